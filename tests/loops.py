"""Reference solutions of mechanisms with loops: accelerations and forces of pins from Pinocchio's frame kinematics."""

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

WORLD_AXES = pin.LOCAL_WORLD_ALIGNED


class Loops:
    """A planar tree whose joints have one coordinate each, closed by pins between frames; index reduced.

    Args:
        model: the tree.
        pins: pairs of names of frames, (a, b).
        axes: the two directions of the plane.
        load: load(q, v) -> generalized force, or None.
    """

    def __init__(self, model, pins, axes=(0, 2), load=None):
        self.model, self.data, self.axes, self.load = model, model.createData(), list(axes), load
        self.pins = [[model.getFrameId(name) for name in pair] for pair in pins]

    def frame_rows(self, frame):
        """Jacobian of a frame and its acceleration at a = 0, in the plane."""
        J = pin.getFrameJacobian(self.model, self.data, frame, WORLD_AXES)
        drift = pin.getFrameClassicalAcceleration(self.model, self.data, frame, WORLD_AXES)
        return J[self.axes], drift.linear[self.axes]

    def solve(self, q, v):
        """Acceleration, and the forces of the pins on b in the axes of the world, (pins, 2)."""
        model, data, nv = self.model, self.data, self.model.nv
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T
        h = -pin.nonLinearEffects(model, data, q, v)
        if self.load is not None:
            h = h + self.load(q, v)
        pin.forwardKinematics(model, data, q, v, np.zeros(nv))
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        rows = [[self.frame_rows(frame) for frame in pair] for pair in self.pins]
        J = np.vstack([b[0] - a[0] for a, b in rows])
        drift = np.concatenate([b[1] - a[1] for a, b in rows])
        zero = np.zeros((len(J), len(J)))
        found = np.linalg.solve(np.block([[M, -J.T], [J, zero]]), np.concatenate((h, -drift)))
        return found[:nv], found[nv:].reshape(-1, 2)

    def run(self, q0, v0, t):
        """Displacements from q0 (n, nv), velocities (n, nv) and forces of the pins (n, pins, 2) at the times t."""
        nv = self.model.nv

        def rate(_, y):
            return np.concatenate((y[nv:], self.solve(pin.integrate(self.model, q0, y[:nv]), y[nv:])[0]))

        start = np.concatenate((np.zeros(nv), v0))
        y = solve_ivp(rate, (t[0], t[-1]), start, "DOP853", t, rtol=1e-11, atol=1e-12).y.T
        x, v = y[:, :nv], y[:, nv:]
        forces = [self.solve(pin.integrate(self.model, q0, xi), vi)[1] for xi, vi in zip(x, v, strict=True)]
        return x, v, np.array(forces)


def displacements(trajectory):
    """Angles turned since the start, (n + 1, nv); steps are small, so that a full turn is not lost."""
    model, q = trajectory.scene.model, trajectory.q
    steps = [pin.difference(model, a, b) for a, b in zip(q[:-1], q[1:], strict=True)]
    return np.vstack((np.zeros(model.nv), np.cumsum(steps, axis=0)))


def pin_force(trajectory, constraint, axes=(0, 2)):
    """Force of a pin on its frame b in the axes of the world, (n + 1, 2)."""
    scene = trajectory.scene
    declared = next(c for c in scene.constraints if c.name == constraint)
    (joint, pose), _ = declared.poses(scene)
    columns = [i for i, name in enumerate(trajectory.constraint_names) if name == constraint]
    # rows that stay in the plane: those of the first two directions of the frame of the joint
    assert len(columns) == 2
    data, found = scene.model.createData(), []
    for q, la in zip(trajectory.q, trajectory.la_g[:, columns], strict=True):
        pin.forwardKinematics(scene.model, data, q)
        found.append((data.oMi[joint].rotation @ pose.rotation[:, :2] @ la)[list(axes)])
    return np.array(found)


def slope(sizes, errors):
    """Order of convergence."""
    return np.polyfit(np.log(sizes), np.log(errors), 1)[0]


def assert_no_drift(run, tol=1e-10):
    """Relative to the size of what the rows subtract."""
    motion = run.constraint_motion
    speed, size = np.abs(run.v).max(), np.abs(run.a).max()
    assert np.abs(motion.g).max() <= tol
    assert np.abs(motion.rate).max() <= tol * speed
    assert np.abs(motion.acceleration).max() <= 1e-8 * size
