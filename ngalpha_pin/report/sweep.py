"""Runs every line of a report at every dt, measures errors and times."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ngalpha_pin.errors import Interrupted, NgalphaError, SceneError
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.simulation.simulate import simulate

from .bounded import Deadline, Found, OutOfTime, within
from .cases import Case
from .lines import GIVEN_UP, Line, March, Start, bounded, own_line
from .orders import Estimate, Order, order, richardson
from .points import MaterialPoints, largest_distance

FOLD = 0.8  # a run with a smaller step that takes less than this part of the time of the larger one
AUDIT = 0.3  # part of the time for all runs that the run of the audit may take
REFERENCE = 0.4  # part of the time that is left that one of the three runs of a reference may take
NONE = "none"  # how the words on a reference begin that is not there
MOMENT = 0.05  # least time that a run gets [s]
LONGEST = 300  # letters of a reason
KINDS = ("between impacts", "across impacts")


@dataclass(frozen=True)
class Entry:
    """One line at one dt.

    Attributes:
        line: its label.
        dt: step [s].
        error: largest distance of a material point from where it should be [m]; NaN where the run failed.
        seconds: of the stepping loop, one per repeat [s].
        setup: before it [s].
        steps: that were made.
        n_iter: iterations per step.
        rungs: how many steps each rung of the solver ladder solved.
        message: why the run ended early, or "".
        energy: of the bodies at the end minus that of the reference [J]; NaN where it is not known.
    """

    line: str
    dt: float
    error: float
    seconds: tuple[float, ...]
    setup: float
    steps: int
    n_iter: float
    rungs: dict[str, int]
    message: str
    energy: float = np.nan

    @property
    def time(self) -> float:
        """Median of the repeats [s]."""
        return statistics.median(self.seconds) if self.seconds else np.nan

    @property
    def noise(self) -> float:
        """Largest minus smallest time, in parts of the median [-]."""
        return (max(self.seconds) - min(self.seconds)) / self.time if self.seconds else np.nan


@dataclass
class Window:
    """A stretch of the motion, with or without impacts in it.

    Attributes:
        kind: "between impacts" or "across impacts".
        t0: start of the stretch [s].
        t1: its end [s].
        reference: what errors are measured against, in words.
        uncertainty: of the reference [m].
        size: of the motion, the unit of rounding [m].
        entries: the runs so far.
    """

    kind: str
    t0: float
    t1: float
    reference: str
    uncertainty: float = 0.0
    size: float = 1.0
    entries: list[Entry] = field(default_factory=list)

    def of(self, line: str) -> list[Entry]:
        """The runs of a line, from coarse to fine."""
        return [entry for entry in self.entries if entry.line == line]

    def has_errors(self) -> bool:
        """Whether there is anything to draw."""
        return any(np.isfinite(entry.error) for entry in self.entries)

    def folds(self) -> list[str]:
        """Lines of which a smaller step took less time than a larger one, which tells that the machine was loaded."""
        found = []
        for line in dict.fromkeys(entry.line for entry in self.entries):
            times = [entry.time for entry in self.of(line) if not entry.message]
            if any(later < FOLD * earlier for earlier, later in pairwise(times)):
                found.append(line)
        return found

    def order(self, line: str) -> Order:
        """The order that the errors of a line show."""
        entries = self.of(line)
        if self.reference.startswith(NONE) and any(not entry.message for entry in entries):
            return Order(np.nan, "no reference")
        if entries and all(entry.message for entry in entries):
            return Order(np.nan, f"no run came to its end: {entries[-1].message}")
        sizes, errors = np.array([e.dt for e in entries]), np.array([e.error for e in entries])
        return order(sizes, errors, self.size, self.uncertainty)


@dataclass
class Result:
    """What is known of a case.

    Attributes:
        case: what was run.
        windows: the stretches.
        run: trajectory of the default method at the middle dt, for the audit; None before it is there.
        absent: lines that cannot run the scene, and why.
        cut: the time for all runs was over before the last one.
        wall, cpu: time that the runs took, and what this process got of it [s].
    """

    case: Case
    windows: list[Window] = field(default_factory=list)
    run: Trajectory | None = None
    absent: dict[str, str] = field(default_factory=dict)
    cut: bool = False
    wall: float = 0.0
    cpu: float = 0.0


def sweep(
    case: Case,
    lines: list[Line],
    repeat: int,
    enough: float,
    tell: Callable[[str], None],
    limit: float = np.inf,
    budget: float = np.inf,
) -> Iterator[Result]:
    """Run a case; what is there is handed out again after every run, so that an interrupt loses nothing.

    Args:
        case: what to run.
        lines: methods and simulators.
        repeat: how often a run is repeated for its time.
        enough: not any more once its repeats have taken so long [s].
        tell: called with what is done next.
        limit: a run that computes longer is given up [s].
        budget: no run begins after so many seconds of computing [s].
    """
    result, clock = Result(case), Clock(budget)
    scene, q0, v0 = case.start()
    points = MaterialPoints(scene)
    tell("audit")
    method = GeneralizedAlpha(rho_inf=case.rho_inf)
    middle = case.sizes[len(case.sizes) // 2]
    result.run = _audited(scene, q0, v0, case.t_end, middle, method, AUDIT * budget)
    yield result
    stretches = []
    for start, kind in zip(_starts(case, result.run, scene, q0, v0, limit), KINDS, strict=True):
        if start is not None:
            tell(f"reference {kind}")
            window, exact, known = _reference(case, points, start, kind, method, clock)
            result.windows.append(window)
            stretches.append((start[0], window, exact, known, set[str]()))
    for dt in case.sizes:
        for begin, window, exact, known, given_up in stretches:
            for line in lines:
                if line.label in result.absent or line.label in given_up:
                    continue
                if clock.left() <= 0.0:
                    result.cut = True
                    continue
                tell(f"{line.label}, {window.kind}, dt = {dt:g} s")
                begin = begin._replace(limit=min(limit, max(clock.left(), MOMENT)))
                done = known.get(dt) if line.note == repr(method) else None
                try:
                    entry = _entry(line, dt, begin, window.t1, points, exact, repeat, enough, done)
                except Exception as error:  # a simulator of others may fail in any way; the other lines go on
                    result.absent[line.label] = _why(error)
                else:
                    window.entries.append(entry)
                    if entry.message.startswith(GIVEN_UP):
                        given_up.add(line.label)  # smaller steps would take longer
                clock.tell(result)
                yield result
    yield result


def _audited(
    scene: Scene, q0: np.ndarray, v0: np.ndarray, t_end: float, dt: float, method: GeneralizedAlpha, limit: float
) -> Trajectory:
    """The run of the audit, or what there is of it at the limit [s]."""
    try:
        return within(limit, lambda: simulate(scene, q0, v0, t_end=t_end, dt=dt, method=method, on_failure="stop"))
    except OutOfTime as error:
        if not isinstance(error.__cause__, Interrupted):
            raise SceneError(f"the run does not begin within {limit:.0f} s") from error
        return error.__cause__.trajectory


class Clock:
    """Time since the beginning of a sweep, and what this process got of it.

    Args:
        budget: for all of it, in time of computing [s].
    """

    def __init__(self, budget: float):
        self._end, self._wall, self._cpu = Deadline(budget), time.perf_counter(), time.process_time()

    def left(self) -> float:
        """Of the budget [s]."""
        return self._end.left()

    def tell(self, result: Result) -> None:
        """Write the times into a result."""
        result.wall, result.cpu = time.perf_counter() - self._wall, time.process_time() - self._cpu


def _why(error: Exception) -> str:
    """One line on why a line cannot run."""
    text = " ".join(str(error).split())[:LONGEST]
    return text if isinstance(error, NgalphaError) else f"{type(error).__name__}: {text}"


def _starts(
    case: Case, run: Trajectory, scene: Scene, q0: np.ndarray, v0: np.ndarray, limit: float
) -> tuple[tuple[Start, float] | None, tuple[Start, float] | None]:
    """Where the stretches between and across impacts start, each with its end [s]; None where there is none."""
    known = case.reference is not None
    across = (Start(scene, q0, v0, 0.0, 0.0, 0, limit, anywhere=known), case.t_end)
    t0, t1 = case.smooth if case.smooth is not None else smooth_stretch(run)
    if not t1 > t0:
        return None, across
    if t0 == 0.0 and t1 > case.t_end * (1.0 - 1e-9):
        return across, None  # there is no impact to go across
    if case.reference is not None:
        q, v = (x[0] for x in case.reference(np.array([t0, t1])))
    else:
        i = int(np.searchsorted(run.t, t0 - 1e-12))
        t0, q, v = float(run.t[i]), run.q[i], run.v[i]
    return (Start(scene, q, v, t0, 0.0, 0, limit, anywhere=known), t1), across


def smooth_stretch(run: Trajectory) -> tuple[float, float]:
    """The stretch without events in which the accelerations change most: start and end [s], equal if there is none."""
    edges = np.unique([0.0, *(event.t for event in run.events), run.t[-1]])
    best, found = -1.0, (0.0, 0.0)
    for a, b in zip(edges[:-1], edges[1:], strict=True):
        # an event belongs to the step before its time, what follows it to the next one or two
        t0, t1 = (a + 3 * run.dt if a > 0 else 0.0), (b - 2 * run.dt if b < run.t[-1] else b)
        inside = (run.t >= t0 - 1e-12) & (run.t <= t1 + 1e-12)
        if t1 - t0 < 20 * run.dt or inside.sum() < 3:
            continue
        change = float(np.abs(np.diff(run.a[inside], axis=0)).sum())
        if change > best:
            best, found = change, (t0, t1)
    return found


class Exact(NamedTuple):
    """What errors are measured against.

    Attributes:
        positions: of the material points at the times t, shape (n, n_points, 3) [m], NaN where they are not known.
        energy: of the bodies at a time, NaN where it is not known [J].
    """

    positions: Callable[[np.ndarray], np.ndarray]
    energy: Callable[[float], float]


def _reference(
    case: Case, points: MaterialPoints, start: tuple[Start, float], kind: str, method: GeneralizedAlpha, clock: Clock
) -> tuple[Window, Exact, dict[float, March]]:
    """The window, what its errors are measured against, and the runs of the method that this took, by their dt."""
    begin, t1 = start
    if case.reference is not None:
        known = _once(case.reference)
        size = _size(points.positions(known(np.linspace(begin.t0, t1, 33))[0]))
        window = Window(kind, begin.t0, t1, case.kind, case.doubt, size)

        def energy(t: float) -> float:
            q, v = known(np.array([t]))
            return points.energy(q[0], v[0])

        return window, Exact(_once(lambda t: points.positions(known(t)[0])), energy), {}
    finest = min(case.sizes) / case.finer
    runs, energies = [], []
    marches: dict[float, March] = {}
    for dt in (4 * finest, 2 * finest, finest):
        limit = max(REFERENCE * clock.left(), MOMENT)
        done = bounded(own_line("reference", method), _with(begin, dt, t1)._replace(limit=limit))
        if done.message:
            words = f"{NONE}: the finest run ended early ({done.message})"
            nothing = Exact(lambda t: np.full((len(t), 1, 3), np.nan), lambda t: np.nan)
            return Window(kind, begin.t0, t1, words), nothing, marches
        marches[dt] = done
        runs.append(points.positions(done.q))
        energies.append(points.energy(done.q[-1], done.v))
    coarse, middle, fine = runs[0], runs[1][::2], runs[2]
    estimate = richardson(_distance(coarse, middle), _distance(middle, fine[::4]))
    doubt = case.doubt if kind == KINDS[1] else 0.0
    words = _in_words(finest, estimate) + (f", and by what it does not resolve, up to {doubt:.0e} m" if doubt else "")
    end = begin.t0 + finest * (len(fine) - 1)
    return (
        Window(kind, begin.t0, t1, words, estimate.uncertainty + doubt, _size(fine)),
        Exact(
            lambda t: fine[np.round((t - begin.t0) / finest).astype(int)],
            lambda t: energies[-1] if abs(t - end) < 0.5 * finest else np.nan,
        ),
        marches,
    )


def _once(exact: Callable[[np.ndarray], Found]) -> Callable[[np.ndarray], Found]:
    """The same for times that were asked for before: all lines with one dt share them."""
    found: dict[bytes, Found] = {}

    def known(t: np.ndarray) -> Found:
        if (key := t.tobytes()) not in found:
            found[key] = exact(t)
        return found[key]

    return known


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    n = min(len(a), len(b))
    return largest_distance(a[:n], b[:n])


def _in_words(dt: float, estimate: Estimate) -> str:
    doubt = "" if estimate.sound else "; the runs do not fall regularly, so this is a guess"
    return (
        f"finest run, dt = {dt:g} s, itself wrong by about {estimate.uncertainty:.1e} m "
        f"(Richardson, order {estimate.order:.2f}{doubt})"
    )


def _size(positions: np.ndarray) -> float:
    """Extent of the motion, at least that of the body [m]."""
    known = positions[np.isfinite(positions).all(axis=(1, 2))]
    return float(np.ptp(known, axis=(0, 1)).max()) if known.size else 1.0


def _with(start: Start, dt: float, t1: float) -> Start:
    """The same start with steps of dt that reach t1 as nearly as they can without passing it."""
    return start._replace(dt=dt, n=int((t1 - start.t0) / dt * (1 + 1e-12) + 1e-9))


def _entry(
    line: Line,
    dt: float,
    start: Start,
    t1: float,
    points: MaterialPoints,
    exact: Exact,
    repeat: int,
    enough: float,
    done: March | None = None,
) -> Entry:
    """Run a line once for its error, where that is not done already, and again for its time."""
    begin = _with(start, dt, t1)
    first = done or bounded(line, begin)
    seconds, setups = [first.seconds], [first.setup]
    while len(seconds) < repeat and sum(seconds) < enough and not first.message:
        again = bounded(line, begin._replace(for_time=True))
        if again.message:
            break
        seconds.append(again.seconds)
        setups.append(again.setup)
    steps = len(first.q) - 1 if first.t is None else round((float(first.t[-1]) - begin.t0) / dt)
    t = begin.t0 + dt * np.arange(steps + 1) if first.t is None else first.t
    error = energy = np.nan
    if not first.message:
        error = largest_distance(points.positions(first.q), exact.positions(t))
        energy = points.energy(first.q[-1], first.v) - exact.energy(float(t[-1]))
    return Entry(
        line.label, dt, error, tuple(seconds), statistics.median(setups), steps, first.n_iter, first.rungs,
        first.message, energy,
    )  # fmt: skip
