"""A cantilever that is let go: the beam of the hopper (section 10.5), clamped to the world and bent by a force before.

The plane of motion is x-z; q holds the control points of the beam, whose points are "root" and "tip".
"""

from __future__ import annotations

import numpy as np

import ngalpha_pin as nga

from .hopper import EA, EI, LENGTH, LINE_DENSITY


def load(
    *, force: float = 20.0, elements: int = 4, degree: int = 3, damping: float = 0.0, gravity: float = 9.81
) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """Build the cantilever at rest as a force at its tip has bent it.

    Args:
        force: downwards [N]; it is gone when the motion starts.
        elements: of the beam.
        degree: of its shape functions.
        damping: retardation time of the beam [s].
        gravity: gravitational acceleration [m/s^2].

    Returns:
        The scene, q0 and v0 of shape (2 (elements + degree),) [m], [m/s].
    """
    scene = nga.Scene()
    scene.model.name = "cantilever"
    scene.model.gravity.linear = np.array([0.0, 0.0, -gravity])
    beam = scene.add_beam(
        nga.PlanarBeam(
            LENGTH, EA=EA, EI=EI, line_density=LINE_DENSITY, degree=degree, elements=elements, damping=damping
        ),
        "beam",
    )
    scene.add_beam_point("root", "beam", 0.0)
    scene.add_beam_point("tip", "beam", 1.0)
    scene.add_constraint(nga.Weld("world", "root", placement_a=beam.plane))
    scene.add_load(nga.PointLoad("tip", force=(0.0, 0.0, -force)))
    bent = nga.static_equilibrium(scene, scene.q_ref).q
    scene.loads.clear()
    return scene, bent, np.zeros(beam.nv)
