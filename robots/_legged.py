"""What the legged robots share: standing on a plane, and the robots of the package example-robot-data."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

from ._descriptions import file_of, loader_of, srdf_of


def example_robot(name: str) -> tuple[nga.Scene, np.ndarray]:
    """A robot of example-robot-data, without contact.

    Args:
        name: its name there.

    Returns:
        The scene and the reference posture, shape (nq,).

    Raises:
        nga.SceneError: the package is not installed.
    """
    robot = loader_of(name)
    free = pin.JointModelFreeFlyer() if robot.free_flyer else None
    scene = nga.Scene.from_urdf(file_of(name), free)
    return scene, scene.reference(robot.ref_posture, srdf_of(name))


def drop(
    scene: nga.Scene, posture: np.ndarray, feet: str, height: float, mu: float, kp: float, kd: float
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Put the robot above the plane z = 0, its joints held in a posture.

    Args:
        scene: a robot with a free flyer as root.
        posture: configuration to hold, shape (nq,); its height is ignored.
        feet: pattern of the names of the feet.
        height: of the lowest point of the feet above the plane [m].
        mu: friction coefficient between feet and plane [-].
        kp: stiffness of every joint [N m / rad].
        kd: damping of every joint [N m s / rad].

    Returns:
        The scene, q0 of shape (nq,) and v0 = 0 of shape (nv,).
    """
    scene.add_plane("ground")
    scene.add_contact(feet, "ground", mu=mu)
    q0 = scene.place_on("ground", posture, height)
    scene.add_force(nga.JointPD(q0, kp, kd))
    return scene, q0, np.zeros(scene.model.nv)
