"""Spheres that roll without slip: the kinematics of contacts, always active."""

from __future__ import annotations

from typing import TYPE_CHECKING

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.collision.contact_points import pair_points
from ngalpha_pin.collision.manifold import Slots
from ngalpha_pin.constraints.provider import Bodies, RowWrenches
from ngalpha_pin.contact.point_rows import Rows
from ngalpha_pin.contact.table import ContactTable
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.constraints import RollingSphere
from ngalpha_pin.scene.contact import ContactLaw, ContactPair

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


class Spheres:
    """The rolling spheres of a scene: contact rows that are always active; see `provider.Provider`."""

    everywhere = True

    def __init__(self, table: ContactTable, names: list[str]):
        self._sub = sub = table.subset(np.arange(table.n))
        self.names_g, self.names_gamma = tuple(names), tuple(names[i] for i in sub.of_F)
        self.group = np.concatenate((np.arange(sub.k), sub.k + sub.of_F))

    def rows(self, bodies: Bodies) -> SphereRows:
        """Rows at one motion."""
        joints = self._sub.bodies
        rotation, translation = [bodies.rotation[j] for j in joints], [bodies.translation[j] for j in joints]
        rows = SphereRows(self._sub, rotation, translation)
        rows.move(bodies.motion)
        return rows


class SphereRows(Rows):
    """Rows of contacts under the names of constraints."""

    @property
    def g(self) -> np.ndarray:
        """Gaps, shape (kb,) [m]."""
        return self.g_N

    @property
    def wrenches(self) -> RowWrenches:
        """What the rows do to bodies."""
        sub = self.sub
        return RowWrenches(self.F, sub.bodies[sub.body_a][sub.of_row], sub.bodies[sub.body_b][sub.of_row])


def spheres(scene: Scene, model: pin.Model) -> Spheres | None:
    """The rolling spheres of a scene; None where it has none."""
    points, names = [], []
    for constraint in scene.constraints:
        if isinstance(constraint, RollingSphere):
            if not isinstance(scene.geometry(constraint.body).geometry, coal.Sphere):
                raise SceneError(f"{constraint.name}: {constraint.body!r} must be a coal.Sphere")
            found = pair_points(scene, ContactPair(constraint.body, constraint.surface, ContactLaw(mu=1.0)))
            points += [] if found is None else [found]
            names.append(constraint.name)
    return Spheres(ContactTable(model, model.createData(), points, Slots([]), []), names) if points else None
