"""Spatial tendons of a compiled MJCF model between two sites: their range is a contact.

A point on the one site stays inside a sphere about the other one, whose radius is the upper end of the range, and
outside of one whose radius is its lower end. Longer paths, with pulleys or around geoms, have no such form.
"""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.scene.contact import ContactLaw, ContactPair
from ngalpha_pin.scene.mjcf.compiler import disabled, mujoco, one_of, pose
from ngalpha_pin.scene.mjcf.tree import Tree


def between_sites(m: Any, tendon: int) -> tuple[int, int] | None:
    """The two sites that a tendon goes straight between; None of any other tendon."""
    first, number = int(m.tendon_adr[tendon]), int(m.tendon_num[tendon])
    kinds = [one_of(m.wrap_type[w], mujoco().mjtWrap.mjWRAP_SITE) for w in range(first, first + number)]
    if number != 2 or not all(kinds):
        return None
    return int(m.wrap_objid[first]), int(m.wrap_objid[first + 1])


def has_length_limit(m: Any, tree: Tree, tendon: int) -> bool:
    """The range of a tendon is taken: it goes straight between two sites that move against each other."""
    sites = between_sites(m, tendon)
    return bool(m.tendon_limited[tendon]) and sites is not None and _joint(m, tree, sites[0]) != _joint(
        m, tree, sites[1]
    )  # fmt: skip


def add_length_limits(m: Any, tree: Tree, geometries: pin.GeometryModel) -> tuple[list[ContactPair], set[str]]:
    """Add the spheres of the ranges to the geometries; the contacts between them, and those touched from inside."""
    pairs: list[ContactPair] = []
    hollow: set[str] = set()
    if disabled(m, "LIMIT"):
        return pairs, hollow
    for t in range(m.ntendon):
        sites = between_sites(m, t)
        if sites is None or not has_length_limit(m, tree, t):
            continue
        name, (lower, upper) = tree.names.tendons[t], (float(x) for x in m.tendon_range[t])
        geometries.addGeometryObject(_sphere(m, tree, sites[1], f"{name}_end", 0.0))
        for end, radius in (("shortest", lower), ("longest", upper)):
            if radius > 0.0:
                geometries.addGeometryObject(_sphere(m, tree, sites[0], f"{name}_{end}", radius))
                pairs.append(ContactPair(f"{name}_end", f"{name}_{end}", ContactLaw(0.0)))
        hollow |= {f"{name}_longest"} if upper > 0.0 else set()
    return pairs, hollow


def _joint(m: Any, tree: Tree, site: int) -> int:
    return tree.places[int(m.site_bodyid[site])][0]


def _sphere(m: Any, tree: Tree, site: int, name: str, radius: float) -> pin.GeometryObject:
    body = int(m.site_bodyid[site])
    joint, at = tree.places[body]
    frame = tree.model.getFrameId(tree.names.bodies[body], pin.FrameType.BODY) if body else 0
    placement = at * pose(m.site_pos[site], np.array([1.0, 0.0, 0.0, 0.0]))
    return pin.GeometryObject(name, joint, frame, placement, coal.Sphere(radius))
