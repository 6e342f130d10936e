"""What the command line makes of a name or a file."""

import pytest

from ngalpha_pin.cli import targets
from ngalpha_pin.robots._descriptions import file_of, loaders
from ngalpha_pin.scene import posture

STATE = """<robot name="r"><group_state name="home" group="all">
<joint name="{}" value="0 0 0 0 0 0 1"/>{}</group_state></robot>"""


@pytest.mark.parametrize(
    ("pose", "others", "floats"),
    [
        ("root_joint", ["hip"], True),  # a joint that the URDF has not is the one of its root
        ("hip", [], False),  # one that it has is not
        ("root_joint", ["shoulder", "elbow", "hip"], False),  # the state of another robot
    ],
)
def test_a_state_of_an_srdf_says_that_the_root_of_this_robot_floats(pose, others, floats, tmp_path):
    (tmp_path / "r.urdf").write_text(
        '<robot name="r"><link name="base"/><link name="leg"/>'
        '<joint name="hip" type="fixed"><parent link="base"/><child link="leg"/></joint></robot>'
    )
    values = "".join(f'<joint name="{name}" value="0"/>' for name in others)
    (tmp_path / "r.srdf").write_text(STATE.format(pose, values))
    assert targets.moves_freely(str(tmp_path / "r.urdf")) is floats


def test_robots_of_example_robot_data_float_as_their_loaders_say():
    """Their SRDF files alone say it of 29 of them, and of none wrongly; roots of the others are in no file."""
    pytest.importorskip("example_robot_data")
    silent = []
    for name, loader in loaders().items():
        urdf = str(file_of(name))
        assert targets.moves_freely(urdf) is bool(loader.free_flyer)
        if urdf.endswith(".urdf") and posture.floats(urdf) is not bool(loader.free_flyer):
            silent.append(name)
            assert loader.free_flyer, name
    assert {"laikago", "g1"} <= set(silent) and not {"finger_edu", "talos_arm", "anymal"} & set(silent)
    assert targets.load("ur5", targets.Options())[0].contacts == []  # on a fixed base, without a ground
