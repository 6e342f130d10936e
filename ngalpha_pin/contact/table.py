"""The contacts of a scene as flat arrays.

A scene is compiled once. A step picks the few contacts that it involves as a `Subset`, whose index arrays are made once
and kept, so that nothing loops over contacts in Python while the clock runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.contact_points import ContactPoint
from ngalpha_pin.collision.manifold import SLOTS, Slots
from ngalpha_pin.contact.moving_surfaces import MovingSurfaces
from ngalpha_pin.contact.tangents import friction_directions, point_motion
from ngalpha_pin.errors import SceneError
from ngalpha_pin.kernel.binding import Plan
from ngalpha_pin.linalg.spatial import cross
from ngalpha_pin.scene.friction_curve import Curve
from ngalpha_pin.scene.joints import JointLimit, own_motions
from ngalpha_pin.scene.unilateral import UnilateralConstraint
from ngalpha_pin.tolerances import TINY


class ContactTable:
    """All contacts of a scene: points fixed in a body, the places of changing features, and the limits of joints.

    Attributes:
        n, n_shapes, n_points, n_fixed: number of contacts, of those that are no own unilateral constraints, of those of
            them that are no limits, and of those that are fixed in a body.
        names: one per contact.
        mu, e_N, e_F: laws, shape (n,) [-].
        adhesion: force that a contact holds, shape (n,) [N]; adheres: there is some.
        n_F: number of friction rows of each contact, shape (n,).
        friction_rows: slice of each contact into an array with one entry per friction row.
        first_F, kinds: its start, shape (n,); and the kind of every friction row, shape (rows,).
        bodies: joints that carry a contact point or a surface, shape (n_bodies,).
        pairs_a, pairs_b: places in `bodies` of those that fixed points can bring together.
        support: 1 where a velocity coordinate moves a body, shape (n_bodies, nv).
        length: size of the scene, a yardstick of gaps [m].
        yardstick: of each contact, the length of the scene or that of `JointLimit`, shape (n,) [m or rad].
        reach: bound of the change of any gap times its measure per unit of each coordinate, shape (nv,) [m or 1].
        measure: of each contact, one for points, shape (n,) [1 or m].
        surfaces: those of points that move along themselves.
    """

    def __init__(
        self,
        model: pin.Model,
        data: pin.Data,
        fixed: list[ContactPoint],
        slots: Slots,
        limits: list[JointLimit],
        length: float = 0.0,
        own: Sequence[UnilateralConstraint] = (),
    ):
        points = fixed + slots.stand_ins()
        self.n_fixed, self.n_points, self.n_shapes = len(fixed), len(points), len(points) + len(limits)
        self.n = self.n_shapes + len(own)
        rest: list[JointLimit | UnilateralConstraint] = [*limits, *own]
        self.names = tuple(p.name for p in points) + tuple(x.name for x in rest)
        if len(set(self.names)) < self.n:
            raise SceneError("two contacts have the same name; give the geometries different names")
        self.mu = np.array([p.law.coefficient for p in points] + [0.0] * len(limits) + [x.mu for x in own])
        self.curves: list[Curve | None] = [p.law.curve for p in points] + [None] * len(rest)
        self.has_curve = np.array([curve is not None for curve in self.curves], dtype=bool)
        self.e_N = np.array([p.law.e_N for p in points] + [x.e_N for x in rest])
        self.e_F = np.array([p.law.e_F for p in points] + [0.0] * len(rest))
        self.adhesion = np.array([p.law.adhesion for p in points] + [0.0] * len(rest))
        self.adheres = bool(self.adhesion.any())
        self.limit_q, self.limit_dof = (np.array([getattr(x, i) for x in limits], dtype=int) for i in ("q", "dof"))
        self.limit_sign, self.limit_value = (np.array([getattr(x, i) for x in limits]) for i in ("sign", "value"))
        self.limit_joint = np.array([limit.joint for limit in limits], dtype=int)
        joints = [(p.joint, p.surface.joint) for p in points]
        self.bodies = np.array(sorted({j for pair in joints for j in pair}), dtype=int)
        place = {int(joint): i for i, joint in enumerate(self.bodies)}
        self.body_b = np.array([place[b] for b, _ in joints], dtype=int)
        self.body_a = np.array([place[a] for _, a in joints], dtype=int)
        pairs = np.unique(np.column_stack((self.body_a, self.body_b))[: self.n_fixed], axis=0)
        self.pairs_a, self.pairs_b = pairs[:, 0], pairs[:, 1]
        self.support = np.array([moved_by(model, j) for j in self.bodies]).reshape(len(self.bodies), model.nv)
        self._place_points(points)
        self.surfaces = MovingSurfaces([p.moving for p in points])
        every = np.arange(self.n_points)
        places = (every - self.n_fixed) % SLOTS
        self.first_place = np.where(every < self.n_fixed, every, every - places)

        self.row_kinds: list[list[int]] = [[] for _ in points]
        self.tangents = np.zeros((self.n_points, 2, 3))
        if self.mu[: self.n_points].any() or slots.n:
            motion = point_motion(model, data, self)
            slots.mobility = motion[0][self.n_fixed :: SLOTS]
            self.row_kinds, self.tangents = friction_directions(self, motion[0] + motion[2], motion[1])
        self.row_kinds += [[] for _ in limits] + [list(range(x.n_F)) for x in own]
        self.n_F = np.array([len(kinds) for kinds in self.row_kinds], dtype=int)
        ends = np.cumsum(self.n_F)
        self.kinds = np.array([kind for kinds in self.row_kinds for kind in kinds], dtype=int)
        self.first_F = ends - self.n_F
        self.friction_rows = tuple(slice(int(e - k), int(e)) for e, k in zip(ends, self.n_F, strict=True))
        self.reach = _reach(model, self)
        # a limit is told in the distance that its coordinate moves the points, so that it does not widen the reach
        ways = self.reach[self.limit_dof]
        ways = np.where((ways > 0.0) & np.isfinite(ways), ways, 1.0)
        self.measure = np.concatenate((np.ones(len(points)), ways, np.ones(len(own))))
        self.reach[self.limit_dof] = np.maximum(self.reach[self.limit_dof], ways)
        self.length = max(length, _length(model, self))
        sizes = [self.length] * len(points), [limit.yardstick for limit in limits], [self.length] * len(own)
        self.yardstick = np.concatenate(sizes)
        self._subsets: dict[bytes, Subset] = {}

    def _place_points(self, points: list[ContactPoint]) -> None:
        """Points and the surfaces that they touch, each in the frame of its body."""
        self.point = np.array([p.point for p in points]).reshape(-1, 3)
        self.radius = np.array([p.radius for p in points])
        surfaces = [p.surface for p in points]
        self.normal = np.array([s.normal for s in surfaces]).reshape(-1, 3)
        self.offset = np.array([s.offset for s in surfaces])
        self.centre = np.array([s.centre for s in surfaces]).reshape(-1, 3)
        self.axis = np.array([s.axis for s in surfaces]).reshape(-1, 3)
        self.surface_radius = np.array([s.radius for s in surfaces])
        self.half_length = np.array([s.half_length for s in surfaces])
        self.side = np.array([s.side for s in surfaces])
        self.curved = np.array([not s.is_plane for s in surfaces], dtype=bool)
        self.drilling = 3.0 * np.pi / 16.0 * np.array([p.law.contact_radius for p in points])  # (157)

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
        curves: places of the contacts whose coefficient depends on the speed of slip, each with its curve.
        plan: the subset as the compiled kernel knows it, made when it is used first.
        surfaces: those that move along themselves, None where none does.
    """

    def __init__(self, table: ContactTable, index: np.ndarray):
        self.table, self.index = table, index
        self.plan: Plan | None = None
        self.surfaces: MovingSurfaces | None = None
        self.k = len(index)
        n_F = table.n_F[index]
        self.of_F = np.repeat(np.arange(self.k), n_F)
        self.m = len(self.of_F)
        self.of_row = np.concatenate((np.arange(self.k), self.of_F))
        self.rows_F = np.repeat(table.first_F[index] - np.cumsum(n_F) + n_F, n_F) + np.arange(self.m)
        self.kind_F = table.kinds[self.rows_F]

        k, m = self.k, self.m
        self.mu = table.mu[index]
        varies = np.flatnonzero(table.has_curve[index]).tolist()
        self.curves = [(place, curve) for place in varies if (curve := table.curves[index[place]]) is not None]
        self.e = np.concatenate((table.e_N[index], table.e_F[index][self.of_F]))
        self.bounces = bool(self.e.any())
        self.mu_F, self.mu_twice = self.mu[self.of_F], np.tile(self.mu, 2)
        self._of_F_twice = np.concatenate((self.of_F, self.of_F + k))
        # places in the vectors of `laws`: friction, and the normal forces that bound it
        self.friction_places = np.concatenate((np.arange(2 * k, 2 * k + m), np.arange(3 * k + m, 3 * k + 2 * m)))
        self.places = (slice(0, k), slice(k, k + m))
        self.normal_places = np.concatenate((np.arange(k, 2 * k), np.arange(2 * k + m, 3 * k + m)))
        # the row of W that gives each of them its scale: friction rows of a contact share the one of the first
        first = np.searchsorted(self.of_F, np.arange(k))
        rows = np.concatenate((np.arange(k), k + first[self.of_F]))
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
            self.surfaces = self.points.surfaces
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
        self.surfaces = table.surfaces.of(index)
        self.drill_F = table.drilling[index][self.of_F] * (self.kind_F == 2)
        self.fixed_planes = not self.moving_surface and not self.any_curved
        if self.fixed_planes:
            self.fixed_d, self.fixed_q = self.row_vectors(self.normal, self.tangent)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the contacts."""
        return tuple(self.table.names[i] for i in self.index)

    @cached_property
    def parts(self) -> tuple[Subset, Subset]:
        """The points fixed in a body, and the places of changing features."""
        return self.table.subset(self.index[: self.k_fixed]), self.table.subset(self.index[self.k_fixed :])

    def coefficients(self, gamma_F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Friction coefficients at a slip, shape (m,), and their slopes by its speed [s/m], shape (k,) each."""
        mu, slope = self.mu.copy(), np.zeros(self.k)
        if self.curves:
            speed = np.sqrt(np.bincount(self.of_F, gamma_F * gamma_F, self.k))
            for i, curve in self.curves:
                (mu[i],), (slope[i],) = curve(speed[i : i + 1])
        return mu, slope

    def norms(self, x: np.ndarray) -> np.ndarray:
        """Norms over the friction rows of each contact of two vectors in one, shape (2 m,) -> (2 k,)."""
        return np.sqrt(np.bincount(self._of_F_twice, x * x, 2 * self.k))

    def unit(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """X over its norm in each contact, and the norms, both of shape (m,)."""
        norm = np.maximum(np.sqrt(np.bincount(self.of_F, x * x, self.k)), TINY)[self.of_F]
        return x / norm, norm

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

    @cached_property
    def friction_pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """All pairs of friction rows of one contact, also of a row with itself, shape (pairs,) each."""
        first = np.searchsorted(self.of_F, np.arange(self.k + 1))
        found = [(f, g) for a, b in pairwise(first.tolist()) for f in range(a, b) for g in range(a, b)]
        pairs = np.array(found, dtype=int).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    @cached_property
    def friction_triples(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of three friction rows f, g, h of one contact: places of (f, g) and (g, h) among the pairs, and h."""
        f, g = self.friction_pairs
        first, last = np.searchsorted(f, g), np.searchsorted(f, g, side="right")
        place = np.repeat(np.arange(len(f)), last - first)
        follows = np.concatenate([np.arange(a, b) for a, b in zip(first, last, strict=True)] or [first])
        return place, follows, g[follows]

    @cached_property
    def same_contact(self) -> np.ndarray:
        """1 where two friction rows belong to the same contact, shape (m, m)."""
        return (self.of_F[:, None] == self.of_F).astype(float)

    def row_vectors(self, n: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Parts d and q of the wrenches of all rows from normals (k, 3) and tangents (k, 2, 3)."""
        o = self.of_F
        d_F = np.where(self.kind_F[:, None] == 2, 0.0, t[o, np.minimum(self.kind_F, 1)])
        q_F = self.drill_F[:, None] * n[o] - self.radius[o, None] * cross(n[o], d_F)
        return np.concatenate((n, d_F)), np.concatenate((np.zeros_like(n), q_F))


def moved_by(model: pin.Model, joint: int) -> np.ndarray:
    """1 for the velocity coordinates on the path from the world to a joint, shape (nv,)."""
    moved = np.zeros(model.nv)
    for j in model.supports[int(joint)]:
        if j > 0:
            moved[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = 1.0
    return moved


def _reach(model: pin.Model, table: ContactTable) -> np.ndarray:
    """Bound of the way of any point of contact per unit of each velocity coordinate, shape (nv,)."""
    turned = table.axis.any(axis=1)
    endless = ~table.curved | (turned & ~np.isfinite(table.half_length))
    size = table.surface_radius + np.where(turned, table.half_length, 0.0) + np.linalg.norm(table.centre, axis=1)
    distances = np.full(len(table.bodies), -1.0)
    np.maximum.at(distances, table.body_b, np.linalg.norm(table.point, axis=1) + table.radius)
    np.maximum.at(distances, table.body_a, np.where(endless, np.inf, size))
    bodies = zip(table.bodies.tolist(), distances.tolist(), strict=True)
    return np.max([np.zeros(model.nv), *(_joint_reach(model, *body) for body in bodies if body[0] > 0)], axis=0)


def _joint_reach(model: pin.Model, joint: int, distance: float) -> np.ndarray:
    """How far a point at `distance` from the origin of a joint moves per unit of each coordinate, at most."""
    reach = np.zeros(model.nv)
    while joint > 0:
        i, n = model.idx_vs[joint], model.nvs[joint]
        S = own_motions(model, joint)
        linear, angular = np.linalg.norm(S[:3], axis=0), np.linalg.norm(S[3:], axis=0)
        turns = angular > 0
        reach[i : i + n] = linear
        reach[i : i + n][turns] += angular[turns] * distance
        # what sits below a joint that slides can be any distance away from the joints above it
        slide = np.inf if linear.any() else 0.0
        distance += float(np.linalg.norm(model.jointPlacements[joint].translation)) + slide
        joint = model.parents[joint]
    return reach


def _length(model: pin.Model, table: ContactTable) -> float:
    """The largest distance between a joint and what is attached to it: joints, contact points, round surfaces [m].

    One, where everything is in one point.
    """
    links = [float(np.linalg.norm(p.translation)) for p in list(model.jointPlacements)[1:]]
    round_ = np.where(np.isfinite(table.surface_radius), table.surface_radius, 0.0)
    points = np.linalg.norm(table.point, axis=1) + table.radius + round_
    return max([0.0, *links, *points]) or 1.0
