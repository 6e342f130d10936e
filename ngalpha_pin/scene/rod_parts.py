"""The rods of a scene: their declarations and their named points."""

from __future__ import annotations

from typing import Any

import coal
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.flexible.rod import Rod
from ngalpha_pin.scene.forces import Force
from ngalpha_pin.scene.model_parts import put_together
from ngalpha_pin.scene.rods import RodForce, node_name, rod_model


class RodParts:
    """What `Scene` offers for rods."""

    model: pin.Model
    forces: list[Force]

    @property
    def rods(self) -> dict[str, Rod]:
        """The rods of the scene by name."""
        return {force.name: force.rod for force in self.forces if isinstance(force, RodForce)}

    def add_rod(self, rod: Rod, name: str, radius: float | None = None) -> Rod:
        """Add a rod. Its nodes are the bodies "name 0", "name 1", ... of the model, which move freely.

        Every constraint, driven motion, spring, wrench and contact works on a node as on any other body. For contacts
        each node carries a sphere of its name; the name of the rod stands for all of them.

        Args:
            rod: the rod.
            name: of the rod; must be new.
            radius: of the spheres [m]; None is that of the section, 0 is no sphere.

        Returns:
            The rod, whose places in q and v are `scene.slices[rod]`.

        Raises:
            SceneError: the rod or its name is in the scene already, or there are beams or functions of all coordinates.
        """
        scene: Any = self
        checks.instance("rod", rod, Rod, "a Rod(...)")
        if checks.name("name of a rod", name) in self.rods or any(rod is other for other in self.rods.values()):
            raise SceneError(f"the scene has this rod or the name {name!r} already; choose another name")
        size = rod.section.radius if radius is None else checks.number(f"rod {name!r}: radius", radius, 0.0)
        part = type(scene)(rod_model(name, rod))
        for i in range(rod.nodes if size else 0):
            part.add_geometry(node_name(name, i), coal.Sphere(size), parent=node_name(name, i))
        part.add_force(RodForce(name, rod))
        put_together(scene, part, "", None, pin.SE3.Identity())
        scene._loaded = None
        return rod

    def add_rod_point(self, name: str, rod: str, xi: float) -> str:
        """Give a node of a rod a name: a frame with its x-axis along the rod, y and z the axes of the section.

        Args:
            name: must be new.
            rod: name of the rod.
            xi: place of the node, in [0, 1].

        Raises:
            SceneError: the name is taken, or there is no node at xi. UnknownName: there is no such rod.
        """
        if checks.name("rod", rod) not in self.rods:
            raise UnknownName("rod", rod, self.rods)
        node = node_name(rod, self.rods[rod].node(xi))
        if self.model.existFrame(checks.name("name of a rod point", name)) or self.model.existJointName(name):
            raise SceneError(f"the scene has a frame or joint named {name!r} already; choose another name")
        joint = self.model.getJointId(node)
        self.model.addFrame(pin.Frame(name, joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME), False)
        return name
