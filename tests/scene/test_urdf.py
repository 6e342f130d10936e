"""URDF files: what they say acts, and what is wrong with one is told by name."""

import struct
import sys
import types

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.viz.collada import read_collada

INERTIA = '<inertial><mass value="{m}"/><inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial>'
JOINT = '<joint name="{n}" type="{t}"><parent link="{p}"/><child link="{c}"/><axis xyz="0 1 0"/>{x}</joint>'
LIMIT = '<limit lower="-1" upper="1" effort="50" velocity="1"/>'


def link(name, extra="", m=1.0, x=0.01, y=0.01, z=0.01):
    return f'<link name="{name}">{INERTIA.format(m=m, x=x, y=y, z=z)}{extra}</link>'


def joint(name, parent, child, kind="prismatic", extra=LIMIT):
    return JOINT.format(n=name, t=kind, p=parent, c=child, x=extra)


def mesh(file, scale="1 1 1"):
    return f'<collision><geometry><mesh filename="{file}" scale="{scale}"/></geometry></collision>'


@pytest.fixture
def read(tmp_path):
    def scene(content, name="robot.urdf", root=None, **options):
        path = tmp_path / name
        path.write_text(content if content.startswith("<?xml") else f'<robot name="r">{content}</robot>')
        return nga.Scene.from_urdf(path, root, **options)

    return scene


def triangles(size):
    """Those of a box with a corner at the origin, as corners."""
    p = [(x, y, z) for x in (0, size) for y in (0, size) for z in (0, size)]
    sides = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return [[p[i] for i in three] for a, b, c, d in sides for three in ((a, b, c), (a, c, d))]


def write_stl(path, corners):
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *[x for p in t for x in p], 0) for t in corners)
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(corners)) + body)


def size_of(scene):
    shape = scene.collision_model.geometryObjects[0].geometry
    shape.computeLocalAABB()
    return shape.aabb_local.max_ - shape.aabb_local.min_


def test_mimic_joints_of_several_followers_and_a_chain(read):
    """One force on the leader moves all: m a = F with the masses seen through the squares of their factors."""
    mimic = LIMIT + '<mimic joint="{}" multiplier="{}" offset="{}"/>'
    scene = read(
        "".join(link(name) for name in ("base", "a", "b", "c", "d"))
        + joint("ja", "base", "a")
        + joint("jb", "base", "b", extra=mimic.format("ja", -2, 0.1))
        + joint("jc", "base", "c", extra=mimic.format("ja", 0.5, 0.0))
        + joint("jd", "base", "d", extra=mimic.format("jb", 1, -0.1))
    )
    assert [c.name for c in scene.constraints] == ["jb mimics ja", "jc mimics ja", "jd mimics jb"]
    scene.add_force(nga.Control(lambda t, q, v: np.array([3.0, 0.0, 0.0, 0.0])))
    q0 = scene.within_limits(np.zeros(4))
    np.testing.assert_allclose(q0, [0.0, 0.1, 0.0, 0.0])
    run = nga.simulate(scene, q0, t_end=0.2, dt=1e-3)
    x = 0.5 * 3.0 / (1 + 4 + 0.25 + 4) * 0.2**2
    np.testing.assert_allclose(run.q[-1], [x, 0.1 - 2 * x, 0.5 * x, -2 * x], atol=1e-9)


def test_gear_between_continuous_joints_whose_ratio_is_a_fraction(read):
    scene = read(
        link("base") + link("a") + link("b") + joint("ja", "base", "a", "continuous", "")
        + joint("jb", "base", "b", "continuous", "")
    )  # fmt: skip
    with pytest.raises(nga.SceneError, match="must be a fraction with a denominator of at most"):
        scene.add_constraint(nga.JointCoupling("jb", "ja", (0.0, np.sqrt(2))))
    with pytest.raises(nga.SceneError, match="its polynomial must be linear"):
        scene.add_constraint(nga.JointCoupling("jb", "ja", (0.0, 1.0, 1.0)))
    scene.add_constraint(nga.JointCoupling("jb", "ja", (0.2, 2 / 3)))
    q0 = np.array([1.0, 0.0, np.cos(0.2), np.sin(0.2)])
    run = nga.simulate(scene, q0, np.array([6.0, 4.0]), t_end=5.0, dt=1e-2)
    turned = [np.unwrap(np.arctan2(run.q[:, i + 1], run.q[:, i]))[-1] for i in (0, 2)]
    np.testing.assert_allclose(turned, [30.0, 20.2], atol=1e-9)


