"""What the documents say is true: scripts run as printed, equations stand where the map says, links lead somewhere."""

import importlib.util
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import ngalpha_pin as nga
from ngalpha_pin import viz
from ngalpha_pin.cli.main import _parser

ROOT = Path(__file__).parents[1]
PACKAGE, DOCS = ROOT / "ngalpha_pin", ROOT / "docs"
OWN = {DOCS / "_site", DOCS / "_generated"}  # what a build leaves
PAGES = [page for page in sorted(DOCS.rglob("*.md")) if not OWN & set(page.parents)]
README = ROOT / "README.md"
DOCUMENTS = [page for page in (README, ROOT / "CONTRIBUTING.md", *PAGES) if page.is_file()]
TUTORIALS = [page for page in PAGES if page.parent.name == "tutorials"]
RUN = [page for page in PAGES if re.search(r"^(```|<!-- )python$", page.read_text(encoding="utf-8"), re.MULTILINE)]
pytestmark = pytest.mark.skipif(not README.is_file(), reason="the documents are not beside the tests")


def named(page):
    return page.relative_to(ROOT).as_posix()


def run(page, folder, replace=str):
    """What all blocks of a page print, by the function that the site uses."""
    pytest.importorskip("matplotlib").use("agg")
    spec = importlib.util.spec_from_file_location("blocks", DOCS / "_ext" / "blocks.py")
    blocks = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(blocks)
    return "".join(output.text for _, output in blocks.run(page, folder, replace))


@pytest.fixture(autouse=True)
def no_figures_left():
    yield
    plt = sys.modules.get("matplotlib.pyplot")
    if plt is not None:
        plt.close("all")


def test_script_of_the_readme(tmp_path):
    pytest.importorskip("example_robot_data")
    from ngalpha_pin.robots._descriptions import file_of

    robot = str(file_of("anymal"))
    output = run(README, tmp_path, lambda code: code.replace("robot.urdf", robot))
    assert re.search(r"end +reached t_end +ok", output) and "NO" not in output
    assert "kind='impact'" in output
    assert (tmp_path / "replay.html").stat().st_size > 100_000


@pytest.mark.parametrize("page", RUN, ids=named)
def test_blocks_run(page, tmp_path):
    output = run(page, tmp_path)
    assert "NOT OK" not in output or page.name == "reading_an_audit.md"
    if page in SAID:
        SAID[page](output)


def test_tests_and_examples_of_each_law_exist():
    tests, laws = DOCS.parent / "tests", 0
    for line in (DOCS / "shown.md").read_text(encoding="utf-8").splitlines():
        own = re.search(r"`(\w+/test_\w+\.py)`", line.split("|")[1] if line.startswith("| ") else "")
        laws += own is not None
        for file, name in re.findall(r"`(?:(\w+/test_\w+\.py)::)?(test_\w+)`", line):
            text = (tests / (file or own.group(1))).read_text(encoding="utf-8")
            assert re.search(rf"^def {name}\(", text, re.MULTILINE), (file or own.group(1), name)
        for name in re.findall(r"`(\w+\.py)`", line):
            assert (DOCS.parent / "examples" / name).is_file(), name
        assert all((tests / file).is_file() for file in re.findall(r"`(\w+/test_\w+\.py)`", line))
    assert laws == 12


def said_by_extending(output):
    errors = dict(re.findall(r"(\w+): error (\S+) m/s", output))
    assert float(errors["GeneralizedAlpha"]) < 1e-4 < float(errors["SemiImplicitEuler"]) < 0.1


