"""One mass on one joint, with the properties of joints that a model can state."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

NO = np.finfo(float).max


def slider(
    mass: float = 1.0,
    limits: tuple[float, float] = (-NO, NO),
    friction: float = 0.0,
    damping: float = 0.0,
    armature: float = 0.0,
    effort: float = 0.0,
    gravity: float = 0.0,
    joint: pin.JointModel | None = None,
) -> nga.Scene:
    """A mass that slides along x, with gravity along x; or the same on another joint."""
    model = pin.Model()
    j = model.addJoint(0, joint or pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(j, pin.Inertia(mass, np.zeros(3), 0.1 * np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(j)
    if model.nq == 1:
        model.lowerPositionLimit, model.upperPositionLimit = np.array(limits[:1]), np.array(limits[1:])
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = np.array([-friction]), np.array([friction])
    model.damping, model.armature = np.array([damping]), np.array([armature])
    model.lowerEffortLimit, model.upperEffortLimit = np.array([-effort]), np.array([effort])
    model.gravity.linear = np.array([gravity, 0.0, 0.0])
    return nga.Scene(model)
