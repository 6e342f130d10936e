"""Random pairs of shapes at random poses: gaps against proven bounds, rates against differences, points on surfaces.

    python benchmarks/poses.py --poses 100000 --seed 0

Boxes, hulls of 4 to 1000 corners, cylinders, capsules, cones, ellipsoids and balls with sides from 1e-4 to 1, so that
aspects reach 1e4; gaps from 1e-9 to 10 sizes; every fourth pose is a rest, flat side on flat side, or one turned out
of that by 1e-12 to 0.1. A gap is proven by `tests/exact_shapes.py`: support functions bound it from below along its
normal, distances of its two points from the shapes from above. Errors are in parts of the larger shape and the gap.
"""

from __future__ import annotations

import argparse
import sys
import time
from itertools import combinations_with_replacement
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from tables import add_table_option, publish

import ngalpha_pin as nga
from ngalpha_pin.system.system import System

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from exact_shapes import best_separation, bounds_of_distance, outside

KINDS = ("box", "hull", "cylinder", "capsule", "cone", "ellipsoid", "ball")
PER_PAIR = 40  # poses of two shapes
FAR = 1e-6  # gaps in parts of the larger shape; below, errors are told in parts of the gap
WRONG = 1e-11  # part of the larger shape and the gap by which a gap may be off
OFF = 1e-9  # likewise for points
NEAR = 0.1  # gap in parts of the smallest length from which on rates are compared
EVERY = 8  # pose at which rates are compared with differences


def shape_of(kind: str, rng: np.random.Generator, aspect: float) -> coal.ShapeBase:
    """A shape with sides from 1 / aspect to 1 [m]."""
    a, b, c = aspect ** -rng.uniform(size=3)
    if kind == "box":
        return coal.Box(a, b, c)
    if kind == "cylinder":
        return coal.Cylinder(0.5 * a, b)
    if kind == "capsule":
        return coal.Capsule(0.5 * a, b)
    if kind == "cone":
        return coal.Cone(0.5 * a, b)
    if kind == "ellipsoid":
        return coal.Ellipsoid(0.5 * a, 0.5 * b, 0.5 * c)
    if kind == "ball":
        return coal.Sphere(0.5 * a)
    points = rng.normal(size=(int(4 * 250 ** rng.uniform()), 3))
    points *= 0.5 * np.array([a, b, c]) / np.linalg.norm(points, axis=1, keepdims=True)
    found = coal.StdVec_Vec3s()
    for p in points:
        found.append(p)
    return coal.Convex.convexHull(found, True, "Qt")


