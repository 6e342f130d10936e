"""A box dropped on its face, an edge and a corner, from many starts: docs/boxes.md.

    python benchmarks/boxes.py [--rows PATH] [--processes N]

Every line of the table is the worst of 20 runs, each with a turn and a throw of its own. Finished runs are kept in the
file of rows, so that the command can be taken up again.
"""
# ruff: noqa: E402  (threads are limited before numpy is imported)

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import product
from pathlib import Path
from typing import Any

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"  # read when numpy is imported

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga

SIZE = np.array([0.3, 0.4, 0.5])
GRAVITY, MU = 9.81, 0.5
T_END, PIECE, RESTS = 3.0, 0.25, 0.1  # longest run, its pieces, and how long a box must be at rest [s]
SIDES, GROUNDS, RESTITUTIONS, STEPS, SEEDS = ("flat", "edge", "corner"), ("plane", "slab"), (0.0, 0.5), (1e-2, 1e-3), 20
AT_REST, PENETRATION = 1e-9, 1e-9  # speed [m/s, rad/s] and depth [m] that are none
ROUNDING = 1e-12  # energy that is none [J]
TABLE = Path(__file__).parents[1] / "docs" / "boxes.md"

NAMES = ("ground", "side", "e_N", "dt", "seed")
WORST = ("moves until", "speed", "rise", "gain", "above", "penetration")
COLUMNS = (
    "ground", "falls on its", "e_N", "dt [s]", "as it should be", "moves until [s]", "speed at the end [m/s, rad/s]",
    "rise of energy / bound", "change at an impact [J]", "above its bound [J]", "penetration [m]", "steps by rung",
)  # fmt: skip
TEXT = """# A box that is dropped

A box of 0.3 x 0.4 x 0.5 m and 1 kg falls 0.1 m on its face, an edge or a corner, turned and thrown at random, with
mu = {mu}, from 20 seeds. The ground is a half-space ("plane"), which the corners of the box touch, or a wide box
("slab"), which is touched by whatever feature comes near. `python benchmarks/boxes.py` writes this page.

{summary}

{table}

Each line is the worst of its runs. A run ends when the box has been at rest for {rests} s: slower than
1e-9 m/s and rad/s in all coordinates. It fails if that is not so within {t_end} s. "As it should be" says that it is at
rest, that every step converged and the audit finds nothing, that penetration stays below 1e-9 m, and that energy keeps
its bounds:

* **In a step** energy may rise by the error of the method, dt^3 times the rate of the acceleration that a body which
  turns sees in its own frame, and by the work of friction in a step in which slip ends. `rise_of_energy` derives the
  bound; the column is the largest rise in any step in parts of it.
* **At an impact** that is located within its step nothing depends on dt. With c = (1 - e_N) / (1 + e_N), e_F = 0, the
  slip gamma_F- before the impact and the matrix G of its contacts,

      T+ - T- <= e_N / (1 + e_N) P_F . gamma_F- - c / 2 P . G P

  follows from (43), (47) and (78), see `gain_of_impacts`. So no impact adds energy if e_N = 0, or if e_F = e_N,
  whatever the friction and however many contacts take part. If e_N > 0 = e_F one may, where friction drives on a slip
  that was there before, as Newton's law of impact is known to allow: a rod that lands on its end and is about to slip
  back gains a tenth of its energy at e_N = 0.95 (`pytest tests/contact/test_boxes.py -k coulomb`). No box here does.
  The columns are the largest change of energy at any impact, negative where all of them lose some, and the largest
  distance above the bound, which is rounding.
"""

Case = tuple[str, str, float, float, int]


