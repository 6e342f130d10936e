"""The sensors of a run: what a `Trajectory` and a `Reading` of one state have in common."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ngalpha_pin.results.events import Event
from ngalpha_pin.results.parts import by_parts
from ngalpha_pin.results.sensors import centre_of_mass, contact_force, frame_motion, joint_reaction, pair_events
from ngalpha_pin.results.sensors.bodies import pairs_of
from ngalpha_pin.results.sensors.centre_of_mass import CentreOfMass
from ngalpha_pin.results.sensors.contact_force import PairWrenches
from ngalpha_pin.results.sensors.frame_motion import FrameMotion, Imu
from ngalpha_pin.results.sensors.wrench_at import WrenchAt

COMPUTED = ("pair_wrenches", "joint_wrenches")


class Sensors:
    """What sensors would have shown, from the stored arrays; a pair is named as "foot/ground"."""

    @property
    def _run(self) -> Any:
        """The run itself."""
        return self

    @cached_property
    def pair_wrenches(self) -> PairWrenches:
        """Forces of the contacts by pair, computed at the first request."""
        return contact_force.pair_wrenches(self._run)

    @cached_property
    def joint_wrenches(self) -> np.ndarray:
        """What every joint carries, computed at the first request; see `joint_reaction`."""
        return joint_reaction.joint_wrenches(self._run)

    @property
    def contact_pairs(self) -> tuple[str, ...]:
        """Names of the pairs of geometries that have columns."""
        return pairs_of(self._run.system, self._run.contact_columns).names

    @property
    def pair_events(self) -> list[Event]:
        """Events by pair in the order of time, not by corner: "lands", "leaves", "impact", "slips" and "sticks".

        With rolling resistance also "rolls" and "rests".

        A pair lands with its first corner and leaves with its last one; it slips while any corner does.
        """
        run = self._run
        if run.parts:
            every = [*run.changes, *(event for part in run.parts for event in part.pair_events)]
            return sorted(every, key=lambda event: event.t)
        return pair_events.pair_events(run)

    def contact_force(self, body: str, other: str | None = None, mean: bool = False) -> WrenchAt:
        """Force and moment of contacts on a body, summed over all points.

        Args:
            body: a pair such as "foot/ground", for the force on the first of the two; or the name of a joint (all that
                moves with it), of a link (what is attached to it), of a geometry, or a pattern of some. Between two
                bodies of a pattern action and reaction cancel: "*" is the ground as well, and feels nothing.
            other: only what this body does to it.
            mean: the mean over the step that ends there, impacts included; otherwise the force at the recorded time,
                without percussions. Of a method with percussions alone it is always the mean.

        Returns:
            A wrench in the axes of the world: `.force` [N], `.moment` [N m] about `.point`, which is the origin of the
            world, each of shape (n + 1, 3); `.about(point)` is the same about another point.

        Raises:
            UnknownName: nothing has that name.
        """
        return contact_force.contact_force(self._run, body, other, mean)

    def contact_percussion(self, body: str, other: str | None = None) -> WrenchAt:
        """Impulsive part of the contact forces on a body in the step that ends there [N s]; see `contact_force`."""
        return contact_force.contact_percussion(self._run, body, other)

    def contact_point(self, body: str, other: str | None = None) -> np.ndarray:
        """Where the force of contacts acts: the mean of the points, weighted by their normal forces.

        Args:
            body: see `contact_force`.
            other: likewise.

        Returns:
            Shape (n + 1, 3) [m]; NaN where there is no force.
        """
        return contact_force.contact_point(self._run, body, other)

    @by_parts
    def joint_reaction(self, joint: str) -> WrenchAt:
        """Force and moment that a joint exerts on its body, about the origin of the joint, in the axes of the world.

        Along the axes of the joint that is what its motor, springs, friction and limits do. Functions of the
        coordinates that are constraints or forces of the user's own count as acting in the joints. Percussions are
        left out.

        Raises:
            UnknownName: there is no such joint. SceneError: the run is from a file, and has forces or constraints.
        """
        return joint_reaction.joint_reaction(self._run, joint)

    @by_parts
    def frame(self, name: str) -> FrameMotion:
        """Pose, velocity and acceleration of a frame, in the axes of the world.

        Raises:
            UnknownName: there is no such frame.
        """
        return frame_motion.frame_motion(self._run, name)

    @by_parts
    def imu(self, frame: str) -> Imu:
        """What an inertial measurement unit in a frame shows, in the axes of the frame.

        Raises:
            UnknownName: there is no such frame.
        """
        return frame_motion.imu(self._run, frame)

    @by_parts
    def centre_of_mass(self, body: str | None = None) -> CentreOfMass:
        """Motion of the centre of mass of everything, or of a body and what hangs on it.

        Raises:
            UnknownName: there is no such body. SceneError: it has no mass, or the scene has beams.
        """
        return centre_of_mass.centre_of_mass(self._run, body)

    def zmp(self, surface: str | None = None) -> np.ndarray:
        """The point of a plane about which the contact forces on it have no moment along the plane.

        Args:
            surface: name of a plane that is fixed to the world; None is the only one with contacts.

        Returns:
            Shape (n + 1, 3) [m]; NaN where nothing presses on the plane.

        Raises:
            SceneError: it is no such plane, or there are several.
        """
        return centre_of_mass.zero_moment_point(self._run, surface)
