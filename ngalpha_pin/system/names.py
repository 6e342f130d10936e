"""What the numbers in a state stand for: the names of joints, contacts, constraints and joint friction of its scene."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

from ngalpha_pin.scene.contents import listed
from ngalpha_pin.system.system import System


class Names(NamedTuple):
    """The names of a system, in the order of its numbers.

    Attributes:
        joints: of the model, and its beams.
        contacts: of the contact table.
        constraints: of each row of g and, behind them, of gamma.
        friction: joints with dry friction.
    """

    joints: tuple[str, ...]
    contacts: tuple[str, ...]
    constraints: tuple[str, ...]
    friction: tuple[str, ...]


def names_of(system: System) -> Names:
    """The names of a system."""
    tree = system.tree if system.scene.beams else system.model
    joints = *list(tree.names)[1:], *system.scene.beams
    return Names(joints, system.contacts.names, system.constraints.names, system.joint_friction.names)


def differences(of_state: Names, of_scene: Names) -> str:
    """What a state has and a scene has not, and the other way round, in words; "" where they are the same."""
    if of_state == of_scene:
        return ""
    said = []
    kinds = ("joint", "contact", "row of constraint", "joint friction")
    for kind, mine, theirs in zip(kinds, of_state, of_scene, strict=True):
        a, b = Counter(mine), Counter(theirs)
        for who, more in (("the state has", a - b), ("the scene has", b - a)):
            if more:
                said.append(f"{who} {kind} {listed(repr(name) for name in more)}")
        if a == b and mine != theirs:
            said.append(f"their {kind}s have another order")
    return "; ".join(said)
