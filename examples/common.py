"""What the examples share: their options, and what they show."""

from __future__ import annotations

import argparse

import numpy as np

import ngalpha_pin as nga


def options(description: str | None, t_end: float, dt: float, argv: list[str] | None) -> argparse.Namespace:
    """The options of every example, with its own defaults for the length of the run and of a step [s]."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--t-end", type=float, default=t_end, metavar="S", help=f"length of the run ({t_end} s)")
    parser.add_argument("--dt", type=float, default=dt, metavar="S", help=f"length of a step ({dt} s)")
    parser.add_argument("--html", metavar="PATH", help="write a replay that any browser opens")
    parser.add_argument("--plot", metavar="PATH", help="write plots (needs matplotlib)")
    parser.add_argument("--display", action="store_true", help="show the motion in meshcat")
    return parser.parse_args(argv)


def show(trajectory: nga.Trajectory, args: argparse.Namespace) -> nga.Trajectory:
    """Print the audit; write and show what the options ask for, and give the run back."""
    print(trajectory.audit())
    if not (args.html or args.plot or args.display):
        return trajectory
    from ngalpha_pin import viz

    if args.html:
        viz.save_html(trajectory, args.html)
    if args.plot:
        viz.plot(trajectory, args.plot)
    if args.display:
        viz.play(trajectory)
    return trajectory


def compare(quantity: str, computed: float, expected: float, unit: str) -> None:
    """Print a computed number beside the expected one."""
    print(f"{quantity}: {computed:.7g} {unit}, expected {expected:.7g} {unit}, difference {computed - expected:.1e}")


def compare_weight(trajectory: nga.Trajectory) -> None:
    """Compare the sum of the normal forces at the end with the weight of the robot."""
    weight = 9.81 * sum(inertia.mass for inertia in trajectory.scene.model.inertias)
    compare("force on the ground at the end", float(np.sum(trajectory.la_N[-1])), weight, "N")


def compare_energy(trajectory: nga.Trajectory) -> None:
    """Compare the energy at the end with that of the start, where nothing takes or gives any."""
    energy = trajectory.energy.total
    compare("energy at the end", energy[-1], energy[0], "J")
