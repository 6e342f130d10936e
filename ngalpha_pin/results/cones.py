"""The cones of the contacts of a run in its arrays: friction, and rolling resistance apart from it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.contact.cones import ROLLING
from ngalpha_pin.results.recorded import Recorded


class RecordedCones(NamedTuple):
    """Those of slip of all k contacts first, then those of rolling.

    Attributes:
        contact: column of the contact of each cone, shape (c,).
        rows: slice of each cone into the arrays of friction.
        mu: coefficient of sticking of each cone, shape (c,).
    """

    contact: np.ndarray
    rows: tuple[slice, ...]
    mu: np.ndarray


def cones_of(trajectory: Recorded) -> RecordedCones:
    """The cones of the contacts of a run."""
    table, columns = trajectory.system.contacts, trajectory.contact_columns
    slip, roll, rolls = [], [], []
    for column, (i, rows) in enumerate(zip(columns.tolist(), trajectory.friction_rows, strict=True)):
        own = table.kind_F[table.first_F[i] :][: table.n_F[i]]
        end = rows.start + int((own < ROLLING).sum())
        slip.append(slice(rows.start, end))
        if end < rows.stop:
            roll.append(slice(end, rows.stop))
            rolls.append(column)
    contact = np.concatenate((np.arange(len(columns)), np.array(rolls, dtype=int)))
    mu = np.concatenate((table.mu[columns], table.rolling[columns[np.array(rolls, dtype=int)]]))
    return RecordedCones(contact, (*slip, *roll), mu)
