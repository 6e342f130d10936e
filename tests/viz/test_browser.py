"""The page in a real browser: it draws, stays off the network, and its controls do what they say."""

import io
import subprocess
import time
from itertools import combinations

import coal
import numpy as np
import pinocchio as pin
import pytest
from viz_scenes import free_ball

import ngalpha_pin as nga
from ngalpha_pin import viz
from ngalpha_pin.common.optional import MissingPackageError, require
from ngalpha_pin.viz.browser import Browser, BrowserError, find_browser
from ngalpha_pin.viz.video import find_ffmpeg

WIDTH, HEIGHT = 900, 600
FLIGHT, STANCE = 0.05, 0.45
BLUE = np.array([51, 102, 204])


@pytest.fixture(scope="module")
def program():
    try:
        return find_browser()
    except MissingPackageError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def run():
    """A blue ball that falls, slips and rolls to the right, beside a tube that nothing touches."""
    scene = nga.Scene(free_ball())
    scene.add_plane("ground")
    scene.add_geometry("ball", coal.Sphere(0.1), parent="body", color=[*BLUE / 255, 1.0])
    scene.add_geometry(
        "tube", nga.Hollow(coal.Cylinder(0.3, 0.4)), placement=pin.SE3(np.eye(3), np.array([0, 1.0, 0.3]))
    )
    scene.add_contact("ball", "ground", mu=0.3)
    v0 = np.array([2.0, 0, 0, 0, 0, 0])
    return nga.simulate(scene, np.array([0, 0, 0.15, 0, 0, 0, 1.0]), v0, t_end=0.5, dt=2e-3)


@pytest.fixture(scope="module")
def page(run, tmp_path_factory):
    return viz.save_html(run, tmp_path_factory.mktemp("browser") / "ball.html")


@pytest.fixture(scope="module")
def browser(program, page):
    with Browser(WIDTH, HEIGHT, path=program) as browser:
        browser.open(page, ready="window.replay", fragment="paused")
        yield browser


@pytest.fixture(autouse=True)
def start(browser):
    browser.evaluate("replay.set_time(0)")


def picture(browser, at=None):
    """The 3D view at a time, without what lies over it, as an array of RGB."""
    if at is not None:
        browser.evaluate(f"replay.set_time({at})")
    overlay = "document.querySelectorAll('#stage > :not(#pane)').forEach((e) => {{ e.style.visibility = '{}'; }})"
    browser.evaluate(overlay.format("hidden"))
    image = require("PIL.Image", "", "").open(io.BytesIO(browser.screenshot())).convert("RGB")
    browser.evaluate(overlay.format(""))
    right, bottom = browser.evaluate(
        "[document.getElementById('pane')].flatMap((e) => [e.clientWidth, e.clientHeight])"
    )
    return np.asarray(image).astype(int)[:bottom, :right]


def differing(a, b):
    """Number of pixels that differ visibly."""
    return int((np.abs(a - b).max(axis=2) > 12).sum())


def click(browser, selector):
    """Press the mouse in the middle of an element, as a user does."""
    x, y = browser.evaluate(
        f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView({{block: 'center'}});"
        " const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
    for kind in ("mousePressed", "mouseReleased"):
        browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)


def press(browser, key, code):
    for kind in ("keyDown", "keyUp"):
        browser.call("Input.dispatchKeyEvent", type=kind, key=key, code=code)


def test_nothing_is_asked_from_the_network(browser):
    assert [url[:60] for url in browser.requests() if not url.startswith(("file:", "data:", "blob:"))] == []


def test_the_ball_is_drawn_in_its_colour(browser):
    image = picture(browser)
    bluish = (image[..., 2] > 1.5 * image[..., 0]) & (image[..., 2] > 60)
    assert bluish.sum() > 300
    rows, columns = np.nonzero(bluish)
    assert np.ptp(rows) < HEIGHT / 3
    assert np.ptp(columns) < WIDTH / 3


