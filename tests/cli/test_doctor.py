"""`ngalpha-pin doctor` on healthy and on broken installations."""

import re
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

from ngalpha_pin.cli import doctor
from ngalpha_pin.cli import main as cli


@pytest.fixture
def fake(tmp_path, monkeypatch):
    """A function that puts a package in front of the others; doctor looks at it and at one real package."""
    monkeypatch.setattr(doctor, "PACKAGES", (doctor.Package("pinocchio", "pin"), doctor.Package("numpy", "numpy")))
    for probe in ("KERNEL", "ENGINE"):  # the healthy installation has them; each takes an import of the whole package
        monkeypatch.setattr(doctor, probe, "print('not looked at')")

    def make(module, source="", folder="early"):
        path = tmp_path / folder
        (path / module).mkdir(parents=True)
        (path / module / "__init__.py").write_text(source)
        monkeypatch.syspath_prepend(str(path))
        return path

    return make


def test_doctor_finds_nothing_wrong_here(capsys):
    assert cli.main(["doctor"]) == 0
    printed = capsys.readouterr().out
    assert printed.endswith("nothing is wrong\n")
    for module, version, path in [
        ("python", sys.version.split()[0], sys.executable),
        ("pinocchio", pin.__version__, pin.__file__),
        ("numpy", np.__version__, np.__file__),
    ]:
        assert re.search(rf"^{module} +{re.escape(version)} +{re.escape(path)}$", printed, re.MULTILINE)
    assert re.search(
        rf"^engine +compiled +by .+ against pinocchio [\d.]+ \({pin.__version__} loaded\)", printed, re.MULTILINE
    )
    assert {"coal", "scipy", "meshcat", "matplotlib"} <= set(re.findall(r"^\w+", printed, re.MULTILINE))


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("", "is not the rigid body dynamics library"),
        ("__version__ = '3.9.0'", "pinocchio 3.9.0 is imported, 4.1 is needed"),
        ("__version__ = '4.2.0'", "pinocchio 4.2.0 is imported, 4.1 is needed"),
        ("__version__ = '4.1.99'", f"pip has installed pin {pin.__version__}, but version 4.1.99 is imported"),
        ("import missing_library", "import pinocchio: ModuleNotFoundError: No module named 'missing_library'"),
        ("import os; os.abort()", "import pinocchio: the interpreter was ended by signal 6"),
    ],
)
def test_doctor_finds_another_pinocchio(fake, source, says, capsys):
    fake("pinocchio", source)
    assert cli.main(["doctor"]) == 1
    printed = capsys.readouterr().out
    assert says in printed
    assert "2 installations of pinocchio, the first one hides the others" in printed
    assert printed.count("     do: ") == printed.count("problem: ") == 2
    assert printed.endswith("2 problems found\n")


def test_doctor_finds_what_an_exported_path_hides(fake, capsys, monkeypatch):
    path = fake("numpy", "__version__ = '1.0'")
    monkeypatch.setenv("PYTHONPATH", str(path))
    assert cli.main(["doctor"]) == 1
    printed = capsys.readouterr().out
    assert f"{path} comes before the installed packages and brings its own numpy" in printed
    assert "do: unset PYTHONPATH" in printed


def test_doctor_does_not_mind_an_exported_path_with_other_packages(fake, capsys, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(fake("other")))
    assert cli.main(["doctor"]) == 0


def test_doctor_finds_ros(fake, capsys, monkeypatch):
    fake("pinocchio", "__version__ = '4.1.0'")
    monkeypatch.setattr(doctor, "ROS", str(fake("ros", folder="ros").parent))
    assert cli.main(["doctor"]) == 1
    assert "do: use a shell that has not sourced" in capsys.readouterr().out


def test_doctor_finds_the_plugin_of_nose(fake, capsys):
    path = fake("pinocchio", "import nose")
    information = path / "pinocchio-0.5.1.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: pinocchio\nVersion: 0.5.1\nSummary: plugins for the nose testing framework\n"
    )
    assert cli.main(["doctor"]) == 1
    printed = capsys.readouterr().out
    assert "pip uninstall -y pinocchio && pip install --force-reinstall pin" in printed
    assert printed.endswith("1 problem found\n")


def test_doctor_tells_missing_from_optional(fake, capsys, monkeypatch):
    needed, optional = (
        doctor.Package("not_there", "not-there"),
        doctor.Package("nor_there", "nor-there", "nobody needs"),
    )
    monkeypatch.setattr(doctor, "PACKAGES", (needed, optional))
    assert cli.main(["doctor"]) == 1
    printed = capsys.readouterr().out
    assert "not installed; nobody needs it: pip install nor-there" in printed
    assert "do: pip install not-there" in printed
    assert printed.endswith("1 problem found\n")


def test_doctor_names_the_library_that_the_wheels_lack(fake, capsys):
    fake("pinocchio", "raise ImportError('libgomp.so.1: cannot open shared object file: No such file or directory')")
    cli.main(["doctor"])
    assert "do: apt-get install libgomp1" in capsys.readouterr().out


def test_doctor_works_where_the_package_cannot_be_imported(tmp_path):
    (tmp_path / "pinocchio.py").write_text("raise ImportError('broken')")
    done = subprocess.run(
        [sys.executable, cli.__file__, "doctor"], capture_output=True, text=True, env={"PYTHONPATH": str(tmp_path)}
    )
    assert done.returncode == 1
    assert "import pinocchio: ImportError: broken" in done.stdout
    assert "unset PYTHONPATH" in done.stdout
    assert done.stderr == ""
