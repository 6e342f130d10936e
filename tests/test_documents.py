"""What the documents say is true: scripts run as printed, equations stand where the map says, links lead somewhere."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "ngalpha_pin"
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
pytestmark = pytest.mark.skipif(not DOCUMENTS[0].is_file(), reason="the documents are not beside the tests")


def script(document):
    """The first block of Python."""
    return re.search(r"```python\n(.*?)```", document.read_text(encoding="utf-8"), re.DOTALL).group(1)


def output_of(text, folder):
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-c", text], cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_script_of_the_readme(tmp_path):
    pytest.importorskip("example_robot_data")
    from ngalpha_pin.robots._descriptions import file_of

    output = output_of(script(ROOT / "README.md").replace("robot.urdf", str(file_of("anymal"))), tmp_path)
    assert re.search(r"end +reached t_end +ok", output) and "NO" not in output
    assert "kind='impact'" in output
    assert (tmp_path / "replay.html").stat().st_size > 100_000


def test_script_of_extending(tmp_path):
    output = output_of(script(ROOT / "docs" / "extending.md"), tmp_path)
    errors = dict(re.findall(r"(\w+): error (\S+) m/s", output))
    assert float(errors["GeneralizedAlpha"]) < 1e-4 < float(errors["SemiImplicitEuler"]) < 0.1


def test_blocks_of_sensors(tmp_path):
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / "sensors.md").read_text(encoding="utf-8"), re.DOTALL)
    output = output_of("".join(blocks), tmp_path)
    assert float(re.search(r"weight (\S+)", output).group(1)) == pytest.approx(1.0, abs=1e-3)
    assert "'FL_foot_0/ground', 'lands'" in output
    assert "audit True" in output and "parts 6 True" in output
    assert "lift-off" in re.search(r"throws (.*)", output).group(1)
    assert float(re.search(r"current (\S+)", output).group(1)) == pytest.approx(0.22494124, abs=1e-8)
    assert "[('weld', 'Weld lower-upper'), ('release', 'Weld lower-upper'), ('disable', 'upper/lower')" in output


def test_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 90


def numbers_in(text):
    """Equation numbers of a file; (128)-(142), (128-142) and (43)-(49) stand for all between them."""
    found = set()
    for first, last in re.findall(r"\((\d{2,3})(?:\)?-\(?(\d{2,3}))?\)", text):
        found |= set(range(int(first), int(last or first) + 1))
    return found


def rows_of_map():
    for line in (ROOT / "docs" / "equations.md").read_text(encoding="utf-8").splitlines():
        cells = line.split("|")
        if len(cells) == 5 and "`" in cells[3]:
            yield numbers_in(cells[2]), re.findall(r"`([^`]+)`", cells[3])


def test_equations_stand_in_their_files():
    """Each number in the first file that is named; of the others, twins of it, at least one."""
    rows = list(rows_of_map())
    assert len(rows) > 20
    for numbers, files in rows:
        texts = [numbers_in((PACKAGE / file).read_text(encoding="utf-8")) for file in files]
        assert numbers <= texts[0], (files[0], numbers - texts[0])
        assert all(numbers & text for text in texts[1:]), files


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.name)
def test_links(document):
    text = document.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        if not link.startswith("http"):
            assert (document.parent / link).exists(), link
    for name in re.findall(r"`((?:benchmarks|tests|examples)/[\w/]+\.py)`", text) + re.findall(
        r"python (benchmarks/\w+\.py)", text
    ):
        assert (ROOT / name).is_file(), name
