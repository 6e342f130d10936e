"""The velocity of a surface along itself: belts, turntables, drums and tracks whose body stays where it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicHermiteSpline

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.numerics.finite_differences import two_derivatives
from ngalpha_pin.scene.breakpoints import as_polynomials, checked_breakpoints, knots, room_around
from ngalpha_pin.scene.user_function import TIME_STEP, array_of, called

NAME = "surface_velocity: speed"


@dataclass(frozen=True)
class SurfaceVelocity:
    """The material at the point x of a surface moves with speed(t) (linear + angular x (x - centre)).

    Only what is tangential of it counts, in the slip of friction: no gap feels it. Everything is in the axes of the
    geometry that has the surface, and turns and moves with it.

    Attributes:
        linear: of a belt or the ground side of a track, shape (3,) [m/s].
        angular: of a turntable, a roller or a drum, shape (3,) [rad/s].
        centre: a point of the axis of `angular`, shape (3,) [m].
        speed: factor [-]: a number, or a function of time that gives it, or it and its rate, or a spline of
            scipy.interpolate.
        breakpoints: times at which `speed` jumps or has a kink, increasing [s]; those of a spline are known, and others
            are looked for where none are given.
    """

    linear: tuple[float, ...] = (0.0, 0.0, 0.0)
    angular: tuple[float, ...] = (0.0, 0.0, 0.0)
    centre: tuple[float, ...] = (0.0, 0.0, 0.0)
    speed: float | Callable[[float], Any] = 1.0
    breakpoints: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check shapes, so that a wrong number is reported where it was written."""
        for name in ("linear", "angular", "centre"):
            vector = checks.vector(f"surface_velocity: {name}", getattr(self, name))
            object.__setattr__(self, name, tuple(vector.tolist()))
        times = checked_breakpoints(NAME, self.breakpoints)
        object.__setattr__(self, "breakpoints", tuple(times.tolist()))
        if not callable(self.speed):
            object.__setattr__(self, "speed", checks.number(NAME, self.speed))
        elif not isinstance(self.speed, partial):  # that of a file
            rates_of(self.speed, times)

    @property
    def curve(self) -> Any:
        """The function of time, or None where the speed is constant or a spline."""
        return self.speed if callable(self.speed) and not hasattr(self.speed, "derivative") else None

    @property
    def declared_breakpoints(self) -> np.ndarray:
        """Those that are given, and the knots of a spline at which it is not smooth, shape (n,) [s]."""
        return np.union1d(self.breakpoints, knots(self.speed))

    def sample(self, t: float) -> np.ndarray:
        """What the function of time gives, as one vector."""
        assert callable(self.speed)
        return np.ravel(np.asarray(called(NAME, self.speed, t), dtype=float))

    @property
    def twist(self) -> np.ndarray:
        """Velocity at the origin of the geometry and angular velocity, for a speed of one, shape (6,)."""
        linear, angular, centre = (np.array(x) for x in (self.linear, self.angular, self.centre))
        return np.concatenate((linear - np.cross(angular, centre), angular))

    def law(self) -> Callable[[float], tuple[float, float]]:
        """The speed and its rate [-], [1/s], by time."""
        if callable(self.speed):
            return rates_of(self.speed, np.array(self.breakpoints))
        always = (self.speed, 0.0)
        return lambda t: always


class MovingSurface(NamedTuple):
    """The surface of one contact that moves.

    Attributes:
        on_b: it is that of the body of the contact point, not that of the surface which the point touches.
        twist: for a speed of one, in the frame of the joint that carries it, linear first, shape (6,).
        speed: its factor and the rate of that, by time.
        own: what stands for the same function wherever it is used.
    """

    on_b: bool
    twist: np.ndarray
    speed: Callable[[float], tuple[float, float]]
    own: object


