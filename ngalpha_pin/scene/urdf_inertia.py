"""Inertials of a URDF, which Pinocchio drops without a word where it cannot read them."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np

from ngalpha_pin.errors import SceneError

# parts of the largest principal moment that rounding in a file may take away
ROUNDED = 1e-3
ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
PRODUCTS = ("ixy", "ixz", "iyz")  # these may be missing


def check_inertials(name: str, robot: ElementTree.Element) -> None:
    """Every inertial of a robot can be read; products of inertia that it leaves out are written into it as zeros.

    Args:
        name: of the file.
        robot: root element.

    Raises:
        SceneError: a number is missing or cannot be read, or a mass is negative; it names the link.
    """
    for link in robot.findall("link"):
        if link.find("inertial") is not None:
            mass, _ = _inertial(name, link)
            for element in link.iterfind("inertial/inertia"):
                for key in ENTRIES:
                    element.set(key, element.get(key, "0"))
            if mass < 0:
                raise SceneError(f"{name}: link {link.get('name')!r}: the mass {mass:g} must not be negative")


def impossible_links(robot: ElementTree.Element) -> list[str]:
    """Links whose inertia no body can have; several of them on one joint may have one that a body can have."""
    found = []
    for link in robot.findall("link"):
        if link.find("inertial") is None:
            continue
        mass, inertia = _inertial("", link)
        a, b, c = np.linalg.eigvalsh(inertia)
        if mass > 0 and (a < -ROUNDED * abs(c) or a + b < (1 - ROUNDED) * c):
            found.append(link.get("name", ""))
    return found


def _inertial(name: str, link: ElementTree.Element) -> tuple[float, np.ndarray]:
    """Mass [kg] and inertia, shape (3, 3) [kg m^2], of a link that has an inertial."""
    who, inertial = f"{name}: link {link.get('name')!r}", link.find("inertial")
    assert inertial is not None
    mass = _number(who, inertial.find("mass"), "mass", "value")
    xx, xy, xz, yy, yz, zz = (_number(who, inertial.find("inertia"), "inertia", key) for key in ENTRIES)
    return mass, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _number(who: str, element: ElementTree.Element | None, tag: str, key: str) -> float:
    text = None if element is None else element.get(key)
    if text is None and element is not None and key in PRODUCTS:
        return 0.0
    try:
        value = float(text or "")
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise SceneError(f"{who}: {key}={text!r} in <{tag}> of its <inertial> is not a number")
    return value
