"""The figures of the paper's section 10, redrawn: python paper_figures.py --out FOLDER

Steps and parameters are those of the paper's footnotes. A figure takes seconds, that of the tippe top minutes, because
its reference is Moreau's scheme with steps of 1e-4 s, as in the paper; --quick takes larger steps and shorter runs.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.robots.ball_in_cylinder import CENTRE
from ngalpha_pin.robots.painleve_rod import HALF_LENGTH
from ngalpha_pin.robots.rotating_ball import RADIUS
from ngalpha_pin.robots.tippe_top import inclination
from ngalpha_pin.viz.figure import WIDTH, paper_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLACK, GRAY = {"color": "black"}, {"color": "0.6"}


def main(argv: Sequence[str] | None = None) -> dict[int, Figure]:
    """Draw the figures, and write them where --out says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("paper_figures"), metavar="FOLDER", help="where to write them")
    parser.add_argument("--format", default="pdf", choices=("pdf", "png", "svg"))
    parser.add_argument("--quick", action="store_true", help="larger steps and shorter runs")
    parser.add_argument("--only", type=int, nargs="+", choices=FIGURES, default=list(FIGURES), metavar="NUMBER")
    args = parser.parse_args(argv)
    figures = {}
    with paper_style():
        args.out.mkdir(parents=True, exist_ok=True)
        for number in args.only:
            figures[number] = FIGURES[number](args.quick)
            path = args.out / f"figure_{number}.{args.format}"
            figures[number].savefig(path)
            print(f"wrote {path}")
    return figures


def rotating_ball_bounces(quick: bool) -> Figure:
    """Figure 1: without spin and with e_N = 0.5 the impacts accumulate."""
    run = simulate("rotating_ball", 2.0, 5e-3 if quick else 2e-3, omega=0.0, e_N=0.5)
    figure, (sketch, ax) = new_figure(sketch=True)
    draw_ground(sketch)
    draw_ball(sketch, 0.0, 1.0)
    ax.plot(run.t, run.q[:, 1], **BLACK)
    label(ax, "$t$ [s]", "$y$ [m]")
    return figure


def rotating_ball_friction(quick: bool) -> Figure:
    """Figure 2: slip, then rolling (left), and stick at the impact (right)."""
    figure, axes = new_figure(sharey=True)
    for ax, omega in zip(axes, (50.0, 10.0), strict=True):
        run = simulate("rotating_ball", 1.5, 5e-3 if quick else 2e-3, omega=omega, e_N=0.0)
        # the impulsive force is there for one step, between the zeros of its neighbours
        ax.plot(run.t, run.La_F[:, 0], label=r"$\Lambda_F$ [N s]", **BLACK)
        ax.plot(run.t, run.la_F[:, 0], "--", label=r"$\lambda_F$ [N]", **BLACK)
        ax.set_title(rf"$\omega = {omega:g}$ rad/s")
        label(ax, "$t$ [s]", "" if omega < 50 else "friction")
    axes[1].legend()
    return figure


def ball_in_corner(quick: bool) -> Figure:
    """Figure 3: the ball comes to rest with both contacts closed, at 1.36 s."""
    run = simulate("ball_in_corner", 2.0, 2e-3 if quick else 1e-4)
    figure, (sketch, ax) = new_figure(sketch=True)
    sketch.plot([-1, 0, 1], [1, 0, 1], **BLACK)
    draw_ball(sketch, *run.q[0, :2])
    draw_ball(sketch, *run.q[-1, :2], linestyle="--")
    for name, style in (("ball_0/right", "-"), ("ball_0/left", "--")):
        k = run.contact_names.index(name)
        ax.plot(run.t, run.g_N[:, k], style, label=f"$g_N$, {name.partition('/')[2]} plane", **BLACK)
    label(ax, "$t$ [s]", "$g_N$ [m]")
    ax.legend()
    return figure


def ball_in_cylinder(quick: bool) -> Figure:
    """Figure 4: the way of the centre; with Moreau's scheme the ball sinks into the wall."""
    t_end = 2.0 if quick else 10.0
    moreau = simulate("ball_in_cylinder", t_end, 1e-2, method=nga.MoreauJean(tol=1e-6))
    run = simulate("ball_in_cylinder", t_end, 1e-2)
    figure, (sketch, ax) = new_figure(sketch=True)
    draw_ball(sketch, *CENTRE[[0, 2]], radius=1.0)
    draw_ball(sketch, *run.q[0, :2])
    ax.plot(*moreau.q[:, :2].T, label="Moreau", **GRAY)
    ax.plot(*run.q[:, :2].T, label=r"generalized-$\alpha$", **BLACK)
    ax.set_aspect("equal", "datalim")
    label(ax, "$x$ [m]", "$y$ [m]")
    ax.legend()
    return figure


