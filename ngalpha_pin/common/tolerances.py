"""Tolerances that several files share: one meaning, one name, one reason each.

Lengths are in parts of the size of the scene, or of the yardstick of a contact where it has one of its own; forces and
inverse masses relative to the largest of their kind.
"""

from __future__ import annotations

import numpy as np

TINY = 1e-300
"""What is divided by instead of zero: no number of a scene is that small in any units."""

ROUNDING = 64 * np.finfo(float).eps
"""What sums over a tree and its contacts lose: some tens of operations on numbers of one size."""

GRAVITY = 9.81
"""Acceleration on earth [m/s^2]: with sizes and masses it makes a speed and a force where nothing moves or presses."""

CLOSED = 1e-10
"""A gap that is none. Gaps are exact to 2e-12 m and steps leave some 1e-13; what is larger is meant."""

ASSEMBLED = 1e-12
"""What assembly leaves of a constraint and of a penetration: far inside of `CLOSED`, so that it is closed."""

BALANCED = 1e-9
"""A gap that is none in a static equilibrium: 1e-11 of the loads moves a soft mechanism by more than `CLOSED`."""

PENETRATION = 1e-9
"""Depth from which shapes penetrate: ten times what counts as closed, so that a start that was rounded is one."""

OVERLAP = 5e-10
"""Depth from which pairs that no one has named are left out: between `CLOSED` and `PENETRATION`."""

RECORDED = 1e-9
"""A gap of a recorded motion that is closed, and a speed that is none, in parts of the largest: ten times `CLOSED`, as
a run may have come from elsewhere."""

PARALLEL = 1e-12
"""What the cosine between two directions lacks where they are the same: they differ by 1.4e-6 rad, and rounding of unit
vectors makes 1e-16 of it."""

MISSED = 1e-10
"""Penetration of features that are in no place of a manifold: as `CLOSED`, or a corner would rest on nothing."""

MOVABLE = 1e-9
"""A direction can move when the mechanism moves it by more than this part of its largest way: a planar mechanism in
space leaves 1e-16 of its third direction, a real one more than 1e-6."""

CONE = 1e-9
"""A force on the edge of its cone, up to this part, belongs to it: what an iteration leaves."""

NO_FORCE = 1e-9
"""A contact force that is none, relative to the largest: as `CONE`, what an iteration leaves."""

STILL = 1e-8
"""Slip velocity, relative to the largest velocity, that is none where sweeps have converged."""

NO_DIRECTION = 5e-5
"""Slip velocity, in parts of the tolerance of a run of chosen accuracy, by which friction keeps its first direction: a
hundredth of what a smooth step may be off by, so that it does not count."""
