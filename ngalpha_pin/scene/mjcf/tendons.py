"""Ranges of the tendons of a compiled MJCF model, as far as their lengths are known without a path around geoms.

Between two sites it is a contact: a point on the one site stays inside a sphere about the other one, whose radius is
the upper end of the range, and outside of one whose radius is its lower end. Of fixed tendons and of paths through more
sites it is a unilateral constraint.
"""

from __future__ import annotations

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.scene.contact import ContactLaw, ContactPair
from ngalpha_pin.scene.length_limits import JointSumLimit, LengthLimit, PathLimit, PathPoint
from ngalpha_pin.scene.mjcf.compiler import disabled, mujoco, one_of, pose
from ngalpha_pin.scene.mjcf.equality import fixed_tendon, named
from ngalpha_pin.scene.mjcf.tree import Tree


def between_sites(m: Any, tendon: int) -> tuple[int, int] | None:
    """The two sites that a tendon goes straight between; None of any other tendon."""
    first, number = int(m.tendon_adr[tendon]), int(m.tendon_num[tendon])
    kinds = [one_of(m.wrap_type[w], mujoco().mjtWrap.mjWRAP_SITE) for w in range(first, first + number)]
    if number != 2 or not all(kinds):
        return None
    return int(m.wrap_objid[first]), int(m.wrap_objid[first + 1])


def has_length_limit(m: Any, tendon: int) -> bool:
    """The range of a tendon is taken: it goes straight between two sites that move against each other."""
    sites = between_sites(m, tendon)
    return bool(m.tendon_limited[tendon]) and sites is not None and _apart(m, *sites)


def add_contacts_of_lengths(m: Any, tree: Tree, geometries: pin.GeometryModel) -> tuple[list[ContactPair], set[str]]:
    """Add the spheres of the ranges to the geometries; the contacts between them, and those touched from inside."""
    pairs: list[ContactPair] = []
    hollow: set[str] = set()
    if disabled(m, "LIMIT"):
        return pairs, hollow
    for t in range(m.ntendon):
        sites = between_sites(m, t)
        if sites is None or not has_length_limit(m, t):
            continue
        name, (lower, upper) = tree.names.tendons[t], (float(x) for x in m.tendon_range[t])
        geometries.addGeometryObject(_sphere(m, tree, sites[1], f"{name}_end", 0.0))
        for end, radius in (("shortest", lower), ("longest", upper)):
            if radius > 0.0:
                geometries.addGeometryObject(_sphere(m, tree, sites[0], f"{name}_{end}", radius))
                pairs.append(ContactPair(f"{name}_end", f"{name}_{end}", ContactLaw(0.0)))
        hollow |= {f"{name}_longest"} if upper > 0.0 else set()
    return pairs, hollow


def pieces(m: Any, tendon: int) -> list[tuple[int, int, float]] | None:
    """Sites at both ends of the straight pieces of a tendon, and what their lengths are divided by.

    None of a fixed tendon and of one around a geom.
    """
    found: list[tuple[int, int, float]] = []
    last, parts = None, 1.0
    first = int(m.tendon_adr[tendon])
    for w in range(first, first + int(m.tendon_num[tendon])):
        if one_of(m.wrap_type[w], mujoco().mjtWrap.mjWRAP_PULLEY):
            last, parts = None, float(m.wrap_prm[w])
            continue
        if not one_of(m.wrap_type[w], mujoco().mjtWrap.mjWRAP_SITE):
            return None
        site = int(m.wrap_objid[w])
        if last is not None:
            found.append((last, site, parts))
        last = site
    return found


def has_range(m: Any, tendon: int) -> bool:
    """The range of a tendon is taken, as a contact or as a constraint."""
    if not m.tendon_limited[tendon]:
        return False
    straight = pieces(m, tendon)
    if straight is None:
        return bool(fixed_tendon(m, tendon))
    return any(_apart(m, a, b) for a, b, _ in straight)


def length_limits(m: Any, tree: Tree) -> list[LengthLimit]:
    """Those ranges that are no contacts, one constraint for each end."""
    found: list[LengthLimit] = []
    for t in range(0 if disabled(m, "LIMIT") else m.ntendon):
        if not has_range(m, t) or has_length_limit(m, t):
            continue
        straight = pieces(m, t)
        for upper, kind in ((False, "shortest"), (True, "longest")):
            name, end = f"{tree.names.tendons[t]}_{kind}", float(m.tendon_range[t, int(upper)])
            if straight is None:
                found.append(JointSumLimit(named(tree.names, fixed_tendon(m, t) or {}), name, end, upper))
            elif upper or end > 0.0:
                sites = list(dict.fromkeys(s for a, b, _ in straight for s in (a, b)))
                points = [PathPoint(tree.names.bodies[m.site_bodyid[s]], np.array(m.site_pos[s])) for s in sites]
                ends = [(sites.index(a), sites.index(b), parts) for a, b, parts in straight]
                found.append(PathLimit(points, ends, name, end, upper))
    return found


def _apart(m: Any, a: int, b: int) -> bool:
    """Two sites move against each other."""
    return bool(m.body_weldid[m.site_bodyid[a]] != m.body_weldid[m.site_bodyid[b]])


def _sphere(m: Any, tree: Tree, site: int, name: str, radius: float) -> pin.GeometryObject:
    body = int(m.site_bodyid[site])
    joint, at = tree.places[body]
    frame = tree.model.getFrameId(tree.names.bodies[body], pin.FrameType.BODY) if body else 0
    placement = at * pose(m.site_pos[site], np.array([1.0, 0.0, 0.0, 0.0]))
    return pin.GeometryObject(name, joint, frame, placement, coal.Sphere(radius))
