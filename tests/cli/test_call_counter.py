"""Calls of Pinocchio and coal are counted as long as the context lasts, and change nothing."""

import numpy as np
import pinocchio as pin

from ngalpha_pin.cli.call_counter import counted_calls


def test_counts():
    model = pin.buildSampleModelManipulator()
    data, q = model.createData(), pin.neutral(model)
    before = pin.computeJointJacobians
    with counted_calls() as counts:
        for _ in range(3):
            pin.computeJointJacobians(model, data, q)
        q = pin.integrate(model, q, np.ones(model.nv))
        pin.randomConfiguration(model) if np.isfinite(model.upperPositionLimit).all() else None
    assert pin.computeJointJacobians is before
    assert counts["pin.computeJointJacobians"] == 3 and counts["pin.integrate"] == 1
    pin.integrate(model, q, np.ones(model.nv))
    assert counts["pin.integrate"] == 1
