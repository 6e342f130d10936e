"""The command line: what it prints and writes, its exit codes, and what it says when something is wrong."""

import dataclasses
import re
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin import robots, viz
from ngalpha_pin.cli import main as cli
from ngalpha_pin.cli import targets as target

URDF = Path(str(robots.__file__)).parent / "urdf"
EXAMPLES = Path(__file__).parents[2] / "examples"


# run and replay


def test_run_prints_the_audit_and_writes_files_that_replay_reads(tmp_path, capsys):
    npz, html, again = tmp_path / "ball.npz", tmp_path / "ball.html", tmp_path / "again.html"
    assert cli.main(["run", "rotating_ball", "--t-end", "0.6", "--out", str(npz), "--html", str(html)]) == 0
    printed = capsys.readouterr().out
    trajectory = nga.Trajectory.load(npz)
    assert str(trajectory.audit()) in printed
    assert trajectory.t[-1] == pytest.approx(0.6)
    assert trajectory.dt == cli.DEFAULTS["rotating_ball"].dt
    assert f"wrote {npz}" in printed
    assert f"wrote {html}" in printed

    assert cli.main(["replay", str(npz), "--html", str(again)]) == 0
    assert "rotating_ball" in again.read_text()
    assert again.stat().st_size == pytest.approx(html.stat().st_size, rel=1e-3)


def test_defaults_are_those_of_the_examples():
    assert tuple(cli.DEFAULTS) == robots.names()
    for name, defaults in cli.DEFAULTS.items():
        source = (EXAMPLES / f"{name}.py").read_text()
        numbers = [float(re.search(rf"\b{word}=([\d.e-]+)", source)[1]) for word in ("t_end", "dt", "rho_inf")]
        assert numbers == list(defaults), name


def test_options_reach_scene_and_method(tmp_path):
    out = tmp_path / "ball.npz"
    command = ["run", "rotating_ball", "--t-end", "0.1", "--dt", "0.05", "--rho-inf", "0.8", "--mu", "0.7"]
    assert cli.main([*command, "--height", "2", "--out", str(out)]) == 0
    trajectory = nga.Trajectory.load(out)
    assert len(trajectory.t) == 3
    assert "rho_inf=0.8" in trajectory.method
    assert trajectory.scene.contacts[0].law.mu == 0.7
    assert trajectory.q[0, 1] == 2.0


def test_run_with_moreau(tmp_path):
    out = tmp_path / "ball.npz"
    assert cli.main(["run", "rotating_ball", "--t-end", "0.02", "--method", "moreau", "--out", str(out)]) == 0
    assert nga.Trajectory.load(out).method.startswith("MoreauJean(theta=0.5")


def lowest_gap(trajectory):
    """Smallest gap of the points at the start; joints may stand at their limits."""
    system = trajectory.system
    system.place(trajectory.q[0])
    return system.gaps(system.contacts.subset(np.arange(system.contacts.n_points)), trajectory.q[0]).min()


def test_urdf_is_dropped_on_the_ground(tmp_path):
    out = tmp_path / "run.npz"
    command = ["run", str(URDF / "quadruped.urdf"), "--floating", "--ground", "--t-end", "0.01", "--out", str(out)]
    assert cli.main(command) == 0
    trajectory = nga.Trajectory.load(out)
    scene = trajectory.scene
    assert {p.geometry_a for p in scene.contacts} == {g.name for g in scene.collision_model.geometryObjects} - {
        "ground"
    }
    assert {p.geometry_b for p in scene.contacts} == {"ground"}
    assert {p.law.mu for p in scene.contacts} == {target.MU}
    assert lowest_gap(trajectory) == pytest.approx(target.HEIGHT, abs=1e-9)

    assert cli.main([*command, "--height", "0.02", "--mu", "0.3"]) == 0
    trajectory = nga.Trajectory.load(out)
    assert lowest_gap(trajectory) == pytest.approx(0.02, abs=1e-9)
    assert {p.law.mu for p in trajectory.scene.contacts} == {0.3}


def test_fixed_urdf_needs_no_ground():
    assert cli.main(["run", str(URDF / "arm.urdf"), "--t-end", "0.01"]) == 0


