"""A scene as another one with other coefficients, masses or gains, for many runs of the same robot."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.scene.contact import ContactPair
from ngalpha_pin.scene.forces import Force
from ngalpha_pin.scene.joint_pd import JointPD
from ngalpha_pin.scene.names import matching
from ngalpha_pin.scene.pending_meshes import loaded


def copied(scene: Any) -> Any:
    """A scene of its own lists: what is declared in it is not in the other one. Model and declarations are shared."""
    new = object.__new__(type(scene))  # a copy by `copy` is one through a file, with meshes that are read again
    for name, value in vars(scene).items():
        setattr(new, name, copy.copy(value) if isinstance(value, (list, dict, set)) else value)
    for pair in scene.contacts:  # what every run uses is loaded once
        for name in pair.key:
            loaded(scene.declared_shapes, name)
    new.declared_shapes = scene.declared_shapes.copy()
    return new


def varied(
    scene: Any,
    coefficients: Mapping[str, Any],
    mass: Mapping[str, float],
    gains: Mapping[str, Any],
    forces: Sequence[Force],
) -> Any:
    """See `SceneParts.varied`."""
    new = copied(scene)
    for name, given in coefficients.items():
        patterns = given if isinstance(given, Mapping) else {"*": given}
        for pattern, value in patterns.items():
            _set_coefficient(new, name, pattern, value)
    if checks.instance("mass", mass, Mapping, "masses by name of a body or joint"):
        new.model = scene.model.copy()
        for body, kilograms in mass.items():
            _set_mass(new, body, kilograms)
    if gains:
        _set_gains(new, gains)
    for force in checks.instances("force", forces, object, "a force"):
        new.add_force(force)
    return new


def _set_coefficient(scene: Any, name: str, pattern: str, value: Any) -> None:
    """Of every contact one of whose geometries matches."""
    if not scene.contacts:
        raise SceneError(f"{name}: the scene has no contacts")
    found = {geometry for pair in scene.contacts for geometry in (pair.geometry_a, pair.geometry_b)}
    names = set(matching("geometry with contacts", pattern, sorted(found)))

    def changed(pair: ContactPair) -> ContactPair:
        return replace(pair, law=replace(pair.law, **{name: value})) if pair.key & names else pair

    scene.contacts = [changed(pair) for pair in scene.contacts]


def _set_mass(scene: Any, body: str, kilograms: Any) -> None:
    mass = checks.number(f"mass of {body!r}", kilograms, 0.0, above=True, unit="kg")
    model = scene.model
    frames = [f.parentJoint for f in model.frames if f.name == body]
    joint = frames[0] if frames else model.getJointId(body) if model.existJointName(body) else None
    if joint is None:
        raise UnknownName("body or joint", body, [f.name for f in model.frames])
    inertia = model.inertias[joint]
    if joint == 0 or not inertia.mass > 0.0:
        raise SceneError(f"mass of {body!r}: it is fixed to the world or has none that could be scaled")
    scaled = inertia.inertia * (mass / inertia.mass)
    model.inertias[joint] = pin.Inertia(mass, inertia.lever, scaled)


def _set_gains(scene: Any, gains: Mapping[str, Any]) -> None:
    laws = [i for i, force in enumerate(scene.forces) if isinstance(force, JointPD)]
    if not laws:
        raise SceneError(f"{', '.join(gains)}: the scene has no JointPD")
    for i in laws:
        scene.forces[i] = scene.forces[i].with_gains(**gains)
        scene.forces[i].check(scene)
