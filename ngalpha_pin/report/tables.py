"""Tables of a report, as CSV files and as rows of text."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from ngalpha_pin.common.files import replacing

from .sweep import Result

RUNS = (
    "system", "stretch", "from [s]", "to [s]", "method", "dt [s]", "largest error [m]", "uncertainty of reference [m]",
    "median time [s]", "noise of time", "repeats", "set-up [s]", "steps", "time per step [us]", "iterations per step",
    "solved by", "ended early", "energy at the end minus that of the reference [J]",
)  # fmt: skip
ORDERS = ("system", "stretch", "method", "order", "in words", "reference")


def run_rows(result: Result) -> list[list[object]]:
    """One row for every run, in the columns `RUNS`."""
    rows: list[list[object]] = []
    for window in result.windows:
        for e in window.entries:
            per_step = 1e6 * e.time / max(e.steps, 1)
            solved = ", ".join(f"{name} {count}" for name, count in e.rungs.items())
            rows.append([
                result.case.name, window.kind, window.t0, window.t1, e.line, e.dt, e.error, window.uncertainty,
                e.time, e.noise, len(e.seconds), e.setup, e.steps, per_step, e.n_iter, solved, e.message,
                e.energy,
            ])  # fmt: skip
    return rows


def order_rows(result: Result, labels: list[str]) -> list[list[object]]:
    """One row for every line and stretch, in the columns `ORDERS`, and one for every line that cannot run the scene."""
    rows: list[list[object]] = []
    for window in result.windows:
        for label in labels:
            if window.of(label):
                found = window.order(label)
                row = [result.case.name, window.kind, label, found.slope, found.words, window.reference]
                rows.append([_plain(value) for value in row])
    rows += [[result.case.name, "", label, "", f"cannot run it: {why}", ""] for label, why in result.absent.items()]
    return rows


def _plain(value: object) -> object:
    if isinstance(value, float):
        return "" if np.isnan(value) else round(value, 3)
    return value


def write_csv(path: Path, header: tuple[str, ...], rows: list[list[object]]) -> None:
    """Write a table; numbers with all their digits."""
    with replacing(path) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(rows)
