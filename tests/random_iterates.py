"""Iterates of a step whose forces put the contacts into all kinds of index sets."""

from __future__ import annotations

from collections import Counter

import numpy as np

DT = 1e-2


def with_laws(equations, options):
    """The equations, evaluated with these laws unless others are given."""
    evaluate = equations.evaluate
    equations.evaluate = lambda x, laws=options: evaluate(x, laws)
    return equations


def random_iterate(equations, seed, parts=(-1.3, 0.5, 2.0)):
    """Unknowns whose forces put the contacts into all kinds of index sets.

    With a part of -0.5 there are also normal forces that push where contacts open.
    """
    rng, sub, nv, n = np.random.default_rng(seed), equations.sub, equations.nv, equations.n
    k, m, o = sub.k, sub.m, sub.of_F
    smooth = rng.normal(size=(3, nv)) * np.array([[1.0], [DT], [DT**2]])
    ev = equations.evaluate(np.concatenate((smooth.ravel(), np.zeros(n))))
    y = ev.contact.y
    r = np.minimum(equations.r[: len(y)], 1e3)
    forces = []
    for level, rows in ((2, 0), (1, k), (0, 2 * k + m)):
        trial = (r * y)[rows : rows + k]
        normal = trial + np.abs(trial).max() * rng.choice(parts, k)
        forces.append(normal)
        if level < 2:
            place = slice(rows + k, rows + k + m)
            cone = (sub.mu * np.abs(normal))[o]
            d = rng.normal(size=m)
            d *= cone / np.maximum(np.sqrt(np.bincount(o, d * d, k)), 1e-300)[o]
            stick, far = (r * y)[place] + 0.3 * d, 2.0 * d
            forces.append(np.where(rng.integers(2, size=k)[o] == 0, stick, far))
    z = np.concatenate(forces)
    la = z[2 * k + m :]
    known = ev.z + np.concatenate((equations.beta_c * la[:k], equations.gamma_c * la, np.zeros(k + m)))
    return np.concatenate((smooth.ravel(), (z - known)[: 2 * k + m], la, np.zeros(n - len(y))))


def sets_of(contact, sub):
    """Name of the index sets of every contact with friction."""
    sets = Counter()
    for i in np.unique(sub.of_F):
        normal = "ABC"[: int(contact.A[i]) + int(contact.B[i]) + int(contact.C[i])] or "open"
        friction = "stick" if contact.stick_a[i] else "just started" if contact.stick[i] else "slip"
        sets[normal if normal == "open" else f"{normal} {friction}"] += 1
        capped = contact.slips and contact.A[i] and not contact.stick[i] and contact.capped[sub.of_F == i].any()
        sets["capped"] += int(capped)
    return sets
