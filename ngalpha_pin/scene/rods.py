"""Rods of a scene: their nodes are bodies of the model, their elasticity and their loads are force laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError
from ngalpha_pin.flexible.beams import Slices
from ngalpha_pin.flexible.rod import Rod
from ngalpha_pin.scene.protocols import Declared, Kinematics


class RodForce:
    """The internal forces of a rod, between the nodes that `Scene.add_rod` has put into the model.

    Args:
        name: of the rod; its nodes are the bodies "name 0", "name 1", ...
        rod: the rod.
    """

    actuated = False
    numbers: tuple[float, ...] = ()

    def __init__(self, name: str, rod: Rod):
        self.name, self.rod = name, rod

    def check(self, scene: Declared) -> None:
        """Find the coordinates of the nodes.

        Raises:
            SceneError: a node is gone, or they do not follow each other.
        """
        model, n = scene.model, self.rod.nodes
        names = [joint for i in range(n) for joint in (place_of_node(self.name, i), node_name(self.name, i))]
        if not all(model.existJointName(name) for name in names):
            raise SceneError(f"rod {self.name!r}: a node of it is gone; a rod stays or goes as a whole")
        first = model.getJointId(names[0])
        if [model.getJointId(name) for name in names] != list(range(first, first + 2 * n)):
            raise SceneError(f"rod {self.name!r}: its nodes do not follow each other in the model")
        q, v = int(model.idx_qs[first]), int(model.idx_vs[first])
        self.slices = Slices(slice(q, q + self.rod.nq), slice(v, v + self.rod.nv))

    def bind(self, kinematics: Kinematics) -> RodForce:
        """See `Force`."""
        return self

    def enter(self, laws: Any) -> None:
        """Become one of the force laws of the engine."""
        laws.add_rod(self.rod.forces, self.slices.q.start, self.slices.v.start)

    def energy(self, q: np.ndarray) -> float:
        """Strain energy [J]."""
        return self.rod.strain_energy(q[self.slices.q])

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `Force`."""
        x, x_dot = np.ascontiguousarray(q[self.slices.q]), np.ascontiguousarray(v[self.slices.v])
        n = self.rod.nv
        f, by_q, by_v = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
        self.rod.forces.subtract(x, x_dot, f, by_q, by_v, 0)
        at = self.slices.v
        tau[at] += f
        K[at, at] += by_q.T  # the engine has its matrices by columns
        D[at, at] += by_v.T


class RodLoad:
    """A force of constant direction, spread evenly over the undeformed length of a rod.

    Args:
        name: of the rod.
        rod: the rod.
        force: per length, in the axes of the world, shape (3,) [N/m].
    """

    actuated = False

    def __init__(self, name: str, rod: Rod, force: Sequence[float]):
        self.name, self.rod, self.force = name, rod, np.array(force, dtype=float)

    def check(self, scene: Declared) -> None:
        """Find the coordinates of the rod."""
        law = RodForce(self.name, self.rod)
        law.check(scene)
        self.slices = law.slices
        self._loads = np.outer(self.rod.node_length, self.force)

    def bind(self, kinematics: Kinematics) -> RodLoad:
        """See `Force`."""
        return self

    def energy(self, q: np.ndarray) -> float:
        """Potential of the dead force, zero at the origin of the world [J]."""
        return -float(np.sum(self._loads * q[self.slices.q].reshape(-1, 7)[:, :3]))

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `Force`."""
        tau[self.slices.v].reshape(-1, 6)[:, :3] += self._loads


def node_name(rod: str, node: int) -> str:
    """Name of a node: of its body, of its frame and of the joint in which it turns."""
    return f"{rod} {node}"


def place_of_node(rod: str, node: int) -> str:
    """Name of the joint in which a node moves."""
    return f"{rod} {node} place"


def rod_model(name: str, rod: Rod) -> pin.Model:
    """The nodes as free bodies, each a translation and a turn in a chain.

    Two joints, not one with six coordinates: velocities are then those of the world, and the mass matrix is constant
    and block diagonal.
    """
    model = pin.Model()
    for i in range(rod.nodes):
        place = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), place_of_node(name, i))
        turn = model.addJoint(place, pin.JointModelSpherical(), pin.SE3.Identity(), node_name(name, i))
        model.appendBodyToJoint(turn, rod.inertia(i), pin.SE3.Identity())
        frame = pin.Frame(node_name(name, i), turn, pin.SE3.Identity(), pin.FrameType.BODY)
        model.addFrame(frame, False)
    return model
