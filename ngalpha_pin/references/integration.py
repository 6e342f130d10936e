"""What the event-driven references have in common: integration to round-off, and events that end it."""

from __future__ import annotations

from typing import Any

import numpy as np

Motion = tuple[np.ndarray, np.ndarray]
"""(q, v): shapes (n, nq) and (n, nv)."""

PRECISE: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14, "dense_output": True}
"""Options of `scipy.integrate.solve_ivp`."""


def ends_integration(event: Any, direction: float = 0.0) -> None:
    """Let an event function of `solve_ivp` stop it where it passes through zero.

    Args:
        event: the function, which gets two attributes.
        direction: 1 where it grows, -1 where it falls, 0 both.
    """
    event.terminal, event.direction = True, direction
