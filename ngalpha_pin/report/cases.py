"""What a report runs: systems with what is known of their motion, and scenes of the user's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin import references, robots
from ngalpha_pin.common.tolerances import GRAVITY
from ngalpha_pin.errors import SceneError
from ngalpha_pin.references.integration import Motion
from ngalpha_pin.scene.scene import Scene

UNKNOWN_END = 0.25  # of a quick report of a scene of which nothing is known: a fall of 0.1 m and the landing [s]
PAPER = ("rotating_ball", "ball_in_corner", "ball_in_cylinder", "painleve_rod", "hopper", "tippe_top")
HOPPER = (
    "The landing at 0.12622 s is located within its step, and up to the next lift-off the order is 2 as it is between "
    "impacts. The landing makes the leg swing along its axis with a period of 1.6e-4 s, and while it does the foot "
    "lifts off and lands again: once or not at all with dt = 1e-4, five times in 0.5 ms with 8e-6. Each of these "
    "landings moves the hopper by less than 1e-7 m, which is how certain the reference is. They decide when the foot "
    "lands again at 0.130 s, so that later errors (1e-5 m at 0.15 s) fall only with steps that resolve this swing, "
    "below 1e-5 s. Friction has no part in it: no slip ends here, and it is the same with mu = 0. With a leg that "
    "damps it (`damping=1e-4`) the order is 2 across both landings from dt = 1.25e-4 on: errors of 3.9e-7, 9.7e-8 "
    "and 1.5e-8 m at 0.15 s. Moreau's scheme is explicit in the stiffness of the leg and bursts with these dt; runs of "
    "chosen accuracy have to resolve its swing, and are given up."
)


@dataclass(frozen=True)
class Case:
    """A system and how it is run.

    Attributes:
        name: of the system and its parameters.
        start: builds the scene, q0 and v0.
        t_end: end of the run [s].
        sizes: steps dt, from coarse to fine [s].
        rho_inf: parameter of generalized-alpha [-].
        reference: exact motion (q, v) at the times t, NaN where it is not known; None takes the finest run.
        smooth: start and end of a stretch without events [s]; None looks for it.
        kind: what the reference is.
        quick_end: end of the run in a quick report [s].
        finer: where the finest run is the reference, its steps are so many times smaller than the finest of `sizes`.
        doubt: uncertainty of that reference which its own convergence does not show [m].
        note: what a reader must know of its orders.
    """

    name: str
    start: Callable[[], tuple[Scene, np.ndarray, np.ndarray]]
    t_end: float
    sizes: tuple[float, ...]
    rho_inf: float = 0.5
    reference: Callable[[np.ndarray], Motion] | None = None
    smooth: tuple[float, float] | None = None
    kind: str = "finest run"
    quick_end: float = np.inf
    finer: int = 4
    doubt: float = 0.0
    note: str = ""

    def quick(self, n: int) -> Case:
        """The n coarsest steps, and where the run takes long only its beginning."""
        unknown = self.reference is None and not np.isfinite(self.quick_end)
        t_end = min(self.t_end, UNKNOWN_END if unknown else self.quick_end)
        smooth = None if self.smooth is None else (self.smooth[0], min(self.smooth[1], t_end))
        finer = min(self.finer, 2) if unknown else self.finer
        return replace(self, sizes=self.sizes[:n], t_end=t_end, smooth=smooth, finer=finer)


def halvings(dt: float, n: int) -> tuple[float, ...]:
    """The step dt and n - 1 halvings of it [s]."""
    return tuple(dt / 2**i for i in range(n))


def known_cases() -> dict[str, Case]:
    """The systems of the paper and some textbook motions, by name."""
    ball, fine, event_driven = partial(_system, "rotating_ball"), halvings(1e-2, 5), "event-driven reference"
    cases = [
        ball("rotating_ball, omega = 50", 1.5, fine, "closed form", (0.45, 0.72), 0.5, 0.8, omega=50.0),
        ball("rotating_ball, omega = 10", 1.5, fine, "closed form", (0.45, 1.5), 0.5, 0.8, omega=10.0),
        ball("rotating_ball, e_N = 0.5", 1.6, fine, "closed form", (0.0, 0.42), 0.5, 1.0, omega=0.0, e_N=0.5),
        _system("ball_in_corner", "ball_in_corner", 1.34, halvings(4e-3, 4), "closed form", (0.0, 0.26), 0.5, 0.6),
        _system("ball_in_cylinder", "ball_in_cylinder", 2.0, halvings(1e-2, 4), event_driven, (0.8, 1.35), 0.5, 1.0),
        _system("painleve_rod", "painleve_rod", 0.72, halvings(3.2e-3, 4), event_driven, (0.0, 0.72), 0.9, 0.4),
        _system("tippe_top", "tippe_top", 1.3, halvings(2e-3, 3), event_driven, (0.01, 0.6), 0.5, 0.15),
        Case(
            "pendulum", pendulum, 2.0, halvings(1.6e-2, 5), 0.5,
            lambda t: references.pendulum(t, 2.0, np.sqrt(GRAVITY / 0.5)), (0.0, 2.0), "closed form",
        ),
        _system("box_on_incline", "box_on_incline", 0.3, halvings(1e-2, 5), "closed form", (0.0, 0.12)),
        _system("rocking_block", "rocking_block", 1.6, halvings(1e-2, 4), event_driven, (0.0, 0.2), 0.5, 0.5),
        _system("cradle", "cradle", 2.0, halvings(1e-2, 4), event_driven, (0.0, 0.2), 0.5, 0.5),
        _system("rolling_disc", "rolling_disc", 0.5, halvings(8e-3, 4), "closed form", (0.0, 0.5), 0.9, 0.1),
        _system("turntable", "turntable", 2.0, halvings(2e-2, 4), "closed form", (0.0, 2.0), 0.9, 0.4),
        Case("four_bar", partial(robots.load, "four_bar"), 0.5, halvings(4e-3, 4), quick_end=0.06),
        # up to the landing and the lift-off after it; steps that resolve the bending of the leg
        Case(
            "hopper", partial(robots.load, "hopper"), 0.128, halvings(1e-3, 3), smooth=(0.0, 0.12), quick_end=0.008,
            finer=2, doubt=1e-7, note=HOPPER,
        ),
    ]  # fmt: skip
    return {case.name: case for case in cases}


def chosen_cases(name: str) -> list[Case]:
    """The cases of a system: those that are known, or one that compares with the finest run; none for another name.

    Args:
        name: of a case or a system, or "paper" for the six systems of the paper.
    """
    wanted = PAPER if name == "paper" else (name,)
    known = [case for key, case in known_cases().items() if key == name or key.partition(",")[0] in wanted]
    if known:
        return known
    if name not in robots.names():
        return []
    return [Case(name, partial(robots.load, name), 0.5, halvings(4e-3, 4))]


def own_case(name: str, start: tuple[Scene, np.ndarray, np.ndarray], t_end: float) -> Case:
    """A scene of the user's own, compared with its finest run."""
    return Case(name, lambda: start, t_end, halvings(4e-3, 4))


