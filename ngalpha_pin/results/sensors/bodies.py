"""What the name of a body, a geometry or a pair means among the contacts of a run."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import UnknownName
from ngalpha_pin.scene.constraints import WORLD
from ngalpha_pin.scene.names import matching
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.system import System


class Pairs(NamedTuple):
    """The pairs of geometries whose contacts are columns of a run, p of them.

    Attributes:
        names: as "foot/ground", in the order of their first columns.
        points: geometry on the side of the contact point, on which the forces of the columns act.
        surfaces: geometry on the other side.
        of_column: number of the pair of each column, -1 for the limit of a joint, shape (k,).
    """

    names: tuple[str, ...]
    points: tuple[str, ...]
    surfaces: tuple[str, ...]
    of_column: np.ndarray


def pairs_of(system: System, columns: np.ndarray) -> Pairs:
    """The pairs of the contacts with some numbers.

    Args:
        system: compiled scene.
        columns: numbers of contacts, shape (k,).
    """
    table, scene = system.contacts, system.scene
    declared = {f"{pair.geometry_a}/{pair.geometry_b}": pair for pair in scene.contacts}
    numbers: dict[str, int] = {}
    points, surfaces = [], []
    of_column = np.full(len(columns), -1)
    for column, i in enumerate(columns.tolist()):
        if i >= table.n_points:
            continue
        name = pair_name(table.names[i], declared)
        if name not in numbers:
            numbers[name] = len(numbers)
            a, b = declared[name].geometry_a, declared[name].geometry_b
            on_a = int(table.bodies[table.body_b[i]]) == scene.geometry(a).parentJoint
            points.append(a if on_a else b)
            surfaces.append(b if on_a else a)
        of_column[column] = numbers[name]
    return Pairs(tuple(numbers), tuple(points), tuple(surfaces), of_column)


def pair_name(contact: str, declared: Mapping[str, object]) -> str:
    """The name of the pair of a contact: without the number of its corner."""
    if contact in declared:
        return contact
    shorter = (contact[: m.start()] + contact[m.end() :] for m in re.finditer(r"\[\d+\]", contact))
    return next(name for name in shorter if name in declared)


def geometries_of(scene: Scene, body: str) -> frozenset[str]:
    """Names of the geometries of a body.

    Of a joint all that move with it, of a link those that are attached to it, "world" is what is fixed there; otherwise
    a geometry or a pattern of some.

    Raises:
        UnknownName: nothing has that name.
    """
    checks.name("body", body)
    model, geometries = scene.model, list(scene.declared_shapes.geometryObjects)
    if body == WORLD:
        return frozenset(g.name for g in geometries if g.parentJoint == 0)
    frames = [i for i, frame in enumerate(model.frames) if frame.name == body]
    joints = {model.frames[i].parentJoint for i in frames}
    attached = frozenset(g.name for g in geometries if g.parentFrame in frames and g.parentJoint in joints)
    if attached and not model.existJointName(body):
        return attached
    if model.existJointName(body):
        joints.add(model.getJointId(body))
    if joints:
        return frozenset(g.name for g in geometries if g.parentJoint in joints)
    names = [g.name for g in geometries]
    try:
        return frozenset(matching("geometry", body, names))
    except UnknownName as error:
        known = [*list(model.names)[1:], *(frame.name for frame in model.frames), *names]
        raise UnknownName("pair, body or geometry", body, list(dict.fromkeys(known))) from error


def sides(scene: Scene, pairs: Pairs, body: str, other: str | None) -> np.ndarray:
    """With which sign the force of each pair acts on a body, 0 where it does not, shape (p,).

    Args:
        scene: with the geometries.
        pairs: of the run.
        body: a pair such as "foot/ground", for the force on its first geometry; or a body.
        other: of the forces on a body, only those from this one.

    Raises:
        UnknownName: there is no such pair or body.
    """
    checks.name("body", body)
    names = {f"{pair.geometry_a}/{pair.geometry_b}": (pair.geometry_a, pair.geometry_b) for pair in scene.contacts}
    names = {f"{b}/{a}": (b, a) for a, b in names.values()} | names
    if other is None and body in names:
        on, of = (frozenset((name,)) for name in names[body])
    else:
        on = geometries_of(scene, body)
        every = frozenset(g.name for g in scene.declared_shapes.geometryObjects)
        of = every - on if other is None else geometries_of(scene, other)
    found = zip(pairs.points, pairs.surfaces, strict=True)
    return np.array([(b in on and a in of) * 1.0 - (a in on and b in of) * 1.0 for b, a in found])
