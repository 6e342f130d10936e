"""The audit of a run as a figure: energy and where it went, gaps, cones, iterations and rungs, events."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.results.energy_balance import LEFT_OVER, Balance
from ngalpha_pin.viz.figure import COLORS

from .figures import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ngalpha_pin import Trajectory

EVENT_COLORS = {"impact": "#b02a4c", "closed": "#1d9a5b", "lift-off": "#1f6fb2", "slip": "#c79a00", "stick": "#4b3fb0"}
MAX_EVENTS = 200  # marks of one kind on the axis
ROW, LEGEND = 1.7, 0.95  # height of a panel, and of the axis and the legend below [inch]


def draw_audit(run: Trajectory, account: Balance) -> Figure:
    """Energy, its balance, worst gap, percussions in their cones, iterations and rungs; events on each axis."""
    contact = bool(run.contact_names)
    panels: list[Callable[[Axes, Trajectory], None]] = [_energy, partial(_work, account=account)]
    panels += [_gap, _cone, _iterations] if contact else [_iterations]
    figure, axes = new_figure(len(panels), 1, ROW, below=LEGEND)
    for ax, draw in zip(axes[:, 0], panels, strict=True):
        draw(ax, run)
        ax.margins(x=0)
        if ax.get_legend_handles_labels()[0]:
            ax.legend(ncols=3, loc="best")
    for ax in axes[:, 0]:
        _events(ax, run)
        ax.sharex(axes[-1, 0])
    axes[-1, 0].set_xlabel("$t$ [s]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    marks = {label: handle for handle, label in zip(handles, labels, strict=True) if label in EVENT_COLORS}
    if marks:
        figure.legend(marks.values(), marks.keys(), ncols=len(marks), loc="lower center", title="events")
    return figure


def _energy(ax: Axes, run: Trajectory) -> None:
    energy = run.energy
    rows = {"kinetic": energy.kinetic, "potential": energy.potential, "elastic": energy.elastic, "total": energy.total}
    for n, (name, y) in enumerate(rows.items()):
        if np.any(y):
            ax.plot(run.t, y, color=COLORS[n], label=name)
    ax.set_title("Energy", loc="left")
    ax.set_ylabel("$E$ [J]")


def _work(ax: Axes, run: Trajectory, account: Balance) -> None:
    for n, (name, y) in enumerate(account.shares().items()):
        if np.any(y) or name == LEFT_OVER:
            ax.plot(run.t, y, color=COLORS[n], label=name, linestyle="--" if name == LEFT_OVER else "-")
    ax.set_title(f"Work since the start; the account is left with {account.error:.1e} of the energy", loc="left")
    ax.set_ylabel("$W$ [J]")


def _gap(ax: Axes, run: Trajectory) -> None:
    gap = run.contact_motion.smallest_gap
    ax.plot(run.t, gap, color=COLORS[0])
    deepest = max(0.0, -float(gap.min()))
    ax.set_title(f"Smallest gap of all contacts; deepest penetration {deepest:.1e} m", loc="left")
    ax.set_ylabel("$g_N$ [m]")


def _cone(ax: Axes, run: Trajectory) -> None:
    mu = run.system.contacts.mu[run.contact_columns]
    largest = max(float(run.P_N.max(initial=0.0)), TINY)
    for k, rows in enumerate(run.friction_rows):
        carries = run.P_N[:, k] > 1e-9 * largest
        if rows.stop > rows.start and carries.any():
            size = np.linalg.norm(run.P_F[carries][:, rows], axis=1) / (mu[k] * run.P_N[carries, k])
            label = run.contact_names[k] if len(run.friction_rows) <= 6 else None
            ax.plot(run.t[carries], size, ".", markersize=2, color=COLORS[k % len(COLORS)], label=label)
    ax.axhline(1.0, color="#8796a5", linewidth=0.7)
    ax.set_ylim(-0.05, 1.15)
    ax.set_title(r"Friction percussions in their cones: $|P_F| / (\mu P_N)$", loc="left")
    ax.set_ylabel("[-]")


def _iterations(ax: Axes, run: Trajectory) -> None:
    for n, rung in enumerate(dict.fromkeys(run.solver_path[1:])):
        solved = run.solver_path == rung
        ax.plot(run.t[solved], run.n_iter[solved], ".", markersize=2.5, color=COLORS[n % len(COLORS)], label=str(rung))
    ax.set_ylim(bottom=-0.5, top=max(float(run.n_iter.max()), 1.0) + 0.5)
    ax.set_title("Iterations of each step, by the rung of the ladder that solved it", loc="left")
    ax.set_ylabel("iterations")


def _events(ax: Axes, run: Trajectory) -> None:
    """Marks on the time axis."""
    for kind, color in EVENT_COLORS.items():
        times = [event.t for event in run.events if event.kind == kind][:MAX_EVENTS]
        if times:
            where = ax.get_xaxis_transform()
            ax.plot(
                times, [0.0] * len(times), "|", color=color, markersize=7, transform=where, clip_on=False, label=kind
            )
