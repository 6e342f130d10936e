"""The report: errors, orders, references, what is written, and what happens when it is interrupted."""

import csv
import dataclasses
import re

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.cli import main as cli
from ngalpha_pin.report import cases, lines, orders, parts, sweep, write
from ngalpha_pin.report.points import MaterialPoints, largest_distance


def short(name, sizes, t_end, smooth=None):
    """A known case, cut down."""
    case = cases.chosen_cases(name)[0]
    return dataclasses.replace(case, sizes=sizes, t_end=t_end, smooth=smooth or case.smooth)


def swept(case, rho_inf=(0.5,)):
    methods = lines.own_lines(rho_inf)
    *_, result = sweep.sweep(case, methods, 1, 0.0, lambda what: None)
    return result


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


# what an error is


def test_material_points_move_with_the_body():
    scene, q0, _ = robots.load("rotating_ball")
    points = MaterialPoints(scene)
    q = np.array([q0, [0.3, 1.0, 1.0, 0.0], [0.0, 1.0, np.cos(0.1), np.sin(0.1)]])
    start, moved, turned = points.positions(q)
    assert start.shape == (4, 3)
    assert largest_distance(start[None], moved[None]) == pytest.approx(0.3)
    # a turn moves the points on the axes by the radius of gyration, not the centre
    assert largest_distance(start[None], turned[None]) == pytest.approx(2 * np.sin(0.05) * 0.1 * np.sqrt(0.4))


def test_times_without_a_reference_do_not_count():
    a, b = np.zeros((2, 1, 3)), np.array([[[1.0, 0, 0]], [[np.nan, 0, 0]]])
    assert largest_distance(a, b) == 1.0


# orders


@pytest.mark.parametrize(
    ("power", "words"), [(2, "second order"), (1, "first order"), (1.5, "between first and second order")]
)
def test_order_of_a_power_law(power, words):
    sizes = np.array([4e-3, 2e-3, 1e-3])
    found = orders.order(sizes, 0.3 * sizes**power, 1.0)
    assert found.slope == pytest.approx(power)
    assert found.words == words


def test_orders_that_cannot_be_told_say_why():
    sizes = np.array([4e-3, 2e-3, 1e-3])
    assert "exact to rounding" in str(orders.order(sizes, np.full(3, 1e-15), 1.0))
    assert "reference" in str(orders.order(sizes, np.full(3, 1e-6), 1.0, uncertainty=1e-6))
    assert "no run" in str(orders.order(sizes, np.full(3, np.nan), 1.0))
    # rounding at the fine end does not spoil the slope of the rest
    assert orders.order(sizes, np.array([1e-6, 2.5e-7, 1e-16]), 1.0).slope == pytest.approx(2.0)


def test_richardson_finds_the_error_of_the_finest_run():
    sizes = np.array([4e-3, 2e-3, 1e-3])
    for power in (1, 2):
        values = 5.0 + 0.7 * sizes**power
        estimate = orders.richardson(values[0] - values[1], values[1] - values[2])
        assert estimate.uncertainty == pytest.approx(values[2] - 5.0, rel=1e-6)
        assert estimate.order == pytest.approx(power)
        assert estimate.sound
    assert not orders.richardson(1e-6, 1e-3).sound


def test_richardsons_estimate_agrees_with_the_closed_form():
    """The pendulum without its closed form: the stated uncertainty is the true error of the finest run."""
    case = short("pendulum", (8e-3, 4e-3), 1.0, (0.0, 1.0))
    unknown = dataclasses.replace(case, reference=None)
    window = swept(unknown).windows[0]
    scene, q0, v0 = case.start()
    finest = nga.simulate(scene, q0, v0, t_end=1.0, dt=1e-3)
    points = MaterialPoints(scene)
    true = largest_distance(points.positions(finest.q), points.positions(case.reference(finest.t)[0]))
    assert window.uncertainty == pytest.approx(true, rel=0.1)
    assert "Richardson" in window.reference


# measured orders


