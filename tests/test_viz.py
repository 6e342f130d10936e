"""The page, the figure and the live viewer: what they contain, and what they say when something is missing."""

import base64
import dataclasses
import gzip
import importlib.util
import json
import re
import subprocess
import sys
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import viz
from ngalpha_pin.viz import browser as browser_module
from ngalpha_pin.viz.collada import read_collada
from ngalpha_pin.viz.contacts import FRICTIONLESS, OPEN, SLIP, STICK, contact_frames, friction_coefficients
from ngalpha_pin.viz.curves import panels, thinned
from ngalpha_pin.viz.frames import FPS, bounds, drawn_geometries, drawn_steps, sample
from ngalpha_pin.viz.live import LiveScene
from ngalpha_pin.viz.objects import Recorder, recorded_objects
from ngalpha_pin.viz.optional import MissingPackageError, require
from ngalpha_pin.viz.planes import cut, grid_segments, nice, planes


def ball_model():
    model = pin.Model()
    model.name = "ball"
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "free")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addBodyFrame("body", joint, pin.SE3.Identity(), 0)
    return model


def dropped_ball(mu=0.3, v_x=2.0, t_end=0.5, e_N=0.0):
    """A ball that falls 5 cm with a horizontal speed: flight, impact, slip, then rolling."""
    scene = nga.Scene(ball_model())
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="body", color=(0.2, 0.4, 0.6, 1.0))
    scene.add_contact("ball", "ground", mu=mu, e_N=e_N)
    q0 = np.array([0, 0, 0.15, 0, 0, 0, 1.0])
    v0 = np.array([v_x, 0, 0, 0, 0, 0])
    return nga.simulate(scene, q0, v0, t_end=t_end, dt=2e-3)


@pytest.fixture(scope="module")
def drop():
    return dropped_ball()


@pytest.fixture(scope="module")
def page(drop, tmp_path_factory):
    return viz.save_html(drop, tmp_path_factory.mktemp("page") / "drop.html", title="a < b & c").read_text("utf-8")


def content(page):
    """Header and blobs of the data block in a page."""
    block = gzip.decompress(base64.b64decode(re.search(r'id="payload"[^>]*>([^<]*)<', page)[1]))
    size = int.from_bytes(block[:4], "little")
    header, body = json.loads(block[4 : 4 + size]), block[4 + size :]
    kinds = {"f4": "<f4", "u4": "<u4", "i4": "<i4", "u1": "u1"}

    def blob(reference):
        kind, start, length = header["blobs"][reference["$"]]
        return np.frombuffer(body[start : start + length], kinds[kind])

    return header, blob


def test_import_loads_neither_meshcat_nor_matplotlib():
    code = (
        "import sys, ngalpha_pin, ngalpha_pin.viz; print(*{'meshcat', 'matplotlib', 'PIL', 'zmq'} & set(sys.modules))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == ""


@pytest.mark.parametrize(
    ("module", "call", "command"),
    [
        ("matplotlib", lambda run, path: viz.plot(run, path / "a.png"), 'pip install "ngalpha-pin[plot]"'),
        ("meshcat", lambda run, path: viz.save_html(run, path / "a.html"), "pip install meshcat"),
        ("meshcat", lambda run, path: viz.play(run), "pip install meshcat"),
        ("imageio_ffmpeg", lambda run, path: viz.save_video(run, path / "a.mp4"), 'pip install "imageio[ffmpeg]"'),
    ],
)
def test_a_missing_package_names_the_command(drop, tmp_path, monkeypatch, module, call, command):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingPackageError, match=re.escape(command)) as caught:
        call(drop, tmp_path)
    assert isinstance(caught.value, nga.NgalphaError)
    assert isinstance(caught.value, ImportError)


def test_a_missing_browser_names_the_command(drop, tmp_path, monkeypatch):
    monkeypatch.setattr(browser_module, "PROGRAMS", ("no-such-browser",))
    with pytest.raises(MissingPackageError, match="apt-get install chromium"):
        viz.save_video(drop, tmp_path / "a.gif")


