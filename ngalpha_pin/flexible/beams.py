"""The beams of a scene, compiled: their equations of motion, and their points as joints of the kinematic tree.

Pinocchio knows nothing of beams. A point of a beam enters its model as massless joints x, y and theta of the world, so
that every contact, constraint and frame works on it as on any other joint. With the control points q_b of the beam, its
shape functions N_i and the direction t = r' of the centreline,

    (x, y) = sum N_i q_i,   theta = angle(t),   u = d/dt (x, y, theta) = T(q_b) v_b

and rows W_u, X_u, Y_u in the coordinates of the joints become W = W_u T, X = X_u T + W_u du/dq and
Y = Y_u T + W_u du_dot/dv.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin import engine
from ngalpha_pin.numerics.band import BandMatrix

from .loads import LineLoad, Load, PointLoad
from .planar_beam import PlanarBeam
from .strains import direction_gradients

SHORTEST = 0.5  # stretch down to which the turning of the centreline is bounded in the search for contacts


class BeamPoint(NamedTuple):
    """A point of a beam that contacts, constraints and loads can name.

    Attributes:
        name: of the point, and of its joint and frame.
        beam: name of the beam.
        xi: place on the centreline, in [0, 1].
    """

    name: str
    beam: str
    xi: float


class Slices(NamedTuple):
    """Places of a beam in q and in v."""

    q: slice
    v: slice


class BeamForces(NamedTuple):
    """Internal forces minus loads of all beams, shape (n,) [N], and their derivatives, one band for each beam."""

    f: np.ndarray
    K: tuple[BandMatrix, ...]
    D: tuple[BandMatrix, ...]


def with_points(model: pin.Model, beams: dict[str, PlanarBeam], points: list[BeamPoint]) -> pin.Model:
    """The model with massless joints x, y and theta, and a frame of the name of the point, for every beam point.

    Three joints in a chain: Pinocchio's derivatives take the axes of a composite joint as fixed in the moved frame.
    """
    if not points:
        return model
    extended = model.copy()
    for point in points:
        x = extended.addJoint(0, pin.JointModelPX(), beams[point.beam].plane, f"{point.name} x")
        y = extended.addJoint(x, pin.JointModelPY(), pin.SE3.Identity(), f"{point.name} y")
        theta = extended.addJoint(y, pin.JointModelRZ(), pin.SE3.Identity(), point.name)
        extended.addJointFrame(theta)
    return extended


class Beams:
    """All beams of a scene. Their coordinates follow those of the tree.

    Args:
        model: the tree.
        beams: by name.
        points: the joints behind those of the tree, in this order.
        loads: what acts on the beams beside gravity.
        forces: of the scene; those that change gravity do so on beams.

    Attributes:
        n: number of coordinates of all beams.
        M: mass matrices, one for each beam.
        mass: of all beams [kg].
        factor: of gravity and loads; statics raises it from 0 to 1.
    """

    def __init__(
        self,
        model: pin.Model,
        beams: dict[str, PlanarBeam],
        points: list[BeamPoint],
        loads: list[Load],
        forces: Sequence[Any] = (),
    ):
        self._nq, self._nv = model.nq, model.nv
        self.beams = tuple(beams.values())
        ends = np.cumsum([0, *(beam.nv for beam in self.beams)])
        self.n = int(ends[-1])
        self._parts = tuple(slice(int(a), int(b)) for a, b in zip(ends[:-1], ends[1:], strict=True))
        part_of = dict(zip(beams, self._parts, strict=True))
        self.M = tuple(beam.M for beam in self.beams)
        self.mass = sum(beam.mass for beam in self.beams)
        self.factor = 1.0
        self.points = tuple(points)
        self._shapes = _PointShapes(beams, part_of, points, self.n)
        self._gravity = np.zeros(self.n)
        given = np.array(model.gravity.linear)
        g = sum((force.more_than(given) for force in forces if hasattr(force, "more_than")), given)
        self._origin = -sum(beam.mass * float(g @ beam.plane.translation) for beam in self.beams)  # [J]
        for beam, part in zip(self.beams, self._parts, strict=True):
            self._gravity[part] = np.kron(beam.node_mass, beam.plane.rotation[:, :2].T @ g)
        self._set_loads(beams, part_of, loads)

    def _set_loads(self, beams: dict[str, PlanarBeam], part_of: dict[str, slice], loads: list[Load]) -> None:
        """Constant forces of the loads, and the moments at the points."""
        self._dead, self._moments = np.zeros(self.n), np.zeros(len(self.points))
        places = {point.name: i for i, point in enumerate(self.points)}
        for load in loads:
            if isinstance(load, LineLoad):
                beam = beams[load.beam]
                force = beam.plane.rotation[:, :2].T @ np.asarray(load.force, dtype=float)
                self._dead[part_of[load.beam]] += np.kron(beam.node_mass / beam.line_density, force)
            elif isinstance(load, PointLoad):
                i = places[load.point]
                force = beams[self.points[i].beam].plane.rotation[:, :2].T @ np.asarray(load.force, dtype=float)
                self._dead += force @ self._shapes.T[3 * i : 3 * i + 2]
                self._moments[i] += load.moment

    @property
    def conserved(self) -> bool:
        """The loads have a potential that `energy` knows."""
        return not self._moments.any()

    def place(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, velocities and accelerations of tree and beam points; kept for `rows` and `row_derivatives`.

        Args:
            q: of tree and beams, shape (nq,).
            v: shape (nv,).
            a: shape (nv,).
        """
        if not self.points:
            return q[: self._nq], v[: self._nv], a[: self._nv]
        nq, nv, shapes = self._nq, self._nv, self._shapes
        x, u, u_dot = shapes.move(q[nq:], v[nv:], a[nv:])
        return np.concatenate((q[:nq], x)), np.concatenate((v[:nv], u)), np.concatenate((a[:nv], u_dot))

    def rows(self, W_u: np.ndarray) -> np.ndarray:
        """Rows in the coordinates of tree and beams from those of tree and points, after `place`."""
        nv = self._nv
        return np.concatenate((W_u[:, :nv], W_u[:, nv:] @ self._shapes.T), axis=1)

    def row_derivatives(self, W_u: np.ndarray, X_u: np.ndarray, Y_u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the rates by q and of the accelerations by v; see the head of this file."""
        turning = W_u[:, self._nv + 2 :: 3]
        X, Y = self.rows(X_u), self.rows(Y_u)
        change = turning @ self._shapes.turning_rate_by_q()
        X[:, self._nv :] += change
        Y[:, self._nv :] += 2.0 * change
        return X, Y

    def reach(self, of_points: np.ndarray) -> np.ndarray:
        """Bound of the gap change per unit of each coordinate, from that of the points, shape (n,)."""
        return self._shapes.reach(of_points)

    def forces(self, q: np.ndarray, v: np.ndarray) -> BeamForces:
        """What the beams add to the residual M a + f of the equations of motion, after `place` at q.

        Args:
            q: of tree and beams, shape (nq,).
            v: shape (nv,).
        """
        f, K, D = -self.factor * (self._gravity + self._dead), [], []
        for beam, part in zip(self.beams, self._parts, strict=True):
            internal = beam.internal_forces(q[self._nq :][part], v[self._nv :][part])
            f[part] += internal.f
            K.append(internal.K)
            D.append(np.zeros_like(internal.K) if internal.D is None else internal.D)
        if self._moments.any():
            f -= self._shapes.add_moments(self.factor * self._moments, K)
        return BeamForces(f, tuple(map(BandMatrix, K)), tuple(map(BandMatrix, D)))

    def native(self) -> Any:
        """The beams as the engine takes them."""
        tables = [beam.table for beam in self.beams]
        load = self._gravity + self._dead
        return engine.Beams(tables, *self._shapes.of_points(), load.tolist(), self._moments.tolist())

    def rounding(self, q: np.ndarray, K: tuple[BandMatrix, ...]) -> np.ndarray:
        """Size of the forces whose rounding is felt: stiffness times coordinates, shape (n,) [N]."""
        size = [np.abs(q[self._nq :][part]).max() for part in self._parts]
        return np.concatenate([np.abs(band.diagonal()) * x for band, x in zip(K, size, strict=True)])

    def energy(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float]:
        """Kinetic energy, and potential of gravity and dead forces [J]."""
        pairs = zip(self.beams, self._parts, strict=True)
        kinetic = sum(beam.kinetic_energy(v[self._nv :][part]) for beam, part in pairs)
        return kinetic, self._origin - float((self._gravity + self._dead) @ q[self._nq :])

    def strain_energy(self, q: np.ndarray) -> float:
        """Of all beams [J]."""
        pairs = zip(self.beams, self._parts, strict=True)
        return sum(beam.strain_energy(q[self._nq :][part]) for beam, part in pairs)

    def damping_power(self, q: np.ndarray, v: np.ndarray) -> float:
        """Power of the damping of the material of all beams, not positive [W]."""
        power = 0.0
        for beam, part in zip(self.beams, self._parts, strict=True):
            if beam.damping:
                x, x_dot = q[self._nq :][part], v[self._nv :][part]
                moving, still = (beam.internal_forces(x, rate).f for rate in (x_dot, np.zeros_like(x_dot)))
                power -= float((moving - still) @ x_dot)
        return power


class _PointShapes:
    """Shape functions of all beam points, and the map T from control points to (x, y, theta)."""

    def __init__(self, beams: dict[str, PlanarBeam], part_of: dict[str, slice], points: list[BeamPoint], n: int):
        count = len(points)
        self.T = np.zeros((3 * count, n))
        # by point, row of (x, y, theta), control point, coordinate
        by_control = self.T.reshape(count, 3, n // 2, 2)
        self._dN, self._turning = np.zeros((count, n // 2)), by_control[:, 2]
        self._first_dof = [part_of[point.beam].start for point in points]
        self._beam = [list(beams).index(point.beam) for point in points]
        self._by_turn = np.zeros((count, n))
        self._first: list[int] = []
        self._values: list[tuple[np.ndarray, np.ndarray]] = []
        for i, point in enumerate(points):
            beam, xi = beams[point.beam], np.array([point.xi])
            N, dN = beam.basis.values(xi, 1)[:, 0]
            first = self._first_dof[i] // 2 + int(beam.basis.element(xi)[0])
            places = slice(first, first + len(N))
            by_control[i, 0, places, 0] = by_control[i, 1, places, 1] = N
            self._dN[i, places] = dN
            self._first.append(first)
            self._values.append((N, dN))
            t = beam.centreline(beam.q_ref, xi, 1)
            self._by_turn[i] = np.repeat(np.abs(self._dN[i]), 2) / (SHORTEST * np.linalg.norm(t))

    def move(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(x, y, theta) of all points, their rates and second derivatives, shape (3 n_points,) each."""
        t, t_dot = self._dN @ q.reshape(-1, 2), self._dN @ v.reshape(-1, 2)
        theta, gradient, self._H = direction_gradients(t)
        self._bend = np.einsum("pij,pj->pi", self._H, t_dot)
        np.multiply(self._dN[:, :, None], gradient[:, None, :], out=self._turning)
        x, u_dot = self.T @ q, self.T @ a
        x[2::3] = theta
        u_dot[2::3] += np.einsum("pi,pi->p", self._bend, t_dot)
        return x, self.T @ v, u_dot

    def of_points(self) -> tuple[list[int], list[int], list[float], list[float]]:
        """Of each point, the first coordinate that moves it and how many shape functions do; all of these, and dN."""
        sizes = [len(N) for N, _ in self._values]
        N, dN = ([float(x) for values in self._values for x in values[i]] for i in (0, 1))
        return [2 * first for first in self._first], sizes, N, dN

    def turning_rate_by_q(self) -> np.ndarray:
        """Derivative of the angular velocities by q, half that of the angular accelerations by v, (n_points, n)."""
        return (self._dN[:, :, None] * self._bend[:, None, :]).reshape(len(self._dN), -1)

    def add_moments(self, moments: np.ndarray, K: list[np.ndarray]) -> np.ndarray:
        """Generalized force of moments at the points, shape (n,); its stiffness is taken off the bands K."""
        for i in np.flatnonzero(moments):
            used = np.flatnonzero(self._dN[i])
            dN, band = self._dN[i, used], K[self._beam[i]]
            block = moments[i] * np.einsum("a,b,kl->akbl", dN, dN, self._H[i]).reshape(2 * len(used), -1)
            places = (2 * used[:, None] + np.arange(2)).ravel() - self._first_dof[i]
            band[len(band) // 2 + places[:, None] - places, places] -= block
        return moments @ self.T[2::3]

    def reach(self, of_points: np.ndarray) -> np.ndarray:
        """Largest reach over the points, by their displacement and by the turning of the centreline, shape (n,)."""
        if not len(of_points):
            return np.zeros(self.T.shape[1])
        moved = np.abs(self.T[0::3] + self.T[1::3]) * of_points.reshape(-1, 3)[:, :2].max(axis=1)[:, None]
        turned = np.where(of_points[2::3, None] > 0, self._by_turn, 0.0) * of_points[2::3, None]
        return (moved + turned).max(axis=0)


def slices_of(model: pin.Model, beams: dict[str, PlanarBeam]) -> dict[PlanarBeam, Slices]:
    """Places of every beam in q and in v, behind those of the model."""
    found, n = {}, 0
    for beam in beams.values():
        q, v = model.nq + n, model.nv + n
        found[beam] = Slices(slice(q, q + beam.nv), slice(v, v + beam.nv))
        n += beam.nv
    return found
