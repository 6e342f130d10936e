"""Tolerances have one name and one place each."""

import ast
from pathlib import Path

import pytest

import ngalpha_pin as nga
from ngalpha_pin.common import tolerances

HERE = Path(nga.__file__).parent
# numbers of their own on purpose: what the rest is held against, and what sees public names alone
OWN = {"oracle", "references", "viz", "robots", "simulators"}


def assigned(file):
    """Names of numbers that a file gives, and the numbers as they are written."""
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                several = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
                names = target.elts if several else [target]
                values = node.value.elts if several else [node.value]
                for name, value in zip(names, values, strict=True):
                    if isinstance(name, ast.Name) and name.id.isupper():
                        yield name.id, ast.unparse(value)


def files():
    for file in sorted(HERE.rglob("*.py")):
        if file != Path(tolerances.__file__) and not OWN & set(file.relative_to(HERE).parts):
            yield file


def test_shared_numbers_are_given_once():
    """A file that gives a shared name its shared value again should import it; TINY is written nowhere else."""
    shared = dict(assigned(Path(tolerances.__file__)))
    again = [f"{file.name}: {name}" for file in files() for name, value in assigned(file) if shared.get(name) == value]
    assert again == []
    tiny = [file.name for file in files() if "1e-300" in file.read_text(encoding="utf-8")]
    assert tiny == []


@pytest.mark.parametrize("name", [name for name, _ in assigned(Path(tolerances.__file__))])
def test_every_shared_number_has_its_reason(name):
    body = ast.parse(Path(tolerances.__file__).read_text(encoding="utf-8")).body
    places = [i for i, node in enumerate(body) if isinstance(node, ast.Assign) and node.targets[0].id == name]
    reason = body[places[0] + 1]
    assert isinstance(reason, ast.Expr) and len(reason.value.value) > 30


def test_order_of_gaps():
    """What assembly leaves is closed, and what is left out at a start overlaps less than what is refused."""
    assert tolerances.ASSEMBLED < tolerances.CLOSED < tolerances.OVERLAP < tolerances.PENETRATION
