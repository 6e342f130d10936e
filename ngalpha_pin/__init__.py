"""Rigid frictional contact for Pinocchio models, by the nonsmooth generalized-alpha method."""

from .assembly import Assembly, assemble
from .audit import Audit
from .constraints import (
    CylindricalJoint,
    Distance,
    FrameTrajectory,
    JointCoupling,
    JointTrajectory,
    KnifeEdge,
    PlanarJoint,
    PointJoint,
    PositionConstraint,
    PrismaticJoint,
    RevoluteJoint,
    RollingDisc,
    RollingSphere,
    UniversalJoint,
    VelocityConstraint,
    Weld,
)
from .contact import ContactLaw, ContactPair, Hollow
from .driven_angle import DrivenAngle
from .errors import NgalphaError, NotConverged, Penetration, SceneError, UnknownName
from .events import Event
from .flexible import LineLoad, PlanarBeam, PointLoad
from .forces import Control, JointPD, JointSpring
from .frame_forces import Damper, Gravity, Spring, Wrench
from .generalized_alpha import GeneralizedAlpha
from .joints import JointLaws
from .moreau import MoreauJean
from .scene import Scene
from .simulate import Simulator, simulate
from .state import State
from .statics import Equilibrium, Modes, eigenmodes, static_equilibrium
from .trajectory import Trajectory

__version__ = "0.1.0"

__all__ = [
    "Assembly",
    "Audit",
    "ContactLaw",
    "ContactPair",
    "Control",
    "Damper",
    "CylindricalJoint",
    "Distance",
    "DrivenAngle",
    "Equilibrium",
    "Event",
    "FrameTrajectory",
    "GeneralizedAlpha",
    "Gravity",
    "Hollow",
    "JointCoupling",
    "JointLaws",
    "JointPD",
    "JointSpring",
    "JointTrajectory",
    "KnifeEdge",
    "LineLoad",
    "Modes",
    "MoreauJean",
    "NgalphaError",
    "NotConverged",
    "Penetration",
    "PlanarJoint",
    "PointJoint",
    "PositionConstraint",
    "PrismaticJoint",
    "RevoluteJoint",
    "RollingDisc",
    "RollingSphere",
    "PlanarBeam",
    "PointLoad",
    "Scene",
    "SceneError",
    "Simulator",
    "Spring",
    "State",
    "Trajectory",
    "UniversalJoint",
    "UnknownName",
    "VelocityConstraint",
    "Weld",
    "Wrench",
    "assemble",
    "eigenmodes",
    "simulate",
    "static_equilibrium",
]
