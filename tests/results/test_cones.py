"""The cones of the contacts of a run, in its arrays."""

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga
from ngalpha_pin.results.cones import cones_of


def test_slip_of_all_contacts_comes_before_rolling():
    scene = nga.Scene()
    scene.add_plane("ground")
    for i, law in enumerate(({"mu": 0.3, "rolling_resistance": 0.01}, {"mu": 0.4}, {"rolling_resistance": 0.02})):
        placement = pin.SE3(np.eye(3), np.array([float(i), 0.0, 0.1]))
        scene.add_body(f"ball_{i}", coal.Sphere(0.1), mass=1.0, placement=placement)
        scene.add_contact(f"ball_{i}", "ground", **law)
    run = nga.simulate(scene, scene.q_ref, t_end=0.02, dt=1e-2)
    cones = cones_of(run)
    assert cones.contact.tolist() == [0, 1, 2, 0, 2]
    assert [(rows.start, rows.stop) for rows in cones.rows] == [(0, 2), (4, 6), (6, 6), (2, 4), (6, 8)]
    np.testing.assert_allclose(cones.mu, [0.3, 0.4, 0.0, 0.1, 0.2])
