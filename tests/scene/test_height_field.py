"""Slopes, steps and height fields from arrays."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin.system.system import System


def ball(radius=0.1):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, radius), pin.SE3.Identity())
    model.addJointFrame(joint)
    scene = nga.Scene(model)
    scene.add_geometry("ball", coal.Sphere(radius), parent="ball")
    return scene


def test_ball_rolls_down_a_sloping_field_as_down_a_plane():
    """A solid ball accelerates with 5/7 g sin(theta); a piece it comes to has no force in the step before."""
    scene, slope = ball(), 0.2
    x = np.linspace(-1.0, 1.0, 5)
    field = scene.add_height_field("hill", np.outer(-slope * x, np.ones(3)), (2.0, 1.0))
    scene.add_contact("ball", field, mu=1.0)
    normal = np.array([slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
    along = np.array([normal[2], 0.0, -normal[0]])
    q0 = pin.neutral(scene.model)
    q0[:3] = [-0.73, 0.11, 0.73 * slope]
    q0[:3] += 0.1 * normal
    errors = []
    for dt in (4e-3, 2e-3):
        run = nga.simulate(scene, q0, t_end=0.8, dt=dt)
        s = 5.0 / 7.0 * 9.81 * normal[0] / 2 * run.t**2
        assert s[-1] > 0.4  # into the next piece
        errors.append(np.abs(run.q[:, :3] - q0[:3] - s[:, None] * along).max())
        assert run.audit().penetration < 1e-9
    # on one plane it is half of that: velocities in a frame that turns with the ball, of second order in dt
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.05)


def test_ball_stops_at_a_step():
    scene = ball()
    heights = np.zeros((5, 2))
    heights[3:] = 0.5
    field = scene.add_height_field("step", heights, (2.0, 1.0))
    scene.add_contact("ball", field, mu=0.5)
    q0 = pin.neutral(scene.model)
    q0[:3] = [-0.6, 0.1, 0.1]
    run = nga.simulate(scene, q0, np.array([1.0, 0, 0, 0, 10.0, 0]), t_end=1.5, dt=2e-3)
    audit = run.audit()
    assert audit.ok and audit.penetration < 1e-9
    # the ramp of the field rises from x = 0 with slope 1: the ball climbs at most what its energy allows
    assert run.q[:, 2].max() < 0.1 + 0.7 * 1.0**2 / 9.81 + 1e-6


@pytest.mark.parametrize(
    "heights, size", [(np.zeros(4), (1, 1)), (np.full((3, 3), np.nan), (1, 1)), (np.zeros((3, 3)), (1, -1))]
)
def test_numbers_that_make_no_field(heights, size):
    with pytest.raises(nga.SceneError):
        ball().add_height_field("field", heights, size)


def test_a_field_of_more_pieces_than_pinocchio_can_list_is_refused():
    heights = np.sin(np.arange(201.0))[:, None] * np.cos(np.arange(201.0))
    with pytest.raises(nga.SceneError, match=r"201 x 201 heights has 80000 flat pieces.* fewer heights"):
        ball().add_height_field("field", heights, (10.0, 10.0))


@pytest.mark.parametrize("way", ["geometry model", "add_geometry", "on a frame"])
def test_height_field_of_coal_is_that_of_the_array(way):
    """Turned and shifted: the gap of a ball is its distance from a dense sample."""
    heights = np.array([[0.0, 0.1, 0.3], [0.2, 0.25, 0.1]])  # rows from the largest y down
    placement = pin.SE3(pin.exp3(np.array([0.1, -0.2, 0.3])), np.array([0.3, 0.2, -0.1]))
    geometries, model = pin.GeometryModel(), ball().model
    field = coal.HeightFieldOBBRSS(2.0, 1.0, heights, -0.5)
    if way == "geometry model":
        geometries.addGeometryObject(pin.GeometryObject("hill", 0, placement, field))
    if way == "on a frame":
        model.addFrame(pin.Frame("place", 0, 0, placement, pin.FrameType.OP_FRAME))
    scene = nga.Scene(model, geometries)
    if way == "add_geometry":
        assert scene.add_geometry("hill", field, placement=placement) == "hill_*"
    if way == "on a frame":
        assert scene.add_geometry("hill", field, parent="place") == "hill_*"
    scene.add_geometry("ball", coal.Sphere(0.1), parent="ball")
    scene.add_contact("ball", "hill_*")
    system, rng, q = System(scene), np.random.default_rng(3), pin.neutral(model)
    x, y = (part.ravel() for part in np.meshgrid(np.linspace(0, 1, 401), np.linspace(0, 1, 401), indexing="ij"))
    sample = []
    for i in (0, 1):
        low, right, left, high = heights[1, i], heights[1, i + 1], heights[0, i], heights[0, i + 1]
        # two triangles along the diagonal from the smallest x and y
        z = low + np.where(x > y, x * (right - low) + y * (high - right), x * (high - left) + y * (left - low))
        sample.append(np.column_stack((x + i - 1.0, y - 0.5, z)))
    sample = np.concatenate(sample)
    for p in sample[rng.integers(len(sample), size=50)]:
        p = p + [0, 0, rng.uniform(0.2, 0.4)]
        q[:3] = placement.act(p)
        system.place(q)
        nearest = min(system.slots.proximity.look(system.data, i) for i in range(len(system.slots.pairs)))
        apart = np.sqrt(((sample - p) ** 2).sum(axis=1).min())
        # the nearest point is at most half a diagonal of the sample, 2 mm, from one of its points
        assert apart - 0.1 - (2e-3) ** 2 / apart <= nearest <= apart - 0.1 + 1e-9