def test_wrong_arguments_are_refused(drop, tmp_path):
    with pytest.raises(nga.SceneError, match="2 trajectories, but 1 labels"):
        viz.save_html([drop, drop], tmp_path / "a.html", labels=["one"])
    with pytest.raises(nga.SceneError, match="at least one"):
        viz.save_html([], tmp_path / "a.html")
    with pytest.raises(nga.SceneError, match="fps"):
        viz.save_html(drop, tmp_path / "a.html", fps=0)
    with pytest.raises(nga.SceneError, match=r"\.mp4 and \.gif"):
        viz.save_video(drop, tmp_path / "a.avi")
    with pytest.raises(nga.SceneError, match="speed"):
        viz.play(drop, speed=-1.0)
    with pytest.raises(nga.UnknownName, match="did you mean 'energy'"):
        viz.plot(drop, tmp_path / "a.png", show=["enrgy"])
    with pytest.raises(nga.UnknownName, match="joint"):
        viz.plot(drop, tmp_path / "a.png", joints=["knee"])
    with pytest.raises(nga.UnknownName, match="contact"):
        viz.plot(drop, tmp_path / "a.png", contact="ball/wall")


def test_page_is_one_file_without_links(page):
    assert not re.findall(r"<(?:script|img|link)[^>]+(?:src|href)=[\"'](?!data:)", page)
    own = page[: page.index('id="payload"')] + page[page.rindex("<script>") :]
    assert "http" not in own
    assert "<title>a &lt; b &amp; c</title>" in page
    assert len(page) < 1.2e6


def test_page_holds_the_motion_and_the_forces(drop, page):
    header, blob = content(page)
    run = header["runs"][0]
    t, pose = blob(run["t"]), blob(run["pose"]).reshape(-1, 2, 7)
    assert t[0] == 0
    assert t[-1] == pytest.approx(drop.t[-1])
    at = np.searchsorted(drop.t, t - 1e-6)
    np.testing.assert_allclose(pose[:, 1, :3], drop.q[at, :3], atol=1e-6)
    np.testing.assert_allclose(blob(run["com"]).reshape(-1, 3), drop.q[at, :3], atol=1e-6)
    contacts = run["contacts"]
    np.testing.assert_allclose(blob(contacts["la_N"]), drop.la_N[at, 0], rtol=1e-5, atol=1e-9)
    assert contacts["mu"] == [0.3]
    assert contacts["names"] == ["ball/ground"]
    kinds = [kind for _, kind, _, _ in run["events"]]
    assert kinds == [event.kind for event in drop.events]
    assert [row[0] for row in run["audit"]] == [row[0] for row in drop.audit().rows()]
    assert {panel["key"] for panel in header["panels"]} >= {
        "gap",
        "force",
        "percussion",
        "friction",
        "energy",
        "position",
    }


def test_events_carry_the_percussion_of_their_step(drop, page):
    event = next(e for e in content(page)[0]["runs"][0]["events"] if e[1] == "impact")
    assert event[2] == 0
    assert event[3] == pytest.approx(np.sqrt(2 * 9.81 * 0.05), rel=0.05)  # m v of the fall


def test_several_runs_share_one_page(drop, tmp_path):
    other = dropped_ball(mu=0.0, t_end=0.2)
    path = viz.save_html([drop, other], tmp_path / "two.html", labels=["rough", "smooth"])
    header, _ = content(path.read_text("utf-8"))
    assert [run["label"] for run in header["runs"]] == ["rough", "smooth"]
    assert header["runs"][0]["tint"] is None
    assert len(header["runs"][1]["tint"]) == 4
    assert len(header["planes"]) == 1
    gap = next(panel for panel in header["panels"] if panel["key"] == "gap")
    assert [curve["run"] for curve in gap["curves"]] == [0, 1]


def test_a_scene_without_contact_is_drawn(tmp_path):
    scene = nga.Scene(ball_model())
    run = nga.simulate(scene, pin.neutral(scene.model), np.zeros(6), t_end=0.05, dt=1e-2)
    header, _ = content(viz.save_html(run, tmp_path / "free.html").read_text("utf-8"))
    assert header["runs"][0]["events"] == []
    viz.plot(run, tmp_path / "free.png")


def test_a_loaded_run_gives_the_same_page(drop, page, tmp_path):
    drop.save(tmp_path / "drop.npz")
    path = viz.save_html(nga.Trajectory.load(tmp_path / "drop.npz"), tmp_path / "again.html", title="a < b & c")
    first, second = content(page)[0], content(path.read_text("utf-8"))[0]
    for header in (first, second):
        for run in header["runs"]:
            del run["objects"]  # their identifiers are new every time
    assert first == second


