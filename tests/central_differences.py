"""Central differences of whole runs, at two steps that have to agree with each other."""

import numpy as np

import ngalpha_pin as nga
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.sensitivities.configuration import Geometry
from ngalpha_pin.sensitivities.parameters import parameters_of, scene_with
from ngalpha_pin.sensitivities.start import held_to
from ngalpha_pin.system.system import System

EXACT = nga.GeneralizedAlpha(tol=1e-12)


def last(run):
    return run.q[-1], run.v[-1]


def difference(system, plus, minus, h):
    return np.concatenate((system.difference(minus[0], plus[0]), plus[1] - minus[1])) / (2 * h)


def by_parameters(scene, q0, v0, names, along, h, **how):
    """Derivatives of the end along directions of the parameters, shape (p, r): shape (2 nv, r)."""
    found, system = parameters_of(scene, names), System(scene)
    values, columns = np.concatenate([p.values for p in found]), []
    for direction in along.T:
        ends = [
            last(nga.simulate(scene_with(scene, found, values + s * h * direction), q0, v0, **how)) for s in (1, -1)
        ]
        columns.append(difference(system, *ends, h))
    return np.array(columns).T


def by_start(scene, q0, v0, dq, dv, h, **how):
    """Derivatives of the end along directions of the start, shape (2 nv, r)."""
    system, columns = System(scene), []
    for x, y in zip(dq.T, dv.T, strict=True):
        ends = []
        for s in (h, -h):
            q, v = system.integrate(q0, s * x), v0 + s * y
            if scene.constraints:
                there = nga.assemble(scene, q, v)
                q, v = there.q, there.v
            ends.append(last(nga.simulate(scene, q, v, **how)))
        columns.append(difference(system, *ends, h))
    return np.array(columns).T


def agreed(function, tolerance, steps=(1e-5, 1e-6)):
    """Differences at two steps; they have to agree to half of a tolerance, in parts of the largest."""
    coarse, fine = (function(h) for h in steps)
    size = max(1.0, np.abs(fine).max())
    assert np.abs(coarse - fine).max() <= 0.5 * tolerance * size, np.abs(coarse - fine).max() / size
    return fine, tolerance * size


def random_directions(scene, q0, v0, count, seed=0, only_v=False):
    """Directions of the start that keep constraints and contacts that rest."""
    system, rng = System(scene), np.random.default_rng(seed)
    dq, dv = rng.normal(size=(2, system.nv, count))
    dq = np.zeros_like(dq) if only_v else dq
    return held_to(Geometry(system), initial_state(system, q0, v0), dq, dv)


def end(run):
    return np.concatenate((run.derivatives.q[-1], run.derivatives.v[-1]))
