"""A figure of a run for a paper: gaps, percussions with their bounds, energy, coordinates."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy as np

from ngalpha_pin.errors import UnknownName
from ngalpha_pin.files import replacing
from ngalpha_pin.optional import require

from .curves import Panel, panels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ngalpha_pin import Trajectory

PLOT_COMMAND = 'pip install "ngalpha-pin[plot]"'
DEFAULT = ("gap", "percussion", "friction", "energy", "angle", "position")
COLORS = ("#1f6fb2", "#e0541b", "#1d9a5b", "#a3389c", "#c79a00", "#4b3fb0", "#00889b", "#b02a4c", "#6b7a2a", "#7a4d24")
WIDTH, ROW = 7.2, 2.1  # of the figure and of a row of panels [inch]
SYMBOLS = {
    "gap": "$g_N$",
    "force": r"$\lambda_N$",
    "percussion": "$P_N$",
    "friction": "$P_F$",
    "energy": "$E$",
    "angle": "$q$",
    "position": "$q$",
    "rate": "$v$",
    "speed": "$v$",
    "limit": "$g_N$",
    "limit force": r"$\lambda_N$",
    "constraint": r"$\lambda_g$",
    "axial": "$N$",
    "bending": "$M$",
    "joint friction": r"$\tau_F$",
    "iterations": "iterations",
}
MAX_LEGEND = 15
STYLE: Any = {
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e8ec",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "lines.linewidth": 1.0,
    "legend.fontsize": 6.5,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.75,
    "legend.borderpad": 0.2,
    "legend.columnspacing": 1.0,
    "legend.handlelength": 1.4,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "figure.dpi": 150,
    "savefig.dpi": 300,
}


def plot(
    trajectory: Trajectory,
    path: str | os.PathLike[str] | None = None,
    show: Sequence[str] = DEFAULT,
    joints: Sequence[str] | None = None,
    contact: str | None = None,
) -> Figure:
    """Draw a run over time.

    Args:
        trajectory: any run.
        path: file to write, its ending says the format (.pdf, .png, .svg); None leaves the figure to
            `matplotlib.pyplot.show()`.
        show: panels, out of gap [m], force [N], percussion [N s], friction [N s], energy [J], angle [rad],
            position [m], rate [rad/s], speed [m/s], limit [rad or m], limit force, constraint, joint friction (each
            [N m or N]), axial [N], bending [N m] (of beams), iterations; those with nothing to show are left out.
        joints: names of the joints whose coordinates and velocities are drawn; None is all of them.
        contact: name of the contact in the panel of friction; None is the one that carries most.

    Returns:
        The figure.

    Raises:
        UnknownName: a panel, joint or contact that does not exist. MissingPackageError: matplotlib is not installed.
    """
    style = paper_style()
    chosen = _chosen(trajectory, show, joints, contact)
    rows = max((len(chosen) + 1) // 2, 1)
    with style:
        figure = new_figure(path is None, (WIDTH, ROW * rows))
        axes = figure.subplots(rows, 2, squeeze=False, sharex=True).ravel()
        for ax, panel in zip(axes, chosen, strict=False):
            _draw(ax, np.asarray(trajectory.t), panel)
        for ax in axes[len(chosen) :]:
            ax.set_visible(False)
        for ax in axes[max(len(chosen) - 2, 0) : len(chosen)]:
            ax.set_xlabel("$t$ [s]")
            ax.tick_params(labelbottom=True)
        if path is not None:
            with replacing(path) as beside:
                figure.savefig(beside)
    return figure


def paper_style() -> AbstractContextManager[None]:
    """A context in which new axes look as those of `plot`.

    Raises:
        MissingPackageError: matplotlib is not installed.
    """
    return require("matplotlib", "plot", PLOT_COMMAND).rc_context(STYLE)


def new_figure(interactive: bool, size: tuple[float, float]) -> Figure:
    """A figure that pyplot knows only if somebody is going to look at it."""
    if interactive:
        from matplotlib import pyplot

        return pyplot.figure(figsize=size, layout="constrained")
    from matplotlib.figure import Figure

    return Figure(figsize=size, layout="constrained")


def _chosen(
    trajectory: Trajectory, show: Sequence[str], joints: Sequence[str] | None, contact: str | None
) -> list[Panel]:
    """The panels to draw, with the curves that were asked for."""
    for key in show:
        if key not in SYMBOLS:
            raise UnknownName("panel", key, SYMBOLS)
    names = list(trajectory.scene.model.names)[1:]
    for joint in joints or ():
        if joint not in names:
            raise UnknownName("joint", joint, names)
    if contact is not None and contact not in trajectory.contact_names:
        raise UnknownName("contact", contact, trajectory.contact_names)
    found = {panel.key: panel for panel in panels(trajectory)}
    chosen = []
    for panel in (found[key] for key in show if key in found):
        curves = panel.curves
        if panel.key in ("angle", "position", "rate", "speed") and joints is not None:
            curves = [c for c in curves if any(c.label == j or c.label.startswith(f"{j} ") for j in joints)]
        if curves and curves[0].group:
            groups = {c.group for c in curves}
            name = (contact or _busiest(trajectory, groups)) if panel.key == "friction" else min(groups)
            curves = [c for c in curves if c.group == name]
            panel = Panel(panel.key, f"{panel.title}: {name}", panel.unit, curves)
        if curves:
            chosen.append(Panel(panel.key, panel.title, panel.unit, curves))
    return chosen


def _busiest(trajectory: Trajectory, names: set[str]) -> str:
    load = dict(zip(trajectory.contact_names, np.sum(trajectory.P_N, axis=0), strict=True))
    return max(sorted(names), key=lambda name: load[name])


def _draw(ax: Axes, t: np.ndarray, panel: Panel) -> None:
    for n, curve in enumerate(panel.curves):
        color = COLORS[n % len(COLORS)]
        if curve.bound is not None:
            ax.fill_between(t, -curve.bound, curve.bound, color="#8796a5", alpha=0.25, linewidth=0.3)
        ax.plot(t, curve.y, color=color, label=_math(curve.label), **_style(n))
    ax.set_title(panel.title.replace("μ P_N", r"$\mu P_N$"), loc="left")
    ax.set_ylabel(SYMBOLS[panel.key] + (f" [{panel.unit}]" if panel.unit else ""))
    ax.margins(x=0)
    if len(panel.curves) > 1 or panel.key not in ("gap", "force", "percussion", "iterations"):
        shown = min(len(panel.curves), MAX_LEGEND)
        handles = ax.get_legend_handles_labels()
        ax.legend(handles[0][:shown], handles[1][:shown], ncols=1 + (shown > 3) + (shown > 8), loc="best")


def _style(n: int) -> dict[str, Any]:
    return {"linestyle": ("-", "--", "-.", ":")[n // len(COLORS) % 4]}


def _math(label: str) -> str:
    return {"P_F,1": "$P_{F,1}$", "P_F,2": "$P_{F,2}$"}.get(label, label)
