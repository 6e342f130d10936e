"""The machine of a report, and its unit of time."""

from ngalpha_pin.report.machine import machine, solve_time


def test_what_is_said():
    said = machine()
    assert set(said) == {"processor", "cores", "load", "system"} and all(said.values())
    assert "pin " in said["system"] and "numpy " in said["system"]


def test_unit_grows_with_the_size():
    small, large = (solve_time(n, calls=50, repeats=5)[0] for n in (10, 80))
    assert 0.0 < small < large
