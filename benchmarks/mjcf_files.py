"""MJCF files as scenes and as MuJoCo has them: energies, mass matrix, forces, pairs at random states, a row per file.

Run with `python benchmarks/mjcf_files.py FOLDER...`, of packages that are installed or unpacked somewhere; without one,
the files of the tests and of gymnasium. The comparison is that of `tests/scene/mjcf/test_against_mujoco.py`, in parts
of the larger of one and the largest entry; what is left out of a file is in the last column, and may be what its row
differs by.
"""

from __future__ import annotations

import argparse
import re
import sys
import warnings
from pathlib import Path

import numpy as np
from tables import add_table_option

import ngalpha_pin as nga

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from mujoco_reference import GYMNASIUM, OWN, Reference, quantities, random_state

sys.path.pop(0)
STATES = 20
SAME = 1e-12
PIECE = re.compile(r"_\d+_\d+(_[ab])?$")  # what stands behind the name of a height field in those of its pieces
QUANTITIES = ("T", "U", "M", "forces")
COLUMNS = "| file | nv | T | U | M | forces | pairs | not taken as declared |", "|" + " --- |" * 8


def differences(path: Path, scene: nga.Scene) -> list[float]:
    """The largest of each quantity over random states and controls."""
    rng, found = np.random.default_rng(0), np.zeros(len(QUANTITIES))
    reference = Reference(path, scene.model)
    controls = {name: rng.normal() for name in reference.names.actuators}
    reference.d.ctrl[:] = list(controls.values())
    for name, actuator in scene.actuators.items():
        actuator.ctrl = controls[name]
    for declared in (scene.contacts, scene.constraints, scene.unilaterals):  # no part of these forces
        declared.clear()
    for _ in range(STATES):
        q, v = random_state(scene.model, rng)
        reference.place(q, v)
        for i, (a, b) in enumerate(zip(quantities(scene, q, v), reference.quantities(), strict=True)):
            found[i] = max(found[i], float(np.abs(a - b).max(initial=0.0) / max(1.0, np.abs(b).max(initial=0.0))))
    return found.tolist()


def row(path: Path) -> tuple[str, bool]:
    """The line of a file, and whether it agrees or is refused in words."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            scene = nga.Scene.from_mjcf(path)
            reference = Reference(path, scene.model)
            limits = {f"{name}_end" for name in reference.names.tendons}
            geoms = set(reference.names.geoms)
            own = {
                frozenset(name if name in geoms else PIECE.sub("", name) for name in pair.key): pair.law.mu
                for pair in scene.contacts
                if not pair.key & limits
            }
            off = differences(path, scene)
    except nga.NgalphaError as error:
        return f"| {path.stem} |  |  |  |  |  |  | refused: {' '.join(str(error).split())[:200]} |", True
    theirs = reference.pairs(path)
    pairs = f"{len(own)}" if own == theirs else f"{len(own)}, MuJoCo {len(theirs)}"
    left = [f"{e.what}: {e.number}" for e in scene.contents if e.fate in ("left out", "approximated")]
    numbers = " | ".join(f"{x:.0e}" if x else "0" for x in off)
    line = f"| {path.stem} | {scene.model.nv} | {numbers} | {pairs} | {', '.join(left)} |"
    return line, own == theirs and (max(off) <= SAME or bool(left))


def is_model(path: Path) -> bool:
    """Whether a file is a whole MJCF model with a body, not a part that others include."""
    text = path.read_text(encoding="utf-8", errors="replace")
    return "<mujoco" in text and ("<body" in text or "<include" in text)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="*", type=Path, help="folders or files")
    add_table_option(parser)
    arguments = parser.parse_args()
    paths = [p for f in arguments.folders for p in ([f] if f.is_file() else sorted(f.rglob("*.xml")))]
    paths = [p for p in paths if is_model(p)] if arguments.folders else [*OWN, *GYMNASIUM]
    lines, good = list(COLUMNS), 0
    print("\n".join(lines), flush=True)
    for path in paths:
        line, fine = row(path)
        good += fine
        lines.append(line)
        print(line, flush=True)
    print(f"\n{good} of {len(paths)} files agree to {SAME:g}, or say what they leave out or why they are refused.")
    if arguments.table is not None:
        arguments.table.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