def test_time_can_be_set_and_changes_the_picture(browser):
    first, second = picture(browser, FLIGHT), picture(browser, STANCE)
    assert browser.evaluate("replay.time()") == pytest.approx(STANCE)
    assert differing(first, second) > 500
    assert differing(second, picture(browser, STANCE)) == 0


def test_bodies_are_where_the_trajectory_has_them(browser, run):
    for at in (0.0, 0.2, 0.5):
        browser.evaluate(f"replay.set_time({at})")
        found = browser.evaluate(
            "(() => { const { scene } = replay.viewer, ball = scene.getObjectByName('ball');"
            " scene.updateMatrixWorld(true);"
            " return scene.matrixWorld.clone().invert().multiply(ball.matrixWorld).elements; })()"
        )
        i = int(np.argmin(np.abs(run.t - at)))
        expected = pin.XYZQUATToSE3(run.q[i]).homogeneous
        np.testing.assert_allclose(np.array(found).reshape(4, 4).T, expected, atol=2e-3)


def test_forces_are_shown_in_stance_and_not_in_flight(browser, run):
    browser.evaluate(f"replay.set_time({FLIGHT})")
    assert browser.evaluate("replay.forces()") == [[]]
    browser.evaluate("replay.set_time(0.15)")
    assert browser.evaluate("replay.forces()[0][0].state") == "slip"
    browser.evaluate(f"replay.set_time({STANCE})")
    (force,) = browser.evaluate("replay.forces()[0]")
    assert force["state"] == "stick"
    assert force["force"] == pytest.approx(9.81, rel=1e-3)
    shown = {at: picture(browser, at) for at in (FLIGHT, STANCE)}
    click(browser, "#forces")
    assert differing(picture(browser, FLIGHT), shown[FLIGHT]) == 0
    assert differing(picture(browser, STANCE), shown[STANCE]) > 30
    click(browser, "#forces")


@pytest.mark.parametrize("box", ["cones", "trace", "follow"])
def test_switches_change_the_picture(browser, box):
    before = picture(browser, STANCE)
    click(browser, f"#{box}")
    browser.evaluate(f"replay.set_time({STANCE})")
    assert differing(picture(browser, STANCE), before) > 30
    click(browser, f"#{box}")
    browser.evaluate("replay.set_time(0)")
    click(browser, "[data-view=home]")


def test_a_click_on_an_event_moves_the_time(browser, run):
    click(browser, "#show-events")
    rows = browser.evaluate("document.querySelectorAll('#tab-events tbody tr').length")
    assert rows == len(run.events)
    for n, event in enumerate(run.events):
        click(browser, f"#tab-events tbody tr:nth-child({n + 1})")
        assert browser.evaluate("replay.time()") == pytest.approx(event.t)
    click(browser, "#show-audit")
    text = browser.evaluate("document.getElementById('tab-audit').innerText")
    assert all(row[0] in text for row in run.audit().rows())
    click(browser, "#show-plots")


def test_a_click_in_a_plot_moves_the_time(browser):
    click(browser, "details.plot[open] canvas")
    assert browser.evaluate("replay.time()") == pytest.approx(0.2, abs=0.05)  # left of the middle: the axes


def test_plots_show_curves(browser):
    drawn = browser.evaluate(
        "[...document.querySelectorAll('details.plot[open] canvas')].map((c) => new Set(new Uint32Array("
        "c.getContext('2d').getImageData(0, 0, c.width, c.height).data.buffer)).size)"
    )
    assert len(drawn) >= 4
    assert min(drawn) > 10


TEXTS = """(() => {
  const found = [];
  for (const e of document.querySelectorAll('#panel *')) {
    if (e.closest('details:not([open])') && !e.closest('summary')) continue;
    const own = [...e.childNodes].filter((n) => n.nodeType === 3 && n.textContent.trim());
    const range = document.createRange();
    for (const node of own) {
      range.selectNodeContents(node);
      const b = range.getBoundingClientRect();
      if (b.width && b.height) found.push([node.textContent.trim(), b.left, b.top, b.right, b.bottom]);
    }
  }
  return found;
})()"""


