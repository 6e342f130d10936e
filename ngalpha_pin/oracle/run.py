"""A whole motion, one step after the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ngalpha_pin.oracle.equations import Parameters, State
from ngalpha_pin.oracle.impact import consistent
from ngalpha_pin.oracle.kinematics import movable
from ngalpha_pin.oracle.laws import LAWS, SECOND_ORDER
from ngalpha_pin.oracle.problem import NotConverged, Problem, Scene, SceneError, compile_scene
from ngalpha_pin.oracle.steps import solve_step


@dataclass(frozen=True, eq=False)
class Run:
    """A motion as arrays, time along the first axis.

    Attributes:
        t, q, v, a: shapes (n + 1,), (n + 1, nq), (n + 1, nv), (n + 1, nv).
        P_N, La_N, la_N: of all contacts, shape (n + 1, n_N) [N s], [N s], [N].
        P_F, La_F, la_F: of all friction velocities, contact by contact, shape (n + 1, n_F).
        n_iter: corrections and sweeps of every step, shape (n + 1,).
        states: the states themselves.
    """

    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    P_N: np.ndarray
    La_N: np.ndarray
    la_N: np.ndarray
    P_F: np.ndarray
    La_F: np.ndarray
    la_F: np.ndarray
    n_iter: np.ndarray
    states: tuple[State, ...]


def simulate(
    scene: Scene | Problem,
    q0: np.ndarray | None = None,
    v0: np.ndarray | None = None,
    *,
    t_end: float,
    dt: float,
    rho_inf: float = 0.5,
    laws: str = SECOND_ORDER,
    state: State | None = None,
) -> Run:
    """Integrate a scene from its initial values, or from a state, with fixed steps.

    Args:
        scene: with nothing but what the systems of the paper have, or its `problem_of`.
        q0: initial configuration, shape (nq,); it has to fulfil the constraints, and no contact may penetrate.
        v0: initial velocity, shape (nv,); None is rest.
        t_end: end of the run [s]; the last step ends at the nearest multiple of dt.
        dt: step [s].
        rho_inf: spectral radius at infinite frequency (72), in [0, 1] [-].
        laws: "second-order" or "paper".
        state: start from here instead of q0 and v0.

    Raises:
        SceneError: the scene has something else, or an initial value or option cannot be used.
        NotConverged: a step was not solved.
    """
    if laws not in LAWS:
        raise SceneError(f"laws {laws!r} are unknown; choose one of {', '.join(LAWS)}")
    if not 0.0 <= rho_inf <= 1.0:
        raise SceneError(f"rho_inf = {rho_inf} must be in [0, 1]")
    if not (np.isfinite(dt) and dt > 0.0):
        raise SceneError(f"dt = {dt} must be a positive number of seconds")
    p = scene if isinstance(scene, Problem) else problem_of(scene)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # iterates that run away are recognised
        states = [_start(p, q0, v0) if state is None else state]
        n_iter, parameters = [0], Parameters(rho_inf, laws)
        for _ in range(round((t_end - states[0].t) / dt)):
            solved = solve_step(p, parameters, states[-1], dt)
            if solved is None:
                raise NotConverged(
                    f"the step from t = {states[-1].t:.6g} s of dt = {dt:.3g} s did not converge; try a smaller dt",
                    states[-1].t,
                    tuple(contact.name for contact in p.contacts),
                )
            states.append(solved.state)
            n_iter.append(solved.n_iter)
    names = ("t", "q", "v", "a", "P_N", "La_N", "la_N", "P_F", "La_F", "la_F")
    arrays = {name: np.array([getattr(s, name) for s in states]) for name in names}
    return Run(**arrays, n_iter=np.array(n_iter), states=tuple(states))


def problem_of(scene: Scene) -> Problem:
    """The problem of a scene, without the rows that no motion changes.

    Raises:
        SceneError: the scene has something that the systems of the paper have not.
    """
    return movable(compile_scene(scene))


def _start(p: Problem, q0: np.ndarray | None, v0: np.ndarray | None) -> State:
    """Consistent state at t = 0."""
    q = np.array([] if q0 is None else q0, dtype=float)
    v = np.zeros(p.nv) if v0 is None else np.array(v0, dtype=float)
    for name, x, n in (("q0", q, p.nq), ("v0", v, p.nv)):
        if x.shape != (n,) or not np.isfinite(x).all():
            raise SceneError(f"{name} has shape {x.shape}, it must be finite with shape ({n},)")
    return consistent(p, 0.0, q, v)
