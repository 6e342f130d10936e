"""Small scenes for the table: balls on rails, spring-mass chains, pendulums, plates, boxes."""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.scene.forces import JointSpring
from ngalpha_pin.scene.scene import Scene

Start = tuple[Scene, np.ndarray, np.ndarray]


def balls_on_rails(
    masses: Sequence[float], radius: float, axis: str, gaps: Sequence[float], e_N: float = 0.0, ground: bool = False
) -> Start:
    """Balls in a row along an axis, each on its own rail, with contact between neighbours.

    Args:
        masses: of the balls [kg].
        radius: of all [m].
        axis: "x" or "z".
        gaps: in front of each ball: to the ground (z) or from the origin (x), then to the one before [m].
        e_N: restitution of all contacts [-].
        ground: contact of the first ball with the plane z = 0.
    """
    model = pin.Model()
    model.name = "balls"
    joint = {"x": pin.JointModelPX, "z": pin.JointModelPZ}[axis]
    for i, mass in enumerate(masses):
        model.addJoint(0, joint(), pin.SE3.Identity(), f"rail_{i}")
        model.appendBodyToJoint(i + 1, pin.Inertia.FromSphere(mass, radius), pin.SE3.Identity())
        model.addJointFrame(i + 1)
    scene = Scene(model)
    for i in range(len(masses)):
        scene.add_geometry(f"ball_{i}", coal.Sphere(radius), parent=f"rail_{i}")
    for i in range(1, len(masses)):
        scene.add_contact(f"ball_{i}", f"ball_{i - 1}", e_N=e_N)
    if ground:
        scene.add_plane("ground")
        scene.add_contact("ball_0", "ground", e_N=e_N)
    q0 = np.cumsum(np.asarray(gaps) + 2 * radius) - radius
    return scene, q0, np.zeros(len(masses))


def planar_ball(radius: float, height: float, omega: float, mu: float, inertia: float | None = None) -> Start:
    """A ball of 1 kg in the x-z plane above the plane z = 0, as `robots.rotating_ball` but of any size.

    Args:
        radius: [m].
        height: of its centre [m].
        omega: initial spin [rad/s].
        mu: friction coefficient [-].
        inertia: about the centre, that of a homogeneous ball by default [kg m^2].
    """
    model = pin.Model()
    model.name = "planar ball"
    turn = pin.SE3(np.diag([1.0, -1.0, -1.0]), np.zeros(3))  # the angle counts about -y
    placements = (pin.SE3.Identity(), pin.SE3.Identity(), turn)
    for i, joint in enumerate((pin.JointModelPX(), pin.JointModelPZ(), pin.JointModelRUBY())):
        model.addJoint(i, joint, placements[i], ("x", "z", "phi")[i])
    about = 0.4 * radius**2 if inertia is None else inertia
    model.appendBodyToJoint(3, pin.Inertia(1.0, np.zeros(3), about * np.eye(3)), pin.SE3.Identity())
    model.addJointFrame(3)
    scene = Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(radius), parent="phi")
    scene.add_contact("ball", "ground", mu=mu)
    return scene, np.array([0.0, height, 1.0, 0.0]), np.array([0.0, 0.0, omega])


def spring_hopper(stiffness: float) -> Start:
    """Two masses of 1 kg with a spring between them, dropped from 5 cm; the lower one can touch the ground."""
    model = pin.Model()
    model.name = "two masses"
    for i in range(2):
        model.addJoint(i, pin.JointModelPZ(), pin.SE3.Identity(), ("foot", "spring")[i])
        model.appendBodyToJoint(i + 1, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
        model.addJointFrame(i + 1)
    scene = Scene(model)
    scene.add_plane("ground")
    scene.add_geometry("foot", coal.Sphere(0.1), parent="foot")
    scene.add_contact("foot", "ground")
    scene.add_force(JointSpring("spring", stiffness, rest=0.5))
    return scene, np.array([0.15, 0.5]), np.zeros(2)


def pendulum_chain(n: int, massless: Sequence[int] = (), length: float = 1.0, ground: float | None = None) -> Start:
    """A chain of n equal links that starts stretched to the side; its first end is fixed.

    Args:
        n: number of links.
        massless: links without mass.
        length: of the whole chain [m].
        ground: height of a plane below the fixed end that the far end of each link can touch [m]; None is none.
    """
    model = pin.Model()
    model.name = "chain"
    link = length / n
    for i in range(n):
        place = pin.SE3(np.eye(3), np.array([link if i else 0.0, 0.0, 0.0]))
        model.addJoint(i, pin.JointModelRY(), place, f"joint_{i}")
        if i not in massless:
            rod = pin.Inertia.FromBox(1.0 / n, link, 0.1 * link, 0.1 * link)
            model.appendBodyToJoint(i + 1, rod, pin.SE3(np.eye(3), np.array([link / 2, 0.0, 0.0])))
        model.addJointFrame(i + 1)
    scene = Scene(model)
    if ground is not None:
        scene.add_plane("ground", point=(0.0, 0.0, -ground))
        end = pin.SE3(np.eye(3), np.array([link, 0.0, 0.0]))
        for i in range(n):
            scene.add_geometry(f"end_{i}", coal.Sphere(0.1 * link), parent=f"joint_{i}", placement=end)
        scene.add_contact("end_*", "ground", mu=0.3)
    return scene, np.zeros(n), np.zeros(n)


def free_body() -> Start:
    """A body of 1 kg with three different inertias that tumbles without gravity."""
    model = pin.Model()
    model.name = "free body"
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(1, pin.Inertia(1.0, np.zeros(3), np.diag([1e-3, 2e-3, 2.5e-3])), pin.SE3.Identity())
    model.gravity.linear = np.zeros(3)
    return Scene(model), pin.neutral(model), np.array([1.0, 0.0, 0.0, 2.0, 10.0, 2.0])


def plate(points: int, height: float) -> Start:
    """A square plate of 1 kg that stands on a grid of small feet, about as many as asked for."""
    model = pin.Model()
    model.name = "plate"
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "plate")
    model.appendBodyToJoint(1, pin.Inertia.FromBox(1.0, 1.0, 1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(1)
    scene = Scene(model)
    scene.add_plane("ground")
    side = round(np.sqrt(points))
    for i, x in enumerate(np.linspace(-0.5, 0.5, side)):
        for j, y in enumerate(np.linspace(-0.5, 0.5, points // side)):
            scene.add_geometry(f"foot_{i}_{j}", coal.Sphere(0.0), "plate", pin.SE3(np.eye(3), np.array([x, y, -0.05])))
    scene.add_contact("foot_*", "ground", mu=0.5)
    return scene, np.array([0.0, 0.0, 0.05 + height, 0.0, 0.0, 0.0, 1.0]), np.zeros(6)
