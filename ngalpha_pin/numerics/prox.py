"""Proximal point function of the ball (25); that of the non-positive numbers is a minimum with zero."""

from __future__ import annotations

import numpy as np


def prox_ball(p: np.ndarray, radius: float) -> np.ndarray:
    """Nearest point of the ball of a radius >= 0 about the origin (25), shape (n,)."""
    norm = float(np.sqrt(p @ p))
    return p if norm <= radius else p * (radius / norm)
