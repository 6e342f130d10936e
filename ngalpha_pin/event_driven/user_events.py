"""Events of the user: functions of the motion whose zeros are located."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.scene.user_function import called

UserFunction = Callable[[float, np.ndarray, np.ndarray], float]


@dataclass
class UserEvent:
    """A function of the user whose zeros are located, with what was found.

    Attributes:
        function: called with (t, q, v); attributes `terminal` (bool or number of times) and `direction` as in scipy.
        t, q, v: where it vanished.
    """

    function: UserFunction
    t: list[float] = field(default_factory=list)
    q: list[np.ndarray] = field(default_factory=list)
    v: list[np.ndarray] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Read the attributes of the function."""
        checks.function("event", self.function, "of (t, q, v)")
        self.name = f"event {getattr(self.function, '__name__', 'of the user')}"
        self.direction = checks.number(f"{self.name}: direction", getattr(self.function, "direction", 0.0))
        terminal = getattr(self.function, "terminal", False)
        if not isinstance(terminal, bool):
            checks.integer(f"{self.name}: terminal", terminal, 0)
        self.terminal = int(terminal)

    def value(self, t: float, q: np.ndarray, v: np.ndarray) -> float:
        """The function at a motion.

        Raises:
            SceneError: it fails, or gives anything but a finite number.
        """
        return checks.number(f"{self.name} at t = {t:g}", called(self.name, self.function, t, q, v))

    def crossed(self, before: float, after: float) -> bool:
        """Whether the signs at both ends of a step show a zero in the wanted direction."""
        up, down = before < 0.0 <= after, before > 0.0 >= after
        return (up and self.direction >= 0) or (down and self.direction <= 0)

    def add(self, t: float, q: np.ndarray, v: np.ndarray) -> bool:
        """Note a zero; whether the run ends there."""
        self.t.append(t)
        self.q.append(q)
        self.v.append(v)
        return 0 < self.terminal <= len(self.t)
