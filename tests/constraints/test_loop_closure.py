"""One four-bar closed in every way there is moves alike; its crank driven needs the torque of inverse dynamics."""

import numpy as np
import pinocchio as pin
import pytest
from loops import displacements, slope
from scipy.interpolate import CubicSpline

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.robots.four_bar import URDF

HALVES = """
  <link name="half">
    <inertial>
      <origin xyz="{x} 0 0"/><mass value="0.5"/>
      <inertia ixx="0" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/>
    </inertial>
  </link>
  <joint name="half" type="continuous">
    <parent link="rocker"/><child link="half"/><origin xyz="0.8 0 0"/><axis xyz="0 -1 0"/>
  </joint>
"""


def split_tree():
    """The tree with the coupler cut in the middle: its second half hangs on the rocker by the last pin."""
    text = URDF.read_text()
    whole = '<origin xyz="0.5 0 0"/>\n      <mass value="1"/>'
    first = '<origin xyz="0.25 0 0"/>\n      <mass value="0.5"/>'
    assert whole in text
    text = text.replace(whole, first).replace("0.08333333333333333", repr(0.5 * 0.5**2 / 12))
    half = HALVES.format(x=-0.25, i=repr(0.5 * 0.5**2 / 12))
    model = pin.buildModelFromXML(text.replace("</robot>", half + "</robot>"))
    return nga.Scene(model)


def closed_by(kind):
    middle = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0]))
    axis = (0.0, 1.0, 0.0)
    if kind == "weld":
        scene = split_tree()
        scene.add_constraint(nga.Weld("coupler", "half", placement_a=middle, placement_b=middle.inverse()))
        return scene
    scene = nga.Scene.from_urdf(URDF)
    tips = ("coupler_tip", "rocker_tip")
    if kind == "anchor of Pinocchio":
        ends = [pin.SE3(np.eye(3), np.array([x, 0.0, 0.0])) for x in (1.0, 0.8)]
        joints = [scene.model.getJointId(name) for name in ("coupler", "rocker")]
        scene.add_constraint(pin.PointAnchorConstraintModel(scene.model, joints[0], ends[0], joints[1], ends[1]))
    else:
        make = {
            "revolute": lambda: nga.RevoluteJoint(*tips, axis=axis),
            "point": lambda: nga.PointJoint(*tips),
            "cylindrical": lambda: nga.CylindricalJoint(*tips, axis=axis),
        }
        scene.add_constraint(make[kind]())
    return scene


ROWS = {"revolute": 2, "point": 2, "cylindrical": 2, "anchor of Pinocchio": 2, "weld": 3}


def swing(kind, dt=4e-3, t_end=0.3):
    """Angles of crank, coupler and rocker of the same motion."""
    _, q0, v0 = robots.load("four_bar")
    scene = closed_by(kind)
    model = scene.model
    if kind == "weld":
        rough = np.concatenate((q0, [np.cos(-2.0), np.sin(-2.0)]))
        rough = nga.assemble(scene, rough, np.append(v0, 0.0), hold=["crank", "coupler", "rocker"])
        q0, v0 = rough.q, rough.v
    run = nga.simulate(scene, q0, v0, t_end=t_end, dt=dt, method=nga.GeneralizedAlpha(rho_inf=0.9))
    columns = [model.idx_vs[model.getJointId(name)] for name in ("crank", "coupler", "rocker")]
    return run, displacements(run)[:, columns]


@pytest.mark.parametrize("kind", ROWS)
def test_every_closure_gives_the_same_motion(kind):
    _, expected = swing("revolute")
    run, found = swing(kind)
    # rows across the plane are left out, not solved for
    assert run.n_g == ROWS[kind]
    assert run.constraint_motion.rank.tolist() == [run.n_g] * len(run.t)
    assert "newton" in run.solver_path
    # a split body has its inertia in another place, which is felt with the order of the method
    atol = 2e-3 if kind == "weld" else 1e-8
    np.testing.assert_allclose(found, expected, atol=atol)


def test_split_coupler_moves_alike_to_second_order():
    sizes = [4e-3, 2e-3, 1e-3]
    found = [np.abs(swing("weld", dt, 0.2)[1] - swing("revolute", dt, 0.2)[1]).max() for dt in sizes]
    assert 1.9 <= slope(sizes, found) <= 2.1, found


def angle(t):
    return 0.5 + 6.0 * t + 0.4 * np.sin(7.0 * t), 6.0 + 2.8 * np.cos(7.0 * t), -19.6 * np.sin(7.0 * t)


def inverse_dynamics(model, run):
    """Torque of the crank from the kinematics of the slider-crank in closed form and `pin.rnea`, by virtual power."""
    data, found = model.createData(), []
    r, length = 0.1, 0.3
    for t in run.t:
        x, v, a = angle(t)
        # rod below: r sin x = length sin y; crank angle x, rod angle -y, absolute
        sy = r / length * np.sin(x)
        y = np.arcsin(sy)
        c = r / length * np.cos(x) / np.cos(y)  # dy/dx
        dc = -r / length * np.sin(x) / np.cos(y) + c * np.tan(y) * c
        ds = -r * np.sin(x) - length * np.sin(y) * c
        dds = -r * np.cos(x) - length * (np.cos(y) * c * c + np.sin(y) * dc)
        slope_of = np.array([1.0, -c - 1.0, ds])
        bend = np.array([0.0, -dc, dds])
        s = r * np.cos(x) + length * np.cos(y)
        q = np.array([np.cos(x), np.sin(x), np.cos(-y - x), np.sin(-y - x), s])
        tau = pin.rnea(model, data, q, slope_of * v, slope_of * a + bend * v * v)
        found.append(slope_of @ tau)
    return np.array(found)


def spline():
    """As smooth as a spline is: its third derivative jumps, so the order shows on the function itself."""
    t = np.linspace(-0.1, 0.6, 300)
    return CubicSpline(t, angle(t)[0])


@pytest.mark.parametrize(
    ("drive", "error"),
    [(angle, 1e-8), (lambda t: angle(t)[0], 1e-8), (spline(), 1e-2)],
    ids=["triple", "plain", "spline"],
)
def test_torque_of_the_driven_crank(drive, error):
    """Position, velocity and acceleration are given: what is left is rounding, or the error of the spline."""
    scene, q0, v0 = robots.load("slider_crank", drive=drive)
    run = nga.simulate(scene, q0, v0, t_end=0.4, dt=4e-3, method=nga.GeneralizedAlpha(rho_inf=0.9))
    torque = run.la_g[:, run.constraint_names.index("drive")]
    expected = inverse_dynamics(scene.model, run)
    assert np.abs(torque - expected).max() < error * np.abs(expected).max()
    assert np.abs(run.constraint_motion.g).max() < 1e-10
