"""Rods and cables of a scene, strands: their nodes are bodies of the model, their elasticity and loads force laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError
from ngalpha_pin.flexible.beams import Slices
from ngalpha_pin.flexible.cable import Cable
from ngalpha_pin.flexible.rod import Rod
from ngalpha_pin.scene.protocols import Declared, Kinematics

Strand = Rod | Cable


class StrandForce:
    """The internal forces of a strand, between the nodes that `Scene.add_rod` or `add_cable` has put into the model.

    Args:
        name: of the strand; its nodes are the bodies "name 0", "name 1", ...
        strand: the rod or cable.
    """

    actuated = False
    numbers: tuple[float, ...] = ()

    def __init__(self, name: str, strand: Strand):
        self.name, self.strand = name, strand

    def check(self, scene: Declared) -> None:
        """Find the coordinates of the nodes.

        Raises:
            SceneError: a node is gone, or they do not follow each other.
        """
        model, names = scene.model, joints_of(self.name, self.strand)
        if not all(model.existJointName(name) for name in names):
            raise SceneError(f"{self.name!r}: a node of it is gone; a rod or cable stays or goes as a whole")
        first = model.getJointId(names[0])
        if [model.getJointId(name) for name in names] != list(range(first, first + len(names))):
            raise SceneError(f"{self.name!r}: its nodes do not follow each other in the model")
        q, v = int(model.idx_qs[first]), int(model.idx_vs[first])
        self.slices = Slices(slice(q, q + self.strand.nq), slice(v, v + self.strand.nv))

    def bind(self, kinematics: Kinematics) -> StrandForce:
        """See `Force`."""
        return self

    def enter(self, laws: Any) -> None:
        """Become one of the force laws of the engine."""
        add = laws.add_rod if isinstance(self.strand, Rod) else laws.add_cable
        add(self.strand.forces, self.slices.q.start, self.slices.v.start)

    def energy(self, q: np.ndarray) -> float:
        """Strain energy [J]."""
        return self.strand.strain_energy(q[self.slices.q])

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `Force`."""
        x, x_dot = np.ascontiguousarray(q[self.slices.q]), np.ascontiguousarray(v[self.slices.v])
        n = self.strand.nv
        f, by_q, by_v = np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
        self.strand.forces.subtract(x, x_dot, f, by_q, by_v, 0)
        at = self.slices.v
        tau[at] += f
        K[at, at] += by_q.T  # the engine has its matrices by columns
        D[at, at] += by_v.T


class StrandLoad:
    """A force of constant direction, spread evenly over the undeformed length of a rod or cable.

    Args:
        name: of the strand.
        strand: the rod or cable.
        force: per length, in the axes of the world, shape (3,) [N/m].
    """

    actuated = False

    def __init__(self, name: str, strand: Strand, force: Sequence[float]):
        self.name, self.strand, self.force = name, strand, np.array(force, dtype=float)

    def check(self, scene: Declared) -> None:
        """Find the coordinates of the strand."""
        law = StrandForce(self.name, self.strand)
        law.check(scene)
        self.slices = law.slices
        self._loads = np.outer(self.strand.node_length, self.force)

    def bind(self, kinematics: Kinematics) -> StrandLoad:
        """See `Force`."""
        return self

    def energy(self, q: np.ndarray) -> float:
        """Potential of the dead force, zero at the origin of the world [J]."""
        return -float(np.sum(self._loads * q[self.slices.q].reshape(self.strand.nodes, -1)[:, :3]))

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `Force`."""
        tau[self.slices.v].reshape(self.strand.nodes, -1)[:, :3] += self._loads


def node_name(strand: str, node: int) -> str:
    """Name of a node: of its body, of its frame and of its joint; of a node of a rod, of that in which it turns."""
    return f"{strand} {node}"


def place_of_node(strand: str, node: int) -> str:
    """Name of the joint in which a node of a rod moves."""
    return f"{strand} {node} place"


def reach(cable: str, segment: int) -> tuple[str, str]:
    """Names of the two geometries that keep a segment of a cable from getting longer: a point, and a sphere around."""
    return f"{node_name(cable, segment + 1)} end", f"{node_name(cable, segment)} reach"


def joints_of(name: str, strand: Strand) -> list[str]:
    """Names of the joints of all nodes, in their order."""
    if isinstance(strand, Cable):
        return [node_name(name, i) for i in range(strand.nodes)]
    return [joint for i in range(strand.nodes) for joint in (place_of_node(name, i), node_name(name, i))]


def strand_model(name: str, strand: Strand) -> pin.Model:
    """The nodes as free bodies: those of a cable move, those of a rod turn as well, by a second joint.

    Two joints, not one with six coordinates: velocities are then those of the world, and the mass matrix is constant
    and block diagonal.
    """
    model = pin.Model()
    for i in range(strand.nodes):
        at = 0
        if isinstance(strand, Rod):
            at = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), place_of_node(name, i))
        kind = pin.JointModelSpherical() if isinstance(strand, Rod) else pin.JointModelTranslation()
        joint = model.addJoint(at, kind, pin.SE3.Identity(), node_name(name, i))
        model.appendBodyToJoint(joint, strand.inertia(i), pin.SE3.Identity())
        frame = pin.Frame(node_name(name, i), joint, pin.SE3.Identity(), pin.FrameType.BODY)
        model.addFrame(frame, False)
    return model
