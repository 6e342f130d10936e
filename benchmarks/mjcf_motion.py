"""Smooth motion of MJCF files without contact: runs with rtol against MuJoCo's Runge-Kutta steps, one row per file.

Run with `python benchmarks/mjcf_motion.py`: 1 s, steps of 1e-5 s in MuJoCo, rtol = 1e-11 here. Contacts, limits, dry
friction and equalities are left out on both sides. `away` is the largest difference of a coordinate at the end; the
columns behind it say whose error it is: how far MuJoCo is from itself at twice the step, how far this package is from
itself at ten times the tolerance, and what is left of `away` where both steps of MuJoCo are extrapolated to none. Where
balls and free bodies turn, these steps are of order 2: a sum of angular velocities is no turn of order 4.
"""

from __future__ import annotations

import argparse
import importlib.util
import warnings
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from tables import add_table_option

import ngalpha_pin as nga
from ngalpha_pin.scene.mjcf.compiler import compiled

OWN = Path(__file__).parents[1] / "tests" / "scene" / "mjcf"
FILES = ["springs", "pose_springs", "free_bodies", "joints_in_a_row", "fixed_bodies", "defaults", "tendons", "moon"]
FILES += ["shapes"]
OF_GYMNASIUM = ["half_cheetah", "walker2d", "hopper", "reacher"]
T_END, DT, RTOL = 1.0, 1e-5, 1e-11
COLUMNS = "| file | nv | away | MuJoCo, 2 dt | ours, 10 rtol | extrapolated |", "|" + " --- |" * 6


def reference(path: Path, model: pin.Model, q: np.ndarray, v: np.ndarray, t_end: float, dt: float) -> np.ndarray:
    """The configuration of MuJoCo at the end, shape (nq,)."""
    m, _ = compiled(path)
    off = mujoco.mjtDisableBit
    m.opt.disableflags |= off.mjDSBL_CONSTRAINT | off.mjDSBL_CONTACT
    m.opt.timestep, m.opt.integrator = dt, mujoco.mjtIntegrator.mjINT_RK4
    d = mujoco.MjData(m)
    d.qpos[:], d.qvel[:] = nga.q_to_mujoco(model, q), nga.v_to_mujoco(model, q, v)
    for _ in range(round(t_end / dt)):
        mujoco.mj_step(m, d)
    return nga.q_from_mujoco(model, d.qpos)


def own(path: Path, t_end: float, rtol: float, seed: int) -> tuple[pin.Model, np.ndarray, np.ndarray, np.ndarray]:
    """The model, q0, v0 and the configuration of this package at the end."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is left out acts on neither side
        scene = nga.Scene.from_mjcf(path, constraints=False)
    scene.contacts.clear()
    scene.unilaterals.clear()
    scene.joints = nga.JointLaws(limits=False, friction=False)
    q, v = scene.reference("qpos0"), np.random.default_rng(seed).normal(size=scene.model.nv)
    return scene.model, q, v, nga.simulate(scene, q, v, t_end=t_end, rtol=rtol, atol=rtol).q[-1]


def distance(model: pin.Model, a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of a coordinate of the tangent space [m or rad]."""
    return float(np.abs(pin.difference(model, a, b)).max())


def row(path: Path, t_end: float = T_END, dt: float = DT, rtol: float = RTOL, seed: int = 2) -> tuple[float, str]:
    """The difference of both, and the line of a file."""
    model, q, v, end = own(path, t_end, rtol, seed)
    right = reference(path, model, q, v, t_end, dt)
    coarse = reference(path, model, q, v, t_end, 2 * dt)
    away = distance(model, end, right)
    looser = own(path, t_end, 10 * rtol, seed)[3]
    limit = pin.integrate(model, right, pin.difference(model, coarse, right) / 3.0)
    return away, (
        f"| {path.stem} | {model.nv} | {away:.1e} | {distance(model, right, coarse):.1e} "
        f"| {distance(model, end, looser):.1e} | {distance(model, end, limit):.1e} |"
    )


def files() -> list[Path]:
    """The files of the tests, and those of gymnasium where it is installed."""
    found = [OWN / f"{name}.xml" for name in FILES]
    spec = importlib.util.find_spec("gymnasium")
    if spec is not None and spec.origin is not None:
        assets = Path(spec.origin).parent / "envs" / "mujoco" / "assets"
        found += [assets / f"{name}.xml" for name in OF_GYMNASIUM]
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="*", type=Path, help="MJCF files; by default thirteen")
    parser.add_argument("--dt", type=float, default=DT, help="step of MuJoCo [s]")
    add_table_option(parser)
    arguments = parser.parse_args()
    lines = list(COLUMNS)
    print("\n".join(lines), flush=True)
    for path in arguments.files or files():
        lines.append(row(path, dt=arguments.dt)[1])
        print(lines[-1], flush=True)
    if arguments.table is not None:
        arguments.table.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