def test_run_that_ends_early_writes_what_it_has(tmp_path, capsys, monkeypatch):
    step, out = nga.GeneralizedAlpha.step, tmp_path / "part.npz"

    def fails_after_a_while(self, system, state, dt):
        return dataclasses.replace(step(self, system, state, dt), converged=state.t < 0.05)

    monkeypatch.setattr(nga.GeneralizedAlpha, "step", fails_after_a_while)
    assert cli.main(["run", "rotating_ball", "--dt", "0.01", "--out", str(out)]) == 1
    captured = capsys.readouterr()
    assert "ended early, at t = 0.05 s" in captured.err
    assert "NOT OK" in captured.out
    trajectory = nga.Trajectory.load(out)
    assert not trajectory.success
    assert trajectory.t[-1] == pytest.approx(0.05)


@pytest.mark.parametrize("option", ["--out", "--html"])
def test_run_that_cannot_be_written_is_kept_elsewhere(option, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    command = ["run", "rotating_ball", "--t-end", "0.01", "--dt", "1e-3"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("ngalpha_pin.cli.main._check_writable", lambda path: None)  # the disk fills while it runs
        assert cli.main([*command, option, str(tmp_path / "no" / "folder.npz")]) == 2
    said = capsys.readouterr().err
    assert re.search(r"ngalpha-pin: cannot write \S+: No such file.*; the run is in \S+\.npz\n", said)
    assert len(nga.Trajectory.load(re.search(r"the run is in (\S+)", said)[1]).t) == 11


def test_replay_in_the_browser(tmp_path, monkeypatch):
    out, calls = tmp_path / "ball.npz", []
    cli.main(["run", "rotating_ball", "--t-end", "0.02", "--out", str(out)])
    monkeypatch.setattr(viz, "play", lambda trajectory, **options: calls.append((len(trajectory.t), options)))
    assert cli.main(["replay", str(out), "--serve", "--speed", "0.5", "--loop"]) == 0
    assert calls == [(11, {"speed": 0.5, "loop": True})]


def test_replay_as_a_film_of_several_runs(tmp_path, monkeypatch, capsys):
    files, calls = [tmp_path / "slow.npz", tmp_path / "fast.npz"], []
    for path, dt in zip(files, ("0.005", "0.01"), strict=True):
        cli.main(["run", "rotating_ball", "--t-end", "0.02", "--dt", dt, "--out", str(path)])

    def film(trajectories, path, **options):
        calls.append(([run.dt for run in trajectories], options))
        path.write_bytes(b"film")
        return path

    monkeypatch.setattr(viz, "save_video", film)
    capsys.readouterr()
    out = tmp_path / "ball.mp4"
    assert cli.main(["replay", *map(str, files), "--video", str(out), "--speed", "0.25"]) == 0
    assert calls == [([0.005, 0.01], {"speed": 0.25, "labels": ["slow", "fast"]})]
    assert f"wrote {out} (0.00 MB)" in capsys.readouterr().out


# what cannot be done


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("run solo", "did you mean 'solo12'"),
        ("run nothing.urdf", "there is no file nothing.urdf"),
        ("run {folder}/txet.urdf", "did you mean {folder}/text.urdf?"),
        ("run {folder}", "is a folder; give a file, such as text.urdf"),
        ("run https://example.org/robot.urdf", "is an address: download the file"),
        ("run nothing", "neither a file nor a system; systems: andrews, anymal"),
        ("run {own}", "give a function in it that returns (scene, q0, v0): {own}:function"),
        ("run {own}:fails", "{own}:fails failed: ZeroDivisionError: division by zero, {own} line 2"),
        ("run {own}:needs", "{own}:needs failed: TypeError"),
        ("run {sdf}", "is an SDF file, which is not read"),
        ("info {sdf}", "is an SDF file, which is not read"),
        ("replay {folder}/missing.npz --html x.html", "there is no such file"),
        ("report {npz}", "a trajectory is shown by: ngalpha-pin replay"),
        ("stability {sdf}", "is an SDF file"),
        ("stability --q0 1,2", "--q0 is for a scene of your own"),
        ("stability arm --dt 0", "--dt = 0.0"),
        ("info nothing", "neither a file nor a system"),
        ("run arm --mu 0.5", "no parameter 'mu'"),
        ("run rotating_ball --mu -1", "mu = -1"),
        ("run arm --ground", "for URDF files"),
        ("run {urdf} --mu 0.5", "--mu needs --ground"),
        ("run {urdf} --height 1", "--height needs --floating"),
        ("run {text}", "cannot be read"),
        ("run none.py:load", "there is no file none.py"),
        ("run no_such_module:load", "no module named 'no_such_module'"),
        ("run ngalpha_pin.robots.arm:nothing", "has no function 'nothing'"),
        ("run ngalpha_pin.robots:names", "must return (scene, q0, v0)"),
        ("run ngalpha_pin.robots.arm:load --mu 1", "the function says it all"),
        ("run arm --q0 1,2", "--q0 has 2 numbers, the model needs 7"),
        ("run arm --v0 fast", "neither numbers with commas"),
        ("run arm --dt 0", "dt = 0.0: expected a positive number"),
        ("run arm --dt nan", "dt = nan"),
        ("run arm --t-end -1", "t_end = -1.0 must be later"),
        ("run arm --rho-inf 2", "rho_inf = 2.0"),
        ("run arm --method moreau --rho-inf 0.5", "--rho-inf belongs to generalized-alpha"),
        ("run arm --html {folder}/none/x.html", "there is no folder"),
        ("run arm --out {folder}", "is a folder"),
        ("replay {folder}/none.npz --html x.html", "cannot be read as a trajectory"),
        ("replay {text} --html x.html", "cannot be read as a trajectory"),
        ("replay {text} --html x.html --loop", "--loop goes with --serve"),
        ("replay {text} --video x.gif --loop", "--loop goes with --serve"),
        ("replay {text} --html x.html --speed 2", "has a control for it"),
        ("replay {text} {text} --serve", "--serve plays one trajectory"),
        ("replay {text} --video {folder}/none/x.gif", "there is no folder"),
    ],
)
def test_an_input_that_cannot_be_used_is_one_line(command, says, tmp_path, capsys):
    text, own, sdf, npz = (tmp_path / name for name in ("text.urdf", "own.py", "world.sdf", "run.npz"))
    text.write_text("no model")
    own.write_text("def fails():\n    return 1 / 0\n\n\ndef needs(a):\n    return a\n")
    sdf.write_text('<sdf version="1.7"><world name="w"/></sdf>')
    npz.write_text("")
    files = {"urdf": URDF / "arm.urdf", "folder": tmp_path, "text": text, "own": own, "sdf": sdf, "npz": npz}
    command, says = command.format(**files), says.format(**files)
    assert cli.main(command.split()) == 2
    captured = capsys.readouterr()
    assert says in captured.err
    assert re.fullmatch(r"ngalpha-pin: .*\n", captured.err)
    assert captured.out == ""


