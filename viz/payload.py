"""One compressed block of data inside a page: a JSON header, then the arrays and texts it refers to."""

from __future__ import annotations

import base64
import gzip
import json
from typing import Any

import numpy as np

KINDS = {"f4": "<f4", "u4": "<u4", "i4": "<i4", "u1": "|u1"}


class Payload:
    """Collects arrays and texts, each stored once, however often it is used."""

    def __init__(self) -> None:
        self._blobs: list[bytes] = []
        self._table: list[list[Any]] = []
        self._known: dict[tuple[str, bytes], int] = {}
        self._offset = 0

    def array(self, values: np.ndarray, kind: str = "f4") -> dict[str, int]:
        """Store an array, flattened in C order, and return what the header writes in its place.

        Args:
            values: any shape.
            kind: one of `KINDS`.
        """
        return self._store(kind, np.ascontiguousarray(values, dtype=KINDS[kind]).tobytes())

    def raw(self, kind: str, content: bytes) -> dict[str, int]:
        """Store the bytes of an array of that kind."""
        return self._store(kind, content)

    def text(self, content: str) -> dict[str, int]:
        """Store a long text, such as a mesh file."""
        return self._store("text", content.encode())

    def encode(self, header: dict[str, Any]) -> str:
        """The whole block in base64: length of the header, header, blobs; compressed with gzip."""
        head = json.dumps({**header, "blobs": self._table}, separators=(",", ":"), allow_nan=False).encode()
        block = len(head).to_bytes(4, "little") + head + b"".join(self._blobs)
        return base64.b64encode(gzip.compress(block, compresslevel=6, mtime=0)).decode("ascii")

    def _store(self, kind: str, content: bytes) -> dict[str, int]:
        key = (kind, content)
        if key not in self._known:
            self._known[key] = len(self._table)
            self._table.append([kind, self._offset, len(content)])
            self._blobs.append(content)
            self._offset += len(content)
        return {"$": self._known[key]}