@pytest.mark.parametrize("tab", ["plots", "events", "audit"])
def test_no_text_of_the_panel_lies_over_another(browser, tab):
    click(browser, f"#show-{tab}")
    found = browser.evaluate(TEXTS)
    assert len(found) > 10
    for (a, *box), (b, *other) in combinations(found, 2):
        wide, high = (min(box[k + 2], other[k + 2]) - max(box[k], other[k]) for k in (0, 1))
        assert wide <= 1 or high <= 3, f"{a!r} and {b!r} lie over each other"
    cut = browser.evaluate(
        "[...document.querySelectorAll('details.plot summary')].filter((e) => e.scrollWidth > e.clientWidth + 1)"
        ".map((e) => e.textContent)"
    )
    assert cut == []
    click(browser, "#show-plots")


def test_it_plays_pauses_and_steps(browser):
    click(browser, "#play")
    time.sleep(0.3)
    assert browser.evaluate("replay.time()") > 0.0
    click(browser, "#play")
    stopped = browser.evaluate("replay.time()")
    time.sleep(0.1)
    assert browser.evaluate("replay.time()") == stopped
    press(browser, "ArrowRight", "ArrowRight")
    after = browser.evaluate("replay.time()")
    assert 0 < after - stopped < 0.05
    press(browser, "Home", "Home")
    assert browser.evaluate("replay.time()") == 0.0


def test_the_page_fits_a_narrow_window(browser):
    try:
        browser.resize(420, 800)
        time.sleep(0.2)
        assert browser.evaluate("document.documentElement.scrollWidth") <= 420
        assert browser.evaluate("document.getElementById('pane').clientHeight") > 200
    finally:
        browser.resize(WIDTH, HEIGHT)


def test_ghosts_and_a_free_body(browser, page, run, tmp_path):
    path = viz.save_html([run, run], tmp_path / "two.html", labels=["one", "two"])
    browser.open(path, ready="window.replay", fragment="paused")
    browser.evaluate(f"replay.set_time({STANCE})")
    with_both = picture(browser)
    click(browser, "#runs label:nth-child(2) input")
    assert differing(picture(browser), with_both) > 30
    browser.open(page, ready="window.replay", fragment="paused")


def test_a_video_of_pictures(program, run, tmp_path):
    path = viz.save_video(run, tmp_path / "ball.gif", fps=4.0, size=(320, 240), browser=program)
    with require("PIL.Image", "", "").open(path) as film:
        assert film.n_frames == 3
        assert film.size == (320, 240)


@pytest.mark.long
def test_a_video_to_send(program, run, tmp_path):
    try:
        ffmpeg = find_ffmpeg()
    except MissingPackageError as error:
        pytest.skip(str(error))
    path = viz.save_video(run, tmp_path / "ball.mp4", fps=10.0, speed=0.5, size=(321, 240), browser=program)
    decode = [ffmpeg, "-loglevel", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    content = subprocess.run(decode, capture_output=True, check=True).stdout
    frames = np.frombuffer(content, np.uint8).reshape(-1, 240, 322, 3)
    assert len(frames) == 11  # 0.5 s at half the speed
    assert differing(frames[0].astype(int), frames[-1].astype(int)) > 100
    with pytest.raises(OSError, match="ffmpeg says"):
        viz.save_video(run, tmp_path / "no folder" / "ball.mp4", fps=2.0, size=(640, 480), browser=program)


def test_a_failing_script_is_reported(browser):
    with pytest.raises(BrowserError, match="no_such_name"):
        browser.evaluate("no_such_name")


def test_the_page_has_complained_about_nothing(browser):
    assert browser.complaints() == []
