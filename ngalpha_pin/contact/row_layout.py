"""Where the rows of contacts, joint friction and constraints stand among the multipliers of a step.

The multipliers, and in the same order the equations that belong to them, are

    contacts          kappa_N (k)   La_N (k)  La_F (m)        la_N (k)  la_F (m)
    joint friction                  La_f (f)                  la_f (f)
    constraints       kappa_g (kb)  La_g (kb) La_gamma (mb)   la_g (kb) la_gamma (mb)

The rows W of all of them are stacked as k + m contact rows, f joint friction rows, kb + mb constraint rows.
"""

from __future__ import annotations

import numpy as np

from ngalpha_pin.contact.table import Subset

Index = slice | np.ndarray


class Layout:
    """Index arrays of one set of contacts with the joint friction and the constraints of the scene.

    Attributes:
        k, m: normal and friction rows of the contacts.
        f: rows of joint friction.
        kb, mb: rows of the constraints on position level g and on velocity level gamma.
        rows: number of rows of W.
        n_c, n: multipliers of the contacts, and of all.
        at_g, at_v, at_a: multiplier of each row on position, velocity and acceleration level.
        position_rows: rows of W that have a position level.
        contacts, friction, constraints: rows of W of each kind.
        friction_v, friction_a: multipliers La_f and la_f.
        scale_rows, levels: row of W that gives a multiplier its scale, and its level (2 position, 1 velocity, 0
            acceleration), shape (n,).
        half_rows, half_v: rows of W whose impulse acts for dt/2 (80), joint friction and gamma, and their multipliers.
    """

    def __init__(self, sub: Subset, f: int, kb: int, mb: int):
        self.k, self.m, self.f, self.kb, self.mb = k, m, f, kb, mb = sub.k, sub.m, f, kb, mb
        j, jb = k + m, kb + mb
        self.rows, self.n_c = j + f + jb, k + 2 * j
        first = self.n_c + 2 * f  # the first multiplier of the constraints
        self.n = first + kb + 2 * jb
        self.friction_v = slice(self.n_c, self.n_c + f)
        self.friction_a = slice(self.n_c + f, first)
        self.contacts, self.friction, self.constraints = slice(0, j), slice(j, j + f), slice(j + f, self.rows)
        starts = ((0, k, k + j), (self.n_c, self.n_c, self.n_c + f), (first, first + kb, first + kb + jb))
        counts = ((k, j, j), (0, f, f), (kb, jb, jb))
        self.at_g, self.at_v, self.at_a = (
            _joined([(start[level], count[level]) for start, count in zip(starts, counts, strict=True)])
            for level in range(3)
        )
        self.position_rows = _joined([(0, k), (j + f, kb)])
        own = [np.arange(j, j + f), np.arange(j, j + f), np.arange(j + f, j + f + kb)] + 2 * [
            np.arange(j + f, self.rows)
        ]
        self.scale_rows = np.concatenate([sub.scale_rows, *own])
        self.levels = np.concatenate((sub.levels, np.repeat((1, 0, 2, 1, 0), (f, f, kb, jb, jb))))
        self.half_rows = _joined([(j, f), (j + f + kb, mb)])
        self.half_v = _joined([(self.n_c, f), (first + 2 * kb, mb)])


def _joined(ranges: list[tuple[int, int]]) -> Index:
    """Ranges of (start, count) as one index: a slice where only one of them has entries."""
    used = [(start, count) for start, count in ranges if count]
    if len(used) <= 1:
        start, count = used[0] if used else (0, 0)
        return slice(start, start + count)
    return np.concatenate([np.arange(start, start + count) for start, count in used])
