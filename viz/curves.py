"""The curves over time that a plot shows, the same ones for the HTML page and for the figure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from .contacts import friction_coefficients, in_the_world, step_forces
from .pairs import Pairs, busiest, contact_pairs, friction_impulse, pair_gap

if TYPE_CHECKING:
    from ngalpha_pin import Trajectory

SECTIONS = np.linspace(0.0, 1.0, 5)  # places of beams whose section forces are drawn over time
MAX_PAIRS = 7  # of geometries with curves of their own; the others are one curve
MAX_LIMITS = 8  # of joints with curves
ROUNDED = 1e-9  # a component of a friction force below this part of it is rounding


@dataclass(frozen=True)
class Curve:
    """One line of a panel.

    Attributes:
        label: its name in the legend.
        y: values in the panel's unit, shape (n + 1,).
        bound: draw the band between -bound and bound behind it, shape (n + 1,), or None.
        group: curves of one group are shown together, one group at a time; "" is always shown.
    """

    label: str
    y: np.ndarray
    bound: np.ndarray | None = None
    group: str = ""


@dataclass(frozen=True)
class Panel:
    """A set of axes.

    Attributes:
        key: short name for options.
        title: what is shown.
        unit: of the values.
        curves: its lines.
    """

    key: str
    title: str
    unit: str
    curves: list[Curve]


def panels(trajectory: Trajectory) -> list[Panel]:
    """Every panel that has something to show, in the order of the page."""
    limits = touched_limits(trajectory)
    g_N = trajectory.g_N
    names = trajectory.contact_names
    la_N = step_forces(trajectory)[0]
    energy = trajectory.energy
    energies = {"total": energy.total, "kinetic": energy.kinetic, "potential": energy.potential}
    if np.any(energy.elastic):
        energies["elastic"] = energy.elastic
    found = [
        *_contacts(trajectory, la_N),
        Panel("energy", "Energy", "J", [Curve(name, y) for name, y in energies.items()]),
        Panel("angle", "Joint angles", "rad", list(_coordinates(trajectory, "rad"))),
        Panel("position", "Positions", "m", list(_coordinates(trajectory, "m"))),
        Panel("rate", "Angular velocities", "rad/s", list(_velocities(trajectory, "rad/s"))),
        Panel("speed", "Velocities", "m/s", list(_velocities(trajectory, "m/s"))),
        Panel("limit", "Distance to limits of joints", "rad, m", [Curve(names[k], g_N[:, k]) for k in limits]),
        Panel("limit force", "Force of limits of joints", "N m, N", [Curve(names[k], la_N[:, k]) for k in limits]),
        Panel("constraint", "Forces of constraints", "N, N m", list(_constraints(trajectory))),
        Panel("axial", "Axial force of beams", "N", list(_beams(trajectory, 0))),
        Panel("bending", "Bending moment of beams", "N m", list(_beams(trajectory, 1))),
        Panel("joint friction", "Dry friction of joints", "N m, N", list(_joint_friction(trajectory))),
        Panel("iterations", "Iterations in a step", "", [Curve("iterations", np.asarray(trajectory.n_iter, float))]),
    ]
    return [panel for panel in found if panel.curves]


def _beams(trajectory: Trajectory, which: int) -> Iterator[Curve]:
    """Axial forces (0) or bending moments (1) of the beams at a few places."""
    for name in trajectory.scene.beams:
        values = trajectory.section_forces(name, SECTIONS)[which]
        for xi, y in zip(SECTIONS, values.T, strict=True):
            yield Curve(f"{name} at \N{GREEK SMALL LETTER XI} = {xi:g}", y, group=name)


def _contacts(trajectory: Trajectory, la_N: np.ndarray) -> Iterator[Panel]:
    """Gaps, forces and impulses by pair of geometries: those that carry most, and the others in one curve."""
    pairs, P_N = contact_pairs(trajectory), np.asarray(trajectory.P_N)
    shown = busiest(trajectory, pairs, MAX_PAIRS)
    others = [columns for name, columns in pairs.items() if name not in shown]
    parts = {name: pairs[name] for name in shown}
    of = f" of the {len(shown)} pairs of {len(pairs)} that carry most" if others else ""
    yield Panel("gap", f"Gap{of}", "m", [Curve(name, pair_gap(trajectory, pairs[name])) for name in shown])
    if others:
        parts[f"{len(others)} other pairs together"] = np.concatenate(others)
    for key, title, unit, values in (
        ("force", "Normal force", "N", la_N),
        ("impulse", "Normal impulse in a step", "N s", P_N),
    ):
        yield Panel(key, title, unit, [Curve(name, values[:, k].sum(axis=1)) for name, k in parts.items()])
    title = "Friction impulse in a step (\N{PLUS-MINUS SIGN}\N{GREEK SMALL LETTER MU})"
    yield Panel("friction", title, "N s", list(_friction(trajectory, {name: pairs[name] for name in shown})))


def touched_limits(trajectory: Trajectory) -> list[int]:
    """Limits of joints that carried a force, those that carry most, at most `MAX_LIMITS`, in their own order."""
    load = np.where(in_the_world(trajectory), 0.0, np.sum(trajectory.P_N, axis=0))
    return sorted(k for k in np.argsort(-load, kind="stable")[:MAX_LIMITS].tolist() if load[k] > 0)


def _constraints(trajectory: Trajectory) -> Iterator[Curve]:
    """Multipliers of every constraint, one constraint at a time: those of positions, then those of velocities."""
    columns = np.hstack([trajectory.la_g, trajectory.la_gamma]).T
    seen: Counter[str] = Counter()
    for name, y in zip(trajectory.constraint_names, columns, strict=True):
        seen[name] += 1
        yield Curve(f"row {seen[name]}", y, group=name)


def _joint_friction(trajectory: Trajectory) -> Iterator[Curve]:
    for name, y in zip(trajectory.friction_names, np.asarray(trajectory.tau_f).T, strict=True):
        yield Curve(name, y)


def _friction(trajectory: Trajectory, pairs: Pairs) -> Iterator[Curve]:
    """Components of the friction of every pair along the axes of the world, and its drilling friction."""
    mu = friction_coefficients(trajectory)
    rough = {name: columns for name, columns in pairs.items() if mu[columns[0]] > 0}
    for name, P in friction_impulse(trajectory, rough).items():
        columns = pairs[name]
        bound = mu[columns[0]] * trajectory.P_N[:, columns].sum(axis=1)
        drilling = [r.start + 2 for r in (trajectory.friction_rows[k] for k in columns) if r.stop - r.start > 2]
        least = ROUNDED * float(np.abs(P).max(initial=0.0))
        curves = [(f"along {axis}", y) for axis, y in zip("xyz", P.T, strict=True) if np.abs(y).max() > least]
        if drilling:
            curves.append(("drilling / radius", trajectory.P_F[:, drilling].sum(axis=1)))
        for n, (label, y) in enumerate(curves):
            yield Curve(label, y, bound if n == 0 else None, name)


def _coordinates(trajectory: Trajectory, unit: str) -> Iterator[Curve]:
    """Joint coordinates in rad or m; of a rotation in space the tilt of the joint's z axis."""
    model, q = trajectory.scene.model, np.asarray(trajectory.q)
    for name, kind, own in _joints(model, q, model.idx_qs, model.nqs):
        if kind in ("FreeFlyer", "Translation", "Planar") and unit == "m":
            for axis, y in zip("xyz"[: 2 if kind == "Planar" else 3], own.T, strict=False):
                yield Curve(f"{name} {axis}", y)
        elif kind in ("FreeFlyer", "Spherical") and unit == "rad":
            x, y = own[:, -4], own[:, -3]
            yield Curve(f"{name} tilt", np.arccos(np.clip(1 - 2 * (x**2 + y**2), -1, 1)))
        elif kind.startswith(("RevoluteUnbounded", "RUB")) or kind == "Planar":
            if unit == "rad":
                yield Curve(name, np.unwrap(np.arctan2(own[:, -1], own[:, -2])))
        elif kind not in ("FreeFlyer", "Translation", "Spherical") and unit == _unit(kind):
            for n, y in enumerate(own.T):
                yield Curve(name if own.shape[1] == 1 else f"{name} {n + 1}", y)


