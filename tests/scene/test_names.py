"""Patterns of names."""

import pytest

from ngalpha_pin.errors import UnknownName
from ngalpha_pin.scene.names import matching

NAMES = ["LF_FOOT", "RF_FOOT", "base", "foot*"]


def test_a_name_itself_comes_before_a_pattern():
    assert matching("geometry", "foot*", NAMES) == ["foot*"]
    assert matching("geometry", "?F_FOOT", NAMES) == ["LF_FOOT", "RF_FOOT"]


def test_case_matters_only_where_a_name_is_exact():
    with pytest.warns(UserWarning, match="LF_FOOT, RF_FOOT only without regard to case"):
        assert matching("geometry", "*_foot", NAMES) == ["LF_FOOT", "RF_FOOT"]


def test_the_error_names_what_is_near_and_how_many_there_are():
    with pytest.raises(UnknownName, match=r"no geometry named 'bse'; did you mean 'base'"):
        matching("geometry", "bse", NAMES)
