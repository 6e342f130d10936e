"""What a URDF declares: used, left out, or without effect on the motion."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

import pinocchio as pin

from ngalpha_pin.scene.contents import Entry, Fate, listed
from ngalpha_pin.scene.meshes import says_another_up_axis
from ngalpha_pin.scene.urdf_inertia import impossible_links

NO_EFFECT = {
    "calibration": "reference positions of sensors",
    "safety_controller": "soft limits belong to a controller",
    "gazebo": "settings of another simulator",
    "sensor": "read the trajectory",
    "material": "colours",
}


def contents(robot: ElementTree.Element, model: pin.Model, meshes: Iterable[str] = ()) -> list[Entry]:
    """Every kind that a file has.

    Args:
        robot: root element.
        model: that was made of it.
        meshes: files of the meshes for contact.
    """
    joints = robot.findall("joint")
    mass_at = [x for x in robot.findall("link") if x.find("inertial") is not None]
    found: list[Entry] = []

    def add(what: str, count: int, fate: Fate, reason: str = "") -> None:
        if count:
            found.append(Entry(what, count, fate, reason))

    add("links", len(robot.findall("link")), "used", f"{len(mass_at)} with mass")
    odd = impossible_links(robot)
    add("links with an inertia that no body can have", len(odd), "used", listed(odd))
    kinds = {kind: sum(j.get("type") == kind for j in joints) for kind in sorted({j.get("type") or "" for j in joints})}
    add("joints", len(joints), "used", ", ".join(f"{n} {kind}" for kind, n in kinds.items()))
    limits = [x for j in joints for x in j.findall("limit") if j.get("type") != "fixed"]
    add("limits of position", sum("lower" in x.attrib or "upper" in x.attrib for x in limits), "used")
    add("limits of effort", sum("effort" in x.attrib for x in limits), "used", "of controls; 0 is none")
    add("limits of velocity", sum("velocity" in x.attrib for x in limits), "no effect", "they belong to a controller")
    for key in ("damping", "friction"):
        dynamics = [x for j in joints for x in j.findall("dynamics") if float(x.get(key) or 0)]
        add(f"joint {key}", len(dynamics), "used", "" if key == "damping" else "set-valued")
    mimics = [j.get("name", "") for j in joints if j.find("mimic") is not None]
    moving = [name for name in mimics if model.existJointName(name)]
    add("mimic joints", len(moving), "used", f"as JointCoupling ({listed(moving)})")
    add("mimic joints that are fixed", len(mimics) - len(moving), "no effect")
    for kind, what in (("collision", "for contact"), ("visual", "to draw, loaded when something is drawn")):
        add(f"{kind} shapes", sum(len(x.findall(kind)) for x in robot.findall("link")), "used", what)
    turned = sum(says_another_up_axis(path) for path in set(meshes))
    add("COLLADA files with x or y up", turned, "no effect", "coordinates count as they stand in the file, as in ROS")
    reductions = [x.text or "" for t in robot.findall("transmission") for x in t.iter("mechanicalReduction")]
    add("mechanical reductions", sum(map(_is_number, reductions)), "used", "as model.rotorGearRatio")
    add("transmissions", len(robot.findall("transmission")), "no effect", "declare forces with add_force")
    for tag, why in NO_EFFECT.items():
        add(tag, sum(1 for _ in robot.iter(tag)), "no effect", why)
    return found


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
