"""What `ngalpha-pin sweep` does: runs a target over a grid of parameters, prints and writes what became of each run."""

from __future__ import annotations

import argparse
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from ngalpha_pin.cli import targets
from ngalpha_pin.common import checks
from ngalpha_pin.common.files import replacing
from ngalpha_pin.common.optional import require
from ngalpha_pin.errors import Interrupted, SceneError
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.simulation.simulate import simulate
from ngalpha_pin.simulation.sweeps.dataset import INSTALL
from ngalpha_pin.simulation.sweeps.sweep import sweep

OF_RUNS = ("t_end", "dt", "rho_inf")
OF_CONTACTS = ("mu", "e_N", "e_F")
SHOWN = 10  # failed runs that are printed


def run(args: argparse.Namespace, defaults: dict[str, float]) -> int:
    """Run the sweep; exit code 0, 1 where a run failed, 130 where it was interrupted.

    Args:
        args: options of the command line.
        defaults: t_end, dt and rho_inf of the target.
    """
    grid: dict[str, Any] = dict(_parameter(text) for text in args.grid)
    _check_names(args.target, list(grid))
    options = (*targets.Options._fields, "t_end", "dt")
    given = {name: x for name in options if (x := getattr(args, name)) is not None}
    twice = [name for name in given if name in grid]
    if twice:
        raise SceneError(f"--{twice[0].replace('_', '-')} and --grid {twice[0]}=... both say it; give one of them")
    target = str(Path(args.target).resolve()) if Path(args.target).is_file() else args.target
    fixed: dict[str, Any] = {"target": target, **{n: x for n, x in (defaults | given).items() if n not in grid}}
    table = args.out is not None and args.out.suffix == ".csv"
    save_to = None if table else args.out
    stopped = False
    with _executor(args) as executor:
        try:
            results = sweep(cell, executor=executor, save_to=save_to, **(fixed | grid))
        except Interrupted as error:
            results, stopped = error.results, True
    if table:
        with replacing(args.out) as beside:
            flat = results.drop_dims(set(results.dims) - set(results["error"].dims))
            flat.drop_vars(list(fixed)).to_dataframe().to_csv(beside)
    failed = _print(results)
    if args.out is not None:
        print(f"wrote {args.out}")
    if stopped:
        print("ngalpha-pin: interrupted; the same command goes on from a file .nc", file=sys.stderr)
        return 130
    return int(failed > 0)


def cell(target: str, t_end: float, dt: float, rho_inf: float, **parameters: Any) -> Any:
    """A run of a target, and what is said of it: the end of the motion and the lines of the audit that are one number.

    Args:
        target: see `targets.load`.
        t_end: end of the run [s].
        dt: step [s].
        rho_inf: parameter of the generalized-alpha method [-].
        **parameters: of the target, of its contacts, and options of the command line.
    """
    known = targets.parameters_of(target)
    own = {name: x for name, x in parameters.items() if name in known}
    laws = {name: x for name, x in parameters.items() if name in OF_CONTACTS}
    options = {n: x for n, x in parameters.items() if n in targets.Options._fields and n not in (*own, *laws)}
    scene, q0, v0 = targets.load(target, targets.Options(**options), own)
    scene = scene.varied(**laws)
    trajectory = simulate(scene, q0, v0, t_end=t_end, dt=dt, method=GeneralizedAlpha(rho_inf=rho_inf))
    last, audit = trajectory.to_xarray().isel(time=-1, drop=True), trajectory.audit()
    force = trajectory.la_N.max() if trajectory.la_N.size else 0.0
    energy = trajectory.energy.total
    return last[["q", "v"]].assign(
        audit=audit.ok,
        penetration=((), float(audit.penetration), {"units": "m", "long_name": "deepest penetration"}),
        largest_force=((), float(force), {"units": "N", "long_name": "largest normal force of a contact"}),
        impacts=((), len(trajectory.impacts.t), {"long_name": "impacts that were located"}),
        energy=((), float(energy[-1]), {"units": "J", "long_name": "energy at the end"}),
    )


def _parameter(text: str) -> tuple[str, list[Any]]:
    """`mu=0.1:1:10` are ten numbers from 0.1 to 1, `mu=0.1,0.5` two, `name=left,right` two texts."""
    name, _, values = text.partition("=")
    if not name.isidentifier() or not values:
        raise SceneError(f"--grid {text}: expected NAME=FIRST:LAST:NUMBER or NAME=VALUE,VALUE,...")
    if values.count(":") == 2:
        try:
            first, last, n = values.split(":")
            return name, np.linspace(float(first), float(last), checks.integer("NUMBER", int(n), 1)).tolist()
        except ValueError as error:
            raise SceneError(f"--grid {text}: expected two numbers and how many, as in mu=0.1:1:10") from error
    words = values.split(",")
    try:
        return name, [float(word) for word in words]
    except ValueError:
        return name, words


def _check_names(target: str, given: list[str]) -> None:
    known = list(dict.fromkeys((*OF_RUNS, *OF_CONTACTS, "height", *targets.parameters_of(target))))
    for name in given:
        if name not in known:
            others = ", ".join(known)
            raise SceneError(f"--grid {name}=...: {target} has no parameter {name!r}; known: {others}")


def _executor(args: argparse.Namespace) -> Any:
    """The executor of the options, as a context."""
    if args.scheduler is None:
        return nullcontext(args.processes)
    if args.processes is not None:
        raise SceneError("--scheduler and --processes both say where the runs are made; give one of them")
    distributed = require("dask.distributed", "--scheduler", INSTALL)
    return _Cluster(distributed.Client(args.scheduler))


class _Cluster:
    """The executor of a cluster, left as it was found."""

    def __init__(self, client: Any):
        self._client = client

    def __enter__(self) -> Any:
        return self._client.get_executor()

    def __exit__(self, *error: object) -> None:
        self._client.close()


def _print(results: Any) -> int:
    """A line for each run that failed, and how many there are of either; the number of failed ones."""
    errors = results["error"]
    failed = [(where, word) for where, word in np.ndenumerate(errors.values) if word]
    for where, word in failed[:SHOWN]:
        at = (f"{name}={results[name].values[i]}" for name, i in zip(errors.dims, where, strict=True))
        print(f"{' '.join(map(str, at))}: {word}")
    if len(failed) > SHOWN:
        print(f"and {len(failed) - SHOWN} more")
    took = float(results["seconds"].sum())
    print(f"{errors.size} runs, {len(failed)} without a result; {took:.1f} s of computing")
    return len(failed)
