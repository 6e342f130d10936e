"""Head-on flights of all pairs of shapes, slow and fast, with dt and with rtol: is every impact found, at its time?

    python benchmarks/head_on.py --seeds 1 --table out_head_on.md

Every convex shape flies at every other one, at a plane and at a height field, turned and aside at random (the seed),
and spins. A ball in the middle of the one meets a ball in the middle of the other, so that they cannot miss. When they
meet is known from coal's distances along the free flight, followed by no more than shapes can move before they touch.

An impact is found where the run ends well, says one at that time, up to ten tolerances of the way or up to one step,
and where the shapes are not in each other at the end. A flight may take 20 s of processor time.
"""
# ruff: noqa: E402  (threads are limited before numpy is imported)

from __future__ import annotations

import argparse
import os
import signal
import sys
import warnings
from collections.abc import Iterator
from time import process_time
from typing import Any, NamedTuple

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when numpy is imported

import coal
import numpy as np
import pinocchio as pin
from tables import add_table_option, publish

import ngalpha_pin as nga

SPEEDS = (1.0, 30.0, 1000.0)  # of each body [m/s]
OPTIONS: tuple[dict[str, float], ...] = (
    {"rtol": 1e-3}, {"rtol": 1e-6}, {"rtol": 1e-9}, {"dt": 1e-4}, {"dt": 1e-3}, {"dt": 1e-2},
)  # fmt: skip
# a step resolves how bodies turn after an impact where the way in it is not longer than they are; elsewhere they do not
RESOLVED = 0.05
WIDE = (0.6, 0.6)  # extent of the height field [m]
SPIN = 10.0  # of each body about each axis, in the mean [rad/s]
ASIDE = 0.8  # of the sum of the radii of the balls in the middle, at most
FAR, STEPS = 0.9, 100.0  # way before the impact [m], and in steps, at most
ROOM = 0.08  # every convex shape is within this distance of its middle [m]
ALLOWED = 20.0  # processor time of a flight [s]
TOUCHING = 1e-9  # distance at which shapes touch [m]
ROUNDED = 2e-6  # what coal's distances of round shapes leave [m]
DEEP = 1e-4  # overlap at the end that is an impact that was missed [m]


def hull() -> coal.ConvexBase:
    """A hull of 14 points."""
    points = coal.StdVec_Vec3s()
    for p in np.random.default_rng(0).normal(size=(14, 3)):
        points.append(0.06 * p / np.linalg.norm(p))
    return coal.Convex.convexHull(points, True, "")


# each with the radius of a ball in its middle [m]
SHAPES = {
    "ball": (coal.Sphere(0.05), 0.05),
    "box": (coal.Box(0.1, 0.08, 0.06), 0.03),
    "capsule": (coal.Capsule(0.03, 0.08), 0.03),
    "cylinder": (coal.Cylinder(0.04, 0.1), 0.04),
    "cone": (coal.Cone(0.05, 0.1), 0.02),
    "ellipsoid": (coal.Ellipsoid(0.06, 0.04, 0.05), 0.04),
    "hull": (hull(), 0.02),
}
# the first two are well: the audit may say that the motion after the impact is not resolved by dt
VERDICTS = (
    "found", "unresolved", "captured", "missed", "late", "overlap", "accused", "error", "raw error", "unfinished",
)  # fmt: skip
WELL = VERDICTS[:2]
FIXED = ("plane", "height field")


class Flight(NamedTuple):
    """What flies at what, and how."""

    one: str
    other: str
    speed: float
    options: dict[str, float]
    seed: int


class Outcome(NamedTuple):
    """What became of a flight: a word, what was said, and its processor time [s]."""

    verdict: str
    said: str
    time: float


class Start(NamedTuple):
    """A scene with its start, and the sums of the speeds [m/s] and of the spins [rad/s] of its bodies."""

    scene: nga.Scene
    q: np.ndarray
    v: np.ndarray
    pace: float
    spin: float


