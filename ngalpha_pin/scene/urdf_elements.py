"""Elements of a URDF that its parser stops at, or drops with all that stands beside them."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.contents import Entry, listed

Element = ElementTree.Element
JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
# attributes of numbers, and how many each has, of the shapes that there are
SHAPES: dict[str, dict[str, int]] = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "mesh": {},
}


def check_elements(name: str, robot: Element) -> None:
    """Links, types of joints, and numbers of poses, axes and shapes can be read.

    Args:
        name: of the file.
        robot: root element.

    Raises:
        SceneError: one of them cannot; it names the link or joint.
    """
    if robot.find("link") is None:
        raise SceneError(f"{name} has no links: nothing of it can be simulated")
    for joint in robot.findall("joint"):
        who, kind = f"{name}: joint {joint.get('name')!r}", joint.get("type")
        if kind not in JOINTS:
            raise SceneError(f"{who}: type={kind!r}, which URDF does not have; there are {', '.join(JOINTS)}")
        for element in joint:
            if element.tag in ("origin", "axis"):
                _check_pose(who, element)
    for link in robot.findall("link"):
        who = f"{name}: link {link.get('name')!r}"
        for part in (x for kind in ("inertial", "collision", "visual") for x in link.findall(kind)):
            for origin in part.findall("origin"):
                _check_pose(who, origin)
        for shape in _shapes(link):
            for key, n in SHAPES.get(shape.tag, {}).items():
                _check_numbers(who, shape, key, n)


def leave_out_unknown(robot: Element) -> list[Entry]:
    """Take collision elements without a shape that URDF has out of the tree, and say of which links they are."""
    found: dict[str, list[str]] = {}
    for link in robot.findall("link"):
        for collision in link.findall("collision"):
            geometry = collision.find("geometry")
            tags = [] if geometry is None else [shape.tag for shape in geometry if isinstance(shape.tag, str)]
            if not any(tag in SHAPES for tag in tags):
                link.remove(collision)
                found.setdefault(tags[0] if tags else "without a shape", []).append(link.get("name", ""))
    why = "not a shape of URDF"
    return [
        Entry(f"collision {tag}", len(links), "left out", f"{why} ({listed(links)})") for tag, links in found.items()
    ]


def _shapes(link: Element) -> Iterator[Element]:
    for part in (*link.findall("collision"), *link.findall("visual")):
        for geometry in part.findall("geometry"):
            yield from geometry


def _check_pose(who: str, element: Element) -> None:
    for key in ("xyz", "rpy"):
        if element.get(key) is not None:
            _check_numbers(who, element, key, 3)


def _check_numbers(who: str, element: Element, key: str, n: int) -> None:
    text = element.get(key)
    try:
        values = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        values = np.full(n, np.nan)
    if len(values) != n or not np.isfinite(values).all():
        wanted = "a number" if n == 1 else f"{n} numbers"
        raise SceneError(f"{who}: {key}={text!r} in <{element.tag}>: expected {wanted}")
