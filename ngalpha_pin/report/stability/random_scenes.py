"""Random scenes: one to six bodies of random shapes, walls, joints, loops, at random speeds; what becomes of a run.

A scene is made from a recipe, plain data with few parts, so that one that fails can be made smaller and printed.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from copy import deepcopy
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga
from ngalpha_pin.common.tolerances import TINY
from ngalpha_pin.results.energy_audit import RISES

from ..bounded import OutOfTime, within

Recipe = dict[str, Any]
STEPS = 100
SECONDS = 1.0  # of processor time for a run of STEPS
WALL = 8.0  # distance of the walls from the origin [m]
SHAPES = ("Sphere", "Box", "Capsule", "Cylinder", "Ellipsoid", "Cone", "Convex")
JOINTS = {
    "free": pin.JointModelFreeFlyer,
    "revolute": pin.JointModelRY,
    "prismatic": pin.JointModelPX,
    "spherical": pin.JointModelSpherical,
}
VERDICTS = ("well", "energy rises", "audit", "not converged", "unfinished", "refused", "raw error")


class Outcome(NamedTuple):
    """What became of a run: one of VERDICTS, whether its audit is content, what it said, and its time [s]."""

    verdict: str
    audit_ok: bool
    said: str
    seconds: float


def random_recipe(seed: int) -> Recipe:
    """The recipe of a number."""
    rng = np.random.default_rng(seed)
    bodies = []
    for i in range(int(rng.integers(1, 7))):
        kind = str(rng.choice(SHAPES))
        child = i > 0 and rng.random() < 0.35
        joint = str(rng.choice(list(JOINTS)[1:])) if child or rng.random() < 0.15 else "free"
        speed, turn = 10 ** rng.uniform(-2, 2), 10 ** rng.uniform(-2, 3)
        n = JOINTS[joint]().nv
        along = rng.normal(size=6)
        v = np.concatenate((speed * along[:3], turn * along[3:])) / max(1.0, float(np.linalg.norm(along)))
        bodies.append({
            "shape": kind,
            "size": rng.uniform(0.03, 0.3, size=3).round(3).tolist(),
            "mass": float(f"{10 ** rng.uniform(-3, 3):.3g}"),
            "joint": joint,
            "parent": i - 1 if child else None,
            "turn": rng.normal(size=3).round(3).tolist(),
            "v": (v if n == 6 else v[3 : 3 + n] if joint != "prismatic" else v[:1]).round(4).tolist(),
        })  # fmt: skip
    walls = [[[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]]
    for _ in range(int(rng.integers(0, 3))):
        angle = rng.uniform(0, 2 * np.pi)
        normal = [float(np.cos(angle).round(3)), float(np.sin(angle).round(3)), 0.0]
        walls.append([[-WALL * normal[0], -WALL * normal[1], 0.0], normal])
    return {
        "bodies": bodies,
        "walls": walls,
        "loop": sorted(rng.choice(len(bodies), 2, replace=False).tolist())
        if len(bodies) > 1 and rng.random() < 0.3
        else None,
        "mu": float(rng.choice([0.0, round(rng.uniform(0, 2), 3)])),
        "e_N": float(rng.choice([0.0, round(rng.uniform(0, 1), 3), 1.0])),
        "dt": float(f"{10 ** rng.uniform(-4, -2):.3g}"),
    }


def _shape(body: Recipe) -> tuple[coal.CollisionGeometry, pin.Inertia]:
    a, b, c = body["size"]
    m = body["mass"]
    if body["shape"] == "Sphere":
        return coal.Sphere(a), pin.Inertia.FromSphere(m, a)
    if body["shape"] == "Box":
        return coal.Box(a, b, c), pin.Inertia.FromBox(m, a, b, c)
    if body["shape"] == "Capsule":
        return coal.Capsule(a, b), pin.Inertia.FromCapsule(m, a, b)
    if body["shape"] == "Cylinder":
        return coal.Cylinder(a, b), pin.Inertia.FromCylinder(m, a, b)
    if body["shape"] == "Cone":
        return coal.Cone(a, b), pin.Inertia.FromCylinder(m, a, b)
    if body["shape"] == "Ellipsoid":
        return coal.Ellipsoid(a, b, c), pin.Inertia.FromEllipsoid(m, a, b, c)
    points = coal.StdVec_Vec3s()
    for p in np.random.default_rng(int(1000 * a)).normal(size=(12, 3)):
        points.append(p / np.linalg.norm(p) * np.array(body["size"]))
    return coal.Convex.convexHull(points, True, "Qt"), pin.Inertia.FromEllipsoid(m, a, b, c)


def _place(recipe: Recipe, i: int) -> np.ndarray:
    """Where a body that hangs on no other starts: side by side, out of reach of each other [m]."""
    return np.array([1.2 * (i - 0.5 * len(recipe["bodies"])), 0.0, 0.6])


def build(recipe: Recipe) -> tuple[nga.Scene, np.ndarray, np.ndarray]:
    """The scene of a recipe with q0 and v0, in which nothing overlaps and the loop is closed."""
    model = pin.Model()
    joints: list[int] = []
    for i, body in enumerate(recipe["bodies"]):
        free, parent = body["joint"] == "free", body["parent"]
        where = np.zeros(3) if free else _place(recipe, i) if parent is None else np.array([0.0, 1.0, 0.2])
        before, place = 0 if parent is None else joints[parent], pin.SE3(np.eye(3), where)
        joint = model.addJoint(before, JOINTS[body["joint"]](), place, f"body{i}")
        model.appendBodyToJoint(joint, _shape(body)[1], pin.SE3.Identity())
        model.addJointFrame(joint)
        joints.append(joint)
    scene, q, v = nga.Scene(model), pin.neutral(model), np.zeros(model.nv)
    for i, (body, joint) in enumerate(zip(recipe["bodies"], joints, strict=True)):
        scene.add_geometry(f"shape{i}", _shape(body)[0], parent=f"body{i}")
        first, at = model.idx_qs[joint], model.idx_vs[joint]
        if body["joint"] == "free":
            alone = all(other["parent"] != i for other in recipe["bodies"])  # a chain that is turned could be anywhere
            R = pin.exp3(np.array(body["turn"])) if alone else np.eye(3)
            q[first : first + 7] = pin.SE3ToXYZQUAT(pin.SE3(R, _place(recipe, i)))
        v[at : at + len(body["v"])] = body["v"]
    law = {"mu": recipe["mu"], "e_N": recipe["e_N"]}
    for k, (point, normal) in enumerate(recipe["walls"]):
        scene.add_plane(f"wall{k}", point, normal)
        scene.add_contact("shape*", f"wall{k}", **law)
    for i in range(len(joints)):
        for j in range(i):
            if model.parents[joints[i]] != joints[j]:
                scene.add_contact(f"shape{i}", f"shape{j}", **law)
    if recipe["loop"] is not None:
        data, (a, b) = model.createData(), recipe["loop"]
        pin.forwardKinematics(model, data, q)
        length = float(np.linalg.norm(data.oMi[joints[a]].translation - data.oMi[joints[b]].translation))
        scene.add_constraint(nga.Distance(f"body{a}", f"body{b}", length))
        v = nga.assemble(scene, q, v).v
    return scene, q, v


def outcome(recipe: Recipe, steps: int = STEPS, seconds: float = SECONDS) -> Outcome:
    """Run a recipe and judge it.

    Args:
        recipe: what to run.
        steps: of its dt.
        seconds: of computing in the run, apart from its audit.
    """
    began = time.process_time()
    try:
        scene, q, v = build(recipe)
        run = within(seconds, lambda: nga.simulate(scene, q, v, t_end=steps * recipe["dt"], dt=recipe["dt"]))
        took = time.process_time() - began
        audit, E = run.audit(), run.energy.total
    except OutOfTime:
        return Outcome("unfinished", False, "", time.process_time() - began)
    except nga.NotConverged as error:
        return Outcome("not converged", False, str(error), time.process_time() - began)
    except nga.NgalphaError as error:
        return Outcome("refused", False, str(error), time.process_time() - began)
    except Exception as error:
        return Outcome("raw error", False, repr(error), time.process_time() - began)
    rise = float((E - np.minimum.accumulate(E)).max()) / max(float(np.ptp(E)), abs(float(E[0])), TINY)
    if rise > RISES:
        return Outcome("energy rises", audit.ok, f"by {rise:.3g} of the largest", took)
    return Outcome("well" if audit.ok else "audit", audit.ok, "" if audit.ok else _reason(audit), took)


def _reason(audit: nga.Audit) -> str:
    return ", ".join(f"{name} {value}" for name, value, _, ok in audit.rows() if ok is False)


def smaller(recipe: Recipe) -> Iterator[Recipe]:
    """Recipes with one thing less."""
    for i in reversed(range(len(recipe["bodies"]))):
        if len(recipe["bodies"]) > 1 and all(body["parent"] != i for body in recipe["bodies"]):
            less = deepcopy(recipe)
            del less["bodies"][i]
            for body in less["bodies"]:
                if body["parent"] is not None and body["parent"] > i:
                    body["parent"] -= 1
            pair = less["loop"]
            less["loop"] = None if pair is None or i in pair else [j - (j > i) for j in pair]
            yield less
    for i in range(1, len(recipe["walls"])):
        yield {**recipe, "walls": recipe["walls"][:i] + recipe["walls"][i + 1 :]}
    yield from ({**recipe, name: value} for name, value in (("loop", None), ("mu", 0.0), ("e_N", 0.0)))
    for i in range(len(recipe["bodies"])):
        for change in (
            {"v": [0.0] * len(recipe["bodies"][i]["v"])},
            {"mass": 1.0},
            {"shape": "Sphere"},
            {"turn": [0, 0, 0]},
        ):
            less = deepcopy(recipe)
            less["bodies"][i].update(change)
            yield less


def shrunk(recipe: Recipe, verdict: str, tries: int = 60) -> Recipe:
    """A small recipe with the same verdict."""
    for _ in range(tries):
        for less in smaller(recipe):
            if less != recipe and outcome(less).verdict == verdict:
                recipe = less
                break
        else:
            break
    return recipe


def script(recipe: Recipe) -> str:
    """A program that runs a recipe."""
    return (
        "import ngalpha_pin as nga\nfrom ngalpha_pin.report.stability.random_scenes import build\n\n"
        f"recipe = {recipe!r}\nscene, q0, v0 = build(recipe)\n"
        f"run = nga.simulate(scene, q0, v0, t_end={STEPS} * recipe['dt'], dt=recipe['dt'])\nprint(run.audit())\n"
    )
