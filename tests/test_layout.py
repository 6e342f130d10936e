"""A module's tests are found by its name."""

import ast
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parent
# packages by the folder of their sources
SOURCES = {"ngalpha_pin": "ngalpha_pin", "ngalpha_pin.robots": "robots", "ngalpha_pin.viz": "viz"}


def modules():
    """Every module with code, as its dotted name and the test file that its name asks for."""
    for package, folder in SOURCES.items():
        for file in sorted((ROOT / folder).rglob("*.py")):
            inner = file.relative_to(ROOT / folder).with_suffix("")
            if file.name in ("__init__.py", "__main__.py"):
                continue
            folder_of_tests = Path(*package.split(".")[1:]) / inner.parent
            yield ".".join((package, *inner.parts)), folder_of_tests / f"test_{inner.name.lstrip('_')}.py"


def imported(file):
    """Dotted names that a test file imports, names within modules included."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.skipif(not (ROOT / "pyproject.toml").is_file(), reason="the sources are not beside the tests")
def test_every_module_is_tested_by_name():
    names = {name for file in HERE.rglob("test_*.py") for name in imported(file)}
    missing = [
        f"{module}: no tests/{file}, and no test imports it"
        for module, file in modules()
        if not (HERE / file).is_file() and module not in names
    ]
    assert missing == []


@pytest.mark.skipif(not (ROOT / "pyproject.toml").is_file(), reason="the sources are not beside the tests")
def test_test_files_stand_in_the_folder_of_what_they_test():
    packages = {Path(*module.split(".")[1:]).parent for module, _ in modules()} | {Path("robots"), Path("viz")}
    strays = [f for f in HERE.rglob("test_*.py") if f.parent != HERE and f.parent.relative_to(HERE) not in packages]
    assert strays == []
