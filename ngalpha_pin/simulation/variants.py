"""A scene with something added or switched off: what a run goes on in after its scene has changed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.constraints.frame_forces import Gravity
from ngalpha_pin.errors import UnknownName
from ngalpha_pin.scene.constraints import Constraint, Weld
from ngalpha_pin.scene.scene import Scene


@dataclass(frozen=True)
class Changes:
    """What a scene has beside what it declares, and what of that is switched off.

    Attributes:
        added: constraints.
        off: names of contacts, constraints and forces.
        gravity: acceleration in place of that of the model, shape (3,) [m/s^2]; None leaves it.
    """

    added: tuple[Constraint, ...] = ()
    off: frozenset[str] = frozenset()
    gravity: tuple[float, ...] | None = None

    def without(self, name: str) -> Changes:
        """The same without an added constraint."""
        return replace(self, added=tuple(c for c in self.added if c.name != name))


def force_names(scene: Scene) -> list[str]:
    """Names of the forces in their order: their own, or their kind; a number where that has been there before."""
    found: list[str] = []
    for force in scene.forces:
        own = str(getattr(force, "name", type(force).__name__))
        n = sum(name == own or name.startswith(f"{own} #") for name in found)
        found.append(f"{own} #{n + 1}" if n else own)
    return found


def pair_names(scene: Scene) -> list[str]:
    """Names of the contact pairs in their order, as "foot/ground"."""
    return [f"{pair.geometry_a}/{pair.geometry_b}" for pair in scene.contacts]


def switchable(scene: Scene, name: str) -> list[str]:
    """Names of the pairs, constraints and forces that one name means: a pair either way round, or a geometry's pairs.

    Raises:
        UnknownName: there is none.
    """
    pairs, constraints, forces = pair_names(scene), [c.name for c in scene.constraints], force_names(scene)
    both = {f"{pair.geometry_b}/{pair.geometry_a}": own for pair, own in zip(scene.contacts, pairs, strict=True)}
    if name in pairs or name in constraints or name in forces:
        return [name]
    if name in both:
        return [both[name]]
    of_geometry = [own for pair, own in zip(scene.contacts, pairs, strict=True) if name in pair.key]
    if of_geometry:
        return of_geometry
    raise UnknownName("contact pair, constraint or force", name, [*pairs, *constraints, *forces])


def variant(scene: Scene, changes: Changes) -> Scene:
    """The scene with changes; it shares the model and what is not changed."""
    found: Scene = object.__new__(type(scene))
    vars(found).update(vars(scene))
    off = changes.off
    found.constraints = [c for c in scene.constraints if c.name not in off] + list(changes.added)
    forces = zip(force_names(scene), scene.forces, strict=True)
    found.forces = [force for name, force in forces if name not in off]
    if changes.gravity is not None:
        found.forces = [force for force in found.forces if not isinstance(force, Gravity)]
        found.forces.append(Gravity(changes.gravity))
    pairs = zip(pair_names(scene), scene.contacts, strict=True)
    found.contacts = [pair for name, pair in pairs if name not in off]
    return found


def with_all_contacts(scene: Scene) -> Scene:
    """The scene without constraints, so that none of them holds two bodies of a contact together."""
    return variant(scene, Changes(off=frozenset(constraint.name for constraint in scene.constraints)))


def weld_here(scene: Scene, poses: Any, frames: tuple[str, str], places: Any, name: str | None) -> Weld:
    """A weld of two frames as they are now.

    Args:
        scene: with the frames.
        poses: rotations and translations of all joints now.
        frames: their names.
        places: joint of each frame and its pose there.
        name: of the weld; None is made from the frames.
    """
    pose_a, pose_b = (pin.SE3(np.array(poses[0][joint]), np.array(poses[1][joint])) * place for joint, place in places)
    return Weld(*frames, placement_b=pose_b.inverse() * pose_a, name=name)
