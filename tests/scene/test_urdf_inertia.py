"""Inertials of a URDF: what no body can have, and what cannot be read."""

from xml.etree import ElementTree

import pytest

from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.urdf_inertia import check_inertials, impossible_links


def robot(mass: str | None = "1", **inertia):
    entries = {"ixx": "1", "iyy": "1", "izz": "1"} | inertia
    said = " ".join(f'{key}="{value}"' for key, value in entries.items() if value is not None)
    weighs = "" if mass is None else f' value="{mass}"'
    return ElementTree.fromstring(
        f'<robot name="r"><link name="arm"><inertial><mass{weighs}/><inertia {said}/></inertial></link></robot>'
    )


@pytest.mark.parametrize(
    ("inertia", "odd"),
    [({"izz": "1.9999"}, False), ({"izz": "2.1"}, True), ({"ixy": "0.49"}, False), ({"ixy": "0.51"}, True)],
)
def test_triangle_inequality_and_sign_of_principal_moments(inertia, odd):
    # with ixy the principal moments are 1 - ixy, 1, 1 + ixy: a body has them up to ixy = 1 / 2
    assert impossible_links(robot(**inertia)) == (["arm"] if odd else [])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"mass": "${mass}"}, r"link 'arm': value='\$\{mass\}' in <mass>"), ({"mass": "-1"}, "must not be negative"),
        ({"mass": None}, r"link 'arm': value=None in <mass>"), ({"ixx": None}, "ixx=None in <inertia>"),
        ({"iyy": "nan"}, "iyy='nan'"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_names_the_link(given, words):
    with pytest.raises(SceneError, match=words):
        check_inertials("r.urdf", robot(**given))


def test_products_of_inertia_may_be_missing():
    check_inertials("r.urdf", robot())
