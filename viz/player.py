"""A run played in a meshcat viewer in the browser, in the time it took."""

from __future__ import annotations

import time
import webbrowser
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.common.optional import require
from ngalpha_pin.errors import SceneError

from .contacts import FRICTIONLESS, SLIP, STICK, contact_frames, reference_force
from .frames import FPS, bounds, drawn_geometries, sample
from .objects import grid_lines, recorded_objects, solid, surface
from .page import ARROW_LENGTH
from .planes import is_plane, planes
from .server import LOCAL, start_server, what_is_open
from .tubes import COLOR, tube_surface

if TYPE_CHECKING:
    import meshcat

    from ngalpha_pin import Trajectory

ROOT = "replay"
ARROW_COLORS = {"normal": (0.12, 0.44, 0.70, 1.0), "stick": (0.11, 0.60, 0.36, 1.0), "slip": (0.88, 0.33, 0.11, 1.0)}


def play(
    trajectory: Trajectory,
    zmq_url: str | None = None,
    speed: float = 1.0,
    loop: bool = False,
    address: str = LOCAL,
) -> meshcat.Visualizer:
    """Play a run in a browser window that is connected to a meshcat server; returns at its end.

    Args:
        trajectory: any run.
        zmq_url: address of a running server, such as "tcp://127.0.0.1:6000"; None starts one and opens its page.
        speed: simulated seconds per second [-].
        loop: start again at the end, until interrupted.
        address: of the server that is started: this machine alone, or e.g. 0.0.0.0 for everybody on the network.

    Returns:
        The viewer, which stays open.

    Raises:
        SceneError: speed is not positive. MissingPackageError: meshcat is not installed.
    """
    if not (np.isfinite(speed) and speed > 0):
        raise SceneError(f"play: speed = {speed} must be positive")
    meshcat = require("meshcat", "play", "pip install meshcat")
    own = zmq_url is None
    if own:
        zmq_url, page = start_server(address)
        print(what_is_open(page, address))
    viewer = meshcat.Visualizer(zmq_url)
    if own:
        webbrowser.open(page, new=2)
        viewer.wait()
    scene = LiveScene(viewer, trajectory)
    try:
        while True:
            scene.play(speed)
            if not loop:
                break
    except KeyboardInterrupt:
        pass
    return viewer