def test_a_mimic_joint_of_pinocchio_is_refused_by_name(tmp_path):
    mimic = LIMIT + '<mimic joint="ja" multiplier="-1"/>'
    path = tmp_path / "gripper.urdf"
    parts = link("base") + link("a") + link("b") + joint("ja", "base", "a") + joint("jb", "base", "b", extra=mimic)
    path.write_text(f'<robot name="r">{parts}</robot>')
    with pytest.raises(nga.SceneError, match="joint 'jb' is a mimic joint"):
        nga.Scene(pin.buildModelFromUrdf(str(path), mimic=True))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (link("base") + link("a", m="${mass}") + joint("j", "base", "a"), r"link 'a' has value='\$\{mass\}' in <mass>"),
        (link("base") + link("a", m="heavy") + joint("j", "base", "a"), "link 'a': value='heavy' in <mass>"),
        (link("base") + link("a", x="") + joint("j", "base", "a"), "link 'a': ixx='' in <inertia>"),
        (link("base") + link("a", m=-1) + joint("j", "base", "a"), "link 'a': the mass -1 must not be negative"),
        (link("base") + link("a", x=-0.01) + joint("j", "base", "a"), "robot.urdf: link 'a' on joint 'j'.*negative"),
        (link("base", mesh("lost.stl")), "link 'base': there is no mesh 'lost.stl'"),
        (link("base") + link("a") + joint("j", "base", "a", extra='<mimic joint="k"/>'), "'j' mimics 'k'"),
        ('<?xml version="1.0"?><sdf version="1.9"/>', "is an SDF file, which is not read: convert it to URDF or MJCF"),
        ('<?xml version="1.0"?><mujoco/>', "is an MJCF file: read it with Scene.from_mjcf"),
        ('<?xml version="1.0"?><html/>', "its root is <html>, not <robot>"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_the_name_of_the_link(read, content, message):
    with pytest.raises(nga.SceneError, match=message):
        read(content)


def test_an_inertia_that_no_body_has_is_an_error_where_it_moves_alone(read):
    with pytest.raises(nga.SceneError, match="robot.urdf: link 'a' on joint 'j'.*exceeds the sum"):
        read(link("base") + link("a", z=0.5) + joint("j", "base", "a"))
    scene = read(
        link("base") + link("a", z=0.021) + link("b") + joint("j", "base", "a") + joint("f", "a", "b", "fixed")
    )
    odd = next(entry for entry in scene.contents if "no body can have" in entry.what)
    assert odd.reason == "a"


def test_meshes_are_found_by_package_by_blanks_and_beside_the_file(read, tmp_path):
    write_stl(tmp_path / "meshes" / "a box.stl", triangles(0.2))
    for uri in ("meshes/a%20box.stl", "meshes/a box.stl", f"package://{tmp_path.name}/meshes/a%20box.stl"):
        np.testing.assert_allclose(size_of(read(link("base", mesh(uri, "1 2 1")))), [0.2, 0.4, 0.2], atol=1e-7)


COLLADA = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}" name="u"/><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="s"><float_array id="a" count="{n3}">{numbers}</float_array>
<technique_common><accessor source="#a" count="{n}" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
<triangles count="{k}"><input semantic="VERTEX" source="#v" offset="0"/><p>{index}</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="vs"><node id="n"><instance_geometry url="#g"/></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#vs"/></scene></COLLADA>"""


@pytest.mark.parametrize("up", ["Z_UP", "Y_UP", "X_UP"])
def test_collada_has_its_unit_and_the_axes_of_its_numbers(read, tmp_path, up):
    corners = [p for t in triangles(200.0) for p in t]
    numbers = " ".join(f"{x:g} {y:g} {2 * z:g}" for x, y, z in corners)
    n = len(corners)
    text = COLLADA.format(
        unit=0.001, up=up, n3=3 * n, n=n, k=n // 3, numbers=numbers, index=" ".join(map(str, range(n)))
    )
    (tmp_path / "part.dae").write_text(text)
    scene = read(link("base", mesh("part.dae", "1 1 2")))
    np.testing.assert_allclose(size_of(scene), [0.2, 0.2, 0.8], atol=1e-7)
    drawn = np.concatenate([part.vertices for part in read_collada(tmp_path / "part.dae")]) * (1, 1, 2)
    np.testing.assert_allclose(np.ptp(drawn, axis=0), [0.2, 0.2, 0.8], atol=1e-7)  # where contact has it
    told = [entry.number for entry in scene.contents if entry.what == "COLLADA files with x or y up"]
    assert told == ([] if up == "Z_UP" else [1])
    # the same where Pinocchio has read the file, and after another read of it
    path = tmp_path / "robot.urdf"
    model = pin.buildModelFromUrdf(str(path))
    theirs = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=[str(tmp_path)])
    once = nga.Scene(model, theirs)
    again = nga.Scene(model, once.collision_model)
    for other in (once, again):
        np.testing.assert_allclose(size_of(other), [0.2, 0.2, 0.8], atol=1e-7)


def test_reductions_of_transmissions(read):
    transmission = (
        '<transmission name="t"><joint name="j"/><actuator name="m"><mechanicalReduction>-80</mechanicalReduction>'
        "</actuator></transmission>"
    )
    scene = read(link("base") + link("a") + joint("j", "base", "a") + transmission)
    assert scene.model.rotorGearRatio == [-80.0]
    with pytest.warns(UserWarning, match=r"not numbers \(1\) left out: joint 'j': 'ratio'"):
        scene = read(link("base") + link("a") + joint("j", "base", "a") + transmission.replace("-80", "ratio"))
    assert scene.model.rotorGearRatio == [1.0] and "mechanical reductions:" not in str(scene.contents)