def test_frames_are_thinned_and_keep_events(drop):
    steps = drawn_steps(drop)
    assert len(steps) <= FPS * 0.5 + 2 + len(drop.events)
    assert steps[0] == 0
    assert steps[-1] == len(drop.t) - 1
    drawn = drop.t[steps]
    assert all(np.abs(drawn - event.t).min() <= drop.dt / 2 for event in drop.events)


def test_quaternions_do_not_jump(drop):
    quaternion = sample(drop).pose[:, 1, 3:]
    assert (np.sum(quaternion[1:] * quaternion[:-1], axis=1) > 0.5).all()


def test_contact_state_follows_the_motion(drop):
    contacts = contact_frames(drop, np.arange(len(drop.t)))
    state = contacts.state[:, 0]
    impact, stick = (next(e.t for e in drop.events if e.kind == kind) for kind in ("impact", "stick"))
    assert (state[drop.t < impact - 1e-9] == OPEN).all()
    assert (state[(drop.t > impact + 0.01) & (drop.t < stick - 0.01)] == SLIP).all()
    assert (state[drop.t > stick + 0.01] == STICK).all()
    slipping = state == SLIP
    np.testing.assert_allclose(np.linalg.norm(contacts.la_F[slipping, 0], axis=1), 0.3 * drop.la_N[slipping, 0])
    assert (contacts.la_F[slipping, 0, 0] < 0).all()  # against the motion along x
    np.testing.assert_allclose(contacts.point[:, 0, 2], drop.q[:, 2] - 0.1, atol=1e-12)


def test_a_smooth_contact_is_frictionless():
    run = dropped_ball(mu=0.0, t_end=0.2)
    assert friction_coefficients(run).tolist() == [0.0]
    assert set(contact_frames(run, np.arange(len(run.t))).state.ravel()) == {OPEN, FRICTIONLESS}


def test_a_run_of_percussions_alone_shows_their_mean_force(drop):
    percussions = dataclasses.replace(drop, la_N=0 * drop.la_N, la_F=0 * drop.la_F)
    contacts = contact_frames(percussions, np.array([0, len(drop.t) - 1]))
    np.testing.assert_allclose(contacts.la_N[:, 0], [0.0, 9.81], rtol=1e-3)
    assert contacts.state[:, 0].tolist() == [OPEN, STICK]


def test_a_step_that_is_not_finite_is_left_out(drop):
    q = drop.q.copy()
    q[-1] = np.nan
    broken = dataclasses.replace(drop, q=q, success=False, message="stopped")
    assert drawn_steps(broken)[-1] < len(drop.t) - 1


def test_box_of_the_motion(drop):
    box = bounds(drop.scene, sample(drop))
    np.testing.assert_allclose(box.start, [[-0.1, -0.1, 0.05], [0.1, 0.1, 0.25]], atol=1e-6)
    np.testing.assert_allclose(box.motion[:, 2], [0.0, 0.25], atol=1e-3)
    assert box.motion[1, 0] == pytest.approx(drop.q[-1, 0] + 0.1, abs=1e-6)


def test_planes_are_cut_where_another_begins():
    scene = nga.Scene(ball_model())
    scene.add_plane("left", normal=(1, 0, 1))
    scene.add_plane("right", normal=(-1, 0, 1))
    low, high = np.array([-1.0, -1, 0]), np.array([1.0, 1, 2])
    left, right = planes(scene, low, high)
    for piece, own, other in ((left, [1, 0, 1], [-1, 0, 1]), (right, [-1, 0, 1], [1, 0, 1])):
        assert np.abs(piece.polygon @ own).max() < 1e-9
        assert (piece.polygon @ other).min() > -1e-9
        lines = grid_segments(piece)
        assert len(lines) > 10
        assert np.abs(lines @ own).max() < 1e-9
        assert (lines @ other).min() > -1e-9
    square = np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    assert len(cut(square, np.array([2.0, 0, 0]), np.array([1.0, 0, 0]))) == 0
    np.testing.assert_array_equal(cut(square, np.array([-2.0, 0, 0]), np.array([1.0, 0, 0])), square)


@pytest.mark.parametrize(("value", "expected"), [(1.0, 1.0), (4.9, 2.0), (0.05, 0.05), (999.0, 500.0), (3e-7, 2e-7)])
def test_nice_numbers(value, expected):
    assert nice(value) == pytest.approx(expected)