def start(flight: Flight) -> Start:
    """The scene and the start of a flight."""
    fixed = flight.other in FIXED
    rng = np.random.default_rng([flight.seed, *(ord(c) for c in flight.one + flight.other), int(flight.speed)])
    turns = flight.speed * flight.options.get("dt", 0.0) <= RESOLVED
    turned = [pin.Quaternion(turn / np.linalg.norm(turn)) for turn in rng.normal(size=(1 if fixed else 2, 4))]
    scene = scene_of(flight, turned, turns, 0.04 * rng.random((9, 9)) if flight.other == FIXED[1] else None)
    towards = np.array([*(0.4 * rng.uniform(-1.0, 1.0, 2)), -1.0]) if fixed else rng.normal(size=3)
    towards /= np.linalg.norm(towards)
    aside = np.cross(towards, rng.normal(size=3))
    middles = sum(SHAPES[name][1] for name in (flight.one, flight.other) if name in SHAPES)
    aside *= rng.uniform(0.0, ASIDE) * middles / np.linalg.norm(aside)
    share = 1.0 if fixed else 0.5
    pace = flight.speed / share
    way = rng.uniform(0.5, 1.0) * min(FAR, STEPS * pace * flight.options.get("dt", np.inf))
    way += ROOM if flight.other == FIXED[0] else 2.0 * ROOM
    q, v = [], []
    for sign, turn in zip((1.0, -1.0), turned, strict=False):
        middle = np.zeros(3) if sign > 0 else aside
        q.append(np.r_[middle - sign * share * way * towards, turn.coeffs() if turns else ()])
        v.append(np.r_[sign * flight.speed * towards, SPIN * rng.normal(size=3) if turns else ()])
    return Start(scene, np.concatenate(q), np.concatenate(v), pace, sum(float(np.linalg.norm(x[3:])) for x in v))


