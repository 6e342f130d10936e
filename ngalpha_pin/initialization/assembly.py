"""Assembly: from a rough q0 to one that closes all loops with contacts open, and to a v0 that fits it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.common.tolerances import ASSEMBLED, TINY
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.initialization.initial import checked_values
from ngalpha_pin.numerics.gauss_seidel import FreeProblem
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.system import System

MAX_ROUNDS = 200  # of steps of at most `LONGEST`: sixty lengths or ten turns
PATIENCE = 12  # rounds in which the error may stay above half of the smallest one so far
LONGEST = 0.3  # step of one round in any coordinate [rad or m]
MET = 1e-9  # rate of a constraint, in parts of the speeds of the scene, that is none: linear equations leave 1e-13


@dataclass(frozen=True)
class Assembly:
    """Values that fulfil the constraints, and what it took.

    Attributes:
        q, v: configuration and velocity, shapes (nq,) and (nv,).
        moved: largest change of a coordinate of each joint that had to move [rad or m].
        v_changed: the same of its velocity [rad/s or m/s].
        rounds: Gauss-Newton rounds.
    """

    q: np.ndarray
    v: np.ndarray
    moved: dict[str, float]
    v_changed: dict[str, float]
    rounds: int

    def __str__(self) -> str:
        parts = [f"assembled in {self.rounds} rounds"]
        for what, unit, changes in (("moved", "", self.moved), ("velocity changed", "/s", self.v_changed)):
            listed = ", ".join(f"{name} by {size:.3g}{unit}" for name, size in changes.items())
            parts.append(f"{what}: {listed or 'nothing'}")
        return "; ".join(parts)


def assemble(
    scene: Scene, q0: np.ndarray, v0: np.ndarray | None = None, t0: float = 0.0, hold: Sequence[str] = ()
) -> Assembly:
    """Find q with g(t0, q) = 0 and open contacts near q0, and v with g_dot = 0 and gamma = 0 near v0.

    Steps are the smallest in kinetic energy; so is the change of the velocity.

    Args:
        scene: what is to be assembled.
        q0: rough configuration, shape (nq,).
        v0: rough velocity, shape (nv,); None is rest.
        t0: time [s].
        hold: joints that keep their value, e.g. the crank.

    Raises:
        SceneError: the constraints cannot be reached or contradict each other; the message names the worst.
        UnknownName: `hold` names a joint that is not there.
    """
    system = System(checks.instance("scene", scene, Scene))
    q, v = checked_values(system, q0, v0)
    t0 = checks.number("t0", t0)
    free = _free(system, hold)
    start = q
    q, rounds = _closed(system, t0, q, free)
    v_new = _project(system, t0, q, v, free)
    return Assembly(
        q,
        v_new,
        _by_joint(system, system.difference(start, q)),
        _by_joint(system, v_new - v),
        rounds,
    )


def _closed(system: System, t: float, q: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, int]:
    """The configuration and the number of rounds.

    Where the error stays as it is, e.g. with rods that lie in one line, a small random displacement helps on.

    Raises:
        SceneError: there is none.
    """
    rng = np.random.default_rng(0)
    best, worst, waited = np.inf, "", 0
    for rounds in range(MAX_ROUNDS):
        error, rows, names, unit = _open(system, t, q)
        size = float(np.abs(error).max(initial=0.0))
        if size <= ASSEMBLED * unit:
            return q, rounds
        waited = 0 if size < best / 2 else waited + 1
        if size < best:
            best, worst = size, names[int(np.argmax(np.abs(error)))]
        if waited == PATIENCE:
            waited, dq = 0, LONGEST * free * rng.uniform(-1.0, 1.0, len(free))
        else:
            dq = _smallest(system, q, rows, error, free)
        q = system.integrate(q, dq * min(1.0, LONGEST / max(float(np.abs(dq).max()), TINY)))
    raise SceneError(
        f"cannot assemble: {worst!r} stays off by {best:.3g}; it contradicts the other constraints, is out of reach, "
        "or q0 is too far away"
    )


def _free(system: System, hold: Sequence[str]) -> np.ndarray:
    """Coordinates that may move, shape (nv,)."""
    model, free = system.tree, np.ones(system.nv, dtype=bool)
    if isinstance(hold, str) or not isinstance(hold, Collection):
        raise checks.fail("hold", hold, "a list of names of joints")
    for name in checks.instances("hold: joint", hold, str, "the name of a joint"):
        if not model.existJointName(checks.name("hold: joint", name)):
            raise UnknownName("joint", name, list(model.names)[1:])
        joint = model.getJointId(name)
        free[model.idx_vs[joint] : model.idx_vs[joint] + model.nvs[joint]] = False
    return free


def _open(system: System, t: float, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[str], float]:
    """What is to vanish: g with its still rows, and penetrations; their rows, their names, the unit of length."""
    still, table = np.zeros(system.nv), system.contacts
    system.dynamics(t, q, still, still)
    names: list[str] = []
    errors, rows, unit = [np.zeros(0)], [np.zeros((0, system.nv))], table.length
    if system.constraints.names:
        found = system.constraint_rows(t, q, still, still)
        g, W_g = found.whole(system.motion(still, still))
        errors.append(g)
        rows.append(system.coordinate_rows(W_g))
        names += system.constraints.names_of_every_g
        unit = max(unit, found.sizes[0])
    if table.n:
        gaps = system.gaps(table.subset(np.arange(table.n)), q)
        deep = table.subset(np.flatnonzero(gaps < 0.0))
        if deep.k:
            contact = system.contact_rows(deep, q, still, still, 0.0)
            errors.append(contact.g_N)
            rows.append(system.coordinate_rows(contact.W[: deep.k]))
            names += [table.names[i] for i in deep.index]
    return np.concatenate(errors), np.concatenate(rows), names, unit


def _smallest(system: System, q: np.ndarray, W: np.ndarray, error: np.ndarray, free: np.ndarray) -> np.ndarray:
    """The smallest step in kinetic energy with W dq = -error, shape (nv,)."""
    M = system.mass_matrix(q)
    dq = np.zeros(len(free))
    by_M = np.linalg.solve(M[np.ix_(free, free)], W[:, free].T)
    dq[free] = by_M @ FreeProblem(W[:, free] @ by_M, error, 0).constraint_forces(np.zeros(0))
    return dq


def _project(system: System, t: float, q: np.ndarray, v: np.ndarray, free: np.ndarray) -> np.ndarray:
    """The velocity nearest to v in kinetic energy that fulfils the constraints.

    Raises:
        SceneError: there is none.
    """
    if not system.constraints.names:
        return v
    still = np.zeros(system.nv)
    system.dynamics(t, q, v, still)
    rows = system.constraint_rows(t, q, v, still)
    v = v + _smallest(system, q, system.directions([rows]), rows.rate, free)
    system.dynamics(t, q, v, still)
    rows = system.constraint_rows(t, q, v, still)
    speed = max(1.0, rows.sizes[1])
    worst = int(np.argmax(np.abs(rows.rate)))
    if abs(rows.rate[worst]) > MET * speed:
        raise SceneError(
            f"no velocity fulfils {system.constraints.names[worst]!r} together with the other constraints: "
            f"its rate stays at {abs(rows.rate[worst]):.3g}"
        )
    return v


def _by_joint(system: System, change: np.ndarray) -> dict[str, float]:
    """Largest change of each joint and beam that changed, by name."""
    model, scene = system.tree, system.scene
    places = {model.names[j]: slice(model.idx_vs[j], model.idx_vs[j] + model.nvs[j]) for j in range(1, model.njoints)}
    places |= {name: scene.slices[beam].v for name, beam in scene.beams.items()}
    sizes = {name: float(np.abs(change[place]).max(initial=0.0)) for name, place in places.items()}
    return {name: size for name, size in sizes.items() if size > ASSEMBLED}
