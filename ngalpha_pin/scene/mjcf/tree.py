"""Bodies and joints of a compiled MJCF model as a `pin.Model`, and their coordinates in both conventions.

A hinge or slide has MuJoCo's coordinate, so that it stands as drawn at its `ref`; quaternions are (x, y, z, w) here and
(w, x, y, z) there; the linear velocity of a free joint is in the body here and in the world there.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.scene.mjcf.compiler import Names, disabled, mujoco, one_of, pose

AXES = ("X", "Y", "Z")


class Tree(NamedTuple):
    """The multibody tree of a file.

    Attributes:
        model: `pin.Model`; its coordinates are in the order of MuJoCo's.
        places: joint of every body, and the pose of the body there.
        names: of everything in the file.
    """

    model: pin.Model
    places: list[tuple[int, pin.SE3]]
    names: Names


def read_tree(m: Any, name: str) -> Tree:
    """The tree of a compiled model: every body of it, with all of its joints in a row."""
    model, names = pin.Model(), Names(m)
    model.name = name
    model.gravity.linear = np.zeros(3) if disabled(m, "GRAVITY") else np.array(m.opt.gravity)
    places = [(0, pin.SE3.Identity())]
    for b in range(1, m.nbody):
        parent, at = places[m.body_parentid[b]]
        joint, at = _with_joints(m, model, names, b, parent, at * pose(m.body_pos[b], m.body_quat[b]))
        if joint > 0:
            model.appendBodyToJoint(joint, _inertia(m, b), at)
        model.addFrame(pin.Frame(names.bodies[b], joint, at, pin.FrameType.BODY))
        places.append((joint, at))
    for i in range(m.nsite):
        joint, at = places[m.site_bodyid[i]]
        model.addFrame(
            pin.Frame(names.sites[i], joint, at * pose(m.site_pos[i], m.site_quat[i]), pin.FrameType.OP_FRAME)
        )
    _write_joint_properties(m, model)
    for i in range(m.nkey):
        model.referenceConfigurations[names.keys[i]] = q_from_mujoco(model, m.key_qpos[i])
    model.referenceConfigurations["qpos0"] = q_from_mujoco(model, m.qpos0)
    return Tree(model, places, names)


def _with_joints(m: Any, model: pin.Model, names: Names, body: int, parent: int, at: pin.SE3) -> tuple[int, pin.SE3]:
    """Add the joints of a body behind its parent; the last one and the pose of the body there."""
    kinds = mujoco().mjtJoint
    for j in range(m.body_jntadr[body], m.body_jntadr[body] + m.body_jntnum[body]):
        anchor = pin.SE3(np.eye(3), np.array(m.jnt_pos[j]))
        axis, ref = np.array(m.jnt_axis[j]), float(m.qpos0[m.jnt_qposadr[j]])
        kind = m.jnt_type[j]
        if kind == kinds.mjJNT_FREE:
            joint, placement, at = pin.JointModelFreeFlyer(), pin.SE3.Identity(), pin.SE3.Identity()
        elif kind == kinds.mjJNT_BALL:
            joint, placement, at = pin.JointModelSpherical(), at * anchor, anchor.inverse()
        elif kind == kinds.mjJNT_HINGE:
            back = pin.SE3(pin.AngleAxis(-ref, axis).matrix(), np.zeros(3))
            joint, placement, at = _along("Revolute", "R", axis), at * anchor * back, anchor.inverse()
        else:
            back = pin.SE3(np.eye(3), -ref * axis)
            joint, placement, at = _along("Prismatic", "P", axis), at * anchor * back, anchor.inverse()
        parent = model.addJoint(parent, joint, placement, names.joints[j])
        model.addJointFrame(parent)
    return parent, at


def _along(kind: str, short: str, axis: np.ndarray) -> pin.JointModel:
    for i, letter in enumerate(AXES):
        if np.array_equal(axis, np.eye(3)[i]):
            return getattr(pin, f"JointModel{short}{letter}")()
    return getattr(pin, f"JointModel{kind}Unaligned")(axis)


def _inertia(m: Any, body: int) -> pin.Inertia:
    principal = pose(m.body_ipos[body], m.body_iquat[body])
    R = principal.rotation
    return pin.Inertia(float(m.body_mass[body]), principal.translation, R @ np.diag(m.body_inertia[body]) @ R.T)


def _write_joint_properties(m: Any, model: pin.Model) -> None:
    """Armature, damping, dry friction, limits of position and effort; none where the file states none."""
    nv, nq, no = model.nv, model.nq, np.inf
    friction = np.zeros(nv) if disabled(m, "FRICTIONLOSS") else np.array(m.dof_frictionloss)
    effort = np.full((2, nv), [[-no], [no]])
    position = np.full((2, nq), [[-no], [no]])
    kinds = mujoco().mjtJoint
    for j in range(m.njnt):
        if not one_of(m.jnt_type[j], kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE):
            continue
        if m.jnt_limited[j] and not disabled(m, "LIMIT"):
            position[:, m.jnt_qposadr[j]] = m.jnt_range[j]
        if m.jnt_actfrclimited[j]:
            effort[:, m.jnt_dofadr[j]] = m.jnt_actfrcrange[j]
    model.armature = np.array(m.dof_armature)
    model.damping = np.zeros(nv) if disabled(m, "DAMPER") else np.array(m.dof_damping)
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = -friction, friction
    model.lowerPositionLimit, model.upperPositionLimit = position
    model.lowerEffortLimit, model.upperEffortLimit = effort
    model.lowerVelocityLimit, model.upperVelocityLimit = np.full(nv, -no), np.full(nv, no)


def q_from_mujoco(model: pin.Model, qpos: np.ndarray) -> np.ndarray:
    """Pinocchio's configuration of a model that was read from MJCF.

    Args:
        model: the model.
        qpos: MuJoCo's configuration, shape (nq,), with quaternions (w, x, y, z).

    Returns:
        q, shape (nq,), with quaternions (x, y, z, w).

    Raises:
        SceneError: the length is another one.
    """
    return _reordered(model, qpos, (1, 2, 3, 0))


def q_to_mujoco(model: pin.Model, q: np.ndarray) -> np.ndarray:
    """The inverse of `q_from_mujoco`."""
    return _reordered(model, q, (3, 0, 1, 2))


def v_from_mujoco(model: pin.Model, q: np.ndarray, qvel: np.ndarray) -> np.ndarray:
    """Pinocchio's velocity: the linear velocity of a free joint in the axes of the body.

    Args:
        model: the model.
        q: Pinocchio's configuration, shape (nq,).
        qvel: MuJoCo's velocity, shape (nv,).

    Returns:
        v, shape (nv,).

    Raises:
        SceneError: a length is another one.
    """
    return _turned(model, q, qvel, -1)


def v_to_mujoco(model: pin.Model, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """The inverse of `v_from_mujoco`."""
    return _turned(model, q, v, 1)


def _reordered(model: pin.Model, values: np.ndarray, order: tuple[int, ...]) -> np.ndarray:
    checks.instance("model", model, pin.Model, "a pin.Model, as scene.model")
    found = checks.vector("the configuration", values, model.nq)
    for joint, i in zip(list(model.joints)[1:], list(model.idx_qs)[1:], strict=True):
        if joint.nq in (4, 7):
            i += joint.nq - 4
            found[i : i + 4] = found[i : i + 4][list(order)]
    return found


def _turned(model: pin.Model, q: np.ndarray, values: np.ndarray, way: int) -> np.ndarray:
    checks.instance("model", model, pin.Model, "a pin.Model, as scene.model")
    found, q = checks.vector("the velocity", values, model.nv), checks.vector("q", q, model.nq)
    for joint, i, k in zip(list(model.joints)[1:], list(model.idx_qs)[1:], list(model.idx_vs)[1:], strict=True):
        if joint.nq == 7:
            R = pin.Quaternion(q[i + 3 : i + 7]).matrix()
            found[k : k + 3] = (R if way > 0 else R.T) @ found[k : k + 3]
    return found
