"""Values of any kind, where numbers, names, arrays and functions belong: a clear error of the package, or a scene."""

import dataclasses
import os
import random
from functools import cache
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ngalpha_pin as nga
from ngalpha_pin import robots, viz
from ngalpha_pin.cli import main as cli

EXAMPLES = int(os.environ.get("NGALPHA_EXAMPLES", "8"))
"""Of each call; NGALPHA_EXAMPLES=200 pytest tests/fuzz tries ten thousand."""

numbers = st.one_of(
    st.floats(), st.integers(), st.sampled_from([0, -1, 1e-300, 1e300, 10**400, np.float32(1), np.array(1.0), 1j])
)
rows = st.lists(st.one_of(numbers, st.none(), st.text(max_size=2)), max_size=7)
junk = st.one_of(
    numbers,
    st.none(),
    st.booleans(),
    st.text(max_size=5),
    st.binary(max_size=3),
    rows,
    rows.map(tuple),
    st.lists(st.lists(numbers, max_size=3), max_size=3),
    st.sampled_from([len, dict, object(), {}, {"a": 1}, np.zeros((0, 3)), np.full((2, 2), np.nan), pin.SE3.Identity()]),
    st.sampled_from([coal.Box(1, 1, 1), coal.Sphere(np.nan), pin.Model(), lambda *a: 0.0, lambda *a: None, Path("a")]),
)


def scene():
    model = pin.Model()
    for name in ("b", "c"):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        model.addJointFrame(joint)
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "hinge")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    s = nga.Scene(model)
    s.add_geometry("x", coal.Sphere(0.1), parent="b")
    s.add_plane("p")
    s.add_beam(nga.PlanarBeam(1.0, EA=1.0, EI=1.0, line_density=1.0, elements=2), "beam")
    return s


Q0 = np.concatenate((np.array([0, 0, 1.0, 0, 0, 0, 1, 0, 0, 2.0, 0, 0, 0, 1, 0]), scene().q_ref[15:]))


def section():
    return nga.Section(1.0, (1.0, 1.0), 1.0, (1.0, 1.0), line_density=1.0, line_inertia=(2.0, 1.0, 1.0))


def one_field(j):
    """Another value of one field of a state."""
    names = [field.name for field in dataclasses.fields(nga.State)]
    return dict(zip(random.Random(repr(j)).sample(names, 1), j, strict=False))


@cache
def state():
    return nga.Simulator(scene(), 1e-3).initial_state(Q0)


@cache
def short_run():
    return nga.simulate(*robots.load("rotating_ball"), t_end=1e-2, dt=1e-3)


