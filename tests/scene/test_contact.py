"""Laws of contact: ranges, and the law between two surfaces."""

import coal
import numpy as np
import pytest

import ngalpha_pin as nga
from ngalpha_pin.scene.contact import ContactLaw, ContactPair, Hollow, combined_law


@pytest.mark.parametrize(
    "name, wrong",
    [("mu", -0.1), ("mu", np.inf), ("e_N", 1.1), ("e_N", -0.1), ("e_F", -1.1), ("contact_radius", np.nan)],
)
def test_ranges(name, wrong):
    with pytest.raises(nga.SceneError, match=f"{name} = "):
        ContactLaw(**{name: wrong})


def test_combined_law_is_symmetric():
    a, b = ContactLaw(0.4, 0.5, 0.2, 0.0), ContactLaw(0.9, 0.1, 0.3, 0.02)
    found = combined_law(a, b)
    assert found == combined_law(b, a) and found.mu == pytest.approx(0.6)
    assert (found.e_N, found.e_F, found.contact_radius) == (0.1, 0.2, 0.02)
    assert combined_law(a, a).mu == pytest.approx(0.4)


def test_pairs_have_no_order():
    assert ContactPair("a", "b", ContactLaw()).key == ContactPair("b", "a", ContactLaw(mu=1.0)).key


def test_hollow_shapes():
    Hollow(coal.Sphere(1.0)), Hollow(coal.Cylinder(1.0, 2.0))
    with pytest.raises(nga.SceneError, match="not Box"):
        Hollow(coal.Box(1.0, 1.0, 1.0))
