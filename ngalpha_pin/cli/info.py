"""What a scene computes and what it leaves out, row by row: what its structure says, and calls that were counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import coal
import numpy as np

from ngalpha_pin.cli.call_counter import counted_calls
from ngalpha_pin.contact.cones import DRILLING, ROLLING
from ngalpha_pin.errors import NgalphaError
from ngalpha_pin.initialization.initial import initial_state
from ngalpha_pin.integrators.generalized_alpha import GeneralizedAlpha
from ngalpha_pin.scene.meshes import hull_excess
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.system import System

Rows = list[tuple[str, str]]
STEPS = 300  # in which calls are counted


def tables(scene: Scene, q0: np.ndarray, v0: np.ndarray, dt: float) -> dict[str, Rows]:
    """The rows of every table, by its title.

    Args:
        scene: to tell about.
        q0: start of the steps in which calls are counted, shape (nq,).
        v0: its velocity, shape (nv,).
        dt: length of these steps [s].
    """
    if not scene.q_ref.size:
        return {"scene": [("coordinates", "none: nothing moves")]}
    system = System(scene)
    return {
        "scene": list(_scene_rows(system)),
        "every step": list(_step_rows(system)),
        f"calls counted over {STEPS} steps of {dt:g} s": list(_counted_rows(scene, q0, v0, dt)),
        "left out": list(_absent_rows(system)),
    }


def file_tables(scene: Scene) -> dict[str, Rows]:
    """What the files of a scene declare and what becomes of it; no table where it was built without files."""
    if not scene.contents:
        return {}
    rows = [(f"{e.what}: {e.number}", f"{e.fate}{f': {e.reason}' if e.reason else ''}") for e in scene.contents]
    meshes = [g for g in scene.collision_model.geometryObjects if isinstance(g.geometry, coal.BVHModelBase)]
    hulls = {g.name: hull_excess(g) for g in meshes}
    if meshes:
        larger = sum(volumes is not None for volumes in hulls.values())
        fate = f"approximated: it is larger for {larger}" if larger else "used"
        rows.append((f"meshes: {len(meshes)}", f"{fate}; contact takes their convex hull"))
    for name, volumes in hulls.items():
        if volumes is not None:
            mesh, hull = volumes
            rows.append((f"  {name}", f"hull of {hull:.3g} m^3, {hull / mesh - 1:.0%} more than the mesh"))
    return {"file": rows}


def _counted_rows(scene: Scene, q0: np.ndarray, v0: np.ndarray, dt: float) -> Iterator[tuple[str, str]]:
    """How often the functions of Pinocchio and coal are called, per evaluation of the equations of motion."""
    method, n_iter, steps = GeneralizedAlpha(), 0, 0
    try:
        with counted_calls() as start:
            system = System(scene)
            state = initial_state(system, q0, v0)
        with counted_calls() as calls:
            while steps < STEPS:
                result = method.step(system, state, dt)
                if not result.converged:
                    break
                state, n_iter, steps = result.state, n_iter + result.n_iter, steps + 1
    except NgalphaError as error:
        yield "none", f"the start cannot be used: {error}"
        return
    evaluations = calls["pin.computeRNEADerivatives"]
    yield "evaluations", f"{evaluations / max(steps, 1):.3g} per step, with {n_iter / max(steps, 1):.3g} iterations"
    for name, count in sorted(calls.items(), key=lambda item: (-item[1], item[0])):
        yield name, f"{count / max(evaluations, 1):.3g} per evaluation, {count} in all"
    if not any(name.startswith("coal.") for name in calls):
        yield "coal", "no call: every gap is a closed form of the poses"
    at_start = ", ".join(f"{name} {count}" for name, count in sorted(start.items()))
    yield "at the start", at_start or "no call"


def _scene_rows(system: System) -> Iterator[tuple[str, str]]:
    scene, model, table = system.scene, system.tree, system.contacts
    kinds = Counter(joint.shortname().removeprefix("JointModel") for joint in list(model.joints)[1:])
    yield "model", model.name
    yield "coordinates", f"nq = {system.nq}, nv = {system.nv}"
    yield "joints", ", ".join(f"{n} {kind}" for kind, n in kinds.items()) or "none"
    yield "bodies", f"{sum(inertia.mass > 0 for inertia in list(model.inertias)[1:])} with mass"
    yield "mass", f"{sum(inertia.mass for inertia in model.inertias):.6g} kg"
    if system.beams is not None:
        n, points = len(scene.beams), len(scene.beam_points)
        yield "beams", f"{n} with {system.beams.n} coordinates and {points} named points, {system.beams.mass:.6g} kg"
    for kind, strands in (("rods", scene.rods), ("cables", scene.cables)):
        if strands:
            nodes, mass = (sum(x) for x in zip(*((s.nodes, s.mass) for s in strands.values()), strict=True))
            yield kind, f"{len(strands)} with {nodes} nodes, {mass:.6g} kg"
    visual = 0 if scene.visual_model is None else scene.visual_model.ngeoms
    yield "geometries", f"{scene.declared_shapes.ngeoms} for contact, {visual} to draw"
    yield "contacts", f"{table.n_points} points of {len(scene.contacts)} pairs of geometries"
    yield from _surface_rows(system)
    if table.n > table.n_points:
        yield "joint limits", f"{table.n - table.n_points}, each a contact without friction"
    if system.joint_friction.f:
        yield "joint dry friction", f"of {system.joint_friction.f} coordinates"
    if system.damping is not None:
        yield "joint damping", f"of {int((system.damping > 0).sum())} coordinates"
    kinds = Counter(type(constraint).__name__ for constraint in scene.constraints)
    if kinds:
        yield "constraints", ", ".join(f"{n} {kind}" for kind, n in kinds.items())
    forces = Counter(type(force).__name__ for force in scene.forces)
    yield "forces", ", ".join(f"{n} {kind}" for kind, n in forces.items()) or "none"


def _surface_rows(system: System) -> Iterator[tuple[str, str]]:
    """Pieces of one body that touch each other: what of them is no surface, and up to where they are flush."""
    solids = {id(solid): solid.exposed for pair in system.slots.pairs for solid in pair.solids}
    pieces = [piece for piece in solids.values() if piece is not None]
    if not pieces:
        return
    faces, edges = (sum(int(np.sum(~getattr(p, name))) for p in pieces) for name in ("faces", "edges"))
    tol, shift = (max(getattr(p, name) for p in pieces) for name in ("tol", "shift"))
    hidden = f"{faces} faces and {edges} parts of edges are covered or go on"
    flush = f"those off by less than {tol:.1g} m are flush (moved by at most {shift:.1g} m)"
    yield "pieces of a surface", f"{len(pieces)} that touch others of their body, of which {hidden}; {flush}"


def _step_rows(system: System) -> Iterator[tuple[str, str]]:
    nv, table, constraints = system.nv, system.contacts, system.constraints
    layout = system.layout(table.subset(np.arange(table.n_points)))
    always = layout.n - layout.n_c
    blocks = f"a, U and Q, {nv} each" if always else "the accelerations"
    yield (
        "in flight",
        f"{(3 * nv if always else nv) + always} unknowns: {blocks}" + (f", and {always} multipliers" if always else ""),
    )
    if constraints.kb + constraints.mb:
        yield "constraint rows", f"{constraints.kb} of g, {constraints.mb} of gamma"
    if system.joint_friction.f:
        yield "joint friction rows", str(system.joint_friction.f)
    if table.n_points:
        drilling, rolling = int((table.kind_F == DRILLING).sum()), int((table.kind_F >= ROLLING).sum())
        tangential = len(table.kind_F) - drilling - rolling
        dropped = 2 * int((table.mu > 0).sum()) - tangential
        planar = f" ({dropped} dropped: the motion is planar)" if dropped else ""
        yield "all contacts closed", f"{3 * nv + layout.n} unknowns: a, U and Q, {nv} each, and {layout.n} multipliers"
        yield "Newton matrix", f"at most {layout.n} x {layout.n}, for the multipliers alone"
        yield "normal rows", str(table.n_points)
        rolls = f", {rolling} rolling" if rolling else ""
        yield "friction rows", f"{tangential} tangential{planar}, {drilling} drilling{rolls}"
    if table.n > table.n_points:
        yield "each limit reached", "3 multipliers more"
    yield "evaluation calls", "pin.integrate, pin.computeRNEADerivatives"
    if not system.flat:
        yield "correction", "pin.dIntegrate"
    if table.n:
        yield "search for contact", "pin.forwardKinematics"
    if table.n_points:
        yield "impact law", "pin.computeJointJacobiansTimeVariation"


def _absent_rows(system: System) -> Iterator[tuple[str, str]]:
    table = system.contacts
    if table.n == 0:
        yield "contact", "none is declared: no contact code runs"
    elif table.n_points == 0:
        yield "contact", "none is declared: only limits of joints are looked at"
    else:
        yield "open contacts", "those that cannot close within a step are not unknowns of it"
        if not (table.mu > 0).any() and not table.resists:
            yield "friction", "mu = 0: no friction rows"
        elif DRILLING not in table.kind_F:
            yield "drilling friction", "contact_radius = 0"
        if not _restitutes(system):
            yield "restitution", "e_N = e_F = 0: no velocities at the start of a step"
        if not table.curved.any() and table.n_points:
            yield "curvature", "every surface is a plane"
    if not system.scene.forces:
        yield "forces", "none is declared"
    if system.flat:
        yield "pin.dIntegrate", "every coordinate is a plain number: it is the identity"
    if not system.scene.constraints:
        yield "constraints", "none is declared: no such rows"
    for name in dict.fromkeys(system.constraints.still):
        yield "rows of a constraint", f"{name}: those that no motion changes"
    yield from _ignored_joint_laws(system)


def _ignored_joint_laws(system: System) -> Iterator[tuple[str, str]]:
    """What the model says of its joints and the scene does not take, or what it does not say."""
    laws = system.scene.joints
    stated = {
        "limits": (laws.limits, system.contacts.n > system.contacts.n_points),
        "friction": (laws.friction, system.joint_friction.f > 0),
        "damping": (laws.damping, system.damping is not None),
        "effort": (laws.effort, system.effort is not None),
    }
    for name, (asked, there) in stated.items():
        if not there:
            yield f"joint {name}", "the model states none" if asked else "switched off in the scene"


def _restitutes(system: System) -> bool:
    return bool(system.contacts.e_N.any() or system.contacts.e_F.any())
