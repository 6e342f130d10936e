"""An MJCF file as the parts of a scene."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import pinocchio as pin

from ngalpha_pin.scene.constraints import Constraint
from ngalpha_pin.scene.contact import ContactLaw, ContactPair
from ngalpha_pin.scene.contents import Entry
from ngalpha_pin.scene.forces import Force
from ngalpha_pin.scene.length_limits import LengthLimit
from ngalpha_pin.scene.mjcf.ball_limits import ball_limits
from ngalpha_pin.scene.mjcf.compiler import compiled
from ngalpha_pin.scene.mjcf.contacts import pairs, surfaces
from ngalpha_pin.scene.mjcf.contents import contents
from ngalpha_pin.scene.mjcf.equality import equality_constraints
from ngalpha_pin.scene.mjcf.forces import forces
from ngalpha_pin.scene.mjcf.geometry import collision_model, visual_model
from ngalpha_pin.scene.mjcf.tendons import add_contacts_of_lengths, length_limits
from ngalpha_pin.scene.mjcf.tree import read_tree


class MjcfFile(NamedTuple):
    """What a file says, in the terms of a scene; the attributes are those of `Scene`."""

    model: pin.Model
    collision_model: pin.GeometryModel
    contacts: list[ContactPair]
    surfaces: dict[str, ContactLaw]
    hollow: set[str]
    constraints: list[Constraint]
    forces: list[Force]
    unilaterals: list[LengthLimit]
    contents: list[Entry]


def read_mjcf(path: str | os.PathLike[str]) -> MjcfFile:
    """Everything of a file that moves.

    Raises:
        SceneError: the file is missing or cannot be read, or MuJoCo is not installed.
    """
    m, said = compiled(path)
    tree = read_tree(m, Path(path).stem)
    geometries, names = collision_model(m, tree)
    limits, hollow = add_contacts_of_lengths(m, tree, geometries)
    rows = contents(m, tree) + [Entry("warning of the compiler", 1, "no effect", text) for text in said]
    return MjcfFile(
        tree.model, geometries, pairs(m, names) + limits, surfaces(m, names), hollow,
        equality_constraints(m, tree.names), forces(m, tree.names),
        [*length_limits(m, tree), *ball_limits(m, tree.names)], rows,
    )  # fmt: skip


def read_mjcf_visuals(path: str | os.PathLike[str]) -> tuple[pin.Model, pin.GeometryModel]:
    """The model of a file and its geometries that are drawn."""
    m, _ = compiled(path)
    tree = read_tree(m, Path(path).stem)
    return tree.model, visual_model(m, tree)
