"""How far coordinates move the points of contact at most, and how large a scene is."""

from __future__ import annotations

from typing import Protocol

import numpy as np
import pinocchio as pin

from ngalpha_pin.scene.joints import own_motions


class Points(Protocol):
    """Points and the surfaces that they touch, as `ContactTable` has them, with the joints that carry them."""

    bodies: np.ndarray
    body_a: np.ndarray
    body_b: np.ndarray
    point: np.ndarray
    radius: np.ndarray
    centre: np.ndarray
    axis: np.ndarray
    curved: np.ndarray
    surface_radius: np.ndarray
    half_length: np.ndarray


def moved_by(model: pin.Model, joint: int) -> np.ndarray:
    """1 for the velocity coordinates on the path from the world to a joint, shape (nv,)."""
    moved = np.zeros(model.nv)
    for j in model.supports[int(joint)]:
        if j > 0:
            moved[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = 1.0
    return moved


def reach_of(model: pin.Model, table: Points) -> np.ndarray:
    """Bound of the way of any point of contact per unit of each velocity coordinate, shape (nv,)."""
    turned = table.axis.any(axis=1)
    endless = ~table.curved | (turned & ~np.isfinite(table.half_length))
    size = table.surface_radius + np.where(turned, table.half_length, 0.0) + np.linalg.norm(table.centre, axis=1)
    distances = np.full(len(table.bodies), -1.0)
    np.maximum.at(distances, table.body_b, np.linalg.norm(table.point, axis=1) + table.radius)
    np.maximum.at(distances, table.body_a, np.where(endless, np.inf, size))
    bodies = zip(table.bodies.tolist(), distances.tolist(), strict=True)
    return np.max([np.zeros(model.nv), *(_joint_reach(model, *body) for body in bodies if body[0] > 0)], axis=0)


def _joint_reach(model: pin.Model, joint: int, distance: float) -> np.ndarray:
    """How far a point at `distance` from the origin of a joint moves per unit of each coordinate, at most."""
    reach = np.zeros(model.nv)
    while joint > 0:
        i, n = model.idx_vs[joint], model.nvs[joint]
        S = own_motions(model, joint)
        linear, angular = np.linalg.norm(S[:3], axis=0), np.linalg.norm(S[3:], axis=0)
        turns = angular > 0
        reach[i : i + n] = linear
        reach[i : i + n][turns] += angular[turns] * distance
        # what sits below a joint that slides can be any distance away from the joints above it
        slide = np.inf if linear.any() else 0.0
        distance += float(np.linalg.norm(model.jointPlacements[joint].translation)) + slide
        joint = model.parents[joint]
    return reach


def length_of(model: pin.Model, table: Points) -> float:
    """The largest distance between a joint and what is attached to it: joints, contact points, round surfaces [m].

    One, where everything is in one point.
    """
    links = [float(np.linalg.norm(p.translation)) for p in list(model.jointPlacements)[1:]]
    round_ = np.where(np.isfinite(table.surface_radius), table.surface_radius, 0.0)
    points = np.linalg.norm(table.point, axis=1) + table.radius + round_
    return max([0.0, *links, float(points.max(initial=0.0))]) or 1.0
