"""What the parts of a scene ask of each other: what declarations are checked against, what a force acts on."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import pinocchio as pin


class Declared(Protocol):
    """A scene as its declarations see it; `Scene` is one."""

    @property
    def model(self) -> pin.Model:
        """The tree."""

    def frame(self, name: str) -> pin.Frame:
        """The frame of that name, or of the joint of that name."""

    def geometry(self, name: str) -> pin.GeometryObject:
        """The geometry of that name."""


class Kinematics(Protocol):
    """The bodies that a force acts on; a compiled system has them."""

    @property
    def model(self) -> pin.Model:
        """The tree."""

    @property
    def nv(self) -> int:
        """Velocities of the tree."""

    @property
    def scene(self) -> Any:
        """Where frames are looked up by name."""

    @property
    def poses(self) -> tuple[list[np.ndarray], list[np.ndarray]]:
        """Rotation and translation of every joint after the last call of `place` or of the equations of motion."""

    def motion(self, v: np.ndarray, a: np.ndarray) -> Any:
        """Joint Jacobians in the world and their derivatives there, with v and a."""

    def place(self, q: np.ndarray) -> None:
        """Move the bodies to q."""


Editable = Any
"""A `Scene` that parts are put into and taken out of, whose class stands above these files."""
