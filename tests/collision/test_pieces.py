"""What of boxes and cells that touch each other is surface: faces, parts of edges and corners, one by one."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from ngalpha_pin.collision.pieces import exposed
from ngalpha_pin.collision.shapes import solid
from ngalpha_pin.scene.height_field import prisms

X, Y, Z = np.eye(3)


def boxes(*places):
    """Boxes between two corners each, as pieces of one body."""
    found = []
    for low, high in places:
        low, high = np.array(low, dtype=float), np.array(high, dtype=float)
        pose = pin.SE3(np.eye(3), 0.5 * (low + high))
        found.append(solid(pin.GeometryObject("box", 0, pose, coal.Box(*(high - low)))))
    return exposed(found)


def field(heights, size):
    return exposed([solid(pin.GeometryObject("cell", 0, pin.SE3.Identity(), shape)) for _, shape in
                    prisms(np.array(heights, dtype=float), size, None)])  # fmt: skip


def covered(piece):
    """Normals of the faces that are none, rounded."""
    return sorted(np.round(piece.normals[~piece.exposed.faces]).astype(int).tolist())


def felt(piece, p, n):
    n = np.array(n, dtype=float)
    return piece.exposed.native.felt(np.array(p, dtype=float), n / np.linalg.norm(n))


@pytest.mark.parametrize("off", [0.0, 1e-12, -1e-12])
def test_flush_tiles_have_no_seam(off):
    """The sides between them are covered, the edges there are none, nor the corners, in whatever direction."""
    a, b = boxes(([-1, 0, -1], [0, 1, 0]), ([0, 0, -1], [1, 1, off]))
    assert covered(a) == [[1, 0, 0]] and covered(b) == [[-1, 0, 0]]
    for n in (Z, X, [1, 0, 1], [1e-6, 0, 1]):
        assert not felt(a, [0, 0.5, 0], n) and not felt(a, [0, 0, 0], n) and not felt(a, [0, 1, 0], [1, 1, 1])
    for n in (Y, Z, [0, 1, 1]):
        assert felt(a, [-0.5, 1, 0], n)  # the border stays
    assert felt(a, [-1, 0, 0], [-1, -1, 1]) and felt(a, [-0.5, 0.5, 0], Z)
    assert b.exposed.shift == pytest.approx(abs(off), abs=1e-15)
    np.testing.assert_array_equal(a.offsets[a.normals @ Z > 0.5], b.offsets[b.normals @ Z > 0.5])


def test_tiles_of_different_heights_have_a_step():
    high, low = boxes(([-1, 0, -1], [0, 1, 0.1]), ([0, 0, -1], [1, 1, 0]))
    assert covered(high) == [] and covered(low) == [[-1, 0, 0]]
    assert felt(high, [0, 0.5, 0.1], [1, 0, 1]) and felt(high, [0, 0, 0.1], [1, -1, 1])
    assert not felt(low, [0, 0.5, 0], [-1, 0, 1]) and not felt(low, [0, 0, 0], [-1, -1, 1])
    # what is off by more than what is flush is a step as well, however low
    high, low = boxes(([-1, 0, -1], [0, 1, 1e-6]), ([0, 0, -1], [1, 1, 0]))
    assert covered(high) == [] and felt(high, [0, 0.5, 1e-6], [1, 0, 1])


def test_an_edge_that_neighbours_cover_in_part():
    """A tile beside two that stand back from its corner: its edge stays where nothing is."""
    tile, other = boxes(([-1, 0, -1], [0, 2, 0]), ([0, 0.5, -1], [1, 1.5, 0]))
    assert covered(tile) == [] and covered(other) == [[-1, 0, 0]]
    assert felt(tile, [0, 0.25, 0], [1, 0, 1]) and felt(tile, [0, 1.75, 0], [1, 0, 1])
    assert not felt(tile, [0, 1.0, 0], [1, 0, 1])
    # the edge along which the sides meet is concave
    assert not felt(other, [0, 0.5, -0.5], [-1, -1, 0])


def test_pieces_that_overlap():
    a, b = boxes(([-1, 0, -1], [0.2, 1, 0]), ([-0.2, 0, -1], [1, 1, 0]))
    assert covered(a) == [[1, 0, 0]] and covered(b) == [[-1, 0, 0]]
    assert not felt(a, [0.2, 0.5, 0], [1, 0, 1]) and not felt(a, [0.2, 0, 0], [1, -1, 1])


def test_a_wall_on_a_floor():
    """The bottom of the wall is covered; the edges between both are concave and none."""
    floor, wall = boxes(([-1, -1, -1], [1, 1, 0]), ([0, -0.5, 0], [0.1, 0.5, 1]))
    assert covered(floor) == [] and covered(wall) == [[0, 0, -1]]
    assert not felt(wall, [0, 0, 0], [-1, 0, 1]) and felt(wall, [0, 0, 1], [-1, 0, 1])
    assert not felt(wall, [0, 0.5, 0], [-1, 1, 1]) and felt(wall, [0, 0.5, 0.5], [-1, 1, 0])


def test_ridges_of_a_field_are_felt_between_the_normals_of_their_slopes_and_valleys_are_not():
    up, down = field([[0, 0], [0.2, 0.2], [0, 0]], (2.0, 1.0))
    slopes = [[-0.2, 0, 1], [0.2, 0, 1]]
    for piece in (up, down):
        for n, there in (
            ([0, 0, 1], True),
            (slopes[0], True),
            (slopes[1], True),
            ([-0.21, 0, 1], False),
            ([0.21, 0, 1], False),
        ):
            assert felt(piece, [0, 0, 0.2], n) == there
    for piece in field([[0.2, 0.2], [0, 0], [0.2, 0.2]], (2.0, 1.0)):
        assert not any(felt(piece, [0, 0, 0], n) for n in ([0, 0, 1], [0.1, 0, 1], [-0.1, 0, 1]))


def test_shapes_that_touch_nothing_are_as_they_were():
    a, b = boxes(([-1, 0, -1], [0, 1, 0]), ([0.01, 0, -1], [1, 1, 0]))
    assert a.exposed is None and b.exposed is None
