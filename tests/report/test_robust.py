"""A report goes on where a line fails or hangs, keeps what there is, and says when its times are no good."""

import csv
import dataclasses
import gc
import signal
import subprocess
import sys
import time
import weakref

import numpy as np
import pinocchio as pin
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.cli import main as cli
from ngalpha_pin.errors import Interrupted
from ngalpha_pin.report import bounded, cases, lines, page, recorded, sweep, write
from ngalpha_pin.report.bounded import Deadline, OutOfTime, within
from ngalpha_pin.simulators import pinocchio_admm


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def pendulum(sizes=(1e-2, 5e-3), t_end=0.2):
    case = cases.chosen_cases("pendulum")[0]
    return dataclasses.replace(case, sizes=sizes, t_end=t_end, smooth=(0.0, t_end))


def swept(case, more, **options):
    own = lines.own_line("generalized-alpha", nga.GeneralizedAlpha())
    *_, result = sweep.sweep(case, [*more, own], 1, 0.0, lambda what: None, **options)
    return result


def fails(start):
    raise ZeroDivisionError("in the middle\nof everything")


def hangs(start):
    time.sleep(30.0)


def test_a_line_that_fails_is_one_line_and_the_others_go_on(tmp_path):
    result = swept(pendulum(), [lines.Line("broken", fails)])
    assert result.absent == {"broken": "ZeroDivisionError: in the middle of everything"}
    assert len(result.windows[0].of("generalized-alpha")) == 2
    said = page.summary([result], [lines.Line("broken", fails)])
    assert "cannot run it: ZeroDivisionError: in the middle of everything" in said


def test_a_line_that_hangs_within_a_step_is_given_up():
    began = time.perf_counter()
    result = swept(pendulum(), [lines.Line("slow", hangs)], limit=0.2)
    assert time.perf_counter() - began < 20.0
    (entry,) = result.windows[0].of("slow")
    assert entry.message.startswith(lines.GIVEN_UP)
    assert np.isnan(entry.error)
    assert len(result.windows[0].of("generalized-alpha")) == 2


def test_what_is_done_at_the_end_of_the_time_is_kept():
    with pytest.raises(OutOfTime) as caught:
        within(0.3, lambda: nga.simulate(*robots.load("rotating_ball"), t_end=1e4, dt=1e-3))
    assert isinstance(caught.value.__cause__, Interrupted)
    assert caught.value.__cause__.trajectory.t[-1] > 0.0
    assert within(5.0, lambda: 7) == 7
    assert signal.getitimer(signal.ITIMER_REAL)[0] == 0.0


def _busy(seconds: float) -> None:
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        pass


class Vanishes:
    def __del__(self):
        _busy(0.2)


def collects():
    def callback(phase, info):
        _busy(0.1)

    gc.callbacks.append(callback)
    try:
        gc.collect()
        return "went on"
    finally:
        gc.callbacks.remove(callback)


def vanishes():
    kept = [Vanishes()]
    kept.clear()
    return "went on"


def finalizes():
    thing = type("Thing", (), {})()
    weakref.finalize(thing, _busy, 0.2)
    del thing
    return "went on"


@pytest.mark.parametrize("work", [collects, vanishes, finalizes])
def test_the_end_of_the_time_is_not_lost_where_exceptions_are(work):
    with pytest.raises(OutOfTime):
        within(0.05, lambda: [work(), _busy(1.0)])


def test_time_without_a_processor_does_not_count(monkeypatch, tmp_path):
    """What sleeps takes its time; where others have the processor, the time of this thread goes on later."""
    with pytest.raises(OutOfTime):
        within(0.05, lambda: time.sleep(5.0))
    waited = tmp_path / "schedstat"
    monkeypatch.setattr(bounded, "WAITED", waited)
    waited.write_text("0 0 1")
    end = Deadline(0.01)
    waited.write_text(f"0 {int(1e12)} 1")
    time.sleep(0.02)
    assert end.left() > 100.0
    assert not end.passed()
    waited.unlink()  # a system that does not tell
    end = Deadline(0.01)
    time.sleep(0.02)
    assert end.passed()


