"""Which geoms of a compiled MJCF model may touch, and with which friction: its rules, in its order.

With condim 3 friction is Coulomb's. Condim 4 adds torsion: MuJoCo's elliptic cone |F|^2 / slide^2 + M^2 / torsion^2 <=
N^2 is that of Coulomb-Contensou friction (157) with M <= 3 pi R / 16 slide N, so that R = 16 torsion / (3 pi slide).
Condim 6 adds rolling, |M| <= roll N, here with a cone of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ngalpha_pin.scene.contact import ContactLaw, ContactPair
from ngalpha_pin.scene.mjcf.compiler import disabled, mujoco, one_of


def surfaces(m: Any, names: dict[int, list[str]]) -> dict[str, ContactLaw]:
    """Friction of every geometry, for pairs that the user declares."""
    return {name: _law(max(int(m.geom_condim[g]), 3), m.geom_friction[g]) for g, of_g in names.items() for name in of_g}


def pairs(m: Any, names: dict[int, list[str]]) -> list[ContactPair]:
    """The pairs of <contact><pair/> with their own friction, then those that the masks of the geoms let touch."""
    found: list[ContactPair] = []
    if disabled(m, "CONTACT"):
        return found
    for g1, g2, law in [*_explicit(m), *_by_masks(m)]:
        found += [ContactPair(a, b, law) for a in names.get(g1, ()) for b in names.get(g2, ())]
    return found


def _law(condim: int, friction: np.ndarray) -> ContactLaw:
    """The law of a contact with (slide, torsion, roll), of which condim says how many count."""
    slide, torsion, roll = (float(x) for x in friction)
    if condim < 3:
        return ContactLaw(0.0)
    radius = 16.0 * torsion / (3.0 * np.pi * slide) if condim > 3 and slide > 0.0 else 0.0
    return ContactLaw(slide, contact_radius=radius, rolling_resistance=roll if condim > 4 else 0.0)


def _explicit(m: Any) -> Iterator[tuple[int, int, ContactLaw]]:
    for i in range(m.npair):
        law = _law(int(m.pair_dim[i]), m.pair_friction[i][[0, 2, 3]])
        yield int(m.pair_geom1[i]), int(m.pair_geom2[i]), law


def _by_masks(m: Any) -> Iterator[tuple[int, int, ContactLaw]]:
    bodies, moves = range(m.nbody), [False]
    for b in range(1, m.nbody):
        moves.append(moves[m.body_parentid[b]] or bool(m.body_dofnum[b]))
    explicit = {frozenset((int(a), int(b))) for a, b in zip(m.pair_geom1, m.pair_geom2, strict=True)}
    geoms = [range(m.body_geomadr[b], m.body_geomadr[b] + m.body_geomnum[b]) for b in bodies]
    excluded = {int(s) for s in m.exclude_signature}
    for b1 in bodies:
        for b2 in range(b1 + 1, m.nbody):
            still = not (moves[b1] or moves[b2])
            if still or (b1 << 16) + b2 in excluded or not _bodies_may_touch(m, b1, b2):
                continue
            for g1 in geoms[b1]:
                for g2 in geoms[b2]:
                    one_way = m.geom_contype[g1] & m.geom_conaffinity[g2]
                    if (one_way or m.geom_contype[g2] & m.geom_conaffinity[g1]) and (
                        frozenset((g1, g2)) not in explicit and not _both_unbounded(m, g1, g2)
                    ):
                        yield g1, g2, _friction(m, g1, g2)


def _bodies_may_touch(m: Any, b1: int, b2: int) -> bool:
    """Not of bodies that are welded to each other, nor of one and the one that carries it, but for the world."""
    w1, w2 = int(m.body_weldid[b1]), int(m.body_weldid[b2])
    if w1 == w2:
        return False
    p1, p2 = (int(m.body_weldid[m.body_parentid[w]]) for w in (w1, w2))
    carries = (w1 == p2 and w1 != 0) or (w2 == p1 and w2 != 0)
    return disabled(m, "FILTERPARENT") or not carries


def _both_unbounded(m: Any, g1: int, g2: int) -> bool:
    kinds = mujoco().mjtGeom
    return all(one_of(m.geom_type[g], kinds.mjGEOM_PLANE, kinds.mjGEOM_HFIELD) for g in (g1, g2))


def _friction(m: Any, g1: int, g2: int) -> ContactLaw:
    """That of the geom with priority, or the larger values of both."""
    first, second = int(m.geom_priority[g1]), int(m.geom_priority[g2])
    chosen = [g1, g2] if first == second else [g1 if first > second else g2]
    return _law(max(int(m.geom_condim[g]) for g in chosen), np.max([m.geom_friction[g] for g in chosen], axis=0))
