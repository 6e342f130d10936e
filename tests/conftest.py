"""What the tests of left-out work share."""

import pytest


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
