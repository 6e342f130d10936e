"""Ranges of tendons: their lengths are MuJoCo's, they hold as unilateral constraints, and go along with their model."""

import pickle

import coal
import numpy as np
import pinocchio as pin
import pytest
from mujoco_reference import OWN, Reference

import ngalpha_pin as nga

PATH = next(path for path in OWN if path.stem == "ranges")


def rows_of(scene, q, v):
    """Gaps, rates and accelerations without those of the coordinates, of all limits by name."""
    system = nga.Simulator(scene, 1e-3).system
    limits = system.unilaterals
    clock = np.concatenate((q, [0.0])), np.concatenate((v, [1.0]))
    system.dynamics(0.0, *clock, np.zeros(system.nv))
    rows = limits.rows(np.arange(len(scene.unilaterals)), clock[0], system.motion(clock[1], np.zeros(system.nv)))
    return {own.name: (g, rate) for own, g, rate in zip(scene.unilaterals, rows.g, rows.rate, strict=True)}


def test_lengths_and_their_rates_are_those_of_mujoco():
    scene, rng = nga.Scene.from_mjcf(PATH), np.random.default_rng(0)
    reference, signs = Reference(PATH, scene.model), {"shortest": 1.0, "longest": -1.0}
    names = reference.names.tendons
    assert {own.name for own in scene.unilaterals} == {f"{t}_{end}" for t in names for end in signs}
    for _ in range(10):
        q, v = rng.normal(size=3), rng.normal(size=3)
        reference.place(q, v)
        found = rows_of(scene, q, v)
        for t, name in enumerate(names):
            for i, (end, sign) in enumerate(signs.items()):
                gap, rate = found[f"{name}_{end}"]
                assert gap == pytest.approx(
                    sign * (reference.d.ten_length[t] - reference.m.tendon_range[t, i]), abs=1e-12
                )
                assert rate == pytest.approx(sign * reference.d.ten_velocity[t], abs=1e-9)


def test_a_body_falls_to_the_end_of_a_fixed_tendon():
    scene = nga.Scene.from_mjcf(PATH)
    for name in ("sum_shortest", "sum_longest", "cable_shortest", "cable_longest"):
        scene.remove(name)
    run = nga.simulate(scene, np.zeros(3), t_end=0.2, dt=5e-3)
    slide = scene.model.idx_qs[scene.model.getJointId("slide")]
    impact = next(event for event in run.events if event.kind == "impact")
    assert impact.contact == "lift_shortest" and impact.t == pytest.approx(np.sqrt(2 * 0.1 / 9.81), abs=1e-9)
    assert run.q[-1][slide] == pytest.approx(-0.1, abs=1e-12)
    # twice the force of the tendon carries the weight
    weight = 9.81 * scene.model.inertias[scene.model.getJointId("slide")].mass
    assert run.la_N[-1].max() == pytest.approx(weight / 2, rel=1e-9)
    assert run.audit().ok


def test_arms_hang_in_a_cable_of_three_sites():
    scene = nga.Scene.from_mjcf(PATH)
    scene.remove("sum_shortest"), scene.remove("sum_longest")
    run = nga.simulate(scene, np.zeros(3), t_end=0.18, dt=5e-3)
    gaps = run.g_N[:, run.contact_names.index("cable_longest")]
    assert gaps.min() > -1e-9 and run.la_N[:, run.contact_names.index("cable_longest")].max() > 1.0  # it was taut
    assert run.audit().ok


def test_limits_go_along_with_their_model():
    alone = nga.Scene.from_mjcf(PATH)
    scene = nga.Scene()
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    at = pin.SE3(pin.utils.rotate("z", 0.7), np.array([0.5, -0.2, 0.1]))
    scene.add_model(PATH, "left", at)
    q, v = np.array([0.3, -0.2, 0.1]), np.array([0.5, 1.0, -0.3])
    whole = np.concatenate((pin.neutral(scene.model)[:7], q)), np.concatenate((np.zeros(6), v))
    ours, theirs = rows_of(scene, *whole), rows_of(alone, q, v)
    for name, (gap, rate) in theirs.items():
        assert ours[f"left/{name}"] == (pytest.approx(gap, abs=1e-12), pytest.approx(rate, abs=1e-9))
    again = pickle.loads(pickle.dumps(scene))
    assert rows_of(again, *whole) == ours
    scene.remove("ball")
    assert rows_of(scene, q, v)["left/cable_longest"] == pytest.approx(theirs["cable_longest"], abs=1e-9)
    with pytest.raises(nga.SceneError, match="'left/c' cannot be removed"):
        scene.remove("left/c")
    scene.add_unilateral(nga.UnilateralConstraint(lambda t, q: q[0] + 9.0, name="own"))
    with pytest.raises(nga.SceneError, match="add models before states and unilateral constraints"):
        scene.add_model(PATH, "right")
