"""Rigid frictional contact for Pinocchio models, by the nonsmooth generalized-alpha method."""

from .audit import Audit
from .contact import ContactLaw, ContactPair, Hollow
from .errors import NgalphaError, NotConverged, Penetration, SceneError, UnknownName
from .events import Event
from .forces import Control, JointPD, JointSpring
from .generalized_alpha import GeneralizedAlpha
from .scene import Scene
from .simulate import Simulator, simulate
from .state import State
from .trajectory import Trajectory

__version__ = "0.1.0"
