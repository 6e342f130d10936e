"""Tippe top, section 10.6: friction turns a spinning top over, it stands on its stick until the spin is used up.

The frame K of the body is in the centre of mass S with z along the axis of symmetry, towards the stick:

    r_OS, quaternion  ->  q = (r_OS, x, y, z, w)        v = (v_S in the frame of the world, angular velocity K_Omega)

These are the coordinates of the paper. Pinocchio's free flyer takes v_S in the frame K instead, where it turns with the
spin of 180 rad/s; at the same dt the error of theta is then seven times as large.

The centre of the body is at +a_1 e_z, the centre of the rounded end of the stick at +a_2 e_z. theta is the angle
between e_z of K and the vertical.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

URDF = Path(__file__).parent / "urdf" / "tippe_top.urdf"


def load(
    *,
    spin: float = 180.0,
    theta: float = 0.1,
    height: float = 1.2015e-2,
    mu: float = 0.3,
    e_N: float = 0.0,
    contact_radius: float = 5e-4,
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the top on the plane z = 0, inclined about x; the contacts with "ground" are "top_0", "top_1" (stick).

    Args:
        spin: initial angular velocity about the axis of symmetry [rad/s].
        theta: initial inclination of the axis [rad].
        height: initial height of S [m]; the paper's leaves a gap of 1.25e-8 m.
        mu: friction coefficient [-].
        e_N: restitution in normal direction [-].
        contact_radius: of Coulomb-Contensou friction (157) [m].

    Returns:
        The scene, q0 of shape (7,) [m, -] and v0 of shape (6,) [m/s, rad/s].
    """
    scene = _on_a_sliding_point(nga.Scene.from_urdf(URDF, root_joint=pin.JointModelSpherical()))
    scene.add_plane("ground")
    scene.add_contact("top_*", "ground", mu=mu, e_N=e_N, contact_radius=contact_radius)
    q0 = np.array([0.0, 0.0, height, np.sin(theta / 2), 0.0, 0.0, np.cos(theta / 2)])
    return scene, q0, np.array([0.0, 0.0, 0.0, 0.0, 0.0, spin])


def _on_a_sliding_point(scene: nga.Scene) -> nga.Scene:
    """The scene of a tree with a spherical root joint, on a joint that translates freely."""
    carrier, nothing = pin.Model(), pin.GeometryModel()
    carrier.gravity = scene.model.gravity
    carrier.addJointFrame(carrier.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "translation"))
    where = carrier.getFrameId("translation"), pin.SE3.Identity()
    model, collision = pin.appendModel(carrier, scene.model, nothing, scene.collision_model, *where)
    _, visual = pin.appendModel(carrier, scene.model, nothing, scene.visual_model, *where)
    model.name = scene.model.name
    return nga.Scene(model, collision, visual)


def inclination(q: np.ndarray) -> np.ndarray:
    """The angle theta between the axis of the top and the vertical.

    Args:
        q: configurations, shape (..., 7).

    Returns:
        theta [rad], shape (...).
    """
    x, y, z, w = np.moveaxis(np.asarray(q)[..., 3:7], -1, 0)
    # 2 atan2 of sine and cosine of the half angle: no loss of digits near 0 and pi
    return 2 * np.arctan2(np.hypot(x, y), np.hypot(z, w))