@pytest.mark.parametrize(
    "command",
    [
        "fly",
        "run",
        "run arm --dt fast",
        "run arm --method euler",
        "replay x.npz",
        "replay x --html y --serve",
        "replay x --video y --serve",
    ],
)
def test_wrong_usage(command, capsys):
    with pytest.raises(SystemExit) as error:
        cli.main(command.split())
    assert error.value.code == 2
    assert "usage: ngalpha-pin" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "says"),
    [
        ("runn arm", "there is no command 'runn'; did you mean 'run'?"),
        ("RUN arm", "did you mean 'run'?"),
        ("swep arm", "did you mean 'sweep'?"),
        ("run arm --tend 1", "usage: ngalpha-pin run"),
        ("run arm --tend 1", "unrecognized arguments: --tend 1 (did you mean --t-end?)"),
        ("run arm ball", "usage: ngalpha-pin run"),
        ("doctor now", "usage: ngalpha-pin doctor"),
        ("report arm --dt x", "'x': numbers with commas between them"),
    ],
)
def test_wrong_usage_says_what_was_meant(command, says, capsys):
    with pytest.raises(SystemExit, match="2"):
        cli.main(command.split())
    assert says in capsys.readouterr().err


def test_without_arguments_there_is_the_help(capsys):
    assert cli.main([]) == 2
    said = capsys.readouterr().err
    commands = ("run", "replay", "info", "report", "sweep", "stability", "doctor")
    assert all(command in said for command in commands)


