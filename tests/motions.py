"""Motions along which kinematics are differentiated by differences."""

import numpy as np
import pinocchio as pin
from contact_scenes import all_rows

STEP = 1e-5


TOLERANCE = 1e-7
"""Of central differences with that step, relative to the largest entry: truncation 1e-10, rounding 1e-11."""


def same(x, y, tolerance=TOLERANCE):
    return np.abs(np.asarray(x) - y).max() <= tolerance * max(1.0, np.abs(y).max())


def bodies(system, q):
    """Poses of the joints that carry the surface and the contact point."""
    data = system.model.createData()
    pin.forwardKinematics(system.model, data, q)
    return (data.oMi[int(system.scene.geometry(name).parentJoint)] for name in "ab")


def central(function):
    """Derivative of a function of one number at zero."""
    return (function(STEP) - function(-STEP)) / (2 * STEP)


def along(model, q, v, a, s):
    """The motion with velocity v and acceleration a at s = 0; its velocity is v + s a up to s^2."""
    return pin.integrate(model, q, s * v + s**2 / 2 * a), v + s * a


def surface_pose(system, q):
    """Pose of the joint that carries the surface."""
    return next(iter(bodies(system, q)))


def carried(system, q, v, at, pose_of=surface_pose, t=0.0):
    """Friction rates at (q, v) in the tangents of the rows `at`, carried along in parallel as seen from body A.

    A frame of two tangent vectors cannot be continuous all over a sphere, and turns about the normal on the way.
    """
    rows, pose = all_rows(system, q, v, np.zeros_like(v), t), pose_of(system, q)
    pose_0, k = at[1], len(rows.g_N)
    m = (
        len(rows.rate) // k - 1
    )  # rows of each contact: slip along two tangents, drilling, and rolling about the tangents
    found = np.zeros(m * k)
    for i in range(k):
        own = slice(k + m * i, k + m * i + m)
        (t1, t2), rate, tangents_0 = rows.directions[own][:2], rows.rate[own], at[0].directions[own][:2]
        n, n_0 = pose.rotation.T @ rows.normals[i], pose_0.rotation.T @ at[0].normals[i]
        turn = tangents_0 @ pose_0.rotation @ pin.Quaternion.FromTwoVectors(n, n_0).toRotationMatrix() @ pose.rotation.T
        found[m * i : m * i + m] = rate
        for first in range(0, m, 3):
            found[m * i + first : m * i + first + 2] = turn @ (rate[first] * t1 + rate[first + 1] * t2)
    return np.concatenate((rows.rate[:k], found))
