"""A state carried from one scene to another: what both have in common, by name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ngalpha_pin.collision.manifold import SLOTS
from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.initial import check_start, consistent_state
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.extra_states import starting
from ngalpha_pin.system.names import Names, differences, names_of
from ngalpha_pin.system.sampling import begun, sampled_shape, with_samples
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System


class Places(NamedTuple):
    """Where the numbers of system a are in system b, -1 for what b has not.

    Attributes:
        contacts: shape (n_a,).
        constraints: rows, shape (b_a,).
        friction: joints with dry friction, shape (f_a,).
        slots: places of the features of pairs, shape (slots_a,).
    """

    contacts: np.ndarray
    constraints: np.ndarray
    friction: np.ndarray
    slots: np.ndarray


def places(a: System, b: System) -> Places:
    """Where to find in one system what another one has."""
    mine, theirs = names_of(a), names_of(b)
    pairs = places_of([pair.name for pair in a.slots.pairs], [pair.name for pair in b.slots.pairs])
    slots = np.where(pairs < 0, -1, SLOTS * pairs)[:, None] + np.where(pairs < 0, 0, 1)[:, None] * np.arange(SLOTS)
    contacts, constraints, friction = (places_of(x, y) for x, y in zip(mine[1:], theirs[1:], strict=True))
    return Places(contacts, constraints, friction, slots.reshape(-1))


def places_of(a: Sequence[str], b: Sequence[str]) -> np.ndarray:
    """Number in b of every name in a, -1 where it has none; rows of one name keep their order, shape (len(a),)."""
    known = {key: i for i, key in enumerate(_numbered(b))}
    return np.array([known.get(key, -1) for key in _numbered(a)], dtype=int)


def _numbered(names: Sequence[str]) -> list[tuple[str, int]]:
    """Every name with how many of it came before."""
    seen: Counter[str] = Counter()
    found = []
    for name in names:
        found.append((name, seen[name]))
        seen[name] += 1
    return found


def transfer(state: State, scene_a: Scene, scene_b: Scene) -> State:
    """A state of one scene as a start in another one: what both have in common, by name.

    Joints keep their position and velocity, contacts what is known of them, sampled controls what they hold where both
    scenes have the same number of them. Joints that are new are at their neutral position at rest. Accelerations and
    forces are those of the new scene.

    Args:
        state: of scene a.
        scene_a: the scene it belongs to.
        scene_b: where it is to go on.

    Raises:
        SceneError: the state does not belong to scene a, a joint of one name has other coordinates in the two scenes,
            or the new scene's constraints are not fulfilled. Penetration: shapes of the new scene overlap.
    """
    checks.instance("state", state, State, "a State such as trajectory.final_state")
    a, b = (System(checks.instance(f"scene_{x}", s, Scene)) for x, s in (("a", scene_a), ("b", scene_b)))
    said = differences(Names(*state.names), names_of(a)) if state.names else ""
    if said or state.q.shape != (a.nq,):
        raise SceneError(f"transfer: the state does not belong to scene_a: {said or f'q has shape {state.q.shape}'}")
    q, v = motion_in(a, b, state.t, state.q, state.v)
    check_start(b, state.t, q, v)
    return arrived(b, state, q, v)


def arrived(system: System, state: State, q: np.ndarray, v: np.ndarray) -> State:
    """A start at a motion at the time of a state, with forces of the system.

    Args:
        system: where it goes on; its slots hold the features there.
        state: of another system, whose time and samples are kept.
        q: configuration, shape (nq,).
        v: velocity, shape (nv,).
    """
    found = consistent_state(system, state.t, q, v)
    if system.samplers:
        held = replace(found, sampled=state.sampled)
        if state.sampled.shape != sampled_shape(system):
            held = with_samples(system, begun(system, found), state.t)
        else:
            held = with_samples(system, held, -np.inf)
        found = replace(consistent_state(system, state.t, q, v, held.actuation), sampled=held.sampled)
    return replace(found, names=names_of(system))


def motion_in(a: System, b: System, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The coordinates of b where those of a are (q, v) at t.

    Raises:
        SceneError: a joint or beam has another number of coordinates.
    """
    clock = b.unilaterals is not None
    n = b.nv - sum(state.n for state in b.scene.states) - clock
    q_b, v_b = starting(b.scene.states, b.scene.q_ref, np.zeros(n), clock, t)
    mine, theirs = _coordinates(a), _coordinates(b)
    for name, (of_q, of_v) in mine.items():
        if name not in theirs:
            continue
        to_q, to_v = theirs[name]
        if (of_q.stop - of_q.start, of_v.stop - of_v.start) != (to_q.stop - to_q.start, to_v.stop - to_v.start):
            raise SceneError(f"transfer: {name!r} has other coordinates in the two scenes")
        q_b[to_q], v_b[to_v] = q[of_q], v[of_v]
    return q_b, v_b


def _coordinates(system: System) -> dict[str, tuple[slice, slice]]:
    """Where every joint and beam stands in q and v."""
    model, found = system.tree if system.scene.beams else system.model, {}
    for j in range(1, model.njoints):
        i, k = model.idx_qs[j], model.idx_vs[j]
        found[model.names[j]] = slice(i, i + model.nqs[j]), slice(k, k + model.nvs[j])
    for name, beam in system.scene.beams.items():
        place = system.scene.slices[beam]
        found[name] = place.q, place.v
    return found
