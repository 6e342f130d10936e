"""A controller that looks at the motion at its own rate and holds its force in between."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.protocols import Declared, Kinematics
from ngalpha_pin.scene.user_function import array_of, called


class SampledControl:
    """A generalized force from a function of the user's own that is called once a sample and held exactly in between.

    Samples are taken at the start of a run and at the multiples of 1 / rate; steps end there, whatever their length.
    The force counts as that of motors: the effort limits of the joints bound it together with the other controls.

    A law with a memory (a filter, an integral, a counter) gets it as its last argument and returns the next one: so the
    memory is saved with the run and goes on from there to the same bits. What a law keeps elsewhere is its own matter.

    Args:
        law: `law(t, q, v, forces) -> tau`, or with a `state` `law(t, q, v, forces, state) -> (tau, next state)`.
            t is the time [s], q has shape (nq,), v and tau have shape (nv,) of the tree; tau is a generalized force
            [N or N m]. `forces` is a dict of the contacts that carry a force just before the sample, with the names of
            `Trajectory.contact_names`, as "foot/ground", or "box[2]/ground" of a corner: the force on the first of the
            two in the axes of the world, shape (3,) [N]. An open one has no entry: `forces.get(name, np.zeros(3))`.
        rate: samples a second [Hz].
        state: memory of the law at the start, a number or shape (s,); None is none.

    Raises:
        SceneError: rate or state cannot be used; at a sample: the law fails, or gives something else.
    """

    energy = None
    actuated = True

    def __init__(self, law: Callable[..., Any], rate: float, state: float | np.ndarray | None = None):
        self.law = checks.function("SampledControl: law", law, "of (t, q, v, forces) that returns shape (nv,)")
        self.name = f"SampledControl {getattr(law, '__name__', 'of a function')}"
        self.rate = checks.number("SampledControl: rate", rate, 0.0, above=True, unit="samples a second")
        self.state: np.ndarray | None = None
        if state is not None:
            self.state = np.atleast_1d(checks.array("SampledControl: state", state, (None,) if np.ndim(state) else ()))

    def check(self, scene: Declared) -> None:
        """Any model will do; what the law gives is checked at the first sample."""

    def bind(self, kinematics: Kinematics) -> SampledControl:
        """See `Force`."""
        return self

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """What it holds is in the state of the run, not here."""

    def at(
        self, t: float, q: np.ndarray, v: np.ndarray, forces: dict[str, np.ndarray], state: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """One sample: the force that is held from t on, shape (nv,), and the next state of the law.

        Args:
            t: time [s].
            q: configuration of the tree, shape (nq,).
            v: velocity of the tree, shape (nv,).
            forces: see the class.
            state: of the law, shape (s,); empty without one.
        """
        where: tuple[Any, ...] = (q.copy(), v.copy(), forces)
        shape = v.shape
        if self.state is None:
            return array_of(self.name, called(self.name, self.law, t, *where), t, shape), state
        given = called(self.name, self.law, t, *where, state.copy())
        if not isinstance(given, tuple) or len(given) != 2:
            raise SceneError(f"{self.name}: got {checks.shown(given)} at t = {t:g}; it must be (force, next state)")
        return array_of(self.name, given[0], t, shape), array_of(f"{self.name}: state", given[1], t, state.shape)
