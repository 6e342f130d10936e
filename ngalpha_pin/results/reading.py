"""The sensors at one state."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import numpy as np

from ngalpha_pin.results.recorder import Recorder
from ngalpha_pin.results.sensors.sensors import Sensors
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

Method = TypeVar("Method", bound=Callable[..., Any])


def _of_one(method: Method) -> Method:
    """A sensor without the axis of time."""

    @wraps(method)
    def first(*args: Any, **kwargs: Any) -> Any:
        found = method(*args, **kwargs)
        return found[0] if isinstance(found, np.ndarray) else type(found)(*(array[0] for array in found))

    return first  # type: ignore[return-value]


class Reading(Sensors):
    """What the sensors show at one state: those of a `Trajectory`, without the axis of time.

    Args:
        system: compiled scene.
        state: the state.
        method: that made it.
    """

    def __init__(self, system: System, state: State, method: str):
        length = state.whole or state.dt
        self._of = Recorder(system, state).trajectory(system.scene, method, length, True, "one state")
        self._of.__dict__["system"] = system

    @property
    def _run(self) -> Trajectory:
        return self._of

    contact_force = _of_one(Sensors.contact_force)
    contact_percussion = _of_one(Sensors.contact_percussion)
    contact_point = _of_one(Sensors.contact_point)
    joint_reaction = _of_one(Sensors.joint_reaction)
    frame = _of_one(Sensors.frame)
    imu = _of_one(Sensors.imu)
    centre_of_mass = _of_one(Sensors.centre_of_mass)
    zmp = _of_one(Sensors.zmp)
