"""Which steps of a trajectory are drawn, and where everything that moves is at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import coal
import numpy as np
import pinocchio as pin

from .tubes import Tube, tubes

if TYPE_CHECKING:
    from ngalpha_pin import Scene, Trajectory

FPS = 60.0
FIXED_REACH = 3.0  # what is fixed counts if it is no larger than so many diagonals of the motion
ARROW_SHARE = 0.3  # of the diagonal of the motion
MAX_EVENT_FRAMES = 1000  # a Zeno sequence has any number of impacts


@dataclass(frozen=True)
class Frames:
    """The drawn steps of one trajectory.

    Attributes:
        index: steps that are drawn, shape (F,), increasing.
        t: their times [s], shape (F,).
        pose: placement of every joint in the world, shape (F, njoints, 7): position [m], quaternion x, y, z, w.
        com: centre of mass [m], shape (F, 3).
        tubes: bodies that deform.
    """

    index: np.ndarray
    t: np.ndarray
    pose: np.ndarray
    com: np.ndarray
    tubes: tuple[Tube, ...]


def drawn_steps(trajectory: Trajectory, fps: float = FPS) -> np.ndarray:
    """Indices of the steps to draw: `fps` per second, and the steps of events, so that a bounce touches the ground.

    Args:
        trajectory: any run.
        fps: frames per second of simulated time [1/s].

    Returns:
        Increasing indices, shape (F,), with the first and the last step; a step that is not finite is left out.
    """
    t = np.asarray(trajectory.t)
    n = max(int(np.ceil((t[-1] - t[0]) * fps)), 1)
    regular = nearest_step(t, np.linspace(t[0], t[-1], n + 1))
    times = np.array([event.t for event in trajectory.events][:MAX_EVENT_FRAMES])
    steps = np.unique(np.concatenate([regular, nearest_step(t, times)]))
    return steps[np.isfinite(np.asarray(trajectory.q)[steps]).all(axis=1)]


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
    system = trajectory.system
    model, data = system.model, system.model.createData()
    index = drawn_steps(trajectory, fps)
    pose = np.empty((len(index), model.njoints, 7))
    com = np.zeros((len(index), 3))
    has_mass = pin.computeTotalMass(model) > 0
    for row, i in enumerate(index):
        pin.forwardKinematics(model, data, system.kinematic(trajectory.q[i]))
        for j, placement in enumerate(data.oMi):
            pose[row, j] = pin.SE3ToXYZQUAT(placement)
        if has_mass:
            com[row] = pin.centerOfMass(model, data, system.kinematic(trajectory.q[i]))
    _without_jumps(pose[:, :, 3:])
    return Frames(index, np.asarray(trajectory.t)[index], pose, com, tubes(trajectory, index))


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
    added = [scene.geometry(g.name) for g in scene.declared_shapes.geometryObjects if g.name in scene.added]
    return list(visual.geometryObjects) + added


@dataclass(frozen=True)
class Bounds:
    """Boxes of what moves, each of shape (2, 3): lower and upper corner [m].

    Attributes:
        motion: over the whole motion, with the fixed bodies around it.
        start: at the first frame.
    """

    motion: np.ndarray
    start: np.ndarray

    @property
    def size(self) -> float:
        """Diagonal of the system at the first frame [m]."""
        diagonal = float(np.linalg.norm(self.start[1] - self.start[0]))
        return diagonal if diagonal > 0 else 1.0

    @property
    def arrow_size(self) -> float:
        """Length to which arrows are scaled [m]: the system, or a part of a motion that is much larger."""
        return max(self.size, ARROW_SHARE * float(np.linalg.norm(self.motion[1] - self.motion[0])))


def bounds(scene: Scene, frames: Frames) -> Bounds:
    """Boxes of everything that moves."""
    solid = [(g, _extent(g)) for g in drawn_geometries(scene)]
    bodies = [(g.parentJoint, *e) for g, e in solid if e is not None and g.parentJoint > 0]
    fixed = [(g.parentJoint, *e) for g, e in solid if e is not None and g.parentJoint == 0]
    rows = np.unique(np.linspace(0, len(frames.t) - 1, 120).astype(int))
    motion = [_moving_box(frames, row, bodies) for row in rows]
    moving = np.concatenate(motion)
    reach = FIXED_REACH * np.linalg.norm(np.ptp(moving, axis=0))
    # the stand of an arm or a tube around a ball belongs into the picture, a large floor does not
    beside = [_box(frames.pose[0], [body]) for body in fixed]
    everything = np.concatenate([moving, *(box for box in beside if np.linalg.norm(box[1] - box[0]) < reach)])
    return Bounds(np.stack([everything.min(axis=0), everything.max(axis=0)]), motion[0])


def _moving_box(frames: Frames, row: int, bodies: list[tuple[int, np.ndarray, float]]) -> np.ndarray:
    """Box around the rigid and the deforming bodies at a frame: (2, 3)."""
    deforming = [(tube.points[row], tube.radius) for tube in frames.tubes]
    boxes = [np.stack([line.min(axis=0) - radius, line.max(axis=0) + radius]) for line, radius in deforming]
    if bodies or not boxes:
        boxes.append(_box(frames.pose[row], bodies))
    corners = np.concatenate(boxes)
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def _box(pose: np.ndarray, bodies: list[tuple[int, np.ndarray, float]]) -> np.ndarray:
    """Box around bodies, given by joint, points and radius, or around the joints if there is none: (2, 3)."""
    placements = [pin.XYZQUATToSE3(p) for p in pose]
    low, high = [], []
    for joint, points, radius in bodies or [(j, np.zeros((1, 3)), 0.0) for j in range(len(pose))]:
        placed = points @ placements[joint].rotation.T + placements[joint].translation
        low.append(placed.min(axis=0) - radius)
        high.append(placed.max(axis=0) + radius)
    return np.stack([np.min(low, axis=0), np.max(high, axis=0)])


def _extent(geometry: pin.GeometryObject) -> tuple[np.ndarray, float] | None:
    """Points in the joint's frame [m], shape (n, 3), and a radius [m] around them; None if the shape has no end."""
    shape, placement = geometry.geometry, geometry.placement
    if isinstance(shape, (coal.Halfspace, coal.Plane)):
        return None
    if isinstance(shape, coal.Sphere):
        return placement.translation[None], float(shape.radius)
    shape.computeLocalAABB()
    ends = np.stack([shape.aabb_local.min_, shape.aabb_local.max_])
    if not np.isfinite(ends).all():
        return None
    corners = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    return corners @ placement.rotation.T + placement.translation, 0.0