def test_thinning_keeps_a_single_peak():
    t = np.linspace(0, 1, 100_001)
    y = np.sin(t)
    y[77_777] = 50.0
    t1, y1 = thinned(t, y, 1000)
    assert len(t1) <= 1002
    assert y1.max() == 50.0
    assert (np.diff(t1) > 0).all()


def test_panels_show_angles_of_every_joint_type():
    model = pin.Model()
    parent = 0
    kinds = (
        pin.JointModelRX(),
        pin.JointModelRUBY(),
        pin.JointModelPZ(),
        pin.JointModelSpherical(),
        pin.JointModelPlanar(),
    )
    for n, kind in enumerate(kinds):
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), f"j{n}")
        model.appendBodyToJoint(parent, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    run = nga.simulate(nga.Scene(model), pin.neutral(model), np.zeros(model.nv), t_end=0.01, dt=5e-3)
    labels = {panel.key: [curve.label for curve in panel.curves] for panel in panels(run)}
    assert labels["angle"] == ["j0", "j1", "j3 tilt", "j4"]
    assert labels["position"] == ["j2", "j4 x", "j4 y"]
    assert labels["rate"] == ["j0", "j1", "j3 x", "j3 y", "j3 z", "j4 z"]
    assert labels["speed"] == ["j2", "j4 x", "j4 y"]


def test_figure_has_units_and_bounds(drop, tmp_path):
    figure = viz.plot(drop, tmp_path / "drop.png", show=["gap", "percussion", "friction", "energy", "position"])
    axes = [ax for ax in figure.axes if ax.get_visible()]
    assert [ax.get_ylabel().split()[-1] for ax in axes] == ["[m]", "s]", "s]", "[J]", "[m]"]
    assert len(axes[2].collections) == 1  # the band of mu P_N
    np.testing.assert_array_equal(axes[0].lines[0].get_ydata(), drop.g_N[:, 0])
    assert (tmp_path / "drop.png").stat().st_size > 10_000


def test_hollow_shapes_show_their_inside():
    scene = nga.Scene(ball_model())
    scene.add_geometry("tube", nga.Hollow(coal.Cylinder(1.0, 2.0)))
    description = recorded_objects(drawn_geometries(scene), scene.hollow)[0]
    assert description["materials"][0]["side"] == 1
    assert description["geometries"][0]["openEnded"] is True


def test_every_coal_shape_is_drawn():
    points = coal.StdVec_Vec3s()
    for point in np.vstack([np.eye(3), -np.eye(3)]):
        points.append(point)
    shapes = (
        coal.Box(1, 2, 3), coal.Sphere(1), coal.Cylinder(1, 2), coal.Capsule(1, 2), coal.Cone(1, 2),
        coal.Ellipsoid(1, 2, 3), coal.Convex.convexHull(points, True, "Qt"), coal.TriangleP(*np.eye(3)),
    )  # fmt: skip
    geometries = [pin.GeometryObject(f"g{n}", 0, pin.SE3.Identity(), shape) for n, shape in enumerate(shapes)]
    for description in recorded_objects(geometries):
        assert description["geometries"]


@pytest.mark.parametrize("ending", [".obj", ".dae"])
def test_a_mesh_without_its_file_is_drawn_as_coal_has_it(tmp_path, ending):
    path = tmp_path / "mesh.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    mesh = coal.MeshLoader().load(str(path), np.full(3, 2.0))
    gone = str(tmp_path / f"gone{ending}")
    geometry = pin.GeometryObject("mesh", 0, pin.SE3.Identity(), mesh, gone, np.full(3, 2.0))
    (description,) = recorded_objects([geometry])
    position = description["geometries"][0]["data"]["attributes"]["position"]["array"]
    assert np.frombuffer(position.data, "<f4").max() == 2.0
    np.testing.assert_array_equal(description["object"]["matrix"], np.diag([0.5, 0.5, 0.5, 1.0]).ravel())


def test_live_scene_moves_bodies_and_shows_forces_in_stance(drop):
    recorder = Recorder()
    viewer = require("meshcat", "", "").Visualizer(window=recorder)
    scene = LiveScene(viewer, drop)

    def sent(row):
        recorder.commands.clear()
        scene.show(row)
        last = {}
        for command in recorder.commands:
            last[(command["path"], command.get("property", command["type"]))] = command
        return last

    rows = len(scene.frames.t)
    stance = sent(rows - 1)
    assert stance[("/meshcat/replay/force0/normal", "visible")]["value"] is True
    matrix = np.array(stance[("/meshcat/replay/joint1", "set_transform")]["matrix"]).reshape(4, 4).T
    np.testing.assert_allclose(matrix[:3, 3], drop.q[-1, :3], atol=1e-9)
    flight = sent(0)
    assert flight[("/meshcat/replay/force0/normal", "visible")]["value"] is False


@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")  # meshcat drops a socket while it connects
def test_play_sends_to_a_server(drop):
    code = "import sys; sys.argv = ['server']; from meshcat.servers.zmqserver import main; main()"
    command = [sys.executable, "-u", "-W", "ignore", "-c", code]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        try:
            address = next(line.split("=", 1)[1].strip() for line in server.stdout if line.startswith("zmq_url="))
            viewer = viz.play(drop, zmq_url=address, speed=10.0)
            assert "set_transform" not in viewer.static_html()[:100]
            assert viewer.static_html().count("fetch") > 10  # one command per node
            viewer.window.zmq_socket.close()
        finally:
            server.kill()


@pytest.mark.skipif(importlib.util.find_spec("example_robot_data") is None, reason="no example-robot-data-loaders")
def test_anymal_agrees_with_the_viewer_of_pinocchio():
    example_robot_data = pytest.importorskip("example_robot_data")
    robot = example_robot_data.load("anymal")
    meshcat, visualize = require("meshcat", "", ""), require("pinocchio.visualize", "", "")
    theirs = visualize.MeshcatVisualizer(robot.model, robot.collision_model, robot.visual_model)
    recorder = Recorder()
    theirs.initViewer(viewer=meshcat.Visualizer(window=recorder))
    theirs.loadViewerModel("robot")
    q = pin.integrate(robot.model, robot.q0, 0.3 * np.sin(np.arange(robot.model.nv)))
    theirs.display(q)
    placed = {c["path"]: c["matrix"] for c in recorder.commands if c["type"] == "set_transform"}
    loaded = {c["path"]: c["object"] for c in recorder.commands if c["type"] == "set_object"}

    scene = nga.Scene(robot.model, robot.collision_model, robot.visual_model)
    geometries = drawn_geometries(scene)
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    for geometry, ours in zip(geometries, recorded_objects(geometries), strict=True):
        path = f"/meshcat/robot/visuals/{geometry.name}"
        matrix = data.oMi[geometry.parentJoint].homogeneous @ geometry.placement.homogeneous
        np.testing.assert_allclose(np.array(placed[path]).reshape(4, 4).T, matrix, atol=1e-12)
        source = loaded[path]["object"].get("data")
        if source is None:
            assert [m["color"] for m in ours["materials"]] == [m["color"] for m in loaded[path]["materials"]]
            continue
        # a COLLADA file has its own colours, which Pinocchio's viewer leaves to the reader in the page
        named = re.findall(r"<diffuse>\s*<color[^>]*>([^<]*)</color>", source)
        allowed = {tuple(int(255 * float(c)) for c in color.split()[:3]) for color in named} | {(178,) * 3, (255,) * 3}
        for material in ours["materials"]:
            assert tuple(material["color"].to_bytes(3, "big")) in allowed
        assert bool(ours["textures"]) == ("<texture" in source)


@pytest.mark.skipif(importlib.util.find_spec("example_robot_data") is None, reason="no example-robot-data-loaders")
def test_collada_meshes_lie_where_collision_checking_has_them():
    robot = pytest.importorskip("example_robot_data").load("go2")
    meshes = {geometry.meshPath: geometry for geometry in robot.visual_model.geometryObjects}
    for geometry in meshes.values():
        if geometry.meshPath.endswith(".dae"):
            parts = read_collada(Path(geometry.meshPath))
            ours = np.concatenate([part.vertices for part in parts])
            theirs = geometry.geometry.vertices()
            np.testing.assert_allclose(ours.min(axis=0), theirs.min(axis=0), atol=1e-6)
            np.testing.assert_allclose(ours.max(axis=0), theirs.max(axis=0), atol=1e-6)
            assert sum(len(part.faces) for part in parts) >= geometry.geometry.num_tris
