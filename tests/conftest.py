"""What the tests of left-out work share, and the start of each test."""

import pinocchio as pin
import pytest


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    """What Pinocchio draws is the same, whatever tests have run before."""
    pin.seed(0)


@pytest.fixture
def count(monkeypatch):
    """Counts the calls of a function from now on."""

    def counted(owner, name):
        calls, original = [], getattr(owner, name)

        def wrapper(*args, **kwargs):
            calls.append(name)
            return original(*args, **kwargs)

        monkeypatch.setattr(owner, name, wrapper)
        return calls

    return counted
