"""Tolerances have one name and one place each."""

import ast
from functools import cache
from pathlib import Path

import pytest

import ngalpha_pin as nga
from ngalpha_pin.common import tolerances

HERE = Path(nga.__file__).parent
# numbers of their own on purpose: what the rest is held against, and what sees public names alone
OWN = {"oracle", "references", "viz", "robots", "simulators"}
# what judges, or is an example: its bounds are part of what it says
JUDGES = {"report", "gym", "cli"}


@cache
def parsed(file):
    return ast.parse(file.read_text(encoding="utf-8"))


def assigned(file):
    """Names of numbers that a file gives, and the numbers as they are written."""
    for node in parsed(file).body:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                several = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
                names = target.elts if several else [target]
                values = node.value.elts if several else [node.value]
                for name, value in zip(names, values, strict=True):
                    if isinstance(name, ast.Name) and name.id.isupper():
                        yield name.id, ast.unparse(value)


def files(without=frozenset()):
    for file in sorted(HERE.rglob("*.py")):
        if file != Path(tolerances.__file__) and not (OWN | without) & set(file.relative_to(HERE).parts):
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
    body = parsed(Path(tolerances.__file__)).body
    places = [i for i, node in enumerate(body) if isinstance(node, ast.Assign) and node.targets[0].id == name]
    reason = body[places[0] + 1]
    assert isinstance(reason, ast.Expr) and len(reason.value.value) > 30


def test_order_of_gaps():
    """What assembly leaves is closed, and what is left out at a start overlaps less than what is refused."""
    assert tolerances.ASSEMBLED < tolerances.CLOSED < tolerances.OVERLAP < tolerances.PENETRATION


def in_functions(file):
    """Numbers in the bodies of functions, not those that are defaults."""
    for function in ast.walk(parsed(file)):
        if isinstance(function, (ast.FunctionDef, ast.Lambda)):
            body = function.body if isinstance(function, ast.FunctionDef) else [function.body]
            for node in (node for line in body for node in ast.walk(line)):
                if isinstance(node, ast.Constant) and isinstance(node.value, float):
                    yield node.value, node.lineno


def test_no_function_has_a_tolerance_without_a_name():
    """A number below 1e-4 is a tolerance: it is given once, above the functions, with its reason."""
    found = [
        f"{file.name}:{line}: {value}"
        for file in files(JUDGES)
        for value, line in in_functions(file)
        if 0 < value < 1e-4
    ]
    assert found == []


def told(lines, node, after):
    """A reason stands beside an assignment: above it, behind it, or as a string below it."""
    above, behind = lines[node.lineno - 2].startswith("#"), "#" in lines[node.end_lineno - 1]
    return above or behind or (isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant))


def test_every_threshold_has_its_reason():
    """Numbers alone: tables of coefficients, parts of arrays and what is put together of names say what they are."""
    untold, pieces = [], (ast.Constant, ast.UnaryOp, ast.USub, ast.Tuple, ast.Load, ast.BinOp, ast.operator)
    for file in files(JUDGES):
        lines, body = file.read_text(encoding="utf-8").splitlines(), parsed(file).body
        for node, after in zip(body, [*body[1:], None], strict=True):
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], (ast.Name, ast.Tuple)):
                parts = list(ast.walk(node.value))
                numbers = [p.value for p in parts if isinstance(p, ast.Constant)]
                threshold = numbers and all(type(n) in (int, float) for n in numbers)
                if threshold and all(isinstance(p, pieces) for p in parts) and not told(lines, node, after):
                    untold.append(f"{file.name}: {ast.unparse(node)}")
    # the version of a format, which its file explains
    assert untold == ["trajectory_file.py: FORMAT = 8"]
