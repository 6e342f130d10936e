"""Meshes: with and without their files, with the colours and placements of Pinocchio's own viewer."""

import importlib.util
import re
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.common.optional import require
from ngalpha_pin.viz.collada import read_collada
from ngalpha_pin.viz.frames import drawn_geometries
from ngalpha_pin.viz.objects import Recorder, recorded_objects


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


@pytest.mark.skipif(importlib.util.find_spec("example_robot_data") is None, reason="no example-robot-data-loaders")
@pytest.mark.parametrize("name", ["anymal", "talos"])
def test_a_robot_agrees_with_the_viewer_of_pinocchio(name):
    example_robot_data = pytest.importorskip("example_robot_data")
    robot = example_robot_data.load(name)
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
        matrix = matrix @ np.diag([*geometry.meshScale, 1.0])  # Talos mirrors some of its meshes
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
