"""Which steps of a trajectory are drawn, and where every joint and the centre of mass are at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import coal
import numpy as np
import pinocchio as pin

if TYPE_CHECKING:
    from ngalpha_pin import Scene, Trajectory

FPS = 60.0
MAX_EVENT_FRAMES = 1000  # a Zeno sequence has any number of impacts


@dataclass(frozen=True)
class Frames:
    """The drawn steps of one trajectory.

    Attributes:
        index: steps that are drawn, shape (F,), increasing.
        t: their times [s], shape (F,).
        pose: placement of every joint in the world, shape (F, njoints, 7): position [m], quaternion x, y, z, w.
        com: centre of mass [m], shape (F, 3).
    """

    index: np.ndarray
    t: np.ndarray
    pose: np.ndarray
    com: np.ndarray


def drawn_steps(trajectory: Trajectory, fps: float = FPS) -> np.ndarray:
    """Indices of the steps to draw: `fps` per second, and the steps of events, so that a bounce touches the ground.

    Args:
        trajectory: any run.
        fps: frames per second of simulated time [1/s].

    Returns:
        Increasing indices, shape (F,), with the first and the last step.
    """
    t = np.asarray(trajectory.t)
    n = max(int(np.ceil((t[-1] - t[0]) * fps)), 1)
    regular = nearest_step(t, np.linspace(t[0], t[-1], n + 1))
    times = np.array([event.t for event in trajectory.events][:MAX_EVENT_FRAMES])
    return np.unique(np.concatenate([regular, nearest_step(t, times)]))


def nearest_step(t: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Index of the step whose time is closest, for each of `times` [s]; shape of `times`."""
    right = np.clip(np.searchsorted(t, times), 1, max(len(t) - 1, 1))
    right = np.minimum(right, len(t) - 1)
    left = np.maximum(right - 1, 0)
    return np.where(np.abs(times - t[left]) <= np.abs(t[right] - times), left, right)


def sample(trajectory: Trajectory, fps: float = FPS) -> Frames:
    """Kinematics of the drawn steps.

    Args:
        trajectory: any run.
        fps: frames per second of simulated time [1/s].
    """
    model = trajectory.scene.model
    data = model.createData()
    index = drawn_steps(trajectory, fps)
    pose = np.empty((len(index), model.njoints, 7))
    com = np.zeros((len(index), 3))
    has_mass = pin.computeTotalMass(model) > 0
    for row, i in enumerate(index):
        pin.forwardKinematics(model, data, trajectory.q[i])
        for j, placement in enumerate(data.oMi):
            pose[row, j] = pin.SE3ToXYZQUAT(placement)
        if has_mass:
            com[row] = pin.centerOfMass(model, data, trajectory.q[i])
    _without_jumps(pose[:, :, 3:])
    return Frames(index, np.asarray(trajectory.t)[index], pose, com)


def _without_jumps(quaternion: np.ndarray) -> None:
    """Choose signs so that neighbours in time are close: (F, n, 4), in place."""
    turned = np.sum(quaternion[1:] * quaternion[:-1], axis=-1) < 0
    sign = np.where(np.cumsum(turned, axis=0) % 2, -1.0, 1.0)
    quaternion[1:] *= sign[..., None]


def drawn_geometries(scene: Scene) -> list[pin.GeometryObject]:
    """The visual geometries (the collision geometries where there are none) and those added to the scene."""
    visual = scene.visual_model
    if visual is None or visual.ngeoms == 0:
        return list(scene.collision_model.geometryObjects)
    added = [g for g in scene.collision_model.geometryObjects if g.name in scene.added]
    return list(visual.geometryObjects) + added


@dataclass(frozen=True)
class Bounds:
    """Boxes of what moves, each of shape (2, 3): lower and upper corner [m].

    Attributes:
        motion: over the whole motion, with the hollow shapes around it.
        start: at the first frame.
    """

    motion: np.ndarray
    start: np.ndarray

    @property
    def size(self) -> float:
        """Diagonal of the system at the first frame [m]."""
        diagonal = float(np.linalg.norm(self.start[1] - self.start[0]))
        return diagonal if diagonal > 0 else 1.0


def bounds(scene: Scene, frames: Frames) -> Bounds:
    """Boxes of everything that moves."""
    solid = [(g, _corners(g)) for g in drawn_geometries(scene)]
    bodies = [(g.parentJoint, c) for g, c in solid if c is not None and g.name not in scene.hollow]
    around = [(g.parentJoint, c) for g, c in solid if c is not None and g.name in scene.hollow]
    # what is fixed to the world does not count, unless there is nothing else
    bodies = [(j, c) for j, c in bodies if j > 0] or bodies
    rows = np.unique(np.linspace(0, len(frames.t) - 1, 120).astype(int))
    motion = [_cloud(frames.pose[row], bodies) for row in rows]
    if around:
        motion.append(_cloud(frames.pose[0], around))
    return Bounds(_box(np.concatenate(motion)), _box(motion[0]))


def _box(points: np.ndarray) -> np.ndarray:
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _cloud(pose: np.ndarray, moving: list[tuple[int, np.ndarray]]) -> np.ndarray:
    if not moving:
        return pose[:, :3]
    placements = [pin.XYZQUATToSE3(p) for p in pose]
    return np.concatenate([c @ placements[j].rotation.T + placements[j].translation for j, c in moving])


def _corners(geometry: pin.GeometryObject) -> np.ndarray | None:
    """Corners of the bounding box of a geometry in its joint's frame [m], shape (8, 3); None if it has no end."""
    shape = geometry.geometry
    if isinstance(shape, (coal.Halfspace, coal.Plane)):
        return None
    shape.computeLocalAABB()
    ends = np.stack([shape.aabb_local.min_, shape.aabb_local.max_])
    if not np.isfinite(ends).all():
        return None
    corners = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    return corners @ geometry.placement.rotation.T + geometry.placement.translation
