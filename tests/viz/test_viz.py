"""The page, the figure and the live viewer: what they contain, and what they say when something is missing."""

import base64
import dataclasses
import gzip
import json
import re
import subprocess
import sys

import coal
import numpy as np
import pinocchio as pin
import pytest
from viz_scenes import free_ball

import ngalpha_pin as nga
from ngalpha_pin import robots, viz
from ngalpha_pin.common.optional import MissingPackageError, require
from ngalpha_pin.results import trajectory
from ngalpha_pin.viz import browser as browser_module
from ngalpha_pin.viz import video
from ngalpha_pin.viz.contacts import (
    FRICTIONLESS,
    OPEN,
    SLIP,
    STICK,
    contact_frames,
    friction_coefficients,
    reference_force,
)
from ngalpha_pin.viz.curves import panels
from ngalpha_pin.viz.frames import FPS, bounds, drawn_steps, sample
from ngalpha_pin.viz.objects import Recorder
from ngalpha_pin.viz.page import page as page_text
from ngalpha_pin.viz.player import LiveScene


def dropped_ball(mu=0.3, v_x=2.0, t_end=0.5, e_N=0.0):
    """A ball that falls 5 cm with a horizontal speed: flight, impact, slip, then rolling."""
    scene = nga.Scene(free_ball())
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


def content(page, block="payload"):
    """Header and blobs of a data block in a page."""
    block = gzip.decompress(base64.b64decode(re.search(rf'id="{block}"[^>]*>([^<]*)<', page)[1]))
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
        ("imageio_ffmpeg", lambda run, path: viz.save_video(run, path / "a.mp4"), "pip install imageio-ffmpeg"),
    ],
)
def test_a_missing_package_names_the_command(drop, tmp_path, monkeypatch, module, call, command):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setattr(video.shutil, "which", lambda program: None)
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
        "impulse",
        "friction",
        "energy",
        "position",
    }


def test_events_carry_the_percussion_of_their_step(drop, page):
    run = content(page)[0]["runs"][0]
    event, impact = next(e for e in run["events"] if e[1] == "impact"), run["impacts"][0]
    assert event[2] == "ball/ground"
    assert impact == [event[0], 0, event[3]]
    assert event[3] == pytest.approx(np.sqrt(2 * 9.81 * 0.05), rel=1e-6)  # m v of the fall


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
    scene = nga.Scene(free_ball())
    run = nga.simulate(scene, pin.neutral(scene.model), np.zeros(6), t_end=0.05, dt=1e-2)
    header, _ = content(viz.save_html(run, tmp_path / "free.html").read_text("utf-8"))
    assert header["runs"][0]["events"] == []
    viz.plot(run, tmp_path / "free.png")


@pytest.mark.long
def test_ten_seconds_of_a_robot_are_below_five_megabytes():
    """A robot with the joints and contacts of Solo12, and numbers that do not compress: the worst case."""
    scene, q0, v0 = robots.load("quadruped")
    step = nga.simulate(scene, q0, v0, t_end=1e-3, dt=1e-3)
    t, rng = np.linspace(0, 10, 10_001), np.random.default_rng(0)
    q = np.array([pin.integrate(scene.model, q0, 0.1 * x) for x in rng.normal(size=(len(t), scene.model.nv))])
    noise = {
        name: rng.normal(size=(len(t), *getattr(step, name).shape[1:]))
        for name in ("v", "a", "tau_f", "P_f", "la_g", "La_g", "la_gamma", "La_gamma", *trajectory.CONTACT_ARRAYS)
    }
    work = {
        "adhesion": np.zeros((len(t), step.adhesion.shape[1])),
        "n_iter": np.ones(len(t), int),
        "slot_ends": np.zeros(len(t), int),
        "solver_path": np.full(len(t), "newton"),
    }
    text = page_text(dataclasses.replace(step, t=t, q=q, **noise, **work))
    header, blob = content(text)
    assert len(blob(header["runs"][0]["t"])) <= 10 * FPS + 2 + 1000  # and the frames of events
    total, motion, shapes, viewer = map(float, re.findall(r"([\d.]+) MB", text))
    assert total == pytest.approx(len(text.encode()) / 1e6, abs=0.01)
    assert motion + shapes + viewer == pytest.approx(total, abs=0.02)
    assert motion + viewer < 5


