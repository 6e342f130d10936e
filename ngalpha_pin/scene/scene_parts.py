"""What a scene offers for putting it together from parts, for where it starts, and for sending it away."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.flexible.beams import BeamPoint, with_points
from ngalpha_pin.flexible.planar_beam import PlanarBeam
from ngalpha_pin.scene import posture, variants
from ngalpha_pin.scene.actuator import JointActuator
from ngalpha_pin.scene.constraints import Constraint
from ngalpha_pin.scene.contact import Hollow
from ngalpha_pin.scene.decomposition import THRESHOLD, decomposed
from ngalpha_pin.scene.extra_states import ExtraState, Rate
from ngalpha_pin.scene.forces import Force
from ngalpha_pin.scene.model_parts import body_model, part_of, put_together, taken_away
from ngalpha_pin.scene.names import matching
from ngalpha_pin.scene.pending_meshes import loaded, make_searchable
from ngalpha_pin.scene.strands import StrandForce, StrandLoad
from ngalpha_pin.scene.unilateral import UnilateralConstraint
from ngalpha_pin.scene.visuals import VisualFile


class SceneParts:
    """The part of `Scene` that is about other models, bodies, postures and drawing."""

    model: pin.Model
    declared_shapes: pin.GeometryModel
    constraints: list[Constraint]
    forces: list[Force]
    visuals: pin.GeometryModel | None
    beams: dict[str, PlanarBeam]
    beam_points: list[BeamPoint]
    visual_files: list[VisualFile]
    _loaded: pin.GeometryModel | None = None

    @property
    def _scene(self) -> Any:
        """The scene that this is a part of."""
        return self

    def frame(self, name: str) -> pin.Frame:
        """The frame (or joint) of that name; of a link and a joint with one name the link.

        Raises:
            UnknownName: there is none.
        """
        checks.name("frame", name)
        model = with_points(self.model, self.beams, self.beam_points)
        named = [frame for frame in model.frames if frame.name == name]
        if not named:
            if model.existJointName(name):  # a model built by hand has no frames of its joints
                joint = model.getJointId(name)
                return pin.Frame(name, joint, pin.SE3.Identity(), pin.FrameType.JOINT)
            raise UnknownName("frame", name, [f.name for f in model.frames] + list(model.names))
        return next((frame for frame in named if frame.type == pin.FrameType.BODY), named[0])

    def geometries(self, pattern: str) -> list[str]:
        """Names of the collision geometries that match the pattern, in the order of the model.

        The name of a rod, or of a mesh that is decomposed, is that of all of its parts.

        Raises:
            UnknownName: there is none.
        """
        checks.name("name or pattern of geometries", pattern)
        return matching("geometry", pattern, [g.name for g in self.declared_shapes.geometryObjects])

    def geometry(self, name: str) -> pin.GeometryObject:
        """The collision geometry of that exact name.

        Raises:
            UnknownName: there is none.
        """
        found = loaded(self.declared_shapes, name)
        make_searchable(self.declared_shapes, name)
        return found

    def decompose(self, pattern: str, threshold: float = THRESHOLD, most: int | None = None) -> list[str]:
        """Make convex parts of meshes, by coacd, where contact would take their convex hull.

        The parts have the contacts and properties of their mesh, and the name of the mesh stands for all of them. What
        coacd finds is kept on disk, by content.

        Args:
            pattern: name of a mesh, or a pattern that matches some.
            threshold: how concave a part may be, in parts of the size of the mesh, 0.01 to 1.
            most: at most so many parts of what hangs together; None is as many as the threshold needs.

        Returns:
            Names of the parts.

        Raises:
            UnknownName: the pattern matches nothing. SceneError: nothing that it matches is a mesh, or a mesh is not
                closed. MissingPackageError: coacd is not installed.
        """
        return decomposed(self._scene, pattern, threshold, most)

    def add_model(
        self,
        source: str | os.PathLike[str] | pin.Model | SceneParts,
        prefix: str = "",
        placement: pin.SE3 | None = None,
        root_joint: pin.JointModel | None = None,
        parent: str | None = None,
    ) -> str:
        """Add a robot, with its contacts, constraints, forces and geometries.

        Its coordinates follow those that are there, or those of the branch that carries it.

        Args:
            source: the path of a URDF or MJCF file, a `pin.Model`, or a scene.
            prefix: "left" makes `left/gripper` of the name `gripper`; empty leaves the names.
            placement: pose of its world in the parent; a root that moves freely is there at its neutral position.
            root_joint: of a URDF, e.g. `pin.JointModelFreeFlyer()`; None fixes it to the parent.
            parent: name of a frame that carries it; None is the world.

        Returns:
            What its names begin with, for patterns.

        Raises:
            SceneError: a name is taken, there are beams or functions of all coordinates already, or the file cannot be
                read. UnknownName: there is no such parent.
        """
        start = "" if isinstance(prefix, str) and not prefix else f"{checks.name('prefix', prefix)}/"
        part = part_of(source, root_joint, type(self._scene))
        put_together(self._scene, part, start, parent, checks.placement("placement", placement))
        self._loaded = None
        return start

    def add_body(
        self,
        name: str,
        shape: coal.ShapeBase | Hollow,
        mass: float | None = None,
        density: float | None = None,
        placement: pin.SE3 | None = None,
        free: bool = True,
        color: Sequence[float] | None = None,
        joint: pin.JointModel | None = None,
        parent: str | None = None,
    ) -> str:
        """Add a body of one shape: one that moves, freely or on a joint, with the inertia of its shape, or a fixed one.

        Args:
            name: of the body, of its joint and of its geometry.
            shape: a coal shape with a volume, or any if the body is fixed.
            mass: [kg], of a body that moves; or
            density: [kg/m^3].
            placement: pose in the parent; of a body that moves at its neutral position.
            free: the body moves; otherwise it is fixed to its parent.
            color: RGBA in [0, 1]; None is grey.
            joint: how it moves, e.g. `pin.JointModelPX()`; None is freely.
            parent: name of a body or frame that carries it; None is the world.

        Returns:
            The name.

        Raises:
            SceneError: the name is taken, mass or density is missing, or the shape has no volume; a body that is fixed
                has a joint. UnknownName: there is no such parent.
        """
        if not free:
            if joint is not None:
                raise SceneError(f"body {name!r}: one that is fixed has no joint; leave out joint= or free=False")
            return self._scene.add_geometry(name, shape, parent, placement, color=color)
        part = part_of(body_model(name, shape, mass, density, joint), None, type(self._scene))
        part.add_geometry(name, shape, parent=name, color=color)
        put_together(self._scene, part, "", parent, checks.placement("placement", placement))
        self._loaded = None
        return name

    def add_state(
        self,
        name: str,
        rate: Rate,
        start: float | Sequence[float] = 0.0,
        force: Rate | None = None,
        derivatives: Rate | None = None,
        scale: float = 1.0,
    ) -> ExtraState:
        """Add states z of the first order beside the motion, as a current or a pressure: z_dot = rate(t, q, v, z).

        They are integrated with the motion, to the order of the method or to the chosen accuracy, and are the last
        entries of v; `trajectory.states[name]` has them. q and v in the functions are those of the model.

        Args:
            name: must be new.
            rate: returns a number, or shape (n,) for several states.
            start: at the start of a run, a number or shape (n,).
            force: generalized force (t, q, v, z) on the model, shape (nv,) [N or N m]; None is none.
            derivatives: of (t, q, v, z): those of the rate by q (tangent), v and z, then those of the force; None takes
                differences.
            scale: size of the state, in parts of which it is to be right.

        Raises:
            SceneError: the name is taken, a function cannot be used, or the scene has beams.
        """
        scene = self._scene
        state = ExtraState(name, rate, start, force, derivatives, scale)
        if scene.beams:
            raise SceneError(f"state {name!r}: a scene with beams cannot have states of the first order")
        if name in {other.name for other in scene.states} or scene.model.existJointName(name):
            raise SceneError(f"the scene has a state or joint named {name!r} already; choose another name")
        state.check(scene)
        scene.states.append(state)
        return state

    def add_unilateral(self, constraint: UnilateralConstraint) -> UnilateralConstraint:
        """Add an own unilateral constraint; it is checked against the model at once.

        Raises:
            SceneError: it does not fit the model, its name is taken, or the scene has beams.
        """
        scene = self._scene
        checks.instance("constraint", constraint, UnilateralConstraint, "a UnilateralConstraint(...)")
        if scene.beams:
            raise SceneError(f"{constraint.name}: a scene with beams cannot have own unilateral constraints")
        if constraint.name in {other.name for other in (*scene.constraints, *scene.unilaterals)}:
            raise SceneError(f"the scene has a constraint {constraint.name!r} already; give one of them a name")
        constraint.check(scene)
        scene.unilaterals.append(constraint)
        return constraint

    def remove(self, name: str) -> None:
        """Take something away before a run: a constraint, a force with a name, a body with what it carries, a geometry.

        Contacts of what is gone go too.

        Args:
            name: of a constraint, an actuator, a joint or link, or a geometry, looked up in this order.

        Raises:
            UnknownName: there is nothing of that name. SceneError: a force or constraint needs it.
        """
        taken_away(self._scene, name)
        self._loaded = None

    def varied(
        self,
        *,
        mu: float | Mapping[str, float] | None = None,
        e_N: float | Mapping[str, float] | None = None,
        e_F: float | Mapping[str, float] | None = None,
        mass: Mapping[str, float] | None = None,
        kp: float | np.ndarray | None = None,
        kd: float | np.ndarray | None = None,
        forces: Sequence[Force] = (),
    ) -> Any:
        """Another scene with other parameters; this one stays as it is, and what both share is not to be changed.

        Args:
            mu: of all contacts, or by name or pattern of one of their geometries [-].
            e_N: likewise [-].
            e_F: likewise [-].
            mass: by name of a body or joint [kg]: of all that moves with it, with an inertia that is scaled alike.
            kp: stiffness of every `JointPD`, a number or shape (nv,) [N m / rad or N / m].
            kd: damping of every `JointPD`, likewise [N m s / rad or N s / m].
            forces: that are added.

        Raises:
            SceneError: a number is out of range, or there is nothing that it could belong to. UnknownName: a name
                matches nothing.
        """
        coefficients = {n: x for n, x in zip(("mu", "e_N", "e_F"), (mu, e_N, e_F), strict=True) if x is not None}
        gains = {n: x for n, x in zip(("kp", "kd"), (kp, kd), strict=True) if x is not None}
        return variants.varied(self._scene, coefficients, {} if mass is None else mass, gains, forces)

    @property
    def has_functions(self) -> bool:
        """There are forces, states or own unilateral constraints, which a file cannot hold."""
        scene = self._scene
        own = [force for force in scene.forces if not isinstance(force, (StrandForce, StrandLoad))]
        return bool(own or scene.states or scene.unilaterals)

    @property
    def collision_model(self) -> pin.GeometryModel:
        """Every geometry that a contact can name, meshes loaded.

        Raises:
            SceneError: a mesh cannot be read.
        """
        make_searchable(self.declared_shapes)
        return self.declared_shapes

    @collision_model.setter
    def collision_model(self, geometries: pin.GeometryModel) -> None:
        self.declared_shapes = geometries

    @property
    def visual_model(self) -> pin.GeometryModel | None:
        """Geometries that are drawn, loaded at the first request; None where the collision model is drawn."""
        if self.visual_files and self._loaded is None:
            self._loaded = pin.GeometryModel() if self.visuals is None else self.visuals.copy()
            for file in self.visual_files:
                for geometry in file.geometries(self.model).geometryObjects:
                    self._loaded.addGeometryObject(geometry)
        return self._loaded if self.visual_files else self.visuals

    @property
    def actuators(self) -> dict[str, JointActuator]:
        """Actuators by name; set their `ctrl`, a number or a function of (t, q, v)."""
        return {force.name: force for force in self.forces if isinstance(force, JointActuator)}

    @property
    def keyframes(self) -> dict[str, np.ndarray]:
        """Configurations that the files or the model name, each of shape (nq,)."""
        return posture.references(self._scene, None)

    def reference(self, name: str | None = None, srdf: str | os.PathLike[str] | None = None) -> np.ndarray:
        """A configuration that a file names: a keyframe, or a group state of an SRDF.

        Args:
            name: e.g. "standing"; None is the usual start ("standing", "half_sitting", "home" and the like, and the
                neutral configuration where there is none of them), within the limits.
            srdf: the SRDF file; None looks for one of the same robot beside the URDF.

        Returns:
            q, shape (nq,).

        Raises:
            UnknownName: no file names it. SceneError: the SRDF cannot be read.
        """
        return posture.reference(self._scene, name, None if srdf is None else str(checks.path("srdf", srdf)))

    def within_limits(self, q: np.ndarray) -> np.ndarray:
        """The configuration nearest to q within the limits of the joints, geared joints where their leaders put them.

        Args:
            q: shape (nq,).
        """
        return posture.within(self._scene, q)

    def place_on(self, surface: str, q: np.ndarray, clearance: float = 0.0, root: str | None = None) -> np.ndarray:
        """Move a robot or a body along z so that its lowest geometry is a distance above a surface.

        Args:
            surface: name or pattern of geometries fixed to the world.
            q: configuration, shape (nq,).
            clearance: distance of the nearest geometry that has a contact with the surface, or of the nearest one where
                none is declared [m].
            root: name of the joint that is moved, where several move freely.

        Returns:
            The configuration, shape (nq,).

        Raises:
            SceneError: nothing moves freely, the surface moves, or the body is beside it.
        """
        return posture.placed_on(self._scene, surface, q, checks.number("clearance", clearance), root)
