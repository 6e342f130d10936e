"""Centrelines and section forces of beams and rods over a run."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.results.flexible_bodies import TUBE_POINTS, tubes


def test_a_hanging_rod_carries_what_hangs_below():
    scene = nga.Scene()
    section = nga.Section.round(5e-3, 2e9, 0.3, 1200)
    rod = scene.add_rod(nga.Rod(section=section, elements=2, curve=lambda s: np.outer(s, (0.0, 0.0, -1.0))), "wire")
    down = pin.SE3(pin.utils.rotate("y", np.pi / 2), np.zeros(3))
    scene.add_constraint(nga.Weld("world", "wire 0", placement_a=down))
    rest = nga.static_equilibrium(scene, scene.q_ref)
    assert rest.stable
    run = nga.simulate(scene, rest.q, t_end=2e-3, dt=1e-3)
    xi = np.array([0.2, 0.5, 0.9])
    forces = run.section_forces("wire", xi)
    # linear through the Gauss points of each element; lumped weights leave the error of one quadrature in them
    assert forces.N.shape == (3, 3)
    assert np.allclose(forces.N[-1], 9.81 * rod.mass * (1.0 - xi), rtol=1e-3)
    assert abs(run.section_forces(rod, xi).M_y).max() < 1e-9
    name, points, radius = tubes(run)[0]
    assert name == "wire" and points.shape == (3, TUBE_POINTS, 3) and radius == 5e-3
    assert run.tubes[0][0] == "wire"
    with pytest.raises(nga.UnknownName, match="rope"):
        run.section_forces("rope", xi)
