"""Blocks of Python in a page: found, and run one after the other in one namespace.

The site shows what they print and draw, the tests run the same blocks by the same function.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

# a fence, or a comment that neither the site nor GitHub shows; what a comment prints is shown
BLOCK = re.compile(r"^```python\n(?P<shown>.*?)^```$|^<!-- python\n(?P<hidden>.*?)^-->$", re.DOTALL | re.MULTILINE)


class Block(NamedTuple):
    """Code, and where it stands in the text: the line of its first line, and the index behind its end."""

    code: str
    line: int
    end: int


class Output(NamedTuple):
    """What a block printed, and the files that it wrote."""

    text: str
    files: tuple[Path, ...]


def blocks(text: str) -> list[Block]:
    """The blocks of a page in their order."""
    found = []
    for match in BLOCK.finditer(text):
        group = "shown" if match["shown"] is not None else "hidden"
        found.append(Block(match[group], text.count("\n", 0, match.start(group)) + 1, match.end()))
    return found


def run(page: Path, folder: Path, replace: Callable[[str], str] = str) -> Iterator[tuple[Block, Output]]:
    """Run the blocks of a page in a folder; a warning is an error.

    Args:
        page: the file.
        folder: where the blocks run and write, e.g. an empty one.
        replace: changes the code before it runs, e.g. a file name that only stands for one.

    Yields:
        Each block with its output.
    """
    namespace: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks(page.read_text(encoding="utf-8")):
        before, printed = set(folder.iterdir()), io.StringIO()
        code = compile("\n" * (block.line - 1) + replace(block.code), str(page), "exec")
        with _inside(folder), contextlib.redirect_stdout(printed), warnings.catch_warnings():
            warnings.simplefilter("error")
            exec(code, namespace)
        yield block, Output(printed.getvalue(), tuple(sorted(set(folder.iterdir()) - before)))


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
