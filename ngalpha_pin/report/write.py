"""Makes a report: runs the cases and writes the folder, also where it is interrupted."""

from __future__ import annotations

import re
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from ngalpha_pin.common.files import write_bytes
from ngalpha_pin.errors import NgalphaError
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.results.energy_balance import balance
from ngalpha_pin.results.trajectory import Trajectory

from . import page
from .audit_figure import draw_audit
from .bounded import OutOfTime, within
from .cases import Case
from .figures import draw_errors, draw_overview, png
from .lines import OWN, Line, Start, installed_simulators, march, own_lines
from .machine import machine, solve_time
from .parts import shares
from .sweep import Result, sweep
from .tables import ORDERS, RUNS, order_rows, run_rows, write_csv

QUICK_SIZES = 3  # of each case, the coarsest ones
SECONDS, QUICK_SECONDS = 0.3, 0.004  # a run is not repeated any more once its repeats have taken so long
LIMIT, QUICK_LIMIT = 30.0, 3.0  # a run is given up after so many seconds
QUICK_BUDGET = 45.0  # seconds for loading and running the only system of a quick report
LEAST = 10.0  # of them, for running it
UNFINISHED = "Not finished: this is what there is."
OFTEN = 2.0  # the page is written again after so many seconds, and after every system
WATCHED, QUICK_WATCHED = 300, 60  # most steps in which the time of the parts is taken


