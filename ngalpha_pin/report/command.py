"""What `ngalpha-pin report` does with its options."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ngalpha_pin.errors import SceneError
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.scene.scene import Scene

from .bounded import worked
from .cases import Case, check_sizes, chosen_cases, known_cases, own_case
from .recorded import compared_with
from .write import audit_page, report

Loader = Callable[[], tuple[Scene, np.ndarray, np.ndarray]]
"""Builds a target: a scene, q0 and v0."""
CHANGES = ("floating", "ground", "height", "mu", "q0", "v0")
OWN_END = 0.5  # of a run of a scene of the user's own [s]


def run(args: argparse.Namespace, load: Loader | None) -> int:
    """Write the report; exit code 0, or 130 where it was interrupted.

    Args:
        args: options of the command line.
        load: builds the target, or None where there is none.
    """
    if args.audit is not None:
        return _audit(args, load)
    if args.repeat < 1:
        raise SceneError("--repeat must be at least 1")
    for rho in args.rho_inf:
        GeneralizedAlpha(rho_inf=rho)  # says what is wrong with it
    begin = worked()
    cases = _cases(args, load)
    loading = worked() - begin
    if args.compare is not None:
        if len(cases) != 1 or load is None:
            raise SceneError("--compare needs the scene that was recorded: ngalpha-pin report TARGET --compare FILE")
        cases = [compared_with(replace(cases[0], t_end=np.inf), args.compare)]
    cases = [_changed(case, args) for case in cases]
    complete = report(cases, args.out, args.rho_inf, args.repeat, args.quick, loading=loading)
    print(f"wrote {args.out / 'report.html'}")
    if not complete:
        print("ngalpha-pin: interrupted; what there was has been written", file=sys.stderr)
    return 0 if complete else 130


def _cases(args: argparse.Namespace, load: Loader | None) -> list[Case]:
    if load is None:
        return list(known_cases().values())
    plain = all(getattr(args, name) in (None, False) for name in CHANGES)
    found = chosen_cases(args.target) if plain else []
    name = Path(args.target).stem if Path(args.target).is_file() else args.target
    return found or [own_case(name, load(), OWN_END)]


def _changed(case: Case, args: argparse.Namespace) -> Case:
    """The case with the end and the steps of the options."""
    if args.t_end is not None:
        if not args.t_end > 0:
            raise SceneError(f"--t-end {args.t_end} must be positive")
        inside = case.smooth is None or case.smooth[1] <= args.t_end
        case = replace(case, t_end=args.t_end, smooth=case.smooth if inside else None)
    sizes = check_sizes(case.sizes if args.dt is None else args.dt)
    if case.t_end < 2 * sizes[0]:
        raise SceneError(f"the largest dt = {sizes[0]:g} s does not go into a run of {case.t_end:g} s twice")
    return replace(case, sizes=sizes)


def _audit(args: argparse.Namespace, load: Loader | None) -> int:
    trajectory = Trajectory.load(args.audit)
    if load is not None:
        scene = load()[0]
        if scene.model.nq != trajectory.q.shape[1]:
            raise SceneError(f"{args.target} has nq = {scene.model.nq}, {args.audit} has {trajectory.q.shape[1]}")
        trajectory = replace(trajectory, scene=scene)
    print(f"wrote {audit_page(trajectory, args.out)}")
    return 0