def scene_of(a: coal.ShapeBase, b: coal.ShapeBase) -> nga.Scene:
    """A fixed shape and one that moves freely."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 1.0), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_geometry("a", a)
    scene.add_geometry("b", b, parent="body")
    scene.add_contact("a", "b")
    return scene


def size_of(shape: coal.ShapeBase) -> float:
    """Diameter of a sphere that holds all of it [m]."""
    shape.computeLocalAABB()
    return 2.0 * float(shape.aabb_radius)


def pose_of(system: System, rng: np.random.Generator, size: float, rest: bool) -> np.ndarray:
    """A pose of b at some gap: near the shape, moved along the normal that coal finds there."""
    turn = pin.Quaternion(rng.normal(size=4)).normalized().matrix()
    if rest:
        axes = np.array(
            [pin.utils.rotate("x", 0.0), pin.utils.rotate("x", np.pi / 2), pin.utils.rotate("y", np.pi / 2)]
        )
        turn = axes[rng.integers(3)] @ pin.utils.rotate("z", rng.uniform(0, 6.3))
        if rng.uniform() < 0.5:
            turn = turn @ pin.exp3(10.0 ** rng.uniform(-12, -1) * rng.normal(size=3))
    way = rng.normal(size=3)
    if rest:
        way = np.eye(3)[rng.integers(3)] + 0.3 * rng.normal(size=3) * (rng.uniform() < 0.5)
    q = np.concatenate((3.0 * size * way / np.linalg.norm(way), pin.Quaternion(turn).coeffs()))
    pair, gap = system.slots.pairs[0], size * 10.0 ** rng.uniform(-9, 1)
    for _ in range(3):  # straight towards it
        system.place(q)
        X = system.slots.pose(system.data, 0)
        far, n, _, _ = pair.native.distance(X.rotation, X.translation)
        q[:3] -= (far - gap) * n
    return q


def rows_at(system: System, q: np.ndarray, v: np.ndarray, a: np.ndarray):
    """Rows of the features that are loaded."""
    sub = system.contacts.subset(
        np.concatenate(
            (np.arange(system.contacts.n_fixed), system.contacts.n_fixed + np.flatnonzero(system.slots.loaded))
        )
    )
    system.dynamics(0.0, q, v, a)
    return system.contact_rows(sub, q, v, a)


def loaded(system: System, q: np.ndarray, v: np.ndarray) -> None:
    """Put the features that the pair has at a pose into its places."""
    system.place_moving(q, v)
    slots = system.slots
    slots.load(system.data, slots.contents()[:0], np.zeros(0, dtype=int), 0.0, np.inf)


class Found:
    """The largest errors of one kind of pair."""

    def __init__(self) -> None:
        self.overlaps, self.poses = 0, 0
        self.above, self.below, self.near = 0.0, 0.0, 0.0
        self.off, self.rate, self.acceleration = 0.0, 0.0, 0.0
        self.wrong: list[str] = []

    def see(self, system: System, scene: nga.Scene, q: np.ndarray, size: float, label: str) -> None:
        """Gap and points at a pose."""
        self.poses += 1
        zero = np.zeros(6)
        loaded(system, q, zero)
        rows = rows_at(system, q, zero, zero)
        if not len(rows.g_N):
            self.wrong.append(f"{label}: no features")
            return
        k = int(np.argmin(rows.g_N))
        geometries = [scene.geometry(name) for name in "ab"]
        poses = [system.data.oMi[g.parentJoint] * g.placement for g in geometries]
        shapes = [g.geometry for g in geometries]
        gap = float(rows.g_N[k])
        if gap < 0.0:  # coal's distance has led into the shape
            self.overlaps += 1
            return
        unit = size + gap
        n, ends = rows.normals[k], (rows.c[k] - gap * rows.normals[k], rows.c[k])
        lower, upper = bounds_of_distance(shapes, poses, n, ends)
        (at_a, at_b), here = (
            [outside(s, X.actInv(p)) for s, X, p in zip(shapes, poses, ends, strict=True)],
            list(zip(shapes, poses, strict=True)),
        )
        for own, (s, X), p in ((at_b, here[0], ends[1]), (at_a, here[1], ends[0])):
            upper = min(upper, own + outside(s, X.actInv(p)))
        if gap - lower > WRONG * unit:  # another normal may separate further
            for width in (1e-1, 1e-3, 1e-6):
                lower = max(lower, best_separation(shapes, poses, n, width))
        above, below = (gap - lower) / unit, (upper - gap) / unit
        if gap > FAR * unit:
            self.above, self.below = max(self.above, above), max(self.below, below)
            right = max(above, below) < WRONG
        else:
            self.near = max(self.near, above * unit / gap, below * unit / gap)
            right = max(above, below) < WRONG or max(above, below) * unit < gap
        if not right:
            self.wrong.append(f"{label}: gap {gap:.3g}, {above:.1e} above, {below:.1e} below")
        for i in range(len(rows.g_N)):
            ends = rows.c[i] - rows.g_N[i] * rows.normals[i], rows.c[i]
            off = min(outside(s, X.actInv(p)) for s, X, p in zip(shapes, poses, ends, strict=True)) / unit
            self.off = max(self.off, off)
            if not off < OFF:
                self.wrong.append(f"{label}: point off both surfaces by {off:.1e}")

    def move(
        self, system: System, q: np.ndarray, rng: np.random.Generator, least: float, size: float, label: str
    ) -> None:
        """Rates and accelerations along a motion in which nothing moves by more than the smallest length."""
        v, a = (least * np.concatenate((rng.normal(size=3), rng.normal(size=3) / size)) for _ in range(2))
        h = 3e-4
        loaded(system, q, v)
        rows = rows_at(system, q, v, a)
        if not len(rows.g_N) or len(rows.g_N) != len(rows.rate):
            return
        k, model = int(np.argmin(rows.g_N)), system.scene.model
        if rows.g_N[k] < NEAR * least:  # two points that are near turn their normal faster than differences follow
            return
        ends = []
        for s in (-2.0, -1.0, 1.0, 2.0):
            t = s * h
            ends.append(rows_at(system, pin.integrate(model, q, t * v + 0.5 * t * t * a), v + t * a, a))
        g, r = (np.array([getattr(x, name)[k] for x in ends]) for name in ("g_N", "rate"))
        by_g, by_r = ((x[0] - 8 * x[1] + 8 * x[2] - x[3]) / (12 * h) for x in (g, r))
        scale = 1.0 + abs(rows.acceleration[k]) / least
        rate = abs(by_g - rows.rate[k]) / least / scale
        acceleration = abs(by_r - rows.acceleration[k]) / least / scale
        self.rate, self.acceleration = max(self.rate, rate), max(self.acceleration, acceleration)
        if not (abs(rows.W[k] @ v - rows.rate[k]) < 1e-12 * least + 1e-15 and rate < 1e-5 and acceleration < 1e-4):
            self.wrong.append(f"{label}: rate off by {rate:.1e}, acceleration by {acceleration:.1e}")


def main() -> None:
    """Look at all kinds of pairs in turn."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--aspect", type=float, default=1e4)
    parser.add_argument("--only", default="", help="pairs whose name contains it, such as cone-hull")
    parser.add_argument("--show", type=int, default=5, help="wrong poses of each kind of pair that are printed")
    add_table_option(parser)
    args = parser.parse_args()
    kinds = [p for p in combinations_with_replacement(KINDS, 2) if p != ("ball", "ball") and args.only in "-".join(p)]
    found = {pair: Found() for pair in kinds}
    start, n = time.process_time(), 0
    while sum(x.poses for x in found.values()) < args.poses:
        pair = kinds[n % len(kinds)]
        rng = np.random.default_rng((args.seed, n))
        shapes = [shape_of(kind, rng, args.aspect) for kind in pair]
        scene = scene_of(*shapes)
        system, size = System(scene), max(map(size_of, shapes))
        least = min(min(2.0 * np.array(s.aabb_local.max_ - s.aabb_local.min_)) for s in shapes)
        for i in range(PER_PAIR):
            label = f"{'-'.join(pair)} {n}.{i}"
            q = pose_of(system, rng, size, i % 4 == 0)
            found[pair].see(system, scene, q, size, label)
            if i % EVERY == 1:
                found[pair].move(system, q, rng, least, size, label)
        n += 1
    lines = [
        f"{sum(x.poses for x in found.values())} poses, seed {args.seed}, {time.process_time() - start:.0f} s",
        "",
        "| pair | poses | gap above | below | near, in parts | off both surfaces | rate | acceleration | wrong |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for pair, x in found.items():
        numbers = f"{x.above:.1e} | {x.below:.1e} | {x.near:.1e} | {x.off:.1e} | {x.rate:.1e} | {x.acceleration:.1e}"
        lines.append(f"| {'-'.join(pair)} | {x.poses} | {numbers} | {len(x.wrong)} |")
    publish(lines, args.table)
    for x in found.values():
        print(*x.wrong[: args.show], sep="\n", end="\n" if x.wrong else "")


if __name__ == "__main__":
    main()