def test_orders_of_the_ball_in_the_cylinder_between_impacts():
    found = swept(short("ball_in_cylinder", (1e-2, 5e-3, 2.5e-3), 1.0, (0.8, 1.0)))
    between = found.windows[0]
    assert between.kind == "between impacts"
    assert between.order("generalized-alpha").slope == pytest.approx(2.0, abs=0.15)
    assert between.order("Moreau").slope == pytest.approx(1.0, abs=0.15)
    assert found.run.success


def test_between_impacts_the_ball_is_exact_and_across_them_it_is_not():
    result = swept(short("rotating_ball", (1e-2, 5e-3), 0.6, (0.45, 0.6)))
    between, across = result.windows
    assert between.order("generalized-alpha").words == "exact to rounding at every dt"
    errors = {line: [entry.error for entry in across.of(line)] for line in ("generalized-alpha", "Moreau")}
    assert max(errors["generalized-alpha"]) < 1e-4 < min(errors["Moreau"])


def test_smooth_stretch_has_no_event_in_it():
    scene, q0, v0 = robots.load("ball_in_cylinder")
    run = nga.simulate(scene, q0, v0, t_end=2.0, dt=5e-3)
    t0, t1 = sweep.smooth_stretch(run)
    assert t1 - t0 > 0.3
    assert not [event for event in run.events if t0 < event.t < t1]


def test_time_is_the_stepping_loop_alone(monkeypatch):
    case = short("pendulum", (1e-2,), 0.5, (0.0, 0.5))
    entry = swept(case).windows[0].of("generalized-alpha")[0]
    assert entry.steps == 50
    assert entry.setup > 0
    assert len(entry.seconds) == 1
    times = [3.0, 1.0, 2.0]
    assert dataclasses.replace(entry, seconds=tuple(times)).time == 2.0
    assert dataclasses.replace(entry, seconds=tuple(times)).noise == 1.0


def test_run_that_fails_is_an_entry_with_a_reason(monkeypatch):
    step = nga.GeneralizedAlpha.step

    def fails(self, system, state, dt):
        return dataclasses.replace(step(self, system, state, dt), converged=dt > 6e-3)

    monkeypatch.setattr(nga.GeneralizedAlpha, "step", fails)
    window = swept(short("pendulum", (1e-2, 5e-3), 0.5, (0.0, 0.5))).windows[0]
    good, bad = window.of("generalized-alpha")
    assert np.isfinite(good.error)
    assert np.isnan(bad.error)
    assert "did not converge" in bad.message
    ended = dataclasses.replace(window, entries=[bad]).order("generalized-alpha").words
    assert ended.startswith("no run came to its end: ") and "did not converge" in ended


def test_lines_share_what_they_are_measured_against():
    """A reference is asked for the same times once, however many lines there are."""
    case, asked = short("pendulum", (1e-2, 5e-3), 0.5, (0.0, 0.5)), []

    def reference(t):
        asked.append(t.tobytes())
        return cases.chosen_cases("pendulum")[0].reference(t)

    result = swept(dataclasses.replace(case, reference=reference))
    assert len(result.windows[0].entries) == 8
    assert len(asked) == len(set(asked))


def test_run_of_chosen_accuracy_is_measured_at_its_own_steps_where_that_is_known():
    case = short("pendulum", (1e-2,), 0.5, (0.0, 0.5))
    start = lines.Start(*case.start(), 0.0, 1e-2, 50)
    sampled, own = (lines.march_to_accuracy(start._replace(anywhere=anywhere)) for anywhere in (False, True))
    assert sampled.t == pytest.approx(1e-2 * np.arange(51))
    assert len(own.t) < 30
    points = MaterialPoints(start.scene)
    for run in (sampled, own):
        assert largest_distance(points.positions(run.q), points.positions(case.reference(run.t)[0])) < 1e-4


def test_doubt_of_a_reference_is_part_of_its_uncertainty():
    case = short("box_on_incline", (1e-2, 5e-3), 0.3)
    between, across = swept(dataclasses.replace(case, reference=None, doubt=1e-3)).windows
    assert between.uncertainty < 1e-9
    assert across.uncertainty > 1e-3
    assert "does not resolve, up to 1e-03 m" in across.reference
    assert "not resolved" in across.order("generalized-alpha").words


