"""Laws of contact: ranges, and the law between two surfaces."""

import coal
import numpy as np
import pytest
from scipy.optimize import brentq

import ngalpha_pin as nga
from ngalpha_pin.scene.combined_law import combined_law
from ngalpha_pin.scene.contact import ContactLaw, ContactPair, Hollow


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


def test_restitution_of_two_surfaces():
    """The smaller one at each speed, by the law that one of them says; a number goes with any."""
    number, faster = ContactLaw(e_N=0.5), ContactLaw(e_N=lambda v: 0.9 / (1 + v))
    stronge, poisson = (ContactLaw(e_N=nga.Restitution(0.7, law)) for law in ("stronge", "poisson"))
    assert combined_law(number, stronge).restitution == nga.Restitution(0.5, "stronge")
    found = combined_law(number, faster)
    assert found == combined_law(number, faster) and found.restitution.law == "newton" and found.e_N == 0.5
    assert found.restitution(np.array([0.0, 0.5, 2.0])) == pytest.approx([0.5, 0.5, 0.3])
    with pytest.raises(nga.SceneError, match="'stronge' and the other one 'poisson'"):
        combined_law(stronge, poisson)


@pytest.mark.parametrize(
    "a, b",
    [
        (nga.KelvinVoigt(1e4, 20.0), nga.KelvinVoigt(3e4, 60.0)),
        (nga.HuntCrossley(1e6, 1e-3), nga.HuntCrossley(4e6, 2e-3)),
        (nga.HuntCrossley(1e6, 0.0, 2.0), nga.HuntCrossley(2e5, 0.0, 2.0)),
    ],
)
def test_two_compliances_carry_one_force(a, b):
    """Of the second one the damping is not one law in a row; it is to first order."""
    law = combined_law(ContactLaw(compliance=a), ContactLaw(compliance=b, rolling_resistance=0.0)).compliance
    assert law == combined_law(ContactLaw(compliance=b), ContactLaw(compliance=a)).compliance
    force = law(np.array([1e-3]), np.array([0.1]))[0][0]

    def rest(part):
        return a(np.array([part * 1e-3]), np.array([part * 0.1]))[0][0] - force

    part = brentq(rest, 0.0, 1.0)
    other = b(np.array([(1 - part) * 1e-3]), np.array([(1 - part) * 0.1]))[0][0]
    assert other == pytest.approx(force, rel=1e-7)


def test_compliance_of_surfaces():
    rigid, soft, hertz = ContactLaw(e_N=0.5), ContactLaw(compliance=nga.KelvinVoigt(1e4)), nga.HuntCrossley(1e6)
    assert combined_law(rigid, soft).compliance == soft.compliance and combined_law(rigid, soft).e_N == 0.0
    with pytest.raises(nga.SceneError, match="not one law in a row"):
        combined_law(soft, ContactLaw(compliance=hertz))
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    scene.set_surface("*", mu=0.5, e_N=0.5, rolling_resistance=1e-3)
    scene.set_surface("ground", e_N=nga.Restitution(0.3, "stronge"))
    law = scene.add_contact("ball", "ground", compliance=hertz, rolling_resistance=0.0)[0].law
    assert law.compliance == hertz and law.e_N == 0.0 and law.restitution is None


def test_pairs_print_what_was_given():
    scene = nga.Scene()
    scene.add_plane("ground")
    scene.add_body("ball", coal.Sphere(0.1), mass=1.0)
    scene.add_contact("ball", "ground", mu=0.3, e_N=nga.Restitution(0.5, "poisson"), adhesion=2.0)
    restitution = nga.Restitution(0.5, "poisson")
    assert repr(scene.contacts) == f"[ContactPair('ball', 'ground', mu=0.3, e_N={restitution!r}, adhesion=2.0)]"
    assert repr(nga.ContactLaw()) == "ContactLaw(mu=0.0, e_N=0.0)"
    assert repr(nga.ContactLaw(mu=nga.FrictionEllipse(0.2, 0.5))).startswith("ContactLaw(mu=FrictionEllipse(")


def test_a_scene_says_its_name_where_it_has_one():
    scene = nga.Scene()
    assert repr(scene).startswith("Scene(nq=0, ")
    scene.model.name = "cart"
    assert repr(scene).startswith("Scene('cart', nq=0, ")