def _velocities(trajectory: Trajectory, unit: str) -> Iterator[Curve]:
    """Joint velocities; of a free joint in its own frame, linear before angular."""
    model, v = trajectory.scene.model, np.asarray(trajectory.v)
    for name, kind, own in _joints(model, v, model.idx_vs, model.nvs):
        linear = {"FreeFlyer": 3, "Translation": 3, "Planar": 2}.get(kind, own.shape[1] if _unit(kind) == "m" else 0)
        for n, y in enumerate(own.T):
            if unit == ("m/s" if n < linear else "rad/s"):
                axis = n if n < linear else n - linear + (2 if kind == "Planar" else 0)
                yield Curve(name if own.shape[1] == 1 else f"{name} {'xyz'[axis % 3]}", y)


def _joints(
    model: pin.Model, values: np.ndarray, starts: list[int], sizes: list[int]
) -> Iterator[tuple[str, str, np.ndarray]]:
    """Name, kind without the prefix "JointModel", and the columns of every joint that moves."""
    for j in range(1, model.njoints):
        if sizes[j]:
            kind = model.joints[j].shortname().removeprefix("JointModel")
            yield model.names[j], kind, values[:, starts[j] : starts[j] + sizes[j]]


def _unit(kind: str) -> str:
    return "m" if kind.startswith(("P", "Translation")) and kind != "Planar" else "rad"


def liveliest(curves: list[Curve], most: int) -> list[Curve]:
    """The curves that vary most, in their own order."""
    span = [
        float(np.ptp(curve.y[np.isfinite(curve.y)], axis=0)) if np.isfinite(curve.y).any() else 0.0 for curve in curves
    ]
    kept = sorted(np.argsort(-np.array(span), kind="stable")[:most].tolist())
    return [curves[k] for k in kept]


def thinned(t: np.ndarray, y: np.ndarray, limit: int) -> tuple[np.ndarray, np.ndarray]:
    """A curve of about `limit` points that keeps the extremes, so that a single impact stays visible.

    Args:
        t: times [s], shape (n,).
        y: values, shape (n,).
        limit: number of points.
    """
    n = len(t)
    if n <= limit:
        return t, y
    edges = np.linspace(0, n, limit // 2 + 1).astype(int)
    ends = [0, n - 1]
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        ends += [a + int(np.argmin(y[a:b])), a + int(np.argmax(y[a:b]))]
    keep = np.unique(ends)
    return t[keep], y[keep]
