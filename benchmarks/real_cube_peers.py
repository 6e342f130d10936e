"""The simulators that follow the tosses of benchmarks/real_cube.py beside this package, each as a function of a toss.

A cube of eight corners on a plane, without damping in the air. Friction and what stands for restitution there are their
parameters; everything else is their default.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import metadata
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

Body = dict[str, float]
"""edge [m], mass [kg], inertia [kg m^2] and the recorded rate [Hz]."""

FRICTION = (0.15, 0.18, 0.22)


class Peer(NamedTuple):
    """A simulator: its package, what is tried, and what makes a run of a body, steps a record and parameters."""

    name: str
    package: str
    grid: dict[str, tuple[float, ...]]
    build: Callable[..., Callable[[Any], np.ndarray]]

    def version(self) -> str:
        """Of what is installed; empty where nothing is."""
        try:
            return metadata.version(self.package)
        except metadata.PackageNotFoundError:
            return ""


def in_world(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear and angular velocity in the axes of the world of a free flyer."""
    R = pin.Quaternion(q[3:]).toRotationMatrix()
    return R @ v[:3], R @ v[3:]


def mujoco(body: Body, every: int, mu: float, timeconst: float, dampratio: float) -> Callable[[Any], np.ndarray]:
    """MuJoCo with an elliptic cone; the time constant of its contact counts in steps."""
    import mujoco as mj

    dt, half, J = 1.0 / (body["rate"] * every), body["edge"] / 2, body["inertia"]
    model = mj.MjModel.from_xml_string(f"""
        <mujoco><option timestep="{dt!r}" cone="elliptic" integrator="implicitfast"/>
          <default><geom friction="{mu} 0 0" condim="3" solref="{timeconst * dt} {dampratio}"/></default>
          <worldbody><geom type="plane" size="0 0 1"/>
            <body><freejoint/><inertial pos="0 0 0" mass="{body["mass"]}" diaginertia="{J} {J} {J}"/>
              <geom type="box" size="{half} {half} {half}"/></body></worldbody></mujoco>""")
    data = mj.MjData(model)

    def run(toss: Any) -> np.ndarray:
        mj.mj_resetData(model, data)
        data.qpos[:3], data.qpos[3:] = toss.q0[:3], toss.q0[[6, 3, 4, 5]]
        data.qvel[:3], data.qvel[3:] = in_world(toss.q0, toss.v0)[0], toss.v0[3:]
        poses = [data.qpos.copy()]
        for _ in range(len(toss.record) - 1):
            mj.mj_step(model, data, every)
            poses.append(data.qpos.copy())
        return np.array(poses)[:, [0, 1, 2, 4, 5, 6, 3]]

    return run


def drake(body: Body, every: int, mu: float, stiffness: float, relaxation: float) -> Callable[[Any], np.ndarray]:
    """Drake's SAP; the corners are points, because a box touches a plane in one point only."""
    from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation
    from pydrake.multibody.tree import SpatialInertia, UnitInertia
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder

    builder, half, small = DiagramBuilder(), body["edge"] / 2, 1e-4
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=1.0 / (body["rate"] * every))
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    J = body["inertia"] / body["mass"]
    cube = plant.AddRigidBody("cube", SpatialInertia(body["mass"], np.zeros(3), UnitInertia(J, J, J)))
    properties = ProximityProperties()
    AddContactMaterial(point_stiffness=stiffness, friction=CoulombFriction(mu, mu), properties=properties)
    properties.AddProperty("material", "relaxation_time", relaxation)
    for i, signs in enumerate(np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)):
        place = RigidTransform((half - small) * signs)
        plant.RegisterCollisionGeometry(cube, place, Sphere(small), f"corner {i}", properties)
    ground = RigidTransform()
    plant.RegisterCollisionGeometry(plant.world_body(), ground, HalfSpace(), "ground", properties)
    plant.Finalize()
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())

    def run(toss: Any) -> np.ndarray:
        linear, angular = in_world(toss.q0, toss.v0)
        simulator.get_mutable_context().SetTime(0.0)
        plant.SetPositions(context, np.concatenate((toss.q0[[6, 3, 4, 5]], toss.q0[:3])))
        plant.SetVelocities(context, np.concatenate((angular, linear)))
        simulator.Initialize()
        poses = []
        for i in range(len(toss.record)):
            simulator.AdvanceTo(i / body["rate"])
            poses.append(plant.GetPositions(context))
        found = np.array(poses)[:, [4, 5, 6, 1, 2, 3, 0]]
        found[:, 3:] /= np.linalg.norm(found[:, 3:], axis=1)[:, None]
        return found

    return run


def pybullet(body: Body, every: int, mu: float, restitution: float) -> Callable[[Any], np.ndarray]:
    """PyBullet; the product of both surfaces counts, so that those of the ground are one."""
    import pybullet as pb

    client = pb.connect(pb.DIRECT)
    pb.setGravity(0, 0, -9.81, physicsClientId=client)
    pb.setPhysicsEngineParameter(
        fixedTimeStep=1.0 / (body["rate"] * every),
        numSubSteps=0,
        restitutionVelocityThreshold=0.0,
        physicsClientId=client,
    )
    plane = pb.createCollisionShape(pb.GEOM_PLANE, physicsClientId=client)
    ground = pb.createMultiBody(0, plane, physicsClientId=client)
    box = pb.createCollisionShape(pb.GEOM_BOX, halfExtents=[body["edge"] / 2] * 3, physicsClientId=client)
    cube = pb.createMultiBody(body["mass"], box, basePosition=[0, 0, 1], physicsClientId=client)
    none = {"rollingFriction": 0.0, "spinningFriction": 0.0, "physicsClientId": client}
    pb.changeDynamics(ground, -1, lateralFriction=1.0, restitution=1.0, **none)
    pb.changeDynamics(
        cube,
        -1,
        lateralFriction=mu,
        restitution=restitution,
        linearDamping=0.0,
        angularDamping=0.0,
        localInertiaDiagonal=[body["inertia"]] * 3,
        activationState=pb.ACTIVATION_STATE_DISABLE_SLEEPING,
        **none,
    )

    def run(toss: Any) -> np.ndarray:
        linear, angular = in_world(toss.q0, toss.v0)
        pb.resetBasePositionAndOrientation(cube, toss.q0[:3], toss.q0[3:], physicsClientId=client)
        pb.resetBaseVelocity(cube, linear, angular, physicsClientId=client)
        poses = [toss.q0]
        for _ in range(len(toss.record) - 1):
            for _ in range(every):
                pb.stepSimulation(physicsClientId=client)
            position, turn = pb.getBasePositionAndOrientation(cube, physicsClientId=client)
            poses.append(np.concatenate((position, turn)))
        return np.array(poses)

    return run


PEERS = (
    Peer(
        "MuJoCo",
        "mujoco",
        {"mu": FRICTION, "timeconst": (2.0, 3.0, 5.0), "dampratio": (0.2, 0.5, 0.7, 1.0, 1.5, 2.0)},
        mujoco,
    ),
    Peer(
        "Drake",
        "drake",
        {"mu": FRICTION, "stiffness": (3e3, 1e4, 1e5, 1e6), "relaxation": (0.0, 1e-2, 3e-2, 0.1)},
        drake,
    ),
    Peer("PyBullet", "pybullet", {"mu": FRICTION, "restitution": (0.0, 0.05, 0.125, 0.2, 0.3, 0.4)}, pybullet),
)