def check_sizes(sizes: tuple[float, ...]) -> tuple[float, ...]:
    """Sorted from coarse to fine; every step must be a multiple of the finest, so that runs meet at the same times."""
    if not sizes or not all(np.isfinite(dt) and dt > 0 for dt in sizes):
        raise SceneError(f"dt = {', '.join(f'{dt:g}' for dt in sizes)}: all steps must be positive")
    ratios = np.array(sizes) / min(sizes)
    if np.abs(ratios - np.round(ratios)).max() > 1e-9 * ratios.max():
        raise SceneError("every dt must be a multiple of the smallest one, so that the runs meet at the same times")
    return tuple(sorted(set(sizes), reverse=True))


def pendulum() -> tuple[Scene, np.ndarray, np.ndarray]:
    """A point of 2 kg at 0.5 m on a massless rod, released at rest 2 rad from the downward vertical."""
    model = pin.Model()
    model.name = "pendulum"
    model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "pivot")
    bob = pin.Inertia(2.0, np.array([0.0, 0.0, -0.5]), np.zeros((3, 3)))
    model.appendBodyToJoint(1, bob, pin.SE3.Identity())
    return Scene(model), np.array([2.0]), np.zeros(1)


def _system(
    system: str,
    name: str,
    t_end: float,
    sizes: tuple[float, ...],
    kind: str,
    smooth: tuple[float, float],
    rho_inf: float = 0.5,
    quick_end: float = np.inf,
    **parameters: Any,
) -> Case:
    """A system of robots/ with the reference of the same name."""
    reference = partial(getattr(references, system), **parameters)
    return Case(
        name, partial(robots.load, system, **parameters), t_end, sizes, rho_inf, reference, smooth, kind, quick_end
    )