def test_a_loaded_run_gives_the_same_page(drop, page, tmp_path):
    drop.save(tmp_path / "drop.npz")
    path = viz.save_html(nga.Trajectory.load(tmp_path / "drop.npz"), tmp_path / "again.html", title="a < b & c")
    assert content(page)[0] == content(path.read_text("utf-8"))[0]


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


def swinging_door():
    """A pendulum with dry friction that swings into its upper limit."""
    model = pin.Model()
    hinge = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "hinge")
    model.appendBodyToJoint(hinge, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3(np.eye(3), np.array([0, 0, -1.0])))
    model.lowerPositionLimit, model.upperPositionLimit = np.array([-np.inf]), np.array([0.1])
    model.lowerDryFrictionLimit, model.upperDryFrictionLimit = np.array([-0.2]), np.array([0.2])
    return nga.simulate(nga.Scene(model), np.array([-0.05]), np.array([0.8]), t_end=0.5, dt=2e-3)


def test_limits_of_joints_have_curves_but_no_place(tmp_path):
    run = swinging_door()
    frames = contact_frames(run, np.arange(len(run.t)))
    assert run.P_N.max() > 0
    assert (frames.state == OPEN).all()
    assert reference_force(run) == 0.0
    found = {panel.key: panel for panel in panels(run)}
    assert not {"gap", "force", "percussion", "constraint"} & found.keys()
    (limit,), (force,) = found["limit"].curves, found["limit force"].curves
    assert limit.label == force.label == "hinge upper limit"
    np.testing.assert_allclose(limit.y, 0.1 - run.q[:, 0], atol=1e-12)
    np.testing.assert_array_equal(found["joint friction"].curves[0].y, run.tau_f[:, 0])
    shown = content(viz.save_html(run, tmp_path / "door.html").read_text("utf-8"))[0]["runs"][0]
    contact, impulse = next(event[2:] for event in shown["events"] if event[1] == "impact")
    assert contact == "hinge upper limit"
    assert impulse == pytest.approx(run.La_N.max())
    assert shown["impacts"] == []  # there is no point to draw a ring around
    figure = viz.plot(run, tmp_path / "door.png", show=["limit", "limit force", "joint friction"])
    assert len([ax for ax in figure.axes if ax.get_visible()]) == 3


def test_constraints_have_curves(tmp_path):
    scene = nga.Scene(free_ball())
    scene.add_constraint(nga.Weld("body", "universe", name="weld"))
    run = nga.simulate(scene, pin.neutral(scene.model), np.zeros(6), t_end=0.01, dt=2e-3)
    (panel,) = [panel for panel in panels(run) if panel.key == "constraint"]
    assert {curve.group for curve in panel.curves} == {"weld"}
    assert [curve.label for curve in panel.curves] == [f"row {n}" for n in range(1, 7)]
    force = np.linalg.norm([curve.y for curve in panel.curves][:3], axis=0)
    np.testing.assert_allclose(force, 9.81, rtol=1e-9)  # the weight of the ball
    (axes, *_) = viz.plot(run, tmp_path / "weld.png", show=["constraint"]).axes
    assert "weld" in axes.get_title("left")


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


def test_figure_has_units_and_bounds(drop, tmp_path):
    figure = viz.plot(drop, tmp_path / "drop.png", show=["gap", "impulse", "friction", "energy", "position"])
    axes = [ax for ax in figure.axes if ax.get_visible()]
    assert [ax.get_ylabel().split()[-1] for ax in axes] == ["[m]", "s]", "s]", "[J]", "[m]"]
    assert len(axes[2].collections) == 1  # the band of mu P_N
    np.testing.assert_array_equal(axes[0].lines[0].get_ydata(), drop.g_N[:, 0])
    assert (tmp_path / "drop.png").stat().st_size > 10_000


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
