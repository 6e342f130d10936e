"""How a frame moves, and what an inertial measurement unit in it shows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.constraints.frame_forces import Gravity
from ngalpha_pin.contact.reach import moved_by
from ngalpha_pin.results.recorded import Recorded
from ngalpha_pin.scene.constraints import place_of


class FrameMotion(NamedTuple):
    """Motion of a frame over time, in the axes of the world; of one state without the first axis.

    Attributes:
        position: of its origin, shape (n + 1, 3) [m].
        rotation: its axes as columns, shape (n + 1, 3, 3).
        velocity: of its origin, shape (n + 1, 3) [m/s].
        angular_velocity: shape (n + 1, 3) [rad/s].
        acceleration: of its origin, the second derivative of its position, shape (n + 1, 3) [m/s^2].
        angular_acceleration: shape (n + 1, 3) [rad/s^2].
    """

    position: np.ndarray
    rotation: np.ndarray
    velocity: np.ndarray
    angular_velocity: np.ndarray
    acceleration: np.ndarray
    angular_acceleration: np.ndarray


class Imu(NamedTuple):
    """What an inertial measurement unit shows, in the axes of its frame; of one state without the first axis.

    Attributes:
        gyroscope: angular velocity, shape (n + 1, 3) [rad/s].
        accelerometer: acceleration less that of gravity: at rest it shows 9.81 upwards, shape (n + 1, 3) [m/s^2].
    """

    gyroscope: np.ndarray
    accelerometer: np.ndarray


def frame_motion(trajectory: Recorded, name: str) -> FrameMotion:
    """See `Sensors.frame`."""
    system = trajectory.system
    joint, placement = place_of(trajectory.scene, name)
    moves = moved_by(system.model, joint)
    found = []
    for t, q, v, a in zip(trajectory.t, trajectory.q, trajectory.v, trajectory.a, strict=True):
        system.dynamics(float(t), q, v, a)
        rotations, translations = system.poses
        R, c = rotations[joint].copy(), rotations[joint] @ placement.translation + translations[joint]
        motion = system.motion(v, a)
        J, dJ = motion.J * moves, motion.dJ * moves
        V, A = J @ motion.v, J @ motion.a + dJ @ motion.v  # spatial, at the origin of the world
        velocity = V[:3] + np.cross(V[3:], c)
        acceleration = A[:3] + np.cross(A[3:], c) + np.cross(V[3:], velocity)
        found.append((c, R @ placement.rotation, velocity, V[3:], acceleration, A[3:]))
    return FrameMotion(*(np.array(column) for column in zip(*found, strict=True)))


def imu(trajectory: Recorded, frame: str) -> Imu:
    """See `Sensors.imu`."""
    motion = frame_motion(trajectory, frame)
    felt = motion.acceleration - gravity_over(trajectory)
    into = np.swapaxes(motion.rotation, 1, 2)
    return Imu((into @ motion.angular_velocity[:, :, None])[:, :, 0], (into @ felt[:, :, None])[:, :, 0])


def gravity_over(trajectory: Recorded) -> np.ndarray:
    """Acceleration of gravity over time, shape (n + 1, 3) [m/s^2]."""
    given = np.array(trajectory.scene.model.gravity.linear)
    total = np.tile(given, (len(trajectory.t), 1))
    for force in trajectory.scene.forces:
        if isinstance(force, Gravity):  # each takes the place of that of the model
            total += np.array([force.at(float(t)) for t in trajectory.t]) - given
    return total
