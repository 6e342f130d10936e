"""Stiffness of cross-sections against formulas and tables."""

import numpy as np
import pytest

import ngalpha_pin as nga


def test_sections_have_the_numbers_of_the_tables():
    circle = nga.Section.round(0.1, 2e11, 0.3, 7850)
    area = np.pi * 0.1**2
    assert np.allclose(
        np.diag(circle.stiffness)[[0, 3, 4]], [2e11 * area, 2e11 / 2.6 * np.pi / 2 * 1e-4, 2e11 * np.pi / 4 * 1e-4]
    )
    assert circle.stiffness[1, 1] == pytest.approx(2e11 / 2.6 * area * 6 * 1.3 / (7 + 1.8))
    ring = nga.Section.tube(0.1, 0.0999, 2e11, 0.3, 7850)
    area = np.pi * (0.1**2 - 0.0999**2)
    assert ring.stiffness[1, 1] == pytest.approx(
        2e11 / 2.6 * area * 2 * 1.3 / (4 + 0.9), rel=1e-3
    )  # thin: 2(1+nu)/(4+3nu)
    # Timoshenko, Goodier: torsion of a square 0.1406 a^4, of a plate one third
    for width, factor in ((1.0, 0.140577), (2.0, 0.228682 * 2), (10.0, 0.312 * 10)):
        section = nga.Section.rectangle(width, 1.0, 2.6, 0.3, 1.0)
        assert section.stiffness[3, 3] == pytest.approx(factor, rel=2e-3)
    flat = nga.Section.rectangle(0.04, 0.01, 2e11, 0.3, 7850)
    assert np.allclose(np.diag(flat.stiffness)[4:], [2e11 * 0.04 * 0.01**3 / 12, 2e11 * 0.01 * 0.04**3 / 12])
