"""Where multipliers stand: every one belongs to one row on one level, whatever kinds a scene has."""

import numpy as np
import pytest
from constraint_scenes import KINDS, tree, with_geometries

import ngalpha_pin as nga
from ngalpha_pin.system.system import System


@pytest.mark.parametrize("constraints", [(), ("weld",), ("knife",), ("weld", "knife", "disc on plane")])
@pytest.mark.parametrize("friction", [False, True])
@pytest.mark.parametrize("contact", [False, True])
def test_multipliers_are_numbered_once(constraints, friction, contact):
    model = tree()
    if friction:
        model.upperDryFrictionLimit[6:9] = 0.5
        model.lowerDryFrictionLimit[6:9] = -0.5
    scene = nga.Scene(model)
    with_geometries(scene)
    for name in constraints:
        scene.add_constraint(KINDS[name]())
    if contact:
        scene.add_contact("ball", "ground", mu=0.3)
    system = System(scene)
    layout = system.layout(system.contacts.subset(np.arange(system.contacts.n_points)))
    every = np.arange(layout.n)
    levels = [every[at] for at in (layout.at_g, layout.at_v, layout.at_a)]
    assert sorted(np.concatenate(levels)) == list(every)
    for level, at in zip((2, 1, 0), levels, strict=True):
        assert (layout.levels[at] == level).all()
    rows = np.arange(layout.rows)
    of_kinds = [rows[part] for part in (layout.contacts, layout.friction, layout.constraints)]
    assert list(np.concatenate(of_kinds)) == list(rows)
    # rows with a position level are a part of all; every row has a velocity and an acceleration level
    assert [len(level) for level in levels] == [len(rows[layout.position_rows]), layout.rows, layout.rows]
    assert (layout.f > 0, layout.k > 0) == (friction, contact)
