"""Many runs of one scene in this process, on threads of the compiled engine."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.simulation.inputs import checked_scene
from ngalpha_pin.simulation.simulate import simulate
from ngalpha_pin.system.state import State

S = TypeVar("S")
T = TypeVar("T")


def simulate_many(
    scene: Scene,
    q0: np.ndarray | Sequence[Sequence[float]] | None = None,
    v0: np.ndarray | Sequence[Sequence[float]] | None = None,
    *,
    states: Sequence[State] | None = None,
    mu: Any = None,
    e_N: Any = None,
    e_F: Any = None,
    mass: Mapping[str, Any] | None = None,
    kp: Any = None,
    kd: Any = None,
    forces: Sequence[Any] | None = None,
    threads: int | None = None,
    on_failure: str = "stop",
    **options: Any,
) -> list[Trajectory]:
    """Run a scene many times in this process, each time with other initial values or parameters; see `simulate`.

    Every run has the bits that it has alone. Steps in which nothing happens run side by side; impacts, and shapes other
    than points, spend their time in Python, where threads take turns: for those, `sweep` has processes.

    Args:
        scene: what to simulate; it is not changed.
        q0: initial configurations, shape (n, nq), or (nq,) of all runs.
        v0: initial velocities, shape (n, nv) or (nv,); None is rest.
        states: states to continue from instead, one of each run.
        mu: friction coefficient of all contacts: a number, or one of each run, shape (n,); or a mapping of names and
            patterns of geometries to either [-].
        e_N: likewise [-].
        e_F: likewise [-].
        mass: by name of a body or joint: a number, or shape (n,); see `Scene.varied` [kg].
        kp: stiffness of every `JointPD`: a number, shape (n,), or (n, nv).
        kd: damping, likewise.
        forces: of each run, a force such as `Control`, several in a list, or None, in addition to those of the scene.
        threads: how many; None is one for each core.
        on_failure: "stop" returns the runs that ended early as far as they went; "raise" raises the first error.
        **options: of `simulate`: t_end, and dt or rtol, method, ...

    Returns:
        The trajectories, in order.

    Raises:
        SceneError: nothing says how many runs there are, lengths differ, or an input cannot be used.
    """
    checked_scene(scene)
    for name in ("progress", "save_to", "state"):
        if name in options:
            raise SceneError(f"simulate_many has no {name}" + ("; give states" if name == "state" else ""))
    model = scene.model
    beams = sum(beam.nv for beam in scene.beams.values())
    runs = _Runs()
    starts = [
        runs.each("q0", q0, model.nq + beams),
        runs.each("v0", v0, model.nv + beams),
        runs.listed("states", states),
    ]
    parameters = {name: runs.numbers(name, value) for name, value in (("mu", mu), ("e_N", e_N), ("e_F", e_F))}
    parameters |= {"mass": runs.numbers("mass", mass)}
    parameters |= {name: runs.gains(name, gain, model.nv) for name, gain in (("kp", kp), ("kd", kd))}
    added = runs.listed("forces", forces)

    def run(i: int) -> Trajectory:
        own = {name: of(i) for name, of in parameters.items() if of is not None}
        several = added(i) if added is not None and added(i) is not None else ()
        varied = scene.varied(**own, forces=several if isinstance(several, (list, tuple)) else (several,))
        at: dict[str, Any] = {n: of(i) for n, of in zip(("q0", "v0", "state"), starts, strict=True) if of is not None}
        return simulate(varied, **at, on_failure=on_failure, **options)

    return in_threads(run, range(runs.count), threads)


def in_threads(function: Callable[[S], T], items: Sequence[S], threads: int | None = None) -> list[T]:
    """Results of a function of each item, computed on threads; the first error ends what has not begun."""
    n = min(checks.integer("threads", threads, 1) if threads is not None else checks.cores(), len(items))
    if n <= 1:
        return [function(item) for item in items]
    pool = ThreadPoolExecutor(n, "ngalpha-pin run")
    try:
        return list(pool.map(function, items))
    finally:
        pool.shutdown(cancel_futures=True)


class _Runs:
    """How many runs there are: what is given for each of them says it."""

    def __init__(self) -> None:
        self._said: tuple[str, int] | None = None

    @property
    def count(self) -> int:
        if self._said is None:
            raise SceneError(
                "simulate_many: nothing is given for each run; give q0 of shape (n, nq), or a value of a parameter for "
                "each of them"
            )
        return self._said[1]

    def _says(self, name: str, n: int) -> None:
        if self._said is not None and self._said[1] != n:
            raise SceneError(f"{name} is given for {n} runs, {self._said[0]} for {self._said[1]}")
        if n == 0:
            raise SceneError(f"{name} is given for no run")
        self._said = name, n

    def each(self, name: str, value: Any, n: int) -> Callable[[int], np.ndarray] | None:
        """Vectors of length n: of each run, or of all."""
        if value is None:
            return None
        if np.ndim(value) == 1:
            shared = checks.array(name, value, (n,))
            return lambda i: shared
        array = checks.array(name, value, (None, n))
        self._says(name, len(array))
        return lambda i: array[i]

    def listed(self, name: str, value: Any) -> Callable[[int], Any] | None:
        """Anything, one of each run."""
        if value is None:
            return None
        values = list(checks.instance(name, value, (list, tuple), "a list with an entry for each run"))
        self._says(name, len(values))
        return lambda i: values[i]

    def numbers(self, name: str, value: Any) -> Callable[[int], Any] | None:
        """A number, or one of each run; or a mapping to such."""
        if value is None:
            return None
        if isinstance(value, Mapping):
            parts = {key: self.numbers(f"{name}[{key}]", part) for key, part in value.items()}
            return lambda i: {key: of(i) for key, of in parts.items() if of is not None}
        if checks.dimensions(name, value) == 0:
            return lambda i: value
        array = checks.array(name, value, (None,))
        self._says(name, len(array))
        return lambda i: float(array[i])

    def gains(self, name: str, value: Any, nv: int) -> Callable[[int], Any] | None:
        """As `numbers`, or vectors of each run."""
        if isinstance(value, Mapping) or checks.dimensions(name, value) != 2:
            return self.numbers(name, value)
        array = checks.array(name, value, (None, nv))
        self._says(name, len(array))
        return lambda i: array[i]
