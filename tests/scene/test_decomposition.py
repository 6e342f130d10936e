"""Meshes that are not convex, in convex parts: what is in a recess is not held off by a hull."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial import ConvexHull

import ngalpha_pin as nga
from ngalpha_pin.cli.info import file_tables
from ngalpha_pin.common.optional import MissingPackageError
from ngalpha_pin.scene import convex_parts

BOX = (
    (0, 1, 3),
    (0, 3, 2),
    (4, 6, 7),
    (4, 7, 5),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
    (1, 5, 7),
    (1, 7, 3),
)
GRAVITY = 9.81


@pytest.fixture(autouse=True)
def _cache(tmp_path, monkeypatch):
    monkeypatch.setenv("NGALPHA_CACHE", str(tmp_path / "parts"))


def blocks(*limits):
    """Triangles of blocks, as a CAD program writes what is put together of some."""
    points = [np.array([(x, y, z) for x in b[:2] for y in b[2:4] for z in b[4:]], dtype=float) for b in limits]
    return np.concatenate([p[list(face)] for p in points for face in BOX]).reshape(-1, 3, 3)


def extruded(outline, triangles, width):
    """One closed surface: an outline in x and z, along y."""
    n = len(outline)
    p = np.array([(x, y, z) for y in (-width, width) for x, z in outline], dtype=float)
    faces = [*triangles, *((a + n, c + n, b + n) for a, b, c in triangles)]
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, i + n, j), (j, i + n, j + n)]
    return p[np.array(faces)]


TABLE = blocks(
    (-0.5, 0.5, -0.4, 0.4, 0.5, 0.55),
    *(
        (0.5 * x - 0.05, 0.5 * x + 0.05, 0.35 * y - 0.05, 0.35 * y + 0.05, 0.0, 0.5)
        for x in (-0.8, 0.8)
        for y in (-0.8, 0.8)
    ),
)
# a block with a groove whose sides fall at 45 degrees
VALLEY = extruded(
    [(-0.5, -0.3), (0.5, -0.3), (0.5, 0.3), (0.3, 0.3), (0.0, 0.0), (-0.3, 0.3), (-0.5, 0.3)],
    [(0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 4, 6), (4, 5, 6)],
    0.3,
)


def ring(outer, inner, thick):
    """A plate with a square hole, top at z = 0."""
    corners = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
    p = np.array([(s * x, s * y, z) for z in (-thick, 0.0) for s in (outer, inner) for x, y in corners])
    faces = []
    for k in range(4):
        m = (k + 1) % 4
        faces += [(k + 8, m + 8, m + 12), (k + 8, m + 12, k + 12), (m + 4, m, k), (k + 4, m + 4, k)]
        faces += [(k, m, m + 8), (k, m + 8, k + 8), (k + 4, k + 12, m + 12), (k + 4, m + 12, m + 4)]
    return p[np.array(faces)]


def mesh(triangles):
    found = coal.BVHModelOBBRSS()
    found.beginModel(len(triangles), 3 * len(triangles))
    for corners in triangles:
        found.addTriangle(*corners)
    found.endModel()
    return found


def scene_with(triangles, shape, inertia=None):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(joint, inertia or pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_geometry("thing", mesh(triangles))
    scene.add_geometry("body", shape, "body")
    return scene


def parts_of(triangles, **given):
    points = np.asarray(triangles).reshape(-1, 3)
    return convex_parts.convex_parts(
        "thing", points, np.arange(len(points)).reshape(-1, 3), **{"threshold": 0.05, "most": None, **given}
    )


def test_a_ball_under_a_table_rolls_there():
    """The table is of convex blocks, which need no library; the ball is in its hull."""
    scene = scene_with(TABLE, coal.Sphere(0.1))
    scene.set_surface("*", mu=0.3)
    with pytest.warns(UserWarning, match=r"'thing' by \d+%.*scene.decompose\('thing'\) makes convex parts"):
        scene.add_contact("body", "thing")
    scene.add_plane("ground")
    scene.add_contact("body", "ground", mu=0.3)
    q = pin.neutral(scene.model)
    q[2] = 0.1
    with pytest.raises(nga.Penetration, match="of 'thing' it is the convex hull that overlaps, not the mesh"):
        nga.simulate(scene, q, t_end=0.01, dt=1e-3)
    assert scene.decompose("thing") == [f"thing {i}" for i in range(5)]
    assert {pair.geometry_b for pair in scene.contacts} == {"ground", *(f"thing {i}" for i in range(5))}
    assert all(pair.law.mu == 0.3 for pair in scene.contacts)
    assert scene.geometries("thing") == [f"thing {i}" for i in range(5)]
    v = np.array([1.0, 0, 0, 0, 10.0, 0])
    run = nga.simulate(scene, q, v, t_end=0.2, dt=2e-3)
    alone = scene_with(TABLE, coal.Sphere(0.1))
    alone.add_contact("body", alone.add_plane("ground"), mu=0.3)
    # between the legs it rolls on as on the ground alone, to the second order of dt by 0.2 m
    np.testing.assert_allclose(run.q[-1], nga.simulate(alone, q, v, t_end=0.2, dt=2e-3).q[-1], atol=1e-12)
    assert run.q[-1, 0] == pytest.approx(0.2, abs=1e-4) and run.audit().ok
    q[2] = 0.45  # it would be in the top
    with pytest.raises(nga.Penetration, match="move the bodies apart or leave the pair out$"):
        nga.simulate(scene, q, t_end=0.01, dt=1e-3)


def test_a_ball_in_a_valley_touches_both_sides():
    pytest.importorskip("coacd")
    scene = scene_with(VALLEY, coal.Sphere(0.1))
    assert len(scene.decompose("thing")) == 2
    scene.add_contact("body", "thing")
    q, depth = pin.neutral(scene.model), 0.1 * np.sqrt(2.0)
    q[2] = depth + 0.02
    run = nga.simulate(scene, q, t_end=0.3, dt=2e-3)
    np.testing.assert_allclose(run.q[-1, :3], [0.0, 0.0, depth], atol=1e-9)
    assert run.audit().ok
    volume = sum(ConvexHull(np.array(scene.geometry(n).geometry.points())).volume for n in scene.geometries("thing"))
    assert volume == pytest.approx(0.6 * (0.6 - 0.09), rel=1e-14)
    (entry,) = scene.contents
    assert (entry.what, entry.fate) == ("convex parts of thing", "used")
    assert "the mesh has 0.306, its hull 0.36" in entry.reason
    assert f"convex parts of thing: {entry.number}" in dict(file_tables(scene)["file"])


@pytest.mark.long
def test_seams_of_a_decomposed_plate_are_not_felt():
    pytest.importorskip("coacd")
    scene = scene_with(ring(0.5, 0.15, 0.1), coal.Box(0.2, 0.15, 0.1), pin.Inertia.FromBox(1.0, 0.2, 0.15, 0.1))
    assert len(scene.decompose("thing")) > 3
    scene.add_contact("body", "thing", mu=0.0)
    q = pin.neutral(scene.model)
    q[:3] = -0.35, -0.38, 0.05
    v = np.array([1.0, 0.12, 0, 0, 0, 0.0])
    run = nga.simulate(scene, q, v, t_end=0.6, dt=2e-3)
    assert np.abs(run.v - v).max() < 1e-9
    assert np.abs(run.q[:, 2] - 0.05).max() < 1e-12


def test_parts_are_kept_by_content(monkeypatch):
    first = parts_of(TABLE)
    (file,) = convex_parts.cache_folder().iterdir()
    monkeypatch.setattr(convex_parts, "_pieces", None)  # is not asked again
    for one, two in zip(first, parts_of(TABLE), strict=True):
        np.testing.assert_array_equal(one, two)
    monkeypatch.undo()
    file.write_bytes(b"damaged")
    assert len(parts_of(TABLE)) == len(first)
    assert len(parts_of(TABLE[:12])) == 1 and len(list(convex_parts.cache_folder().iterdir())) == 2


def test_what_cannot_be_decomposed_is_said(monkeypatch):
    scene = scene_with(VALLEY, coal.Sphere(0.1))
    with pytest.raises(nga.SceneError, match=r"'body' is no mesh with triangles but 'body' \(Sphere\)"):
        scene.decompose("body")
    with pytest.raises(nga.SceneError, match="threshold"):
        scene.decompose("thing", threshold=0.0)
    monkeypatch.setattr(convex_parts, "find_spec", lambda name: None)
    with pytest.raises(
        MissingPackageError, match=r"geometry 'thing'.*needs coacd: pip install 'ngalpha-pin\[convex\]'"
    ):
        scene.decompose("thing")
    assert scene.geometries("*") == ["thing", "body"]
    with pytest.raises(nga.SceneError, match="geometry 'thing': its mesh is not closed"):
        scene_with(VALLEY[1:], coal.Sphere(0.1)).decompose("thing")


def test_meshes_of_a_file(tmp_path):
    head = np.array([len(TABLE)], dtype="<u4").tobytes()
    rows = np.zeros(len(TABLE), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("end", "<u2")])
    rows["corners"] = TABLE
    (tmp_path / "table.stl").write_bytes(bytes(80) + head + rows.tobytes())
    shape = '<collision><geometry><mesh filename="table.stl"/></geometry></collision>'
    (tmp_path / "table.urdf").write_text(f'<robot name="r"><link name="table">{shape}</link></robot>')
    scene = nga.Scene.from_urdf(tmp_path / "table.urdf", convex_decomposition=True)
    assert scene.geometries("table_0") == [f"table_0 {i}" for i in range(5)]
    assert any(entry.what == "convex parts of table_0" and entry.number == 5 for entry in scene.contents)
