"""Andrews' squeezing mechanism: seven bodies in a plane, three loops, a motor at constant torque and a spring.

Parameters and names of E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, section VII.7, and of the test
set for initial value problems (F. Mazzia, C. Magherini, University of Bari). The plane is x-y, without gravity. Three
chains of bodies meet in E: the crank K1 and K2 from O, the triangle K3 from B, K5 and K4, and K7 and K6 from A.
The motor turns K1, the spring pulls at D on K3.

In 0.03 s the crank turns two and a half times, at up to 1,500 rad/s.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

from ._mechanism import BLUE, ORANGE, STEEL, Point, Tree

A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)
"""Fixed points; that of the spring is C [m]."""
ANGLES = {
    "beta": -0.0617138900142764496358948458001,
    "theta": 0.0,
    "gamma": 0.455279819163070380255912382449,
    "phi": 0.222668390165885884674473185609,
    "delta": 0.487364979543842550225598953530,
    "omega": -0.222668390165885884674473185609,
    "epsilon": 1.23054744454982119249735015568,
}
"""The joints with their angles at the start, in the order of the literature [rad]."""
END_TIME = 0.03
END_ANGLES = (
    0.1581077119629904e2, -0.1575637105984298e2, 0.4082224013073101e-1, -0.5347301163226948,
    0.5244099658805304, 0.5347301163226948, 0.1048080741042263e1,
)  # fmt: skip
"""The published angles at the end, in the same order [rad]."""
# body: joint it stands on, place of the joint, mass [kg], inertia [kg m^2], centre of mass, all in m
BODIES: dict[str, tuple[str, Point, float, float, Point]] = {
    "beta": ("universe", (0, 0), 0.04325, 2.194e-6, (92e-5, 0)),
    "theta": ("beta", (7e-3, 0), 0.00365, 4.410e-7, (-115e-4, 0)),
    "gamma": ("universe", B, 0.02373, 5.255e-6, (1043e-5, -1874e-5)),
    "delta": ("universe", A, 0.07050, 1.169e-5, (2308e-5, 916e-5)),
    "phi": ("delta", (4e-2, 0), 0.00706, 5.667e-7, (0, 1421e-5 - 2e-2)),
    "epsilon": ("universe", A, 0.05498, 1.912e-5, (1228e-5, -449e-5)),
    "omega": ("epsilon", (0, -4e-2), 0.00706, 5.667e-7, (2e-2 - 1421e-5, 0)),
}
RODS = (
    ("beta", (0, 0), (7e-3, 0)), ("theta", (0, 0), (-28e-3, 0)), ("gamma", (0, 0), (0, -35e-3)),
    ("gamma", (0, 0), (2e-2, -18e-3)), ("gamma", (0, -35e-3), (2e-2, -18e-3)), ("delta", (0, 0), (4e-2, 0)),
    ("phi", (0, 0), (0, -2e-2)), ("epsilon", (0, 0), (0, -4e-2)), ("omega", (0, 0), (2e-2, 0)),
)  # fmt: skip


def load(
    *, torque: float = 0.033, stiffness: float = 4530.0, rest: float = 0.07785
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the mechanism at rest; the joints are those of `ANGLES`, the constraints "K3", "K4" and "K6".

    Args:
        torque: of the motor [N m].
        stiffness: of the spring [N/m].
        rest: length of the spring without force [m].

    Returns:
        The scene, q0 of shape (7,) [rad] and v0 = 0 of shape (7,) [rad/s], both in the order of the model.
    """
    tree = Tree("andrews", (0.0, 0.0, 0.0))
    for name, (parent, at, mass, inertia, centre) in BODIES.items():
        # about the other axes nothing turns: a flat body
        body = pin.Inertia(mass, _in_space(centre), inertia * np.diag([0.5, 0.5, 1.0]))
        tree.add(name, pin.JointModelRZ(), body, _in_space(at), parent)
    for name, start, end in RODS:
        tree.draw_rod(name, _in_space(start), _in_space(end), 6e-4, BLUE if name == "gamma" else STEEL)
    for name, body, at in (
        ("E of K2", "theta", (-28e-3, 0)), ("E of K3", "gamma", (0, -35e-3)), ("E of K4", "phi", (0, -2e-2)),
        ("E of K6", "omega", (2e-2, 0)), ("D", "gamma", (2e-2, -18e-3)), ("C", "universe", C),
    ):  # fmt: skip
        tree.frame(name, body, _in_space(at))
        tree.draw_ball(body, _in_space(at), 1e-3, ORANGE)
    scene = tree.scene()
    for name in ("K3", "K4", "K6"):
        scene.add_constraint(nga.RevoluteJoint(f"E of {name}", "E of K2", name=name))
    scene.add_force(nga.Wrench("beta", moment=(0.0, 0.0, torque)))
    scene.add_force(nga.Spring("C", "D", stiffness, rest))
    q0 = np.array([ANGLES[name] for name in list(scene.model.names)[1:]])
    return scene, q0, np.zeros(7)


def in_order(scene: nga.Scene, x: np.ndarray) -> np.ndarray:
    """Coordinates in the order of the literature, along the last axis.

    Args:
        scene: from `load`.
        x: angles, velocities or accelerations in the order of the model, shape (..., 7).
    """
    return x[..., [scene.model.idx_vs[scene.model.getJointId(name)] for name in ANGLES]]


def _in_space(point: Point) -> np.ndarray:
    return np.array([point[0], point[1], 0.0])
