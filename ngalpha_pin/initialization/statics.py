"""Static equilibrium where the energy is lowest, and the eigenmodes linearised about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import eig

from ngalpha_pin.common import checks
from ngalpha_pin.common.tolerances import BALANCED, CONE
from ngalpha_pin.contact.table import Subset
from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.balance import Balance
from ngalpha_pin.initialization.initial import checked_values
from ngalpha_pin.initialization.minimisation import growth, reduced_stiffness, rest
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.system import System

MAX_ROUNDS = 20  # changes of the set of closed contacts
LISTED = 6  # frequencies in words


@dataclass(frozen=True)
class Equilibrium:
    """Where a scene can rest, and what holds it there.

    Attributes:
        q: configuration, shape (nq,).
        contacts: names of the closed contacts.
        la_N: their normal forces, shape (k,) [N].
        la_F: their friction forces, shape (m,) [N].
        constraints: name of the constraint of each row.
        la_b: forces of the constraints, shape (b,).
        n_iter: displacements tried.
        stable: small motions that the contacts and constraints leave do not grow; contacts that carry stay closed and
            stick. A motion without stiffness counts as stable.
    """

    q: np.ndarray
    contacts: tuple[str, ...]
    la_N: np.ndarray
    la_F: np.ndarray
    constraints: tuple[str, ...]
    la_b: np.ndarray
    n_iter: int
    stable: bool

    def __str__(self) -> str:
        carried = zip(self.contacts, self.la_N, strict=True)
        closed = ", ".join(f"{name} with {force:.4g} N" for name, force in carried)
        rows = f"; {len(self.la_b)} rows of constraints" if len(self.la_b) else ""
        return f"{'stable' if self.stable else 'unstable'} equilibrium; closed contacts: {closed or 'none'}{rows}"


@dataclass(frozen=True)
class Modes:
    """Small vibrations about an equilibrium.

    Attributes:
        equilibrium: where they are.
        omega_squared: eigenvalues in increasing order, shape (n,) [1/s^2]; their real parts where forces have no
            potential.
        shapes: velocities of each mode, shape (nv, n).
        growth: rates at which modes grow, shape (n,) [1/s]; zero for those that vibrate.
    """

    equilibrium: Equilibrium
    omega_squared: np.ndarray
    shapes: np.ndarray
    growth: np.ndarray

    @property
    def frequencies(self) -> np.ndarray:
        """Eigenfrequencies, shape (n,) [Hz]; zero for a motion without stiffness and for an unstable one."""
        return np.sqrt(np.maximum(self.omega_squared, 0.0)) / (2 * np.pi)

    @property
    def unstable(self) -> np.ndarray:
        """Which modes grow, shape (n,)."""
        return self.growth > 0.0

    def __str__(self) -> str:
        shown = [f"{f:.4g}" for f in self.frequencies[:LISTED]]
        more = ", ..." if len(self.frequencies) > LISTED else ""
        grows = f"; {int(self.unstable.sum())} of them grow" if self.unstable.any() else ""
        return f"{len(self.frequencies)} modes at {', '.join(shown)}{more} Hz{grows}; {self.equilibrium}"


def static_equilibrium(scene: Scene, q0: np.ndarray, t0: float = 0.0) -> Equilibrium:
    """Find the equilibrium to which the energy leads down from q0.

    Contacts that are closed at q0 stay closed and stick as long as they press; others close where they would penetrate.
    A q0 that is in balance is returned, `stable` or not; from everywhere else the energy falls to where no motion
    lowers it to second order. Two things have no lowest energy: friction holds wherever it can, so that another
    position may be lower that only slip leads to; and forces without a potential (follower loads, controls) are
    balanced, but what is found there may be unstable. `stable` tells.

    Args:
        scene: what rests.
        q0: start, shape (nq,); constraints may be open by little.
        t0: time of constraints that move, and of forces [s].

    Raises:
        SceneError: there is no equilibrium near q0, or a contact would slip.
    """
    system, t0 = System(checks.instance("scene", scene, Scene)), checks.number("t0", t0)
    return _equilibrium(system, checked_values(system, q0, None)[0], t0)


def eigenmodes(scene: Scene, q0: np.ndarray, t0: float = 0.0) -> Modes:
    """Modes of small motions about the static equilibrium near q0, without damping: those that vibrate or grow.

    Args:
        scene: what vibrates.
        q0: start of the search for the equilibrium, shape (nq,).
        t0: time of constraints that move [s].

    Raises:
        SceneError: there is no equilibrium near q0.
    """
    system, t0 = System(checks.instance("scene", scene, Scene)), checks.number("t0", t0)
    found = _equilibrium(system, checked_values(system, q0, None)[0], t0)
    balance = Balance(system, _subset(system, found), t0)
    at = balance.forces(found.q)
    basis = balance.metric(found.q, at.W).basis
    la = np.concatenate((found.la_N, found.la_F, found.la_b))[balance.kept]
    K, M = reduced_stiffness(balance, found.q, at, la, basis), basis.T @ system.mass_matrix(found.q) @ basis
    values, vectors = eig(K, M)
    order = np.argsort(values.real, kind="stable")
    return Modes(found, values.real[order], (basis @ vectors.real)[:, order], growth(values[order]))


def _equilibrium(system: System, q0: np.ndarray, t0: float) -> Equilibrium:
    """The lowest energy with one set of closed contacts after the other."""
    table, every = system.contacts, system.contacts.subset(np.arange(system.contacts.n))
    if table.surfaces.any:
        name = table.names[int(np.argmax(table.surfaces.moves))]
        raise SceneError(
            f"static equilibrium: the surface of contact {name!r} moves, what lies on it does not rest; leave its "
            "velocity out, or let a run with dampers come to rest"
        )
    system.place(q0)
    closed = np.flatnonzero(system.gaps(every, q0) <= BALANCED * table.yardstick) if table.n else np.zeros(0, dtype=int)
    n_iter = 0
    for _ in range(MAX_ROUNDS):
        sub = table.subset(closed)
        balance = Balance(system, sub, t0)
        found = rest(balance, q0)
        q, n_iter = found.q, n_iter + found.n_iter
        la = balance.whole(q, found.la)
        system.place(q)
        gaps = system.gaps(every, q) if table.n else np.zeros(0)
        la[: sub.k] += table.adhesion[closed]  # what presses, where contacts hold
        pulls = closed[(la[: sub.k] < 0.0) | (table.soft[closed] & (gaps[closed] > 0.0))]
        deep = np.setdiff1d(np.flatnonzero(gaps < -BALANCED * table.yardstick), closed)
        if not len(pulls) and not len(deep):
            _check_friction(sub, la)
            la_N, la_F, la_b = np.split(la, (sub.k, sub.k + sub.m))
            return Equilibrium(q, sub.names, la_N, la_F, system.constraints.names, la_b, n_iter, found.stable)
        closed = np.union1d(np.setdiff1d(closed, pulls), deep)
    raise SceneError("static equilibrium: contacts close and open in turn; start from a q0 closer to the equilibrium")


def _subset(system: System, found: Equilibrium) -> Subset:
    return system.contacts.subset(np.array([system.contacts.names.index(name) for name in found.contacts], dtype=int))


def _check_friction(sub: Subset, la: np.ndarray) -> None:
    cones, la_N = sub.cones, la[: sub.k]
    size, of = cones.sizes(la[sub.k : sub.k + sub.m]), cones.contact
    slips = np.flatnonzero(size > cones.mu * la_N[of] * (1 + CONE) + CONE * np.abs(la_N).max(initial=0.0))
    if len(slips) and sub.m:
        i, c = of[slips[0]], slips[0]
        needs = size[c] / la[i]
        if c >= sub.k:
            arm = sub.table.rolling[sub.index[i]] * sub.table.lever[sub.index[i]]
            raise SceneError(
                f"static equilibrium: contact {sub.names[i]!r} would roll, it needs rolling_resistance = "
                f"{needs * sub.table.lever[sub.index[i]]:.3g} and has {arm:.3g}"
            )
        raise SceneError(
            f"static equilibrium: contact {sub.names[i]!r} would slip, it needs mu = {needs:.3g} and has "
            f"{sub.mu[i]:.3g}"
        )