CALLS = {
    "Scene": lambda s, j: nga.Scene(*j[:3]),
    "add_plane": lambda s, j: s.add_plane(*j[:3]),
    "add_geometry": lambda s, j: s.add_geometry(*j[:5]),
    "placed": lambda s, j: s.add_geometry("y", coal.Sphere(0.1), "c", *j[:2]),
    "add_height_field": lambda s, j: s.add_height_field("h", *j[:4]),
    "heights": lambda s, j: s.add_height_field("h", np.zeros((2, 2)), (1.0, 1.0), *j[:2]),
    "set_surface": lambda s, j: s.set_surface("x", *j[:4]),
    "add_contact": lambda s, j: s.add_contact(*j[:3]),
    "coefficients": lambda s, j: s.add_contact("x", "p", *j[:4]),
    "add_constraint": lambda s, j: s.add_constraint(j[0]),
    "add_force": lambda s, j: s.add_force(j[0]),
    "add_beam": lambda s, j: s.add_beam(*j[:2]),
    "add_beam_point": lambda s, j: s.add_beam_point("end", "beam", *j[:2]),
    "add_load": lambda s, j: s.add_load(j[0]),
    "frame": lambda s, j: s.frame(j[0]),
    "ContactLaw": lambda s, j: nga.ContactLaw(*j[:4]),
    "JointLaws": lambda s, j: nga.JointLaws(*j[:6]),
    "Hollow": lambda s, j: nga.Hollow(j[0]),
    "PointJoint": lambda s, j: s.add_constraint(nga.PointJoint(*j[:4])),
    "RevoluteJoint": lambda s, j: s.add_constraint(nga.RevoluteJoint("b", "c", *j[:4])),
    "Distance": lambda s, j: s.add_constraint(nga.Distance("b", "c", *j[:3])),
    "DrivenAngle": lambda s, j: s.add_constraint(nga.DrivenAngle("b", "c", *j[:4])),
    "KnifeEdge": lambda s, j: s.add_constraint(nga.KnifeEdge("b", *j[:3])),
    "FrameTrajectory": lambda s, j: s.add_constraint(nga.FrameTrajectory("b", *j[:2])),
    "JointTrajectory": lambda s, j: s.add_constraint(nga.JointTrajectory("hinge", *j[:2])),
    "JointCoupling": lambda s, j: s.add_constraint(nga.JointCoupling("hinge", *j[:3])),
    "RollingSphere": lambda s, j: s.add_constraint(nga.RollingSphere("x", *j[:2])),
    "RollingDisc": lambda s, j: s.add_constraint(nga.RollingDisc(*j[:3])),
    "PositionConstraint": lambda s, j: s.add_constraint(nga.PositionConstraint(*j[:3])),
    "JointPD": lambda s, j: s.add_force(nga.JointPD(*j[:3])),
    "gains": lambda s, j: s.add_force(nga.JointPD(pin.neutral(s.model), *j[:2])),
    "JointSpring": lambda s, j: s.add_force(nga.JointSpring("hinge", *j[:3])),
    "Control": lambda s, j: s.add_force(nga.Control(*j[:2])),
    "Spring": lambda s, j: s.add_force(nga.Spring("b", "c", *j[:4])),
    "Damper": lambda s, j: s.add_force(nga.Damper("b", "c", *j[:2])),
    "Wrench": lambda s, j: s.add_force(nga.Wrench("b", *j[:3])),
    "Gravity": lambda s, j: s.add_force(nga.Gravity(j[0])),
    "PlanarBeam": lambda s, j: nga.PlanarBeam(j[0], EA=j[1], EI=j[2], line_density=j[3]),
    "curve": lambda s, j: nga.PlanarBeam(EA=1.0, EI=1.0, line_density=1.0, curve=j[0], plane=j[1]),
    "PointLoad": lambda s, j: nga.PointLoad(*j[:3]),
    "LineLoad": lambda s, j: nga.LineLoad(*j[:2]),
    "GeneralizedAlpha": lambda s, j: nga.GeneralizedAlpha(*j[:5]),
    "MoreauJean": lambda s, j: nga.MoreauJean(*j[:3]),
    "simulate": lambda s, j: nga.simulate(s, j[0], j[1], t_end=2e-3, dt=1e-3),
    "state": lambda s, j: nga.simulate(s, state=j[0], t_end=2e-3, dt=1e-3),
    "dt": lambda s, j: nga.simulate(s, Q0, t_end=1e-3, dt=j[0], method=j[1]),
    "rtol": lambda s, j: nga.simulate(s, Q0, t_end=1e-6, rtol=j[0], atol=j[1], t_eval=j[2], events=j[3]),
    "Simulator": lambda s, j: nga.Simulator(s, *j[:2]).initial_state(Q0),
    "step": lambda s, j: nga.Simulator(s, 1e-3).step(j[0], j[1]),
    "assemble": lambda s, j: nga.assemble(s, j[0], j[1], j[2], j[3]),
    "hold": lambda s, j: nga.assemble(s, Q0, None, j[0], j[1]),
    "static_equilibrium": lambda s, j: nga.static_equilibrium(s, j[0], j[1]),
    "load": lambda s, j: nga.Trajectory.load(j[0]),
    "save": lambda s, j: short_run().save(j[0]),
    "save_html": lambda s, j: viz.save_html(short_run(), *j[:4]),
    "save_to": lambda s, j: nga.simulate(s, Q0, t_end=1e-3, dt=1e-3, save_to=j[0], every=j[1]),
    "Chunks": lambda s, j: nga.Chunks(j[0]),
    "JointActuator": lambda s, j: s.add_force(nga.JointActuator("m", *j[:4])),
    "ranges": lambda s, j: s.add_force(nga.JointActuator("m", "hinge", ctrl_range=j[0], force_range=j[1])),
    "twist": lambda s, j: nga.Rod(1.0, section(), 2, twist=j[0], normal=j[1]),
    "add_body": lambda s, j: nga.Scene().add_body(j[0], coal.Sphere(0.1), j[1]),
    "density": lambda s, j: nga.Scene().add_body("b", coal.Sphere(0.1), None, *j[:2]),
    "add_model": lambda s, j: nga.Scene().add_model(pin.Model(), *j[:4]),
    "source": lambda s, j: nga.Scene().add_model(j[0]),
    "from_mjcf": lambda s, j: nga.Scene.from_mjcf(*j[:2]),
    "from_urdf": lambda s, j: nga.Scene.from_urdf(*j[:3]),
    "disable_contacts": lambda s, j: s.disable_contacts(j[0]),
    "place_on": lambda s, j: s.place_on("p", Q0[:15], j[0], j[1]),
    "within_limits": lambda s, j: s.within_limits(j[0]),
    "reference": lambda s, j: s.reference(j[0], j[1]),
    "remove": lambda s, j: s.remove(j[0]),
    "varied": lambda s, j: s.varied(mass=j[0], kp=j[1], forces=j[2]),
    "q_from_mujoco": lambda s, j: nga.q_from_mujoco(s.model, j[0]),
    "v_to_mujoco": lambda s, j: nga.v_to_mujoco(s.model, j[0], j[1]),
    "join": lambda s, j: nga.Trajectory.join(j[0], j[1]),
    "with_changes": lambda s, j: nga.Trajectory.with_changes(j[0], short_run().scene, []),
    "contact_frames": lambda s, j: short_run().contact_frames(j[0]),
    "contact_force": lambda s, j: short_run().contact_force(*j[:3]),
    "section_forces": lambda s, j: short_run().section_forces(j[0], j[1]),
    "motion of a frame": lambda s, j: short_run().frame(j[0]),
    "mesh of a beam": lambda s, j: nga.Rod(1.0, section(), *j[:1], boundaries=j[1]),
    "ContactPair": lambda s, j: nga.ContactPair(*j[:4]),
    "FrictionEllipse": lambda s, j: nga.FrictionEllipse(*j[:4]),
    "rest": lambda s, j: s.add_force(nga.JointSpring("hinge", 1.0, rest=j[0])),
    "simulate_many": lambda s, j: nga.simulate_many(s, [Q0.tolist()], t_end=1e-3, dt=1e-3, mu=j[0], kp=j[1], mass=j[2]),
    "fields of a state": lambda s, j: nga.Simulator(s, 1e-3).step(dataclasses.replace(state(), **one_field(j))),
    "to_xarray": lambda s, j: short_run().to_xarray(j[0]),
    "release": lambda s, j: nga.Simulator(s, 1e-3).release(j[0]),
}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("call", CALLS)
@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(arguments=st.lists(junk, min_size=6, max_size=6))
def test_any_value_is_refused_or_right(call, arguments, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.getbasetemp())
        try:
            CALLS[call](scene(), arguments)
        except nga.NgalphaError as error:
            assert str(error)


