"""The end of a benchmark: its Markdown table printed, and written to a file where one is named."""

from __future__ import annotations

import argparse
from pathlib import Path


def add_table_option(parser: argparse.ArgumentParser) -> None:
    """Add --table PATH."""
    parser.add_argument("--table", type=Path, metavar="PATH", help="write the table there as well")


def publish(lines: list[str], path: Path | None) -> None:
    """Print the lines, and write them to a file if there is a path."""
    text = "\n".join(lines) + "\n"
    print(text, end="")
    if path is not None:
        path.write_text(text, encoding="utf-8")
