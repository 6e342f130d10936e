"""Accuracy and speed in one table: largest error across impacts of both sets of laws and of Moreau's scheme.

    python benchmarks/accuracy.py --table accuracy.md

Errors are those of `ngalpha-pin report`: largest displacement of a material point against the closed form or an
event-driven reference. Times are medians of the stepping loop, in units of Moreau's scheme at the same dt.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

from tables import add_table_option, publish
from tqdm import tqdm

from ngalpha_pin.report.cases import Case, known_cases
from ngalpha_pin.report.lines import OWN, own_lines
from ngalpha_pin.report.sweep import Entry, sweep

OURS, PAPER, MOREAU = (*OWN, "Moreau")
REPEATS, ENOUGH = 5, 0.3  # of a run, fewer once they have taken so long [s]
SYSTEMS = {
    "rotating_ball, omega = 50": ("ball with spin, omega = 50: falls, slips, rolls", (1e-2, 1e-3)),
    "rotating_ball, omega = 10": ("ball with spin, omega = 10", (1e-2, 1e-3)),
    "rotating_ball, e_N = 0.5": ("ball, e_N = 0.5, bounces to rest", (1e-2, 1e-3)),
    "ball_in_cylinder": ("ball in cylinder, to 2 s", (1e-2, 1e-3)),
    "tippe_top": ("tippe top, to 1.3 s", (2e-3, 1e-3, 5e-4)),
}


def main() -> None:
    """Run all systems and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_table_option(parser)
    table = parser.parse_args().table
    lines = ["| system | dt [s] | this method | laws of the paper | Moreau | time / Moreau |", "| --- " * 6 + "|"]
    cases = known_cases()
    for name, (title, sizes) in tqdm(SYSTEMS.items(), unit="system"):
        lines += rows(replace(cases[name], sizes=sizes, smooth=(0.0, 0.0)), title)
    publish(lines, table)


def rows(case: Case, title: str) -> list[str]:
    """One row of the table for every dt.

    Args:
        case: with the steps of the table.
        title: of its first row.
    """
    methods = [line for line in own_lines((case.rho_inf,)) if line.label in (OURS, PAPER, MOREAU)]
    *_, result = sweep(case, methods, REPEATS, ENOUGH, lambda what: None)
    across = result.windows[-1]
    made: list[str] = []
    for at in zip(*(across.of(label) for label in (OURS, PAPER, MOREAU)), strict=True):
        errors = " | ".join(f"{shown(entry)}" for entry in at)
        made.append(f"| {'' if made else title} | {at[0].dt:g} | {errors} | {at[0].time / at[2].time:.1f} |")
    return made


def shown(entry: Entry) -> str:
    """Its error, or why there is none."""
    return entry.message or f"{entry.error:.1e} m"


if __name__ == "__main__":
    main()
