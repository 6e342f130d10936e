"""The centre of mass, and the point in which the forces of the ground have no moment about horizontal axes."""

from __future__ import annotations

from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError
from ngalpha_pin.results.recorded import Recorded
from ngalpha_pin.results.sensors.contact_force import contact_force


class CentreOfMass(NamedTuple):
    """Motion of a centre of mass over time, in the axes of the world; of one state without the first axis.

    Attributes:
        position: shape (n + 1, 3) [m].
        velocity: shape (n + 1, 3) [m/s].
        acceleration: shape (n + 1, 3) [m/s^2].
    """

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


def centre_of_mass(trajectory: Recorded, body: str | None) -> CentreOfMass:
    """See `Sensors.centre_of_mass`."""
    system = trajectory.system
    if trajectory.scene.beams:
        raise SceneError("centre_of_mass knows the bodies of the model alone, and this scene has beams")
    model, data = system.model, system.model.createData()
    root = 0 if body is None else int(trajectory.scene.frame(body).parentJoint)
    bodies = [j for j in model.subtrees[root] if model.inertias[j].mass > 0.0]
    if not bodies:
        raise SceneError(f"centre_of_mass: {body!r} has no mass" if body else "centre_of_mass: nothing has a mass")
    mass, levers = (np.array([getattr(model.inertias[j], of) for j in bodies]) for of in ("mass", "lever"))
    found = []
    for q, v, a in zip(trajectory.q, trajectory.v, trajectory.a, strict=True):
        pin.forwardKinematics(model, data, q, v, a)
        found.append(np.tensordot(mass, _of_bodies(data, bodies, levers), 1) / mass.sum())
    return CentreOfMass(*np.swapaxes(np.array(found).reshape(-1, 3, 3), 0, 1))


def _of_bodies(data: pin.Data, bodies: list[int], levers: np.ndarray) -> np.ndarray:
    """Position, velocity and acceleration of the centres of mass of bodies in the axes of the world, shape (b, 3, 3).

    Args:
        data: with the motion.
        bodies: numbers of their joints.
        levers: centres of mass in the axes of the joints, shape (b, 3) [m].
    """
    R, p = (np.array([getattr(data.oMi[j], of) for j in bodies]) for of in ("rotation", "translation"))
    V, A = (np.array([twist[j].vector for j in bodies]) for twist in (data.v, data.a))
    arm, v, omega, a, alpha = levers, V[:, :3], V[:, 3:], A[:, :3], A[:, 3:]
    velocity = v + np.cross(omega, arm)
    acceleration = a + np.cross(omega, v) + np.cross(alpha, arm) + np.cross(omega, np.cross(omega, arm))
    turned = np.stack((arm, velocity, acceleration), axis=1) @ np.swapaxes(R, 1, 2)
    turned[:, 0] += p
    return turned


def zero_moment_point(trajectory: Recorded, surface: str | None) -> np.ndarray:
    """See `Sensors.zmp`."""
    scene = trajectory.scene
    plane = scene.geometry(surface if surface is not None else _only_plane(trajectory))
    if not isinstance(plane.geometry, coal.Halfspace) or plane.parentJoint != 0:
        raise SceneError(f"zmp: {plane.name!r} is no plane that is fixed to the world")
    normal = plane.placement.rotation @ np.array(plane.geometry.n)
    wrench = contact_force(trajectory, plane.name, None, False).about(plane.placement.translation)
    pressed = wrench.force @ normal  # of the bodies on the plane
    point = np.cross(normal, wrench.moment) / np.where(pressed == 0.0, np.nan, pressed)[:, None]
    return point + plane.placement.translation + float(plane.geometry.d) * normal


def _only_plane(trajectory: Recorded) -> str:
    """The plane of the world that contacts name.

    Raises:
        SceneError: there is none, or more than one.
    """
    scene = trajectory.scene
    named = dict.fromkeys(name for pair in scene.contacts for name in (pair.geometry_a, pair.geometry_b))
    planes = [
        name for name in named
        if isinstance(scene.geometry(name).geometry, coal.Halfspace) and scene.geometry(name).parentJoint == 0
    ]  # fmt: skip
    if len(planes) != 1:
        raise SceneError(f"zmp: name a plane; those with contacts are {', '.join(planes) or 'none'}")
    return planes[0]
