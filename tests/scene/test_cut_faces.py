"""Parts that were cut with some rounding get their faces back; closed forms of boxes and prisms."""

import numpy as np
from scipy.spatial import ConvexHull

from ngalpha_pin.scene.cut_faces import on_faces


def corners(low, high):
    return np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])


def mesh_of(points):
    return points, ConvexHull(points).simplices


def test_faces_that_are_nearly_those_of_the_mesh_are_put_on_them():
    """Two halves of a cube, with slivers of 5e-5 missing on all sides and between them."""
    mesh, sliver = mesh_of(corners([0, 0, 0], [1, 1, 1])), 5e-5
    parts = [
        corners([sliver, 0, sliver], [0.5 - 0.5 * sliver, 1.0 - sliver, 1.0]),
        corners([0.5 + 0.5 * sliver, sliver, 0], [1.0, 1.0, 1.0 - sliver]),
    ]
    left, right = on_faces(parts, *mesh)
    cut = left[:, 0].max()
    assert abs(cut - 0.5) < sliver and right[:, 0].min() == cut  # on one plane
    np.testing.assert_array_equal([left.min(axis=0), left.max(axis=0)[1:].tolist() + [0.0]], [[0, 0, 0], [1, 1, 0]])
    np.testing.assert_array_equal([right.min(axis=0)[1:], right.max(axis=0)[1:]], [[0, 0], [1, 1]])
    assert len(left) == len(right) == 8


def test_a_cut_that_passes_an_edge_closely_goes_through_it():
    """A prism with a roof is cut beside its ridge, by a plane that is tilted; a corner of the cut is taken off."""
    outline = np.array([[-1.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 1.0], [-1.0, 0.5]])
    points = np.array([[x, y, z] for y in (0.0, 1.0) for x, z in outline])
    half = np.array([[x, y, z] for y in (0.0, 1.0) for x, z in ((-1.0, 0.0), (3e-5, 0.0), (5e-5, 1.0), (-1.0, 0.5))])
    half[6] = [5e-5, 1.0 - 1e-4, 1.0]
    half = np.vstack((half, [5e-5, 1.0, 1.0 - 5e-5]))
    (found,) = on_faces([half], *mesh_of(points))
    assert len(found) == 8
    ridge = found[found[:, 2] > 0.9]
    np.testing.assert_allclose(ridge[np.argsort(ridge[:, 1])], [[0, 0, 1], [0, 1, 1]], atol=1e-15)
    assert abs(ConvexHull(found).volume - 0.75) < 1e-4


def test_a_part_as_thin_as_the_slivers_stays_as_it_is():
    part = corners([0, 0, 0.5], [1, 1, 0.5 + 1e-5])
    (found,) = on_faces([part], *mesh_of(corners([0, 0, 0], [1, 1, 1])))
    np.testing.assert_array_equal(np.sort(found, axis=0), np.sort(part, axis=0))
