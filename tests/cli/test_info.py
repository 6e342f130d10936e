"""What `ngalpha-pin info` says of a scene, against counts and calls of its steps."""

import re
from collections import Counter
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.cli import info
from ngalpha_pin.cli import main as cli

URDF = Path(str(robots.__file__)).parent / "urdf"


def rows(text):
    """Names and values of the table of info."""
    return dict(re.findall(r"^  (\S.*?)  +(\S.*)$", text, re.MULTILINE))


def test_info_of_a_scene_without_contact(capsys):
    assert cli.main(["info", "arm"]) == 0
    told = rows(capsys.readouterr().out)
    assert told["coordinates"] == "nq = 7, nv = 7"
    assert told["bodies"] == "7 with mass"
    assert told["mass"] == "14 kg"
    assert told["contact"] == "none is declared: only limits of joints are looked at"
    assert told["joint limits"] == "14, each a contact without friction"
    assert told["joint damping"] == told["joint friction"] == "the model states none"
    assert told["constraints"] == "none is declared: no such rows"
    assert not {"normal rows", "friction rows", "Newton matrix", "correction"} & told.keys()


@pytest.mark.parametrize(
    ("command", "friction", "unknowns"),
    [
        ("rotating_ball", "1 tangential (1 dropped: the motion is planar), 0 drilling", "14 unknowns"),
        ("rotating_ball --mu 0", "0 tangential, 0 drilling", "12 unknowns"),
        ("tippe_top", "4 tangential, 2 drilling", "36 unknowns"),
        ("quadruped", "8 tangential, 0 drilling", "82 unknowns"),
    ],
)
def test_info_of_friction(command, friction, unknowns, capsys):
    cli.main(["info", *command.split()])
    told = rows(capsys.readouterr().out)
    assert told["friction rows"] == friction
    assert told["all contacts closed"].startswith(unknowns)
    assert ("friction" in told) == ("--mu 0" in command)
    assert ("drilling friction" in told) == ("0 drilling" in friction and "--mu 0" not in command)
    assert told["forces"] == ("1 JointPD" if command == "quadruped" else "none is declared")


def test_info_of_restitution(capsys):
    cli.main(["info", "ball_in_corner"])
    told = rows(capsys.readouterr().out)
    assert told["impact law"] == "pin.computeJointJacobiansTimeVariation"
    assert "restitution" not in told


@pytest.mark.parametrize("name", ["arm", "rotating_ball", "tippe_top", "ball_in_corner"])
def test_info_names_the_functions_of_pinocchio_that_steps_call(name, monkeypatch):
    scene, q0, v0 = robots.load(name)
    dt, steps, calls = 0.02, 70, Counter()  # free flight, impacts, slip and stick
    monkeypatch.setattr(info, "STEPS", steps)
    for module in ("plain_steps", "native_attempt"):  # what the engine calls is not seen from here
        monkeypatch.setattr(f"ngalpha_pin.integrators.{module}.plain_of", lambda system: None)
    tables = info.tables(scene, q0, v0, dt)
    told = set(re.findall(r"pin\.(\w+)", " ".join(value for _, value in tables["every step"])))
    simulator = nga.Simulator(scene, dt)
    state = simulator.initial_state(q0, v0)

    def counted(function, original):
        def call(*arguments):
            calls[function] += 1
            return original(*arguments)

        return call

    for function in [f for f in dir(pin) if f.startswith(("compute", "integrate", "dIntegrate", "forward", "rnea"))]:
        if callable(getattr(pin, function)):
            monkeypatch.setattr(pin, function, counted(function, getattr(pin, function)))
    for _ in range(steps):
        state = simulator.step(state)
    # the arm does not reach the limits of its joints
    unused = {"computeJointJacobiansTimeVariation"} if name == "arm" else set()
    assert set(calls) == told - unused
    # and as often as the table says
    numbers = dict(tables[f"calls counted over {steps} steps of {dt} s"])
    assert {f: int(re.search(r"(\d+) in all", numbers[f"pin.{f}"])[1]) for f in calls} == calls
    assert numbers["evaluations"].startswith(f"{calls['computeRNEADerivatives'] / steps:.3g} per step")
    assert numbers["coal"].startswith("no call")


def test_info_of_a_start_that_cannot_be_used_says_why(tmp_path, capsys):
    command = ["info", str(URDF / "quadruped.urdf"), "--floating", "--ground", "--height", "-0.1"]
    assert cli.main(command) == 0
    assert "q0 penetrates" in rows(capsys.readouterr().out)["none"]


def test_info_of_pieces_says_what_is_flush():
    """Two tiles, one of them 1e-12 m higher: 2 faces between them, 2 x 4 edges around these."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    for k in (0, 1):
        scene.add_geometry(
            f"tile_{k}", coal.Box(1, 1, 1), placement=pin.SE3(np.eye(3), np.array([k - 0.5, 0, k * 1e-12]))
        )
    scene.add_geometry("ball", coal.Sphere(0.1), "ball")
    scene.add_contact("ball", "tile_*")
    found = dict(info.tables(scene, scene.q_ref, np.zeros(6), 1e-3)["scene"])
    said = found["pieces of a surface"]
    assert said.startswith("2 that touch others") and "2 faces and 8 parts of edges" in said
    assert "less than 2e-10 m are flush (moved by at most 1e-12 m)" in said
