"""What a compiled MJCF model declares: used, approximated, left out, or without effect on the motion."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ngalpha_pin.scene.contents import Entry, Fate, listed
from ngalpha_pin.scene.mjcf.ball_limits import limited_balls
from ngalpha_pin.scene.mjcf.compiler import mujoco
from ngalpha_pin.scene.mjcf.equality import fixed_tendon, taken
from ngalpha_pin.scene.mjcf.forces import scalar, why_not_actuator
from ngalpha_pin.scene.mjcf.geometry import touches
from ngalpha_pin.scene.mjcf.tendons import has_length_limit, has_range
from ngalpha_pin.scene.mjcf.tree import Tree


def contents(m: Any, tree: Tree) -> list[Entry]:
    """Every kind that the file has, in the order bodies, joints, geoms, constraints, tendons, actuators, options."""
    parts = (_bodies, _joints, _geoms, _equalities, _tendons, _actuators, _medium, _others)
    return [row for part in parts for row in part(m, tree) if row.number]


def _row(what: str, which: Any, names: list[str] | None, fate: Fate, reason: str) -> Entry:
    """One line about those for which `which` is true, with their names."""
    found = np.flatnonzero(which)
    who = f" ({listed(names[i] for i in found)})" if names is not None and len(found) else ""
    return Entry(what, len(found), fate, reason + who)


def _field(m: Any, name: str, like: Any) -> np.ndarray:
    """An array that not every version of MuJoCo has; zeros of the length of another one where it is missing."""
    found = getattr(m, name, None)
    if found is None or not len(like):
        return np.zeros(len(like), dtype=bool)
    return np.asarray(np.array(found).reshape(len(like), -1).any(axis=1), dtype=bool)


def _bodies(m: Any, tree: Tree) -> Iterator[Entry]:
    names = tree.names.bodies
    yield Entry("bodies", m.nbody - 1, "used")
    yield Entry("sites", m.nsite, "used", "as frames")
    yield Entry("keyframes", m.nkey, "used", "scene.keyframes; of each the configuration")
    yield _row("gravcomp", m.body_gravcomp, names, "left out", "bodies weigh what they weigh")
    yield _row("mocap", m.body_mocapid >= 0, names, "approximated", "fixed where the file puts them")


def _joints(m: Any, tree: Tree) -> Iterator[Entry]:
    names = tree.names.joints
    is_scalar = np.array([scalar(m, j) for j in range(m.njnt)], dtype=bool)
    free = np.array([m.jnt_type[j] == mujoco().mjtJoint.mjJNT_FREE for j in range(m.njnt)], dtype=bool)
    of_free = np.isin(m.dof_jntid, np.flatnonzero(free))
    yield Entry("joints", m.njnt, "used")
    limits = np.array(m.jnt_limited, dtype=bool)
    yield _row("joint range", limits & is_scalar, None, "used", "rigid, without solref, solimp and margin")
    yield _row("range of ball joints", limited_balls(m), None, "used", "rigid, as unilateral constraints")
    stiff = np.array(m.jnt_stiffness) != 0
    yield _row("joint stiffness", stiff, None, "used", "")
    poly = _field(m, "jnt_stiffnesspoly", m.jnt_type)
    yield _row("nonlinear joint stiffness", poly, names, "approximated", "by its linear part")
    of = [names[j] for j in m.dof_jntid]
    yield _row("joint damping", m.dof_damping, None, "used", "")
    poly = _field(m, "dof_dampingpoly", m.dof_jntid)
    yield _row("nonlinear joint damping", poly, of, "approximated", "by its linear part")
    yield _row("armature", m.dof_armature, None, "used", "")
    uneven = of_free & ((np.array(m.dof_armature) != 0) | (np.array(m.dof_frictionloss) != 0))
    reason = "along the axes of the body, not of the world"
    yield _row("armature and frictionloss of free joints", uneven, of, "approximated", reason)
    yield _row("frictionloss", m.dof_frictionloss, None, "used", "set-valued")


def _geoms(m: Any, tree: Tree) -> Iterator[Entry]:
    names, kinds = tree.names.geoms, mujoco().mjtGeom
    hits = np.array([touches(m, g) for g in range(m.ngeom)], dtype=bool)
    yield _row("geoms", hits, None, "used", "")
    yield _row("geoms that touch nothing", ~hits, None, "no effect", "drawn only")
    is_sdf = np.array(m.geom_type) == kinds.mjGEOM_SDF
    yield _row("sdf geoms", hits & is_sdf, names, "left out", "signed distance fields are not read")
    meshes = hits & (np.array(m.geom_type) == kinds.mjGEOM_MESH)
    yield _row("mesh geoms", meshes, None, "used", "by their convex hull, as MuJoCo does")
    condim, (slide, torsion, roll) = np.array(m.geom_condim), np.array(m.geom_friction).reshape(-1, 3).T
    turns = hits & (condim > 3) & (torsion > 0.0)
    yield _row("torsional friction", turns & (slide > 0.0), None, "used", "by the elliptic cone, condim 4 and 6")
    yield _row("torsional friction", turns & (slide == 0.0), names, "left out", "without friction against sliding")
    rolls = hits & (condim > 4) & (roll > 0.0)
    yield _row("rolling friction", rolls, names, "approximated", "with a cone of its own beside that of sliding")
    margin = hits & (np.array(m.geom_margin) != 0)
    yield _row("margin", margin, names, "left out", "contact begins where the surfaces touch")
    for name, what in (("geom_adhesion", "adhesion"), ("geom_surfacevel", "surface velocity")):
        yield _row(what, hits & _field(m, name, m.geom_type), names, "left out", "not supported")
    yield Entry("contact pairs", m.npair, "used", "with their friction")
    friction = np.array(m.pair_friction).reshape(-1, 5)
    uneven = (friction[:, 0] != friction[:, 1]) | ((np.array(m.pair_dim) > 4) & (friction[:, 3] != friction[:, 4]))
    yield _row("anisotropic friction of pairs", uneven, None, "approximated", "the first coefficient in all directions")
    rolls = (np.array(m.pair_dim) > 4) & (friction[:, 3] > 0.0)
    yield _row(
        "rolling friction of pairs", rolls, None, "approximated", "with a cone of its own beside that of sliding"
    )
    yield Entry("excluded pairs", m.nexclude, "used")


def _equalities(m: Any, tree: Tree) -> Iterator[Entry]:
    names, active = tree.names.equalities, np.array(m.eq_active0, dtype=bool)
    known = np.array([taken(m, i) for i in range(m.neq)], dtype=bool)
    yield _row("equality constraints", active & known, None, "used", "rigid, without solref and solimp")
    yield _row("equality constraints that are not active", ~active, None, "no effect", "")
    kind = "between flexes, distances or tendons through sites"
    yield _row("equality constraints", active & ~known, names, "left out", kind)


def _tendons(m: Any, tree: Tree) -> Iterator[Entry]:
    names = tree.names.tendons
    fixed = np.array([fixed_tendon(m, t) is not None for t in range(m.ntendon)], dtype=bool)
    limited = np.array(m.tendon_limited, dtype=bool)
    contact = np.array([has_length_limit(m, t) for t in range(m.ntendon)], dtype=bool)
    ranged = np.array([has_range(m, t) for t in range(m.ntendon)], dtype=bool)
    acts = (np.array(m.tendon_stiffness) != 0) | (np.array(m.tendon_damping) != 0)
    acts |= (limited & ~ranged) | (np.array(m.tendon_frictionloss) != 0)
    yield _row("fixed tendons", fixed, None, "used", "their springs, dampers, actuators and equalities")
    yield _row("range of tendons between two sites", contact, None, "used", "rigid, as contacts")
    yield _row("tendon range", ranged & ~contact, None, "used", "rigid, as unilateral constraints")
    reason = "of tendons through sites only the range is read, and not around geoms"
    yield _row("spatial tendons", ~fixed & acts, names, "left out", reason)
    yield _row("tendon frictionloss", fixed & (np.array(m.tendon_frictionloss) != 0), names, "left out", "no friction")
    yield _row("tendon armature", _field(m, "tendon_armature", m.tendon_adr), names, "left out", "no inertia")
    for name in ("stiffness", "damping"):
        poly = _field(m, f"tendon_{name}poly", m.tendon_adr)
        yield _row(f"nonlinear tendon {name}", poly, names, "approximated", "by its linear part")


def _actuators(m: Any, tree: Tree) -> Iterator[Entry]:
    names = tree.names.actuators
    why = [why_not_actuator(m, i) for i in range(len(names))]
    yield _row("actuators", [not reason for reason in why], None, "used", "scene.actuators; set their ctrl")
    for reason in dict.fromkeys(filter(None, why)):
        yield _row(f"actuators {reason}", [other == reason for other in why], names, "left out", "not supported")
    for name in ("armature", "damping"):
        yield _row(f"actuator {name}", _field(m, f"actuator_{name}", names), names, "left out", "not supported")


def _medium(m: Any, tree: Tree) -> Iterator[Entry]:
    for what in ("density", "viscosity"):
        value = float(getattr(m.opt, what))
        yield Entry(f"{what} of the medium", int(value != 0), "left out", f"{value:g}: there is no fluid force")
    fluid = _field(m, "geom_fluid", m.geom_type)
    yield _row("fluidshape", fluid, None, "no effect" if not m.opt.density else "left out", "there is no fluid force")
    yield Entry("wind", int(np.any(m.opt.wind)), "left out", "there is no fluid force")


def _others(m: Any, tree: Tree) -> Iterator[Entry]:
    yield Entry("flexible bodies", m.nflex, "left out", "beams are declared by scene.add_beam")
    yield Entry("plugins", m.nplugin, "left out", "not supported")
    yield Entry("skins", m.nskin, "no effect", "not drawn")
    yield Entry("sensors", m.nsensor, "no effect", "read the trajectory")
    yield Entry("cameras", m.ncam, "no effect", "")
    yield Entry("lights", m.nlight, "no effect", "")
    reason = f"timestep {m.opt.timestep:g}, solver and integrator are arguments of simulate"
    yield Entry("solver options", 1, "no effect", reason)
