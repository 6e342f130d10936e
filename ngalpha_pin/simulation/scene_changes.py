"""Changes of a scene while it runs: welds, contacts, constraints, forces, gravity, locks of joints.

A change is a moment between two steps. Where a constraint that is new meets a velocity, an impact takes it away: the
laws of `impact_law` with the constraints of the new scene, M (v+ - v-) = W P + W_b P_b and W_b^T v+ = 0, so that the
momentum of what is tied together is kept. Accelerations and forces are then those of the new scene.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import NotConverged, SceneError, UnknownName
from ngalpha_pin.initialization.initial import NEAR, check_start
from ngalpha_pin.initialization.transfer import arrived
from ngalpha_pin.integrators.breakpoints import velocity_jumps
from ngalpha_pin.integrators.impact_law import impact
from ngalpha_pin.results.events import Event
from ngalpha_pin.scene.breakpoints import declared
from ngalpha_pin.scene.constraints import Constraint, JointCoupling, Weld, place_of
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.simulation.inputs import checked_state
from ngalpha_pin.simulation.record import Record
from ngalpha_pin.simulation.variants import Changes, switchable, variant, weld_here
from ngalpha_pin.system.contact_search import load_slots
from ngalpha_pin.system.state import Impact, State
from ngalpha_pin.system.system import System


class SceneChanges:
    """The part of a `Simulator` that changes its scene.

    Every change takes the state at which it happens, by default the one that the simulator has made last, and returns
    the state with which to go on: that of before belongs to the scene of before.

    Attributes:
        scene: as it is now; it serves `simulate(scene, state=...)`.
        system: that scene, compiled.
    """

    scene: Scene
    system: System
    _declared: Scene
    _known: State | None
    _record: Record | None
    _breakpoints: np.ndarray
    _changes = Changes()

    def _alone(self) -> AbstractContextManager[None]:
        raise NotImplementedError

    def weld(self, frame_a: str, frame_b: str, state: State | None = None, name: str | None = None) -> State:
        """Tie two frames together as they are, with a plastic impact where they move against each other.

        Contacts between the two bodies are left out until the release.

        Args:
            frame_a: name of a frame, joint or link, or "world".
            frame_b: the same for the other side.
            state: where it happens.
            name: of the weld, for `release`; by default "Weld frame_a-frame_b".

        Returns:
            The state after it.

        Raises:
            SceneError: the frames are on one body, or the name is taken. UnknownName: there is no such frame.
            NotConverged: the impact has no solution.
        """
        with self._alone():
            state = self._checked(state)
            places = tuple(place_of(self.scene, checks.name("weld: frame", frame)) for frame in (frame_a, frame_b))
            self.system.place(state.q)
            weld = weld_here(self.scene, self.system.poses, (frame_a, frame_b), places, name)
            return self._tie(state, weld, "weld")

    def lock(self, joint: str, state: State | None = None) -> State:
        """Hold a joint where it is, with an impact where it moves; `unlock` lets it go.

        Raises:
            UnknownName: there is no such joint. SceneError: it is locked already.
        """
        model = self.scene.model
        if not model.existJointName(checks.name("joint", joint)) or joint == model.names[0]:
            raise UnknownName("joint", joint, list(model.names)[1:])
        with self._alone():
            state, j = self._checked(state), model.getJointId(joint)
            if model.nvs[j] == 1:
                at = model.idx_qs[j]
                q = np.arctan2(state.q[at + 1], state.q[at]) if model.nqs[j] == 2 else state.q[at]
                held: Constraint = JointCoupling(joint, {}, (float(q),), name=_lock(joint))
            else:
                parent = model.parents[j]
                frames = "world" if parent == 0 else model.names[parent], joint
                places = tuple(place_of(self.scene, frame) for frame in frames)
                self.system.place(state.q)
                held = weld_here(self.scene, self.system.poses, frames, places, _lock(joint))
            return self._tie(state, held, "lock")

    def unlock(self, joint: str, state: State | None = None) -> State:
        """Let a joint go that `lock` has held; see `release`."""
        return self._let_go(_lock(joint), joint, "unlock", state)

    def release(self, name: str | Weld, state: State | None = None) -> State:
        """Let a weld go.

        Args:
            name: of the weld.
            state: where it happens.

        Returns:
            The state after it.

        Raises:
            UnknownName: there is no such weld.
        """
        own = name.name if isinstance(name, Weld) else checks.name("name of a weld", name)
        return self._let_go(own, own, "release", state)

    def disable(self, name: str, state: State | None = None) -> State:
        """Switch off a contact pair such as "foot/ground", all pairs of a geometry, a constraint or a force.

        Args:
            name: see `names`.
            state: where it happens.

        Returns:
            The state after it.

        Raises:
            UnknownName: there is nothing of that name.
        """
        found = switchable(self._declared, checks.name("disable: name", name))
        off = self._changes.off | set(found)
        return self._go_on(self._checked_alone(state), replace(self._changes, off=off), "disable", name)

    def enable(self, name: str, state: State | None = None) -> State:
        """Switch on what `disable` has switched off.

        Raises:
            UnknownName: there is nothing of that name. SceneError: a constraint is not fulfilled any more.
            Penetration: shapes of a contact overlap.
        """
        found = switchable(self._declared, checks.name("enable: name", name))
        off = self._changes.off - set(found)
        return self._go_on(self._checked_alone(state), replace(self._changes, off=off), "enable", name)

    def gravity(self, acceleration: Any, state: State | None = None) -> State:
        """Another gravity from now on, in place of that of the model and of a `Gravity` of the scene.

        Args:
            acceleration: shape (3,) [m/s^2].
            state: where it happens.

        Returns:
            The state after it.
        """
        given = tuple(checks.vector("gravity: acceleration", acceleration).tolist())
        return self._go_on(self._checked_alone(state), replace(self._changes, gravity=given), "gravity", str(given))

    def _tie(self, state: State, constraint: Constraint, kind: str) -> State:
        """Add a constraint; inside of `_alone`."""
        constraint.check(self.scene)
        taken = {c.name for c in (*self._declared.constraints, *self._changes.added)}
        if constraint.name in taken:
            raise SceneError(f"{kind}: there is a constraint {constraint.name!r} already; give one of them a name")
        added = (*self._changes.added, constraint)
        return self._change(state, replace(self._changes, added=added), kind, constraint.name)

    def _let_go(self, name: str, said: str, kind: str, state: State | None) -> State:
        """Take an added constraint away."""
        known = [constraint.name for constraint in self._changes.added]
        if name not in known:
            raise UnknownName("weld or lock", said, known)
        return self._go_on(self._checked_alone(state), self._changes.without(name), kind, name)

    def _checked_alone(self, state: State | None) -> State:
        with self._alone():
            return self._checked(state)

    def _checked(self, state: State | None) -> State:
        """The state of a change.

        Raises:
            SceneError: there is none, or it does not belong to the scene as it is now.
        """
        if state is None:
            if self._known is None:
                raise SceneError("a change of the scene needs a state: there was none yet, pass state=")
            return self._known
        return checked_state(self.system, state)

    def _go_on(self, state: State, changes: Changes, kind: str, name: str) -> State:
        with self._alone():
            return self._change(state, changes, kind, name)

    def _change(self, state: State, changes: Changes, kind: str, name: str) -> State:
        """Go on in another scene; where something fails, the one of before stays."""
        scene = variant(self._declared, changes)
        system = System(scene)
        # percussions of dependent directions that run away are recognised by their residual
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            after, hit = captured(system, state)
        if self._record is not None:
            self._record.change(system, state, after, hit, Event(state.t, kind, name))
        self.scene, self.system, self._changes, self._known = scene, system, changes, after
        self._breakpoints = declared(scene)
        return after


def captured(system: System, state: State) -> tuple[State, Impact | None]:
    """A state of another scene with the same coordinates in a system, and the impact that its constraints ask for.

    Args:
        system: compiled scene.
        state: its motion.

    Raises:
        SceneError: a constraint is not fulfilled. Penetration: shapes overlap.
        NotConverged: the impact has no solution.
    """
    t, q, v, hit = state.t, state.q, state.v, None
    if system.slots.n:
        load_slots(system, State(t, q, v, v), 0.0, NEAR * system.contacts.length)
    if velocity_jumps(system, t, q, v):
        hit = impact(system, t, q, v)
        if hit is None:
            raise NotConverged(f"the impact of the change at t = {t:g} s has no solution that was found", t)
        v = hit.v_after
    check_start(system, t, q, v)
    return arrived(system, state, q, v), hit


def _lock(joint: str) -> str:
    return f"lock {checks.name('joint', joint)}"
