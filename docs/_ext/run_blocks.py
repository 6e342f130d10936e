"""Sphinx runs the blocks of every page while it reads it, and puts their output behind them."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from typing import Any

from blocks import Output, run
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

GENERATED = "_generated"  # beside the pages: pictures, and in `extra` what is copied into the site as it is


def put_outputs(app: Sphinx, page: str, source: list[str]) -> None:
    """Rewrite a page with the outputs of its blocks."""
    path = Path(app.env.doc2path(page))
    folder = Path(app.srcdir) / GENERATED / page
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    parts, at = [], 0
    try:
        for block, output in run(path, folder):
            parts += [source[0][at : block.end], _shown(app, page, output)]
            at = block.end
    except Exception as error:
        raise ExtensionError(f"a block of {path} fails: {type(error).__name__}: {error}", error) from error
    source[0] = "".join(parts) + source[0][at:]


def _shown(app: Sphinx, page: str, output: Output) -> str:
    """What stands behind a block: its text, its pictures and its replays."""
    up, parts = "../" * page.count("/"), []
    if output.text.strip():
        parts.append(f"```{{code-block}} text\n:class: output\n\n{output.text.rstrip()}\n```")
    for file in output.files:
        if file.suffix == ".png":
            parts.append(f"```{{image}} /{GENERATED}/{page}/{file.name}\n```")
        elif file.suffix == ".html":
            extra = Path(app.srcdir) / GENERATED / "extra" / "replays" / page
            extra.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, extra / file.name)
            name = f"{up}replays/{page}/{file.name}"
            parts.append(
                f'<iframe class="replay" src="{name}" loading="lazy" title="Replay"></iframe>\n\n'
                f'<p class="caption"><a href="{name}">The replay in a window of its own</a></p>'
            )
    return "".join(f"\n\n{part}\n" for part in parts)


def plain_text(app: Any, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Docstrings are plain text: a bar or a star outside of backticks is no markup."""
    for i, line in enumerate(lines):
        parts = re.split(r"(`[^`]*`)", line)
        lines[i] = "".join(p if p.startswith("`") else re.sub(r"(?<!\*)([|*])(?!\*)", r"\\\1", p) for p in parts)


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.connect("source-read", put_outputs)
    app.connect("autodoc-process-docstring", plain_text, priority=400)  # before napoleon
    return {"parallel_read_safe": True, "parallel_write_safe": True}
