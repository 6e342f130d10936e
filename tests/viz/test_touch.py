"""The simulation to touch: what a hand and the sliders do against statics, and all of it by mouse in a real browser."""

import threading
import time
from contextlib import contextmanager

import coal
import numpy as np
import pinocchio as pin
import pytest
from viz_scenes import SHAPES, free_ball

import ngalpha_pin as nga
from ngalpha_pin.cli import main as cli
from ngalpha_pin.common.optional import MissingPackageError
from ngalpha_pin.viz.browser import Browser, find_browser
from ngalpha_pin.viz.solids import triangles

pytest.importorskip("viser")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::ResourceWarning")

from ngalpha_pin.viz.touch import PULL, RANGE, LiveView, limits  # noqa: E402


@pytest.mark.parametrize("name", [name for name in SHAPES if "terrain" not in name])
def test_triangles_have_the_size_of_the_shape(name):
    shape = SHAPES[name]
    vertices, faces = triangles(pin.GeometryObject(name, 0, pin.SE3.Identity(), shape))
    assert faces.max() < len(vertices)
    shape.computeLocalAABB()
    low, high = shape.aabb_local.min_, shape.aabb_local.max_
    tolerance = 0.03 * np.linalg.norm(high - low)
    np.testing.assert_allclose(vertices.min(axis=0), low, atol=tolerance)
    np.testing.assert_allclose(vertices.max(axis=0), high, atol=tolerance)


def test_a_mesh_has_its_own_triangles():
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(2, 6)
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], dtype=float)
    given = [corners[[0, 1, 2]], corners[[0, 2, 3]]]
    for triangle in given:
        mesh.addTriangle(*triangle)
    mesh.endModel()
    vertices, faces = triangles(pin.GeometryObject("mesh", 0, pin.SE3.Identity(), mesh))
    np.testing.assert_array_equal(np.sort(vertices[faces], axis=0), np.sort(given, axis=0))


def box():
    scene = nga.Scene(free_ball())
    scene.add_plane("ground")
    scene.add_geometry("box", coal.Box(0.2, 0.2, 0.2), parent="body", color=(0.2, 0.4, 0.8, 1.0))
    scene.add_contact("box", "ground", mu=0.5)
    return scene, np.array([0, 0, 0.1, 0, 0, 0, 1.0])


@pytest.fixture
def view():
    view = LiveView(*box(), dt=2e-3, port=8190)
    yield view
    view.close()


def ahead(view, seconds):
    """So much of simulated time, however slow the machine is."""
    for _ in range(round(seconds / view.dt)):
        view.step()
        view.advance(10.0)


def test_a_body_hangs_on_the_spring_of_a_hand(view):
    view.take(1, np.array([0, 0, 0.2]), np.array([0, 0, 0.8]))
    ahead(view, 3.0)
    sag = 9.81 / PULL**2  # m g / k, and k = m PULL^2
    np.testing.assert_allclose(view.state.q[:3], [0, 0, 0.8 - 0.1 - sag], atol=2e-3)
    assert view.message == ""
    view.grip = None
    ahead(view, 1.0)
    assert view.state.q[2] == pytest.approx(0.1, abs=1e-3)  # on the ground again


def test_pause_step_speed_and_reset(view):
    assert view.paused
    view.advance(0.1)
    assert view.state.t == 0.0
    view.step()
    view.advance(0.1)
    assert view.state.t == pytest.approx(view.dt)
    view.paused, view.speed = False, 0.1
    view.advance(1.0)
    assert view.state.t == pytest.approx(51 * view.dt, abs=1e-9)
    view.reset()
    view.paused = True
    view.advance(0.1)
    assert view.state.t == 0.0
    np.testing.assert_array_equal(view.state.q, box()[1])


def test_a_slider_moves_the_reference_of_a_joint():
    view = turning(port=8191)
    try:
        assert [x.item() for x in limits(view.model)] == [-np.inf, np.inf]
        view._move(1, 0.4)
        ahead(view, 2.0)
        assert view.state.q[0] == pytest.approx(0.4, abs=1e-3)
    finally:
        view.close()


def test_a_step_that_fails_is_said_and_stops(view, monkeypatch):
    def fails(*args):
        raise nga.SceneError("no more\nof this")

    monkeypatch.setattr(view.simulator, "step", fails)
    view.paused = False
    view.advance(0.1)
    assert view.paused
    assert view.message == "no more of this"
    view.show()
    assert "no more of this" in view._clock.value


