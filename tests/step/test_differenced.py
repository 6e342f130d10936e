"""All derivatives by q: in the engine as in numpy."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from contact_scenes import random_state

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.integrators.plain_steps import plain_of
from ngalpha_pin.step.compiled import CompiledEquations
from ngalpha_pin.step.differenced import DifferencedEquations
from ngalpha_pin.system.state import Auxiliary, State
from ngalpha_pin.system.system import System

DT = 1e-3


def cart():
    """A body on four balls, whose forces are not unique."""
    model, geometry = pin.Model(), pin.GeometryModel()
    body = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "cart")
    model.appendBodyToJoint(body, pin.Inertia(2.0, np.zeros(3), np.diag([0.1, 0.2, 0.3])), pin.SE3.Identity())
    for i, (x, y) in enumerate(((0.3, 0.2), (-0.3, 0.2), (0.3, -0.2), (-0.3, -0.2))):
        place = pin.SE3(np.eye(3), np.array([x, y, -0.1]))
        geometry.addGeometryObject(pin.GeometryObject(f"ball_{i}", body, place, coal.Sphere(0.05)))
    scene = nga.Scene(model, geometry)
    scene.add_plane("ground")
    scene.add_contact("ball_*", "ground", mu=0.5)
    return scene


@pytest.mark.skipif(kernel.library is None, reason="the kernel is not compiled")
@pytest.mark.parametrize(("name", "contacts"), [("quadruped", (0, 2, 3)), ("four_bar", ()), ("cart", (0, 1, 2, 3))])
def test_correction_of_the_engine(name, contacts):
    """One correction, with differences that have half of the digits."""
    system, parameters = System(cart() if name == "cart" else robots.load(name)[0]), nga.GeneralizedAlpha().parameters
    sub, none = system.contacts.subset(np.array(contacts, dtype=int)), np.zeros(0)
    q, v, a = random_state(system.model, 1)
    state = State(0.3, q, v, a, la_b=np.zeros(len(system.constraints.names)), memory=Auxiliary(a, *3 * [none]), dt=DT)
    given = system, parameters, state, DT, sub, tuple(np.ones(sub.k + sub.m) for _ in range(2))
    numpy, compiled = DifferencedEquations(*given), CompiledEquations(*given)
    assert plain_of(system) is not None
    x = numpy.start()
    wanted, dependent = numpy.corrected(numpy.evaluate(x))
    found, n, minimum_norm, _ = compiled.in_engine(compiled.evaluate(x), 1, None, every=True)
    assert n == 1 and dependent == (name == "cart") and not minimum_norm
    for begin, end in ((0, 1), (1, 2), (2, 3), (3, None)):
        part = slice(begin * system.nv, end and end * system.nv)
        size = np.abs(wanted.x[part]).max(initial=1e-300)
        assert found.x[part] == pytest.approx(wanted.x[part], abs=1e-5 * size)
