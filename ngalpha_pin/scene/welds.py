"""Bodies that welds hold together: they are one body for contacts."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ngalpha_pin.scene.constraints import Weld
from ngalpha_pin.scene.contact import ContactPair

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


def pairs_apart(scene: Scene) -> list[ContactPair]:
    """The contact pairs of a scene whose bodies no welds hold together.

    The gaps of the others cannot change, and what their contacts would carry the weld carries: as unknowns they would
    be dependent.
    """
    welds = [constraint for constraint in scene.constraints if type(constraint) is Weld]
    if not welds:
        return list(scene.contacts)
    joint = {g.name: int(g.parentJoint) for g in scene.declared_shapes.geometryObjects}
    group = {j: j for j in (0, *joint.values())}
    for weld in welds:
        a, b = (group.setdefault(place[0], place[0]) for place in weld.poses(scene))
        group = {j: a if of == b else of for j, of in group.items()}
    return [pair for pair in scene.contacts if group[joint[pair.geometry_a]] != group[joint[pair.geometry_b]]]