def test_the_command_line_opens_it(monkeypatch, capsys):
    calls = []
    monkeypatch.setattr("ngalpha_pin.viz.live", lambda scene, q0, v0, dt, method: calls.append((scene.model.name, dt)))
    assert cli.main(["run", "rotating_ball", "--live"]) == 0
    assert calls == [("rotating_ball", cli.DEFAULTS["rotating_ball"].dt)]
    assert cli.main(["run", "rotating_ball", "--live", "--t-end", "1"]) == 2
    assert "--live runs until Ctrl-C" in capsys.readouterr().err


def press(browser, text):
    click(browser, "button", text)


def mouse(browser, kind, x, y):
    pressed = 0 if kind == "mouseReleased" else 1
    browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=pressed, clickCount=1)


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


@contextmanager
def opened(view):
    """A browser on a view that runs; it has been heard once already."""
    try:
        program = find_browser()
    except MissingPackageError as error:
        pytest.skip(str(error))
    stop = threading.Event()

    def loop():
        while not stop.is_set():
            view.run(0.2)

    thread = threading.Thread(target=loop)
    with Browser(1000, 700, path=program) as browser:
        browser.open(view.page, ready="[...document.querySelectorAll('button')].some((b) => b.innerText === 'reset')")
        thread.start()
        try:
            until(lambda: _stepped(browser, view))
            yield browser
        finally:
            stop.set()
            thread.join()


@pytest.mark.long  # viser's page is slow without a graphics card
def test_a_browser_drags_pauses_steps_and_resets(view):
    with opened(view) as browser:
        assert view.paused
        press(browser, "play")
        until(lambda: not view.paused and view.state.t > 0.05)
        until(lambda: _drag(browser, view), 120.0)
        until(lambda: view.state.q[2] > 0.12)  # the hand has lifted it
        mouse(browser, "mouseReleased", 500, 200)
        until(lambda: view.grip is None)
        press(browser, "pause")
        until(lambda: view.paused)
        press(browser, "reset")
        until(lambda: view.state.t == 0.0)
        assert view.message == ""


@pytest.mark.long
def test_a_browser_chooses_the_speed_and_moves_a_joint():
    view = turning(port=8192)
    try:
        with opened(view) as browser:
            click(browser, "input[role=combobox]:not([readonly])")
            until(lambda: middle(browser, "[role=option]", "0.1") is not None)
            click(browser, "[role=option]", "0.1")
            until(lambda: view.speed == 0.1)
            assert middle(browser, "[role=slider]") is not None
            # by its keys, each of which is a step of the slider: (high - low) / 200
            browser.evaluate("document.querySelector('[role=slider]').focus()")
            for _ in range(20):
                for kind in ("rawKeyDown", "keyUp"):
                    code = {"key": "ArrowRight", "code": "ArrowRight", "windowsVirtualKeyCode": 39}
                    browser.call("Input.dispatchKeyEvent", type=kind, **code)
            moved = 20 * 2 * RANGE / 200
            until(lambda: view._shift[0] == pytest.approx(moved))
            view.speed = 1.0
            press(browser, "play")
            until(lambda: view.state.q[0] == pytest.approx(moved, abs=1e-3) and abs(view.state.v[0]) < 1e-2)
    finally:
        view.close()


def turning(port):
    """A joint that a servo holds at 0."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "turn")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    scene = nga.Scene(model)
    scene.add_force(nga.JointPD(np.zeros(1), kp=2.0, kd=0.2))
    return LiveView(scene, np.zeros(1), dt=2e-3, port=port)


def middle(browser, selector, text=None):
    """The middle of the first element that a selector finds, with a text of its own; None where there is none."""
    return browser.evaluate(
        f"(() => {{ const e = [...document.querySelectorAll({selector!r})]"
        f".find((x) => {'true' if text is None else f'x.innerText.trim() === {text!r}'});"
        " if (!e) return null; const b = e.getBoundingClientRect();"
        " return b.width > 0 ? [b.x + b.width / 2, b.y + b.height / 2] : null; })()"
    )


def click(browser, selector, text=None):
    at = middle(browser, selector, text)
    assert at, f"no {selector} {text or ''}"
    mouse(browser, "mousePressed", *at)
    mouse(browser, "mouseReleased", *at)


def _stepped(browser, view):
    """Press "step"; whether it has been heard, which it is once the page is connected."""
    press(browser, "step")
    time.sleep(0.5)
    return view.state.t > 0


def _drag(browser, view):
    """Take the body in the middle of the picture and pull it up; whether it was taken."""
    mouse(browser, "mousePressed", 500, 350)
    for y in range(345, 190, -15):
        mouse(browser, "mouseMoved", 500, y)
        time.sleep(0.03)
    end = time.monotonic() + 3.0
    while time.monotonic() < end:
        if view.grip is not None:
            return True
        time.sleep(0.05)
    mouse(browser, "mouseReleased", 500, 200)
    return False
