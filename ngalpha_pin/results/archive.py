"""Named arrays with a header in one file, numpy's npz format; what is read is checked before memory is given to it."""

from __future__ import annotations

import json
import os
from math import prod
from typing import IO, Any
from zipfile import BadZipFile, ZipFile, ZipInfo

import numpy as np

from ngalpha_pin.common.checks import path as checked_path
from ngalpha_pin.common.files import replacing
from ngalpha_pin.errors import SceneError

# deflate makes at most so many bytes of one
LARGEST_RATIO, OVERHEAD = 1100, 4096
LONGEST_HEADER = 100_000  # of one array [bytes]


def write_archive(path: str | os.PathLike[str], header: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
    """Write a file, or leave the one that was there as it is.

    Args:
        path: of the file.
        header: plain lists, texts and numbers.
        arrays: by name, of numbers or texts.

    Raises:
        NotWritten: the system does not let it.
    """
    with replacing(path) as beside, open(beside, "wb") as file:
        np.savez_compressed(file, header=np.array(json.dumps(header)), **arrays)  # type: ignore[arg-type]


def read_archive(path: str | os.PathLike[str], what: str, version: int) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header and the arrays of a file.

    Args:
        path: of the file.
        what: it should be, for messages.
        version: the value of "format" in the header that is understood.

    Raises:
        SceneError: the file is missing, damaged, of another version or of another kind.
    """
    checked_path("path", path)
    try:
        with ZipFile(path) as file:
            content = {member.filename.removesuffix(".npy"): _array(file, member) for member in file.infolist()}
        header = json.loads(str(content.pop("header")))
        found = header["format"]
    except FileNotFoundError as error:
        raise SceneError(f"{path} cannot be read as {what}: there is no such file") from error
    except BadZipFile as error:
        raise SceneError(f"{path} cannot be read as {what}: it is damaged, or no npz file") from error
    except Exception as error:  # damaged files fail in as many ways as there are bytes
        raise SceneError(f"{path} cannot be read as {what}: {error!r}") from error
    if found != version:
        raise SceneError(f"{path} has format {found}, this version reads {version}")
    return header, content


def _array(file: ZipFile, member: ZipInfo) -> np.ndarray:
    """One array, after a look at how large it says it is."""
    if member.file_size > LARGEST_RATIO * member.compress_size + OVERHEAD:
        raise ValueError(f"{member.filename} says it has {member.file_size} bytes")
    with file.open(member) as stream:
        shape, dtype = _shape_and_type(stream)
        start = stream.tell()
    if dtype.hasobject or dtype.kind not in "biufU":
        raise ValueError(f"{member.filename} holds no numbers but {dtype}")
    if start + prod(shape) * dtype.itemsize != member.file_size:
        raise ValueError(f"{member.filename} of {member.file_size} bytes cannot have the shape {shape}")
    with file.open(member) as stream:
        array = np.lib.format.read_array(stream, allow_pickle=False)
        stream.read(1)  # the end, where zipfile compares the checksum
    return array


def _shape_and_type(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    version = np.lib.format.read_magic(stream)
    read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(stream, max_header_size=LONGEST_HEADER)
    if any(n < 0 for n in shape):
        raise ValueError(f"negative shape {shape}")
    return shape, dtype
