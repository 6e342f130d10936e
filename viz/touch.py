"""A simulation to touch: it runs in a browser window, where bodies are dragged and references of joints are moved.

What a hand does is a generalized force that is held during a step: a spring between the point where a body was taken
and the pointer, and the stiffness of the joint controllers times what the sliders add to their references.
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

import ngalpha_pin as nga
from ngalpha_pin.common import checks
from ngalpha_pin.common.optional import require

from .frames import drawn_geometries
from .planes import is_plane
from .server import LOCAL
from .solids import TRIMESH, triangles

if TYPE_CHECKING:
    from ngalpha_pin import Scene, State

FPS = 30.0
PULL = 2 * np.pi * 1.5  # circular frequency of a body of the mass of the system on the spring of a hand [rad/s]
RANGE = 1.0  # of a slider where a joint has no limits, on both sides of its reference [rad or m]
MOST_SLIDERS = 40
SPEEDS = ("0.05", "0.1", "0.25", "0.5", "1", "2")
GREY = (168, 176, 184)


@dataclass(frozen=True)
class Grip:
    """A hand on a body.

    Attributes:
        joint: that carries the body.
        point: where it was taken, in the frame of the joint [m], shape (3,).
        target: where the hand is in the world [m], shape (3,).
    """

    joint: int
    point: np.ndarray
    target: np.ndarray


class LiveView:
    """A scene that runs in a browser window.

    Args:
        scene: what is simulated; it is not changed.
        q0: configuration at the start, shape (nq,).
        v0: velocity at the start, shape (nv,); None is rest.
        dt: step [s].
        method: by default `GeneralizedAlpha()`.
        address: where the page is served; this machine alone unless said otherwise.
        port: of the page; the next free one is taken.

    Attributes:
        state: of the simulation.
        paused, speed: what the controls say; speed in simulated seconds per second.
        grip: the hand on a body, or None.
        page: address of the page.
        message: why the simulation stands still, or "".

    Raises:
        SceneError: the start does not fit the scene. MissingPackageError: viser is not installed.
    """

    def __init__(
        self,
        scene: Scene,
        q0: np.ndarray,
        v0: np.ndarray | None = None,
        dt: float = 1e-3,
        method: Any = None,
        address: str = LOCAL,
        port: int = 8080,
    ):
        viser = require("viser", "live", TRIMESH)
        if scene.beams:
            raise nga.SceneError("live: beams are not drawn; use simulate and save_html")
        self.scene, self.model, self.dt = scene, scene.model, checks.number("dt", dt, 0.0, above=True, unit="s")
        self.simulator = nga.Simulator(scene, dt, method)
        self._start = self.simulator.initial_state(q0, v0)
        self.state: State = self._start
        self.paused, self.speed, self.message = True, 1.0, ""
        self.grip: Grip | None = None
        self._data, self._lock = self.model.createData(), threading.Lock()
        self._shift = np.zeros(self.model.nv)  # what the sliders add to the references, in velocity coordinates
        self._steps, self._reset = 0, False
        mass = max(float(pin.computeTotalMass(self.model)), 1e-6)
        self._stiffness, self._damping = mass * PULL**2, 2 * mass * PULL
        self.server = viser.ViserServer(host=address, port=port, label=self.model.name or "scene", verbose=False)
        self.page = f"http://{address}:{self.server.get_port()}"
        self._add_bodies()
        self._add_controls()
        self.show()

    def close(self) -> None:
        """End the server."""
        self.server.stop()

    def run(self, seconds: float = np.inf) -> None:
        """Simulate and show until Ctrl-C, or for so many seconds [s]."""
        end, due = time.perf_counter() + seconds, time.perf_counter()
        while time.perf_counter() < end:
            due = max(due + 1.0 / FPS, time.perf_counter() - 1.0 / FPS)
            self.advance(1.0 / FPS)
            self.show()
            time.sleep(max(due - time.perf_counter(), 0.001))

    def advance(self, seconds: float) -> None:
        """Do what a moment of the wall clock asks for: a reset, single steps, or the steps of that time [s].

        Steps that would take longer than the moment are left out, so that the page stays quick.
        """
        with self._lock:
            if self._reset:
                self.state, self._reset, self.message, self.grip = self._start, False, "", None
            wanted, self._steps = self._steps, 0
        if not self.paused:
            wanted += max(round(seconds * self.speed / self.dt), 1)
        stop = time.perf_counter() + seconds
        for n in range(wanted):
            if self.message or (n and time.perf_counter() > stop):
                return
            try:
                self.state = self.simulator.step(self.state, self.force())
            except nga.NgalphaError as error:
                self.message = " ".join(str(error).split())
                self.paused = True

    def step(self, n: int = 1) -> None:
        """Ask for n steps, also while it is paused."""
        with self._lock:
            self._steps += n

    def reset(self) -> None:
        """Ask for the start."""
        with self._lock:
            self._reset = True

    def take(self, joint: int, at: np.ndarray, target: np.ndarray) -> None:
        """Put a hand on a body.

        Args:
            joint: that carries it.
            at: point of the body, in the world [m], shape (3,).
            target: where the hand pulls it [m], shape (3,).
        """
        pin.forwardKinematics(self.model, self._data, self.state.q)
        self.grip = Grip(joint, self._data.oMi[joint].actInv(np.asarray(at, float)), np.asarray(target, float))

    def force(self) -> np.ndarray:
        """What the hand and the sliders do, shape (nv,) [N or N m]."""
        tau, model, grip = self._shift_force(), self.model, self.grip
        if grip is None:
            return tau
        q, v = self.state.q, self.state.v
        data = pin.Data(model)
        pin.computeJointJacobians(model, data, q)
        R, p = data.oMi[grip.joint].rotation, data.oMi[grip.joint].act(grip.point)
        J = pin.getJointJacobian(model, data, grip.joint, pin.LOCAL)
        J = R @ (J[:3] - pin.skew(grip.point) @ J[3:])
        return tau + J.T @ (self._stiffness * (grip.target - p) - self._damping * (J @ v))

    def _shift_force(self) -> np.ndarray:
        tau = np.zeros(self.model.nv)
        for law in self.scene.forces:
            if isinstance(law, nga.JointPD):
                tau += np.broadcast_to(law.kp, tau.shape) * self._shift
        return tau

    def show(self) -> None:
        """Send the poses of the bodies, the hand and the clock."""
        pin.forwardKinematics(self.model, self._data, self.state.q)
        grip = self.grip
        with self.server.atomic():
            for j, frame in self._frames.items():
                frame.position = self._data.oMi[j].translation
                frame.wxyz = pin.Quaternion(self._data.oMi[j].rotation).coeffs()[[3, 0, 1, 2]]
            self._hand.visible = grip is not None
            if grip is not None:
                ends = np.array([[self._data.oMi[grip.joint].act(grip.point), grip.target]])
                self._hand.points = ends.astype(np.float32)
        self._clock.value = f"{self.state.t:.3f} s" + (f", {self.message}" if self.message else "")
        self._pause.label = "play" if self.paused else "pause"

    def _add_bodies(self) -> None:
        scene = self.server.scene
        scene.set_up_direction("+z")
        low, high = self._box()
        camera, size = self.server.initial_camera, max(float(np.linalg.norm(high - low)), 1e-3)
        camera.look_at = 0.5 * (low + high)
        camera.position = 0.5 * (low + high) + 1.3 * size * np.array([0.5, -1.0, 0.36])
        self._frames: dict[int, Any] = {}
        for n, geometry in enumerate(drawn_geometries(self.scene)):
            mesh = None if is_plane(geometry) else triangles(geometry)
            if mesh is None:
                continue
            j = int(geometry.parentJoint)
            if j and j not in self._frames:
                self._frames[j] = scene.add_frame(f"/joint{j}", show_axes=False)
            vertices, faces = mesh
            colour = np.asarray(geometry.meshColor)[:3]
            handle = scene.add_mesh_simple(
                f"/joint{j}/{n} {geometry.name}" if j else f"/world/{n} {geometry.name}",
                (vertices * geometry.meshScale).astype(np.float32),
                faces.astype(np.uint32),
                color=GREY if np.ptp(colour) == 0 else tuple(int(255 * c) for c in colour),
                flat_shading=True,
                side="double",
                position=geometry.placement.translation,
                wxyz=pin.Quaternion(geometry.placement.rotation).coeffs()[[3, 0, 1, 2]],
            )
            if j:
                self._can_be_dragged(handle, j)
        for geometry in self.scene.declared_shapes.geometryObjects:
            if is_plane(geometry) and geometry.parentJoint == 0:
                self._add_plane(geometry)
        self._hand = scene.add_line_segments(
            "/hand", np.zeros((1, 2, 3), np.float32), colors=(224, 84, 27), line_width=4.0, visible=False
        )

    def _box(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of a box around the bodies at the start [m]."""
        pin.forwardKinematics(self.model, self._data, self.state.q)
        moving = [g for g in drawn_geometries(self.scene) if g.parentJoint > 0 and not is_plane(g)]
        points = [np.array(x.translation) for x in list(self._data.oMi)[1:]] or [np.zeros(3)]
        for geometry in moving:
            vertices = (triangles(geometry) or (np.zeros((1, 3)),))[0] * geometry.meshScale
            place = self._data.oMi[geometry.parentJoint] * geometry.placement
            ends = np.array([vertices.min(axis=0), vertices.max(axis=0)])
            corners = np.array([[ends[i >> k & 1, k] for k in range(3)] for i in range(8)])
            points += list(corners @ place.rotation.T + place.translation)
        return np.min(points, axis=0), np.max(points, axis=0)

    def _add_plane(self, geometry: pin.GeometryObject) -> None:
        shape = geometry.geometry
        normal = geometry.placement.rotation @ np.asarray(shape.n)
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).coeffs()[[3, 0, 1, 2]]
        place = geometry.placement.act(np.asarray(shape.n) * shape.d)
        self.server.scene.add_grid(f"/world/{geometry.name}", wxyz=turn, position=place, infinite_grid=True)

    def _can_be_dragged(self, handle: Any, joint: int) -> None:
        async def dragged(event: Any) -> None:
            if event.phase == "start":
                self.take(joint, event.start_position, event.end_position)
            elif event.phase == "end":
                self.grip = None
            elif self.grip is not None:
                self.grip = Grip(joint, self.grip.point, np.asarray(event.end_position, float))

        handle.on_drag("left")(dragged)

    def _add_controls(self) -> None:
        gui = self.server.gui
        self._clock = gui.add_text("time", "0 s", disabled=True)
        self._pause = gui.add_button("play", hint="Play or pause")
        self._pause.on_click(lambda event: self._toggle())
        gui.add_button("step", hint="One step").on_click(lambda event: self.step())
        gui.add_button("reset", hint="Back to the start").on_click(lambda event: self.reset())
        speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        speed.on_update(lambda event: setattr(self, "speed", float(speed.value)))
        gui.add_markdown("Drag a body: a spring pulls it. Drag beside it: the camera turns.")
        if any(isinstance(law, nga.JointPD) and not law.moves for law in self.scene.forces):
            with gui.add_folder("references of joints"):
                self._add_sliders()

    def _toggle(self) -> None:
        self.paused = not self.paused

    def _add_sliders(self) -> None:
        model = self.model
        joints = [j for j in range(1, model.njoints) if model.nqs[j] == model.nvs[j] == 1]
        for j in joints[:MOST_SLIDERS]:
            q, low, high = (float(x[model.idx_qs[j]]) for x in (self._start.q, *limits(model)))
            ends = (low if np.isfinite(low) else q - RANGE, high if np.isfinite(high) else q + RANGE)
            low, high = min(ends[0], q), max(ends[1], q)
            slider = self.server.gui.add_slider(model.names[j], low, high, (high - low) / 200, q)
            slider.on_update(lambda event, j=j, s=slider, q=q: self._move(j, float(s.value) - q))

    def _move(self, joint: int, shift: float) -> None:
        found = self._shift.copy()
        found[self.model.idx_vs[joint]] = shift
        self._shift = found


def limits(model: pin.Model) -> tuple[np.ndarray, np.ndarray]:
    """Position limits of a model, shape (nq,) each [m or rad]; infinite where it has none."""
    most = np.finfo(float).max  # what Pinocchio writes for no limit
    lower, upper = np.asarray(model.lowerPositionLimit), np.asarray(model.upperPositionLimit)
    return np.where(lower > -most, lower, -np.inf), np.where(upper < most, upper, np.inf)


def live(scene: Scene, q0: np.ndarray, v0: np.ndarray | None = None, dt: float = 1e-3, **options: Any) -> None:
    """Simulate in a browser window until Ctrl-C; see `LiveView` for the arguments."""
    view = LiveView(scene, q0, v0, dt, **options)
    print(f"the simulation is at {view.page}; Ctrl-C ends it")
    try:
        view.run()
    except KeyboardInterrupt:
        pass
    finally:
        view.close()
