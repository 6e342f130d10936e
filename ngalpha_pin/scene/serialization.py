"""A scene as plain data for a file: all but forces and constraints, which stay with the user."""

from __future__ import annotations

import copyreg
import warnings
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.errors import SceneError
from ngalpha_pin.flexible.beams import BeamPoint
from ngalpha_pin.flexible.cable import Cable
from ngalpha_pin.flexible.loads import LineLoad, PointLoad
from ngalpha_pin.flexible.planar_beam import PlanarBeam
from ngalpha_pin.flexible.rod import Rod
from ngalpha_pin.scene.compliance import compliance_from_plain, compliance_to_plain
from ngalpha_pin.scene.contact import ContactLaw, ContactPair
from ngalpha_pin.scene.contents import Contents, Entry
from ngalpha_pin.scene.convex_hull import hull
from ngalpha_pin.scene.extra_states import ExtraState
from ngalpha_pin.scene.forces import Force
from ngalpha_pin.scene.friction_curve import curve_from_plain, curve_to_plain
from ngalpha_pin.scene.friction_ellipse import FrictionEllipse
from ngalpha_pin.scene.joints import JointLaws
from ngalpha_pin.scene.meshes import load_mesh
from ngalpha_pin.scene.model_parts import check_again
from ngalpha_pin.scene.restitution import restitution_from_plain, restitution_to_plain
from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.scene.strands import Strand, StrandForce, StrandLoad
from ngalpha_pin.scene.surface_velocity import from_plain, to_plain
from ngalpha_pin.scene.unilateral import UnilateralConstraint
from ngalpha_pin.scene.visuals import VisualFile

# constructor arguments of each primitive shape, read from the shape
_PRIMITIVES: dict[str, tuple[str, ...]] = {
    "Sphere": ("radius",),
    "Capsule": ("radius", "halfLength"),
    "Cylinder": ("radius", "halfLength"),
    "Cone": ("radius", "halfLength"),
    "Box": ("halfSide",),
    "Ellipsoid": ("radii",),
    "Halfspace": ("n", "d"),
    "Plane": ("n", "d"),
}


def scene_to_dict(scene: Scene, times: np.ndarray | None = None) -> dict[str, Any]:
    """Everything of a scene but its forces and constraints.

    JSON can hold it, but for speeds of surfaces that are functions; these are kept at some times where they are given.
    """
    return {
        "model": scene.model.saveToString(),
        "collision": [_geometry_to_dict(g) for g in scene.declared_shapes.geometryObjects],
        "visual": None if scene.visuals is None else [_geometry_to_dict(g) for g in scene.visuals.geometryObjects],
        "visual_files": [asdict(file) for file in scene.visual_files],
        "contacts": [_pair_to_dict(pair, times) for pair in scene.contacts],
        "left_out": [_pair_to_dict(pair, times) for pair in scene.left_out],
        "disabled": sorted(sorted(pair) for pair in scene.disabled),
        "complete": [sorted(names) for names in scene.complete],
        "surfaces": {name: _law_to_dict(law, times) for name, law in scene.surfaces.items()},
        "joints": asdict(scene.joints),
        "beams": {name: _beam_to_dict(beam) for name, beam in scene.beams.items()},
        "beam_points": [list(point) for point in scene.beam_points],
        "rods": {name: rod.to_plain() for name, rod in scene.rods.items()},
        "cables": {name: cable.to_plain() for name, cable in scene.cables.items()},
        "rod_loads": [[f.name, f.force.tolist()] for f in scene.forces if isinstance(f, StrandLoad)],
        "loads": [{"kind": type(load).__name__, **asdict(load)} for load in scene.loads],
        "hollow": sorted(scene.hollow),
        "added": scene.added,
        "contents": [list(entry) for entry in scene.contents],
        "unilaterals": [[own.name, own.e_N, own.mu, own.n_F] for own in scene.unilaterals],
        "states": [[state.name, state.start.tolist(), state.scale] for state in scene.states],
    }


