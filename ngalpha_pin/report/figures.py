"""Figures of a report: error against run time and against dt."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from ngalpha_pin.viz.figure import COLORS, PLOT_COMMAND, STYLE
from ngalpha_pin.viz.optional import require

from .sweep import Result, Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 7.6, 3.0  # of a row of two panels [inch]
BELOW, BETWEEN = 0.45, 0.7  # of labels below the panels and between them [inch]
MARKERS = "osD^vP*X"
FLOOR = 1e-17  # an error of zero is drawn here [m]


def new_figure(rows: int, columns: int, height: float = HEIGHT, below: float = BELOW) -> tuple[Figure, Any]:
    """An empty figure in the style of the package, and its axes as an array.

    Args:
        rows: of panels.
        columns: of panels.
        height: of a row with its labels [inch].
        below: what is left free below the panels [inch].

    Raises:
        MissingPackageError: matplotlib is not installed.
    """
    require("matplotlib", "report", PLOT_COMMAND)
    from matplotlib.figure import Figure

    full = height * rows + below - BELOW
    figure = Figure(figsize=(WIDTH, full))
    # margins by hand: a layout that is computed takes as long as the drawing
    figure.subplots_adjust(
        left=0.75 / WIDTH, right=1 - 0.12 / WIDTH, bottom=below / full, top=1 - 0.25 / full, wspace=0.24,
        hspace=BETWEEN / (height - BETWEEN),
    )  # fmt: skip
    return figure, figure.subplots(rows, columns, squeeze=False)


def png(draw: Any, *arguments: Any) -> bytes:
    """What a drawing function draws, as a PNG file."""
    matplotlib = require("matplotlib", "report", PLOT_COMMAND)
    with matplotlib.rc_context({**STYLE, "savefig.dpi": 130}):
        stream = io.BytesIO()
        draw(*arguments).savefig(stream, format="png")
    return stream.getvalue()


def draw_errors(result: Result, labels: list[str]) -> Figure:
    """Error against run time above, against dt below; one column per stretch of the motion."""
    figure, axes = new_figure(2, max(len(result.windows), 1))
    for column, window in enumerate(result.windows):
        top, bottom = axes[:, column]
        for n, label in enumerate(labels):
            entries = [entry for entry in window.of(label) if np.isfinite(entry.error)]
            if not entries:
                continue
            error = np.maximum([entry.error for entry in entries], FLOOR)
            slope = window.order(label).slope
            named = label if np.isnan(slope) else f"{label}: order {slope:.1f}"
            style: Any = {"marker": MARKERS[n % len(MARKERS)], "color": COLORS[n % len(COLORS)], "markersize": 3.5}
            top.loglog([entry.time for entry in entries], error, label=named, **style)
            bottom.loglog([entry.dt for entry in entries], error, **style)
        _finish(window, top, bottom)
    return figure


def _finish(window: Window, top: Axes, bottom: Axes) -> None:
    top.set_title(f"{window.kind}, {window.t0:g} to {window.t1:.4g} s", loc="left")
    top.set_xlabel("run time of the stepping loop [s]")
    bottom.set_xlabel("dt [s]")
    for ax in (top, bottom):
        ax.set_ylabel("largest error [m]")
        if window.uncertainty > 0:
            ax.axhspan(FLOOR, window.uncertainty, color="#8796a5", alpha=0.2, linewidth=0)
            ax.set_ylim(bottom=window.uncertainty / 10)
    if top.get_legend_handles_labels()[0]:
        top.legend()
    _guide(window, bottom)
    _ticks(window, top, bottom)


def _ticks(window: Window, top: Axes, bottom: Axes) -> None:
    """Labels in plain text, which is drawn many times faster than powers; of dt, the values themselves."""
    from matplotlib.ticker import LogLocator, NullFormatter, NullLocator, StrMethodFormatter

    plain = StrMethodFormatter("{x:.0e}")
    for axis, ticks in ((top.xaxis, (1.0, 2.0, 5.0)), (top.yaxis, (1.0,)), (bottom.yaxis, (1.0,))):
        axis.set_major_locator(LogLocator(subs=ticks, numticks=7))
        axis.set_major_formatter(plain)
        axis.set_minor_locator(NullLocator())
    sizes = sorted({entry.dt for entry in window.entries})
    bottom.set_xticks(sizes, [f"{dt:.3g}" for dt in sizes])
    bottom.xaxis.set_minor_locator(NullLocator())
    bottom.xaxis.set_minor_formatter(NullFormatter())


def _guide(window: Window, ax: Axes) -> None:
    """Lines of slope 1 and 2 below the largest error."""
    points = [(entry.dt, entry.error) for entry in window.entries if np.isfinite(entry.error) and entry.error > 0]
    if not points:
        return
    sizes = np.array(sorted({dt for dt, _ in points}))
    largest = max(error for _, error in points)
    for slope, name in ((1, "1"), (2, "2")):
        guide = 2 * largest * (sizes / sizes[-1]) ** slope
        ax.loglog(sizes, guide, color="#8796a5", linewidth=0.6, linestyle=":", zorder=0)
        ax.annotate(name, (sizes[0], guide[0]), fontsize=6, color="#8796a5", ha="right")
