"""States of the first order beside the motion: currents, pressures, temperatures, filters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.forces import without_model
from ngalpha_pin.scene.protocols import Declared
from ngalpha_pin.scene.user_function import DIFFERENCE, array_of, called, check_pure

Rate = Callable[[float, np.ndarray, np.ndarray, np.ndarray], Any]


class ExtraState:
    """One or several states z with z_dot = rate(t, q, v, z), which may exert a generalized force(t, q, v, z).

    Args:
        name: must be new.
        rate: returns shape (n,), or a number for one state; None, of a scene from a file, is zero.
        start: z at the start, a number or shape (n,).
        force: returns shape (nv,) [N or N m]; None is none.
        derivatives: of (t, q, v, z), returns those of the rate by q (tangent), v and z, and of the force likewise: six
            matrices; None takes differences, 4 nv + 2 n calls more an evaluation.
        scale: size of the state, whose parts count as its accuracy.

    Attributes:
        n: number of states.
        start: shape (n,).
    """

    def __init__(
        self,
        name: str,
        rate: Rate | None,
        start: float | Sequence[float] = 0.0,
        force: Rate | None = None,
        derivatives: Rate | None = None,
        scale: float = 1.0,
    ):
        self.name = checks.name("name of a state", name)
        what = f"state {self.name!r}"
        given = "of (t, q, v, z) that returns shape (n,)"
        self.rate = None if rate is None else checks.function(f"{what}: rate", rate, given)
        self.start = np.atleast_1d(checks.number_or_array(f"{what}: start", start, -np.inf))
        self.n = len(self.start)
        given = "of (t, q, v, z) that returns shape (nv,)"
        self.force = None if force is None else checks.function(f"{what}: force", force, given)
        self.derivatives = (
            None
            if derivatives is None
            else checks.function(f"{what}: derivatives", derivatives, "of (t, q, v, z) that returns six matrices")
        )
        self.scale = checks.number(f"{what}: scale", scale, 0.0, above=True)

    def check(self, scene: Declared) -> None:
        """The functions can be called, return what they should, and do not remember their calls."""
        self._model = model = scene.model
        if self.rate is None:
            return
        q, v = pin.neutral(model), np.linspace(0.1, 0.2, model.nv)
        self.values(0.0, q, v, self.start)
        self.slopes(0.0, q, v, self.start)
        for what, function in (("rate", self.rate), ("force", self.force)):
            if function is not None:
                check_pure(f"state {self.name!r}: {what}", function, 0.0, q, v, self.start)

    def __getstate__(self) -> dict[str, object]:
        return without_model(self)

    def values(self, t: float, q: np.ndarray, v: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The rate, shape (n,), and the force, shape (nv,), at a motion.

        Raises:
            SceneError: a function fails or gives something else.
        """
        what, nv = f"state {self.name!r}", self._model.nv
        if self.rate is None:
            return np.zeros(self.n), np.zeros(nv)
        given = called(f"{what}: rate", self.rate, t, q, v, z.copy())
        rate = array_of(f"{what}: rate", given, t, (self.n,), q, v)
        if self.force is None:
            return rate, np.zeros(nv)
        force = called(f"{what}: force", self.force, t, q, v, z.copy())
        return rate, array_of(f"{what}: force", force, t, (nv,), q, v)

    def slopes(
        self, t: float, q: np.ndarray, v: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of rate and force, one below the other, by q, v and z, shapes (n + nv, nv) twice and (n + nv, n).

        Raises:
            SceneError: the derivatives have other shapes.
        """
        nv, n = self._model.nv, self.n
        if self.derivatives is not None:
            what = f"state {self.name!r}: derivatives"
            given = called(what, self.derivatives, t, q, v, z.copy())
            if not isinstance(given, (tuple, list)) or len(given) != 6:
                raise SceneError(f"{what}: got {checks.shown(given)}; expected six matrices")
            shapes = [(rows, columns) for rows in (n, nv) for columns in (nv, nv, n)]
            parts = [checks.array(what, np.reshape(x, s), s) for x, s in zip(given, shapes, strict=True)]
            by_q, by_v, by_z = (np.vstack((parts[i], parts[i + 3])) for i in range(3))
            return by_q, by_v, by_z

        def along(e: np.ndarray, kind: int, h: float) -> np.ndarray:
            def at(s: float) -> np.ndarray:
                moved = pin.integrate(self._model, q, s * e) if kind == 0 else q
                return np.concatenate(
                    self.values(t, moved, v + s * e if kind == 1 else v, z + s * e if kind == 2 else z)
                )

            return (at(h) - at(-h)) / (2 * h)

        sizes = (nv, DIFFERENCE), (nv, DIFFERENCE), (n, DIFFERENCE * self.scale)
        by_q, by_v, by_z = (
            np.array([along(e, kind, h) for e in np.eye(size)]).reshape(size, n + nv).T
            for kind, (size, h) in enumerate(sizes)
        )
        return by_q, by_v, by_z
