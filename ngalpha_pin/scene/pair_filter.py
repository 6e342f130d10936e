"""Which geometries may touch at all: neighbours in the mechanism, SRDF, shapes that overlap at the start."""

from __future__ import annotations

import os
import warnings
from collections.abc import Hashable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import coal
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.combined_law import combined_law
from ngalpha_pin.scene.contact import ContactLaw, ContactPair
from ngalpha_pin.scene.contents import listed
from ngalpha_pin.scene.friction_ellipse import placed_ellipse
from ngalpha_pin.scene.meshes import hull_excess
from ngalpha_pin.scene.pending_meshes import loaded
from ngalpha_pin.scene.protocols import Declared


class _Candidates(Declared, Protocol):
    """A scene whose pairs are looked for."""

    declared_shapes: pin.GeometryModel
    contacts: list[ContactPair]
    surfaces: dict[str, ContactLaw]
    disabled: set[frozenset[str]]
    complete: list[frozenset[str]]

    def geometries(self, pattern: str) -> list[str]:
        """Names of the geometries that match the pattern."""


# one side of a pair matches the first of two patterns, or both, and the other side the second one, or both
MATCHES = ({1, 2}, {1, 3}, {2, 3}, {3})


def neighbours(model: pin.Model, a: pin.GeometryObject, b: pin.GeometryObject) -> bool:
    """Two geometries on one joint, or on two that follow each other in the mechanism."""
    i, j = int(a.parentJoint), int(b.parentJoint)
    # a base may touch the world that it moves in
    # the joints of beam points stand behind those of the model
    in_tree = min(i, j) > 0 and max(i, j) < model.njoints
    return i == j or (in_tree and (model.parents[i] == j or model.parents[j] == i))


def unbounded(geometry: pin.GeometryObject) -> bool:
    """A half-space or a plane."""
    return isinstance(geometry.geometry, (coal.Halfspace, coal.Plane))


def pairs_of_srdf(scene: _Candidates, srdf: str | os.PathLike[str]) -> set[frozenset[str]]:
    """Pairs of geometries that an SRDF file, or its text, disables.

    Raises:
        SceneError: the file is missing or cannot be read.
    """
    text = str(checks.path("srdf", srdf))
    if not text.lstrip().startswith("<"):
        if not Path(text).is_file():
            raise SceneError(f"no SRDF file at {text}")
        text = Path(text).read_text(encoding="utf-8")
    geometries = scene.declared_shapes.copy()
    geometries.addAllCollisionPairs()
    before = _names_of_pairs(geometries)
    try:
        pin.removeCollisionPairsFromXML(scene.model, geometries, text)
    except (ValueError, RuntimeError) as error:
        raise SceneError(f"the SRDF cannot be read: {error}") from error
    return before - _names_of_pairs(geometries)


def _names_of_pairs(geometries: pin.GeometryModel) -> set[frozenset[str]]:
    names = [g.name for g in geometries.geometryObjects]
    return {frozenset((names[p.first], names[p.second])) for p in geometries.collisionPairs}


def pairs_between(scene: _Candidates, a: str, b: str, given: dict[str, Any]) -> list[ContactPair]:
    """Pairs of the geometries that match two names or patterns and may touch, with the coefficients that are given.

    Raises:
        UnknownName: a pattern matches nothing. SceneError: a coefficient out of range, or no pair is left.
    """
    names_a, names_b = scene.geometries(a), scene.geometries(b)
    patterns = a not in names_a and b not in names_b
    declared = {pair.key for pair in scene.contacts}
    pairs: dict[frozenset[str], ContactPair] = {}
    for name_a in names_a:
        for name_b in names_b:
            key = frozenset((name_a, name_b))
            if key in pairs or not _may_touch(scene, name_a, name_b, patterns):
                continue
            if key in declared:
                if patterns:
                    continue
                raise SceneError(f"contact between {name_a!r} and {name_b!r} is declared already")
            law = combined_law(*(scene.surfaces.get(name, ContactLaw()) for name in (name_a, name_b)))
            if "compliance" in given:  # of the pair, instead of what its surfaces give back
                law = replace(law, e_N=0.0, e_F=0.0, restitution=None, compliance=None)
            pairs[key] = ContactPair(name_a, name_b, replace(law, **given), patterns)
            if pairs[key].law.ellipse is not None:  # a geometry that is asked for is loaded
                a, b = (loaded(scene.declared_shapes, x) for x in (name_a, name_b))
                placed_ellipse(scene, pairs[key].law, (a, b), b)
    if pairs:
        return list(pairs.values())
    between = [p for p in scene.contacts if {(x in names_a) + 2 * (x in names_b) for x in p.key} in MATCHES]
    if not between:
        moving = sum(g.parentJoint > 0 for g in scene.declared_shapes.geometryObjects)
        why = "they are on one and the same joint, or excluded" if moving else "no body that moves has a geometry"
        raise SceneError(f"no pair between {a!r} and {b!r} is left: {why}")
    if given:
        raise SceneError(f"every contact between {a!r} and {b!r} is declared already: {between[0].law}")
    return between


def _may_touch(scene: _Candidates, name_a: str, name_b: str, patterns: bool) -> bool:
    shapes = scene.declared_shapes  # none of them has to be loaded for it
    a, b = (shapes.geometryObjects[shapes.getGeometryId(name)] for name in (name_a, name_b))
    if a.parentJoint == b.parentJoint:
        return False
    key = frozenset((name_a, name_b))
    excluded = key in scene.disabled or any(key <= names for names in scene.complete) or neighbours(scene.model, a, b)
    return not (patterns and (excluded or (unbounded(a) and unbounded(b))))


def warn_of_hulls(scene: _Candidates, pairs: list[ContactPair]) -> None:
    """One warning of meshes whose convex hull, which contact takes, is larger than they are, the largest first."""
    names = dict.fromkeys(name for pair in pairs for name in (pair.geometry_a, pair.geometry_b))
    known: dict[Hashable, tuple[float, float] | None] = {}  # robots use one file for several links
    found = {}
    for geometry in map(partial(loaded, scene.declared_shapes), names):
        mesh = (geometry.meshPath, *geometry.meshScale) if geometry.meshPath else geometry.name
        if mesh not in known:
            known[mesh] = hull_excess(geometry)
        found[geometry.name] = known[mesh]
    volumes = sorted(((v, name) for name, v in found.items() if v), key=lambda x: -x[0][1] / x[0][0])
    if volumes:
        which = listed(
            f"{name!r} by {hull / volume - 1:.0%} ({volume:.3g} -> {hull:.3g} m^3)" for (volume, hull), name in volumes
        )
        warnings.warn(
            f"contact takes the convex hull of meshes, which is larger than they are: {which}; "
            f"scene.decompose({volumes[0][1]!r}) makes convex parts",
            stacklevel=3,
        )