def test_script_of_sweeps(tmp_path):
    """A script of its own: its function is imported by the processes of the sweep."""
    pytest.importorskip("h5netcdf")
    code = re.search(r"^```py\n(.*?)```", (DOCS / "sweeps.md").read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    (tmp_path / "script.py").write_text(code.group(1), encoding="utf-8")
    done = subprocess.run([sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and "[['' '']\n ['' '']]" in done.stdout, done.stderr
    assert (tmp_path / "drops.nc").is_file()


def said_by_sensors(output):
    assert float(re.search(r"weight (\S+)", output).group(1)) == pytest.approx(1.0, abs=1e-3)
    assert re.search(r"lands +FL_foot_0/ground", output)
    assert "audit True" in output and "parts 6 True" in output
    assert "lift-off" in re.search(r"throws (.*)", output).group(1)
    assert float(re.search(r"current (\S+)", output).group(1)) == pytest.approx(0.22494124, abs=1e-8)
    assert "[('weld', 'Weld lower-upper'), ('release', 'Weld lower-upper'), ('disable', 'upper/lower')" in output


def pairs_agree(pattern, rtol):
    """Numbers that a page prints beside each other are the same."""

    def check(output):
        found = re.findall(pattern, output)
        assert found
        for a, b in found:
            assert float(a) == pytest.approx(float(b), rel=rtol), (a, b)

    return check


def says(pattern):
    def check(output):
        assert re.search(pattern, output)

    return check


def said_by_closed_loops(output):
    pairs_agree(r"tool at (\S+) m, exact (\S+) m", 1e-10)(output)
    swing, left = re.findall(r"by (\S+) J", output)
    assert float(left) < 1e-2 * float(swing)


def said_by_reading_an_audit(output):
    long, short = output.split("dt = 0.0002 s")
    assert "motion that is not resolved" in long and "cause" not in short.splitlines()[1]
    assert re.search(r"friction against the slip: \S+ rel, at the forged step", output)


NUMBER = r"(-?\d[\d.e+-]*)"
SAID = {
    DOCS / "extending.md": said_by_extending,
    DOCS / "sensors.md": said_by_sensors,
    DOCS / "learning.md": says(r"^\(34,\) "),
    DOCS / "start.md": pairs_agree(rf"{NUMBER} m/s, exact {NUMBER} m/s", 2e-4),
    DOCS / "coming_from.md": pairs_agree(rf"impact at {NUMBER} s, exact {NUMBER} s", 1e-8),
    DOCS / "tutorials" / "drop_and_stand.md": pairs_agree(rf"ground {NUMBER} N, weight {NUMBER} N", 1e-2),
    DOCS / "tutorials" / "push_and_trot.md": says("every law is kept: True"),
    DOCS / "tutorials" / "grasp_and_lift.md": says(r"lifted by 9\.\d+ cm"),
    DOCS / "tutorials" / "closed_loops.md": said_by_closed_loops,
    DOCS / "tutorials" / "flexible_arm.md": pairs_agree(rf"{NUMBER} Hz, textbook {NUMBER} Hz", 1e-2),
    DOCS / "tutorials" / "own_laws.md": pairs_agree(rf"air {NUMBER} J, change of energy {NUMBER} J", 1e-2),
    DOCS / "tutorials" / "sweep.md": says(r"it tips beyond 21\.8 degrees"),
    DOCS / "tutorials" / "learning.md": says("after the search for 100"),
    DOCS / "tutorials" / "identification.md": pairs_agree(rf"e_N +{NUMBER} \+- \S+, true {NUMBER}", 1e-2),
    DOCS / "tutorials" / "reading_an_audit.md": said_by_reading_an_audit,
}


def test_every_tutorial_says_something_that_is_checked():
    assert TUTORIALS and set(TUTORIALS) <= set(SAID)


def test_reference_is_complete():
    """Every public name has its place, and none has two."""
    gym = pytest.importorskip("ngalpha_pin.gym")
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES if page.parent.name == "reference")
    named = re.findall(r"\.\. auto(?:class|function|data):: ngalpha_pin\.((?:viz\.|gym\.)?\w+)$", text, re.MULTILINE)
    apart = [f"{part.__name__.rsplit('.')[-1]}.{name}" for part in (viz, gym) for name in part.__all__]
    assert sorted(named) == sorted([*nga.__all__, *apart])
    for name in ("Scene", "Trajectory", "Simulator"):  # much of what they do is in classes they inherit from
        assert f":: ngalpha_pin.{name}\n   :members:\n   :inherited-members:" in text


def test_every_page_is_in_the_contents():
    index = (DOCS / "index.md").read_text(encoding="utf-8")
    listed = {
        line.strip() for block in re.findall(r"```{toctree}\n(.*?)```", index, re.DOTALL) for line in block.split("\n")
    }
    assert {page.relative_to(DOCS).with_suffix("").as_posix() for page in PAGES} - {"index"} <= listed


def commands():
    """Lines of the documents that are commands of the package."""
    for page in DOCUMENTS:
        for line in re.findall(r"^ {4}(?:\./run|ngalpha-pin) .*$", page.read_text(encoding="utf-8"), re.MULTILINE):
            words = shlex.split(line, comments=True)
            yield pytest.param(["run", *words[1:]] if words[0] == "./run" else words[1:], id=" ".join(words))


@pytest.mark.parametrize("words", list(commands()))
def test_commands_are_understood(words):
    _parser().parse_args(words)


def test_readme_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 90


@pytest.mark.long
def test_site_builds(tmp_path):
    """Without a warning, every link inside of it, and nothing from the network."""
    pytest.importorskip("furo")
    environment = os.environ | {"PYTHON": sys.executable}
    subprocess.run([DOCS / "build", tmp_path / "site"], env=environment, check=True, timeout=600)
    for page in (tmp_path / "site").rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|img|iframe)[^>]* src="(?:https?:)?//', text), page
        assert not re.findall(r'<link[^>]* rel="stylesheet"[^>]* href="(?:https?:)?//', text), page


def test_sentences_of_the_readme_are_short():
    """At most 30 words; a semicolon or a colon ends none."""
    text = re.sub(r"```.*?```", "", README.read_text(encoding="utf-8"), flags=re.DOTALL)
    prose = "\n".join(line for line in text.splitlines() if not line.startswith(("|", "#", "    ", "!")))
    prose = re.sub(r"\]\([^)]*\)", "]", prose)
    for sentence in re.split(r"\.\s|\n\n|\n- ", prose):
        assert len(sentence.split()) <= 30, sentence


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


@pytest.mark.parametrize("document", DOCUMENTS, ids=named)
def test_links(document):
    text = document.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#]+)\)", text):
        if not link.startswith("http"):
            assert (document.parent / link).exists(), link
    for name in re.findall(r"`((?:benchmarks|tests|examples)/[\w/]+\.py)`", text) + re.findall(
        r"python (benchmarks/\w+\.py)", text
    ):
        assert (ROOT / name).is_file(), name