def test_no_run_begins_after_the_budget():
    result = swept(pendulum(), [lines.Line("slow", lambda start: hangs(start))], limit=0.3, budget=0.2)
    assert result.cut
    assert "The time of a quick report was over" in "".join(page.loaded(result))


def test_runs_of_the_reference_are_not_made_again(monkeypatch):
    original, sizes = lines.march, []

    def watched(start, method):
        sizes.append(start.dt)
        return original(start, method)

    monkeypatch.setattr(lines, "march", watched)
    case = dataclasses.replace(pendulum(), reference=None, smooth=None, finer=2)
    method = nga.GeneralizedAlpha(rho_inf=case.rho_inf)
    own = [lines.own_line("generalized-alpha", method), lines.own_line("other", nga.GeneralizedAlpha(rho_inf=0.1))]
    *_, result = sweep.sweep(case, own, 1, 0.0, lambda what: None)
    assert sizes == [1e-2, 5e-3, 2.5e-3, 1e-2, 5e-3]  # the reference, then the other method alone
    first, second = (window_entry.error for window_entry in result.windows[0].of("generalized-alpha"))
    assert first / second == pytest.approx(5.0, rel=0.1)  # 16 - 1 to 4 - 1 where the reference is of order 2


def test_a_case_without_a_reference_has_no_errors_and_is_drawn(tmp_path):
    case = dataclasses.replace(pendulum(), reference=None, smooth=None)
    own = [lines.own_line("generalized-alpha", nga.GeneralizedAlpha())]
    result = swept(case, [])
    result.windows[0].reference = f"{sweep.NONE}: the finest run ended early"
    result.windows[0].entries = [dataclasses.replace(e, error=np.nan) for e in result.windows[0].entries]
    assert str(result.windows[0].order("generalized-alpha")) == "no reference"
    pages = write.Pages(tmp_path, {}, {}, write.Figures(True, False))
    pages.add(result, own, {})
    pages.finish()
    assert "no reference" in (tmp_path / "report.html").read_text()


def test_the_energy_of_a_run_is_compared_with_the_reference():
    result = swept(pendulum((1e-2, 5e-3, 2.5e-3), 1.0), [lines.own_line("Moreau", nga.MoreauJean())])
    window = result.windows[0]
    errors = np.abs([entry.energy for entry in window.of("generalized-alpha")])
    scene, q0, v0 = cases.pendulum()
    run = nga.simulate(scene, q0, v0, t_end=1.0, dt=1e-2)
    assert errors[0] == pytest.approx(abs(run.energy.total[-1] - run.energy.total[0]), rel=1e-6)
    assert errors[1] / errors[2] == pytest.approx(8.0, rel=0.3)  # what it damps falls with the third power


def entry(dt, seconds):
    return sweep.Entry("line", dt, 1e-3, (seconds,), 0.0, 10, 1.0, {}, "")


def test_times_that_fold_back_and_a_loaded_machine_are_told():
    window = sweep.Window("between impacts", 0.0, 1.0, "closed form", entries=[entry(1e-2, 1.0), entry(5e-3, 0.5)])
    assert window.folds() == ["line"]
    assert "Times fold back" in page.window_section(window, [lines.Line("line", fails)])
    window.entries[1] = entry(5e-3, 1.9)
    assert window.folds() == []
    result = sweep.Result(pendulum(), wall=10.0, cpu=4.0)
    assert "this process got 40 % of a core" in "".join(page.loaded(result))
    assert page.loaded(dataclasses.replace(result, cpu=9.8)) == []


