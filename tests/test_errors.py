"""Errors say what is wrong and what to do, and can be caught as one family."""

import pytest

from ngalpha_pin.errors import NgalphaError, NotConverged, Penetration, SceneError, UnknownName


def test_one_family():
    assert issubclass(SceneError, ValueError)
    assert all(issubclass(error, NgalphaError) for error in (SceneError, UnknownName, Penetration, NotConverged))
    assert NotConverged("no", 0.5, ("a/b",)).contacts == ("a/b",)
    assert NotConverged("no", 0.5).trajectory is None


@pytest.mark.parametrize(
    "known, hint",
    [
        (["left_foot", "right_foot"], "did you mean 'left_foot'"),
        ([f"link{i}" for i in range(20)], "known: link0, .*link11 and 8 more$"),
        ([], "known: none"),
    ],
)
def test_unknown_names_suggest_others(known, hint):
    with pytest.raises(SceneError, match=f"no geometry named 'left_fot'; {hint}"):
        raise UnknownName("geometry", "left_fot", iter(known))