def scene_from_parts(
    content: dict[str, Any],
    model: pin.Model,
    constraints: list[Any],
    forces: list[Any],
    states: list[ExtraState],
    own: list[UnilateralConstraint],
) -> Scene:
    """A scene from its declaration, as `pickle` takes it from process to process.

    Raises:
        SceneError: the file of a mesh is gone.
    """
    missing = [e["path"] for e in content["collision"] if e["kind"] == "mesh" and not Path(e["path"]).is_file()]
    if missing:
        raise SceneError(f"the mesh {missing[0]} of the scene is gone")
    scene = scene_from_dict(content, model)
    scene.constraints, scene.forces, scene.states, scene.unilaterals = constraints, forces, states, own
    check_again(scene)
    return scene


def _declaration(scene: Scene) -> tuple[Any, ...]:
    """For pickle: a scene is its declaration, geometries by their files, forces and constraints as they are."""
    functions = scene.constraints, scene.forces, scene.states, scene.unilaterals
    return scene_from_parts, (scene_to_dict(scene), scene.model, *functions)


copyreg.pickle(Scene, _declaration)


def scene_from_dict(content: dict[str, Any], model: pin.Model | None = None) -> Scene:
    """The inverse of `scene_to_dict`. A mesh whose file is gone is left out with a warning."""
    if model is None:
        model = pin.Model()
        model.loadFromString(content["model"])
    visual = None if content["visual"] is None else _geometry_model(content["visual"], False)
    scene = Scene(model, visual_model=visual)
    scene.declared_shapes = _geometry_model(content["collision"], True)  # some are on the beams, not of the model
    scene.joints = JointLaws(**content["joints"])
    scene.beams = {name: _beam_from_dict(entry) for name, entry in content["beams"].items()}
    scene.beam_points = [BeamPoint(*point) for point in content["beam_points"]]
    strands: dict[str, Strand] = {name: Rod.from_plain(entry) for name, entry in content.get("rods", {}).items()}
    strands |= {name: Cable.from_plain(entry) for name, entry in content.get("cables", {}).items()}
    laws: list[Force] = [StrandForce(*item) for item in strands.items()]
    laws += [StrandLoad(name, strands[name], force) for name, force in content.get("rod_loads", [])]
    for law in laws:
        scene.add_force(law)
    for load in content["loads"]:
        scene.loads.append(LineLoad(**load) if load.pop("kind") == "LineLoad" else PointLoad(**load))
    names = {g.name for g in scene.declared_shapes.geometryObjects}
    scene.contacts = [_pair_from_dict(pair) for pair in content["contacts"] if {pair["a"], pair["b"]} <= names]
    scene.left_out = [_pair_from_dict(pair) for pair in content["left_out"] if {pair["a"], pair["b"]} <= names]
    scene.disabled = {frozenset(pair) for pair in content["disabled"]}
    scene.complete = [frozenset(names) for names in content["complete"]]
    scene.surfaces = {name: _law_from_dict(law) for name, law in content["surfaces"].items() if name in names}
    scene.visual_files = [VisualFile(**_tuples(entry)) for entry in content["visual_files"]]
    scene.contents = Contents(Entry(*entry) for entry in content["contents"])
    scene.states = [ExtraState(name, None, start, scale=scale) for name, start, scale in content["states"]]
    scene.unilaterals = [UnilateralConstraint.standing_in(*entry) for entry in content["unilaterals"]]
    for state in scene.states:
        state.check(scene)
    for own in scene.unilaterals:
        own.check(scene)
    scene.hollow, scene.added = set(content["hollow"]), list(content["added"])
    return scene


def _tuples(entry: dict[str, Any]) -> dict[str, Any]:
    folders = entry["package_dirs"]
    return {**entry, "package_dirs": None if folders is None else tuple(folders)}


def _law_to_dict(law: ContactLaw, times: np.ndarray | None) -> dict[str, Any]:
    numbers = {field.name: getattr(law, field.name) for field in fields(law)}
    curve = curve_to_plain(law.curve, times is None)
    ellipse = None if law.ellipse is None else asdict(law.ellipse)
    restitution = restitution_to_plain(law.restitution, times is None)
    apart = {"surface_velocity": to_plain(law.surface_velocity, times), "curve": curve, "restitution": restitution}
    return {**numbers, **apart, "compliance": compliance_to_plain(law.compliance), "ellipse": ellipse}