def scene_of(flight: Flight, turned: list[pin.Quaternion], turns: bool, heights: np.ndarray | None) -> nga.Scene:
    """The bodies of a flight; those that do not turn have shapes that are turned."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    for name in "ab"[: len(turned)]:
        # velocities of a free flyer turn with it: of one that turns far in a step the flight would not be straight
        joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), f"{name} flies")
        if turns:
            joint = model.addJoint(joint, pin.JointModelSpherical(), pin.SE3.Identity(), f"{name} turns")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.05), pin.SE3.Identity())
        model.addFrame(pin.Frame(name, joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    scene = nga.Scene(model)
    for name, shape, turn in zip("ab", (flight.one, flight.other), turned, strict=False):
        place = pin.SE3.Identity() if turns else pin.SE3(turn.toRotationMatrix(), np.zeros(3))
        scene.add_geometry(f"of {name}", SHAPES[shape][0], name, place)
    if flight.other == FIXED[0]:
        scene.add_plane("of b")
    if heights is not None:
        scene.add_height_field("of b", heights, WIDE)
    scene.add_contact("of a", "of b" if heights is None else "of b*", e_N=1.0)
    return scene


def distance(begun: Start, q: np.ndarray) -> float:
    """Of both shapes at a configuration, negative where they overlap [m]."""
    model, least = begun.scene.model, np.inf
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    one = begun.scene.geometry("of a")
    for name in begun.scene.geometries("of b*"):
        shapes = (one, begun.scene.geometry(name))
        poses = [data.oMi[shape.parentJoint] * shape.placement for shape in shapes]
        at = [coal.Transform3s(pose.rotation, pose.translation) for pose in poses]
        found = coal.DistanceResult()
        least = min(
            least, coal.distance(shapes[0].geometry, at[0], shapes[1].geometry, at[1], coal.DistanceRequest(), found)
        )
    return float(least)


def flown(begun: Start, t: float) -> np.ndarray:
    """Where the bodies are in free flight: straight on, and turned about a fixed axis."""
    return np.asarray(pin.integrate(begun.scene.model, begun.q, t * begun.v))


def meeting(begun: Start) -> float:
    """When both shapes meet in free flight [s]."""
    t, fastest = 0.0, begun.pace + ROOM * begun.spin
    while (d := distance(begun, flown(begun, t))) > TOUCHING:
        t += d / fastest
    return t


def judged(flight: Flight) -> Outcome:
    """What becomes of a flight."""
    begun = start(flight)
    hit, dt = meeting(begun), flight.options.get("dt")
    t_end = 1.3 * hit if dt is None else dt * (np.ceil(hit / dt) + 2)
    before = process_time()
    try:
        run = bounded(begun, t_end, flight.options)
    except KeyboardInterrupt:
        return Outcome("unfinished", f"of {ALLOWED:g} s", process_time() - before)
    except nga.NgalphaError as error:
        return Outcome("error", f"{type(error).__name__}: {error}"[:160], process_time() - before)
    except Exception as error:  # what must not be
        return Outcome("raw error", repr(error)[:160], process_time() - before)
    took = process_time() - before
    late = dt if dt is not None else (10.0 * flight.options["rtol"] * FAR + ROUNDED) / begun.pace
    if not len(run.impacts.t):
        return Outcome("captured" if run.P_N.any() else "missed", "no impact at a time", took)
    if abs(first := run.impacts.t[0] - hit) > late:
        return Outcome("late", f"impact at {hit + first:.6g} instead of {hit:.6g} s", took)
    deep = distance(begun, run.q[-1])
    if deep < -DEEP:
        return Outcome("overlap", f"{-deep:.2g} m at the end", took)
    audit = run.audit()
    if audit.ok:
        return Outcome("found", "", took)
    rows = {row.name: row for row in audit.rows()}
    wrong = "; ".join(f"{name}: {row.value}" for name, row in rows.items() if row.ok is False)
    cause = str(rows["cause of the energy"].value) if "cause of the energy" in rows else ""
    # an impact of 1000 m/s leaves bodies that turn many times a step: what is said of them is right
    return Outcome("unresolved" if cause.startswith("motion") else "accused", f"{wrong}, {cause}"[:160], took)


def bounded(begun: Start, t_end: float, options: dict[str, Any]) -> nga.Trajectory:
    """The run, in the processor time that is allowed."""

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGVTALRM, stop)
    signal.setitimer(signal.ITIMER_VIRTUAL, ALLOWED)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return nga.simulate(begun.scene, begun.q, begun.v, t_end=t_end, **options)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)


def flights(seeds: range) -> Iterator[Flight]:
    """All of them, those of a seed together."""
    shapes = list(SHAPES)
    for seed in seeds:
        for i, one in enumerate(shapes):
            for other in [*shapes[i:], *FIXED]:
                for speed in SPEEDS:
                    for options in OPTIONS:
                        yield Flight(one, other, speed, options, seed)


def named(options: dict[str, float]) -> str:
    """A mode in words."""
    return ", ".join(f"{name} = {value:g}" for name, value in options.items())


def table(found: dict[tuple[float, str], list[Outcome]]) -> list[str]:
    """The lines of the table."""
    head = f"| speed | mode | flights | {' | '.join(VERDICTS)} | time, longest [s] |"
    lines = [head, "| --- " * (4 + len(VERDICTS)) + "|"]
    for (speed, mode), outcomes in found.items():
        counts = [sum(outcome.verdict == word for outcome in outcomes) for word in VERDICTS]
        longest = max(outcome.time for outcome in outcomes)
        lines.append(f"| {speed:g} m/s | {mode} | {len(outcomes)} | {' | '.join(map(str, counts))} | {longest:.1f} |")
    return lines


def main() -> int:
    """Command line; exit code 1 where an impact was not found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1, metavar="N")
    parser.add_argument("--first", type=int, default=0, metavar="SEED")
    parser.add_argument("--only", default="", metavar="WORDS", help="in the name of a flight, as cone,rtol = 0.001")
    add_table_option(parser)
    args = parser.parse_args()
    found: dict[tuple[float, str], list[Outcome]] = {}
    for flight in flights(range(args.first, args.first + args.seeds)):
        name = f"{flight.one} at {flight.other}, {flight.speed:g} m/s, {named(flight.options)}, seed {flight.seed}"
        if not all(word in name for word in args.only.split(",")):
            continue
        outcome = judged(flight)
        found.setdefault((flight.speed, named(flight.options)), []).append(outcome)
        if outcome.verdict not in WELL:
            print(f"{name}: {outcome.verdict} {outcome.said} ({outcome.time:.1f} s)", file=sys.stderr, flush=True)
    publish(table(found), args.table)
    return int(any(outcome.verdict not in WELL for outcomes in found.values() for outcome in outcomes))


if __name__ == "__main__":
    sys.exit(main())
