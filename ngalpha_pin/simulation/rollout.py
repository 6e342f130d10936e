"""A run as a function for optimisers: of the forces in its steps and of parameters, with its derivatives both ways."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.errors import SceneError
from ngalpha_pin.initialization.initial import checked_values, initial_state
from ngalpha_pin.integrators.method import Method
from ngalpha_pin.scene.breakpoints import declared
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.sensitivities.differentiated import NOTHING
from ngalpha_pin.sensitivities.parameters import columns_of, parameters_of, scene_with
from ngalpha_pin.sensitivities.start import check_differentiable
from ngalpha_pin.sensitivities.step_maps import StepMap, Taken, start_map, step_map, take
from ngalpha_pin.sensitivities.steps import Steps
from ngalpha_pin.simulation.inputs import checked_dt, checked_method, checked_scene
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System

MOVES = 1e-6  # of the differences of residuals, in parts of the size of the motion


class Rolled(NamedTuple):
    """A run.

    Attributes:
        t: times, shape (n + 1,) [s].
        q: configurations, shape (n + 1, nq).
        v: velocities, shape (n + 1, nv).
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray


class Jacobian(NamedTuple):
    """Derivatives of a run.

    Attributes:
        q: of the configurations, in their tangent spaces, shape (n + 1, nv, c).
        v: of the velocities, shape (n + 1, nv, c).
        names: of the columns.
    """

    q: np.ndarray
    v: np.ndarray
    names: tuple[str, ...]


class Gradient(NamedTuple):
    """Derivatives of one number that depends on a run.

    Attributes:
        u: by the forces, shape (n, nv of the tree), or (0, nv) where none were given.
        p: by the parameters, shape (p,).
        q0: by the initial configuration, in its tangent space, shape (nv,).
        v0: by the initial velocity, shape (nv,).
    """

    u: np.ndarray
    p: np.ndarray
    q0: np.ndarray
    v0: np.ndarray


class _Run(NamedTuple):
    u: np.ndarray
    p: np.ndarray
    system: System
    steps: list[Taken]
    rolled: Rolled


