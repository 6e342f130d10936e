"""One step in one piece: what it says of contacts that close, and the second try with rims that do not run."""

from dataclasses import is_dataclass, replace

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators import division
from ngalpha_pin.integrators.attempt import attempt
from ngalpha_pin.integrators.piece import Piece
from ngalpha_pin.system.state import SolvedBy
from ngalpha_pin.system.system import System

METHOD = nga.GeneralizedAlpha()


def test_contacts_that_close_in_the_step_are_named():
    scene, q0, v0 = robots.load("rotating_ball", height=0.1 + 1e-4, omega=0.0)
    system = System(scene)
    state = initial_state(system, q0, np.array([0.0, -1.0, 0.0]))
    piece = Piece(METHOD.parameters, system, state, 1e-3)
    open_ = attempt(piece, until_closing=True)
    assert list(open_.closing) == [0] and len(open_.state.contacts) == 0
    assert open_.state.q[1] == pytest.approx(0.1 + 1e-4 - 1e-3 - 0.5 * 9.81e-6, abs=1e-12)  # it flies on
    whole = attempt(piece)
    assert len(whole.closing) == 0 and whole.state.P_N.sum() > 0.9
    assert whole.state.q[1] >= 0.1 - 1e-12


def coin():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "coin")
    model.appendBodyToJoint(joint, pin.Inertia.FromCylinder(1.0, 0.2, 0.05), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_geometry("coin", coal.Cylinder(0.2, 0.05), parent="coin")
    scene.add_plane("ground")
    scene.add_contact("coin", "ground", mu=0.4)
    tilt = 0.3
    q0 = pin.neutral(model)
    q0[3:] = pin.Quaternion(pin.exp3(np.array([tilt, 0.0, 0.0]))).coeffs()
    q0[2] = 0.025 * np.cos(tilt) + 0.2 * np.sin(tilt)
    return scene, q0


def test_a_rim_that_runs_too_fast_is_held_before_the_step_is_halved(monkeypatch):
    """A coin on its edge. Where the lowest point may not run around the rim, the whole step is solved all the same."""
    scene, q0 = coin()
    system = System(scene)
    state = METHOD.step(system, initial_state(system, q0), 1e-4).state
    usual = METHOD.step(system, state, 1e-3)
    assert usual.converged and is_dataclass(usual) or hasattr(usual, "_replace")

    def fails_with_running_rims(*arguments, follow_rims=True, **others):
        found = attempt(*arguments, follow_rims=follow_rims, **others)
        if not follow_rims:
            return found
        return replace(found, converged=False) if is_dataclass(found) else found._replace(converged=False)

    monkeypatch.setattr(division, "attempt", fails_with_running_rims)
    held = METHOD.step(system, state, 1e-3)
    assert held.converged and held.solved_by is not SolvedBy.HALVED
    assert held.state.dt == 1e-3
    # of the order of the step the motion is the same
    np.testing.assert_allclose(held.state.v, usual.state.v, atol=2e-2)
