"""A trajectory as one HTML file: the motion in 3D, the contact forces, plots, events and the audit."""

from __future__ import annotations

import html
import os
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.common.files import write_text
from ngalpha_pin.common.optional import require
from ngalpha_pin.errors import SceneError

from .contacts import contact_frames, friction_coefficients, in_the_world, reference_force
from .curves import Curve, panels, thinned
from .frames import FPS, Frames, bounds, drawn_geometries, sample
from .objects import EXT_KINDS, recorded_objects
from .pairs import contact_events, pair_events
from .payload import Payload
from .planes import Plane, is_plane, nice, planes
from .tubes import COLOR, Tube

if TYPE_CHECKING:
    from ngalpha_pin import Trajectory

SCRIPTS = ("payload", "stage", "tubes", "bodies", "arrows", "plot", "plots", "panel", "player")
TINTS = ((0.90, 0.35, 0.20, 0.55), (0.10, 0.55, 0.45, 0.55), (0.55, 0.30, 0.75, 0.55), (0.85, 0.65, 0.05, 0.55))
CURVE_POINTS = 3000
MOST_FPS = 1e5
FOLLOW = 8.0  # the camera follows a centre of mass that travels so many diagonals of the system
ARROW_LENGTH = 0.3  # of an arrow of the reference force, in parts of the size that arrows are scaled to


def save_html(
    trajectory: Trajectory | Sequence[Trajectory],
    path: str | os.PathLike[str],
    labels: Sequence[str] | None = None,
    title: str | None = None,
    fps: float = FPS,
) -> Path:
    """Write a page that replays a run without network, with forces, plots, events and the audit.

    Args:
        trajectory: a run, or several to show in one scene: the first in its colours, the others as ghosts.
        path: of the file; one that is there is replaced when the new one is whole.
        labels: names of the runs.
        title: of the page; the name of the model by default.
        fps: frames per second of simulated time [1/s]; the page interpolates between them.

    Returns:
        The path.

    Raises:
        SceneError: nothing to show, or labels that do not match. MissingPackageError: meshcat is not installed.
        NotWritten: the disk is full, or the folder cannot be written to.
    """
    path = checks.path("path", path)
    write_text(path, page(trajectory, labels, title, fps))
    return path


def page(
    trajectory: Trajectory | Sequence[Trajectory],
    labels: Sequence[str] | None = None,
    title: str | None = None,
    fps: float = FPS,
) -> str:
    """The text of the page that `save_html` writes, with the same arguments."""
    runs = list(trajectory) if isinstance(trajectory, Sequence) else [trajectory]
    if not runs:
        raise SceneError("a replay needs at least one trajectory")
    labels = [f"run {k + 1}" for k in range(len(runs))] if labels is None else labels
    if isinstance(labels, str) or not isinstance(labels, Sequence):
        raise checks.fail("replay: labels", labels, "a list of names")
    if len(labels) != len(runs):
        raise SceneError(f"replay: {len(runs)} trajectories, but {len(labels)} labels")
    labels = [checks.name("replay: label", label) for label in labels]
    fps = checks.number("replay: fps", fps, 0.0, MOST_FPS, above=True)
    title = runs[0].scene.model.name if title is None else checks.name("replay: title", title)
    payload, shapes = Payload(), Payload()
    header = _header(payload, runs, labels, fps)
    content = {
        "title": html.escape(title),
        "style": _own("page.css"),
        "meshcat": _meshcat_bundle(),
        "payload": payload.encode({**header, "title": title}),
        "shapes": shapes.encode({"runs": [_objects(shapes, run) for run in runs]}),
        "script": "\n".join(_own(f"{name}.js") for name in SCRIPTS),
    }
    content["about"] = _about(content)
    return Template(_own("page.html")).substitute(content)


def _about(content: dict[str, str]) -> str:
    """What the page weighs, part by part; its text is all ASCII but for a few characters."""
    megabytes = {name: len(text) / 1e6 for name, text in content.items()}
    rest = sum(megabytes.values()) - megabytes["payload"] - megabytes["shapes"]
    return (
        f"This page has {sum(megabytes.values()):.2f} MB: motion and curves {megabytes['payload']:.2f} MB, "
        f"shapes and meshes {megabytes['shapes']:.2f} MB, the viewer {rest:.2f} MB."
    )


def _own(name: str) -> str:
    return (files(__package__) / name).read_text(encoding="utf-8")


def _meshcat_bundle() -> str:
    """The script of meshcat's viewer, which contains three.js."""
    require("meshcat", "save_html", "pip install meshcat")
    bundle = files("meshcat") / "viewer" / "dist" / "main.min.js"
    return bundle.read_text(encoding="utf-8").replace("</script", "<\\/script")


def _header(payload: Payload, runs: list[Trajectory], labels: list[str], fps: float) -> dict[str, Any]:
    """Everything the page shows."""
    frames = [sample(run, fps) for run in runs]
    boxes = [bounds(run.scene, f) for run, f in zip(runs, frames, strict=True)]
    low, high = _union([box.motion for box in boxes])
    size = max(box.size for box in boxes)
    follow = max(float(np.linalg.norm(np.ptp(f.com, axis=0))) for f in frames) > FOLLOW * size
    if not follow:
        size = max(box.arrow_size for box in boxes)
    force = max(reference_force(run) for run in runs)
    force = nice(force) if force > 0 else 1.0
    parts = list(zip(runs, frames, strict=True))
    return {
        "motion": [low.tolist(), high.tolist()],
        "start": [corner.tolist() for corner in _union([box.start for box in boxes])],
        "follow": follow,
        "size": size,
        "force": force,
        "metres_per_newton": ARROW_LENGTH * size / force,
        "planes": _planes(runs, low, high),
        "runs": [_run(payload, *part, labels[k], k) for k, part in enumerate(parts)],
        "panels": _panels(payload, runs),
    }


