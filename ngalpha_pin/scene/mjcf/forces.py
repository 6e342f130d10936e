"""Springs of joints and tendons, and actuators of a compiled MJCF model, as forces."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ngalpha_pin.scene.actuator import NO_RANGE, JointActuator
from ngalpha_pin.scene.forces import Force, JointSpring
from ngalpha_pin.scene.mjcf.compiler import Names, disabled, mujoco, one_of
from ngalpha_pin.scene.mjcf.equality import fixed_tendon, named
from ngalpha_pin.scene.pose_spring import PoseSpring


def forces(m: Any, names: Names) -> list[Force]:
    """Everything that pulls or drives and is taken."""
    found: list[Force] = [*_joint_springs(m, names), *_tendon_springs(m, names)]
    if not disabled(m, "ACTUATION"):
        found += [_actuator(m, names, i) for i in range(len(m.actuator_trntype)) if not why_not_actuator(m, i)]
    return found


def scalar(m: Any, joint: int) -> bool:
    """A hinge or a slide."""
    return one_of(m.jnt_type[joint], mujoco().mjtJoint.mjJNT_HINGE, mujoco().mjtJoint.mjJNT_SLIDE)


def _joint_springs(m: Any, names: Names) -> Iterator[Force]:
    for j in range(m.njnt):
        if m.jnt_stiffness[j] and scalar(m, j) and not disabled(m, "SPRING"):
            yield JointSpring(names.joints[j], float(m.jnt_stiffness[j]), float(m.qpos_spring[m.jnt_qposadr[j]]))
        elif m.jnt_stiffness[j] and not disabled(m, "SPRING"):
            free, first = one_of(m.jnt_type[j], mujoco().mjtJoint.mjJNT_FREE), int(m.jnt_qposadr[j])
            rest = np.array(m.qpos_spring[first : first + (7 if free else 4)])
            rest[-4:] = rest[[-3, -2, -1, -4]]
            yield PoseSpring(names.joints[j], float(m.jnt_stiffness[j]), rest)


def _tendon_springs(m: Any, names: Names) -> Iterator[Force]:
    """Of fixed tendons; `springlength` is a range without force."""
    for t in range(m.ntendon):
        factors = fixed_tendon(m, t)
        stiffness = 0.0 if disabled(m, "SPRING") else float(m.tendon_stiffness[t])
        damping = 0.0 if disabled(m, "DAMPER") else float(m.tendon_damping[t])
        if factors and (stiffness or damping):
            lower, upper = (float(x) for x in m.tendon_lengthspring[t])
            yield JointSpring(named(names, factors), stiffness, (lower, upper), damping)


def why_not_actuator(m: Any, i: int) -> str:
    """Why an actuator is left out; empty where it is taken."""
    module = mujoco()
    transmission, target = m.actuator_trntype[i], int(m.actuator_trnid[i, 0])
    if one_of(transmission, module.mjtTrn.mjTRN_JOINT, module.mjtTrn.mjTRN_JOINTINPARENT):
        if not scalar(m, target):
            return "on a ball or free joint"
    elif transmission != module.mjtTrn.mjTRN_TENDON or fixed_tendon(m, target) is None:
        return "neither on a joint nor on a fixed tendon"
    if m.actuator_dyntype[i] != module.mjtDyn.mjDYN_NONE:
        return "with a state of its own"
    if not one_of(m.actuator_gaintype[i], module.mjtGain.mjGAIN_FIXED, module.mjtGain.mjGAIN_AFFINE):
        return "whose gain is not affine"
    if not one_of(m.actuator_biastype[i], module.mjtBias.mjBIAS_NONE, module.mjtBias.mjBIAS_AFFINE):
        return "whose bias is not affine"
    if not m.actuator_gear[i, 0]:
        return "with the gear 0"
    delay = getattr(m, "actuator_delay", None)
    return "with a delay" if delay is not None and delay[i] else ""


def _actuator(m: Any, names: Names, i: int) -> JointActuator:
    module, target = mujoco(), int(m.actuator_trnid[i, 0])
    of_tendon = m.actuator_trntype[i] == module.mjtTrn.mjTRN_TENDON
    joints = (fixed_tendon(m, target) or {}) if of_tendon else {target: 1.0}
    gear = float(m.actuator_gear[i, 0])
    affine = m.actuator_gaintype[i] == module.mjtGain.mjGAIN_AFFINE
    gain = [float(x) for x in m.actuator_gainprm[i][: 3 if affine else 1]]
    biased = m.actuator_biastype[i] == module.mjtBias.mjBIAS_AFFINE
    bias = [float(x) for x in m.actuator_biasprm[i][: 3 if biased else 0]]
    clamped = m.actuator_ctrllimited[i] and not disabled(m, "CLAMPCTRL")
    return JointActuator(
        names.actuators[i],
        named(names, {joint: gear * factor for joint, factor in joints.items()}),
        gain=_three(gain),
        bias=_three(bias),
        ctrl_range=_range(m.actuator_ctrlrange[i]) if clamped else NO_RANGE,
        force_range=_range(m.actuator_forcerange[i]) if m.actuator_forcelimited[i] else NO_RANGE,
    )


def _three(numbers: list[float]) -> tuple[float, float, float]:
    a, b, c = [*numbers, 0.0, 0.0, 0.0][:3]
    return a, b, c


def _range(ends: Any) -> tuple[float, float]:
    return float(ends[0]), float(ends[1])
