"""What is told of a URDF."""

from xml.etree import ElementTree

import pinocchio as pin

from ngalpha_pin.scene.urdf_contents import contents

LINK = '<link name="{}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>'
JOINT = (
    '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="5" velocity="9"/><dynamics damping="0.1" friction="{4}"/>{5}</joint>'
)


def test_every_kind_of_a_file_is_counted():
    text = "".join(LINK.format(name) for name in "abcd") + '<link name="e"/>'
    text += JOINT.format("j1", "revolute", "a", "b", 0, "") + JOINT.format("j2", "prismatic", "b", "c", 0.3, "")
    text += JOINT.format("j3", "revolute", "c", "d", 0, '<mimic joint="j1"/>')
    text += '<joint name="j4" type="fixed"><parent link="d"/><child link="e"/></joint>'
    text += '<transmission name="t"><actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator>'
    text = f'<robot name="r">{text}</transmission><gazebo/><gazebo/></robot>'
    rows = {x.what: x for x in contents(ElementTree.fromstring(text), pin.buildModelFromXML(text))}
    counted = {what: (row.number, row.fate) for what, row in rows.items()}
    assert counted == {
        "links": (5, "used"), "joints": (4, "used"), "limits of position": (3, "used"), "limits of effort": (3, "used"),
        "limits of velocity": (3, "no effect"), "joint damping": (3, "used"), "joint friction": (1, "used"),
        "mimic joints": (1, "used"), "mechanical reductions": (1, "used"), "transmissions": (1, "no effect"),
        "gazebo": (2, "no effect"),
    }  # fmt: skip
    assert rows["links"].reason == "4 with mass" and rows["joints"].reason == "1 fixed, 1 prismatic, 2 revolute"
    assert "j3" in rows["mimic joints"].reason
