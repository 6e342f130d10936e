"""Proximal point functions (25)."""

from __future__ import annotations

import numpy as np


def prox_negative(p: np.ndarray) -> np.ndarray:
    """Nearest point of the non-positive numbers, entry by entry (25)."""
    return np.minimum(p, 0.0)


def prox_ball(p: np.ndarray, radius: float) -> np.ndarray:
    """Nearest point of the ball of a radius >= 0 about the origin (25), shape (n,)."""
    norm = float(np.sqrt(p @ p))
    return p if norm <= radius else p * (radius / norm)
