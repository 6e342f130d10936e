"""Equality constraints of a compiled MJCF model that are active: connect, weld, joint and fixed tendon."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.scene.constraints import Constraint, JointCoupling, PointJoint, Weld
from ngalpha_pin.scene.mjcf.compiler import Names, disabled, mujoco, one_of, pose

TERMS = 5  # of polycoef


def taken(m: Any, i: int) -> bool:
    """Whether the kind of an equality constraint is one of those that are read here."""
    kinds = mujoco().mjtEq
    if m.eq_type[i] == kinds.mjEQ_TENDON:
        return all(t < 0 or fixed_tendon(m, t) is not None for t in (m.eq_obj1id[i], m.eq_obj2id[i]))
    if m.eq_type[i] == kinds.mjEQ_JOINT:
        scalar = (mujoco().mjtJoint.mjJNT_HINGE, mujoco().mjtJoint.mjJNT_SLIDE)
        return all(j < 0 or one_of(m.jnt_type[j], *scalar) for j in (m.eq_obj1id[i], m.eq_obj2id[i]))
    return one_of(m.eq_type[i], kinds.mjEQ_CONNECT, kinds.mjEQ_WELD)


def equality_constraints(m: Any, names: Names) -> list[Constraint]:
    """The active constraints that are taken, in the order of the file."""
    if disabled(m, "EQUALITY"):
        return []
    kinds = mujoco().mjtEq
    active = [i for i in range(m.neq) if m.eq_active0[i] and taken(m, i)]
    of_frames = [one_of(m.eq_type[i], kinds.mjEQ_CONNECT, kinds.mjEQ_WELD) for i in active]
    return [
        (_between_frames if f else _between_coordinates)(m, names, i) for i, f in zip(active, of_frames, strict=True)
    ]


def _between_frames(m: Any, names: Names, i: int) -> Constraint:
    """A connect or a weld, of bodies at the poses in `eq_data` or of sites as they are."""
    name, data, (first, second) = names.equalities[i], m.eq_data[i], (int(m.eq_obj1id[i]), int(m.eq_obj2id[i]))
    weld = m.eq_type[i] == mujoco().mjtEq.mjEQ_WELD
    if m.eq_objtype[i] == mujoco().mjtObj.mjOBJ_SITE:
        (a, at_a), (b, at_b) = site_of(m, names, first), site_of(m, names, second)
        return (Weld if weld else PointJoint)(a, b, placement_a=at_a, placement_b=at_b, name=name)
    a, b = names.bodies[first], names.bodies[second]
    if weld:
        anchor = pin.SE3(np.eye(3), np.array(data[:3]))
        return Weld(a, b, placement_a=pose(data[3:6], data[6:10]), placement_b=anchor, name=name)
    at_a, at_b = (pin.SE3(np.eye(3), np.array(data[k : k + 3])) for k in (0, 3))
    return PointJoint(a, b, placement_a=at_a, placement_b=at_b, name=name)


def site_of(m: Any, names: Names, site: int) -> tuple[str, pin.SE3]:
    """Body of a site and the pose of the site there: a site may have the name of a body."""
    return names.bodies[m.site_bodyid[site]], pose(m.site_pos[site], m.site_quat[site])


def _between_coordinates(m: Any, names: Names, i: int) -> Constraint:
    """Of two joints or two fixed tendons, x - x0 = polynomial(y - y0); without the second one x is constant."""
    of_joints = m.eq_type[i] == mujoco().mjtEq.mjEQ_JOINT
    (first, start), (second, leads_from) = (
        _coordinate(m, names, int(k), of_joints) for k in (m.eq_obj1id[i], m.eq_obj2id[i])
    )
    terms = np.polynomial.Polynomial(m.eq_data[i][:TERMS])
    if second:
        # a polynomial of degree 0 of another one is a number
        shifted: Any = terms(np.polynomial.Polynomial((-leads_from, 1.0)))
        coefficients = [float(x) for x in np.atleast_1d(getattr(shifted, "coef", shifted))]
    else:
        coefficients = [float(terms(0.0))]
    coefficients[0] += start
    return JointCoupling(_alone(first), _alone(second), coefficients, names.equalities[i])


def _coordinate(m: Any, names: Names, k: int, of_joints: bool) -> tuple[dict[str, float], float]:
    """Factors by joint name of a joint or a tendon, and its value at the reference."""
    if k < 0:
        return {}, 0.0
    if of_joints:
        return {names.joints[k]: 1.0}, float(m.qpos0[m.jnt_qposadr[k]])
    return named(names, fixed_tendon(m, k) or {}), float(m.tendon_length0[k])


def _alone(factors: Mapping[str, float]) -> str | Mapping[str, float]:
    return next(iter(factors)) if list(factors.values()) == [1.0] else factors


def fixed_tendon(m: Any, tendon: int) -> dict[int, float] | None:
    """Coefficients of a fixed tendon by joint; None of a spatial one."""
    first = int(m.tendon_adr[tendon])
    factors: dict[int, float] = {}
    for w in range(first, first + int(m.tendon_num[tendon])):
        if m.wrap_type[w] != mujoco().mjtWrap.mjWRAP_JOINT:
            return None
        joint = int(m.wrap_objid[w])
        factors[joint] = factors.get(joint, 0.0) + float(m.wrap_prm[w])
    return {joint: factor for joint, factor in factors.items() if factor}


def named(names: Names, factors: Mapping[int, float]) -> dict[str, float]:
    """Factors by the name of the joint."""
    return {names.joints[joint]: factor for joint, factor in factors.items()}