def _union(boxes: list[np.ndarray]) -> np.ndarray:
    return np.stack([np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)])


def _planes(runs: list[Trajectory], low: np.ndarray, high: np.ndarray) -> list[dict[str, Any]]:
    """The planes of all runs; one that several runs have in common is drawn once."""
    found: dict[Any, dict[str, Any]] = {}
    for number, run in enumerate(runs):
        for plane in planes(run.scene, low, high):
            key = (*plane.center, *plane.normal) if plane.joint == 0 else (number, plane.name)
            found.setdefault(key, {"run": number, **_plane(plane)})
    return list(found.values())


def _plane(plane: Plane) -> dict[str, Any]:
    return {
        "joint": plane.joint,
        "name": plane.name,
        "center": plane.center.tolist(),
        "normal": plane.normal.tolist(),
        "axes": plane.axes.tolist(),
        "polygon": plane.polygon.tolist(),
        "radius": plane.radius,
        "cell": plane.cell,
    }


def _run(payload: Payload, run: Trajectory, frames: Frames, label: str, number: int) -> dict[str, Any]:
    contacts = contact_frames(run, frames.index)
    return {
        "label": label,
        "method": run.method,
        "note": f"{run.method.partition('(')[0]}, dt = {run.dt:g} s, {len(run.t) - 1} steps",
        "tint": TINTS[(number - 1) % len(TINTS)] if number else None,
        "success": bool(run.success),
        "message": str(run.message),
        "t": payload.array(frames.t),
        "pose": payload.array(frames.pose),
        "joints": frames.pose.shape[1],
        "com": payload.array(frames.com),
        "tubes": [_tube(payload, tube) for tube in frames.tubes],
        "contacts": {
            "names": list(run.contact_names),
            "mu": friction_coefficients(run).tolist(),
            "point": payload.array(contacts.point),
            "normal": payload.array(contacts.normal),
            "la_N": payload.array(contacts.la_N),
            "la_F": payload.array(contacts.la_F),
            "state": payload.array(contacts.state, "u1"),
        },
        "events": [list(event) for event in pair_events(run)],
        "impacts": _impacts(run),
        "audit": [row.cells() for row in run.audit().rows()],
    }


def _tube(payload: Payload, tube: Tube) -> dict[str, Any]:
    points = payload.array(tube.points)
    return {"name": tube.name, "points": points, "count": tube.points.shape[1], "radius": tube.radius, "color": COLOR}


def _objects(shapes: Payload, run: Trajectory) -> list[dict[str, Any]]:
    geometries = [g for g in drawn_geometries(run.scene) if not is_plane(g)]
    hollow = run.scene.hollow
    return [
        {
            "name": geometry.name,
            "joint": geometry.parentJoint,
            "hollow": geometry.name in hollow,
            # column by column, as three.js reads it; mesh files are scaled here, as in Pinocchio's viewer
            "matrix": (geometry.placement.homogeneous @ np.diag([*geometry.meshScale, 1.0])).T.ravel().tolist(),
            "object": _stored(shapes, description),
        }
        for geometry, description in zip(geometries, recorded_objects(geometries, hollow), strict=True)
    ]


def _stored(payload: Payload, value: Any) -> Any:
    """The same nested value with its arrays and long texts moved to the payload."""
    if isinstance(value, dict):
        return {key: _stored(payload, item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_stored(payload, item) for item in value]
    if isinstance(value, str) and len(value) > 500:
        return payload.text(value)
    if isinstance(value, np.ndarray):
        return payload.array(value, f"{value.dtype.kind}{value.dtype.itemsize}")
    if isinstance(value, np.generic):
        return value.item()
    if hasattr(value, "data") and hasattr(value, "type"):  # an array in msgpack's form
        return payload.raw(EXT_KINDS[value.type], value.data)
    return value


def _impacts(run: Trajectory) -> list[list[float]]:
    """Time, number of the contact and impulse [N s] of every impact that has a place."""
    placed = in_the_world(run)
    events = contact_events(run)
    return [[t, k, impulse] for t, kind, k, _, impulse in events if kind == "impact" and k >= 0 and placed[k]]


def _panels(payload: Payload, runs: list[Trajectory]) -> list[dict[str, Any]]:
    """The panels of all runs, those of the same key in one."""
    merged: dict[str, dict[str, Any]] = {}
    for number, run in enumerate(runs):
        for panel in panels(run):
            entry = {"key": panel.key, "title": panel.title, "unit": panel.unit, "curves": []}
            curves = merged.setdefault(panel.key, entry)["curves"]
            curves += [_curve(payload, np.asarray(run.t), curve, number) for curve in panel.curves]
    return list(merged.values())


def _curve(payload: Payload, t: np.ndarray, curve: Curve, number: int) -> dict[str, Any]:
    def line(y: np.ndarray) -> list[dict[str, int]]:
        return [payload.array(values) for values in thinned(t, np.asarray(y, float), CURVE_POINTS)]

    bound = None if curve.bound is None else line(curve.bound)
    return {"label": curve.label, "run": number, "group": curve.group, "line": line(curve.y), "bound": bound}
