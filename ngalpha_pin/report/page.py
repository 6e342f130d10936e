"""The page of a report: one HTML file with everything in it."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Sequence
from importlib.resources import files
from pathlib import Path
from string import Template

import numpy as np

from ngalpha_pin.common.files import write_text

from .lines import Line
from .sweep import KINDS, Entry, Result, Window

HOW = (
    "The error of a run is the largest distance, over the whole stretch, of a material point from where it should be: "
    "of every body its centre of mass and the ends of its radii of gyration. Time is that of the stepping loop alone, "
    "the median of the repeats on one thread; set-up (compiling the scene, consistent start) is beside it, and noise "
    "is the largest minus the smallest time over the median. The order is the slope of log error over log dt. "
    "The energy is that of the bodies at the end minus that of the reference there. "
    "'Between impacts' starts from the reference and ends before the next event; 'across impacts' is the whole run."
)

BETWEEN, ACROSS = KINDS
BUSY = 0.85  # part of a core below which a process that computes all the time has shared it


def write_page(path: Path, title: str, sections: Iterable[str]) -> None:
    """Write the page.

    Args:
        path: of the file.
        title: of the page.
        sections: HTML.
    """
    template = Template((files(__package__) / "page.html").read_text(encoding="utf-8"))
    write_text(path, template.substitute(title=html.escape(title), body="\n".join(sections)))


def paragraph(text: str, kind: str = "") -> str:
    """A paragraph of text."""
    return f'<p class="{kind}">{html.escape(text)}</p>'


def heading(text: str) -> str:
    """A heading."""
    return f"<h2>{html.escape(text)}</h2>"


def preformatted(text: str) -> str:
    """Text as it is."""
    return f"<pre>{html.escape(text)}</pre>"


def image(png: bytes, alt: str) -> str:
    """A picture, embedded."""
    return f'<p><img alt="{html.escape(alt)}" src="data:image/png;base64,{base64.b64encode(png).decode()}"></p>'


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table; numbers are written with three digits and stand at the right."""
    head = "".join(f"<th>{html.escape(name)}</th>" for name in header)
    lines = ["".join(_cell(value) for value in row) for row in rows]
    return f"<table><tr>{head}</tr>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def _cell(value: object) -> str:
    if isinstance(value, (int, float)):
        return f'<td class="number">{"" if np.isnan(value) else f"{value:.3g}"}</td>'
    return f"<td>{html.escape(str(value))}</td>"


def summary(results: Sequence[Result], lines: Sequence[Line]) -> str:
    """Orders of every system and line, between and across impacts."""
    rows = []
    for result in results:
        for line in lines:
            if line.label in result.absent:
                rows.append([result.case.name, line.label, f"cannot run it: {result.absent[line.label]}", ""])
                continue
            words = {window.kind: str(window.order(line.label)) for window in result.windows if window.of(line.label)}
            if words:
                across = words.get(ACROSS, "no impact")
                rows.append([result.case.name, line.label, words.get(BETWEEN, "-"), across])
    return table(("system", "line", "order between impacts", "order across impacts"), rows)


def in_words(results: Sequence[Result], lines: Sequence[Line]) -> str:
    """One sentence for every system and line of this package's method: its orders, and what is of first order."""
    items = []
    for result in results:
        for line in lines:
            words = [f"{w.kind} {w.order(line.label)}" for w in result.windows if w.of(line.label)]
            if not words:
                continue
            impacts = any(window.kind == ACROSS for window in result.windows)
            end = "" if impacts else "; no impact in this run"
            items.append(f"<li>{html.escape(f'{result.case.name}, {line.label}: ' + '; '.join(words) + end)}</li>")
    return f"<ul>{''.join(items)}</ul>"


def window_section(window: Window, lines: Sequence[Line]) -> str:
    """The runs of one stretch of the motion."""
    parts = [paragraph(f"{window.kind}, from {window.t0:g} to {window.t1:.4g} s; reference: {window.reference}")]
    rows = []
    for line in lines:
        entries = window.of(line.label)
        for entry in entries:
            first = [line.label, str(window.order(line.label))] if entry is entries[0] else ["", ""]
            rows.append([*first, *_numbers(entry)])
    header = (
        "line", "order", "dt [s]", "error [m]", "energy [J]", "time [s]", "noise", "runs", "set-up [s]", "µs per step",
        "iterations per step", "solved by",
    )  # fmt: skip
    folds = window.folds()
    if folds:
        words = "Times fold back: a smaller step took less time than a larger one, as on a machine that was loaded."
        said = paragraph(f"{words} Do not compare the times of {', '.join(folds)}.", "bad")
        return "\n".join([*parts, table(header, rows), said])
    return "\n".join([*parts, table(header, rows)])


def loaded(result: Result) -> list[str]:
    """What must be known of the times of a system: the machine was loaded, or the time was over."""
    said = []
    if result.wall > 1.0 and result.cpu < BUSY * result.wall:
        share = 100 * result.cpu / result.wall
        said.append(
            f"The machine was loaded: this process got {share:.0f} % of a core while it ran. Times are too long."
        )
    if result.cut:
        said.append("The time of a quick report was over before the last run: leave out --quick to see all of them.")
    return [paragraph(text, "bad") for text in said]


def _numbers(e: Entry) -> list[object]:
    solved = ", ".join(f"{name} {count}" for name, count in e.rungs.items())
    per_step = 1e6 * e.time / max(e.steps, 1)
    noise = f"{100 * e.noise:.0f} %" if len(e.seconds) > 1 else "one run"
    ended = f"ended early: {e.message}" if e.message else solved
    return [e.dt, e.error, e.energy, e.time, noise, len(e.seconds), e.setup, per_step, e.n_iter, ended]
