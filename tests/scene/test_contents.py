"""Words about what a file declares."""

import pytest

from ngalpha_pin.scene.contents import Contents, Entry, listed, warn_of


def test_one_warning_names_what_does_not_act_as_declared(recwarn):
    rows = [Entry("joints", 3, "used"), Entry("springs", 2, "left out", "no model"), Entry("cameras", 1, "no effect")]
    with pytest.warns(UserWarning) as caught:
        warn_of("robot.xml", [*rows, Entry("meshes", 4, "approximated", "hulls")])
    assert [str(w.message) for w in caught] == [
        "robot.xml: springs (2) left out: no model; meshes (4) approximated: hulls"
    ]
    warn_of("robot.xml", rows[::2])
    assert len(recwarn) == 0


def test_contents_print_a_line_for_each_kind():
    rows = Contents([Entry("joints", 3, "used"), Entry("joint stiffness", 12, "left out", "no model")])
    rows += [Entry("cameras", 1, "no effect")]
    assert str(rows).splitlines() == [
        "joints: 3            used",
        "joint stiffness: 12  left out: no model",
        "cameras: 1           no effect",
    ]
    assert str(Contents()) == "no file"


def test_a_long_list_says_how_many_more():
    assert listed("abcd") == "a, b, c, d" and listed("abcdef") == "a, b, c, d and 2 more"
