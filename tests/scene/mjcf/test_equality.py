"""Equality constraints of MJCF files hold what MuJoCo means by them."""

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.system.system import System

ROD = '<geom type="capsule" fromto="0 0 0 1 0 0" size="0.05"/>'
HINGE = '<joint name="{}" type="hinge" axis="0 1 0" {}/>'
WORLD = f"""
<body name="base">
  <body name="a" pos="0 0 1">{HINGE.format("ja", "")}{ROD}
    <body name="b" pos="1 0 0">{HINGE.format("jb", 'pos="0.1 0 0"')}{ROD}
      <body name="hook" pos="0.5 0 0.2">{ROD}</body></body></body>
  <body name="c" pos="0 0.3 1">{HINGE.format("c", "")}{ROD}</body>
  <body name="d" pos="3 0 0"><joint name="slide" type="slide" axis="1 0 0"/>{ROD}</body>
</body>"""


@pytest.fixture
def read(tmp_path):
    def scene(equality, world=WORLD, **options):
        path = tmp_path / "robot.xml"
        path.write_text(
            f"<mujoco><worldbody>{world}</worldbody><equality>{equality}</equality></mujoco>", encoding="utf-8"
        )
        return nga.Scene.from_mjcf(path, **options)

    return scene


def place(scene, body, q):
    data = scene.model.createData()
    pin.framesForwardKinematics(scene.model, data, q)
    return pin.SE3.Identity() if body == "world" else data.oMf[scene.model.getFrameId(body, pin.FrameType.BODY)]


def assembled(scene):
    rough = 0.3 * np.arange(1, scene.model.nq + 1)
    return nga.assemble(scene, rough).q


@pytest.mark.parametrize("active", ["", 'active="true"'])
def test_connect_holds_a_point_of_the_bodies(read, active):
    """Also where the body is not in the frame of its joint, or is welded to another one; and several without a name."""
    scene = read(f'<connect body1="b" body2="c" anchor="0.4 0 0.1" {active}/><connect body1="hook" anchor="0.2 0 0"/>')
    assert [type(c) for c in scene.constraints] == 2 * [nga.PointJoint]
    q0 = pin.neutral(scene.model)
    rows = System(scene)
    rows.dynamics(0.0, q0, np.zeros(4), np.zeros(4))
    still = np.zeros(4)
    g, _ = rows.constraint_rows(0.0, q0, still, still).whole(rows.motion(still, still))
    assert np.abs(g).max() < 1e-12  # as in the file
    anchors = [
        place(scene, body, q0).inverse().act(place(scene, "b", q0).act(np.array([0.4, 0, 0.1]))) for body in "bc"
    ]
    assert anchors[0] == pytest.approx([0.4, 0, 0.1])
    run = nga.simulate(scene, q0, t_end=0.1, dt=2e-3)
    for q in run.q[::10]:
        ends = [place(scene, body, q).act(anchor) for body, anchor in zip("bc", anchors, strict=True)]
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-9)
        hook = place(scene, "hook", q).act(np.array([0.2, 0, 0]))
        np.testing.assert_allclose(hook, [1.7, 0, 1.2], atol=1e-9)


def test_weld_keeps_the_pose_of_the_file_or_the_one_it_gives(read):
    for pose, angle in (("", 0.0), ('relpose="0 0 0 0.9238795325112867 0 0.3826834323650898 0"', np.pi / 4)):
        scene = read(f'<weld name="glue" body1="a" body2="c" {pose}/>', WORLD.replace("0 0.3 1", "0 0 1"))
        q = assembled(scene)
        relative = place(scene, "a", q).inverse() * place(scene, "c", q)
        np.testing.assert_allclose(relative.translation, 0.0, atol=1e-9)
        np.testing.assert_allclose(relative.rotation, pin.utils.rotate("y", angle), atol=1e-9)
    # both hinges stand in one place: an offset cannot be reached
    scene = read(
        '<weld name="glue" body1="a" body2="c" relpose="0.5 0 0.2 1 0 0 0"/>', WORLD.replace("0 0.3 1", "0 0 1")
    )
    with pytest.raises(nga.SceneError, match="cannot assemble: 'glue'"):
        assembled(scene)


def test_joint_equality_is_a_gear(read):
    scene = read(
        '<joint joint1="jb" joint2="ja" polycoef="0.1 -2 0.5"/><joint name="lock" joint1="slide" polycoef="0.25"/>'
    )
    q0 = assembled(scene)
    run = nga.simulate(scene, q0, t_end=0.3, dt=2e-3, method=nga.GeneralizedAlpha(rho_inf=0.9))
    names = list(scene.model.names)[1:]
    column = {name: run.q[:, scene.model.idx_qs[i + 1]] for i, name in enumerate(names)}
    np.testing.assert_allclose(column["jb"], 0.1 - 2 * column["ja"] + 0.5 * column["ja"] ** 2, atol=1e-10)
    np.testing.assert_allclose(column["slide"], 0.25, atol=1e-12)
    assert np.ptp(column["ja"]) > 0.1
    assert np.ptp(run.energy.total) < 1e-3 * np.ptp(run.energy.kinetic)


def test_what_is_switched_off_or_left_out(read):
    off = '<connect body1="b" body2="c" anchor="0 0 0" active="false"/>'
    assert read(off).constraints == []
    assert read('<connect body1="b" body2="c" anchor="0 0 0"/>', constraints=False).constraints == []


@pytest.mark.parametrize(
    ("equality", "message"),
    [
        ('<connect name="pin" body1="b" anchor="0 0"/>', "anchor"),
        ('<joint name="gear" joint1="nothing"/>', "nothing"),
        ('<joint name="gear" joint1="ja" joint2="jb" polycoef="1 2 3 4 5 6"/>', "polycoef"),
    ],
)
def test_bad_equality_is_named(read, equality, message):
    with pytest.raises(nga.SceneError, match=f"robot.xml cannot be read: .*{message}"):
        read(equality)
