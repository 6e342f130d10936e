"""A figure of a run for a paper: gaps, impulses with their bounds, energy, coordinates."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any

import numpy as np

from ngalpha_pin.common.files import replacing
from ngalpha_pin.common.optional import require
from ngalpha_pin.errors import UnknownName

from .curves import Panel, liveliest, panels
from .pairs import contact_pairs, pair_names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ngalpha_pin import Trajectory

PLOT_COMMAND = 'pip install "ngalpha-pin[plot]"'
DEFAULT = ("gap", "impulse", "friction", "energy", "angle", "position")
COLORS = ("#1f6fb2", "#e0541b", "#1d9a5b", "#a3389c", "#c79a00", "#4b3fb0", "#00889b", "#b02a4c", "#6b7a2a", "#7a4d24")
WIDTH, ROW, BELOW = 7.2, 1.45, 0.25  # of the figure, of a panel, of what is below the last one [inch]
SYMBOLS = {
    "gap": "$g_N$",
    "force": r"$\lambda_N$",
    "impulse": "$P_N$",
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
DASHES = ("-", "--", "-.", ":")  # curves on top of each other all show
BOUNDED = "Friction impulse in a step, within \N{PLUS-MINUS SIGN}\N{GREEK SMALL LETTER MU} times the normal one"
MAX_CURVES = 8  # in a panel; of more, those that vary most
MAX_NAME, MAX_TITLE = 30, 90  # letters of a name in a legend and of a title
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
        show: panels, out of gap [m], force [N], impulse [N s], friction [N s] (impulses in a step, along the axes of
            the world), energy [J], angle [rad], position [m], rate [rad/s], speed [m/s], limit [rad or m], limit force,
            constraint, joint friction (each [N m or N]), axial [N], bending [N m] (of beams), iterations; those with
            nothing to show are left out. Contacts are shown by pair of geometries: forces of their points summed, the
            smallest gap; of many pairs or coordinates those that carry or move most.
        joints: names of the joints whose coordinates and velocities are drawn; None is those that move most.
        contact: pair of geometries, "foot/ground", in the panel of friction; None is the one that carries most.

    Returns:
        The figure.

    Raises:
        UnknownName: a panel, joint or contact that does not exist. MissingPackageError: matplotlib is not installed.
    """
    style = paper_style()
    chosen = _chosen(trajectory, show, joints, contact)
    with style:
        figure = new_figure(path is None, (WIDTH, ROW * max(len(chosen), 1) + BELOW))
        axes = figure.subplots(max(len(chosen), 1), 1, squeeze=False, sharex=True).ravel()
        for ax, panel in zip(axes, chosen, strict=False):
            _draw(ax, np.asarray(trajectory.t), panel)
        axes[-1].set_xlabel("$t$ [s]")
        if not chosen:
            axes[0].text(0.5, 0.5, "nothing to show", transform=axes[0].transAxes, ha="center")
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
    from matplotlib.figure import Figure

    if not interactive:
        return Figure(figsize=size, layout="constrained")
    from matplotlib import pyplot

    class Shown(Figure):
        """A figure that a notebook shows once: as what a cell ends with, or else pyplot does at the end of the cell."""

        def _ipython_display_(self) -> None:
            if "inline" in pyplot.get_backend():
                pyplot.close(self)
            raise NotImplementedError  # it is shown as any other figure

    return pyplot.figure(figsize=size, layout="constrained", FigureClass=Shown)


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
    if contact is not None:
        known = dict(zip(trajectory.contact_names, pair_names(trajectory), strict=True))
        contact = known.get(contact, contact)
        if contact not in known.values():
            raise UnknownName("contact", contact, sorted({*known.values()}))
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
            title = panel.title if panel.key != "friction" else BOUNDED
            panel = Panel(panel.key, f"{title}: {name}", panel.unit, curves)
        kept = liveliest(curves, MAX_CURVES)
        title = panel.title + (f": the {len(kept)} of {len(curves)} that vary most" if len(kept) < len(curves) else "")
        if curves:
            chosen.append(Panel(panel.key, title, panel.unit, kept))
    return chosen


def _busiest(trajectory: Trajectory, names: set[str]) -> str:
    load = np.sum(trajectory.P_N, axis=0)
    pairs = contact_pairs(trajectory)
    return max(sorted(names), key=lambda name: float(load[pairs[name]].sum()))


def _draw(ax: Axes, t: np.ndarray, panel: Panel) -> None:
    for n, curve in enumerate(panel.curves):
        color = COLORS[n % len(COLORS)]
        if curve.bound is not None:
            ax.fill_between(t, -curve.bound, curve.bound, color="#8796a5", alpha=0.25, linewidth=0.3)
        ax.plot(t, curve.y, color=color, label=short(curve.label), linestyle=DASHES[n % len(DASHES)])
    ax.set_title(short(panel.title, MAX_TITLE), loc="left")
    ax.set_ylabel(SYMBOLS[panel.key] + (f" [{panel.unit}]" if panel.unit else ""))
    ax.margins(x=0)
    ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)  # beside the curves, not over them


def short(name: str, most: int = MAX_NAME) -> str:
    """A name with its middle left out where it is too long."""
    if len(name) <= most:
        return name
    half = (most - 1) // 2
    return f"{name[:half]}\N{HORIZONTAL ELLIPSIS}{name[len(name) - half :]}"
