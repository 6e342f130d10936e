"""Cases of contact: friction, bounces, jams, impacts of many bodies, more contacts than the forces can be told by."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pinocchio as pin

from ngalpha_pin import references, robots
from ngalpha_pin.common.tolerances import GRAVITY
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.simulation.simulate import simulate

from . import scenes
from .row import Case, Check, Row, judged

INCLINE = np.radians(20.0)
NOISE = 1e-12


def cases() -> Iterator[Case]:
    """All cases of contact."""
    for bounces in (100, 10_000):
        yield _case(elastic, f"{bounces} bounces with e_N = 1", bounces, long=bounces > 100)
    for mu in (0.0, 1e-12, 0.2, 10.0, 1e6):
        yield _case(friction_ball, f"spinning ball with mu = {mu:g}", mu)
        yield _case(friction_box, f"box on an incline of 20 degrees with mu = {mu:g}", mu)
    yield _case(wedge, "ball jams in a wedge of 20 degrees with mu = 0.5")
    for mu in (0.5, 1.0, 5 / 3, 2.0, 2.5, 3.0):
        yield _case(painleve, f"Painleve rod with mu = {mu:.3g}", mu)
    for n in (2, 10, 50):
        yield _case(row_of_balls, f"ball hits a row of {n - 1} balls that touch, e_N = 0", n, 0.0)
        yield _case(row_of_balls, f"ball hits a row of {n - 1} balls that touch, e_N = 1", n, 1.0)
    yield _case(weightless, "ball hits a ball without gravity, e_N = 1")
    for points in (4, 16, 64, 200):
        yield _case(standing_plate, f"plate stands on {points} points", points, long=points > 100)
        yield _case(dropped_plate, f"plate drops on {points} points", points, long=points > 20)
    yield _case(resting, "contact closed from the start stays closed")
    yield _case(opening, "contact closed from the start opens")
    yield _case(grazing, "contact that is grazed with zero normal velocity")
    for name in ("rotating_ball", "ball_in_corner", "quadruped"):
        yield Case(f"noise of 1e-12 in q0 of {name}", partial(noise, f"noise of 1e-12 in q0 of {name}", name))


def _case(function: Callable[..., Row], name: str, *parameters: float, long: bool = False) -> Case:
    return Case(name, partial(function, name, *parameters), long)


def elastic(name: str, bounces: int) -> Row:
    """The energy must stay."""
    height = 1e-2
    period = 2 * np.sqrt(2 * height / GRAVITY)
    start = robots.load("rotating_ball", omega=0.0, e_N=1.0, height=0.1 + height)
    run = simulate(*start, t_end=bounces * period, dt=period / 10.3)
    total = run.energy.total
    off = float(np.abs(total - total[0]).max() / (GRAVITY * height))
    return judged(name, run, [Check("energy off by", off, 0.1)], rise=0.1)


def friction_ball(name: str, mu: float) -> Row:
    """Against the exact motion."""
    run = simulate(*robots.load("rotating_ball", mu=mu), t_end=1.5, dt=2e-3)
    q, _ = references.rotating_ball(run.t, mu=mu)
    return judged(name, run, [Check("error of the position [m]", float(np.abs(run.q - q)[:, :2].max()), 1e-5)])


def friction_box(name: str, mu: float) -> Row:
    """Against the exact motion: it slides, or it stays where it is."""
    run = simulate(*robots.load("box_on_incline", angle=INCLINE, mu=mu, speed=0.0), t_end=0.5, dt=2e-3)
    q, _ = references.box_on_incline(run.t, INCLINE, mu, speed=0.0)
    return judged(name, run, [Check("error of the position [m]", float(np.abs(run.q - q)[:, 0].max()), 1e-6)])


def wedge(name: str) -> Row:
    """The half-angle is below the angle of friction: the ball must not slide out of the wedge nor through it.

    Against the exact motion: it falls, hits both walls at once and stays there; the forces of the jam are not unique.
    """
    steep = np.radians(80.0)
    parameters = {"alpha": steep, "beta": steep, "mu": 0.5, "e_N_right": 0.0, "e_N_left": 0.0, "x": 0.0, "height": 0.8}
    run = simulate(*robots.load("ball_in_corner", **parameters), t_end=0.5, dt=1e-3, on_failure="stop")
    q, _ = references.ball_in_corner(run.t, **parameters)
    speed = Check("speed at the end", float(np.abs(run.v[-1]).max()), 1e-8)
    return judged(name, run, [Check("error of the position [m]", float(np.abs(run.q - q).max()), 1e-9), speed])


def painleve(name: str, mu: float) -> Row:
    """It must come through its frictional catastrophe."""
    method = GeneralizedAlpha(rho_inf=0.9)
    run = simulate(*robots.load("painleve_rod", mu=mu), t_end=1.2, dt=8e-4, method=method, on_failure="stop")
    return judged(name, run, [])


def row_of_balls(name: str, n: int, e_N: float) -> Row:
    """Momentum stays; with e_N = 0 all go on together, with e_N = 1 the energy stays."""
    scene, q0, v0 = scenes.balls_on_rails([1.0] * n, 0.05, "x", [0.0, 0.1, *[0.0] * (n - 2)], e_N)
    v0[0] = 1.0
    run = simulate(scene, q0, v0, t_end=0.2, dt=1e-3, on_failure="stop")
    checks = [Check("momentum lost", float(run.v[-1].sum()) - 1.0, 1e-9)]
    energy = float((run.v[-1] ** 2).sum())
    checks.append(Check("energy off by", energy - (1.0 if e_N else 1.0 / n), 1e-8))
    return judged(name, run, checks)


def weightless(name: str) -> Row:
    """Without gravity nothing but the impact sets the size of forces."""
    scene, q0, v0 = scenes.balls_on_rails([1.0, 1.0], 0.05, "x", [0.0, 0.1], 1.0)
    scene.model.gravity.linear = np.zeros(3)
    v0[0] = 1.0
    run = simulate(scene, q0, v0, t_end=0.2, dt=1e-3, on_failure="stop")
    return judged(name, run, [Check("speed off by", float(np.abs(run.v[-1] - [0.0, 1.0]).max()), 1e-9)])


def standing_plate(name: str, points: int) -> Row:
    """It stays, and the feet carry its weight together."""
    run = simulate(*scenes.plate(points, 0.0), t_end=0.1, dt=1e-3, on_failure="stop")
    wrong = float(run.la_N[-1].sum()) / GRAVITY - 1
    moved = float(np.abs(run.q - run.q[0]).max())
    return judged(name, run, [Check("weight off by", wrong, 1e-8), Check("moved by", moved, 1e-9)])


def dropped_plate(name: str, points: int) -> Row:
    """It comes to rest with the impact of all feet at once."""
    run = simulate(*scenes.plate(points, 0.01), t_end=0.1, dt=1e-3, on_failure="stop")
    return judged(name, run, [Check("speed at the end", float(np.abs(run.v[-1]).max()), 1e-8)])


def resting(name: str) -> Row:
    """It must not move, not even by rounding that grows."""
    run = simulate(*robots.load("rotating_ball", omega=0.0, height=0.1), t_end=2.0, dt=1e-3)
    wrong = float(np.abs(run.la_N[:, 0] / GRAVITY - 1).max())
    moved = float(np.abs(run.q - run.q[0]).max())
    return judged(name, run, [Check("moved by", moved, 1e-12), Check("force off by", wrong, 1e-9)])


def opening(name: str) -> Row:
    """Thrown up from the ground: the flight is exact."""
    scene, q0, v0 = robots.load("rotating_ball", omega=0.0, height=0.1)
    v0[1] = 1.0
    run = simulate(scene, q0, v0, t_end=0.2, dt=1e-3)
    wrong = run.q[:, 1] - (0.1 + run.t - GRAVITY / 2 * run.t**2)
    force = Check("force", float(np.abs(run.P_N).max()), 0.0)
    return judged(name, run, [Check("error of the position [m]", float(np.abs(wrong).max()), 1e-12), force])


def grazing(name: str) -> Row:
    """Gravity points up: the ball comes down to the plane, touches it with zero velocity and rises again."""
    scene, q0, v0 = robots.load("rotating_ball", omega=0.0, height=0.3)
    scene.model.gravity.linear = np.array([0.0, 0.0, GRAVITY])
    v0[1] = -np.sqrt(2 * GRAVITY * 0.2)
    run = simulate(scene, q0, v0, t_end=0.5, dt=1e-3)
    wrong = run.q[:, 1] - (0.3 + v0[1] * run.t + GRAVITY / 2 * run.t**2)
    return judged(name, run, [Check("error of the position [m]", float(np.abs(wrong).max()), 1e-8)])


def noise(name: str, system: str) -> Row:
    """The events stay the same ones, and the end stays close."""
    runs = []
    for size in (0.0, NOISE):
        scene, q0, v0 = robots.load(system)
        dq = size * np.cos(np.arange(scene.model.nv))
        q0 = pin.integrate(scene.model, q0, dq) if size else q0
        runs.append(simulate(scene, q0, v0, t_end=1.0, dt=2e-3, on_failure="stop"))
    kinds = [Counter((event.kind, event.contact) for event in run.events) for run in runs]
    other = sum(abs(kinds[0][key] - kinds[1][key]) for key in kinds[0] | kinds[1])
    apart = float(np.abs(runs[0].q[-1] - runs[1].q[-1]).max())
    return judged(name, runs[1], [Check("events that differ", other, 0), Check("ends apart by", apart, 1e-6)])
