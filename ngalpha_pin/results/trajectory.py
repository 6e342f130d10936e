"""Trajectory: what a run returns. Arrays over time, kinematics of the contacts on request, save and load."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.flexible.planar_beam import PlanarBeam, SectionForces
from ngalpha_pin.results.archive import read_archive, write_archive
from ngalpha_pin.results.audit import Audit, audit
from ngalpha_pin.results.energy import Energy, energy
from ngalpha_pin.results.events import Event, find_events
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.scene.serialization import scene_from_dict, scene_to_dict
from ngalpha_pin.system.contact_search import smallest_gap
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

FORMAT = 6
TUBE_POINTS = 33  # of the centreline of a beam, for drawing
CONTACT_ARRAYS = ("P_N", "la_N", "La_N", "P_F", "la_F", "La_F")
CONSTRAINT_ARRAYS = ("la_g", "La_g", "la_gamma", "La_gamma", "tau_f", "P_f")
# rows of norm one count as dependent from this singular value on
RANK = 1e-8


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


class Impacts(NamedTuple):
    """Impacts that were located within their step, j of them, in the order of time.

    Attributes:
        t: times, shape (j,) [s].
        step: the recorded times at which their steps end, as numbers, shape (j,).
        q: configurations, shape (j, nq).
        v_before, v_after: velocities on their two sides, shape (j, nv).
        P_N, P_F: percussions, shapes (j, n_contacts) and (j, n_F) [N s].
        P_b: percussions of the constraints, those of g first, shape (j, n_g + n_gamma).
        slots, slot_ends: features of the pairs of solids at all of them in one array, and where those of each end.
    """

    t: np.ndarray
    step: np.ndarray
    q: np.ndarray
    v_before: np.ndarray
    v_after: np.ndarray
    P_N: np.ndarray
    P_F: np.ndarray
    P_b: np.ndarray
    slots: np.ndarray
    slot_ends: np.ndarray


@dataclass(frozen=True, eq=False)
class Chosen:
    """What a run of chosen accuracy says beside its arrays.

    Attributes:
        rtol, atol: what was asked for.
        rejected: number of steps that were tried and not accepted.
        n_evaluations: evaluations of the equations of motion in smooth phases.
        located: changes of contact at their moments.
        unmet: time [s] and contacts of every step that missed the tolerance at the smallest size.
        t_events, q_events, v_events: where the events of the user happened, one array per event: shapes (j,),
            (j, nq) and (j, nv).
    """

    rtol: float
    atol: float
    rejected: int
    n_evaluations: int
    located: tuple[Event, ...]
    unmet: tuple[tuple[float, tuple[str, ...]], ...]
    t_events: tuple[np.ndarray, ...]
    q_events: tuple[np.ndarray, ...]
    v_events: tuple[np.ndarray, ...]

    def to_header(self) -> dict[str, Any]:
        """As plain lists and numbers."""
        values = dict(vars(self))
        for name in ("t_events", "q_events", "v_events"):
            values[name] = [array.tolist() for array in values[name]]
        return values

    @classmethod
    def from_header(cls, values: dict[str, Any]) -> Chosen:
        """The inverse of `to_header`."""
        values = dict(values)
        values["located"] = tuple(Event(*event) for event in values["located"])
        values["unmet"] = tuple((t, tuple(names)) for t, names in values["unmet"])
        for name in ("t_events", "q_events", "v_events"):
            values[name] = tuple(np.array(array) for array in values[name])
        return cls(**values)


class ConstraintMotion(NamedTuple):
    """What is left of the constraints along a trajectory; all of it should vanish but the rank.

    Attributes:
        g: shape (n + 1, n_g) [m, rad or -].
        rate: g_dot and gamma, shape (n + 1, n_g + n_gamma).
        acceleration: g_ddot and gamma_dot, of the same shape.
        rank: number of independent rows, shape (n + 1,).
        size: largest position that the rows subtract, the yardstick of g, shape (n + 1,) [m, rad or -].
    """

    g: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    rank: np.ndarray
    size: np.ndarray


@dataclass(eq=False)
class Trajectory:
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
        tau_f, P_f: torque of dry friction [N m or N] and its percussion in the step, shape (n + 1, f).
        n_iter: iterations of each step, shape (n + 1,).
        slots, slot_ends: features of the pairs of solids (see `ngalpha_pin.slots`) of all times in one array, and where
            those of each time end, shape (n + 1,).
        solver_path: rung of the solver ladder that solved each step, shape (n + 1,).
        impacts: those that were located within their step.
        chosen: of a run of chosen accuracy, its tolerances, rejected steps and located events; otherwise None.
        final_state: continues the run with `simulate(scene, state=..., t_end=...)`.
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
    tau_f: np.ndarray
    P_f: np.ndarray
    slots: np.ndarray
    slot_ends: np.ndarray
    n_iter: np.ndarray
    solver_path: np.ndarray
    impacts: Impacts
    final_state: State
    chosen: Chosen | None = None

    def __repr__(self) -> str:
        end = "" if self.success else f", stopped: {self.message}"
        return (
            f"Trajectory({self.scene.model.name!r}, {len(self.t) - 1} steps to t = {self.t[-1]:g} s, "
            f"{len(self.contact_names)} contacts{end})"
        )

    def __getstate__(self) -> dict[str, Any]:
        """For pickle: what was computed from it at a request is computed again."""
        return {name: value for name, value in vars(self).items() if name != "system"}

    def _repr_html_(self) -> str:
        """What a notebook shows: what was run, its audit and its events; `viz.embed` shows the motion."""
        from ngalpha_pin.viz.notebook import summary

        return summary(self)

    @cached_property
    def system(self) -> System:
        """The compiled scene, for kinematics along the trajectory."""
        return System(self.scene)

    @cached_property
    def contact_motion(self) -> ContactMotion:
        """Gaps and slip velocities, computed from q and v at the first request."""
        table = self.system.contacts
        sub = table.subset(self.contact_columns)
        n, relative = len(self.t), table.yardstick
        motion = ContactMotion(np.zeros((n, sub.k)), np.zeros((n, sub.k)), np.zeros((n, sub.m)), np.full(n, np.inf))
        for i in range(n if table.n else 0):
            self._restore_slots(i)
            rows = self.system.contact_rows_at(sub, self.q[i], self.v[i])
            motion.g_N[i], motion.g_N_dot[i], motion.gamma_F[i] = rows.g_N, rows.rate[: sub.k], rows.rate[sub.k :]
            if sub.k == table.n and self.system.slots.n == 0:
                smallest = (rows.g_N / relative).min()
            else:
                smallest = smallest_gap(self.system, self.q[i])
            motion.smallest_gap[i] = smallest * table.length
        return motion

    def _restore_slots(self, i: int) -> None:
        """Put the features of step i into the places of the pairs of solids."""
        self.system.slots.restore_one(self.slots, self.slot_ends, i)

    @cached_property
    def constraint_motion(self) -> ConstraintMotion:
        """How well the constraints are fulfilled, computed from q, v and a at the first request."""
        system, n, b = self.system, len(self.t), len(self.constraint_names)
        found = ConstraintMotion(
            np.zeros((n, self.n_g)), np.zeros((n, b)), np.zeros((n, b)), np.zeros(n, dtype=int), np.zeros(n)
        )
        for i in range(n if b else 0):
            system.dynamics(self.t[i], self.q[i], self.v[i], self.a[i])
            rows = system.constraint_rows(self.t[i], self.q[i], self.v[i], self.a[i])
            found.g[i], found.rate[i], found.acceleration[i] = rows.g, rows.rate, rows.acceleration
            found.size[i] = rows.sizes[0]
            W = system.directions([rows])
            size = system.constraints.by_group(np.linalg.norm(W, axis=1))
            found.rank[i] = np.linalg.matrix_rank(W / size[:, None], tol=RANK)
        return found

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
        return energy(self)

    @cached_property
    def events(self) -> list[Event]:
        """Impacts, lift-offs and changes between slip and stick, in the order of time."""
        return find_events(self) if self.chosen is None else list(self.chosen.located)

    @cached_property
    def tubes(self) -> list[tuple[str, np.ndarray, float]]:
        """Name, centreline in the world, shape (n + 1, TUBE_POINTS, 3) [m], and radius [m] of every beam."""
        xi = np.linspace(0.0, 1.0, TUBE_POINTS)
        return [
            (name, np.array([beam.points(q, xi) for q in self.q[:, self.scene.slices[beam].q]]), beam.radius)
            for name, beam in self.scene.beams.items()
        ]

    def section_forces(self, beam: str | PlanarBeam, xi: np.ndarray) -> SectionForces:
        """Axial force [N] and bending moment [N m] of a beam over time.

        Args:
            beam: the beam or its name.
            xi: places on its centreline, shape (m,).

        Returns:
            N and M, each of shape (n + 1, m).

        Raises:
            UnknownName: there is no such beam.
        """
        if isinstance(beam, str):
            if beam not in self.scene.beams:
                raise UnknownName("beam", beam, self.scene.beams)
            beam = self.scene.beams[beam]
        place = self.scene.slices[beam]
        pairs = zip(self.q[:, place.q], self.v[:, place.v], strict=True)
        N, M = zip(*(beam.section_forces(q, v, xi) for q, v in pairs), strict=True)
        return SectionForces(np.array(N), np.array(M))

    def audit(self) -> Audit:
        """Residuals of the laws of mechanics along the trajectory, judged from its arrays."""
        return audit(self)

    def contact_frames(self, i: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Contact points (n_contacts, 3) [m], normals (n_contacts, 3) and friction directions (n_F, 3) in the world.

        The force on the body of the contact point is normal * la_N plus direction * la_F over its friction rows; the
        row of drilling friction is a moment and has the direction zero, as has a limit of a joint.

        Args:
            i: index into the times.
        """
        table = self.system.contacts
        sub = table.subset(self.contact_columns).points
        self._restore_slots(i)
        self.system.place(self.q[i])
        rows = self.system.point_rows(sub)
        points = rows.c - (sub.radius * (sub.index < table.n_fixed))[:, None] * rows.normals
        still = np.zeros((len(self.contact_columns) - sub.k, 3))
        return np.vstack((points, still)), np.vstack((rows.normals, still)), np.array(rows.directions[sub.k :])

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the trajectory, its final state and its scene to a file in numpy's npz format.

        The file is there as a whole or not at all: whatever fails, one that was there stays as it is.

        Raises:
            NotWritten: the disk is full, the folder is missing or cannot be written to.
        """
        header = {
            "format": FORMAT, "method": self.method, "dt": self.dt, "success": self.success, "message": self.message,
            "constraint_names": self.constraint_names, "n_g": self.n_g, "friction_names": self.friction_names,
            "conserved": self.energy.conserved, "contact_names": self.contact_names,
            "friction_rows": [[s.start, s.stop] for s in self.friction_rows],
            "scene": scene_to_dict(self.scene), "chosen": None if self.chosen is None else self.chosen.to_header(),
        }  # fmt: skip
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        # what needs functions of the user's own is written down
        arrays |= {f"constraint.{name}": value for name, value in self.constraint_motion._asdict().items()}
        arrays["elastic"] = self.energy.elastic
        arrays |= {f"state.{name}": value for name, value in self.final_state.to_arrays().items()}
        arrays |= {f"impacts.{name}": value for name, value in self.impacts._asdict().items()}
        write_archive(path, header, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Trajectory:
        """Read a file that `save` has written.

        The scene comes back with its model, geometries and contacts, but without forces and constraints: to go on, pass
        the original scene and `final_state` to `simulate`.

        Raises:
            SceneError: the file is missing, is not a trajectory, or is damaged.
        """
        header, content = read_archive(path, "a trajectory", FORMAT)
        try:
            return cls._unpacked(header, content)
        except Exception as error:  # what is missing or has another type or shape fails where it is used
            raise SceneError(f"{path} cannot be read as a trajectory: its content is damaged: {error!r}") from error

    @classmethod
    def _unpacked(cls, header: dict[str, Any], content: dict[str, np.ndarray]) -> Trajectory:
        """What `save` has packed."""
        state = {name[6:]: value for name, value in content.items() if name.startswith("state.")}
        trajectory = cls(
            scene=scene_from_dict(header["scene"]),
            method=header["method"], dt=header["dt"], success=header["success"], message=header["message"],
            contact_names=tuple(header["contact_names"]),
            friction_rows=tuple(slice(*pair) for pair in header["friction_rows"]),
            chosen=None if header["chosen"] is None else Chosen.from_header(header["chosen"]),
            impacts=Impacts(**{name: content[f"impacts.{name}"] for name in Impacts._fields}),
            final_state=State.from_arrays(state),
            constraint_names=tuple(header["constraint_names"]), n_g=header["n_g"],
            friction_names=tuple(header["friction_names"]),
            **{name: content[name] for name in _ARRAYS},
        )  # fmt: skip
        trajectory._check_sizes()
        motion = ConstraintMotion(*(content[f"constraint.{name}"] for name in ConstraintMotion._fields))
        vars(trajectory)["constraint_motion"] = motion
        vars(trajectory)["energy"] = energy(trajectory)._replace(
            elastic=content["elastic"], conserved=header["conserved"]
        )
        return trajectory

    def _check_sizes(self) -> None:
        """The arrays fit each other and the scene.

        Raises:
            SceneError: one does not.
        """
        n, k, m, b = len(self.t), len(self.contact_names), self.P_F.shape[1], len(self.constraint_names)
        system, contacts, f = self.system, range(self.system.contacts.n), len(self.friction_names)
        widths = {"q": system.nq, "v": system.nv, "a": system.nv, "tau_f": f, "P_f": f}
        widths |= {name: m if name.endswith("F") else k for name in CONTACT_ARRAYS}
        widths |= {f"{la}_{kind}": w for la in ("la", "La") for kind, w in (("g", self.n_g), ("gamma", b - self.n_g))}
        wanted: dict[str, tuple[int, ...]] = {name: (n, width) for name, width in widths.items()}
        wanted |= dict.fromkeys(("t", "slot_ends", "n_iter", "solver_path"), (n,)) | {"contact_columns": (k,)}
        for name, shape in wanted.items():
            if getattr(self, name).shape != shape:
                raise SceneError(f"{name} has the shape {getattr(self, name).shape}, expected {shape}")
        ends = [rows.stop for rows in self.friction_rows]
        if len(ends) != k or not all(int(i) in contacts for i in self.contact_columns):
            raise SceneError("its contacts are not those of its scene")
        if (ends and max(ends) > m) or (np.diff(self.slot_ends) < 0).any() or self.slot_ends[-1] != len(self.slots):
            raise SceneError("parts of friction or of features end where there is nothing")


_ARRAYS = (
    "t",
    "q",
    "v",
    "a",
    "contact_columns",
    *CONTACT_ARRAYS,
    *CONSTRAINT_ARRAYS,
    "slots",
    "slot_ends",
    "n_iter",
    "solver_path",
)
