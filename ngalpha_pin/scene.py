"""Scene: what the user declares. Plain data, nothing computed."""

from __future__ import annotations

import os
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from .constraints import Constraint
from .contact import ContactLaw, ContactPair, Hollow
from .errors import SceneError, UnknownName
from .forces import Force
from .joints import JointLaws


class Scene:
    """A `pin.Model`, its geometries, and what acts between them.

    Args:
        model: the multibody tree. It is kept, not copied; do not change it after the first simulation.
        collision_model: geometries that contacts can name; copied, so that additions stay in the scene.
        visual_model: geometries that are drawn; by default what the collision model has.

    Attributes:
        model: `pin.Model`.
        collision_model: `pin.GeometryModel` with every geometry that a contact can name.
        visual_model: `pin.GeometryModel` or None.
        contacts: the declared pairs, in the order of declaration.
        constraints: the declared constraints.
        forces: the declared forces.
        joints: which properties of the joints act; replace it to leave some out.
        hollow: names of the geometries that are touched from the inside.
        added: names of the geometries that this class added; a viewer draws them beside the visual model.
    """

    def __init__(
        self,
        model: pin.Model,
        collision_model: pin.GeometryModel | None = None,
        visual_model: pin.GeometryModel | None = None,
    ):
        if not isinstance(model, pin.Model):
            raise SceneError(f"model must be a pin.Model, not {type(model).__name__}")
        self.model = model
        self.collision_model = collision_model.copy() if collision_model is not None else pin.GeometryModel()
        self.visual_model = visual_model
        self.contacts: list[ContactPair] = []
        self.constraints: list[Constraint] = []
        self.forces: list[Force] = []
        self.joints = JointLaws()
        self.hollow: set[str] = set()
        self.added: list[str] = []

    def __repr__(self) -> str:
        return (
            f"Scene({self.model.name!r}, nq={self.model.nq}, nv={self.model.nv}, "
            f"{self.collision_model.ngeoms} geometries, {len(self.contacts)} contact pairs, {len(self.forces)} forces)"
        )

    @classmethod
    def from_urdf(
        cls,
        path: str | os.PathLike[str],
        root_joint: pin.JointModel | None = None,
        package_dirs: Sequence[str | os.PathLike[str]] | None = None,
    ) -> Scene:
        """Read a URDF file with its collision and visual geometries.

        Args:
            path: the URDF file.
            root_joint: e.g. `pin.JointModelFreeFlyer()` for a floating base; None fixes the base to the world.
            package_dirs: folders in which `package://` paths are looked up; by default every folder above the file.

        Raises:
            SceneError: the file is missing, or a mesh is not found.
        """
        path = Path(path).resolve()
        if not path.is_file():
            raise SceneError(f"no URDF file at {path}")
        directories = [str(d) for d in (package_dirs if package_dirs is not None else path.parents)]
        try:
            joint = (root_joint,) if root_joint is not None else ()
            model = pin.buildModelFromUrdf(str(path), *joint)
            collision = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=directories)
            visual = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.VISUAL, package_dirs=directories)
        except (ValueError, RuntimeError) as error:
            raise SceneError(f"{path.name} cannot be read: {error}; meshes are looked up in package_dirs") from error
        return cls(model, collision, visual)

    @classmethod
    def from_mjcf(cls, path: str | os.PathLike[str]) -> Scene:
        """Read an MJCF file with its collision and visual geometries.

        Raises:
            SceneError: the file is missing or cannot be read.
        """
        path = Path(path).resolve()
        if not path.is_file():
            raise SceneError(f"no MJCF file at {path}")
        try:
            model = pin.buildModelFromMJCF(str(path))
            collision = pin.buildGeomFromMJCF(model, str(path), pin.GeometryType.COLLISION)
            visual = pin.buildGeomFromMJCF(model, str(path), pin.GeometryType.VISUAL)
        except (ValueError, RuntimeError) as error:
            raise SceneError(f"{path.name} cannot be read: {error}") from error
        return cls(model, collision, visual)

    def add_plane(self, name: str, point: Sequence[float] = (0, 0, 0), normal: Sequence[float] = (0, 0, 1)) -> str:
        """Add a half-space fixed to the world.

        Args:
            name: its name in contacts.
            point: a point of its surface, shape (3,) [m].
            normal: points out of the material, shape (3,) [-]; need not be a unit vector.

        Returns:
            The name.
        """
        n = np.asarray(normal, dtype=float)
        p = np.asarray(point, dtype=float)
        if n.shape != (3,) or p.shape != (3,) or not np.isfinite([*n, *p]).all() or np.linalg.norm(n) == 0:
            raise SceneError(f"plane {name!r}: point and normal must be finite vectors of length 3, normal not zero")
        # placed at `point`, so that the shape itself always passes through its origin
        n = n / np.linalg.norm(n)
        return self.add_geometry(name, coal.Halfspace(n, 0.0), placement=pin.SE3(np.eye(3), p))

    def add_geometry(
        self,
        name: str,
        shape: coal.CollisionGeometry | Hollow,
        parent: str | None = None,
        placement: pin.SE3 | None = None,
        color: Sequence[float] | None = None,
    ) -> str:
        """Attach a shape to a frame or joint of the model, or to the world.

        Args:
            name: its name in contacts; must be new.
            shape: a coal shape, or `Hollow` of one.
            parent: name of a frame or joint; None is the world.
            placement: pose of the shape in the parent.
            color: RGBA in [0, 1]; None is grey.

        Returns:
            The name.

        Raises:
            SceneError: the name is taken. UnknownName: there is no such parent.
        """
        if self.collision_model.existGeometryName(name):
            raise SceneError(f"the scene has a geometry named {name!r} already; choose another name")
        placement = pin.SE3.Identity() if placement is None else placement
        joint, pose = 0, placement
        if parent is not None:
            frame = self.frame(parent)
            joint, pose = frame.parentJoint, frame.placement * placement
        if isinstance(shape, Hollow):
            self.hollow.add(name)
            shape = shape.shape
        geometry = pin.GeometryObject(name, joint, pose, shape)
        geometry.meshColor = np.array(color if color is not None else (0.6, 0.6, 0.6, 1.0), dtype=float)
        self.collision_model.addGeometryObject(geometry)
        self.added.append(name)
        return name

    def add_contact(
        self, a: str, b: str, mu: float = 0.0, e_N: float = 0.0, e_F: float = 0.0, contact_radius: float = 0.0
    ) -> list[ContactPair]:
        """Declare contact between every geometry that matches `a` and every one that matches `b`.

        Args:
            a: name of a geometry, or a pattern such as `"*foot*"`.
            b: the same for the other side.
            mu: friction coefficient [-].
            e_N: restitution coefficient of the normal direction [-].
            e_F: restitution coefficient of the tangential direction [-].
            contact_radius: of Coulomb-Contensou friction (157) [m].

        Returns:
            The pairs that were declared; a pair on one and the same joint is left out.

        Raises:
            UnknownName: a pattern matches nothing. SceneError: a coefficient out of range, or no pair is left.
        """
        law = ContactLaw(mu, e_N, e_F, contact_radius)
        declared = {frozenset((p.geometry_a, p.geometry_b)) for p in self.contacts}
        pairs: list[ContactPair] = []
        for name_a in self.geometries(a):
            for name_b in self.geometries(b):
                key = frozenset((name_a, name_b))
                if len(key) == 1 or self._parent(name_a) == self._parent(name_b):
                    continue
                if key in declared:
                    raise SceneError(f"contact between {name_a!r} and {name_b!r} is declared already")
                declared.add(key)
                pairs.append(ContactPair(name_a, name_b, law))
        if not pairs:
            raise SceneError(f"no pair between {a!r} and {b!r}: all of them are on one and the same joint")
        self.contacts += pairs
        return pairs

    def add_constraint(self, constraint: Constraint) -> Constraint:
        """Add a bilateral constraint, e.g. `RevoluteJoint`; it is checked against the model at once.

        Raises:
            SceneError: it does not fit the model. UnknownName: a frame or joint is not there.
        """
        constraint.check(self)
        if constraint.name in {other.name for other in self.constraints}:
            raise SceneError(f"the scene has a constraint {constraint.name!r} already; give one of them a name")
        self.constraints.append(constraint)
        return constraint

    def add_force(self, force: Force) -> Force:
        """Add a force law, e.g. `JointPD`; it is checked against the model at once.

        Raises:
            SceneError: sizes do not fit the model. UnknownName: a joint is not there.
        """
        force.check(self)
        self.forces.append(force)
        return force

    def geometries(self, pattern: str) -> list[str]:
        """Names of the collision geometries that match the pattern, in the order of the model.

        Raises:
            UnknownName: there is none.
        """
        names = [g.name for g in self.collision_model.geometryObjects]
        found = [name for name in names if name == pattern] or [n for n in names if fnmatchcase(n, pattern)]
        if not found:
            raise UnknownName("geometry", pattern, names)
        return found

    def frame(self, name: str) -> pin.Frame:
        """The frame (or joint) of that name.

        Raises:
            UnknownName: there is none.
        """
        if not self.model.existFrame(name):
            if self.model.existJointName(name):  # a model built by hand has no frames of its joints
                joint = self.model.getJointId(name)
                return pin.Frame(name, joint, pin.SE3.Identity(), pin.FrameType.JOINT)
            raise UnknownName("frame", name, [f.name for f in self.model.frames] + list(self.model.names))
        return self.model.frames[self.model.getFrameId(name)]

    def geometry(self, name: str) -> pin.GeometryObject:
        """The collision geometry of that exact name.

        Raises:
            UnknownName: there is none.
        """
        if not self.collision_model.existGeometryName(name):
            raise UnknownName("geometry", name, [g.name for g in self.collision_model.geometryObjects])
        return self.collision_model.geometryObjects[self.collision_model.getGeometryId(name)]

    def _parent(self, name: str) -> int:
        return int(self.geometry(name).parentJoint)
