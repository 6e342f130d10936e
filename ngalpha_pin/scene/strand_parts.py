"""The rods and cables of a scene: their declarations and their named points."""

from __future__ import annotations

from typing import Any

import coal
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.flexible.cable import Cable
from ngalpha_pin.flexible.rod import Rod
from ngalpha_pin.scene.contact import Hollow
from ngalpha_pin.scene.forces import Force
from ngalpha_pin.scene.model_parts import put_together
from ngalpha_pin.scene.strands import Strand, StrandForce, node_name, reach, strand_model

UNSEEN = (0.0, 0.0, 0.0, 0.0)  # colour of what is no part of a body


class StrandParts:
    """What `Scene` offers for rods and cables."""

    model: pin.Model
    forces: list[Force]

    @property
    def strands(self) -> dict[str, Strand]:
        """The rods and cables of the scene by name."""
        return {force.name: force.strand for force in self.forces if isinstance(force, StrandForce)}

    @property
    def rods(self) -> dict[str, Rod]:
        """The rods of the scene by name."""
        return {name: strand for name, strand in self.strands.items() if isinstance(strand, Rod)}

    @property
    def cables(self) -> dict[str, Cable]:
        """The cables of the scene by name."""
        return {name: strand for name, strand in self.strands.items() if isinstance(strand, Cable)}

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
        _put(self, checks.instance("rod", rod, Rod, "a Rod(...)"), name, radius)
        return rod

    def add_cable(self, cable: Cable, name: str, radius: float | None = None) -> Cable:
        """Add a cable. Its nodes are the bodies "name 0", "name 1", ... of the model, which move but do not turn.

        `PointJoint` ties a node to another body; springs, wrenches and contacts work on it as on any body. Nodes of a
        cable that does not stretch have a contact with their neighbours from inside of a sphere around them.

        Args:
            cable: the cable.
            name: of the cable; must be new.
            radius: of the spheres at its nodes for contacts [m]; None is that of the cable, 0 is no sphere.

        Returns:
            The cable, whose places in q and v are `scene.slices[cable]`.

        Raises:
            SceneError: the cable or its name is in the scene already, or there are beams or functions of all
                coordinates.
        """
        _put(self, checks.instance("cable", cable, Cable, "a Cable(...)"), name, radius)
        return cable

    def add_rod_point(self, name: str, rod: str, xi: float) -> str:
        """Give a node of a rod a name: a frame with its x-axis along the rod, y and z the axes of the section.

        Args:
            name: must be new.
            rod: name of the rod.
            xi: place of the node, in [0, 1].

        Raises:
            SceneError: the name is taken, or there is no node at xi. UnknownName: there is no such rod.
        """
        return self._add_point(name, "rod", rod, self.rods, xi)

    def add_cable_point(self, name: str, cable: str, xi: float) -> str:
        """Give a node of a cable a name: a frame with the axes of the world.

        Args:
            name: must be new.
            cable: name of the cable.
            xi: place of the node, in [0, 1].

        Raises:
            SceneError: the name is taken, or there is no node at xi. UnknownName: there is no such cable.
        """
        return self._add_point(name, "cable", cable, self.cables, xi)

    def _add_point(self, name: str, kind: str, strand: str, there: dict[str, Any], xi: float) -> str:
        if checks.name(kind, strand) not in there:
            raise UnknownName(kind, strand, there)
        node = node_name(strand, there[strand].node(xi))
        if self.model.existFrame(checks.name(f"name of a {kind} point", name)) or self.model.existJointName(name):
            raise SceneError(f"the scene has a frame or joint named {name!r} already; choose another name")
        joint = self.model.getJointId(node)
        self.model.addFrame(pin.Frame(name, joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME), False)
        return name


def _put(scene: Any, strand: Strand, name: str, radius: float | None) -> None:
    """Add a rod or cable to a scene."""
    kind = type(strand).__name__.lower()
    if checks.name(f"name of a {kind}", name) in scene.strands or any(strand is x for x in scene.strands.values()):
        raise SceneError(f"the scene has this {kind} or the name {name!r} already; choose another name")
    size = strand.radius if radius is None else checks.number(f"{kind} {name!r}: radius", radius, 0.0)
    part = type(scene)(strand_model(name, strand))
    for i in range(strand.nodes if size else 0):
        part.add_geometry(node_name(name, i), coal.Sphere(size), parent=node_name(name, i))
    if isinstance(strand, Cable) and not strand.stretches:
        _keep_lengths(part, name, strand)
    part.add_force(StrandForce(name, strand))
    put_together(scene, part, "", None, pin.SE3.Identity())
    scene._loaded = None


def _keep_lengths(part: Any, name: str, cable: Cable) -> None:
    """Let every node but the first stay within a sphere around the one before it."""
    for i, length in enumerate(cable.lengths):
        point, sphere = reach(name, i)
        part.add_geometry(sphere, Hollow(coal.Sphere(length)), parent=node_name(name, i), color=UNSEEN)
        part.add_geometry(point, coal.Sphere(0.0), parent=node_name(name, i + 1))
        part.add_contact(point, sphere, mu=0.0, e_N=0.0)