def test_a_killed_report_keeps_its_lines(tmp_path):
    command = [sys.executable, "-m", "ngalpha_pin", "report", "rotating_ball", "--out", str(tmp_path / "out")]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=tmp_path)
    runs = tmp_path / "out" / "runs.csv"
    end = time.monotonic() + 120.0
    try:
        while not (runs.is_file() and len(runs.read_text().splitlines()) > 2):
            assert time.monotonic() < end
            assert process.poll() is None
            time.sleep(0.05)
    finally:
        process.kill()
        process.wait()
    rows = read(runs)
    assert rows[0]["method"] == "generalized-alpha"
    assert "Not finished: this is what there is." in (tmp_path / "out" / "report.html").read_text()


def test_admm_stops_at_the_limit_of_a_joint():
    """A weight on a slide that falls on its lower limit behind another joint: the limit carries it."""
    model = pin.Model()
    hinge = model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "hinge")  # nq = 2 before the slide
    slide = model.addJoint(hinge, pin.JointModelPZ(), pin.SE3.Identity(), "slide")
    for joint in (hinge, slide):
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.lowerPositionLimit = np.array([-1.0, -1.0, -0.05])
    model.upperPositionLimit = np.array([1.0, 1.0, 1.0])
    start = lines.Start(nga.Scene(model), np.array([1.0, 0.0, 0.0]), np.zeros(2), 0.0, 1e-3, 200)
    found = pinocchio_admm.march(start)
    assert found.message == ""
    free = int(np.sqrt(2 * 0.05 / 9.81) / 1e-3) - 2
    n = np.arange(free)
    np.testing.assert_allclose(found.q[:free, 2], -9.81 * 1e-6 * n * (n + 1) / 2, atol=1e-12)
    np.testing.assert_allclose(found.q[110:, 2], -0.05, atol=1e-8)
    np.testing.assert_allclose(found.v, 0.0, atol=1e-8)


# a motion of one's own


def table(path, model, run):
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["note", "t", *recorded.columns(model)][1:])
        writer.writerows([[t, *q] for t, q in zip(run.t, run.q, strict=True)])


@pytest.mark.parametrize("ending", ["npz", "csv"])
def test_compare_with_a_recorded_motion(ending, tmp_path, capsys):
    scene, q0, v0 = robots.load("arm")
    run = nga.simulate(scene, q0, v0, t_end=0.2, dt=1e-3)
    path = tmp_path / f"run.{ending}"
    run.save(path) if ending == "npz" else table(path, scene.model, run)
    out = tmp_path / "out"
    assert (
        cli.main(["report", "arm", "--compare", str(path), "--dt", "4e-3,2e-3", "--repeat", "1", "--out", str(out)])
        == 0
    )
    rows = read(out / "runs.csv")
    errors = {float(r["dt [s]"]): float(r["largest error [m]"]) for r in rows if r["method"] == "generalized-alpha"}
    assert errors[2e-3] < errors[4e-3] < 1e-4
    assert f"recorded motion run.{ending}, 201 samples to 0.2 s" in (out / "report.html").read_text()


def test_recordings_that_do_not_fit_are_refused(tmp_path, capsys):
    path = tmp_path / "run.csv"
    path.write_text("t,joint_1\n0,0\n1,0\n2,0\n")
    assert cli.main(["report", "arm", "--compare", str(path)]) == 2
    assert "lacks 'joint_2'; columns: t, joint_1, joint_2" in capsys.readouterr().err
    assert cli.main(["report", "--compare", str(path)]) == 2
    assert "needs the scene that was recorded" in capsys.readouterr().err
    run = tmp_path / "ball.npz"
    nga.simulate(*robots.load("rotating_ball"), t_end=0.01, dt=5e-3).save(run)
    assert cli.main(["report", "arm", "--compare", str(run)]) == 2
    assert "was recorded with other joints" in capsys.readouterr().err


def test_names_of_the_columns_of_a_free_body():
    model = pin.Model()
    model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    assert recorded.columns(model) == [f"base.{part}" for part in ("x", "y", "z", "qx", "qy", "qz", "qw")]
