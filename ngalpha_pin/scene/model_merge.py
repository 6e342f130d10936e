"""One `pin.Model` from others: joints in a row branch by branch, with everything that a model says of them."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import pinocchio as pin

OF_Q = ("lowerPositionLimit", "upperPositionLimit")
OF_V = (
    "armature", "damping", "rotorInertia", "rotorGearRatio", "lowerEffortLimit", "upperEffortLimit",
    "lowerVelocityLimit", "upperVelocityLimit", "lowerDryFrictionLimit", "upperDryFrictionLimit",
)  # fmt: skip

Joint = tuple[int, int]
"""Number of a model, and of a joint in it."""


def merged(
    first: pin.Model, second: pin.Model | None, on: int, at: pin.SE3, prefix: str = "", without: Collection[int] = ()
) -> tuple[pin.Model, dict[Joint, int]]:
    """The first model with the second one on a joint of it, and which joint of the new model each joint became.

    Args:
        first: kept as it is.
        second: kept as well, or None.
        on: joint of the first model that carries the second one.
        at: pose of the world of the second model in the frame of that joint.
        prefix: of the names of the second model.
        without: joints of the first model that are left out, with all that they carry.
    """
    models = [first] if second is None else [first, second]
    order = _order(first, second, on, without)
    found = pin.Model()
    found.name, found.gravity = first.name, first.gravity
    place: dict[Joint, int] = {(0, 0): 0}
    for k, j in order:
        model = models[k]
        parent = (k, int(model.parents[j]))
        placement = model.jointPlacements[j]
        if k == 1 and parent[1] == 0:
            parent, placement = (0, on), at * placement
        name = (prefix if k else "") + model.names[j]
        place[k, j] = found.addJoint(place[parent], model.joints[j], placement, name)
        found.inertias[place[k, j]] = model.inertias[j]
    if second is not None:
        place[1, 0] = place[0, on]
        if on:
            found.appendBodyToJoint(place[0, on], second.inertias[0], at)
    _copy_properties(models, found, order, place)
    _copy_frames(models, found, place, at, prefix)
    _copy_references(models, found, order, place, prefix)
    return found, place


def _order(first: pin.Model, second: pin.Model | None, on: int, without: Collection[int]) -> list[Joint]:
    """Joints of the new model: the second one behind the branch of the joint that carries it."""
    gone = {int(j) for root in without for j in first.subtrees[root]}
    own = [(0, j) for j in range(1, first.njoints) if j not in gone]
    if second is None:
        return own
    last = max((int(j) for j in first.subtrees[on]), default=on) if on else first.njoints
    added = [(1, j) for j in range(1, second.njoints)]
    return [x for x in own if x[1] <= last] + added + [x for x in own if x[1] > last]


def _spans(model: pin.Model, joint: int) -> tuple[slice, slice]:
    q, v = model.idx_qs[joint], model.idx_vs[joint]
    return slice(q, q + model.nqs[joint]), slice(v, v + model.nvs[joint])


def _copy_properties(
    models: Sequence[pin.Model], found: pin.Model, order: Sequence[Joint], place: dict[Joint, int]
) -> None:
    for names, of in ((OF_Q, 0), (OF_V, 1)):
        for name in names:
            values = np.array(getattr(found, name))
            for k, j in order:
                values[_spans(found, place[k, j])[of]] = getattr(models[k], name)[_spans(models[k], j)[of]]
            setattr(found, name, values)


def _copy_frames(
    models: Sequence[pin.Model], found: pin.Model, place: dict[Joint, int], at: pin.SE3, prefix: str
) -> None:
    for k, model in enumerate(models):
        for frame in list(model.frames)[1:]:
            joint = place.get((k, int(frame.parentJoint)))
            if joint is None:
                continue
            placement = at * frame.placement if k and frame.parentJoint == 0 else frame.placement
            name = (prefix if k else "") + frame.name
            # inertias have been copied joint by joint
            found.addFrame(pin.Frame(name, joint, placement, frame.type), False)


def _copy_references(
    models: Sequence[pin.Model], found: pin.Model, order: Sequence[Joint], place: dict[Joint, int], prefix: str
) -> None:
    """Named configurations; what another model has no part in stands at its neutral position."""
    for k, model in enumerate(models):
        for item in model.referenceConfigurations:
            name, given = item.key(), np.array(item.data())
            key = (prefix if k else "") + name
            named = found.referenceConfigurations
            q = np.array(named[key]) if key in named else pin.neutral(found)
            for own, j in order:
                if own == k:
                    q[_spans(found, place[k, j])[0]] = given[_spans(model, j)[0]]
            found.referenceConfigurations[key] = q


def moved_geometries(
    geometries: pin.GeometryModel, place: dict[Joint, int], k: int, at: pin.SE3, prefix: str = ""
) -> list[pin.GeometryObject]:
    """Copies of geometries of model k on the joints of the new one; without those whose joint is gone."""
    found = []
    for geometry in geometries.geometryObjects:
        joint = place.get((k, int(geometry.parentJoint)))
        if joint is None:
            continue
        copied = geometry.copy()
        copied.name = prefix + geometry.name
        if k and geometry.parentJoint == 0:
            copied.placement = at * geometry.placement
        copied.parentJoint, copied.parentFrame = joint, 0
        found.append(copied)
    return found
