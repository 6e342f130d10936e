"""Every shape and every deforming body is drawn where it is, in a real browser, and sent to the live viewer."""

import dataclasses

import coal
import numpy as np
import pinocchio as pin
import pytest
from viz_scenes import HOLLOW, SHAPES, bent, fixed_shapes

import ngalpha_pin as nga
from ngalpha_pin import viz
from ngalpha_pin.common.optional import MissingPackageError, require
from ngalpha_pin.viz.browser import Browser, find_browser
from ngalpha_pin.viz.frames import bounds, sample
from ngalpha_pin.viz.objects import Recorder, recorded_objects
from ngalpha_pin.viz.player import LiveScene
from ngalpha_pin.viz.tubes import tube_surface, tubes

RADIUS = 0.02


@pytest.fixture(scope="module")
def run():
    run = fixed_shapes()
    run.tubes = [("beam", bent(run.t), RADIUS)]
    return run


@pytest.fixture(scope="module")
def page(run, tmp_path_factory):
    try:
        program = find_browser()
    except MissingPackageError as error:
        pytest.skip(str(error))
    path = viz.save_html(run, tmp_path_factory.mktemp("shapes") / "shapes.html")
    with Browser(600, 400, path=program) as browser:
        browser.open(path, ready="window.replay", fragment="paused")
        yield browser
        assert browser.complaints() == []


def vertices(page, name, frame):
    """Vertices of all meshes of an object, in the frame of the object or of the world (z up)."""
    inverse = {"own": "node.matrixWorld.clone().invert()", "world": "replay.viewer.scene.matrixWorld.clone().invert()"}
    found = page.evaluate(
        f"(() => {{ const node = replay.viewer.scene.getObjectByName({name!r}), points = [];"
        f" replay.viewer.scene.updateMatrixWorld(true); const to = {inverse[frame]};"
        " node.traverse((mesh) => { if (!mesh.isMesh) return; const { position } = mesh.geometry.attributes;"
        " const matrix = to.clone().multiply(mesh.matrixWorld);"
        " const point = mesh.position.clone(); for (let n = 0; n < position.count; n++) points"
        ".push(...point.fromBufferAttribute(position, n).applyMatrix4(matrix).toArray()); }); return points; })()"
    )
    return np.array(found).reshape(-1, 3)


@pytest.mark.parametrize("name", SHAPES | HOLLOW)
def test_shapes_are_drawn_where_coal_has_them(page, run, name):
    geometry = run.scene.geometry(name)
    geometry.geometry.computeLocalAABB()
    box = geometry.geometry.aabb_local
    placed = vertices(page, name, "world")
    local = (placed - geometry.placement.translation) @ geometry.placement.rotation
    np.testing.assert_allclose(local.min(axis=0), box.min_, atol=3e-3 * np.ptp([box.min_, box.max_]))
    np.testing.assert_allclose(local.max(axis=0), box.max_, atol=3e-3 * np.ptp([box.min_, box.max_]))
    if name == "cone":  # the box does not tell where its tip is
        assert np.linalg.norm(local[local[:, 2] > 0.1499, :2], axis=1).max() < 1e-6


def test_hollow_shapes_show_their_inside(page):
    for name in HOLLOW:
        side = page.evaluate(
            f"(() => {{ let side; replay.viewer.scene.getObjectByName({name!r})"
            ".traverse((mesh) => { if (mesh.isMesh) side = mesh.material.side; }); return side; })()"
        )
        assert side == 1


@pytest.mark.parametrize("t", [0.0, 0.04, 0.1])
def test_a_tube_follows_its_centreline(page, t):
    page.evaluate(f"replay.set_time({t})")
    (line,) = bent([t])
    placed = vertices(page, "beam", "world")
    distance = np.linalg.norm(placed[:, None] - line, axis=2).min(axis=1)
    np.testing.assert_allclose(distance[: len(line) * 16], RADIUS, rtol=1e-3)
    np.testing.assert_allclose(placed[-2:], line[[0, -1]], atol=1e-6)
    normals = np.array(
        page.evaluate("[...replay.viewer.scene.getObjectByName('beam').geometry.attributes.normal.array]")
    ).reshape(-1, 3)
    outward = (placed[: len(line) * 16] - np.repeat(line, 16, axis=0)) / RADIUS
    np.testing.assert_allclose(normals[: len(line) * 16], outward, atol=1e-3)


