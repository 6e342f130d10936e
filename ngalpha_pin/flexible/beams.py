"""The beams of a scene, compiled: their equations of motion, and their points as joints of the kinematic tree.

Pinocchio knows nothing of beams. A point of a beam enters its model as a massless planar joint (x, y, theta) of the
world, so that every contact, constraint and frame works on it as on any other joint. With the control points q_b of the
beam, its shape functions and the direction t = r' of the centreline,

    (x, y) = sum N_i q_i,   theta = angle(t),   u = d/dt (x, y, theta) = T(q_b) v_b

and rows W_u, X_u, Y_u in the coordinates of the joints become W = W_u T, X = X_u T + W_u du/dq and
Y = Y_u T + W_u du_dot/dv.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from .band import BandMatrix
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
    """The model with a massless planar joint, and a frame of the same name, for every beam point."""
    extended = model.copy()
    for point in points:
        joint = pin.JointModelComposite()
        for axis in (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelRZ()):
            joint.addJoint(axis)
        extended.addJointFrame(extended.addJoint(0, joint, beams[point.beam].plane, point.name))
    return extended


class Beams:
    """All beams of a scene. Their coordinates follow those of the tree.

    Args:
        model: the tree.
        beams: by name.
        points: the joints behind those of the tree, in this order.
        loads: what acts on the beams beside gravity.

    Attributes:
        n: number of coordinates of all beams.
        M: mass matrices, one for each beam.
        mass: of all beams [kg].
        factor: of gravity and loads; statics raises it from 0 to 1.
    """

    def __init__(self, model: pin.Model, beams: dict[str, PlanarBeam], points: list[BeamPoint], loads: list[Load]):
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
        g = model.gravity.linear
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

    def rounding(self, q: np.ndarray, K: tuple[BandMatrix, ...]) -> np.ndarray:
        """Size of the forces whose rounding is felt: stiffness times coordinates, shape (n,) [N]."""
        size = [np.abs(q[self._nq :][part]).max() for part in self._parts]
        return np.concatenate([np.abs(band.diagonal()) * x for band, x in zip(K, size, strict=True)])

    def energy(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float, float]:
        """Kinetic energy, potential of gravity and loads, and strain energy [J]."""
        kinetic = elastic = potential = 0.0
        for beam, part in zip(self.beams, self._parts, strict=True):
            q_b = q[self._nq :][part]
            kinetic += beam.kinetic_energy(v[self._nv :][part])
            elastic += beam.strain_energy(q_b)
            potential -= float((self._gravity + self._dead)[part] @ q_b)
        return kinetic, potential + self._origin, elastic


class _PointShapes:
    """Shape functions of all beam points, and the map T from control points to (x, y, theta)."""

    def __init__(self, beams: dict[str, PlanarBeam], part_of: dict[str, slice], points: list[BeamPoint], n: int):
        self.count = len(points)
        self.T = np.zeros((3 * self.count, n))
        self._dT = np.zeros((self.count, n))
        self._N1, self._dofs, self._band, self._turn = [], [], [], []
        names = list(beams)
        for i, point in enumerate(points):
            beam, start = beams[point.beam], part_of[point.beam].start
            N = beam.basis.values(np.array([point.xi]), 1)[:, 0]
            first = start + 2 * int(beam.basis.element(np.array([point.xi]))[0])
            dofs = slice(first, first + 2 * len(N[0]))
            self.T[3 * i, dofs][0::2] = self.T[3 * i + 1, dofs][1::2] = N[0]
            self._N1.append(N[1])
            t = N[1] @ beam.q_ref.reshape(-1, 2)[(first - start) // 2 :][: len(N[1])]
            self._turn.append(np.repeat(np.abs(N[1]), 2) / (SHORTEST * np.linalg.norm(t)))
            self._dofs.append(dofs)
            self._band.append((names.index(point.beam), first - start))
        self._H = np.zeros((self.count, 2, 2))

    def move(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(x, y, theta) of all points, their rates and second derivatives, shape (3 n_points,) each."""
        theta, bias = np.zeros(self.count), np.zeros(self.count)
        self._t_dot = np.zeros((self.count, 2))
        for i, (N1, dofs) in enumerate(zip(self._N1, self._dofs, strict=True)):
            t, self._t_dot[i] = N1 @ q[dofs].reshape(-1, 2), N1 @ v[dofs].reshape(-1, 2)
            theta[i], gradient, self._H[i] = direction_gradients(t)
            self.T[3 * i + 2, dofs] = np.outer(N1, gradient).ravel()
            bias[i] = self._t_dot[i] @ self._H[i] @ self._t_dot[i]
        x, u_dot = self.T @ q, self.T @ a
        x[2::3] = theta
        u_dot[2::3] += bias
        return x, self.T @ v, u_dot

    def turning_rate_by_q(self) -> np.ndarray:
        """Derivative of the angular velocities by q, half that of the angular accelerations by v, (n_points, n)."""
        for i, (N1, dofs) in enumerate(zip(self._N1, self._dofs, strict=True)):
            self._dT[i, dofs] = np.outer(N1, self._H[i] @ self._t_dot[i]).ravel()
        return self._dT

    def add_moments(self, moments: np.ndarray, K: list[np.ndarray]) -> np.ndarray:
        """Generalized force of moments at the points, shape (n,); its stiffness is taken off the bands K."""
        for i in np.flatnonzero(moments):
            N1, (beam, first) = self._N1[i], self._band[i]
            block = moments[i] * np.einsum("a,b,kl->akbl", N1, N1, self._H[i]).reshape(2 * len(N1), -1)
            w = len(K[beam]) // 2
            places = first + np.arange(len(block))
            K[beam][w + places[:, None] - places, places] -= block
        return moments @ self.T[2::3]

    def reach(self, of_points: np.ndarray) -> np.ndarray:
        """Largest reach over the points, by their displacement and by the turning of the centreline, shape (n,)."""
        reach = np.zeros(self.T.shape[1])
        for i, dofs in enumerate(self._dofs):
            shift, turn = of_points[3 * i : 3 * i + 2].max(), of_points[3 * i + 2]
            moved = np.abs(self.T[3 * i : 3 * i + 2, dofs]).sum(axis=0) * shift
            reach[dofs] = np.maximum(reach[dofs], moved + (turn * self._turn[i] if turn else 0.0))
        return reach
