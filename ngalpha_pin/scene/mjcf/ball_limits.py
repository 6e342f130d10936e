"""Ranges of the ball joints of a compiled MJCF model: the angle of the joint, about whatever axis, has an upper end."""

from __future__ import annotations

from typing import Any

import numpy as np

from ngalpha_pin.scene.length_limits import BallLimit
from ngalpha_pin.scene.mjcf.compiler import Names, disabled, mujoco


def limited_balls(m: Any) -> np.ndarray:
    """Which joints are ball joints with a range."""
    is_ball = np.array(m.jnt_type) == int(mujoco().mjtJoint.mjJNT_BALL)
    return np.asarray(is_ball & np.array(m.jnt_limited, dtype=bool), dtype=bool)


def ball_limits(m: Any, names: Names) -> list[BallLimit]:
    """A unilateral constraint for each of them."""
    chosen = [] if disabled(m, "LIMIT") else np.flatnonzero(limited_balls(m)).tolist()
    return [BallLimit(names.joints[j], f"{names.joints[j]}_range", float(np.max(m.jnt_range[j]))) for j in chosen]
