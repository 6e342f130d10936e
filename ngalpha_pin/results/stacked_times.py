"""Kinematic rows of contacts at many times at once: the same few array operations for all of them.

The contacts of T times are taken for one large set of contacts, each with the poses of its own time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ngalpha_pin.collision.features import VANISHED
from ngalpha_pin.collision.manifold import EMPTY
from ngalpha_pin.contact.feature_rows import FeatureRows
from ngalpha_pin.contact.limit_rows import Own
from ngalpha_pin.contact.point_rows import Motion, Rows
from ngalpha_pin.contact.table import ContactTable, Subset


class TimedRows(NamedTuple):
    """Rows at T times, normals before friction rows, contacts in the order of the columns.

    Attributes:
        g_N: gaps, shape (T, k) [m or rad].
        W: directions in the coordinates of the model, shape (T, k + m, nv).
        rate: g_N_dot and gamma_F, shape (T, k + m).
        acceleration: g_N_ddot and gamma_F_dot, shape (T, k + m).
        surface_rate: the part of `rate` that surfaces make which move along themselves, likewise.
        surface_acceleration: its derivative by time, likewise.
    """

    g_N: np.ndarray
    W: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    surface_rate: np.ndarray
    surface_acceleration: np.ndarray


class Motions(NamedTuple):
    """Motions of a model at T times, as `point_rows.Motion` is that of one.

    Attributes:
        q, v, a: shapes (T, nq), (T, nv), (T, nv).
        J, dJ: columns of the Jacobian and their rates, shape (T, 6, nv).
        rotation, translation: poses of the joints, shapes (T, n_joints, 3, 3) and (T, n_joints, 3).
        t: the times, shape (T,) [s].
    """

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    J: np.ndarray
    dJ: np.ndarray
    rotation: np.ndarray
    translation: np.ndarray
    t: np.ndarray

    def project(self, F: np.ndarray, sub: Subset) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """See `point_rows.Motion`; `sub` are the contacts of all times."""
        n = self.v.shape[1]
        wide = self._by_time(F, sub) @ np.concatenate((self.J, self.dJ), axis=2)
        W, W_dot = (_by_row(part, sub) * sub.mask for part in (wide[:, :, :n], wide[:, :, n:]))
        V = np.swapaxes((self.J * self.v[:, None, :]) @ sub.support_T, 1, 2).reshape(-1, 6)
        return W, self._product(W_dot, self.v, sub), (V[sub.body_b], V[sub.body_a])

    def rates(self, W: np.ndarray, sub: Subset) -> np.ndarray:
        """W v, shape (rows,)."""
        return self._product(W, self.v, sub)

    def accelerations(self, W: np.ndarray, sub: Subset) -> np.ndarray:
        """W a, shape (rows,)."""
        return self._product(W, self.a, sub)

    def times(self, sub: Subset) -> np.ndarray:
        """Time of every contact, shape (k,) [s]."""
        return np.repeat(self.t, sub.k // len(self.t))

    def poses(self, sub: Subset) -> tuple[np.ndarray, np.ndarray]:
        """Poses of the bodies of a subset at all times, one after the other."""
        R, p = self.rotation[:, sub.bodies], self.translation[:, sub.bodies]
        return R.reshape(-1, 3, 3), p.reshape(-1, 3)

    def moved(self, rows: Rows | FeatureRows) -> TimedRows:
        """Rows of the contacts of all times, with their rates."""
        rows.move(self)
        every = rows.W, rows.rate, rows.acceleration, rows.surface_rate, rows.surface_acceleration
        return TimedRows(rows.g_N.reshape(len(self.v), -1), *(self._by_time(x, rows.sub) for x in every))

    def _by_time(self, x: np.ndarray, sub: Subset) -> np.ndarray:
        """Rows of all times as an array over the times, shape (T, k + m, ...)."""
        N, F = (part.reshape(len(self.v), -1, *x.shape[1:]) for part in np.split(x, [sub.k]))
        return np.concatenate((N, F), axis=1)

    def _product(self, W: np.ndarray, x: np.ndarray, sub: Subset) -> np.ndarray:
        """The rows of each time with the vector of that time, shape (rows,)."""
        return _by_row((self._by_time(W, sub) @ x[:, :, None])[:, :, 0], sub)


class TimedContacts:
    """Some contacts of a scene, at many times.

    Args:
        table: of all contacts.
        columns: numbers of the contacts, increasing, shape (k,).
        own: the own unilateral constraints of the scene, or None.
    """

    def __init__(self, table: ContactTable, columns: np.ndarray, own: Own | None = None):
        self._table, self._functions = table, own
        kinds = np.split(columns, np.searchsorted(columns, (table.n_fixed, table.n_points, table.n_shapes)))
        self._fixed, self._places, self._limits, self._own = kinds
        self._limits, self._own = self._limits - table.n_points, self._own - table.n_shapes
        self._repeated: dict[tuple[int, int], Subset] = {}

    def rows(self, motions: Motions, features: np.ndarray) -> TimedRows:
        """Rows of the contacts.

        Args:
            motions: of the model.
            features: packed features in the places of pairs of solids, shape (T, places, WIDTH).
        """
        parts, (T, n) = [], motions.v.shape
        if len(self._fixed):
            sub = self._at(self._fixed, T)
            parts.append(motions.moved(Rows(sub, *motions.poses(sub))))
        if len(self._places):
            sub, packed = self._at(self._places, T), features[:, self._places - self._table.n_fixed]
            parts.append(motions.moved(FeatureRows(sub, packed.reshape(-1, packed.shape[2]), *motions.poses(sub))))
        if len(self._limits):
            parts.append(self._limit_rows(motions))
        if len(self._own) and self._functions is not None:
            parts.append(self._own_rows(motions, self._functions))
        k = [part.g_N.shape[1] for part in parts]
        stacked = [np.concatenate([np.zeros((T, 0)), *(part.g_N for part in parts)], axis=1)]
        for i, nothing in enumerate((np.zeros((T, 0, n)), *4 * (np.zeros((T, 0)),)), start=1):
            normal = [part[i][:, :j] for part, j in zip(parts, k, strict=True)]
            friction = [part[i][:, j:] for part, j in zip(parts, k, strict=True)]
            stacked.append(np.concatenate([nothing, *normal, *friction], axis=1))
        return TimedRows(*stacked)

    def _limit_rows(self, motions: Motions) -> TimedRows:
        """Limits of joints: coordinates themselves."""
        table, limits = self._table, self._limits
        sign, dof = table.limit_sign[limits], table.limit_dof[limits]
        W = np.zeros((len(motions.v), len(limits), motions.v.shape[1]))
        W[:, np.arange(len(limits)), dof] = sign
        g_N = sign * (motions.q[:, table.limit_q[limits]] - table.limit_value[limits])
        no_surface = np.zeros((2, *g_N.shape))
        return TimedRows(g_N, W, sign * motions.v[:, dof], sign * motions.a[:, dof], *no_surface)

    def _own_rows(self, motions: Motions, own: Own) -> TimedRows:
        """Own unilateral constraints, time by time."""
        found = []
        for q, v, a, J, dJ in zip(motions.q, motions.v, motions.a, motions.J, motions.dJ, strict=True):
            rows = own.rows(self._own, q, Motion(J, dJ, dJ, v, a))
            found.append((own.gaps(self._own, q), rows.W, rows.rate, rows.acceleration, *np.zeros((2, len(rows.rate)))))
        return TimedRows(*(np.array(part) for part in zip(*found, strict=True)))

    def _at(self, index: np.ndarray, T: int) -> Subset:
        """Contacts of one kind T times, each time with bodies of its own."""
        key = int(index[0]), T
        if key not in self._repeated:
            self._repeated[key] = sub = Subset(self._table, np.tile(index, T))
            _ = sub.mask  # the signs belong to the bodies of one time
            shift = np.repeat(np.arange(T) * len(sub.bodies), len(index))
            sub.body_a, sub.body_b = sub.body_a + shift, sub.body_b + shift
        return self._repeated[key]


def features_at(contents: np.ndarray, ends: np.ndarray, times: np.ndarray, n: int, open_gap: float) -> np.ndarray:
    """Features in all places at some times, from what `Slots.contents` gave at all of them.

    Args:
        contents: those of all times in one array.
        ends: where those of each time end, shape (times,).
        times: increasing numbers of times, shape (T,).
        n: number of places.
        open_gap: gap of an empty place [m].

    Returns:
        Packed features, shape (T, n, WIDTH).
    """
    packed = np.tile(EMPTY, (len(times), n, 1))
    packed[:, :, VANISHED] = open_gap
    for row, i in enumerate(times.tolist() if n else ()):
        taken = contents[ends[i - 1] if i else 0 : ends[i]]
        packed[row, taken[:, 0].astype(int)] = taken[:, 1:]
    return packed


def _by_row(x: np.ndarray, sub: Subset) -> np.ndarray:
    """The inverse of `Motions._by_time`."""
    k = sub.k // len(x)
    return np.concatenate((x[:, :k].reshape(-1, *x.shape[2:]), x[:, k:].reshape(-1, *x.shape[2:])))