def _law_from_dict(law: dict[str, Any]) -> ContactLaw:
    ellipse = law.get("ellipse")
    apart: dict[str, Any] = {"surface_velocity": from_plain(law["surface_velocity"])}
    apart |= {"curve": curve_from_plain(law["curve"])}
    apart |= {"restitution": restitution_from_plain(law.get("restitution"))}
    apart |= {"ellipse": None if ellipse is None else FrictionEllipse(**ellipse)}
    return ContactLaw(**{**law, **apart, "compliance": compliance_from_plain(law.get("compliance"))})


def _pair_to_dict(pair: ContactPair, times: np.ndarray | None) -> dict[str, Any]:
    law = _law_to_dict(pair.law, times)
    return {"a": pair.geometry_a, "b": pair.geometry_b, "found": pair.found, "law": law}


def _pair_from_dict(entry: dict[str, Any]) -> ContactPair:
    return ContactPair(entry["a"], entry["b"], _law_from_dict(entry["law"]), entry["found"])


def _beam_to_dict(beam: PlanarBeam) -> dict[str, Any]:
    numbers = ("EA", "EI", "line_density", "degree", "elements", "gauss", "damping")
    return {
        **{name: getattr(beam, name) for name in numbers},
        "curve": beam.q_ref.reshape(-1, 2).tolist(),
        "plane": beam.plane.homogeneous.tolist(),
    }


def _beam_from_dict(entry: dict[str, Any]) -> PlanarBeam:
    curve, plane = np.array(entry.pop("curve")), pin.SE3(np.array(entry.pop("plane")))
    return PlanarBeam(curve=curve, plane=plane, **entry)


def _geometry_to_dict(geometry: pin.GeometryObject) -> dict[str, Any]:
    shape = geometry.geometry
    kind = type(shape).__name__
    entry: dict[str, Any] = {
        "name": geometry.name,
        "joint": int(geometry.parentJoint),
        "placement": geometry.placement.homogeneous.tolist(),
        "color": np.array(geometry.meshColor).tolist(),
        "kind": kind,
    }
    if kind in _PRIMITIVES:
        entry["size"] = [np.asarray(getattr(shape, name), dtype=float).tolist() for name in _PRIMITIVES[kind]]
        entry["swept"] = float(shape.getSweptSphereRadius())
    elif geometry.meshPath:
        entry |= {"kind": "mesh", "path": str(Path(geometry.meshPath).resolve())}
        entry["scale"] = np.array(geometry.meshScale).tolist()
    else:
        points = shape.vertices() if isinstance(shape, coal.BVHModelBase) else shape.points()
        entry |= {"kind": "points", "points": np.array(points).tolist()}
    return entry


def _geometry_model(entries: list[dict[str, Any]], later: bool) -> pin.GeometryModel:
    """Geometries from plain data; their meshes are loaded now, or later where something asks for them."""
    geometries, loader = pin.GeometryModel(), coal.CachedMeshLoader()
    for entry in entries:
        shape = _shape(entry, loader, later)
        if shape is None:
            warnings.warn(f"mesh {entry['path']} of {entry['name']!r} is gone; it is left out", stacklevel=4)
            continue
        geometry = pin.GeometryObject(entry["name"], entry["joint"], pin.SE3(np.array(entry["placement"])), shape)
        geometry.meshColor = np.array(entry["color"])
        if entry["kind"] == "mesh":
            geometry.meshPath, geometry.meshScale = entry["path"], np.array(entry["scale"])
        geometries.addGeometryObject(geometry)
    return geometries


def _shape(entry: dict[str, Any], loader: coal.MeshLoader, later: bool) -> coal.CollisionGeometry | None:
    kind = entry["kind"]
    if kind == "mesh":
        if not Path(entry["path"]).is_file():
            return None
        return coal.BVHModelOBBRSS() if later else load_mesh(entry["path"], np.array(entry["scale"]), loader)
    if kind == "points":
        return hull(f"geometry {entry['name']!r}", np.array(entry["points"], dtype=float))
    size = entry["size"]
    if kind == "Box":
        shape = coal.Box(*(2 * np.array(size[0])))
    elif kind in ("Capsule", "Cylinder", "Cone"):
        shape = getattr(coal, kind)(size[0], 2 * size[1])
    elif kind in ("Halfspace", "Plane"):
        shape = getattr(coal, kind)(np.array(size[0]), size[1])
    else:
        shape = coal.Ellipsoid(*size[0]) if kind == "Ellipsoid" else coal.Sphere(size[0])
    shape.setSweptSphereRadius(entry["swept"])
    return shape