def painleve_rod(quick: bool) -> Figure:
    """Figure 5: the contact force blows up at 0.81 s and throws the rod off the ground.

    Longer steps may pass the singular time without its impulse: its solution is one of a family.
    """
    run = simulate("painleve_rod", 0.9 if quick else 1.5, 2e-4, rho_inf=0.9)
    figure, (sketch, ax) = new_figure(sketch=True)
    x, y, cos, sin = run.q[0]
    draw_ground(sketch)
    ends = np.array([[-1.0], [1.0]]) * HALF_LENGTH * np.array([cos, -sin])
    sketch.plot(*(ends + [x, y]).T, linewidth=2.5, solid_capstyle="round", **BLACK)
    ax.plot(run.t, run.v[:, 2], **BLACK)
    label(ax, "$t$ [s]", r"$u_\varphi$ [rad/s]")
    return figure


def hopper(quick: bool) -> Figure:
    """Figure 6: the percussions of the foot; friction stays within its cone."""
    run = simulate("hopper", 0.15 if quick else 1.0, 2e-4 if quick else 5e-5, rho_inf=0.0)
    mu = float(run.system.contacts.mu[0])
    figure, (sketch, ax) = new_figure(sketch=True)
    draw_ground(sketch, 0.15)
    height, shin = run.q[0, 0], run.tubes[0][1][0]
    sketch.plot([0.0, shin[0, 0]], [height, shin[0, 2]], linewidth=2.5, **BLACK)
    sketch.plot(shin[:, 0], shin[:, 2], **BLACK)
    sketch.plot([-0.06, 0.06, 0.06, -0.06, -0.06], height + 0.04 * np.array([-1, -1, 1, 1, -1]), **BLACK)
    for sign in (1, -1):
        ax.plot(run.t, sign * mu * run.P_N[:, 0], **GRAY, label=r"$\pm \mu P_N$" if sign > 0 else None)
    ax.plot(run.t, run.P_F[:, 0], label="$P_F$", **BLACK)
    label(ax, "$t$ [s]", "percussion [N s]")
    ax.legend()
    return figure


def tippe_top(quick: bool) -> Figure:
    """Figure 7: the top turns over, stands on its stick, and falls back."""
    t_end = 0.5 if quick else 8.0
    moreau = simulate("tippe_top", t_end, 1e-3 if quick else 1e-4, method=nga.MoreauJean(tol=1e-6))
    run = simulate("tippe_top", t_end, 2e-3 if quick else 1e-3)
    figure, (sketch, ax) = new_figure(sketch=True)
    draw_ground(sketch, 0.03)
    axis = np.array([np.sin(0.1), np.cos(0.1)])
    for offset, radius in ((3e-3, 15e-3), (16e-3, 5e-3)):
        draw_ball(sketch, *(np.array([0.0, 1.2015e-2]) + offset * axis), radius=radius)
    ax.plot(moreau.t, inclination(moreau.q), label=rf"Moreau, $\Delta t = {moreau.dt:g}$ s", **GRAY)
    ax.plot(run.t, inclination(run.q), label=rf"generalized-$\alpha$, $\Delta t = {run.dt:g}$ s", **BLACK)
    label(ax, "$t$ [s]", r"$\theta$ [rad]")
    ax.legend()
    return figure


FIGURES: dict[int, Callable[[bool], Figure]] = {
    1: rotating_ball_bounces,
    2: rotating_ball_friction,
    3: ball_in_corner,
    4: ball_in_cylinder,
    5: painleve_rod,
    6: hopper,
    7: tippe_top,
}


def simulate(
    name: str, t_end: float, dt: float, rho_inf: float = 0.5, method: Any = None, **parameters: float
) -> nga.Trajectory:
    """Run a system of the paper with its parameters [s, s, -]."""
    method = nga.GeneralizedAlpha(rho_inf=rho_inf) if method is None else method
    return nga.simulate(*robots.load(name, **parameters), t_end=t_end, dt=dt, method=method, progress=True)


def new_figure(sketch: bool = False, **options: Any) -> tuple[Figure, np.ndarray]:
    """A figure with two axes; the left one is empty where it is for a sketch."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 0.36 * WIDTH), layout="constrained")
    axes = figure.subplots(1, 2, width_ratios=(1, 1.6) if sketch else (1, 1), **options)
    if sketch:
        axes[0].set_aspect("equal", "datalim")
        axes[0].set_axis_off()
    return figure, axes


def label(ax: Axes, x: str, y: str) -> None:
    """Name the axes."""
    ax.set_xlabel(x)
    ax.set_ylabel(y)


def draw_ground(ax: Axes, half: float = 1.0) -> None:
    """A horizontal line with hatching below it, from -half to half [m]."""
    ax.plot([-half, half], [0, 0], **BLACK)
    ax.fill_between([-half, half], -0.06 * half, 0, facecolor="none", edgecolor="0.6", hatch="////", linewidth=0)


def draw_ball(ax: Axes, x: float, y: float, radius: float = RADIUS, linestyle: str = "-") -> None:
    """A circle with its centre, on axes without ticks [m]."""
    angle = np.linspace(0, 2 * np.pi, 200)
    ax.plot(x + radius * np.cos(angle), y + radius * np.sin(angle), linestyle, **BLACK)
    ax.plot(x, y, "k.", markersize=2)


if __name__ == "__main__":
    main()