def test_line_that_cannot_run_the_scene_is_told_and_left_out():
    def refuses(start):
        raise nga.SceneError("no such shape here")

    methods = [*lines.own_lines([0.5]), lines.Line("other", refuses)]
    *_, result = sweep.sweep(short("pendulum", (1e-2,), 0.2, (0.0, 0.2)), methods, 1, 0.0, lambda what: None)
    assert result.absent == {"other": "no such shape here"}
    assert len(result.windows[0].of("Moreau")) == 1


def test_parts_of_the_time_add_up():
    shares = parts.shares(lambda: nga.simulate(*robots.load("tippe_top"), t_end=0.02, dt=1e-3))
    assert sum(shares.values()) == pytest.approx(1.0)
    assert set(shares) == set(parts.GROUPS)
    assert min(shares.values()) >= 0
    assert shares["Pinocchio"] > 0
    assert shares["coal"] == shares["constraints"] == 0


def test_parts_of_shapes_constraints_and_forces():
    """Each part appears where the scene has it; what no group names stays a small rest."""
    shapes = parts.shares(lambda: nga.simulate(*robots.load("box_on_incline"), t_end=0.02, dt=2e-3))
    assert shapes["features of shapes"] > 0
    loop = parts.shares(lambda: nga.simulate(*robots.load("four_bar"), t_end=0.02, dt=2e-3))
    assert loop["constraints"] > 0.01 and loop["coal"] == 0
    held = parts.shares(lambda: nga.simulate(*robots.load("arm", kp=10.0), t_end=0.02, dt=2e-3))
    assert held["forces"] > 0


# what is written


def test_report_of_a_scene_of_the_users_own(tmp_path, capsys):
    """A robot of example-robot-data-loaders: a URDF and an initial state in one command."""
    import example_robot_data

    urdf, folder = example_robot_data.load("double_pendulum").urdf, tmp_path / "report"
    command = ["report", urdf, "--q0", "1.0,0.5", "--v0", "0,1", "--t-end", "0.2", "--dt", "8e-3,4e-3"]
    assert cli.main([*command, "--out", str(folder), "--repeat", "1"]) == 0
    page = (folder / "report.html").read_text()
    assert "Richardson" in page
    assert 'src="data:image/png;base64,' in page
    assert not re.search(r"(src|href)=\"(?!data:)", page)
    runs = read(folder / "runs.csv")
    assert {row["method"] for row in runs} >= {"generalized-alpha", "laws of the paper", "Moreau"}
    assert {float(row["dt [s]"]) for row in runs} == {8e-3, 4e-3}
    assert {row["stretch"] for row in runs} == {"between impacts"}
    assert "no impact in this run" in page
    assert len(list(folder.glob("*.png"))) == 2
    assert "wrote" in capsys.readouterr().out


def test_report_of_several_systems_draws_them_together(tmp_path):
    several = [short("pendulum", (2e-2, 1e-2), 0.2, (0.0, 0.2)), short("box_on_incline", (1e-2, 5e-3), 0.3)]
    several[1] = dataclasses.replace(several[1], note="a word on its order")
    assert write.report(several, tmp_path, quick=True, simulators=False, progress=False)
    page = (tmp_path / "report.html").read_text()
    assert "a word on its order" in page
    assert [path.name for path in tmp_path.glob("*.png")] == ["overview.png"]
    assert page.count('src="data:image/png;base64,') == 1
    assert "Audit of" in page
    assert write.report(several[:1], tmp_path / "one", quick=True, simulators=False, progress=False)
    assert [path.name for path in (tmp_path / "one").glob("*.png")] == ["pendulum.png"]


def test_interrupted_report_writes_what_it_has(tmp_path, monkeypatch, capsys):
    original, calls = lines.march, []

    def interrupted(start, method):
        calls.append(start.dt)
        if len(calls) > 3 + 3:  # three of them are the reference, one of which is a run of the line at 0.01
            raise KeyboardInterrupt
        return original(start, method)

    monkeypatch.setattr(lines, "march", interrupted)
    folder = tmp_path / "report"
    command = ["report", "ngalpha_pin.report.cases:pendulum", "--t-end", "0.4", "--dt", "0.02,0.01"]
    assert cli.main([*command, "--out", str(folder), "--repeat", "1"]) == 130
    assert "Interrupted" in (folder / "report.html").read_text()
    marched = ("generalized-alpha", "laws of the paper", "Moreau")
    assert sum(row["method"] in marched for row in read(folder / "runs.csv")) == 4
    assert "interrupted" in capsys.readouterr().err