class Rollout:
    """A run of n steps as a function of the forces in them and of parameters, for optimisers.

    The last run is kept, so that its derivatives cost no second one. A step is a linear map of what the method
    remembers; derivatives forward are products of these maps from the left, gradients from the right.

    Args:
        scene: what moves; it is not changed.
        q0: initial configuration, shape (nq,).
        v0: initial velocity, shape (nv,); None is rest.
        dt: step [s].
        n: number of steps.
        parameters: names, see `Sensitivities`.
        method: by default `GeneralizedAlpha()`.

    Attributes:
        names: of the parameters' columns.
        values: their values in the scene, shape (p,).

    Raises:
        SceneError: the scene has no derivatives, or an input cannot be used.
    """

    def __init__(
        self,
        scene: Scene,
        q0: np.ndarray,
        v0: np.ndarray | None,
        dt: float,
        n: int,
        parameters: Sequence[str] = (),
        method: Method | None = None,
    ):
        system = System(checked_scene(scene))
        self._scene, self.dt, self.n = scene, checked_dt(dt), checks.integer("n", n, 1)
        self._method = check_differentiable(system, checked_method(method))
        self._q0, self._v0 = checked_values(system, q0, v0)
        self._parameters = parameters_of(scene, parameters)
        if len(declared(scene)):
            raise SceneError("a Rollout has steps of one length: what is given in its scene must not have breakpoints")
        self.names = tuple(label for parameter in self._parameters for label in parameter.labels)
        self.values = np.concatenate([np.zeros(0), *(parameter.values for parameter in self._parameters)])
        self._run: _Run | None = None
        self._maps: tuple[_Run, np.ndarray, list[StepMap]] | None = None

    def __repr__(self) -> str:
        return f"Rollout({self._scene.model.name!r}, {self.n} steps of {self.dt:g} s by {', '.join(self.names) or 'u'})"

    def __call__(self, u: np.ndarray | None = None, p: np.ndarray | None = None) -> Rolled:
        """The run.

        Args:
            u: generalized force on the tree that is held in each step, shape (n, nv of the model) [N or N m]; None is
                none.
            p: values of the parameters, shape (p,); None are those of the scene.

        Raises:
            SceneError: a wrong shape. NotConverged: a step has no solution.
        """
        return self._taken(u, p).rolled

    @property
    def status(self) -> tuple[str, ...]:
        """Of the derivative of each step of the last run that was differentiated, see `Status`."""
        return () if self._maps is None else tuple(step.report.status.value for step in self._maps[2])

    def jac(self, u: np.ndarray | None = None, p: np.ndarray | None = None, of: Sequence[str] = ("p",)) -> Jacobian:
        """Derivatives of the run, forward.

        Args:
            u: as for a call.
            p: as for a call.
            of: by what, of "p" (parameters), "u" (forces, step by step), "q0" and "v0", in this order of columns.
        """
        for name in of:
            checks.choice("of", name, ("p", "u", "q0", "v0"))
        run, start, maps = self._differentiated(u, p)
        nv, m = run.system.nv, run.u.shape[1]
        widths = {"p": len(self.names), "u": len(run.u) * m, "q0": nv, "v0": nv}
        ends = np.cumsum([0, *(widths[name] for name in of)])
        at = {name: slice(int(a), int(b)) for name, a, b in zip(of, ends[:-1], ends[1:], strict=True)}
        S = np.zeros((len(start), int(ends[-1])))
        for name, columns in (("q0", start[:, :nv]), ("v0", start[:, nv : 2 * nv]), ("p", start[:, 2 * nv :])):
            if name in at:
                S[:, at[name]] = columns
        q, v = [S[:nv]], [S[nv : 2 * nv]]
        for i, step in enumerate(maps):
            S = step.A @ S
            if "p" in at:
                S[:, at["p"]] += step.P
            if "u" in at and m:
                first = at["u"].start + i * m
                S[:, first : first + m] += step.B
            q.append(S[:nv])
            v.append(S[nv : 2 * nv])
        names = {
            "p": self.names,
            "u": tuple(f"u[{i}, {j}]" for i in range(len(run.u)) for j in range(m)),
            "q0": tuple(f"q0[{i}]" for i in range(nv)),
            "v0": tuple(f"v0[{i}]" for i in range(nv)),
        }
        return Jacobian(np.array(q), np.array(v), tuple(label for name in of for label in names[name]))

    def vjp(self, u: np.ndarray | None, p: np.ndarray | None, gq: np.ndarray, gv: np.ndarray) -> Gradient:
        """The gradient of a number by everything, backward: the sum of gq dq and gv dv over all times.

        Args:
            u: as for a call.
            p: as for a call.
            gq: derivatives of the number by the configurations, in their tangent spaces, shape (n + 1, nv).
            gv: by the velocities, shape (n + 1, nv).
        """
        run, start, maps = self._differentiated(u, p)
        nv = run.system.nv
        gq, gv = checks.array("gq", gq, (self.n + 1, nv)), checks.array("gv", gv, (self.n + 1, nv))
        by_u, by_p = np.zeros_like(run.u), np.zeros(len(self.names))
        back = np.zeros(len(maps[-1].A))
        for i in reversed(range(len(maps))):
            back[:nv] += gq[i + 1]
            back[nv : 2 * nv] += gv[i + 1]
            if len(by_u):
                by_u[i] = maps[i].B.T @ back
            by_p += maps[i].P.T @ back
            back = maps[i].A.T @ back
        back[:nv] += gq[0]
        back[nv : 2 * nv] += gv[0]
        first = start.T @ back
        return Gradient(by_u, by_p + first[2 * nv :], first[:nv], first[nv : 2 * nv])

    def jac_of(
        self, residual: Callable[[Rolled], np.ndarray], u: np.ndarray | None = None
    ) -> Callable[[np.ndarray], np.ndarray]:
        """The Jacobian by the parameters of a residual, for `scipy.optimize.least_squares`.

        Args:
            residual: of a run, returns shape (m,); it is differentiated along the motions of the run, without runs.
            u: forces, as for a call.

        Returns:
            A function of p, shape (p,), that returns shape (m, p). It warns of parameters that the run does not feel,
            as mu where nothing slips: an optimiser leaves them where they are.
        """

        def jacobian(p: np.ndarray) -> np.ndarray:
            found, run = self.jac(u, p), self._taken(u, p)
            sizes = np.maximum(np.abs(found.q).max(axis=(0, 1)), np.abs(found.v).max(axis=(0, 1)))
            _warn_of_unfelt(self.names, sizes)
            columns = []
            for j in range(len(self.names)):
                dq, dv = found.q[:, :, j], found.v[:, :, j]
                h = MOVES / max(float(sizes[j]), TINY)
                plus, minus = (np.asarray(residual(_moved(run, s * dq, s * dv)), dtype=float) for s in (h, -h))
                columns.append((plus - minus) / (2.0 * h))
            return np.array(columns).T

        return jacobian

    def _taken(self, u: np.ndarray | None, p: np.ndarray | None) -> _Run:
        """The run with these forces and parameters, the last one where they are the same."""
        m = self._scene.model.nv
        forces = np.zeros((0, m)) if u is None else checks.array("u", u, (self.n, m))
        values = self.values if p is None else checks.array("p", p, (len(self.names),))
        known = self._run
        if known is not None and np.array_equal(known.u, forces) and np.array_equal(known.p, values):
            return known
        system = System(self._scene if p is None else scene_with(self._scene, self._parameters, values))
        system.plain = False  # steps of the engine alone do not say what they are made of
        state = initial_state(system, self._q0, self._v0)
        steps: list[Taken] = []
        states: list[State] = [state]
        for i in range(self.n):
            steps.append(take(self._method, system, state, self.dt, forces[i] if len(forces) else None))
            state = steps[-1].result.state
            states.append(state)
        t, q, v = (np.array([getattr(state, name) for state in states]) for name in ("t", "q", "v"))
        self._run = _Run(forces.copy(), values.copy(), system, steps, Rolled(t, q, v))
        return self._run

    def _differentiated(self, u: np.ndarray | None, p: np.ndarray | None) -> tuple[_Run, np.ndarray, list[StepMap]]:
        """The run with the maps of its start and of its steps."""
        run = self._taken(u, p)
        if self._maps is not None and self._maps[0] is run:
            return self._maps
        system, torques = run.system, run.u.shape[1] if len(run.u) else 0
        found = parameters_of(system.scene, [parameter.name for parameter in self._parameters])
        columns = columns_of(system, system.scene, found, torques, torques + len(self.names), 0)
        steps = Steps(system, self._method.parameters, columns)
        start = start_map(steps, columns, run.steps[0].start, torques)
        self._maps = run, start, [step_map(steps, columns, taken, torques) for taken in run.steps]
        return self._maps


def _warn_of_unfelt(names: Sequence[str], sizes: np.ndarray) -> None:
    unfelt = [name for name, size in zip(names, sizes, strict=True) if size <= NOTHING * sizes.max()]
    if unfelt:
        warnings.warn(
            f"the run does not depend on {', '.join(unfelt)}, so that a fit leaves it where it is: start from another "
            "value (a contact that sticks does not feel mu), or take another motion",
            stacklevel=3,
        )


def _moved(run: _Run, dq: np.ndarray, dv: np.ndarray) -> Rolled:
    """A run beside another one."""
    rolled = run.rolled
    q = np.array([run.system.integrate(at, way) for at, way in zip(rolled.q, dq, strict=True)])
    return Rolled(rolled.t, q, rolled.v + dv)
