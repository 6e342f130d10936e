"""The force laws of the engine: those of numpy on random states, whole runs, and no call of Python."""

import numpy as np
import pinocchio as pin
import pytest
from work import work_of

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.engine import ForceLaws, Servos
from ngalpha_pin.engine.kernel import binding as kernel
from ngalpha_pin.integrators import native_forces
from ngalpha_pin.integrators.plain_steps import _engine, plain_of
from ngalpha_pin.system.actuation import NO_ACTUATION, Actuation
from ngalpha_pin.system.system import System

pytestmark = pytest.mark.skipif(kernel.library is None, reason=f"no compiled kernel: {kernel.origin}")
TOLERANCE = 1e-12  # between two ways to add the same numbers
RUN = 1e-10  # what rounding grows to in a run
POSE = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([0.1, -0.05, 0.2]))


def chain():
    """A floating body with an arm: a ball joint, a continuous joint and a slider on it."""
    model = pin.Model()
    joints = pin.JointModelFreeFlyer(), pin.JointModelSpherical(), pin.JointModelRUBX(), pin.JointModelPZ()
    parent, rng = 0, np.random.default_rng(3)
    for name, joint in zip(("base", "ball", "turn", "slide"), joints, strict=True):
        parent = model.addJoint(parent, joint, pin.SE3.Random() if parent else pin.SE3.Identity(), name)
        model.appendBodyToJoint(parent, pin.Inertia.FromSphere(1.0 + rng.random(), 0.3), pin.SE3.Identity())
    return nga.Scene(model)


def joint_springs(scene):
    yield nga.JointSpring("slide", stiffness=40.0, rest=0.2, damping=0.3)
    yield nga.JointSpring("turn", stiffness=7.0, rest=3.0, damping=0.2)
    yield nga.JointSpring({"slide": -2.0}, stiffness=9.0, rest=(-0.1, 0.4))


def springs(scene):
    yield nga.Spring("base", "slide", stiffness=30.0, rest=0.4, damping=1.5, placement_a=POSE)
    yield nga.Spring("world", "turn", stiffness=20.0, rest=0.1, placement_b=POSE)
    yield nga.Damper("ball", "world", damping=0.7, placement_b=POSE)


def wrenches(scene):
    yield nga.Wrench("slide", force=(1.0, 2.0, -3.0), moment=(0.1, 0.2, 0.3))
    yield nga.Wrench("turn", force=(4.0, -1.0, 0.5), moment=(0.3, -0.2, 0.1), local=True)


def all_of_them(scene):
    for kind in (wrenches, joint_springs, springs):
        yield from kind(scene)


def loaded(kind, scene=None):
    scene = chain() if scene is None else scene
    for force in kind(scene):
        scene.add_force(force)
    return scene


@pytest.mark.parametrize("kind", [joint_springs, springs, wrenches, all_of_them])
def test_laws_are_those_of_numpy(kind):
    """Value and derivatives at random states."""
    system = System(loaded(kind))
    model, engine = system.model, _engine(system)
    found = native_forces.NativeForces(system, engine, np.full(model.nv, -1)).loads(system, NO_ACTUATION)
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        v = rng.normal(size=model.nv)
        wanted = system.loads_there(0.3, q, v, NO_ACTUATION)
        for part, own in zip(engine.loads(found, 0.3, q, v), wanted, strict=True):
            assert np.abs(part - own).max() <= TOLERANCE * max(1.0, np.abs(own).max())


def test_a_law_of_a_users_own_is_for_python():
    class Own(nga.JointSpring):
        def add_to(self, t, q, v, tau, K, D):
            tau += 1.0

    def at(force):
        scene = chain()
        scene.add_force(force)
        system = System(scene)
        return native_forces.NativeForces(system, _engine(system), np.full(system.nv, -1)).loads(system, NO_ACTUATION)

    assert callable(at(Own("slide", stiffness=1.0)))
    assert callable(at(nga.Wrench("slide", force=lambda t: (t, 0.0, 0.0))))
    assert not callable(at(nga.Wrench("slide", force=(1.0, 0.0, 0.0))))


def arm(kind):
    scene, q0, v0 = robots.load("arm")
    scene.forces.clear()
    names = list(scene.model.names)
    if kind == "springs":
        scene.add_force(nga.Spring(names[-1], "world", stiffness=50.0, rest=0.3, damping=2.0, placement_a=POSE))
        scene.add_force(nga.JointSpring(names[2], stiffness=30.0, rest=0.2, damping=0.1))
    if kind == "wrench":
        scene.add_force(nga.Wrench(names[-1], force=(5.0, 0.0, 9.0), moment=(0.1, 0.2, 0.3), local=True))
    scene.add_force(nga.JointPD(scene.q_ref + 0.3, kp=200.0, kd=3.0))
    return scene, q0, v0


@pytest.mark.parametrize("kind", ["springs", "wrench"])
def test_runs_are_those_with_numpy_and_call_no_python(kind, monkeypatch):
    scene, q0, v0 = arm(kind)
    calls = []
    loads = System.loads_there

    def counted(self, *args, **kwargs):
        calls.append(args)
        return loads(self, *args, **kwargs)

    monkeypatch.setattr(System, "loads_there", counted)
    run = nga.simulate(scene, q0, v0, t_end=0.1, dt=1e-3)
    assert not calls
    work = work_of(run.system, run.final_state, 1e-3, 20, nga.GeneralizedAlpha())
    assert work.counts["plain"] == 20 and work.pinocchio == 0
    monkeypatch.setattr(native_forces, "KINDS", ())
    in_python = nga.simulate(scene, q0, v0, t_end=0.1, dt=1e-3)
    assert calls
    for name in ("q", "v", "a"):
        assert np.abs(getattr(run, name) - getattr(in_python, name)).max() <= RUN * np.abs(run.a).max()


def test_a_stiffness_that_is_changed_between_steps_acts():
    scene, q0, v0 = arm("springs")
    simulator = nga.Simulator(scene, 1e-3)
    state = simulator.steps(simulator.initial_state(q0, v0), 20)[-1].state
    softer = simulator.steps(state, 20)[-1].state
    scene.forces[0].stiffness = 5000.0
    stiffer = simulator.steps(state, 20)[-1].state
    assert np.abs(stiffer.q - softer.q).max() > 1e-4


def test_arrays_of_another_size_are_refused():
    system = System(chain())
    laws = ForceLaws(_engine(system), np.zeros(system.nv**2).tolist())
    with pytest.raises(ValueError, match="another size"):
        laws.add_wrench(1, [0.0] * 9, [0.0] * 3, [1.0], False)
    with pytest.raises(ValueError, match="another size"):
        laws.set([1.0])


def test_servos_beside_sampled_controls_stay_native():
    scene, q0, _ = robots.load("quadruped")
    scene.add_force(nga.SampledControl(lambda t, q, v, forces: np.zeros(v.shape), rate=100.0))
    system = System(scene)
    assert isinstance(plain_of(system).forces.loads(system, Actuation(np.ones(system.nv))), Servos)
