"""Files that are written whole or not at all, whatever ends the process in between."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ngalpha_pin.common.checks import path as checked_path
from ngalpha_pin.errors import NotWritten

UNFINISHED = ".part"  # end of the name of a file that is being written; one that stays behind can be deleted


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """The path of a new file beside the wanted one, which takes its place when all is written and on the disk.

    Until then, and where anything fails, the file that was there stays as it is. What is no regular file, such as
    /dev/stdout, is written to directly.

    Args:
        path: of the file that is wanted.

    Yields:
        Where to write; its name ends as that of the wanted file.

    Raises:
        NotWritten: the system says no: the disk is full, the folder is missing or cannot be written to.
    """
    wanted = Path(os.path.realpath(checked_path("path", path)))
    if wanted.exists() and not wanted.is_file():
        if wanted.is_dir():
            raise NotWritten(f"cannot write {path}: it is a folder, give the name of a file")
        with _said(path):
            yield wanted
        return
    beside = wanted.with_name(f".{wanted.stem[:100]}.{secrets.token_hex(4)}{UNFINISHED}{wanted.suffix}")
    try:
        with _said(path):
            yield beside
            with open(beside, "rb+") as file:
                os.fsync(file.fileno())
            if wanted.exists():
                shutil.copymode(wanted, beside)
            os.replace(beside, wanted)
    finally:
        with suppress(OSError):
            beside.unlink(missing_ok=True)


@contextmanager
def _said(path: str | os.PathLike[str]) -> Iterator[None]:
    try:
        yield
    except NotWritten:
        raise
    except OSError as error:
        what = error.strerror or str(error) or type(error).__name__
        raise NotWritten(f"cannot write {path}: {what}; a file that was there is as before") from error


def write_bytes(path: str | os.PathLike[str], content: bytes) -> None:
    """Write a file; see `replacing`."""
    with replacing(path) as beside:
        beside.write_bytes(content)


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write a text in UTF-8; see `replacing`."""
    write_bytes(path, text.encode("utf-8"))
