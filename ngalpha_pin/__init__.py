"""Rigid frictional contact for Pinocchio models, by the nonsmooth generalized-alpha method."""

from importlib import import_module
from types import ModuleType

from ngalpha_pin.constraints.frame_forces import Damper, Gravity, Spring, Wrench
from ngalpha_pin.errors import Interrupted, NgalphaError, NotConverged, NotWritten, Penetration, SceneError, UnknownName
from ngalpha_pin.flexible import Cable, LineLoad, PlanarBeam, PointLoad, Rod, Section
from ngalpha_pin.initialization.assembly import Assembly, assemble
from ngalpha_pin.initialization.statics import Equilibrium, Modes, eigenmodes, static_equilibrium
from ngalpha_pin.initialization.transfer import transfer
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.integrators.moreau import MoreauJean
from ngalpha_pin.results.audit import Audit
from ngalpha_pin.results.chunks import Chunks
from ngalpha_pin.results.events import Event
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.scene.actuator import JointActuator
from ngalpha_pin.scene.compliance import HuntCrossley, KelvinVoigt
from ngalpha_pin.scene.constraints import (
    CylindricalJoint,
    Distance,
    DrivenAngle,
    FrameTrajectory,
    JointCoupling,
    JointTrajectory,
    KnifeEdge,
    PlanarJoint,
    PointJoint,
    PrismaticJoint,
    RevoluteJoint,
    RollingDisc,
    RollingSphere,
    UniversalJoint,
    Weld,
)
from ngalpha_pin.scene.contact import ContactLaw, ContactPair, Hollow
from ngalpha_pin.scene.forces import Control, JointSpring
from ngalpha_pin.scene.friction_curve import FrictionCurve, Stribeck
from ngalpha_pin.scene.friction_ellipse import FrictionEllipse
from ngalpha_pin.scene.joint_pd import JointPD
from ngalpha_pin.scene.joints import JointLaws
from ngalpha_pin.scene.mjcf.tree import q_from_mujoco, q_to_mujoco, v_from_mujoco, v_to_mujoco
from ngalpha_pin.scene.own_constraints import PositionConstraint, VelocityConstraint
from ngalpha_pin.scene.pose_spring import PoseSpring
from ngalpha_pin.scene.restitution import Restitution
from ngalpha_pin.scene.sampled_control import SampledControl
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.scene.surface_velocity import SurfaceVelocity
from ngalpha_pin.scene.unilateral import UnilateralConstraint
from ngalpha_pin.sensitivities.differentiated import RunDerivatives, Sensitivities
from ngalpha_pin.sensitivities.statuses import Status
from ngalpha_pin.simulation.batches import simulate_many
from ngalpha_pin.simulation.linearise import Linearisation, linearise
from ngalpha_pin.simulation.rollout import Rollout
from ngalpha_pin.simulation.simulate import Simulator, simulate
from ngalpha_pin.simulation.sweeps.sweep import sweep
from ngalpha_pin.system.state import State

__version__ = "0.2.0"

__all__ = [
    "Assembly",
    "Audit",
    "Cable",
    "ContactLaw",
    "ContactPair",
    "Chunks",
    "Control",
    "Damper",
    "CylindricalJoint",
    "Distance",
    "DrivenAngle",
    "Equilibrium",
    "Event",
    "FrameTrajectory",
    "FrictionCurve",
    "FrictionEllipse",
    "GeneralizedAlpha",
    "Gravity",
    "Hollow",
    "HuntCrossley",
    "Interrupted",
    "JointActuator",
    "JointCoupling",
    "JointLaws",
    "JointPD",
    "JointSpring",
    "JointTrajectory",
    "KelvinVoigt",
    "KnifeEdge",
    "LineLoad",
    "Linearisation",
    "Modes",
    "MoreauJean",
    "NgalphaError",
    "NotConverged",
    "NotWritten",
    "Penetration",
    "PlanarJoint",
    "PointJoint",
    "PoseSpring",
    "PositionConstraint",
    "PrismaticJoint",
    "Restitution",
    "RevoluteJoint",
    "Rod",
    "RollingDisc",
    "RunDerivatives",
    "RollingSphere",
    "Rollout",
    "PlanarBeam",
    "PointLoad",
    "SampledControl",
    "Scene",
    "SceneError",
    "Section",
    "Sensitivities",
    "Simulator",
    "Spring",
    "State",
    "Status",
    "Stribeck",
    "SurfaceVelocity",
    "Trajectory",
    "UnilateralConstraint",
    "UniversalJoint",
    "UnknownName",
    "VelocityConstraint",
    "Weld",
    "Wrench",
    "assemble",
    "eigenmodes",
    "linearise",
    "q_from_mujoco",
    "q_to_mujoco",
    "simulate",
    "simulate_many",
    "static_equilibrium",
    "sweep",
    "transfer",
    "v_from_mujoco",
    "v_to_mujoco",
]


def __getattr__(name: str) -> ModuleType:
    """`nga.robots` and `nga.viz` are loaded when they are first named."""
    if name in ("references", "robots", "viz"):
        return import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