words = st.sampled_from(
    "run replay info report stability rotating_ball tippe_top nothing --dt --t-end --rho-inf --mu --height --q0 --v0 "
    "--out --html --video --serve --address --speed --floating --ground --method moreau --audit --only nope "
    "nan inf -1 0 1e-300 1e300 0,1 , . / missing.urdf missing.xml a.npz a:b a.py:b --loop \0 \ud800 é".split(" ")
)


@pytest.mark.filterwarnings("ignore")
@settings(max_examples=4 * EXAMPLES, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(command=st.sampled_from(["run", "replay", "info", "report"]), arguments=st.lists(words, max_size=4))
def test_any_command_line_ends_with_an_exit_code(command, arguments, tmp_path_factory, capsys):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.getbasetemp())
        patch.setattr("ngalpha_pin.simulate", _short)
        patch.setattr("ngalpha_pin.report.command.report", lambda *a, **k: True)
        patch.setattr("ngalpha_pin.viz.play", lambda *a, **k: None)
        try:
            code = cli.main([command, *arguments])
        except SystemExit as end:  # argparse
            code = end.code
    assert code in (0, 1, 2)


_simulate = nga.simulate


def _short(scene, q0, v0, t_end, dt, **options):
    """Two steps of what was asked for."""
    return _simulate(scene, q0, v0, t_end=t_end if not 0 < dt < t_end else 2 * dt, dt=dt, **options)
