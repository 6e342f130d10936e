"""The contacts of a scene as flat arrays.

A scene is compiled once. A step picks the few contacts that it involves as a `Subset`, whose index arrays are made once
and kept, so that nothing loops over contacts in Python while the clock runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.contact_points import ContactPoints
from ngalpha_pin.collision.manifold import SLOTS, Slots
from ngalpha_pin.common.tolerances import GRAVITY
from ngalpha_pin.contact.cones import DRILLING, KINDS, ROLLING, Cones
from ngalpha_pin.contact.friction_axes import FrictionAxes, TurningRows
from ngalpha_pin.contact.moving_surfaces import MovingSurfaces
from ngalpha_pin.contact.reach import length_of, moved_by, reach_of
from ngalpha_pin.contact.tangents import friction_directions, point_motion
from ngalpha_pin.engine.kernel.binding import Plan
from ngalpha_pin.errors import SceneError
from ngalpha_pin.numerics.spatial import cross
from ngalpha_pin.scene.compliance import Compliance
from ngalpha_pin.scene.contact import ContactLaw
from ngalpha_pin.scene.friction_curve import Curve
from ngalpha_pin.scene.joints import JointLimit
from ngalpha_pin.scene.restitution import Restitution
from ngalpha_pin.scene.unilateral import UnilateralConstraint


class ContactTable:
    """All contacts of a scene: points fixed in a body, the places of changing features, and the limits of joints.

    Attributes:
        n, n_shapes, n_points, n_fixed: number of contacts, of those that are no own unilateral constraints, of those of
            them that are no limits, and of those that are fixed in a body.
        names: one per contact.
        mu, e_N, e_F: laws, shape (n,) [-]; curves of mu over the slip, None where it is constant; has_curve: where.
        compliances: laws of the compliant contacts, None of rigid ones; soft: which are, shape (n,).
        restitutions: of contacts that have more than Newton's law with a number; has_restitution: which have.
        adhesion: force that a contact holds, shape (n,) [N]; adheres: there is some.
        rolling: coefficient of rolling resistance, the arm of the normal force by `lever`, shape (n,) [-].
        resists: there is some.
        lever: distance of each point from the joint that carries it, which rows of rolling have, shape (n_points,) [m].
        n_F, first_F: number and first of the friction rows of each contact, shape (n,).
        kind_F: kinds of all friction rows, see `friction_directions`.
        bodies: joints that carry a contact point or a surface, shape (n_bodies,).
        pairs_a, pairs_b: places in `bodies` of those that fixed points can bring together.
        support: 1 where a velocity coordinate moves a body, shape (n_bodies, nv).
        length: size of the scene, a yardstick of gaps [m].
        speed: of what has fallen by half of it on earth, a yardstick where nothing moves [m/s].
        yardstick: of each contact, the length of the scene or that of `JointLimit`, shape (n,) [m or rad].
        reach: bound of the change of any gap times its measure per unit of each coordinate, shape (nv,) [m or 1].
        measure: of each contact, one for points, shape (n,) [1 or m].
        surfaces: those of points that move along themselves.
        axes: friction ellipses of points.
    """

    def __init__(
        self,
        model: pin.Model,
        data: pin.Data,
        fixed: list[ContactPoints],
        slots: Slots,
        limits: list[JointLimit],
        length: float = 0.0,
        own: Sequence[UnilateralConstraint] = (),
    ):
        parts = fixed + slots.stand_ins()
        sizes = [len(part.names) for part in parts]
        points = [part for part, size in zip(parts, sizes, strict=True) for _ in range(size)]
        self.n_fixed, self.n_points, self.n_shapes = sum(sizes[: len(fixed)]), len(points), len(points) + len(limits)
        self.n = self.n_shapes + len(own)
        rest: list[JointLimit | UnilateralConstraint] = [*limits, *own]
        self.names = tuple(chain.from_iterable(part.names for part in parts)) + tuple(x.name for x in rest)
        if len(set(self.names)) < self.n:
            raise SceneError("two contacts have the same name; give the geometries different names")
        self._take_laws([part.law for part in parts], sizes, limits, own)
        self.limit_q, self.limit_dof = (np.array([getattr(x, i) for x in limits], dtype=int) for i in ("q", "dof"))
        self.limit_sign, self.limit_value = (np.array([getattr(x, i) for x in limits]) for i in ("sign", "value"))
        self.limit_joint = np.array([limit.joint for limit in limits], dtype=int)
        self._place_bodies(model, parts, sizes)
        self._place_points(parts, np.array(sizes, dtype=int))
        self.surfaces = MovingSurfaces([p.moving for p in points])
        self.axes = FrictionAxes([p.ellipse for p in points])
        every = np.arange(self.n_points)
        places = (every - self.n_fixed) % SLOTS
        self.first_place = np.where(every < self.n_fixed, every, every - places)
        self._find_directions(model, data, slots, limits, own)
        self._measure(model, limits, length)
        self._subsets: dict[bytes, Subset] = {}

    def _take_laws(
        self,
        laws: list[ContactLaw],
        sizes: list[int],
        limits: list[JointLimit],
        own: Sequence[UnilateralConstraint],
    ) -> None:
        """What happens at each contact; limits have no friction. laws, sizes: of shapes, and how many points each."""
        rest: list[JointLimit | UnilateralConstraint] = [*limits, *own]
        none = [None] * len(rest)

        def each(of_parts: list[float], of_rest: list[float]) -> np.ndarray:
            return np.concatenate((np.repeat(np.array(of_parts, dtype=float), sizes), np.array(of_rest, dtype=float)))

        def listed(of_parts: list[Any]) -> list[Any]:
            return [x for x, size in zip(of_parts, sizes, strict=True) for _ in range(size)] + none

        self.mu = each([law.coefficient for law in laws], [0.0] * len(limits) + [x.mu for x in own])
        self.curves: list[Curve | None] = listed([law.curve for law in laws])
        self.has_curve = np.array([curve is not None for curve in self.curves], dtype=bool)
        self.restitutions: list[Restitution | None] = listed([law.restitution for law in laws])
        self.has_restitution = np.array([law is not None for law in self.restitutions], dtype=bool)
        self.compliances: list[Compliance | None] = listed([law.compliance for law in laws])
        self.soft = np.array([law is not None for law in self.compliances], dtype=bool)
        self.e_N = each([law.bounce for law in laws], [x.e_N for x in rest])
        self.e_F = each([law.e_F for law in laws], [0.0] * len(rest))
        self.adhesion = each([law.adhesion for law in laws], [0.0] * len(rest))
        self.adheres = bool(self.adhesion.any())

    def _place_bodies(self, model: pin.Model, parts: list[ContactPoints], sizes: list[int]) -> None:
        """The bodies of points and surfaces, and which of them fixed points can bring together."""
        joints = np.repeat(
            np.array([(p.joint, p.surface.joint) for p in parts], dtype=int).reshape(-1, 2), sizes, axis=0
        )
        self.bodies, places = np.unique(joints, return_inverse=True)
        self.body_b, self.body_a = np.ascontiguousarray(places.reshape(-1, 2).T)
        codes = np.unique((self.body_a * len(self.bodies) + self.body_b)[: self.n_fixed])
        self.pairs_a, self.pairs_b = np.divmod(codes, max(len(self.bodies), 1))
        self.support = np.array([moved_by(model, j) for j in self.bodies]).reshape(len(self.bodies), model.nv)

    def _find_directions(
        self,
        model: pin.Model,
        data: pin.Data,
        slots: Slots,
        limits: list[JointLimit],
        own: Sequence[UnilateralConstraint],
    ) -> None:
        """The friction rows of each contact, with the directions of those of points."""
        rows = np.zeros((self.n_points, KINDS), dtype=bool)
        self.tangents = np.zeros((self.n_points, 2, 3))
        if self.mu[: self.n_points].any() or self.resists or slots.n:
            motion = point_motion(model, data, self)
            slots.mobility = np.ascontiguousarray(motion[0][self.n_fixed :: SLOTS])
            rows, self.tangents = friction_directions(self, motion[0] + motion[2], motion[1])
        of_own = np.array([x.n_F for x in own], dtype=int)
        self.n_F = np.concatenate((rows.sum(axis=1), np.zeros(len(limits), dtype=int), of_own))
        self.kind_F = np.concatenate((np.nonzero(rows)[1], np.zeros(of_own.sum(), dtype=int)))
        self.first_F = np.cumsum(self.n_F) - self.n_F

    def _measure(self, model: pin.Model, limits: list[JointLimit], length: float) -> None:
        """How far coordinates move contacts, and the lengths that gaps are compared with."""
        points, own = self.n_points, self.n - self.n_shapes
        self.reach = reach_of(model, self)
        # a limit is told in the distance that its coordinate moves the points, so that it does not widen the reach
        ways = self.reach[self.limit_dof]
        ways = np.where((ways > 0.0) & np.isfinite(ways), ways, 1.0)
        self.measure = np.concatenate((np.ones(points), ways, np.ones(own)))
        self.reach[self.limit_dof] = np.maximum(self.reach[self.limit_dof], ways)
        self.length = max(length, length_of(model, self))
        self.speed = float(np.sqrt(GRAVITY * self.length))
        own_sizes = [limit.yardstick for limit in limits]
        self.yardstick = np.array([self.length] * points + own_sizes + [self.length] * own)

    def _place_points(self, parts: list[ContactPoints], sizes: np.ndarray) -> None:
        """Points and the surfaces that they touch, each in the frame of its body."""

        def each(values: list[Any], width: int = 1) -> np.ndarray:
            array = np.array(values, dtype=float)
            return np.repeat(array if width == 1 else array.reshape(-1, width), sizes, axis=0)

        surfaces = [part.surface for part in parts]
        self.point = np.concatenate([np.zeros((0, 3)), *(part.points for part in parts)])
        self.radius = each([part.radius for part in parts])
        self.normal, self.offset = each([s.normal for s in surfaces], 3), each([s.offset for s in surfaces])
        self.centre, self.axis = each([s.centre for s in surfaces], 3), each([s.axis for s in surfaces], 3)
        self.surface_radius = each([s.radius for s in surfaces])
        self.half_length, self.side = each([s.half_length for s in surfaces]), each([s.side for s in surfaces])
        self.curved = np.repeat(np.array([not s.is_plane for s in surfaces], dtype=bool), sizes)
        self.drilling = 3.0 * np.pi / 16.0 * each([part.law.contact_radius for part in parts])  # (157)
        arms = each([part.law.rolling_resistance for part in parts])
        self.lever = np.linalg.norm(self.point, axis=1) + self.radius
        self.lever = np.where(self.lever > 0.0, self.lever, arms)
        self.rolling = np.zeros(self.n)
        self.rolling[: self.n_points] = arms / np.where(arms > 0.0, self.lever, 1.0)
        self.resists = bool(arms.any())

    def fresh(self) -> ContactTable:
        """The same for another system: it shares all but the subsets, which a system writes into."""
        found = copy(self)
        found._subsets = {}
        return found

    def motion(self, dq: np.ndarray) -> float:
        """Bound of the change of any gap of fixed points and limits along a tangent step or a velocity [m or m/s]."""
        ways = np.where(dq == 0.0, 0.0, np.abs(dq)) * np.where(dq == 0.0, 0.0, self.reach)
        bodies = np.where(self.support > 0.0, ways, 0.0).sum(axis=1)
        points = (bodies[self.pairs_a] + bodies[self.pairs_b]).max(initial=0.0)
        limits = np.abs(dq)[self.limit_dof] * self.measure[self.n_points : self.n_shapes]
        return float(max(points, limits.max(initial=0.0)))

    def subset(self, index: np.ndarray) -> Subset:
        """The index arrays of some contacts, made at the first request.

        Args:
            index: increasing numbers of contacts, shape (k,).
        """
        key = index.tobytes()
        found = self._subsets.get(key)
        if found is None:
            if len(self._subsets) > 4096:
                self._subsets.clear()
            found = self._subsets[key] = Subset(self, index)
        return found


class Subset:
    """Some of the contacts, as the arrays that the kinematics and the laws index with.

    The rows of a subset are its normals, in order, then its friction rows, contact by contact.

    Attributes:
        index: numbers of the contacts in the table, shape (k,).
        k: number of contacts.
        m: number of friction rows.
        of_row: contact (place in the subset) of each row, shape (k + m,).
        of_F: the same for the friction rows, shape (m,).
        rows_F: numbers of the friction rows in the table, shape (m,).
        limits, own: which limits of joints and which own unilateral constraints are among the contacts.
        points: the subset without them; the geometry below is that of points, and is there where there are no limits.
        cones: which friction rows share a cone.
        restitutions: places of the contacts with more than Newton's law with a number, each with what it has.
        in_phases, phases: those with Poisson's or Stronge's law, shape (k,), and whether there is one.
        soft: places of compliant contacts, shape (s,); compliances: their laws.
        plan: the subset as the compiled kernel knows it, made when it is used first.
        surfaces: those that move along themselves, None where none does.
        axes: friction ellipses, None where there is none; turns: their friction rows.
    """

    def __init__(self, table: ContactTable, index: np.ndarray):
        self.table, self.index = table, index
        self.plan: Plan | None = None
        self.surfaces: MovingSurfaces | None = None
        self.axes: FrictionAxes | None = None
        self.k = len(index)
        n_F = table.n_F[index]
        self.of_F = np.repeat(np.arange(self.k), n_F)
        self.m = len(self.of_F)
        self.of_row = np.concatenate((np.arange(self.k), self.of_F))
        self.rows_F = np.arange(self.m) + (table.first_F[index] - np.cumsum(n_F) + n_F)[self.of_F]
        self.kind_F = table.kind_F[self.rows_F]

        k, m = self.k, self.m
        self.mu = table.mu[index]
        curves = [table.curves[i] for i in index] if table.has_curve[index].any() else []
        self.cones = Cones(self.of_F, self.kind_F, self.mu, table.rolling[index], curves, index, table.n)
        self.e = np.concatenate((table.e_N[index], table.e_F[index][self.of_F] * (self.kind_F < ROLLING)))
        self.bounces = bool(self.e.any())
        bouncing = np.flatnonzero(table.has_restitution[index]).tolist() if table.has_restitution.any() else []
        self.restitutions = [(i, law) for i in bouncing if (law := table.restitutions[index[i]]) is not None]
        self.soft = np.flatnonzero(table.soft[index])
        self.compliances = [law for i in index[self.soft] if (law := table.compliances[i]) is not None]
        self.in_phases = np.zeros(self.k, dtype=bool)
        self.in_phases[[i for i, law in self.restitutions if law.law != "newton"]] = True
        self.phases = bool(self.in_phases.any())
        # places in the vectors of `laws`: friction, and the normal forces that bound the cones
        self.friction_places = np.concatenate((np.arange(2 * k, 2 * k + m), np.arange(3 * k + m, 3 * k + 2 * m)))
        self.places = (slice(0, k), slice(k, k + m))
        self.normal_places = np.concatenate((k + self.cones.contact, 2 * k + m + self.cones.contact))
        # the row of W that gives each of them its scale: friction rows of a cone share the one of the first
        rows = np.concatenate((np.arange(k), k + self.cones.first))
        self.scale_rows = np.concatenate((np.arange(k), rows, rows))
        self.levels = np.concatenate((np.full(k, 2), np.full(k + m, 1), np.zeros(k + m, dtype=int)))
        first, last = np.searchsorted(index, (table.n_points, table.n_shapes))
        self.limits, self.own = index[first:last] - table.n_points, index[last:] - table.n_shapes
        # of the points, those that are fixed in a body, and the places of the others
        self.k_fixed = int(np.searchsorted(index, table.n_fixed))
        self.slots = index[self.k_fixed : first] - table.n_fixed
        self.points = self
        if first < k:
            self.points = table.subset(index[:first])
            self.surfaces, self.axes = self.points.surfaces, self.points.axes
            self.limit_q, self.limit_dof = table.limit_q[self.limits], table.limit_dof[self.limits]
            self.limit_sign, self.limit_value = table.limit_sign[self.limits], table.limit_value[self.limits]
        else:
            self._place(table, index)

    def _place(self, table: ContactTable, index: np.ndarray) -> None:
        """Where the points and the surfaces are."""
        self.body_b, self.body_a = table.body_b[index], table.body_a[index]
        used = np.unique(np.concatenate((self.body_b, self.body_a)))
        self.bodies = table.bodies[used]
        self.body_b, self.body_a = np.searchsorted(used, self.body_b), np.searchsorted(used, self.body_a)
        self.support_T = np.ascontiguousarray(table.support[used].T)
        self.support = table.support[used]
        self.moving = self.support[self.body_a].any(axis=1)
        self.moving_surface = bool(self.moving.any())

        self.point, self.radius = table.point[index], table.radius[index]
        self.normal, self.offset = table.normal[index], table.offset[index]
        self.centre, self.axis = table.centre[index], table.axis[index]
        self.surface_radius, self.half_length = table.surface_radius[index], table.half_length[index]
        self.side, self.curved = table.side[index], table.curved[index]
        self.any_curved = bool(self.curved.any())
        self.tangent = table.tangents[index]
        self.surfaces, self.axes = table.surfaces.of(index), table.axes.of(index)
        self.turns = None if self.axes is None else TurningRows(self.of_F, self.kind_F, self.axes)
        self.drill_F = table.drilling[index][self.of_F] * (self.kind_F == DRILLING)
        self.roll_F = table.lever[index][self.of_F] * (self.kind_F >= ROLLING)
        bends = self.any_curved or self.axes is not None or len(self.soft) > 0
        self.fixed_planes = not self.moving_surface and not bends
        if self.fixed_planes:
            self.fixed_d, self.fixed_q = self.row_vectors(self.normal, self.tangent)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Of the contacts."""
        return tuple(self.table.names[i] for i in self.index.tolist())

    @property
    def plain(self) -> bool:
        """The compiled kernel knows their laws and surfaces: those of Newton and Coulomb with numbers, at rest."""
        others = self.restitutions or self.compliances or self.surfaces is not None or self.axes is not None
        return self.cones.plain and not others

    @cached_property
    def parts(self) -> tuple[Subset, Subset]:
        """The points fixed in a body, and the places of changing features."""
        return self.table.subset(self.index[: self.k_fixed]), self.table.subset(self.index[self.k_fixed :])

    def restitution(self, rates: np.ndarray) -> np.ndarray:
        """Restitution coefficients e_N and e_F of rates before an impact, shape (k + m,) [-]."""
        e = self.e
        if self.restitutions:
            e = e.copy()
            for i, law in self.restitutions:
                e[i] = law(np.maximum(-rates[i : i + 1], 0.0))[0]
        return e

    @cached_property
    def sign(self) -> np.ndarray:
        """Sign with which a velocity coordinate enters the rows of a contact, shape (k, nv)."""
        return self.support[self.body_b] - self.support[self.body_a]

    @cached_property
    def mask(self) -> np.ndarray:
        """Sign with which a velocity coordinate enters a row, shape (k + m, nv)."""
        return self.sign[self.of_row]

    @cached_property
    def projector(self) -> np.ndarray:
        """Projection onto what the axis of a cylinder leaves, shape (k, 3, 3)."""
        return np.eye(3) - self.axis[:, :, None] * self.axis[:, None, :]

    @cached_property
    def to_contact(self) -> np.ndarray:
        """1 where a friction row belongs to a contact, shape (m, k)."""
        return (self.of_F[:, None] == np.arange(self.k)).astype(float)

    def row_vectors(self, n: np.ndarray, t: np.ndarray, arm: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Parts d and q of the wrenches of all rows from normals (k, 3), tangents (k, 2, 3) and arms (k,)."""
        arm, o = self.radius if arm is None else arm, self.of_F
        d_F, along = self.along_tangents(t)
        q_F = self.drill_F[:, None] * n[o] - arm[o, None] * cross(n[o], d_F) + along
        return np.concatenate((n, d_F)), np.concatenate((np.zeros_like(n), q_F))

    def along_tangents(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tangents (k, 2, 3) as the forces of rows of slip, and times levers as the moments of rolling, (m, 3) each."""
        along = t[self.of_F, self.kind_F % ROLLING % 2]
        slip = along if self.turns is None else self.turns.scale[:, None] * along
        return np.where(self.kind_F[:, None] < DRILLING, slip, 0.0), self.roll_F[:, None] * along
