"""Scene: what the user declares. Plain data, nothing computed."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any
from weakref import WeakSet

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.flexible.beams import BeamPoint
from ngalpha_pin.flexible.loads import Load
from ngalpha_pin.flexible.planar_beam import PlanarBeam
from ngalpha_pin.scene.anchors import ANCHORS, from_anchor
from ngalpha_pin.scene.beam_parts import BeamParts
from ngalpha_pin.scene.compliance import Compliance
from ngalpha_pin.scene.constraints import Constraint
from ngalpha_pin.scene.contact import ContactLaw, ContactPair, Hollow
from ngalpha_pin.scene.contents import Contents, warn_of
from ngalpha_pin.scene.decomposition import decompose_concave
from ngalpha_pin.scene.extra_states import ExtraState
from ngalpha_pin.scene.forces import Force
from ngalpha_pin.scene.friction_curve import Curve
from ngalpha_pin.scene.friction_ellipse import FrictionEllipse
from ngalpha_pin.scene.height_field import FIELDS, prisms, prisms_of
from ngalpha_pin.scene.joints import JointLaws
from ngalpha_pin.scene.mjcf.reader import read_mjcf
from ngalpha_pin.scene.model_checks import checked_shape
from ngalpha_pin.scene.model_files import checked_geometries, checked_model
from ngalpha_pin.scene.pair_filter import pairs_between, pairs_of_srdf, warn_of_hulls
from ngalpha_pin.scene.restitution import Restitution
from ngalpha_pin.scene.scene_parts import SceneParts
from ngalpha_pin.scene.surface_velocity import SurfaceVelocity
from ngalpha_pin.scene.unilateral import UnilateralConstraint
from ngalpha_pin.scene.urdf import read_urdf
from ngalpha_pin.scene.visuals import VisualFile


class Scene(SceneParts, BeamParts):
    """A `pin.Model`, its geometries, and what acts between them.

    Args:
        model: the multibody tree. It is kept, not copied; do not change it after the first simulation. None is an
            empty one, for beams alone.
        collision_model: geometries that contacts can name; copied, so that additions stay in the scene.
        visual_model: geometries that are drawn; by default what the collision model has.

    Attributes:
        model: `pin.Model`.
        declared_shapes: `collision_model`, in which meshes that nothing has asked for are still empty, and those that
            only contact has asked for have no tree for distances.
        visual_files: files whose visual geometries are loaded when something is drawn.
        contacts: the declared pairs, in the order of declaration.
        constraints: the declared constraints.
        forces: the declared forces.
        beams: flexible bodies by name; their coordinates follow those of the model.
        beam_points: points of beams that have a name; frames as those of the model.
        loads: dead loads on beams.
        joints: which properties of the joints act; replace it to leave some out.
        hollow: names of the geometries that are touched from the inside.
        surfaces: properties of geometries, see `set_surface`.
        disabled: pairs of names that an SRDF excludes.
        complete: geometries of each MJCF file, which says which of them may touch: patterns add none to these.
        left_out: pairs that overlapped at the start of a simulation.
        added: names of the geometries that this class added; a viewer draws them beside the visual model.
        contents: what the files declare, and what becomes of it.
        states: of the first order, beside the motion.
        unilaterals: own unilateral constraints.
        simulators: those in which it runs.
    """

    def __init__(
        self,
        model: pin.Model | None = None,
        collision_model: pin.GeometryModel | None = None,
        visual_model: pin.GeometryModel | None = None,
    ):
        self.model = checked_model(pin.Model() if model is None else model)
        self.declared_shapes = checked_geometries(self.model, collision_model)
        if visual_model is not None:
            checks.instance("visual_model", visual_model, pin.GeometryModel, "a pin.GeometryModel")
        self.visuals, self.visual_files = visual_model, []
        self.contacts: list[ContactPair] = []
        self.constraints: list[Constraint] = []
        self.forces: list[Force] = []
        self.beams: dict[str, PlanarBeam] = {}
        self.beam_points: list[BeamPoint] = []
        self.loads: list[Load] = []
        self.joints = JointLaws()
        self.hollow: set[str] = set()
        self.surfaces: dict[str, ContactLaw] = {}
        self.disabled: set[frozenset[str]] = set()
        self.complete: list[frozenset[str]] = []
        self.left_out: list[ContactPair] = []
        self.added: list[str] = []
        self.contents = Contents()
        self.states: list[ExtraState] = []
        self.unilaterals: list[UnilateralConstraint] = []
        self.simulators: WeakSet[Any] = WeakSet()

    def __repr__(self) -> str:
        n, name = self.declared_shapes.ngeoms, f"{self.model.name!r}, " if self.model.name else ""
        parts = f"{n} geometries, {len(self.contacts)} contact pairs, {len(self.forces)} forces"
        return f"Scene({name}nq={self.model.nq}, nv={self.model.nv}, {parts})"

    @classmethod
    def from_urdf(
        cls,
        path: str | os.PathLike[str],
        root_joint: pin.JointModel | None = None,
        package_dirs: Sequence[str | os.PathLike[str]] | None = None,
        convex_decomposition: bool = False,
    ) -> Scene:
        """Read a URDF file with its collision and visual geometries.

        Args:
            path: the URDF file.
            root_joint: e.g. `pin.JointModelFreeFlyer()` for a floating base; None fixes the base to the world.
            package_dirs: folders in which `package://` paths are looked up; by default every folder above the file.
            convex_decomposition: make convex parts of meshes that are smaller than their hull, see `decompose`.

        What is not used as declared is named in one warning; `contents` has all of it.

        Raises:
            SceneError: the file is missing or cannot be read, or a mesh is not found. MissingPackageError: meshes are
                to be decomposed and coacd is not installed.
        """
        file = read_urdf(path, root_joint, package_dirs)
        try:
            scene = cls(file.model, file.collision_model)
        except SceneError as error:
            raise SceneError(f"{os.path.basename(path)}: {error}") from error
        folders = None if package_dirs is None else tuple(os.path.abspath(d) for d in package_dirs)
        scene.visual_files.append(VisualFile(os.path.abspath(path), "urdf", folders))
        scene.constraints += file.constraints
        scene.contents += file.contents
        warn_of(os.path.basename(path), scene.contents)
        if convex_decomposition:
            decompose_concave(scene)
        return scene

    @classmethod
    def from_mjcf(cls, path: str | os.PathLike[str], constraints: bool = True) -> Scene:
        """Read an MJCF file with MuJoCo's compiler: everything in it that acts, its contacts included.

        q is MuJoCo's qpos but for quaternions, see `q_from_mujoco`; gaps and limits are rigid. What is not used as
        declared is named in one warning; `contents` has all of it.

        Args:
            path: the MJCF file.
            constraints: take over the active equality constraints.

        Raises:
            SceneError: the file is missing or cannot be read, or MuJoCo is not installed.
        """
        file = read_mjcf(path)
        scene = cls(file.model, file.collision_model)
        scene.visual_files.append(VisualFile(os.path.abspath(path), "mjcf"))
        scene.contacts, scene.surfaces, scene.contents[:] = file.contacts, file.surfaces, file.contents
        scene.hollow = file.hollow
        scene.complete.append(frozenset(g.name for g in scene.declared_shapes.geometryObjects))
        for constraint in file.constraints if constraints else []:
            scene.add_constraint(constraint)
        for force in file.forces:
            scene.add_force(force)
        for limit in file.unilaterals:
            scene.add_unilateral(limit)
        warn_of(os.path.basename(path), scene.contents)
        return scene

    def add_plane(self, name: str, point: Sequence[float] = (0, 0, 0), normal: Sequence[float] = (0, 0, 1)) -> str:
        """Add a half-space fixed to the world.

        Args:
            name: its name in contacts.
            point: a point of its surface, shape (3,) [m].
            normal: points out of the material, shape (3,) [-]; need not be a unit vector.

        Returns:
            The name.

        Raises:
            SceneError: the name is taken, or a vector cannot be used.
        """
        p = checks.vector(f"plane {name!r}: point", point)
        n = checks.direction(f"plane {name!r}: normal", normal)
        # placed at `point`, so that the shape itself always passes through its origin
        return self.add_geometry(name, coal.Halfspace(n, 0.0), placement=pin.SE3(np.eye(3), p))

    def add_height_field(
        self,
        name: str,
        heights: np.ndarray,
        size: Sequence[float],
        placement: pin.SE3 | None = None,
        depth: float | None = None,
    ) -> str:
        """Add terrain that is fixed to the world, as one convex geometry for every flat piece.

        Args:
            name: start of the names of the pieces.
            heights: z at the points of a regular grid, x along the first axis, shape (n, m) [m].
            size: extent of the grid along x and y, about the origin of the placement [m].
            placement: pose of the grid in the world.
            depth: how far the material reaches below the lowest point [m]; None is a tenth of the size.

        Returns:
            The pattern that matches all pieces, for `add_contact`.

        Raises:
            SceneError: the numbers do not make a field.
        """
        checks.name("name of a height field", name)
        for end, piece in list(prisms(heights, size, depth)):
            self.add_geometry(f"{name}_{end}", piece, placement=placement)
        return f"{name}_*"

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
            shape: a coal shape, or `Hollow` of one; a height field of coal becomes convex pieces.
            parent: name of a frame or joint; None is the world.
            placement: pose of the shape in the parent.
            color: RGBA in [0, 1]; None is grey.

        Returns:
            The name; of a height field the pattern that matches its pieces.

        Raises:
            SceneError: the name is taken, or a size or the placement is none. UnknownName: there is no such parent.
        """
        if isinstance(shape, FIELDS):
            checks.name("name of a geometry", name)
            for end, piece in list(prisms_of(shape)):
                self.add_geometry(f"{name}_{end}", piece, parent, placement, color)
            return f"{name}_*"
        if self.declared_shapes.existGeometryName(checks.name("name of a geometry", name)):
            raise SceneError(f"the scene has a geometry named {name!r} already; choose another name")
        joint, pose = 0, checks.placement(f"geometry {name!r}: placement", placement)
        rgba = checks.vector(f"geometry {name!r}: color", (0.6, 0.6, 0.6, 1.0) if color is None else color, 4)
        if parent is not None:
            frame = self.frame(parent)
            joint, pose = frame.parentJoint, frame.placement * pose
        checked = checked_shape(name, shape.shape if isinstance(shape, Hollow) else shape)
        geometry = pin.GeometryObject(name, joint, pose, checked)
        geometry.meshColor = rgba
        self.declared_shapes.addGeometryObject(geometry)
        if isinstance(shape, Hollow):
            self.hollow.add(name)
        self.added.append(name)
        return name

    def set_surface(
        self, pattern: str, mu: float = 0.0, e_N: float | Callable[[float], float] | Restitution = 0.0,
        e_F: float = 0.0, contact_radius: float = 0.0, rolling_resistance: float = 0.0,
        compliance: Compliance | None = None,
    ) -> None:  # fmt: skip
        """Properties of the surface of every geometry that matches, for contacts that do not name them.

        Between two surfaces acts the geometric mean of mu, the smaller restitution, the larger contact radius and
        rolling resistance, and one compliance behind the other.

        Raises:
            UnknownName: the pattern matches nothing. SceneError: a coefficient out of range.
        """
        law = ContactLaw(
            checks.number("mu", mu, 0.0), e_N, e_F, contact_radius,
            rolling_resistance=rolling_resistance, compliance=compliance,
        )  # fmt: skip
        self.surfaces |= {name: law for name in self.geometries(pattern)}

    def disable_contacts(self, srdf: str | os.PathLike[str]) -> None:
        """Leave out the pairs that an SRDF file, or its text, disables; of those declared so far and later by patterns.

        Raises:
            SceneError: the file is missing or cannot be read.
        """
        self.disabled |= pairs_of_srdf(self, srdf)
        self.contacts = [pair for pair in self.contacts if pair.key not in self.disabled]

    def add_contact(
        self,
        a: str,
        b: str,
        mu: float | Curve | FrictionEllipse | None = None,
        e_N: float | Callable[[float], float] | Restitution | None = None,
        e_F: float | None = None,
        contact_radius: float | None = None,
        surface_velocity: SurfaceVelocity | Sequence[float] | None = None,
        adhesion: float | None = None,
        compliance: Compliance | None = None,
        rolling_resistance: float | None = None,
    ) -> list[ContactPair]:
        """Declare contact between every geometry that matches `a` and every one that matches `b`.

        Two patterns with a wildcard, such as `"*"` and `"*"`, leave out what is declared already, what an SRDF disables
        and geometries on joints that follow each other; `simulate` leaves out pairs that overlap at q0, and warns.

        Args:
            a: name of a geometry, or a pattern such as `"*foot*"`.
            b: the same for the other side.
            mu: friction coefficient [-], `Stribeck` or `FrictionCurve` where it depends on the speed of slip, or a
                `FrictionEllipse`; None is that of the two surfaces, see `set_surface`, or 0.
            e_N: restitution coefficient of the normal direction [-], f(speed) or `Restitution`; None likewise.
            e_F: restitution coefficient of the tangential direction [-]; None likewise.
            contact_radius: of Coulomb-Contensou friction (157) [m]; None likewise.
            surface_velocity: with which the surface of `b` moves along itself in the axes of its geometry, as that of a
                belt, shape (3,) [m/s]; of turntables, drums and speeds that change see `SurfaceVelocity`.
            adhesion: force that every point of the contact holds once it is closed, as a vacuum cup [N].
            compliance: `KelvinVoigt` or `HuntCrossley` of every point of the contact; None is rigid.
            rolling_resistance: arm of the normal force that resists rolling, mu_R times the radius of a ball [m].

        Returns:
            The pairs that were declared; a pair on one and the same joint is left out. Of two patterns all of whose
            pairs a file has declared, and without coefficients, those.

        Raises:
            UnknownName: a pattern matches nothing. SceneError: a coefficient out of range, or no pair is left.
        """
        laws: dict[str, Any] = {"mu": mu, "e_N": e_N, "e_F": e_F, "contact_radius": contact_radius}
        laws |= {"surface_velocity": surface_velocity, "adhesion": adhesion, "rolling_resistance": rolling_resistance}
        laws |= {"compliance": compliance}
        given = {name: value for name, value in laws.items() if value is not None}
        pairs = pairs_between(self, a, b, given)
        new = [pair for pair in pairs if pair not in self.contacts]
        warn_of_hulls(self, new)
        self.contacts += new
        return pairs

    def add_constraint(
        self, constraint: Constraint | pin.PointAnchorConstraintModel | pin.FrameAnchorConstraintModel
    ) -> Constraint:
        """Add a bilateral constraint, e.g. `RevoluteJoint`; it is checked against the model at once.

        Args:
            constraint: one of this package, or a `PointAnchorConstraintModel` or `FrameAnchorConstraintModel` of
                Pinocchio, which becomes a `PointJoint` or a `Weld`.

        Returns:
            The constraint.

        Raises:
            SceneError: it does not fit the model. UnknownName: a frame or joint is not there.
        """
        if len(self.simulators):
            raise SceneError(
                "the scene is running in a Simulator, which would not see the constraint: simulator.weld(frame_a, "
                "frame_b) and simulator.lock(joint) tie what runs; for another run, give it a scene of its own"
            )
        if isinstance(constraint, ANCHORS):
            constraint = from_anchor(self, constraint)
        if not isinstance(constraint, Constraint) or isinstance(constraint, type):
            raise checks.fail("constraint", constraint, "a constraint such as RevoluteJoint(...)")
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
        if not all(callable(getattr(force, method, None)) for method in ("check", "bind")) or isinstance(force, type):
            raise checks.fail("force", force, "a force such as JointPD(...)")
        force.check(self)
        self.forces.append(force)
        return force