def test_a_warning_is_one_line(monkeypatch, capsys):
    def warns(*args, **options):
        warnings.warn("the mesh is\nlarge", stacklevel=1)
        raise nga.SceneError("no more")

    monkeypatch.setattr(nga, "simulate", warns)
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        assert cli.main(["run", "arm"]) == 2
    assert capsys.readouterr().err == "ngalpha-pin: warning: the mesh is large\nngalpha-pin: no more\n"


def test_whoever_stops_reading_gets_no_traceback():
    done = subprocess.run(
        f"{sys.executable} -m ngalpha_pin info arm | head -1", shell=True, capture_output=True, text=True
    )
    assert done.stderr == ""
    assert done.stdout == "file\n"


def test_columns_of_info_do_not_touch(capsys):
    assert cli.main(["info", "rotating_ball"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  ")]
    assert any(re.match(r"  pin.computeJointJacobiansTimeVariation  +\d", line) for line in lines)
    assert len({re.match(r"  \S.*?  +(?=\S)", line).end() for line in lines}) == 1


def test_stability_of_a_scene_of_ones_own(tmp_path, capsys):
    out = tmp_path / "table.md"
    command = ["stability", "rotating_ball", "--t-end", "0.6", "--dt", "0.0025", "--quick", "--only", "rho_inf = 0.5"]
    assert cli.main([*command, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "ok      rotating_ball for 0.6 s with dt = 0.04, rho_inf = 0.5" in said
    assert "5 cases, 0 failed" in said
    assert out.read_text().startswith("# rotating_ball with other steps and damping")
    assert "Dependent constraints" not in out.read_text()


def test_names_of_systems_are_loaded_not_called():
    assert nga.robots is robots
    with pytest.raises(AttributeError, match=r"use robots.load\('tippe_top'\)"):
        vars(robots)["__getattr__"]("tippe_top")
    with pytest.raises(AttributeError, match=r"did you mean robots.load\('quadruped'\)"):
        _ = robots.quadrupet
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = nga.nothing


def test_interrupt_is_no_traceback(monkeypatch, capsys):
    def interrupted(*args, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(nga, "simulate", interrupted)
    assert cli.main(["run", "arm"]) == 130
    assert capsys.readouterr().err == "ngalpha-pin: interrupted\n"


def test_initial_state_comes_from_options_and_files(tmp_path):
    out, q0 = tmp_path / "run.npz", tmp_path / "q0.npy"
    np.save(q0, np.array([0.0, 0.5, 0.8, 0.6]))
    command = ["run", "rotating_ball", "--t-end", "0.01", "--out", str(out), "--q0", str(q0), "--v0", "1,0,-2.5"]
    assert cli.main(command) == 0
    run = nga.Trajectory.load(out)
    assert run.q[0] == pytest.approx([0.0, 0.5, 0.8, 0.6])
    assert run.v[0].tolist() == [1.0, 0.0, -2.5]


def test_target_is_a_function_of_a_file_or_of_a_module(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(
        "from ngalpha_pin import robots\n\ndef fast():\n    return robots.load('rotating_ball', omega=7.0)\n"
    )
    assert target.load(f"{file}:fast", target.Options())[2][2] == 7.0
    assert target.load("ngalpha_pin.robots.arm:load", target.Options())[0].model.name == "arm"
    assert sys.path[0] != ""  # a folder does not come before what is installed, here or in processes of their own


def test_python_m(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "ngalpha_pin", "info", "arm"], capture_output=True, text=True, cwd=tmp_path
    )
    assert done.returncode == 0
    assert "nq = 7, nv = 7" in done.stdout


SRDF = """<robot name="r"><group_state name="standing" group="all"><joint name="hip" value="0.4"/></group_state>
<virtual_joint name="w" type="floating" parent_frame="world" child_link="base"/></robot>"""


def test_a_file_floats_and_stands_on_the_ground_where_its_srdf_says_so(tmp_path, capsys):
    inertial = (
        '<inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    ball = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    links = "".join(f'<link name="{name}">{inertial}{ball}</link>' for name in ("base", "leg"))
    hip = '<joint name="hip" type="revolute"><parent link="base"/><child link="leg"/><axis xyz="0 1 0"/>'
    hip += '<origin xyz="0 0 -0.3"/><limit lower="-1" upper="0.3" effort="1" velocity="1"/></joint>'
    path = tmp_path / "r.urdf"
    path.write_text(f'<robot name="r">{links}{hip}</robot>')
    scene, q0, _ = target.load(str(path), target.Options())
    assert (scene.model.nv, scene.contacts) == (1, [])
    (tmp_path / "srdf").mkdir()
    (tmp_path / "srdf" / "other.srdf").write_text(SRDF)
    scene, q0, _ = target.load(str(path), target.Options(height=0.2))
    assert [pair.geometry_a for pair in scene.contacts] == ["base_0", "leg_0"]
    assert q0[2] == pytest.approx(0.6, abs=1e-9)  # the leg's ball of 0.1 m is 0.3 m below
    assert q0[7] == 0.3  # of "standing", within the limits
    scene, q0, _ = target.load(str(path), target.Options(floating=False))
    assert scene.model.nv == 1
    assert cli.main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    assert re.search(r"^  joints: 1  +used: 1 revolute", said, re.MULTILINE)
    assert re.search(r"^  limits of velocity: 1  +no effect: they belong to a controller", said, re.MULTILINE)


def test_info_of_a_file_in_which_nothing_moves_and_the_version(tmp_path, capsys):
    path = tmp_path / "f.urdf"
    path.write_text('<robot name="f"><link name="a"/></robot>')
    assert cli.main(["info", str(path), "--no-floating"]) == 0
    assert "none: nothing moves" in capsys.readouterr().out
    assert cli.main(["run", str(path), "--no-floating"]) == 2
    assert "nothing in f moves" in capsys.readouterr().err
    with pytest.raises(SystemExit, match="0"):
        cli.main(["--version"])
    assert nga.__version__ in capsys.readouterr().out


@pytest.mark.parametrize(
    ("stop", "code", "word"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")]
)
def test_stopped_run_writes_what_it_has(stop, code, word, tmp_path):
    path = tmp_path / "run.npz"
    command = ["run", "rotating_ball", "--t-end", "1000", "--dt", "1e-3", "--out", str(path)]
    process = subprocess.Popen(
        [sys.executable, "-m", "ngalpha_pin", *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell in the background ignores it
    )  # fmt: skip
    said = b""
    while not re.search(rb"\| [1-9]\d*/1000000", said):  # the progress bar: some steps are done
        said += (byte := process.stderr.read(1))
        assert byte, said.decode()
    process.send_signal(stop)
    said += process.communicate(timeout=60)[1]
    assert process.returncode == code
    assert f"{word} at t = " in said.decode()
    assert nga.Trajectory.load(path).t[-1] > 0.0


@pytest.mark.parametrize("name", ["frames.urdf", "frames.urdf.xacro"])
def test_a_file_of_links_without_mass_is_told_and_not_run(tmp_path, capsys, name):
    xacro = name.endswith(".xacro")
    if xacro:
        pytest.importorskip("xacrodoc")
    path = tmp_path / name
    space = ' xmlns:xacro="http://www.ros.org/wiki/xacro"' if xacro else ""
    inside = '<xacro:property name="m" value="1"/>' if xacro else ""
    path.write_text(f'<robot name="r"{space}>{inside}<link name="a"/></robot>')
    assert cli.main(["run", str(path)]) == 2
    said = capsys.readouterr().err
    assert "no joint that moves and no link with a mass" in said and ("once xacro has expanded it" in said) == xacro
    assert cli.main(["info", str(path)]) == 0
    assert "nothing moves" in capsys.readouterr().out