def test_an_impossible_inertia_of_a_link_that_stands_is_told_with_its_name(read):
    with pytest.raises(nga.SceneError, match="link 'base', fixed to the world: principal.*which no body has"):
        read(link("base", x=0.1) + link("a") + joint("j", "base", "a"))


def test_xacro_is_expanded_or_named(read, tmp_path, monkeypatch):
    text = '<?xml version="1.0"?><robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:x/></robot>'
    monkeypatch.setitem(sys.modules, "xacrodoc", None)
    with pytest.raises(nga.SceneError, match=r"is a xacro file: pip install 'ngalpha-pin\[xacro\]', or run"):
        read(text)
    expanded = f'<robot name="r">{link("base")}{link("a")}{joint("j", "base", "a")}</robot>'
    document = types.SimpleNamespace(to_urdf_string=lambda: expanded)
    module = types.SimpleNamespace(XacroDoc=types.SimpleNamespace(from_file=lambda path: document))
    monkeypatch.setitem(sys.modules, "xacrodoc", module)
    assert read(text).model.existJointName("j")


def test_xacro_itself(read):
    pytest.importorskip("xacrodoc")
    text = '<?xml version="1.0"?><robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    text += '<xacro:property name="m" value="2.5"/>'
    inertial = INERTIA.format(m="${2 * m}", x=1, y=1, z=1)
    scene = read(f'{text}<link name="base"/><link name="a">{inertial}</link>{joint("j", "base", "a")}</robot>')
    assert scene.model.inertias[1].mass == 5.0


def test_meshes_that_are_not_convex_are_named_with_what_their_hull_adds(read, tmp_path):
    """An L of two boxes: 0.75 of the volume of the box, whose hull has 0.875 of it."""
    write_stl(tmp_path / "box.stl", triangles(0.2))
    corner = [[(0.5 * x, y, 0.5 * z) for x, y, z in t] for t in triangles(0.2)]
    lower = [[(x, y, 0.5 * z) for x, y, z in t] for t in triangles(0.2)]
    write_stl(tmp_path / "angle.stl", lower + [[(x, y, z + 0.1) for x, y, z in t] for t in corner])
    body = "".join(link(name, mesh(f"{name}.stl")) for name in ("box", "angle"))
    scene = read(body + joint("j", "box", "angle", "floating", ""))
    scene.add_plane("ground")
    with pytest.warns(
        UserWarning,
        match=r"'angle_0' by 17% \(0.006 -> 0.007 m\^3\); scene\.decompose\('angle_0'\) makes convex parts$",
    ):
        scene.add_contact("*", "ground")


def test_visual_meshes_are_loaded_when_something_is_drawn(read, tmp_path, count):
    write_stl(tmp_path / "box.stl", triangles(0.2))
    visual = mesh("box.stl").replace("collision", "visual")
    built = count(pin, "buildGeomFromUrdfString")
    scene = read(link("base") + link("a", visual) + joint("j", "base", "a"), root=pin.JointModelFreeFlyer())
    assert len(built) == 1
    drawn = scene.visual_model
    assert len(built) == 2
    assert drawn is scene.visual_model
    geometry = drawn.geometryObjects[0]
    assert (geometry.name, geometry.parentJoint) == ("a_0", scene.model.getJointId("j"))
    assert isinstance(geometry.geometry, coal.BVHModelBase)


def test_a_shape_to_draw_that_urdf_does_not_have_takes_no_shape_of_contact_along(read):
    shapes = "<visual><geometry><torus/></geometry></visual>"
    shapes += '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    scene = read(link("base") + link("a", shapes) + joint("j", "base", "a"))
    assert [g.name for g in scene.declared_shapes.geometryObjects] == ["a_0"]
    assert scene.visual_model.ngeoms == 0


@pytest.mark.parametrize(
    "shape", ['<origin xyz="0 a 0"/><geometry><sphere radius="1"/>', '<geometry><sphere radius="a"/>']
)
def test_numbers_of_a_shape_to_draw_are_read_with_the_file(read, shape):
    with pytest.raises(nga.SceneError, match=r"link 'a': (xyz='0 a 0'|radius='a') in <(origin|sphere)>"):
        read(link("base") + link("a", f"<visual>{shape}</geometry></visual>") + joint("j", "base", "a"))


@pytest.mark.parametrize("root", ["free", pin.JointModelFreeFlyer, 3])
def test_a_root_joint_that_is_none(read, root):
    with pytest.raises(nga.SceneError, match="root_joint = .*JointModelFreeFlyer"):
        read(link("base"), root=root)


def test_a_body_without_inertia_that_moves_is_told_by_its_link_and_numbers(read):
    scene = read(link("base") + link("rod", x=0.1, y=0.0, z=0.1) + joint("j", "base", "rod", "revolute"))
    with pytest.raises(nga.SceneError, match="look at link 'rod' on joint 'j', of 1 kg and 0, 0.1, 0.1 kg m"):
        nga.simulate(scene, scene.reference(), t_end=0.01, dt=1e-3)
