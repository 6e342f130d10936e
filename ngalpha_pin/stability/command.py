"""What `ngalpha-pin stability` does: runs the cases, prints the table, writes it as Markdown."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tqdm import tqdm

import ngalpha_pin
from ngalpha_pin.errors import SceneError

from . import cases, made
from .row import Row

HEADER = (
    "case",
    "result",
    "rise of energy",
    "drift",
    "penetration [m]",
    "outside cone",
    "iterations",
    "solved by",
    "found",
)
ABOUT = (
    "Every row is a run, judged by the audit and by what is known of the motion. The rise of the energy and friction "
    "outside its cone are relative, iterations are mean / worst per step. A row that fails says why; none is left out. "
    "Made by `ngalpha-pin stability{quick} --out docs/stability.md`"
)


def run(args: argparse.Namespace) -> int:
    """Run the cases; exit code 0 all passed, 1 a row failed, 130 interrupted (with the rows so far)."""
    chosen = list(cases(args.quick, args.only))
    if not chosen:
        raise SceneError(f"no case has {args.only!r} in its name")
    rows: list[Row] = []
    interrupted = False
    try:
        for case in tqdm(chosen, unit="case", leave=False):
            rows.append(made(case))
            _print(rows[-1])
    except KeyboardInterrupt:
        interrupted = True
    failed = sum(not row.passed for row in rows)
    print(f"{len(rows)} cases, {failed} failed")
    if args.out is not None:
        write(args.out, rows, args.quick)
        print(f"wrote {args.out}")
    if interrupted:
        print("ngalpha-pin: interrupted", file=sys.stderr)
        return 130
    return int(failed > 0)


def _print(row: Row) -> None:
    tqdm.write(f"{'ok    ' if row.passed else 'FAILED'}  {row.case}: {row.reason}")


def write(path: Path, rows: list[Row], quick: bool) -> None:
    """Write the table as Markdown.

    Args:
        path: of the file.
        rows: of the table.
        quick: the cases that take long are left out.
    """
    about = ABOUT.format(quick=" --quick" if quick else "")
    lines = ["# Stiff and extreme cases", "", f"{about} (version {ngalpha_pin.__version__}).", ""]
    lines += [_line(HEADER), _line(["---"] * len(HEADER))]
    for row in rows:
        case, *numbers, passed, reason = row
        lines.append(_line([case, "pass" if passed else "**fail**", *map(str, numbers), reason]))
    failed = sum(not row.passed for row in rows)
    lines += ["", f"{len(rows)} cases, {len(rows) - failed} pass, {failed} fail.", ""]
    path.write_text("\n".join(lines), encoding="utf-8")


def _line(cells: tuple[str, ...] | list[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
