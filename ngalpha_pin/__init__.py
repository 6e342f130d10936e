"""Rigid frictional contact for Pinocchio models, by the nonsmooth generalized-alpha method."""

from .audit import Audit
from .contact import ContactLaw, ContactPair, Hollow
from .errors import NgalphaError, NotConverged, Penetration, SceneError, UnknownName
from .events import Event
from .forces import Control, JointPD, JointSpring
from .generalized_alpha import GeneralizedAlpha
from .moreau import MoreauJean
from .scene import Scene
from .simulate import Simulator, simulate
from .state import State
from .trajectory import Trajectory

__version__ = "0.1.0"

__all__ = [
    "Audit",
    "ContactLaw",
    "ContactPair",
    "Control",
    "Event",
    "GeneralizedAlpha",
    "Hollow",
    "JointPD",
    "JointSpring",
    "MoreauJean",
    "NgalphaError",
    "NotConverged",
    "Penetration",
    "Scene",
    "SceneError",
    "Simulator",
    "State",
    "Trajectory",
    "UnknownName",
    "simulate",
]
