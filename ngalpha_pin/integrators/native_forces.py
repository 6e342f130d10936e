"""The forces of a scene as the engine takes them: servos, springs, wrenches and damping, without a call of Python."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ngalpha_pin.constraints.frame_forces import BoundSpring, BoundWrench, stands_before
from ngalpha_pin.engine import ForceLaws, PlainSteps, Servos
from ngalpha_pin.scene.forces import JointSpring
from ngalpha_pin.scene.pose_spring import PoseSpring
from ngalpha_pin.scene.sampled_control import SampledControl
from ngalpha_pin.scene.strands import StrandForce
from ngalpha_pin.system.actuation import Actuation
from ngalpha_pin.system.system import System

# in the order in which the engine has them; others are what a user has made of them
KINDS = (JointSpring, PoseSpring, BoundSpring, BoundWrench, StrandForce)


class NativeForces:
    """The force laws of one system in its engine.

    Args:
        system: compiled scene.
        engine: of its steps.
        place: place in q of each velocity coordinate of joints that have as many of one as of the other, -1 elsewhere.
    """

    def __init__(self, system: System, engine: PlainSteps, place: np.ndarray):
        self._place = place
        self._forces: list[Any] = sorted(system.forces, key=_kind)
        self._laws: Any = None
        # forces know the coordinates of the tree alone, and not those of states behind them
        if self._forces and system.states is None and _kind(self._forces[-1]) < len(KINDS):
            model = system.model if system.beams is None else system.tree
            self._laws = ForceLaws(engine, stands_before(model).ravel().tolist())
            for force in self._forces:
                force.enter(self._laws)

    def loads(self, system: System, actuation: Actuation) -> Any:
        """The forces of the scene: natively where the engine knows all, or as a function; None where there are none.

        Gains, stiffnesses and references are those of now: between steps they may be changed.
        """
        if not system.loaded(actuation):
            return None
        # what sampled controls hold is in the state
        controls = [force for force in system.controls if not isinstance(force, SampledControl)]
        servos = [getattr(force, "servo", None) for force in controls]
        laws, numbers = [law for law in servos if law is not None], self._numbers() if self._forces else []
        known = numbers is not None and len(laws) == len(servos) and actuation.holding is None
        if not known or system.states is not None:
            return partial(system.loads_there, actuation=actuation)
        if self._laws is not None:
            self._laws.set(numbers)
        kp, kd = ([law[i].tolist() for law in laws] for i in (0, 1))
        rest = [np.where(self._place < 0, 0.0, law[2][self._place]).tolist() for law in laws]
        held, damping = ([] if x is None else x.tolist() for x in (actuation.tau, system.damping))
        lower, upper = ([], []) if system.effort is None else (bound.tolist() for bound in system.effort)
        return Servos(kp, kd, rest, self._place.tolist(), held, lower, upper, damping, self._laws)

    def _numbers(self) -> list[float] | None:
        """Those of all laws, or None where one of the forces is for Python."""
        if self._laws is None:
            return None
        found: list[float] = []
        for force in self._forces:
            numbers = force.numbers
            if numbers is None:
                return None
            found += numbers
        return found


def _kind(force: object) -> int:
    """Place among `KINDS`; behind them what is for Python."""
    return KINDS.index(type(force)) if type(force) in KINDS else len(KINDS)