def boxes(sizes: list[np.ndarray], ground: str, tilt: float = 0.0, **law: float) -> nga.Scene:
    """Free boxes "box_0", ... of 1 kg above a ground that falls towards +x.

    Args:
        sizes: edges of the boxes [m].
        ground: "plane", a half-space with the corners of the boxes as contact points, or "slab", a wide box, whose
            face touches whatever corner, edge or face comes near.
        tilt: angle of the ground [rad].
        law: mu and e_N of all contacts with the ground.
    """
    model = pin.Model()
    for i, size in enumerate(sizes):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"box_{i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromBox(1.0, *size), pin.SE3.Identity())
        model.addJointFrame(joint)
    scene = nga.Scene(model)
    R = pin.exp3(np.array([0.0, tilt, 0.0]))
    if ground == "plane":
        scene.add_plane("ground", normal=R[:, 2])
    else:
        scene.add_geometry("ground", coal.Box(6.0, 6.0, 0.4), placement=pin.SE3(R, -0.2 * R[:, 2]))
    for i, size in enumerate(sizes):
        scene.add_geometry(f"shape_{i}", coal.Box(*size), parent=f"box_{i}")
    scene.add_contact("shape_*", "ground", **law)
    return scene


def dropped(side: str, seed: int, height: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """A box that comes down on its face, an edge or a corner, turned and thrown at random: q0 and v0."""
    rng, half = np.random.default_rng(seed), SIZE / 2
    turned = pin.exp3(np.array([0.0, 0.0, rng.uniform(-3.0, 3.0)]))
    if side == "edge":
        turned = turned @ pin.exp3(np.array([0.0, np.arctan2(half[0], half[2]), 0.0]))
    if side == "corner":
        down = np.array([0.0, 0.0, -1.0])
        turned = turned @ pin.Quaternion.FromTwoVectors(-half, down).toRotationMatrix()
    v0 = np.concatenate((0.3 * rng.normal(size=2), [0.0], 0.5 * rng.normal(size=3)))
    if side == "flat":
        v0[3:5] = 0.0
    q0 = np.concatenate(([0.0, 0.0, height + np.abs(turned[2]) @ half], pin.Quaternion(turned).coeffs()))
    return q0, v0


def rise_of_energy(run: nga.Trajectory) -> float:
    """Largest rise of the energy in a step, in parts of what the error of the method can be there.

    The velocities are those of a frame that turns with the body, in which a free flight has the rate of acceleration
    |da/dt| <= |omega| (2 g + |omega| |v|) of the centre and |omega|^3 of the rotation. Each smooth part of a step
    starts with a_bar = a, which should be a at (alpha_m - alpha_f) dt = -dt / 3 from there; with 1 - gamma = 1/6 that
    is an error of dt^2 / 18 |da/dt| of the velocity. What a step without a start leaves is smaller by |omega| dt.
    Positions are off by ((alpha_m - alpha_f) / 2 + beta - 1/6) dt^3 |da/dt| = dt^3 / 9 |da/dt|, which gravity turns
    into energy.
    Where slip ends within a step, the percussion of the whole step, most of which comes when nothing slips any more,
    does the work P_F . gamma_F / 2 on the slip at its start, which may be positive.
    """
    dt, inertia = np.diff(run.t), 0.5 * run.scene.model.inertias[1].inertia.trace()
    v, omega = (np.linalg.norm(run.v[:, part], axis=1) for part in (slice(0, 3), slice(3, 6)))
    v, omega = (np.maximum(x[1:], x[:-1]) for x in (v, omega))
    parts = 1 + np.bincount(np.searchsorted(run.t, run.impacts.t), minlength=len(run.t))[1:]
    rate = omega * (2 * GRAVITY + omega * v)
    error = dt**2 * ((v * rate + inertia * omega**4) * (parts / 18 + omega * dt) + GRAVITY * dt / 9 * rate)
    work = (run.P_F[1:] * run.gamma_F[:-1]).reshape(len(dt), -1, 2).sum(axis=2) / 2
    error += np.maximum(work, 0.0).sum(axis=1)
    return float((np.diff(run.energy.total) / (error + ROUNDING)).max())


def gain_of_impacts(run: nga.Trajectory) -> tuple[float, float]:
    """Largest change of the kinetic energy at a located impact, and how far one is above its bound at most [J].

    With c = (1 - e) / (1 + e) of every row, xi = gamma+ + e gamma- (44), (48) and gamma+ - gamma- = G P (78),

        T+ - T- = P . (gamma+ + gamma-) / 2 = sum of P xi / (1 + e) - sum of c P (G P) / 2.

    The laws make P_N xi_N = 0 and P_F . xi_F <= 0 (43), (47). Were all coefficients equal, c P . G P / 2 would be what
    is lost at least. Here that of friction is zero: with the c of e_N for all rows, and G P = xi_F - gamma_F- in those
    of friction, there remain (1 + c) / 2 P_F . xi_F <= 0 and

        T+ - T- <= (1 - c) / 2 P_F . gamma_F- - c / 2 P . G P,       (1 - c) / 2 = e_N / (1 + e_N).

    So no impact with e_N = 0 adds energy, and one with e_N > 0 only where friction drives on a slip that was there.
    """
    gain, above = -np.inf, -np.inf
    e_N, columns = run.scene.contacts[0].law.e_N, run.contact_columns
    sub, c = run.system.contacts.subset(columns), (1.0 - e_N) / (1.0 + e_N)
    for j in range(len(run.impacts.t)):
        q, before, after = run.impacts.q[j], run.impacts.v_before[j], run.impacts.v_after[j]
        M, jump = run.system.mass_matrix(q), after - before
        if not jump.any():
            continue  # the halves of a step meet without an impact
        run.system.slots.restore_one(run.impacts.slots, run.impacts.slot_ends, j)
        slip = run.system.contact_rates(sub, q, before)[sub.k :]
        bound = (1.0 - c) / 2 * float(run.impacts.P_F[j] @ slip) - c / 2 * float(jump @ M @ jump)
        change = 0.5 * float(after @ M @ after - before @ M @ before)
        gain, above = max(gain, change), max(above, change - bound)
    return gain, above


def fall(ground: str, side: str, e_N: float, dt: float, seed: int, t_end: float = T_END) -> dict[str, Any]:
    """Drop one box until it has been at rest for a while: what the table says of it.

    The run is judged in pieces, each of which goes on from the state at the end of the one before.
    """
    scene, (q, v), start = boxes([SIZE], ground, mu=MU, e_N=e_N), dropped(side, seed), time.process_time()
    pieces: list[dict[str, float]] = []
    rungs: Counter[str] = Counter()
    run, ok, rests = nga.simulate(scene, q, v, t_end=PIECE, dt=dt), True, False
    while True:
        audit, speed = run.audit(), np.abs(run.v).max(axis=1)
        moves = np.flatnonzero(speed >= AT_REST)
        gain, above = gain_of_impacts(run)
        pieces.append(
            {
                "speed": float(speed[-1]),
                "moves until": float(run.t[moves[-1]]) if len(moves) else 0.0,
                "rise": rise_of_energy(run),
                "gain": gain,
                "above": above,
                "penetration": audit.penetration,
            }
        )
        rungs.update(audit.rungs)
        ok = ok and audit.ok and audit.success
        rests = not (speed[run.t >= run.t[-1] - RESTS] >= AT_REST).any()
        if rests or run.t[-1] >= t_end - 0.5 * dt:
            break
        run = nga.simulate(scene, state=run.final_state, t_end=run.t[-1] + PIECE, dt=dt)
    worst = {name: max(piece[name] for piece in pieces) for name in pieces[0]} | {"speed": pieces[-1]["speed"]}
    case = dict(zip(NAMES, (ground, side, e_N, dt, seed), strict=True))
    seconds = time.process_time() - start
    return case | worst | {"rungs": dict(rungs), "ok": ok, "rests": rests, "seconds": seconds}


def good(row: dict[str, Any]) -> bool:
    """Everything of a run is as it should be."""
    kept = row["rise"] <= 1.0 and row["above"] <= ROUNDING and (row["e_N"] > 0.0 or row["gain"] <= ROUNDING)
    return bool(row["ok"] and row["rests"] and kept and row["penetration"] <= PENETRATION)


def cases() -> list[Case]:
    """All runs, quick ones first."""
    found = product(GROUNDS, SIDES, RESTITUTIONS, STEPS, range(SEEDS))
    return sorted(found, key=lambda case: (-case[3], GROUNDS.index(case[0]), case[4]))


def _run(case: Case) -> dict[str, Any]:
    try:
        return fall(*case)
    except nga.NgalphaError as error:
        return dict(zip(NAMES, case, strict=True)) | {"stopped": str(error)}


def finished(path: Path) -> dict[Case, dict[str, Any]]:
    """The rows of a file by their cases."""
    rows = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()] if path.exists() else []
    return {tuple(row[name] for name in NAMES): row for row in rows}


