"""A valid run of which one thing is changed is found out, by the line that speaks of it."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots

FORCES, IMPULSES, DISPLACEMENTS = "equations of motion", "momentum over a step", "displacement over a step"
SLIP, CONE, PULLS, OPEN = (
    "friction against the slip", "friction outside its cone", "contact that pulls", "force at an open contact",
)  # fmt: skip
IMPACT, BALANCE, FINITE = "impact against its laws", "energy that no work explains", "all numbers are finite"


def slider():
    """A block that slides down a slope, with gravity along z and a slope of 30 degrees."""
    model = pin.Model()
    along = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "along")
    up = model.addJoint(along, pin.JointModelPZ(), pin.SE3.Identity(), "up")
    model.appendBodyToJoint(up, pin.Inertia.FromBox(1.0, 0.1, 0.1, 0.1), pin.SE3.Identity())
    model.gravity.linear = 9.81 * np.array([0.5, 0.0, -np.sqrt(0.75)])
    scene = nga.Scene(model)
    scene.add_plane("slope")
    scene.add_geometry("block", coal.Sphere(0.05), parent="up")
    scene.add_contact("block", "slope", mu=0.3)
    return nga.simulate(scene, np.array([0.0, 0.05]), np.array([0.2, 0.0]), t_end=0.2, dt=1e-3)


def rubbed():
    """An arm with dry friction in its joints."""
    scene, q0, v0 = robots.load("arm")
    scene.model.lowerDryFrictionLimit, scene.model.upperDryFrictionLimit = np.full(7, -0.5), np.full(7, 0.5)
    return nga.simulate(scene, q0, v0, t_end=0.1, dt=1e-3)


RUNS = {
    "slider": slider,
    "rubbed": rubbed,
    "ball": lambda: nga.simulate(*robots.load("rotating_ball", e_N=0.5), t_end=1.3, dt=2e-3),
    "corner": lambda: nga.simulate(*robots.load("ball_in_corner"), t_end=0.6, rtol=1e-6),
    "top": lambda: nga.simulate(*robots.load("tippe_top"), t_end=0.05, dt=1e-3),
    "arm": lambda: nga.simulate(*robots.load("arm"), t_end=0.3, dt=2e-3),
    "bars": lambda: nga.simulate(*robots.load("four_bar"), t_end=0.2, dt=1e-3),
}


@pytest.fixture(scope="module")
def valid():
    made = {}

    def run(name):
        if name not in made:
            made[name] = RUNS[name]()
            assert made[name].audit().ok, str(made[name].audit())
        return made[name]

    return run


def scaled(array, factor, rows=slice(None)):
    def change(run):
        values = getattr(run, array).copy()
        values[rows] *= factor
        return {array: values}

    return change


def added(array, what, rows):
    def change(run):
        values = getattr(run, array).copy()
        values[rows] += what
        return {array: values}

    return change


def of_impacts(array, factor):
    def change(run):
        return {"impacts": run.impacts._replace(**{array: factor * getattr(run.impacts, array)})}

    return change


def outside_its_cone(run):
    """A small friction percussion that is twice what its normal one allows."""
    P_F, P_N = run.P_F.copy(), run.P_N
    carries = np.flatnonzero(P_N[:, 0] > 0.0)
    smallest = carries[np.argmin(P_N[carries, 0])]
    P_F[smallest, 0] = 2.0 * 0.2 * P_N[smallest, 0]
    return {"P_F": P_F}


def swapped(run):
    order = np.arange(len(run.t))
    order[[40, 45]] = order[[45, 40]]
    return {name: getattr(run, name)[order] for name in ("q", "v", "a")}


def still(run):
    """A motion that stops for ten steps, with the right velocities."""
    q = run.q.copy()
    q[50:60] = q[50]
    return {"q": q}


def heavier(run):
    """The motion of another mass."""
    model = run.scene.model.copy()
    mass = 1.01 * model.inertias[2].mass
    model.inertias[2] = pin.Inertia.FromBox(mass, 0.1, 0.1, 0.1)
    scene = nga.Scene(model)
    scene.add_plane("slope")
    scene.add_geometry("block", coal.Sphere(0.05), parent="up")
    scene.add_contact("block", "slope", mu=0.3)
    return {"scene": scene}


CORRUPTIONS = {
    "friction that drives the slip": ("slider", scaled("la_F", -1.0), SLIP),
    "half the cone while slipping": ("slider", scaled("la_F", 0.5), SLIP),
    "half the cone of percussions": ("slider", scaled("P_F", 0.5), SLIP),
    "percussions that drive the slip": ("top", scaled("P_F", -1.0), SLIP),
    "slip in space that friction drives": ("top", scaled("la_F", -1.0), SLIP),
    "normal force 10 % too large": ("slider", scaled("la_N", 1.1), FORCES),
    "normal force 10 % too large once": ("ball", scaled("la_N", 1.1, -3), FORCES),
    "normal percussion 10 % too large": ("slider", scaled("P_N", 1.1), IMPULSES),
    "percussion outside its cone": ("ball", outside_its_cone, CONE),
    "contact that pulls": ("slider", scaled("la_N", -1.0, 50), PULLS),
    "force in flight": ("ball", added("la_N", 1e-3, (20, 0)), OPEN),
    "jump of 1 mm": ("slider", added("q", 1e-3, (slice(80, None), 0)), DISPLACEMENTS),
    "jump of 1 mm in a run of chosen accuracy": ("corner", added("q", 1e-3, (slice(4, None), 0)), DISPLACEMENTS),
    "one sample off by 1 mm": ("top", added("q", 1e-3, (30, 0)), DISPLACEMENTS),
    "doubled velocities": ("slider", scaled("v", 2.0), DISPLACEMENTS),
    "doubled velocities of an arm": ("arm", scaled("v", 2.0), DISPLACEMENTS),
    "doubled velocities of a mechanism": ("bars", scaled("v", 2.0), DISPLACEMENTS),
    "velocity that jumps": ("arm", added("v", 1.0, (slice(60, None), 2)), IMPULSES),
    "accelerations 1 % too large": ("arm", scaled("a", 1.01), FORCES),
    "time 1 % too long": ("ball", scaled("t", 1.01), DISPLACEMENTS),
    "rebound of an impact too fast": ("ball", of_impacts("v_after", 1.1), IMPACT),
    "percussion of an impact too large": ("ball", of_impacts("P_N", 1.1), IMPACT),
    "constraint force too large": ("bars", scaled("la_g", 1.01), FORCES),
    "constraint that opens": ("bars", added("q", 1e-6, (50, -1)), "constraints on position level"),
    "dry friction that drives": ("rubbed", scaled("tau_f", -1.0), FORCES),
    "samples in the wrong order": ("arm", swapped, DISPLACEMENTS),
    "motion that stops for a while": ("arm", still, DISPLACEMENTS),
    "another mass": ("slider", heavier, FORCES),
    "no number in a constraint force": ("bars", scaled("La_g", np.nan, 3), FINITE),
    "no number in a percussion": ("top", scaled("P_F", np.nan, 3), FINITE),
}  # fmt: skip


@pytest.mark.parametrize("name", CORRUPTIONS)
def test_corruption_is_found(name, valid):
    of, change, line = CORRUPTIONS[name]
    run = valid(of)
    audit = replace(run, **change(run)).audit()
    assert line in [row.name for row in audit.rows() if row.ok is False], str(audit)
    assert audit.ok is False
