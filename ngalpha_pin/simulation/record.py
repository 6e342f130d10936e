"""What was stepped by hand, as a trajectory."""

from __future__ import annotations

from ngalpha_pin.errors import SceneError
from ngalpha_pin.integrators.breakpoints import without_percussions
from ngalpha_pin.results.events import Event
from ngalpha_pin.results.recorder import Recorder
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.simulation.variants import with_all_contacts
from ngalpha_pin.step.contact_history import join_percussions
from ngalpha_pin.system.state import Impact, State, StepResult
from ngalpha_pin.system.system import System

BY_HAND = "stepped by hand"


class Record:
    """The steps of a `Simulator`.

    A step from the last state goes on; one from an earlier state since the last change of the scene takes back what
    came after it; one from any other state begins anew.

    Args:
        scene: as declared, with all contacts.
        method, dt: of the steps.
    """

    def __init__(self, scene: Scene, method: str, dt: float):
        self._scene, self._method, self._dt = scene, method, dt
        self._parts: list[Trajectory] = []
        self._changes: list[Event] = []
        self._recorder: Recorder | None = None
        self._given: list[State] = []  # the states as the user has them

    def begin(self, system: System, state: State) -> None:
        """A new run."""
        self._parts, self._changes = [], []
        self._recorder, self._given = Recorder(system, state), [state]

    def add(self, system: System, given: State, start: State, result: StepResult) -> None:
        """A step.

        Args:
            system: compiled scene.
            given: the state that the user has passed.
            start: the same as the step began with it: with the torque that is held.
            result: of the step.
        """
        found = next((i for i in range(len(self._given) - 1, -1, -1) if self._given[i] is given), None)
        if found is None or self._recorder is None:
            self.begin(system, given)
            found = 0
        assert self._recorder is not None
        self._recorder.back_to(found)
        del self._given[found + 1 :]
        if start is not given:  # what is held has changed; the percussions are those of the step before
            start = join_percussions(system, self._recorder.state, without_percussions(start))
            self._recorder.replace_last(start)
        self._recorder.add(result)
        self._given.append(result.state)

    def change(self, system: System, before: State, after: State, hit: Impact | None, event: Event) -> None:
        """The scene has changed at a state."""
        if self._recorder is None or not any(state is before for state in self._given):
            self.begin(system, after)
            return
        i = next(i for i, state in enumerate(self._given) if state is before)
        self._recorder.back_to(i)
        self._parts.append(self._part(self._recorder))
        self._changes.append(event)
        self._recorder, self._given = Recorder(system, after, hit), [after]

    def _part(self, recorder: Recorder) -> Trajectory:
        part = recorder.trajectory(recorder.system.scene, self._method, self._dt, True, BY_HAND)
        vars(part)["system"] = recorder.system
        return part

    def trajectory(self) -> Trajectory:
        """The run so far.

        Raises:
            SceneError: there is none.
        """
        if self._recorder is None:
            raise SceneError("nothing was recorded: begin with initial_state(q0, v0) or step(state)")
        parts = [*self._parts, self._part(self._recorder)]
        return Trajectory.with_changes(parts, with_all_contacts(self._scene), self._changes) if parts[1:] else parts[0]