class LiveScene:
    """The bodies, planes and contact forces of a run in a meshcat viewer.

    Args:
        viewer: `meshcat.Visualizer`.
        trajectory: what is shown.
    """

    def __init__(self, viewer: meshcat.Visualizer, trajectory: Trajectory):
        self.viewer = viewer
        self.frames = sample(trajectory, FPS)
        self.contacts = contact_frames(trajectory, self.frames.index)
        box = bounds(trajectory.scene, self.frames)
        force = reference_force(trajectory)
        self._scale = ARROW_LENGTH * box.arrow_size / force if force > 0 else 0.0
        self._width = 0.012 * box.arrow_size
        self._visible: dict[str, bool] = {}
        viewer[ROOT].delete()
        self._add_bodies(trajectory)
        self._add_planes(trajectory, box.motion)
        for k in range(self.contacts.la_N.shape[1]):
            for kind, color in ARROW_COLORS.items():
                self._send(f"force{k}/{kind}", surface(*_arrow(), color))
        self._look_at(box.motion)
        self.show(0)

    def play(self, speed: float = 1.0) -> None:
        """Show every frame at its time, leaving out those that come too late."""
        t, begin = self.frames.t, time.perf_counter()
        row = 0
        while row < len(t) - 1:
            now = t[0] + (time.perf_counter() - begin) * speed
            row = min(int(np.searchsorted(t, now, side="right")), len(t) - 1)
            time.sleep(max((t[row] - now) / speed, 0.0))
            self.show(row)

    def show(self, row: int) -> None:
        """Show one frame."""
        for j, pose in enumerate(self.frames.pose[row]):
            self.viewer[f"{ROOT}/joint{j}"].set_transform(pin.XYZQUATToSE3(pose).homogeneous)
        for n, tube in enumerate(self.frames.tubes):
            self._send(f"tube{n}", surface(*tube_surface(tube.points[row], tube.radius), COLOR))
        contacts = self.contacts
        for k, state in enumerate(contacts.state[row]):
            point = contacts.point[row, k]
            normal = contacts.normal[row, k] * contacts.la_N[row, k]
            self._show_arrow(f"force{k}/normal", state >= FRICTIONLESS, point, normal)
            self._show_arrow(f"force{k}/stick", state == STICK, point, contacts.la_F[row, k])
            self._show_arrow(f"force{k}/slip", state == SLIP, point, contacts.la_F[row, k])

    def _show_arrow(self, name: str, wanted: bool, point: np.ndarray, force: np.ndarray) -> None:
        length = float(np.linalg.norm(force)) * self._scale
        visible = bool(wanted) and length > 0.5 * self._width
        if self._visible.get(name) != visible:
            self._visible[name] = visible
            self.viewer[f"{ROOT}/{name}"].set_property("visible", visible)
        if visible:
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), force).toRotationMatrix()
            placement = np.eye(4)
            placement[:3, :3] = turn @ np.diag([self._width, self._width, length])
            placement[:3, 3] = point
            self.viewer[f"{ROOT}/{name}"].set_transform(placement)

    def _add_bodies(self, trajectory: Trajectory) -> None:
        scene = trajectory.scene
        geometries = [g for g in drawn_geometries(scene) if not is_plane(g)]
        for n, (g, description) in enumerate(zip(geometries, recorded_objects(geometries, scene.hollow), strict=True)):
            name = f"joint{g.parentJoint}/{n}"
            self._send(name, description)
            self.viewer[f"{ROOT}/{name}"].set_transform(g.placement.homogeneous @ np.diag([*g.meshScale, 1.0]))

    def _add_planes(self, trajectory: Trajectory, box: np.ndarray) -> None:
        for plane in planes(trajectory.scene, *box):
            corners = len(plane.polygon)
            fan = np.array([[0, n, n + 1] for n in range(1, corners - 1)])
            name = f"joint{plane.joint}/plane {plane.name}"
            self._send(f"{name}/surface", surface(plane.polygon, fan, (0.93, 0.94, 0.95, 1.0), lit=False))
            self._send(f"{name}/grid", grid_lines(plane))

    def _look_at(self, box: np.ndarray) -> None:
        """Point the camera at the middle of the motion; it lives y up and orbits about its own origin."""
        span = float(np.linalg.norm(box[1] - box[0]))
        placement = np.eye(4)
        placement[:3, 3] = box.mean(axis=0)
        x, y, z = 0.75 * span * np.array([0.5, -1.0, 0.36])
        self.viewer["/Cameras/default"].set_transform(placement)
        self.viewer["/Cameras/default/rotated/<object>"].set_property("position", [x, z, -y])
        for name, color in (("top_color", [0.80, 0.86, 0.92]), ("bottom_color", [0.96, 0.97, 0.98])):
            self.viewer["/Background"].set_property(name, color)
        for name in ("/Grid", "/Axes"):
            self.viewer[name].set_property("visible", False)

    def _send(self, name: str, description: dict[str, Any]) -> None:
        path = self.viewer[f"{ROOT}/{name}"].path.lower()
        self.viewer.window.send(_Command({"type": "set_object", "path": path, "object": solid(description)}))


class _Command(dict):
    """A command in the form that goes over the wire, where meshcat asks for it with `lower`."""

    def lower(self) -> dict[str, Any]:
        return dict(self)


def _arrow() -> tuple[np.ndarray, np.ndarray]:
    """An arrow of length 1 along z and radius 1, as vertices and faces."""
    angles = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    profile = [(0.0, 0.0), (1.0, 0.0), (1.0, 0.75), (2.4, 0.75), (0.0, 1.0)]  # radius and height
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    vertices = np.concatenate([np.column_stack([r * circle, np.full(len(angles), h)]) for r, h in profile])
    n, faces = len(angles), []
    for ring in range(len(profile) - 1):
        for k in range(n):
            a, b = ring * n + k, ring * n + (k + 1) % n
            faces += [[a, b, a + n], [b, b + n, a + n]]
    return vertices, np.array(faces)
