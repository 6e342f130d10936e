"""Trajectory: what a run returns. Arrays over time, kinematics of the contacts on request, save and load."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.flexible.cable import Cable, CableForce
from ngalpha_pin.flexible.planar_beam import PlanarBeam, SectionForces
from ngalpha_pin.flexible.rod import Rod, RodSectionForces
from ngalpha_pin.initialization.transfer import places_of
from ngalpha_pin.results import labelled
from ngalpha_pin.results.audit import Audit, audit
from ngalpha_pin.results.energy_balance import Energy, energy
from ngalpha_pin.results.events import Event, find_events
from ngalpha_pin.results.flexible_bodies import section_forces, tubes
from ngalpha_pin.results.impact_audit import ImpactLaws, judge_impacts
from ngalpha_pin.results.joining import check_follows, columns_of, joined_fields, joined_kept, spread
from ngalpha_pin.results.parts import in_line, worst
from ngalpha_pin.results.records import Chosen, Impacts, Kept
from ngalpha_pin.results.replay import ConstraintMotion, Replay, replay
from ngalpha_pin.results.sensors.sensors import COMPUTED, Sensors
from ngalpha_pin.results.summary import summary
from ngalpha_pin.results.trajectory_file import check_sizes, damaged, read, write
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

CONTACT_ARRAYS = ("P_N", "la_N", "La_N", "P_F", "la_F", "La_F")


class ContactMotion(NamedTuple):
    """Kinematics of the contacts along a trajectory.

    Attributes:
        g_N: gaps, shape (n + 1, n_contacts) [m].
        g_N_dot: their rates, shape (n + 1, n_contacts) [m/s].
        gamma_F: slip velocities, shape (n + 1, n_F) [m/s].
        smallest_gap: over all contacts of the scene, those without a column included, shape (n + 1,) [m]; the gaps of
            joint limits in parts of their yardstick, times the length of the scene.
    """

    g_N: np.ndarray
    g_N_dot: np.ndarray
    gamma_F: np.ndarray
    smallest_gap: np.ndarray


@dataclass(eq=False)
class Trajectory(Sensors):
    """A motion over time; time runs along the first axis, n is the number of steps.

    A scene with many contact points (vertices of meshes) has columns for those that carried a force.

    Attributes:
        scene: what was simulated; after `load`, enough of it to draw.
        method, dt: how it was simulated; dt in [s], the mean step where the accuracy was chosen.
        success: t_end was reached; message says why not.
        t, q, v, a: shapes (n + 1,), (n + 1, nq), (n + 1, nv), (n + 1, nv).
        contact_names: one per contact column.
        contact_columns: number of the contact of each column in the scene.
        friction_rows: slice of each contact into the arrays of friction.
        P_N, la_N, La_N: percussion of the step [N s], force [N] and impulsive part [N s], shape (n + 1, n_contacts).
        P_F, la_F, La_F: the same of friction, shape (n + 1, n_F).
        constraint_names: constraint of each row of g and, behind them, of gamma.
        n_g: number of rows of g.
        la_g, La_g: forces [N or N m] and impulsive parts [N s or N m s] of the constraints g, shape (n + 1, n_g).
        la_gamma, La_gamma: the same of the constraints gamma, shape (n + 1, n_gamma).
        friction_names: joints with dry friction.
        adhesion: force with which contacts pull from each time on, beside la_N which presses, shape (n + 1, n_contacts)
            [N].
        tau, tau_step: generalized force that sampled controls hold from each time on, and its mean over the step that
            ends there, shape (n + 1, nv) of the tree; (n + 1, 0) without such controls [N or N m].
        tau_f, P_f: torque of dry friction [N m or N] and its percussion in the step, shape (n + 1, f).
        n_iter: iterations of each step, shape (n + 1,).
        slots, slot_ends: features of the pairs of solids (see `ngalpha_pin.slots`) of all times in one array, and where
            those of each time end, shape (n + 1,).
        solver_path: rung of the solver ladder that solved each step, shape (n + 1,).
        impacts: those that were located within their step.
        chosen: of a run of chosen accuracy, its tolerances, rejected steps and located events; otherwise None.
        final_state: continues the run with `simulate(scene, state=..., t_end=...)`.
        entry: the impact with which the run began, where a change of the scene led to one.
        parts: of a run whose scene changed, what happened between the changes, each with the scene of its own; the
            arrays above are theirs, one after the other, with a column for every contact and constraint of any part.
        changes: of the scene, as events.
        derivatives: by what `simulate(sensitivities=...)` was asked for, see `RunDerivatives`; files have none.
        kept: what a file says of forces and constraints that its scene does not have; None of a run that was computed.
    """

    scene: Scene
    method: str
    dt: float
    success: bool
    message: str
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    contact_names: tuple[str, ...]
    contact_columns: np.ndarray
    friction_rows: tuple[slice, ...]
    P_N: np.ndarray
    la_N: np.ndarray
    La_N: np.ndarray
    P_F: np.ndarray
    la_F: np.ndarray
    La_F: np.ndarray
    constraint_names: tuple[str, ...]
    n_g: int
    la_g: np.ndarray
    La_g: np.ndarray
    la_gamma: np.ndarray
    La_gamma: np.ndarray
    friction_names: tuple[str, ...]
    adhesion: np.ndarray
    tau: np.ndarray
    tau_step: np.ndarray
    tau_f: np.ndarray
    P_f: np.ndarray
    slots: np.ndarray
    slot_ends: np.ndarray
    n_iter: np.ndarray
    solver_path: np.ndarray
    impacts: Impacts
    final_state: State
    chosen: Chosen | None = None
    kept: Kept | None = None
    derivatives: Any = None
    entry: Impacts | None = None
    parts: tuple[Trajectory, ...] = ()
    changes: tuple[Event, ...] = ()

    def __repr__(self) -> str:
        end = "" if self.success else f", stopped: {self.message}"
        name = f"{self.scene.model.name!r}, " if self.scene.model.name else ""
        return (
            f"Trajectory({name}{len(self.t) - 1} steps to t = {self.t[-1]:g} s, "
            f"{len(self.contact_names)} contacts{end})"
        )

    def __getstate__(self) -> dict[str, Any]:
        """For pickle: what was computed from it at a request is computed again."""
        return {name: value for name, value in vars(self).items() if name not in ("system", "replay", *COMPUTED)}

    def _repr_html_(self) -> str:
        """What a notebook shows: what was run, its audit and its events; `viz.embed` shows the motion."""
        return summary(self)

    @cached_property
    def system(self) -> System:
        """The compiled scene, for kinematics along the trajectory."""
        return System(self.scene)

    @property
    def on_velocity_level(self) -> bool:
        """The method asks its laws of the velocities alone, in the middle of a step, as Moreau's does.

        It has percussions and no forces, and its positions are off by what a step moves them.
        """
        return self.method.startswith("MoreauJean")

    @cached_property
    def replay(self) -> Replay:
        """What the scene says along the motion, computed at the first request.

        Raises:
            SceneError: the scene changed; each of the `parts` has its own.
        """
        if self.parts:
            raise SceneError("the scene of this run changed: ask its parts, trajectory.parts[i].replay")
        return replay(self)

    @cached_property
    def contact_motion(self) -> ContactMotion:
        """Gaps and slip velocities, computed from q and v."""
        if self.parts:
            return self._contact_motion_of_parts()
        found, k = self.replay, len(self.contact_columns)
        return ContactMotion(found.g_N, found.rate[:, :k], found.rate[:, k:], found.smallest_gap)

    def _contact_motion_of_parts(self) -> ContactMotion:
        """Gaps and slip velocities of all parts; NaN where a contact is switched off."""
        k, m = len(self.contact_columns), self.P_F.shape[1]
        motions = []
        for part, at in zip(self.parts, columns_of(self.parts, self.contact_names, "contact_names"), strict=True):
            rows = [i for j in at.tolist() for i in range(self.friction_rows[j].start, self.friction_rows[j].stop)]
            of, own = np.array(rows, dtype=int), part.contact_motion
            g_N, g_N_dot = (spread(x, at, k, np.nan) for x in (own.g_N, own.g_N_dot))
            motions.append(ContactMotion(g_N, g_N_dot, spread(own.gamma_F, of, m, np.nan), own.smallest_gap))
        return in_line(motions)

    @cached_property
    def constraint_motion(self) -> ConstraintMotion:
        """How well the constraints are fulfilled, computed from q, v and a."""
        if self.parts:
            return self._constraint_motion_of_parts()
        if self.kept is None and not self.constraint_names:  # nothing that a pass over the run would have to find
            return ConstraintMotion.zero(len(self.t), 0, 0)
        return self.replay.constraints if self.kept is None else self.kept.constraint_motion

    def _constraint_motion_of_parts(self) -> ConstraintMotion:
        """That of all parts; zero where a constraint is not there."""
        g, gamma = self.constraint_names[: self.n_g], self.constraint_names[self.n_g :]
        motions = []
        for part in self.parts:
            own, n = part.constraint_motion, part.n_g
            at_g = places_of(part.constraint_names[:n], g)
            at = np.concatenate((at_g, len(g) + places_of(part.constraint_names[n:], gamma)))
            rate, acceleration = (spread(x, at, len(g + gamma)) for x in (own.rate, own.acceleration))
            motions.append(ConstraintMotion(spread(own.g, at_g, len(g)), rate, acceleration, own.rank, own.size))
        return in_line(motions)

    @cached_property
    def impact_laws(self) -> ImpactLaws:
        """The located impacts against their laws."""
        return judge_impacts(self)

    @property
    def g_N(self) -> np.ndarray:
        """Gaps, shape (n + 1, n_contacts) [m]."""
        return self.contact_motion.g_N

    @property
    def gamma_F(self) -> np.ndarray:
        """Slip velocities, shape (n + 1, n_F) [m/s]."""
        return self.contact_motion.gamma_F

    @cached_property
    def energy(self) -> Energy:
        """Kinetic and potential energy along the trajectory."""
        return in_line([part.energy for part in self.parts]) if self.parts else energy(self)

    @cached_property
    def events(self) -> list[Event]:
        """Impacts, lift-offs and changes between slip and stick, and changes of the scene, in the order of time."""
        if self.parts:
            every = [*self.changes, *(event for part in self.parts for event in part.events)]
            return sorted(every, key=lambda event: event.t)
        return find_events(self) if self.chosen is None else list(self.chosen.located)

    @cached_property
    def tubes(self) -> list[tuple[str, np.ndarray, float]]:
        """Name, centreline in the world, shape (n + 1, n_points, 3) [m], and radius [m] of every beam and rod."""
        return tubes(self)

    @property
    def states(self) -> dict[str, np.ndarray]:
        """States of the first order over time by name, shape (n + 1,), or (n + 1, m) of several; see `add_state`."""
        found, at = {}, self.scene.model.nv
        for state in self.scene.states:
            values = self.v[:, at : at + state.n]
            found[state.name], at = values[:, 0] if state.n == 1 else values, at + state.n
        return found

    def section_forces(
        self, body: str | PlanarBeam | Rod | Cable, xi: np.ndarray
    ) -> SectionForces | RodSectionForces | CableForce:
        """Forces and moments in the sections of a beam, rod or cable over time.

        Args:
            body: the beam, rod or cable, or its name.
            xi: places on its centreline, shape (m,).

        Returns:
            N and M of a beam, N, Q_y, Q_z, M_x, M_y, M_z of a rod, N of a cable, each of shape (n + 1, m) [N and N m].

        Raises:
            UnknownName: there is no such beam, rod or cable.
        """
        return section_forces(self, body, xi)

    def audit(self) -> Audit:
        """Residuals of the laws of mechanics along the trajectory, judged from its arrays."""
        if self.parts:
            total = self.energy.total
            return worst([part.audit() for part in self.parts], float(total[-1] - total[0]), self.message)
        return audit(self)

    @classmethod
    def with_changes(cls, parts: Sequence[Trajectory], scene: Scene, changes: Sequence[Event]) -> Trajectory:
        """The run of a scene that changed.

        Args:
            parts: between the changes.
            scene: with all contacts of all parts, for the columns of the whole.
            changes: what changed.
        """
        parts = checks.instances("run", parts, Trajectory, "a Trajectory")
        found = cls.join([replace(part, kept=None) for part in parts], scene)
        return replace(found, parts=tuple(parts), changes=tuple(changes)) if len(parts) > 1 else found

    @classmethod
    def join(cls, parts: Sequence[Trajectory], scene: Scene | None = None) -> Trajectory:
        """Runs of one scene that follow each other as one, e.g. chunks.

        Args:
            parts: each begins with the state with which the one before ended.
            scene: of the joined run; None is that of the first one.

        Raises:
            SceneError: they do not follow each other, or are no trajectories.
        """
        parts = checks.instances("run", parts, Trajectory, "a Trajectory")
        check_follows(parts)
        if len(parts) == 1:
            return parts[0]
        scene = parts[0].scene if scene is None else scene
        system = parts[0].system if scene is parts[0].scene else System(scene)
        found = cls(**joined_fields(parts, scene, system), kept=joined_kept(parts))
        vars(found)["system"] = system
        return found

    def contact_frames(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Contact points (n_contacts, 3) [m], normals (n_contacts, 3) and friction directions (n_F, 3) in the world.

        The force on the body of the contact point is normal * la_N plus direction * la_F over its friction rows; the
        row of drilling friction is a moment and has the direction zero, as have limits of joints and own constraints.

        Args:
            i: index into the times.
        """
        checks.integer("i", i, -len(self.t), len(self.t) - 1)
        table = self.system.contacts
        sub = table.subset(self.contact_columns).points
        self.system.slots.restore_one(self.slots, self.slot_ends, i)
        self.system.place(self.q[i])
        rows = self.system.point_rows(sub)
        points = rows.c - (sub.radius * (sub.index < table.n_fixed))[:, None] * rows.normals
        still = np.zeros((len(self.contact_columns) - sub.k, 3))
        directions = np.zeros((self.P_F.shape[1], 3))
        directions[: sub.m] = rows.directions[sub.k :]
        return np.vstack((points, still)), np.vstack((rows.normals, still)), directions

    def to_xarray(self, kinematics: bool = False) -> Any:
        """The arrays with names for their axes, as an `xarray.Dataset`.

        Axes are time, coordinate (of q), velocity (of v and a), contact, and direction of friction, NaN where a contact
        has none; units are attributes, those of q and v coordinates (`unit_q`, `unit_v`). `.to_netcdf("run.nc")` writes
        it; a run goes on from what `save` writes.

        Args:
            kinematics: gaps and slip velocities as well, which are computed first.

        Raises:
            MissingPackageError: xarray is not installed.
        """
        return labelled.to_xarray(self, kinematics)

    def to_dataframe(self, kinematics: bool = False) -> Any:
        """The same as a `pandas.DataFrame`, one row per time and one column per number, e.g. "la_N[FL_foot_0]".

        `.to_csv("run.csv")` writes it; units are in `attrs["units"]`, by column.

        Args:
            kinematics: gaps and slip velocities as well, which are computed first.

        Raises:
            MissingPackageError: pandas or xarray is not installed.
        """
        return labelled.to_dataframe(self, kinematics)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the trajectory, its final state and its scene to a file in numpy's npz format.

        The file is there as a whole or not at all: whatever fails, one that was there stays as it is.

        Raises:
            NotWritten: the disk is full, the folder is missing or cannot be written to.
        """
        write(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Read a file that `save` has written.

        The scene comes back with its model, geometries and contacts, but without forces and constraints: to go on, pass
        the original scene and `final_state` to `simulate`.

        Raises:
            SceneError: the file is missing, is not a trajectory, or is damaged.
        """
        with damaged(path):
            content = read(path)
            parts = [cls(**fields) for fields in content.parts]
            for part in parts:
                check_sizes(part)
            if content.scene is None:
                return parts[0]
            return cls.with_changes(parts, content.scene, content.changes)
