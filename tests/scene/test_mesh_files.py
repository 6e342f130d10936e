"""Files of meshes: places, units and hulls, with closed forms of volumes."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.meshes import find_mesh, hull_excess, metres_per_unit


@pytest.mark.parametrize(
    "uri", ["package://arm/meshes/a b.stl", "package://arm/meshes/a%20b.stl", "a%20b.stl", "model://arm/meshes/a b.stl"]
)
def test_a_mesh_is_found_above_the_file(tmp_path, uri):
    mesh = tmp_path / "arm" / "meshes" / "a b.stl"
    mesh.parent.mkdir(parents=True)
    mesh.touch()
    assert find_mesh(uri, mesh.parent / "arm.urdf", None) == mesh.resolve()
    assert find_mesh(uri, tmp_path / "elsewhere.urdf", [str(tmp_path / "arm")]) == (
        mesh.resolve() if "arm/" in uri else None
    )
    assert find_mesh(f"file://{mesh}", tmp_path / "x.urdf", []) == mesh.resolve()


@pytest.mark.parametrize(("unit", "metres"), [('<unit meter="0.001" name="mm"/>', 0.001), ("", 1.0)])
def test_units_of_collada(tmp_path, unit, metres):
    file = tmp_path / "part.dae"
    file.write_text(f"<COLLADA><asset>{unit}</asset></COLLADA>", encoding="utf-8")
    assert metres_per_unit(str(file)) == metres
    assert metres_per_unit("part.stl") == 1.0
    file.write_text('<COLLADA><unit meter="-1"/></COLLADA>', encoding="utf-8")
    with pytest.raises(SceneError, match="unit of length"):
        metres_per_unit(str(file))


def mesh(points, triangles):
    found = coal.BVHModelOBBRSS()
    found.beginModel(len(triangles), 3 * len(triangles))
    for triangle in triangles:
        found.addTriangle(*(np.array(points[i], dtype=float) for i in triangle))
    found.endModel()
    return pin.GeometryObject("part", 0, pin.SE3.Identity(), found)


def octahedron(height):
    """Its upper tip is at a height; below 0 it is hollow from above."""
    points = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, height], [0, 0, -1]]
    upper, lower = [(i, (i + 1) % 4, 4) for i in range(4)], [((i + 1) % 4, i, 5) for i in range(4)]
    return points, upper + lower


def test_how_much_larger_a_hull_is():
    assert hull_excess(mesh(*octahedron(1.0))) is None
    # a pyramid of volume 2 / 3 from which a pyramid of half its height is cut
    volume, hull = hull_excess(mesh(*octahedron(-0.5)))
    assert volume == pytest.approx(1 / 3) and hull == pytest.approx(2 / 3)
    points, triangles = octahedron(-0.5)
    assert hull_excess(mesh(points, triangles[1:])) is None  # open: it has no volume
    assert hull_excess(pin.GeometryObject("ball", 0, pin.SE3.Identity(), coal.Sphere(1.0))) is None