def test_a_tube_moves_between_frames(page):
    page.evaluate("replay.set_time(0.05)")
    first = vertices(page, "beam", "world")
    page.evaluate("replay.set_time(0.052)")
    moved = np.abs(vertices(page, "beam", "world") - first).max()
    assert 1e-3 < moved < 0.02


def test_frames_are_shown_on_demand(page):
    count = (
        "(() => { let n = 0; replay.viewer.scene.getObjectByName('run 1')"
        ".traverse((o) => { n += o.type === 'AxesHelper' && o.visible; }); return n; })()"
    )
    assert page.evaluate(count) == 0
    page.evaluate("document.getElementById('frames').click()")
    assert page.evaluate(count) == 2  # the world and the ball
    page.evaluate("document.getElementById('frames').click()")


def test_surface_of_a_tube_is_closed():
    vertices, faces = tube_surface(bent([0.1])[0], RADIUS)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    # every edge belongs to two triangles, which run through it in opposite directions
    assert sorted(map(tuple, edges)) == sorted(map(tuple, edges[:, ::-1]))
    a, b, c = vertices[faces].swapaxes(0, 1)
    volume = np.sum(a * np.cross(b, c)) / 6
    polygon = 16 / 2 * np.sin(2 * np.pi / 16) * RADIUS**2
    assert volume == pytest.approx(polygon * 0.5, rel=1e-2)


def test_box_of_the_motion_holds_the_tubes():
    model = pin.Model()
    run = fixed_shapes()
    nothing = np.zeros((len(run.t), 0))
    still = dataclasses.replace(run, scene=nga.Scene(model), q=nothing, v=nothing, a=nothing)
    still.tubes = [("beam", bent(run.t), RADIUS)]
    box = bounds(still.scene, sample(still))
    np.testing.assert_allclose(box.start, [[-RADIUS, -RADIUS, -RADIUS], [0.5 + RADIUS, RADIUS, RADIUS]], atol=1e-12)
    assert box.motion[1, 2] == pytest.approx(1 / np.pi + RADIUS, rel=1e-3)  # height of the quarter circle


@pytest.mark.parametrize(
    ("points", "radius", "says"),
    [
        (np.zeros((3, 5, 3)), 0.1, r"shape \(3, 5, 3\), not \(6, n, 3\)"),
        (np.zeros((6, 1, 3)), 0.1, r"n >= 2"),
        (np.zeros((6, 5, 3)), 0.0, "radius = 0.0 must be positive"),
    ],
)
def test_wrong_tubes_are_refused(points, radius, says):
    run = fixed_shapes()
    run.tubes = [("beam", points, radius)]
    with pytest.raises(nga.SceneError, match=f"tube 'beam'.*{says}"):
        tubes(run, np.arange(2))


def test_live_viewer_redraws_the_tubes(run):
    recorder = Recorder()
    scene = LiveScene(require("meshcat", "", "").Visualizer(window=recorder), run)
    sent = []
    for row in (0, len(scene.frames.t) - 1):
        recorder.commands.clear()
        scene.show(row)
        (command,) = [c for c in recorder.commands if c["type"] == "set_object"]
        assert command["path"].endswith("/tube0")
        data = command["object"]["geometries"][0]["data"]["attributes"]["position"]["array"].data
        sent.append(np.frombuffer(data, "<f4").reshape(-1, 3))
    for points, t in zip(sent, (0.0, 0.1), strict=True):
        np.testing.assert_allclose(points[-2:], bent([t])[0][[0, -1]], atol=1e-6)


def test_a_shape_that_cannot_be_drawn_is_named():
    geometry = pin.GeometryObject("cloud", 0, pin.SE3.Identity(), coal.OcTree(0.1))
    with pytest.raises(nga.SceneError, match="'cloud', of the kind OcTree"):
        recorded_objects([geometry])
