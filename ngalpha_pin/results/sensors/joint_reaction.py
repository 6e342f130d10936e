"""What joints carry: the forces between bodies, from the motion and from all that acts on the bodies from outside.

Contacts, constraints between bodies, springs, wrenches and gravity act on bodies. Motors, joint springs, friction,
limits, gears and own functions of coordinates act between the two bodies of a joint and are part of what it carries.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.results.recorded import Recorded
from ngalpha_pin.results.sensors.contact_force import step_lengths, wrench_rows
from ngalpha_pin.results.sensors.wrench_at import WrenchAt


def joint_reaction(trajectory: Recorded, joint: str) -> WrenchAt:
    """See `Sensors.joint_reaction`."""
    tree = trajectory.system.tree
    if not tree.existJointName(checks.name("joint", joint)) or joint == "universe":
        raise UnknownName("joint", joint, list(tree.names)[1:])
    if trajectory.kept is not None and (trajectory.kept.has_forces or trajectory.constraint_names):
        raise SceneError(
            "joint_reaction needs the forces and constraints of the scene, which are not in a file: ask the trajectory "
            "that was computed"
        )
    found, number = trajectory.joint_wrenches, tree.getJointId(joint)
    return WrenchAt(found[:, number, :3], found[:, number, 3:6], found[:, number, 6:])


def joint_wrenches(trajectory: Recorded) -> np.ndarray:
    """Wrench of every joint on its body about the origin of the joint, and that origin, shape (n + 1, n_joints, 9)."""
    system = trajectory.system
    tree, nq, nv = system.tree, system.tree.nq, system.tree.nv
    data = tree.createData()
    found = np.zeros((len(trajectory.t), tree.njoints, 9))
    lengths = step_lengths(trajectory) if trajectory.on_velocity_level else None
    for i, (q, v, a) in enumerate(zip(trajectory.q, trajectory.v, trajectory.a, strict=True)):
        total = _contacts(trajectory, i, None if lengths is None else lengths[i])
        total += _forces_and_constraints(trajectory, i)
        poses = [system.data.oMi[j] for j in range(tree.njoints)]
        outside = pin.StdVec_Force()
        for pose, wrench in zip(poses, total, strict=False):
            outside.append(pose.actInv(pin.Force(wrench)))
        pin.rnea(tree, data, q[:nq], v[:nv], a[:nv], outside)
        for j in range(1, tree.njoints):
            R = poses[j].rotation
            found[i, j] = np.concatenate((R @ data.f[j].linear, R @ data.f[j].angular, poses[j].translation))
    return found


def _contacts(trajectory: Recorded, i: int, length: float | None) -> np.ndarray:
    """Wrenches of the contacts on all bodies about the origin of the world, shape (n_joints, 6).

    Args:
        trajectory: the run.
        i: number of the time.
        length: of the step whose percussions are spread over it [s]; None takes the forces.
    """
    system, table = trajectory.system, trajectory.system.contacts
    total = np.zeros((system.model.njoints, 6))
    N, T = trajectory.la_N[i], trajectory.la_F[i]
    if length is not None:
        N, T = trajectory.P_N[i] / length, trajectory.P_F[i] / length
    columns = np.flatnonzero((N != 0.0) & (trajectory.contact_columns < table.n_points))
    if not len(columns):
        return total
    contacts = trajectory.contact_columns[columns]
    F, _, of_row = wrench_rows(trajectory, i, contacts)
    rows = [trajectory.friction_rows[column] for column in columns]
    F *= np.concatenate([N[columns], *(T[s] for s in rows)])[:, None]
    np.add.at(total, table.bodies[table.body_b[contacts]][of_row], F)
    np.add.at(total, table.bodies[table.body_a[contacts]][of_row], -F)
    return total


def _forces_and_constraints(trajectory: Recorded, i: int) -> np.ndarray:
    """Wrenches of constraints and of the forces of the scene on all bodies, as of `_contacts`."""
    system, t = trajectory.system, float(trajectory.t[i])
    q, v, a = trajectory.q[i], trajectory.v[i], trajectory.a[i]
    total = np.zeros((system.model.njoints, 6))
    system.dynamics(t, q, v, a)
    for force in system.forces:
        wrenches = getattr(force, "wrenches", None)  # others act in the joints
        if wrenches is not None:
            wrenches(t, q, v, total)
    if system.constraints.names:
        system.constraint_rows(t, q, v, a).add_wrenches(
            np.concatenate((trajectory.la_g[i], trajectory.la_gamma[i])), total
        )
    return total
