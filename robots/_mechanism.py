"""What the mechanisms of rods share: a tree that is built joint by joint, with what is drawn of it."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

Point = Sequence[float] | np.ndarray
STEEL, BLUE, ORANGE = (0.55, 0.58, 0.62, 1.0), (0.12, 0.45, 0.72, 1.0), (0.94, 0.48, 0.12, 1.0)


def rod_inertia(mass: float, start: Point, end: Point) -> pin.Inertia:
    """A thin homogeneous rod between two points [kg, m, kg m^2]."""
    a, b = np.array(start, dtype=float), np.array(end, dtype=float)
    d = b - a
    return pin.Inertia(mass, (a + b) / 2, mass / 12 * (d @ d * np.eye(3) - np.outer(d, d)))


class Tree:
    """A tree of bodies; every body has the name of its joint.

    Args:
        name: of the model.
        gravity: shape (3,) [m/s^2].

    Attributes:
        model: `pin.Model`.
    """

    def __init__(self, name: str, gravity: Point = (0.0, 0.0, -9.81)):
        self.model, self._visual = pin.Model(), pin.GeometryModel()
        self.model.name, self.model.gravity.linear = name, np.array(gravity)

    def add(self, name: str, joint: pin.JointModel, inertia: pin.Inertia, at: Point, parent: str = "universe") -> None:
        """Add a body on a joint whose frame stands at a point of its parent, parallel to it."""
        model = self.model
        placement = pin.SE3(np.eye(3), np.array(at, dtype=float))
        index = model.addJoint(model.getJointId(parent), joint, placement, name)
        model.addJointFrame(index)
        model.appendBodyToJoint(index, inertia, pin.SE3.Identity())

    def frame(self, name: str, body: str, at: Point) -> None:
        """Name a point of a body."""
        placement = pin.SE3(np.eye(3), np.array(at, dtype=float))
        self.model.addFrame(pin.Frame(name, self.model.getJointId(body), placement, pin.FrameType.OP_FRAME))

    def draw_rod(self, body: str, start: Point, end: Point, radius: float, color: Point = STEEL) -> None:
        """Draw a rod between two points of a body."""
        a, b = np.array(start, dtype=float), np.array(end, dtype=float)
        d = b - a
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), d).matrix()
        self.draw(body, coal.Capsule(radius, float(np.linalg.norm(d))), pin.SE3(turn, (a + b) / 2), color)

    def draw_ball(self, body: str, centre: Point, radius: float, color: Point = ORANGE) -> None:
        """Draw a ball on a body."""
        self.draw(body, coal.Sphere(radius), pin.SE3(np.eye(3), np.array(centre, dtype=float)), color)

    def draw(self, body: str, shape: coal.CollisionGeometry, placement: pin.SE3, color: Point) -> None:
        """Draw a shape on a body."""
        name = f"{body}_{self._visual.ngeoms}"
        drawn = pin.GeometryObject(name, self.model.getJointId(body), placement, shape)
        drawn.meshColor = np.array(color)
        self._visual.addGeometryObject(drawn)

    def scene(self) -> nga.Scene:
        """The scene of the tree."""
        return nga.Scene(self.model, visual_model=self._visual)


def by_joint(model: pin.Model, values: dict[str, float]) -> np.ndarray:
    """Values of joints with one coordinate in the order of the model, zero where none is given, shape (nv,)."""
    found = np.zeros(model.nv)
    for name, value in values.items():
        found[model.idx_vs[model.getJointId(name)]] = value
    return found
