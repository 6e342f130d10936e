"""Elements of a URDF that its parser would drop without a word, or stop at with words of its own."""

from xml.etree import ElementTree

import pytest

import ngalpha_pin as nga
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.urdf_elements import check_elements

LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>{}</link>'
ARM = '<joint name="elbow" type="{}"><parent link="a"/><child link="b"/><origin xyz="{}"/><axis xyz="0 1 0"/></joint>'


def shape(text):
    return f"<collision><geometry>{text}</geometry></collision>"


def robot(shapes="", kind="continuous", xyz="0 0 1"):
    return '<robot name="r">' + LINK.format("a", "") + LINK.format("b", shapes) + ARM.format(kind, xyz) + "</robot>"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('<robot name="r"/>', "r.urdf has no links"),
        (robot(kind="spherical"), "joint 'elbow': type='spherical'"),
        (robot(xyz="0 0.07, 1"), "joint 'elbow': xyz='0 0.07, 1' in <origin>: expected 3 numbers"),
        (robot(xyz="0 0 1 0"), "joint 'elbow': xyz='0 0 1 0'"),
        (robot(shape('<box size="1 1"/>')), "link 'b': size='1 1' in <box>: expected 3 numbers"),
        (robot(shape('<sphere radius="x"/>')), "link 'b': radius='x' in <sphere>: expected a number"),
        (robot(shape('<cylinder radius="1"/>')), "link 'b': length=None in <cylinder>"),
    ],
)
def test_what_cannot_be_read_names_the_link_or_joint(text, words):
    with pytest.raises(SceneError, match=words):
        check_elements("r.urdf", ElementTree.fromstring(text))


def test_a_shape_that_urdf_does_not_have_is_left_out_alone_and_named(tmp_path):
    # urdfdom drops all shapes of the link, and with them those that it can read
    path = tmp_path / "r.urdf"
    path.write_text(robot(shape('<plane normal="0 0 1"/>') + shape('<box size="1 2 3"/>')))
    with pytest.warns(UserWarning, match=r"r.urdf: collision plane \(1\) left out: not a shape of URDF \(b\)"):
        scene = nga.Scene.from_urdf(path)
    (left,) = scene.collision_model.geometryObjects
    assert left.name == "b_0" and left.geometry.halfSide.tolist() == [0.5, 1.0, 1.5]
    assert [entry.what for entry in scene.contents if entry.fate == "left out"] == ["collision plane"]


def test_products_of_inertia_that_are_left_out_do_not_lose_the_mass(tmp_path):
    path = tmp_path / "r.urdf"
    path.write_text(robot())
    assert nga.Scene.from_urdf(path).model.inertias[1].mass == 1.0
