"""Cases of scale: stiffness, mass, inertia, length, spin, number of bodies, step, damping of the method."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
import pinocchio as pin

from ngalpha_pin import references, robots
from ngalpha_pin.common.tolerances import GRAVITY
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.robots.tippe_top import inclination
from ngalpha_pin.simulation.simulate import simulate

from . import scenes
from .row import ROUNDING, Case, Check, Row, judged

TURN = "links that turn by a radian in a step after the impact; with half the step it reaches its end"
HALF_TURN = "links that turn by half a radian in a step after the impact; it reaches its end"
FALL = "the free fall of one step, which is as long as the legs; dt < sqrt(2 l / g) passes"
STANDS = 0.3229  # height of the quadruped at rest, from a run with dt = 5e-4 [m]


def cases() -> Iterator[Case]:
    """All cases of scale."""
    for k in (1e3, 1e6, 1e9, 1e12):
        yield _case(spring, f"spring of {k:.0e} N/m between two masses that are dropped, dt = 1e-3", k)
    for ratio in (1.0, 1e3, 1e6, 1e9):
        yield _case(heavy_on_light, f"ball on a ball, {ratio:.0e} times as heavy, at rest", ratio)
    for inertia in (1e-3, 1e-6, 1e-9):
        yield _case(small_inertia, f"ball of 1 kg and 0.1 m with inertia {inertia:.0e} kg m^2 slips and rolls", inertia)
    for size in (1e-6, 1e-3, 1e3, 1e6):
        yield _case(size_of_scene, f"lengths times {size:.0e}: fall, impact, slip, roll", size)
    for spin in (1e3, 1e5):
        yield _case(fast_spin, f"ball with a spin of {spin:.0e} rad/s drops and slips", spin)
    yield _case(spinning_body, "free body with a spin of 1e+05 rad/s about its axis")
    yield _case(hanging_chain, "chain of 100 links hangs at rest", 100)
    yield _case(long_chain, "chain of 100 links falls, dt = 1e-3", 100)
    for rho in (0.5, 0.0):
        for dt in (1e-3, 5e-4):
            title = f"chain of 100 links with 100 contacts falls on the ground, dt = {dt:g}, rho_inf = {rho:g}"
            yield _case(chain_on_ground, title, dt, rho, long=True, bound=TURN if dt == 1e-3 else HALF_TURN)
    yield _case(massless_links, "chain of 6 links, every second one without mass")
    for dt in (1e-6, 1e-4, 1e-2, 5e-2, 0.1, 0.2):
        yield _case(step_ball, f"spinning ball falls, slips, rolls with dt = {dt:g}", dt)
    for dt in (5e-4, 2e-3, 1e-2, 2e-2, 5e-2, 0.1, 0.2, 0.25, 0.5):
        far, title = dt > 0.2, f"quadruped lands with dt = {dt:g}"
        yield _case(step_quadruped, title, dt, long=dt < 1e-3 or far, bound=FALL if far else "")
    for rho in (0.0, 0.5, 0.9, 1.0):
        yield _case(damping_top, f"tippe top for 0.2 s with rho_inf = {rho:g}", rho)
        yield _case(damping_quadruped, f"quadruped lands with rho_inf = {rho:g}", rho)


def _case(function: Callable[..., Row], name: str, *parameters: float, long: bool = False, bound: str = "") -> Case:
    return Case(name, partial(function, name, *parameters), long, bound)


def spring(name: str, stiffness: float) -> Row:
    """The energy must not rise, whether the step resolves the oscillation or not."""
    run = simulate(*scenes.spring_hopper(stiffness), t_end=0.5, dt=1e-3, on_failure="stop")
    weight = 2 * GRAVITY
    push = float(run.P_N[:, 0].sum())
    momentum = float(run.v[-1, 0] + (run.v[-1, 0] + run.v[-1, 1]))
    # what the ground gave is what the momentum and the weight took
    return judged(name, run, [Check("momentum not accounted for", (push - weight * run.t[-1] - momentum) / push, 1e-6)])


def heavy_on_light(name: str, ratio: float) -> Row:
    """The lower ball carries both.

    Both gaps may be off by tol dt^2 g sqrt(1 + ratio), the tolerance of a light row in the unit of force of the scene;
    that much of the weight of the heavy ball, 0.3 m above the ground, is no rise of the energy.
    """
    method, dt = GeneralizedAlpha(), 1e-3
    start = scenes.balls_on_rails([1.0, ratio], 0.1, "z", [0.0, 0.0], ground=True)
    run = simulate(*start, t_end=0.2, dt=dt, method=method)
    rounding = 2 * method.tol * dt**2 * GRAVITY * np.sqrt(1 + ratio) / 0.3 / ROUNDING
    names = run.contact_names
    ground = next(k for k, n in enumerate(names) if "ground" in n)
    wrong = run.la_N[-1, ground] / ((1 + ratio) * GRAVITY) - 1
    checks = [Check("force at the ground off by", wrong, 1e-9), _still(run)]
    return judged(name, run, checks, rise=max(1e-2, rounding))


def _still(run: Trajectory) -> Check:
    return Check("moved by", float(np.abs(run.q - run.q[0]).max()), 1e-9)


def small_inertia(name: str, inertia: float) -> Row:
    """It rolls in the end, and the angular momentum about a point of the ground stays."""
    omega = 50.0
    run = simulate(*scenes.planar_ball(0.1, 0.1, omega, 0.2, inertia), t_end=0.8, dt=1e-3)
    v = run.v[-1]
    about_ground = v[2] * inertia - 0.1 * v[0]
    # the sign of the slip is that of omega
    lost = about_ground / (inertia * omega) - 1
    slip = float(np.abs(run.gamma_F[-1]).max())
    return judged(name, run, [Check("angular momentum lost", lost, 1e-8), Check("slip at the end", slip, 1e-8 * omega)])


def size_of_scene(name: str, size: float) -> Row:
    """The motion, in units of the length and of the time of fall, is that of the scene of 1 m."""
    runs = []
    for length in (1.0, size):
        second = np.sqrt(length)
        start = scenes.planar_ball(0.1 * length, 0.3 * length, 50.0 / second, 0.2)
        runs.append(simulate(*start, t_end=0.6 * second, dt=2e-3 * second))
    here = runs[1].q[:, :2] / size
    apart = float(np.abs(here - runs[0].q[:, :2]).max())
    return judged(name, runs[1], [Check("motion differs by", apart, 1e-9)])


def fast_spin(name: str, spin: float) -> Row:
    """Against the exact motion."""
    start = robots.load("rotating_ball", omega=spin)
    run = simulate(*start, t_end=1.0, dt=2e-3)
    q, _ = references.rotating_ball(run.t, omega=spin)
    return judged(name, run, [Check("error of the position [m]", float(np.abs(run.q - q)[:, :2].max()), 1e-4)])


def spinning_body(name: str) -> Row:
    """One hundred radians a step: the axis of the least inertia stays where it is, and the spin."""
    scene, q0, _ = scenes.free_body()
    v0 = np.array([0.0, 0.0, 0.0, 1e5, 0.0, 0.0])
    run = simulate(scene, q0, v0, t_end=0.5, dt=1e-3)
    axis = [pin.XYZQUATToSE3(q).rotation[:, 0] for q in (run.q[0], run.q[-1])]
    spin = Check("spin off by", float(np.abs(run.v - v0).max()) / 1e5, 1e-9)
    return judged(name, run, [spin, Check("axis tilts by [rad]", float(np.linalg.norm(axis[1] - axis[0])), 1e-9)])


def hanging_chain(name: str, n: int) -> Row:
    """It hangs straight down and stays so."""
    scene, q0, v0 = scenes.pendulum_chain(n)
    q0[0] = np.pi / 2
    run = simulate(scene, q0, v0, t_end=0.1, dt=1e-3)
    return judged(name, run, [_still(run)])


def long_chain(name: str, n: int) -> Row:
    """No damping, so the energy must stay."""
    run = simulate(*scenes.pendulum_chain(n), t_end=0.3, dt=1e-3, method=GeneralizedAlpha(rho_inf=1.0))
    total = run.energy.total
    off = float(np.abs(total - total[0]).max() / run.energy.kinetic.max())
    return judged(name, run, [Check("energy off by", off, 1e-3)])


def chain_on_ground(name: str, dt: float, rho_inf: float) -> Row:
    """Many contacts one after the other, of which most do not wait for the end of the step."""
    start, method = scenes.pendulum_chain(100, ground=0.5), GeneralizedAlpha(rho_inf=rho_inf)
    run = simulate(*start, t_end=0.6, dt=dt, method=method, on_failure="stop")
    return judged(name, run, [])


def massless_links(name: str) -> Row:
    """The energy stays, with an error that falls with dt^2."""
    off = []
    for dt in (1e-3, 5e-4):
        start = scenes.pendulum_chain(6, massless=(0, 2, 4))
        run = simulate(*start, t_end=0.3, dt=dt, method=GeneralizedAlpha(rho_inf=0.9))
        total = run.energy.total
        off.append(float(np.abs(total - total[0]).max() / run.energy.kinetic.max()))
    return judged(
        name, run, [Check("energy off by", off[1], 1e-3), Check("ratio when dt is halved", off[1] / off[0], 0.3)]
    )


def step_ball(name: str, dt: float) -> Row:
    """Against the exact motion: up to 1.5 s, or 4000 steps about the impact."""
    n = min(round(1.5 / dt), 4000)
    height = 1.0 if n * dt > 1.0 else 0.1 + GRAVITY / 2 * (0.3 * n * dt) ** 2
    run = simulate(*robots.load("rotating_ball", height=height), t_end=n * dt, dt=dt)
    q, _ = references.rotating_ball(run.t, height=height)
    # an impact is known to a step, and acts on what follows in proportion to its length squared
    limit = max(0.5 * dt**2, 1e-9)
    return judged(name, run, [Check("error of the position [m]", float(np.abs(run.q - q)[:, :2].max()), limit)])


def step_quadruped(name: str, dt: float) -> Row:
    """It must land and stand: its swing dies out by a factor of seven in a second, so it is looked at after four."""
    run = simulate(*robots.load("quadruped"), t_end=4.0, dt=dt, on_failure="stop")
    height = Check("height at the end off by [m]", run.q[-1, 2] - STANDS, 1e-3)
    return judged(name, run, [Check("speed at the end", float(np.abs(run.v[-1]).max()), 0.05), height])


def damping_top(name: str, rho_inf: float) -> Row:
    """Against the event-driven reference."""
    run = simulate(*robots.load("tippe_top"), t_end=0.2, dt=1e-3, method=GeneralizedAlpha(rho_inf=rho_inf))
    q, _ = references.tippe_top(run.t)
    return judged(
        name, run, [Check("error of theta [rad]", float(np.abs(inclination(run.q) - inclination(q)).max()), 5e-3)]
    )


def damping_quadruped(name: str, rho_inf: float) -> Row:
    """It must land and stand."""
    method = GeneralizedAlpha(rho_inf=rho_inf)
    run = simulate(*robots.load("quadruped"), t_end=1.0, dt=2e-3, method=method, on_failure="stop")
    return judged(name, run, [Check("speed at the end", float(np.abs(run.v[-1]).max()), 0.1)])