def test_every_system_of_the_paper_is_reported_on():
    known = cases.known_cases()
    for name in ("rotating_ball", "ball_in_corner", "ball_in_cylinder", "painleve_rod", "tippe_top"):
        found = cases.chosen_cases(name)
        assert found and all(case.reference is not None for case in found)
    for case in known.values():
        if case.reference is None:
            continue
        start, (q, v) = case.start(), case.reference(np.array([0.0, 1e-3]))
        assert pin.isSameConfiguration(start[0].model, q[0], np.asarray(start[1]), 1e-9), case.name
        assert v[0] == pytest.approx(start[2], abs=1e-9), case.name


def test_paper_is_its_six_systems():
    systems = {case.name.partition(",")[0] for case in cases.chosen_cases("paper")}
    assert systems == set(cases.PAPER)
    assert len(systems) == 6
    assert systems < set(robots.names())


@pytest.mark.long
def test_quick_report_of_all_systems(tmp_path):
    assert cli.main(["report", "--quick", "--out", str(tmp_path)]) == 0
    rows = read(tmp_path / "orders.csv")
    assert {row["system"] for row in rows} == set(cases.known_cases())
    slopes = {(r["system"], r["stretch"], r["method"]): r["order"] for r in rows}
    assert float(slopes["tippe_top", "between impacts", "generalized-alpha"]) == pytest.approx(2.0, abs=0.25)
    assert float(slopes["tippe_top", "between impacts", "laws of the paper"]) < 1.5


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("report solo", "did you mean 'solo12'"),
        ("report --dt 0.01,0.004 pendulum.urdf", "there is no file pendulum.urdf"),
        ("report rotating_ball --dt 0.01,0.004", "multiple of the smallest"),
        ("report rotating_ball --dt 0.01,-1", "must be positive"),
        ("report rotating_ball --t-end 0.01 --dt 0.01", "does not go into a run"),
        ("report rotating_ball --t-end -1", "must be positive"),
        ("report rotating_ball --rho-inf 2", "rho_inf = 2.0"),
        ("report rotating_ball --repeat 0", "--repeat must be at least 1"),
        ("report --audit none.npz", "cannot be read as a trajectory"),
    ],
)
def test_an_input_that_cannot_be_used_is_one_line(command, says, tmp_path, capsys):
    assert cli.main([*command.split(), "--out", str(tmp_path / "out")]) == 2
    captured = capsys.readouterr()
    assert says in captured.err
    assert captured.out == ""
    assert not (tmp_path / "out").exists()


def test_audit_page_of_a_file(tmp_path, capsys):
    file, folder = tmp_path / "run.npz", tmp_path / "audit"
    scene, q0, v0 = robots.load("quadruped", height=0.01)
    run = nga.simulate(scene, q0, v0, t_end=0.1, dt=2e-3)
    run.save(file)
    assert cli.main(["report", "--audit", str(file), "--out", str(folder)]) == 0
    page = (folder / "audit.html").read_text()
    assert "no forces here" in page
    assert "largest penetration" in page
    assert (folder / "audit.png").stat().st_size > 10_000
    # with the system that made it, its forces are part of the account
    assert cli.main(["report", "quadruped", "--audit", str(file), "--out", str(folder)]) == 0
    assert "no forces here" not in (folder / "audit.html").read_text()
    assert cli.main(["report", "arm", "--audit", str(file), "--out", str(folder)]) == 2
    assert "nq = 7" in capsys.readouterr().err


def test_table_of_orders_names_lines_that_cannot_run():
    result = sweep.Result(cases.known_cases()["pendulum"], absent={"other": "no"})
    from ngalpha_pin.report.tables import order_rows

    assert order_rows(result, ["other"]) == [["pendulum", "", "other", "", "cannot run it: no", ""]]
    assert write.time_of_parts(dataclasses.replace(result.case, t_end=0.1))["Pinocchio"] > 0
