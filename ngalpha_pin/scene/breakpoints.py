"""Breakpoints: moments at which a given motion, a force or a control jumps or has a kink.

Nothing is smooth across them: steps end there, and accelerations and forces begin anew. They are declared with
`breakpoints=`, read from the knots of a spline of scipy.interpolate, or looked for where nothing is declared: the
function is sampled at many times of the run, and where neighbours do not fit each other between them again, down to the
moment itself. What is shorter than a sample apart can be missed, so that short pulses should be declared.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol, runtime_checkable

import numpy as np
import pinocchio as pin
from scipy.interpolate import BSpline, PPoly

from ngalpha_pin.common import checks
from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.user_function import called

# samples of a run, and of each part that is looked at again
SAMPLES, FINER = 4096, 64
# a second difference that is so many times that of the samples beside it belongs to a jump or a kink
STANDS_OUT = 8.0
# rounding of a function, in parts of its values, and of a time
NOISE, MOMENT = 1e-13, 4 * np.finfo(float).eps
# places that stand out in one function, at most: with more of them it is rough, not broken
MAX_FOUND = 256
# moments that are nearer than this part of the run are one
SAME = 1e-9
# jump of a spline or of its derivatives at a knot, in parts of its largest value, that is none
SMOOTH = 1e-7
# distance from a breakpoint at which what is given is that of one side
SIDE = 64 * np.finfo(float).eps


@runtime_checkable
class TimeDependent(Protocol):
    """A declaration with functions of time.

    Attributes:
        breakpoints: declared ones, increasing [s].
    """

    breakpoints: np.ndarray

    def check(self, scene: Any) -> None:
        """Raise a SceneError if it does not fit the scene."""

    def sample(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """What it gives at a time, at a fixed motion, shape (n,)."""

    @property
    def curve(self) -> Any:
        """The function of time that may be a spline, or None."""


class GivenAngle:
    """The part of a `TimeDependent` whose function of time is `angle`: a number, or (q, v, a)."""

    name: str
    angle: Callable[[float], Any]

    @property
    def curve(self) -> Callable[[float], Any]:
        """The function of time, which may be a spline."""
        return self.angle

    def sample(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """What is given at a time, as one vector."""
        return np.ravel(np.asarray(called(self.name, self.angle, t), dtype=float))


def checked_breakpoints(name: str, given: Sequence[float]) -> np.ndarray:
    """Declared breakpoints, shape (n,) [s].

    Raises:
        SceneError: they are not finite numbers, or do not increase.
    """
    try:
        times = np.array(given, dtype=float)
    except Exception:  # whatever an object does when it is asked for numbers
        times = np.full(1, np.nan)
    if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0.0).any():
        raise SceneError(f"{name}: breakpoints = {checks.shown(given)} must be increasing finite times")
    return times


def side(t: float) -> float:
    """Distance from a breakpoint at which what is given is that of one side [s]."""
    return SIDE * abs(t)


def room_around(t: float, breakpoints: np.ndarray) -> tuple[float, float]:
    """How far it is back and on to where something jumps, from a time on; a moment belongs to what follows it [s]."""
    i = int(np.searchsorted(breakpoints, t, side="right"))
    before, after = breakpoints[:i], breakpoints[i:]
    low = before[-1] + side(before[-1]) - t if len(before) else -np.inf
    high = after[0] - side(after[0]) - t if len(after) else np.inf
    return min(float(low), 0.0), max(float(high), 0.0)


def declared(scene: Any) -> np.ndarray:
    """All breakpoints of a scene that are declared, or knots of splines, increasing, shape (n,) [s]."""
    found = [np.zeros(0)]
    for item in (*scene.forces, *scene.constraints):
        if isinstance(item, TimeDependent):
            found += [item.breakpoints, knots(item.curve)]
    found += [velocity.declared_breakpoints for velocity in _surface_velocities(scene)]
    return np.unique(np.concatenate(found))


def time_functions(scene: Any, q: np.ndarray, v: np.ndarray) -> list[Callable[[float], np.ndarray]]:
    """What is given in a scene as functions of time, each at a fixed motion of shapes (nq,) and (nv,)."""
    found: list[Callable[[float], np.ndarray]] = [partial(item.sample, q=q, v=v) for item in _time_dependent(scene)]
    return found + [velocity.sample for velocity in _surface_velocities(scene) if callable(velocity.speed)]


def completed(scene: Any, start: float, end: float, q: np.ndarray | None = None) -> Any:
    """The scene with the breakpoints of a run; where nothing is declared they are looked for.

    Args:
        scene: it is not changed; the same one comes back where nothing is found.
        start: of the run [s].
        end: of the run [s].
        q: where functions are looked at, shape (nq,) or longer; None is the neutral configuration.
    """
    q, v, changed = pin.neutral(scene.model) if q is None else q[: scene.model.nq], np.zeros(scene.model.nv), {}
    for item in _time_dependent(scene):
        if len(item.breakpoints) or hasattr(item.curve, "derivative"):
            continue

        def value(t: float, item: TimeDependent = item) -> np.ndarray:
            return item.sample(t, q, v)

        times = found_breakpoints(value, start, end)
        if len(times):
            changed[id(item)] = copy.copy(item)
            changed[id(item)].breakpoints = times
            changed[id(item)].check(scene)  # a copy has not met the model yet
    speeds = {}
    for velocity in _surface_velocities(scene):
        if velocity.curve is not None and not velocity.breakpoints and id(velocity) not in speeds:
            times = found_breakpoints(velocity.sample, start, end)
            if len(times):
                speeds[id(velocity)] = replace(velocity, breakpoints=tuple(times.tolist()))
    if not changed and not speeds:
        return scene
    contacts = [
        replace(pair, law=replace(pair.law, surface_velocity=speeds[id(pair.law.surface_velocity)]))
        if id(pair.law.surface_velocity) in speeds else pair
        for pair in scene.contacts
    ]  # fmt: skip
    scene = copy.copy(scene)
    scene.forces, scene.constraints = (
        [changed.get(id(item), item) for item in items] for items in (scene.forces, scene.constraints)
    )
    scene.contacts = contacts
    return scene


def _time_dependent(scene: Any) -> list[TimeDependent]:
    """What may change with time: not a force that stores energy, which is a function of the configuration."""
    items = (item for item in (*scene.forces, *scene.constraints) if isinstance(item, TimeDependent))
    return [item for item in items if getattr(item, "energy", None) is None]


def _surface_velocities(scene: Any) -> list[Any]:
    """Of all contacts of a scene whose surface moves along itself (see `SurfaceVelocity`)."""
    return [pair.law.surface_velocity for pair in scene.contacts if pair.law.surface_velocity is not None]


def knots(curve: Any) -> np.ndarray:
    """Knots of a spline at which it or one of its first two derivatives jumps, shape (n,) [s]."""
    curve = as_polynomials(curve)
    if not isinstance(curve, PPoly):
        return np.zeros(0)
    inner, jumps = np.asarray(curve.x[1:-1]), np.zeros(len(curve.x) - 2, dtype=bool)
    for order in range(3):
        derivative = curve.derivative(order) if order else curve
        left, right = derivative(inner - SIDE * np.abs(inner)), derivative(inner)
        jump = np.abs(right - left).reshape(len(inner), -1)
        jumps |= (jump > SMOOTH * max(float(np.abs(derivative(curve.x)).max(initial=0.0)), TINY)).any(axis=1)
    return inner[jumps]


def as_polynomials(curve: Any) -> Any:
    """A spline as polynomials between its knots, which has derivatives of any order; anything else as it is."""
    if not isinstance(curve, BSpline):
        return curve
    columns = curve.c.reshape(len(curve.c), -1).T
    parts = [PPoly.from_spline(BSpline(curve.t, column, curve.k)) for column in columns]
    c = np.stack([part.c for part in parts], axis=-1).reshape(parts[0].c.shape + curve.c.shape[1:])
    return PPoly(c, parts[0].x)


def found_breakpoints(function: Callable[[float], np.ndarray], start: float, end: float) -> np.ndarray:
    """Moments between two times at which a function jumps or has a kink, shape (n,) [s]."""
    jumps: list[float] = []
    kinks: list[float] = []
    noise: np.ndarray | None = None
    parts = [(start, end, SAMPLES)]
    while parts:
        low, high, n = parts.pop()
        t = np.linspace(low, high, n + 1)
        values = np.array([np.ravel(function(float(s))) for s in t])
        if noise is None:
            noise = NOISE * np.abs(values).max(axis=0)
        if high - low <= MOMENT * max(abs(low), abs(high)) * n:
            jumps.append(float(t[1 + int(np.argmax(np.abs(np.diff(values, axis=0)).max(axis=1)))]))
            continue
        places = _standing_out(values, noise)
        if not len(places):
            if n == FINER and _is_kink(values, noise):
                kinks.append(_corner(t, values))
            continue
        groups = np.split(places, np.flatnonzero(np.diff(places) > 2) + 1)
        if len(groups) > MAX_FOUND:
            return np.zeros(0)
        parts += [(float(t[group[0]]), float(t[group[-1] + 2]), FINER) for group in groups]
    return _merged(jumps, kinks, start, end)


def _merged(jumps: list[float], kinks: list[float], start: float, end: float) -> np.ndarray:
    """Each moment once, though samples on both sides of it have led there: from a jump, which shows to the last bit."""
    times, exact = np.array(jumps + kinks), np.arange(len(jumps) + len(kinks)) < len(jumps)
    order = np.argsort(times)
    times, exact = times[order], exact[order]
    groups = np.split(np.arange(len(times)), np.flatnonzero(np.diff(times) > SAME * (end - start)) + 1)
    chosen = [group[exact[group]] if exact[group].any() else group for group in groups if len(group)]
    merged = np.array([times[group[len(group) // 2]] for group in chosen])
    return merged[(merged > start) & (merged < end)]


def _standing_out(values: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """First of three samples in a row whose second difference is far above that of others near them."""
    second = np.abs(np.diff(values, 2, axis=0))
    beside = np.pad(second, ((3, 3), (0, 0)), mode="edge")
    others = np.maximum(beside[:-6], beside[6:])
    return np.flatnonzero((second > STANDS_OUT * others + 1e2 * noise).any(axis=1))


def _is_kink(values: np.ndarray, noise: np.ndarray) -> bool:
    """Whether two straight lines meet in a part that is so short that rounding hides where."""
    n = len(values) // 4
    bend = np.abs((values[-1] - values[-1 - n]) - (values[n] - values[0]))
    m = n // 2
    curved = np.abs(values[n] - 2 * values[m] + values[0])
    curved += np.abs(values[-1] - 2 * values[-1 - m] + values[-1 - n])
    return bool(((bend > 1e2 * noise) & (curved < 0.1 * bend)).any())


def _corner(t: np.ndarray, values: np.ndarray) -> float:
    """Where the straight lines from both ends of a part meet."""
    n = len(values) // 4
    left, right = (values[n] - values[0]) / (t[n] - t[0]), (values[-1] - values[-1 - n]) / (t[-1] - t[-1 - n])
    i = int(np.argmax(np.abs(right - left)))
    meet = (values[-1, i] - right[i] * (t[-1] - t[0]) - values[0, i]) / (left[i] - right[i])
    return float(np.clip(t[0] + meet, t[0], t[-1]))