def report(
    cases: Sequence[Case],
    folder: Path,
    rho_inf: Sequence[float] = (),
    repeat: int = 5,
    quick: bool = False,
    simulators: bool = True,
    progress: bool = True,
    loading: float = 0.0,
) -> bool:
    """Run the cases and write report.html, runs.csv, orders.csv and the figures, of several one of all of them.

    Args:
        cases: what to run.
        folder: where to write; it is made.
        rho_inf: parameters of generalized-alpha, one line each; none takes that of each case.
        repeat: runs of which the median time is taken.
        quick: the three coarsest steps of each case, the beginning of the longer runs, fewer repeats, audits in
            numbers alone and one figure for all systems.
        simulators: other simulators that are installed are further lines.
        progress: show a progress bar.
        loading: what it took to load the cases, which comes off the time of a quick report [s].

    Returns:
        True, or False where it was interrupted: then what there is has been written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    others, missing = installed_simulators() if simulators else ([], {})
    pages = Pages(folder, {**machine(), "unit": _unit()}, missing, Figures(not quick or len(cases) == 1, not quick))
    enough, limit = (QUICK_SECONDS, QUICK_LIMIT) if quick else (SECONDS, LIMIT)
    budget = max(QUICK_BUDGET - loading, LEAST) if quick and len(cases) == 1 else np.inf
    try:
        for case in tqdm(cases, disable=not progress, unit="system", position=0):
            case = case.quick(QUICK_SIZES) if quick else case
            lines, result = [*own_lines(rho_inf or (case.rho_inf,)), *others], Result(case)
            total = 3 + 2 * len(lines) * len(case.sizes)
            with tqdm(total=total, disable=not progress, leave=False, position=1, unit="run") as bar:
                bar.set_description_str(case.name)
                try:
                    for so_far in sweep(case, lines, repeat, enough, bar.set_postfix_str, limit, budget):
                        result = so_far
                        bar.update()
                        pages.progress(result, lines)
                except KeyboardInterrupt:
                    pages.add(result, lines, {})
                    raise
            pages.add(result, lines, _parts(case, QUICK_WATCHED if quick else WATCHED, limit))
    except KeyboardInterrupt:
        pages.write("Interrupted: this is what there was.")
        return False
    pages.finish()
    return True


def time_of_parts(case: Case, most: int = WATCHED) -> dict[str, float]:
    """Parts of the time of a run with at most so many steps that Pinocchio, contact, solving and the rest take [-]."""
    scene, q0, v0 = case.start()
    n = min(int(case.t_end / case.sizes[-1]), most)
    start = Start(scene, q0, v0, 0.0, case.t_end / n, n)
    return shares(partial(march, start, GeneralizedAlpha(rho_inf=case.rho_inf)))


def _parts(case: Case, most: int, limit: float) -> dict[str, float]:
    """The same, or nothing where it takes too long or the run fails."""
    try:
        return within(limit, lambda: time_of_parts(case, most))
    except (OutOfTime, NgalphaError):
        return {}


def _unit() -> str:
    seconds, spread = solve_time()
    return f"one LAPACK solve of size 20 takes {1e6 * seconds:.2f} µs, with a noise of {100 * spread:.0f} %"


class Figures(NamedTuple):
    """What is drawn for each system: errors against run time, and the audit."""

    errors: bool
    audit: bool


class Pages:
    """What is written: it grows by one system after the other, and is there after each of them.

    Args:
        folder: where to write.
        about: the machine.
        missing: simulators that are not installed, and what to do.
        figures: which ones are drawn for each system.
    """

    def __init__(self, folder: Path, about: dict[str, str], missing: dict[str, str], figures: Figures):
        self.folder, self.about, self.missing, self.figures = folder, about, missing, figures
        self.results: list[Result] = []
        self.lines: dict[str, Line] = {}
        self.bodies: list[str] = []
        self.runs: list[list[object]] = []
        self.orders: list[list[object]] = []
        self._written = -np.inf

    def progress(self, result: Result, lines: Sequence[Line]) -> None:
        """Write what is known of a system that is still running, without its figures: a kill loses none of it."""
        if time.perf_counter() - self._written < OFTEN:
            return
        labels = [line.label for line in lines]
        sections = [page.heading(result.case.name), *(page.window_section(w, lines) for w in result.windows)]
        self._write(UNFINISHED, run_rows(result), order_rows(result, labels), sections)
        self._written = time.perf_counter()

    def add(self, result: Result, lines: Sequence[Line], parts: dict[str, float]) -> None:
        """Draw what is known of a system, and write it."""
        self.results.append(result)
        self.lines.update({line.label: line for line in lines})
        self.runs += run_rows(result)
        self.orders += order_rows(result, [line.label for line in lines])
        self.bodies += _system(self.folder, result, lines, parts, self.figures)
        self.write(UNFINISHED)

    def finish(self) -> None:
        """Draw all systems together, and write the page for the last time."""
        if len(self.results) > 1 and any(r.windows and r.windows[-1].has_errors() for r in self.results):
            picture = png(draw_overview, self.results, list(self.lines))
            write_bytes(self.folder / "overview.png", picture)
            self.bodies.insert(0, page.image(picture, "error against run time of all systems"))
        self.write()

    def write(self, ended: str = "") -> None:
        """Write the tables and the page, with a sentence on why they are not complete."""
        self.about["unit at the end"] = _unit()
        self._write(ended, [], [], [])

    def _write(self, ended: str, runs: list[list[object]], orders: list[list[object]], last: list[str]) -> None:
        """The same with what is known of a system that is not finished."""
        sections = [page.paragraph(page.HOW), page.table(("machine", ""), self.about.items())]
        if ended:
            sections.insert(0, page.paragraph(ended, "bad"))
        lines = list(self.lines.values())
        own = [line for line in lines if line.label.startswith(OWN)]
        sections += [page.heading("Orders"), page.in_words(self.results, own), page.summary(self.results, lines)]
        notes = [(line.label, line.note) for line in lines]
        notes += [(name, f"not run: {why}") for name, why in self.missing.items()]
        sections.append(page.table(("line", "what it is"), notes))
        write_csv(self.folder / "runs.csv", RUNS, self.runs + runs)
        write_csv(self.folder / "orders.csv", ORDERS, self.orders + orders)
        page.write_page(self.folder / "report.html", "Error against run time", [*sections, *self.bodies, *last])


def _system(
    folder: Path, result: Result, lines: Sequence[Line], parts: dict[str, float], figures: Figures
) -> list[str]:
    """The section of one system; its figures are written beside the page."""
    name = result.case.name
    sections = [page.heading(name), *page.loaded(result)]
    stem = re.sub(r"[^A-Za-z0-9.]+", "_", name).strip("_")
    if figures.errors and any(window.has_errors() for window in result.windows):
        picture = png(draw_errors, result, [line.label for line in lines])
        write_bytes(folder / f"{stem}.png", picture)
        sections.append(page.image(picture, f"{name}: error against run time"))
    sections += [page.window_section(window, lines) for window in result.windows]
    if result.case.note:
        sections.append(page.paragraph(result.case.note, "note"))
    if parts:
        text = ", ".join(f"{group} {100 * share:.0f} %" for group, share in parts.items() if share >= 0.005)
        sections.append(page.paragraph(f"Where the time of a step goes (generalized-alpha, watched): {text}."))
    if result.run is not None:
        sections += audit_sections(result.run, folder / f"{stem}_audit.png" if figures.audit else None)
    return sections


def audit_sections(run: Trajectory, picture: Path | None) -> list[str]:
    """The audit of a run: its table, and its figure, which is written as well, or with None left out."""
    account = balance(run)
    note = f"Audit of {run.method} at dt = {run.dt:g} s:"
    work = [(name, float(y[-1]), float(np.abs(y).max())) for name, y in account.shares().items() if y.any()]
    sections = [
        page.paragraph(note),
        page.preformatted(str(run.audit())),
        page.table(("work since the start", "at the end [J]", "largest [J]"), work),
    ]
    if picture is not None:
        drawn = png(draw_audit, run, account)
        write_bytes(picture, drawn)
        sections.append(page.image(drawn, "audit of the run over time"))
    return sections


def audit_page(run: Trajectory, folder: Path) -> Path:
    """Write the audit of one trajectory as a page and a figure.

    Args:
        run: whoever computed it.
        folder: where to write; it is made.

    Returns:
        The path of the page.
    """
    folder.mkdir(parents=True, exist_ok=True)
    name = run.scene.model.name or "run"
    sections = [page.paragraph(f"{len(run.t) - 1} steps to t = {run.t[-1]:g} s; {run.message}")]
    if not run.scene.forces:
        note = "The scene has no forces here (files do not hold them): what they did is in what is left over."
        sections.append(page.paragraph(note, "note"))
    sections += audit_sections(run, folder / "audit.png")
    events = [(event.t, event.kind, event.contact) for event in run.events[:500]]
    sections += [page.heading("Events"), page.table(("t [s]", "event", "contact"), events)]
    page.write_page(folder / "audit.html", f"Audit of {name}", sections)
    return folder / "audit.html"