def run_all(todo: list[Case], path: Path, processes: int) -> Iterator[dict[str, Any]]:
    """Run what a file of rows does not have yet, and add it there."""
    with ProcessPoolExecutor(processes) as pool, path.open("a", encoding="utf-8") as file:
        for done in as_completed([pool.submit(_run, case) for case in todo]):
            row = done.result()
            file.write(json.dumps(row) + "\n")
            file.flush()
            yield row


def lines_of(rows: dict[Case, dict[str, Any]]) -> list[str]:
    """The table, a line for every 20 runs."""
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + " --- |" * len(COLUMNS)]
    for ground, side, e_N, dt in product(GROUNDS, SIDES, RESTITUTIONS, STEPS):
        every = [row for case, row in rows.items() if case[:4] == (ground, side, e_N, dt)]
        ended = [row for row in every if "stopped" not in row]
        if not ended:
            continue
        worst = {name: max(row[name] for row in ended) for name in WORST}
        rungs = sum((Counter(row["rungs"]) for row in ended), Counter[str]())
        cells = [ground, side, f"{e_N:g}", f"{dt:g}", f"{sum(good(row) for row in ended)} of {len(every)}"]
        cells += [f"{worst[name]:.2g}" for name in WORST]
        cells.append(", ".join(f"{name} {count}" for name, count in rungs.most_common()))
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def summary(rows: dict[Case, dict[str, Any]]) -> str:
    """What the table says in a sentence or two."""
    ended = [row for row in rows.values() if "stopped" not in row]
    gains = [max(row["gain"] for row in ended if row["e_N"] == e_N) for e_N in RESTITUTIONS]
    missing = len(cases()) - len(rows)
    return (
        f"Of {len(rows)} runs {len(ended)} converged in every step, and in {sum(map(good, ended))} everything is as it "
        f"should be. Penetrations are at most {max(row['penetration'] for row in ended):.1g} m. Of the impacts that "
        f"are located within their steps the one that loses least changes the energy by {gains[0]:.1g} J where "
        f"e_N = 0 and by {gains[1]:.1g} J where e_N = 0.5." + (f" {missing} runs are missing." if missing else "")
    )


def main(argv: list[str] | None = None) -> int:
    """Run what is missing and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rows", type=Path, default=Path("out_boxes.jsonl"), help="file of finished runs")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="runs at a time (2)")
    args = parser.parse_args(argv)
    known = finished(args.rows)
    for row in run_all([case for case in cases() if case not in known], args.rows, args.processes):
        print(" ".join(str(row[name]) for name in NAMES), row.get("stopped") or ("" if good(row) else row), flush=True)
    rows = finished(args.rows)
    text = TEXT.format(summary=summary(rows), table="\n".join(lines_of(rows)), t_end=T_END, rests=RESTS, mu=MU)
    TABLE.write_text(text, encoding="utf-8")
    return 0 if all("stopped" not in row and good(row) for row in rows.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
