"""Differences of joints that store a cosine and a sine, where those of Pinocchio lose small angles.

It takes a rotation whose trace is rounded above 2 for none at all: one angle of ten, up to 2e-8 rad, is lost. Beside
such angles the way of a planar joint is off by 1e-5 of itself.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin


class PlaneAngles:
    """The joints of a model that store a cosine and a sine.

    Args:
        model: with continuous and planar joints.
    """

    def __init__(self, model: pin.Model):
        of = [j for j in list(model.joints)[1:] if (j.nq, j.nv) == (2, 1) or j.shortname() == "JointModelPlanar"]
        self._cos = np.array([j.idx_q + j.nq - 2 for j in of], dtype=int)
        self._angle = np.array([j.idx_v + j.nv - 1 for j in of], dtype=int)
        self._planar = [(j.idx_q, j.idx_v) for j in of if j.nv == 3]

    def correct(self, q0: np.ndarray, q1: np.ndarray, step: np.ndarray) -> np.ndarray:
        """The tangent step (nv,) from q0 to q1 with what these joints do in it to all digits."""
        if len(self._cos):
            (c0, s0), (c1, s1) = ((q[self._cos], q[self._cos + 1]) for q in (q0, q1))
            step[self._angle] = np.arctan2(c0 * s1 - s0 * c1, c0 * c1 + s0 * s1)
        for q, v in self._planar:
            half, (x, y), (c, s) = step[v + 2] / 2.0, q1[q : q + 2] - q0[q : q + 2], q0[q + 2 : q + 4]
            x, y, along = c * x + s * y, c * y - s * x, half / np.tan(half) if half else 1.0
            step[v : v + 2] = along * x + half * y, along * y - half * x
        return step
