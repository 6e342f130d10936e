"""The contacts of a scene, compiled once: a scene that declares the same as one before gets what that one got.

What a scene declares is compared by value, down to the corners of its meshes, so that it does not matter whether it is
the same object, a copy with other masses, or one that has been read again; and what is changed is compiled anew.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import fields
from functools import partial
from threading import Lock
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.contact_points import contact_points
from ngalpha_pin.collision.manifold import Slots
from ngalpha_pin.collision.solid_pairs import solid_pairs
from ngalpha_pin.contact.table import ContactTable
from ngalpha_pin.scene.contact import ContactLaw, ContactPair
from ngalpha_pin.scene.joints import JointLimit
from ngalpha_pin.scene.pending_meshes import loaded
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.scene.welds import pairs_apart

KEPT = 16  # scenes whose contacts are kept: those that alternate, and variants of one
# numbers that say what a shape is
NUMBERS = {
    coal.Box: ("halfSide",),
    coal.Sphere: ("radius",),
    coal.Capsule: ("radius", "halfLength"),
    coal.Cylinder: ("radius", "halfLength"),
    coal.Cone: ("radius", "halfLength"),
    coal.Ellipsoid: ("radii",),
    coal.Halfspace: ("n", "d"),
    coal.Plane: ("n", "d"),
    coal.TriangleP: ("a", "b", "c"),
}


class _Tree:
    """How a model moves, to be compared: all of it but the masses."""

    def __init__(self, model: pin.Model):
        self.model, nothing = model.copy(), pin.Inertia.Zero()
        for joint in range(model.njoints):
            self.model.inertias[joint] = nothing

    def __hash__(self) -> int:
        return hash((self.model.nq, self.model.nv))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Tree) and bool(self.model == other.model)


_kept: OrderedDict[Hashable, tuple[Slots, ContactTable, list[ContactPair]]] = OrderedDict()
_lock = Lock()


def compiled_contacts(
    scene: Scene, model: pin.Model, data: pin.Data, limits: list[JointLimit], length: float
) -> tuple[Slots, ContactTable]:
    """The places of changing features and the table of all contacts, for one system alone.

    Args:
        scene: what is declared.
        model: the joints that bodies move with.
        data: of it.
        limits: of its joints.
        length: least size of the scene [m].

    Raises:
        SceneError: a pair cannot touch at all.
    """
    if scene.beams:  # their points are no geometries of the scene
        return _compile(scene, model, data, limits, length)
    pairs = pairs_apart(scene)
    # laws with a function are the same where they are one object, which the entry keeps
    key = (_Tree(model), tuple(limits), _geometries(scene, pairs), _laws(pairs), _own(scene))
    with _lock:
        found = _kept.get(key)
        if found is not None:
            _kept.move_to_end(key)
    if found is None:
        found = *_compile(scene, model, data, limits, length), pairs
        for array in (found[0].mobility, *vars(found[1]).values()):
            if isinstance(array, np.ndarray):
                array.setflags(write=False)  # all systems have the same ones
        with _lock:
            _kept[key] = found
            while len(_kept) > KEPT:
                _kept.popitem(last=False)
    slots, table, _ = found
    return slots.fresh(), table.fresh()


def _compile(
    scene: Scene, model: pin.Model, data: pin.Data, limits: list[JointLimit], length: float
) -> tuple[Slots, ContactTable]:
    points, pairs = contact_points(scene)
    slots = Slots(solid_pairs(scene, pairs))
    table = ContactTable(model, data, points, slots, limits, length, scene.unilaterals)
    slots.open_with(table.length)
    return slots, table


def _geometries(scene: Scene, pairs: list[ContactPair]) -> tuple[Hashable, ...]:
    """Geometries that take part, by value."""
    used = {name for pair in pairs for name in (pair.geometry_a, pair.geometry_b)}
    names = [g.name for g in scene.declared_shapes.geometryObjects if g.name in used]
    return tuple(
        (g.name, int(g.parentJoint), _bytes(g.placement.rotation, g.placement.translation), g.name in scene.hollow)
        + _shape(g.geometry)
        for g in map(partial(loaded, scene.declared_shapes), names)
    )


def _shape(shape: coal.CollisionGeometry) -> tuple[Any, ...]:
    if isinstance(shape, coal.BVHModelBase):
        return coal.BVHModelBase, _bytes(shape.vertices())  # whatever tree it has
    swept = float(shape.getSweptSphereRadius()) if isinstance(shape, coal.ShapeBase) else 0.0
    if isinstance(shape, coal.ConvexBase):
        return type(shape), swept, _bytes(shape.points())
    return type(shape), swept, *(_bytes(getattr(shape, name)) for name in NUMBERS.get(type(shape), ()))


def _laws(pairs: list[ContactPair]) -> tuple[Hashable, ...]:
    return tuple((pair.geometry_a, pair.geometry_b, *_law(pair.law)) for pair in pairs)


def _law(law: ContactLaw) -> tuple[Hashable, ...]:
    values = (getattr(law, part.name) for part in fields(law))
    return tuple(x if isinstance(x, float) else id(x) for x in values)


def _own(scene: Scene) -> tuple[Hashable, ...]:
    return tuple((own.name, own.mu, own.e_N, own.n_F) for own in scene.unilaterals)


def _bytes(*numbers: Any) -> bytes:
    return b"".join(np.asarray(x, dtype=float).tobytes() for x in numbers)
