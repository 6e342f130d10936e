"""The bilateral constraints of a scene, compiled: g(t, q) = 0 and gamma(t, q, v) = 0 with their rates (54), (55)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ngalpha_pin.common.tolerances import MOVABLE, TINY
from ngalpha_pin.constraints.driven_angle import DrivenAngles, driven_angles
from ngalpha_pin.constraints.frame_rows import FrameRow, FrameRows, FrameTable
from ngalpha_pin.constraints.frames import Frames, frames
from ngalpha_pin.constraints.joint_coupling import Coupled, Couplings, CouplingTable, couplings
from ngalpha_pin.constraints.joint_trajectory import Coordinates, coordinates
from ngalpha_pin.constraints.provider import Bodies, Provider, ProviderRows
from ngalpha_pin.constraints.rolling_disc import discs
from ngalpha_pin.constraints.rolling_sphere import spheres
from ngalpha_pin.constraints.user_defined import UserRows, user_functions
from ngalpha_pin.contact.point_rows import Motion
from ngalpha_pin.numerics.gauss_seidel import VANISHES

if TYPE_CHECKING:
    from ngalpha_pin.scene.scene import Scene


class Constraints:
    """All bilateral constraints of a scene; rows of g before those of gamma.

    A row that cannot move (across the plane of a planar mechanism) would make the equations singular and is left out.

    Attributes:
        kb, mb: number of rows of g and of gamma.
        names: constraint that each row belongs to.
        still: constraints with a row that is left out.
        group: of each row; rows of one group have the same unit and share their scale.
        compiled: the kernel knows all rows: there are some, of frames that nobody moves, of driven angles, of joints
            that follow a function of time and of couplings.
        frames, couplings: those rows, in their order, as the kernel takes them; None where there are none.
        follows: of each of them the place of its function of time in `wanted`, -1 where it has none.
        over_time: there are such functions.
        vanishes: inverse mass of a group, in parts of the largest one, that is none.
        names_of_every_g: constraint of each entry of `ConstraintRows.whole`.
    """

    vanishes = VANISHES

    def __init__(self, scene: Scene, model: pin.Model):
        kinds = (frames, driven_angles, coordinates, couplings, spheres, discs, user_functions)
        self._providers: list[Provider] = [p for p in (kind(scene, model) for kind in kinds) if p is not None]
        # rows come provider by provider, each with g before gamma; `_order` puts all of g first
        names: list[str] = []
        levels, groups, first = [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)], 0
        for provider in self._providers:
            names += provider.names_g + provider.names_gamma
            levels.append(np.repeat((0, 1), (len(provider.names_g), len(provider.names_gamma))))
            groups.append(first + provider.group)
            first += int(provider.group.max()) + 1
        level, group = np.concatenate(levels), np.concatenate(groups)
        moves = _movable(self._providers, model, group) if len(group) else np.zeros(0, dtype=bool)
        self._order = np.flatnonzero(moves)[np.argsort(level[moves], kind="stable")]
        self._of_g = moves[level == 0]  # which entries of g are kept
        self.kb, self.mb = int((level[moves] == 0).sum()), int((level[moves] == 1).sum())
        self.names = tuple(names[i] for i in self._order)
        self.names_of_every_g = tuple(name for name, at in zip(names, level, strict=True) if at == 0)
        self.still = tuple(name for name, kept in zip(names, moves, strict=True) if not kept)
        self.group = group[self._order]
        self._compile(model)

    def _compile(self, model: pin.Model) -> None:
        """Put the rows into the tables of the kernel, where it knows them all."""
        self.frames: FrameTable | None = None
        self.couplings: CouplingTable | None = None
        self.follows = np.full(len(self._order), -1)
        self._laws: list[Callable[[float], np.ndarray]] = []
        known = all(isinstance(p, Frames | DrivenAngles | Coordinates | Couplings) for p in self._providers)
        tied = next((p.table for p in self._providers if isinstance(p, Frames)), None)
        moved = tied is not None and tied.n_moved > 0
        # rows of gamma come last, and with them those of frames would be no part of their own
        alone = len(self._providers) == (tied is not None)
        self.compiled = bool(len(self._order)) and known and not moved and (alone or self.mb == 0)
        if self.compiled:
            self._fill(model, tied)

    def _fill(self, model: pin.Model, frames: FrameTable | None) -> None:
        """The tables of the kernel."""
        tied: list[FrameRow] = []
        coupled: list[Coupled] = []
        first = 0
        for provider in self._providers:
            n = len(provider.group)
            here = (self._order >= first) & (self._order < first + n)
            which, first = self._order[here] - first, first + n
            if isinstance(provider, DrivenAngles | Coordinates):
                self.follows[here] = len(self._laws) + np.arange(len(which))
                self._laws += [provider.laws[i] for i in which]
            if isinstance(provider, Frames):
                tied += [provider.table.rows[i] for i in which]
            elif isinstance(provider, DrivenAngles):
                tied += provider.frame_rows(which)
            elif isinstance(provider, Coordinates | Couplings):
                coupled += provider.coupled(which)
        if tied:
            self.frames = FrameTable(model, tied, 0)
            self.frames.unit = 0.0 if frames is None else frames.unit
        if coupled:
            self.couplings = CouplingTable.of(coupled)

    @property
    def over_time(self) -> bool:
        """See above."""
        return bool(self._laws)

    def wanted(self, t: float) -> np.ndarray:
        """What rows follow at a time, value and two derivatives of each, for the kernel, shape (3 n,)."""
        return np.concatenate([law(t) for law in self._laws])

    def by_group(self, G: np.ndarray) -> np.ndarray:
        """The largest entry of its group for every row, shape (kb + mb,): one unit for rows of one kind."""
        largest = np.full(int(self.group.max(initial=0)) + 1, max(self.vanishes * float(G.max(initial=0.0)), TINY))
        np.maximum.at(largest, self.group, G)
        return largest[self.group]

    def rows(self, bodies: Bodies) -> ConstraintRows:
        """Rows of all constraints at one motion."""
        return ConstraintRows([provider.rows(bodies) for provider in self._providers], self._order, self._of_g)


class ConstraintRows:
    """Rows of all constraints at one motion.

    Attributes:
        g: shape (kb,) [m, rad or -].
        W: W_g^T and below it W_gamma^T (34), shape (kb + mb, nv).
        rate: g_dot (54) and gamma, shape (kb + mb,).
        acceleration: g_ddot and gamma_dot (55), shape (kb + mb,).
        sizes: largest position and velocity that the rows subtract.
        parts, order: rows of each kind of constraint, and the places of these rows among all of theirs.
        noise: what differences leave of `acceleration`, `rate` and g, shape (3, kb + mb).
    """

    def __init__(self, parts: list[ProviderRows], order: np.ndarray, of_g: np.ndarray):
        self.parts, self.order = parts, order
        self.g = np.concatenate([part.g for part in parts])[of_g]
        self.W, self.rate, self.acceleration = (
            self._sorted([getattr(part, name) for part in parts]) for name in ("W", "rate", "acceleration")
        )
        positions, velocities = zip(*(part.sizes for part in parts), strict=True)
        self.sizes = max(positions), max(velocities)
        noise = [part.noise if isinstance(part, UserRows) else np.zeros((3, len(part.rate))) for part in parts]
        self.noise = np.concatenate(noise, axis=1)[:, order]

    def whole(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """What assembly has to bring to zero, rows that cannot move included, and its directions; see `aligned`."""
        found = [
            part.aligned(motion) if isinstance(part, FrameRows) else (part.g, part.W[: len(part.g)])
            for part in self.parts
        ]
        g, W = zip(*found, strict=True)
        return np.concatenate(g), np.concatenate(W)

    def add_wrenches(self, la: np.ndarray, total: np.ndarray) -> None:
        """Add what forces of the rows do to the bodies.

        Args:
            la: forces, shape (kb + mb,).
            total: wrenches on all bodies about the origin of the world, shape (n_joints, 6).
        """
        parts = [part.wrenches for part in self.parts]
        F, a, b = (self._sorted([part[i] for part in parts]) for i in range(3))
        np.add.at(total, b, la[:, None] * F)
        np.add.at(total, a, -la[:, None] * F)

    def derivatives(self, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of `rate` by q and of `acceleration` by v, each of the shape of W."""
        X, Y = zip(*(part.derivatives(motion) for part in self.parts), strict=True)
        return self._sorted(list(X)), self._sorted(list(Y))

    def _sorted(self, parts: list[np.ndarray]) -> np.ndarray:
        return (parts[0] if len(parts) == 1 else np.concatenate(parts))[self.order]


def _movable(providers: list[Provider], model: pin.Model, group: np.ndarray) -> np.ndarray:
    """Which rows some motion changes, found on random configurations, shape (n,)."""
    data, rng, v = model.createData(), np.random.default_rng(0), np.zeros(model.nv)
    size = np.zeros(len(group))
    for _ in range(4):
        q = pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv))
        pin.computeRNEADerivatives(model, data, q, v, v)
        poses = [data.oMi[j] for j in range(model.njoints)]
        J, dJ, dAdv = (x.reshape(6, len(v)) for x in (data.J, data.dJ, data.dAdv))
        motion = Motion(J, dJ, dAdv, v, v)
        bodies = Bodies(0.0, q, [pose.rotation for pose in poses], [pose.translation for pose in poses], motion)
        W = np.concatenate([
            provider.rows(bodies).W if provider.everywhere else np.ones((len(provider.group), model.nv))
            for provider in providers
        ])  # fmt: skip
        size = np.maximum(size, np.abs(W).max(axis=1, initial=0.0))
    largest = np.zeros(int(group.max()) + 1)
    np.maximum.at(largest, group, size)
    return size > MOVABLE * largest[group]
