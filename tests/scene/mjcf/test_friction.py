"""Torsional and rolling friction of MJCF files, condim 4 and 6, against closed forms and MuJoCo itself."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import ngalpha_pin as nga

SLIDE, TORSION, ROLL, R, G = 0.5, 0.004, 0.002, 0.1, 9.81
RADIUS = 16 * TORSION / (3 * np.pi * SLIDE)
FRICTION = f"{SLIDE} {TORSION} {ROLL}"
SCENE = """<mujoco><option cone="elliptic" impratio="100" timestep="2e-4" integrator="implicitfast"/><worldbody>
<geom name="floor" type="plane" size="9 9 1" solref="-1e6 -2e3" {floor}/>
<body pos="0 0 0.1"><freejoint/><geom name="ball" size="0.1" mass="1" {ball}/></body>
</worldbody>{more}</mujoco>"""


def read(tmp_path, floor="", ball="", more=""):
    path = tmp_path / "ball.xml"
    path.write_text(SCENE.format(floor=floor, ball=ball, more=more))
    return nga.Scene.from_mjcf(path), path


def coefficients(scene):
    law = scene.contacts[0].law
    return law.mu, law.contact_radius, law.rolling_resistance


def by_mujoco(path, v, t_end):
    m = mujoco.MjModel.from_xml_path(str(path))
    d = mujoco.MjData(m)
    d.qvel[:] = v
    while d.time < t_end - 1e-9:
        mujoco.mj_step(m, d)
    return d


@pytest.mark.filterwarnings("ignore:.*rolling friction:UserWarning")
@pytest.mark.parametrize(
    ("floor", "ball", "expected"),
    [
        ('condim="4"', 'condim="1"', (SLIDE, RADIUS, 0.0)),  # the larger condim
        ('condim="3"', 'condim="3"', (SLIDE, 0.0, 0.0)),
        ('condim="1"', 'condim="1"', (0.0, 0.0, 0.0)),
        ('condim="4" priority="1" friction="1 0.03 0"', 'condim="6"', (1.0, 0.16 / np.pi, 0.0)),
        ('condim="4" friction="1 0.03 0"', 'condim="3"', (1.0, 0.16 / np.pi, 0.0)),  # the larger of each coefficient
    ],
)
def test_coefficients_of_two_geoms_by_the_rules_of_mujoco(tmp_path, floor, ball, expected):
    given = [text if "friction" in text else f'friction="{FRICTION}" {text}' for text in (floor, ball)]
    assert coefficients(read(tmp_path, *given)[0]) == pytest.approx(expected, rel=1e-12)


def test_what_has_no_twin_is_named(tmp_path):
    rolls = f'condim="6" friction="{FRICTION}"'
    with pytest.warns(UserWarning, match=r"rolling friction .* a cone of its own beside that of sliding \(floor\)"):
        scene, _ = read(tmp_path, rolls)
    assert coefficients(scene) == pytest.approx((1.0, 16 * 0.005 / (3 * np.pi), ROLL), rel=1e-12)  # 1 0.005 0.0001
    slippery = 'condim="4" friction="0 0.01 0"'
    with pytest.warns(UserWarning, match="torsional friction .* without friction against sliding"):
        assert coefficients(read(tmp_path, slippery, slippery)[0]) == (0.0, 0.0, 0.0)
    pair = '<contact><pair geom1="floor" geom2="ball" condim="6" friction="0.5 0.5 0.004 0.002 0.003"/></contact>'
    with pytest.warns(UserWarning, match="anisotropic friction of pairs.*rolling friction of pairs"):
        assert coefficients(read(tmp_path, more=pair)[0]) == pytest.approx((SLIDE, RADIUS, ROLL), rel=1e-12)


def test_a_surface_keeps_them_for_pairs_that_are_declared_later(tmp_path):
    scene, _ = read(tmp_path, ball=f'condim="4" friction="{FRICTION}" contype="2" conaffinity="2"')
    scene.add_plane("table")
    pair = scene.add_contact("ball", "table")[0]
    assert pair.law.contact_radius == pytest.approx(RADIUS, rel=1e-12)


def spin_of_a_ball(slip, spin, t_end):
    """Largest dissipation with |F|^2 / slide^2 + M^2 / torsion^2 <= N^2, while it slides and afterwards."""
    inertia, arm = 0.4 * R * R, TORSION / SLIDE

    def flow(t, y):
        size = np.hypot(y[0], arm * y[1])
        return -SLIDE * G / size * np.array([3.5 * y[0], arm * arm * y[1] / inertia])

    stops = lambda t, y: y[0] - 1e-9  # noqa: E731
    stops.terminal = True
    t = 0.0
    if slip:
        sliding = solve_ivp(flow, (0.0, t_end), [slip, spin], events=stops, rtol=1e-9, atol=1e-11)
        t, spin = sliding.t[-1], sliding.y[1, -1]
    return spin - TORSION * G / inertia * (t_end - t)


@pytest.mark.parametrize("slip", [0.0, 1.0])
def test_a_ball_that_spins(tmp_path, slip):
    """On the spot torsion N / I takes its spin away; while it slides, the elliptic cone leaves less of it."""
    same = f'condim="4" friction="{FRICTION}"'
    scene, path = read(tmp_path, same, same)
    v0, t_end = np.array([slip, 0, 0, 0, 0, 20.0]), 0.25
    run = nga.simulate(scene, scene.reference("qpos0"), v0, t_end=t_end, dt=2.5e-3)
    d = by_mujoco(path, v0, t_end)
    assert run.audit().ok
    turned = pin.Quaternion(run.q[-1, 3:]).matrix(), d.xmat[1].reshape(3, 3)
    spin, theirs = (M[2] @ omega for M, omega in zip(turned, (run.v[-1, 3:], d.qvel[3:]), strict=True))
    assert spin == pytest.approx(spin_of_a_ball(slip, 20.0, t_end), rel=1e-4)
    # its contact is soft and has to sink in before it presses
    assert run.q[-1, :2] == pytest.approx(d.qpos[:2], abs=2e-3)
    assert nga.v_to_mujoco(scene.model, run.q[-1], run.v[-1])[:2] == pytest.approx(d.qvel[:2], abs=2e-3)
    assert spin == pytest.approx(theirs, rel=6e-3)


@pytest.mark.filterwarnings("ignore:.*rolling friction:UserWarning")
def test_a_ball_that_rolls(tmp_path):
    """It loses roll / R g / (1 + 2/5) of its speed in each second."""
    same = f'condim="6" friction="{FRICTION}"'
    scene, path = read(tmp_path, same, same)
    v0, t_end = np.array([0.5, 0, 0, 0, 5.0, 0]), 0.2
    run = nga.simulate(scene, scene.reference("qpos0"), v0, t_end=t_end, dt=4e-3)
    d = by_mujoco(path, v0, t_end)
    rate = ROLL / R * G / 1.4
    assert run.q[-1, 0] == pytest.approx(0.5 * t_end - 0.5 * rate * t_end**2, abs=1e-5)
    assert run.q[-1, 0] == pytest.approx(d.qpos[0], abs=1e-3)
    assert np.linalg.norm(run.v[-1, :3]) == pytest.approx(d.qvel[0], rel=2e-3)
