"""What a scene is made of, checked: shapes, geometries, and the bodies and joints of a `pin.Model`."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache, partial

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.common.tolerances import MOVABLE
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.contents import listed
from ngalpha_pin.scene.convex_hull import LARGEST, hull, plane_of
from ngalpha_pin.scene.meshes import is_pending

# sizes of each primitive shape; zero makes a point, a segment, a disc or a plate of it
_SIZES: dict[type[coal.CollisionGeometry], tuple[str, ...]] = {
    coal.Sphere: ("radius",),
    coal.Capsule: ("radius", "halfLength"),
    coal.Cylinder: ("radius", "halfLength"),
    coal.Cone: ("radius", "halfLength"),
    coal.Box: ("halfSide",),
    coal.Ellipsoid: ("radii",),
}
# rounding of inertias in files, in parts of the largest of the body about its joint
ROUNDED = 1e-6
# what moments of two digits can be off by, in parts of the largest one: more than that is no rounding
TWO_DIGITS = 0.01
# vectors of a model that cannot be negative
_NOT_NEGATIVE = ("armature", "damping", "rotorInertia")
_FINITE = (*_NOT_NEGATIVE, "rotorGearRatio", "friction")
_LIMITS = (
    "lowerPositionLimit", "upperPositionLimit", "lowerEffortLimit", "upperEffortLimit",
    "lowerDryFrictionLimit", "upperDryFrictionLimit",
)  # fmt: skip


def checked_shape(name: str, shape: coal.CollisionGeometry) -> coal.CollisionGeometry:
    """The shape of a geometry as contacts can use it: of a flat mesh or polygon a thin plate.

    Args:
        name: of the geometry.
        shape: of coal.

    Raises:
        SceneError: it is none of coal's shapes, or its sizes or points are not finite, negative or of no shape.
    """
    what = f"geometry {name!r}"
    checks.instance(f"{what}: shape", shape, coal.CollisionGeometry, "a coal shape such as coal.Box, or Hollow of one")
    if isinstance(shape, coal.ShapeBase):
        checks.number(f"{what}: swept sphere radius", shape.getSweptSphereRadius(), 0.0, LARGEST)
    if isinstance(shape, (coal.Halfspace, coal.Plane)):
        checks.direction(f"{what}: normal", shape.n)
        checks.number(f"{what}: offset d", shape.d, -LARGEST, LARGEST)
    elif isinstance(shape, (coal.BVHModelBase, coal.ConvexBase)):
        points = np.array(shape.vertices() if isinstance(shape, coal.BVHModelBase) else shape.points())
        return shape if plane_of(what, points) is None else hull(what, points)
    elif isinstance(shape, coal.TriangleP):
        plane_of(what, np.array([shape.a, shape.b, shape.c]))
    for size in next((sizes for kind, sizes in _SIZES.items() if isinstance(shape, kind)), ()):
        value = np.atleast_1d(np.asarray(getattr(shape, size), dtype=float))
        # an ellipsoid has no flat limit: its curvature grows without bound
        lowest = np.nextafter(0.0, 1.0) if isinstance(shape, coal.Ellipsoid) else 0.0
        if not (np.isfinite(value) & (value >= lowest) & (value <= LARGEST)).all():
            said = value.tolist() if len(value) > 1 else float(value[0])
            kind, wanted = type(shape).__name__, "positive" if lowest else "not negative"
            raise SceneError(f"{what}: {size} = {said} of its {kind}: expected finite lengths, {wanted}")
    return shape


def checked_geometry(geometry: pin.GeometryObject) -> pin.GeometryObject:
    """A collision geometry as contacts can use it; a copy where its shape is another one.

    Raises:
        SceneError: as of `checked_shape`, or its placement is no pose.
    """
    checks.placement(f"geometry {geometry.name!r}: placement", geometry.placement)
    given = geometry.geometry
    shape = given if is_pending(geometry) else checked_shape(geometry.name, given)
    if shape is given:
        return geometry
    plate = pin.GeometryObject(geometry.name, geometry.parentJoint, geometry.placement, shape)
    plate.parentFrame, plate.meshColor = geometry.parentFrame, geometry.meshColor
    return plate


def check_model(model: pin.Model) -> None:
    """Check the numbers of a model: inertias, placements of joints, gravity, damping and limits.

    Raises:
        SceneError: one of them is impossible; the message names the body or joint.
    """
    checks.vector("model.gravity.linear", model.gravity.linear)
    for name, placement in zip(model.names, model.jointPlacements, strict=True):
        checks.placement(f"joint {name!r}: placement", placement)
    one_axis = cache(lambda: _turn_about_one_axis(model))  # dear for many bodies, and seldom asked for

    def planar(joint: int) -> Callable[[], bool]:
        return lambda: one_axis()[joint]

    for i, (name, inertia) in enumerate(zip(model.names, model.inertias, strict=True)):
        check_inertia(partial(body_of, model, name), inertia, planar(i))
    for attribute in (*_FINITE, *_LIMITS):
        values = np.asarray(getattr(model, attribute, ()), dtype=float)
        wrong = np.isnan(values) if attribute in _LIMITS else ~np.isfinite(values)
        wrong |= (values < 0.0) & (attribute in _NOT_NEGATIVE)
        if wrong.any():
            i = int(np.flatnonzero(wrong)[0])
            of_q = len(values) == model.nq != model.nv or attribute.endswith("PositionLimit")
            joint = _joint_of(model, i, of_q)
            wanted = "a number" if attribute in _LIMITS else "a finite number"
            wanted += ", not negative" if attribute in _NOT_NEGATIVE else ""
            raise SceneError(f"model.{attribute}[{i}] = {values[i]} of joint {joint!r}: expected {wanted}")


def body_of(model: pin.Model, joint: str) -> str:
    """What moves with a joint: its links, where the model has them as frames."""
    j = model.getJointId(joint)
    links = [repr(f.name) for f in model.frames if f.parentJoint == j and f.type == pin.FrameType.BODY]
    if not links:
        return f"body of joint {joint!r}"
    return f"link {listed(links)} on joint {joint!r}" if j else f"link {listed(links)}, fixed to the world"


def _joint_of(model: pin.Model, i: int, of_q: bool) -> str:
    starts, sizes = (model.idx_qs, model.nqs) if of_q else (model.idx_vs, model.nvs)
    return next(n for n, first, k in zip(model.names, starts, sizes, strict=True) if first <= i < first + k)


def _turn_about_one_axis(model: pin.Model) -> list[bool]:
    """Whether the body of each joint turns about a single axis at most, in whatever configuration."""
    data, q = model.createData(), pin.integrate(model, pin.neutral(model), np.linspace(0.3, 0.7, model.nv))
    J = pin.computeJointJacobians(model, data, q).reshape(6, -1)[3:]
    columns = [
        np.concatenate([np.arange(model.idx_vs[j], model.idx_vs[j] + model.nvs[j]) for j in support])
        for support in model.supports
    ]
    return [bool(np.linalg.matrix_rank(J[:, own], tol=MOVABLE) <= 1) if len(own) else True for own in columns]


def check_inertia(what: Callable[[], str], inertia: pin.Inertia, planar: Callable[[], bool] = lambda: False) -> None:
    """Check the inertia of a body: finite, of a mass and moments that are not negative.

    The largest moment of a body is at most the sum of the others; what moments of two digits can be off by is warned
    of. Not so of a planar one, which turns about one axis: there only one moment acts, and the others may be left out.

    Raises:
        SceneError: it is impossible.
    """
    mass, lever, moments = float(inertia.mass), np.asarray(inertia.lever), np.asarray(inertia.inertia)
    if not (np.isfinite(mass) and mass >= 0.0):
        raise SceneError(f"{what()}: mass = {mass}: expected a finite number of kilograms, not negative")
    if not (np.isfinite(lever).all() and np.isfinite(moments).all()):
        raise SceneError(
            f"{what()}: its centre of mass {lever.tolist()} or its inertia {moments.tolist()} is not finite"
        )
    principal = np.linalg.eigvalsh(moments)
    rounding = ROUNDED * (float(np.abs(principal).max()) + mass * float(lever @ lever))
    excess = principal[2] - principal[0] - principal[1]
    negative = principal[0] < -rounding
    if negative or excess > rounding and not (principal[1] <= rounding and planar()):
        said = f"{what()}: principal moments of inertia {', '.join(f'{x:.4g}' for x in principal)} kg m^2"
        if negative:
            raise SceneError(f"{said}: expected none that is negative")
        said += f": the largest one exceeds the sum of the others by {excess / principal[2]:.2g} of itself"
        if excess > max(rounding, TWO_DIGITS * principal[2]):
            raise SceneError(f"{said}, which no body has; expected at most {TWO_DIGITS:g}, the rounding of two digits")
        warnings.warn(f"{said}, which no body has: rounded in the file?", stacklevel=4)