def moving_surface(velocity: SurfaceVelocity | None, geometry: pin.GeometryObject, on_b: bool) -> MovingSurface | None:
    """The moving surface of a geometry as its joint has it; `on_b` as in `MovingSurface`."""
    if velocity is None:
        return None
    placed = geometry.placement.act(pin.Motion(velocity.twist))
    return MovingSurface(on_b, np.array(placed.vector), velocity.law(), velocity)


def surface_velocity(given: SurfaceVelocity | Sequence[float] | None) -> SurfaceVelocity | None:
    """What `add_contact` has been given: a vector is the velocity of a belt."""
    if given is None or isinstance(given, SurfaceVelocity):
        return given
    if callable(given):
        raise SceneError(
            "surface_velocity is a function: give its direction too, as in SurfaceVelocity(linear=(1, 0, 0), speed=f)"
        )
    return SurfaceVelocity(tuple(checks.vector("surface_velocity", given).tolist()))


def to_plain(velocity: SurfaceVelocity | None, times: np.ndarray | None) -> dict[str, Any] | None:
    """A surface velocity as a file or a pickle holds it, from which `from_plain` makes it again.

    Args:
        velocity: what was declared.
        times: a function of time is put down as its values and rates at these, shape (n,) [s]; None keeps it.
    """
    if velocity is None:
        return None
    plain = {name: getattr(velocity, name) for name in ("linear", "angular", "centre", "speed", "breakpoints")}
    if callable(velocity.speed) and times is not None:
        law = velocity.law()
        plain["speed"] = [[float(t), *law(float(t))] for t in times]
    return plain


def from_plain(plain: dict[str, Any] | None) -> SurfaceVelocity | None:
    """The inverse of `to_plain`."""
    if plain is None:
        return None
    speed = plain["speed"]
    speed = partial(_between, np.array(speed).T) if isinstance(speed, list) else speed
    return SurfaceVelocity(**{**plain, "speed": speed})


def _between(known: np.ndarray, t: float) -> np.ndarray:
    """Value and rate of a function, of which times, values and rates are known, by the cubic between two of them."""
    times = known[0]
    if not times[0] <= t <= times[-1]:
        raise SceneError(
            f"{NAME}: a file keeps it at the times of its run, t = {t:g} s is beyond them; declare the contact again"
        )
    i = min(max(int(np.searchsorted(times, t, side="right")) - 1, 0), max(len(times) - 2, 0))
    if len(times) == 1 or times[i] == t:
        return known[1:, i]
    cubic = CubicHermiteSpline(times[i : i + 2], known[1, i : i + 2], known[2, i : i + 2])
    return np.array([cubic(t), cubic(t, 1)])


def rates_of(speed: Callable[[float], Any], breakpoints: np.ndarray) -> Callable[[float], tuple[float, float]]:
    """A function of time that gives (value, rate), from what the user has; see `SurfaceVelocity.speed`."""
    speed = as_polynomials(speed)
    if hasattr(speed, "derivative"):
        first = speed.derivative(1)
        return lambda t: (_number(speed(t), t), _number(first(t), t))
    shape = (2,) if isinstance(speed, partial) else np.shape(called(NAME, speed, 0.0))
    if shape == (2,):

        def given(t: float) -> tuple[float, float]:
            value, rate = array_of(NAME, called(NAME, speed, t), t, (2,))
            return float(value), float(rate)

        return given
    if shape not in ((), (1,)):
        raise SceneError(f"{NAME}: the function of time must give a number, or it and its rate, not shape {shape}")

    def by_differences(t: float) -> tuple[float, float]:
        def value(s: float) -> np.ndarray:
            return array_of(NAME, called(NAME, speed, t + s), t + s, (1,))

        found = two_derivatives(value, TIME_STEP, room_around(t, breakpoints))
        return float(found[0][0]), float(found[1][0])

    return by_differences


def _number(value: Any, t: float) -> float:
    return float(array_of(NAME, value, t, (1,))[0])
