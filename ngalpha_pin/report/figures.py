"""Figures of a report: error against run time and against dt."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ngalpha_pin.common.optional import require
from ngalpha_pin.viz.figure import COLORS, PLOT_COMMAND, STYLE

from .sweep import Result, Window

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 7.6, 3.0  # of a row of two panels [inch]
BELOW, BETWEEN = 0.45, 0.7  # of labels below the panels and between them [inch]
OVERVIEW, LEGEND = 2.1, 0.95  # height of a row of the overview, and of the legend below it [inch]
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
    windows = [window for window in result.windows if window.has_errors()]
    figure, axes = new_figure(2, max(len(windows), 1))
    for column, window in enumerate(windows):
        top, bottom = axes[:, column]
        _draw_lines(window, labels, top, bottom)
        _finish(window, top, bottom)
    return figure


def draw_overview(results: Sequence[Result], labels: list[str]) -> Figure:
    """Error against run time of every system, across its impacts where there are any."""
    shown = [result for result in results if result.windows and result.windows[-1].has_errors()]
    columns = min(len(shown), 3)
    figure, axes = new_figure(-(-len(shown) // columns), columns, OVERVIEW, below=LEGEND)
    for ax in axes.flat[len(shown) :]:
        ax.remove()
    named: dict[str, Any] = {}
    for ax, result in zip(axes.flat, shown, strict=False):
        window = result.windows[-1]
        _draw_lines(window, labels, ax, named=False)
        ax.set_title(result.case.name, loc="left")
        _plain_labels(ax.xaxis)
        _plain_labels(ax.yaxis)
        named |= dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    for ax in axes[:, 0]:
        ax.set_ylabel("largest error [m]")
    title = "over the run time of the stepping loop [s]"
    figure.legend(named.values(), named.keys(), ncols=4, loc="lower center", title=title)
    return figure


def _draw_lines(window: Window, labels: list[str], top: Axes, bottom: Axes | None = None, named: bool = True) -> None:
    """The errors of a window over the run time and, on another axis, over dt; names with the order."""
    for n, label in enumerate(labels):
        entries = [entry for entry in window.of(label) if np.isfinite(entry.error)]
        if not entries:
            continue
        error = np.maximum([entry.error for entry in entries], FLOOR)
        slope = window.order(label).slope
        name = f"{label}: order {slope:.1f}" if named and not np.isnan(slope) else label
        style: Any = {"marker": MARKERS[n % len(MARKERS)], "color": COLORS[n % len(COLORS)], "markersize": 3.5}
        top.loglog([entry.time for entry in entries], error, label=name, **style)
        if bottom is not None:
            bottom.loglog([entry.dt for entry in entries], error, **style)


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
    """Of dt, the values themselves."""
    from matplotlib.ticker import NullFormatter, NullLocator

    for axis in (top.xaxis, top.yaxis, bottom.yaxis):
        _plain_labels(axis)
    sizes = sorted({entry.dt for entry in window.entries})
    bottom.set_xticks(sizes, [f"{dt:.3g}" for dt in sizes])
    bottom.xaxis.set_minor_locator(NullLocator())
    bottom.xaxis.set_minor_formatter(NullFormatter())


def _plain_labels(axis: Axis) -> None:
    """A few ticks with labels in plain text, which is drawn many times faster than powers."""
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    low, high = axis.get_view_interval()
    multiples = (1.0,) if high > 30 * low else (1.0, 3.0) if high > 4 * low else (1.0, 1.5, 2.0, 3.0, 5.0)
    axis.set_major_locator(LogLocator(subs=multiples, numticks=7))
    axis.set_major_formatter(StrMethodFormatter("{x:.2g}"))
    axis.set_minor_locator(NullLocator())


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
