"""Faces of pieces of one body that are flush up to a length that is none: they get one plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ngalpha_pin.collision.polytope import Polytope
from ngalpha_pin.common.tolerances import PARALLEL


def flush_faces(pieces: Sequence[Polytope], around: Sequence[Sequence[int]], tol: float) -> list[Polytope]:
    """The pieces, those changed that have a face which is flush with one of a piece before them.

    Args:
        pieces: of one body.
        around: of every piece the numbers of those that touch it.
        tol: distance from the plane of the other face, in all corners of both, that is none [m].
    """
    begin = np.cumsum([0, *(len(piece.offsets) for piece in pieces)])
    first = np.arange(begin[-1])  # the face whose plane every face takes
    for i, others in enumerate(around):
        for j in (j for j in others if j > i):
            for f, g in zip(*_same(pieces[i], pieces[j], tol), strict=True):
                a, b = sorted((_root(first, begin[i] + f), _root(first, begin[j] + g)))
                first[b] = a
    return [_moved(pieces, begin, first, i) for i in range(len(pieces))]


def _same(a: Polytope, b: Polytope, tol: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of faces of two pieces that are flush."""
    f, g = np.nonzero(a.normals @ b.normals.T > 1.0 - PARALLEL)
    keep = [
        np.abs(a.V[a.members[i]] @ b.normals[j] - b.offsets[j]).max() <= tol
        and np.abs(b.V[b.members[j]] @ a.normals[i] - a.offsets[i]).max() <= tol
        for i, j in zip(f, g, strict=True)
    ]
    return f[keep], g[keep]


def _root(first: np.ndarray, i: int) -> int:
    while first[i] != i:
        i = int(first[i])
    return i


def _moved(pieces: Sequence[Polytope], begin: np.ndarray, first: np.ndarray, i: int) -> Polytope:
    """A piece with the planes of the faces that its own are flush with."""
    piece, V = pieces[i], pieces[i].V
    normals, offsets = piece.normals.copy(), piece.offsets.copy()
    for f in range(len(offsets)):
        root = _root(first, int(begin[i]) + f)
        k = int(np.searchsorted(begin, root, side="right")) - 1
        if k == i:
            continue
        other, g = pieces[k], root - begin[k]
        normals[f], offsets[f] = other.normals[g], other.offsets[g]
        V = V.copy() if V is piece.V else V
        here = piece.members[f]
        V[here] += (offsets[f] - V[here] @ normals[f])[:, None] * normals[f]
    return piece if V is piece.V else replace(piece, V=V, normals=normals, offsets=offsets)
