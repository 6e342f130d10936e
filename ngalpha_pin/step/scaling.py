"""Scales of a step: its unit of force, and what makes tolerances and rows the same in any units."""

from __future__ import annotations

import numpy as np

from ngalpha_pin.common.tolerances import ROUNDING
from ngalpha_pin.constraints.constraint_set import ConstraintRows
from ngalpha_pin.numerics.block_matrix import solve
from ngalpha_pin.step import newton_matrix
from ngalpha_pin.step.evaluation import Evaluation
from ngalpha_pin.step.protocol import Equations, Scales

SMALLEST = 1e-200  # force unit of a step in which nothing moves
ALPHA_R = 0.3  # prox parameter r_k = ALPHA_R / (w_k^T M^-1 w_k)
IMMOVABLE = 1e-8  # inverse mass of a tangent, relative to its contact, below which nothing moves along it


def scales(equations: Equations, ev: Evaluation, by_M: np.ndarray) -> Scales:
    """Scales of all rows and the prox parameters; by_M is M^-1 W, shape (nv, rows).

    With the force unit f a contact row w, of the inverse mass G = w M^-1 w^T, has the unit of acceleration sqrt(G) f
    and the unit of force f / sqrt(G), in any units.
    """
    tol, dt, dynamics, system = equations.parameters.tol, equations.dt, ev.dynamics, equations.system
    root_M = np.sqrt(dynamics.M.diagonal())
    f = force_unit(equations, ev, root_M)
    rounding = ROUNDING * system.rounding(equations.state.q, dynamics, equations.state.actuation)
    if equations.n == 0:
        nothing = np.zeros(0)
        return Scales(1.0 / (tol * f * root_M + rounding), *6 * (nothing,))
    layout = equations.layout
    G = _inverse_masses(equations, ev, by_M)
    r = ALPHA_R / G
    if layout.f:  # a damper or a stiff servo resists more than the mass: slip that starts is slow
        W = ev.W[layout.friction]
        soft = np.einsum("ij,ji->i", W, solve(newton_matrix.stiffness(equations, ev)[0], W.T))
        hard = ALPHA_R / np.where(soft > 0.0, np.minimum(soft, G[layout.friction_v]), G[layout.friction_v])
        r[layout.friction_v] = r[layout.friction_a] = hard
    root, level = np.sqrt(G), np.array([1.0, dt, dt * dt])[layout.levels]
    prescribed = slice(layout.friction_a.stop, None)  # a motion that is prescribed may be all that moves
    f = max(f, float((np.abs(ev.y) / (level * root))[prescribed].max(initial=0.0)))
    by_dof = np.array([[1.0], [1.0 / dt], [1.0 / (dt * dt)]]) / (tol * f * root_M + rounding)
    sizes = np.array([part.sizes for part in ev.parts]).max(axis=0)
    floor = ROUNDING * np.array([0.0, sizes[1], sizes[0]])[layout.levels]
    if isinstance(ev.parts[-1], ConstraintRows):
        own = layout.scale_rows - layout.constraints.start
        floor += np.where(own >= 0, ev.parts[-1].noise[layout.levels, np.maximum(own, 0)], 0.0)
    row, column = 1.0 / (level * root), level / root
    return Scales(by_dof, 1.0 / (tol * f / row + floor), 1.0 / (tol * f * column), r, f / root[: layout.k], row, column)


def _inverse_masses(equations: Equations, ev: Evaluation, by_M: np.ndarray) -> np.ndarray:
    """W M^-1 W^T of each multiplier's row, shape (n,) [1/kg]."""
    layout, sub = equations.layout, equations.sub
    G = np.einsum("ij,ji->i", ev.W, by_M)
    if layout.rows > layout.constraints.start:
        G[layout.constraints] = equations.system.constraints.by_group(G[layout.constraints])
    k, m, cones = sub.k, sub.m, sub.cones
    if m:  # where the bodies cannot move along a tangent, its scale is that of the contact
        largest = G[:k][cones.contact]
        np.maximum.at(largest, cones.of_row, G[k : k + m])
        G[k : k + m] = np.maximum(G[k : k + m], IMMOVABLE * largest[cones.of_row])
    return G[layout.scale_rows]


def force_unit(equations: Equations, ev: Evaluation, root_M: np.ndarray) -> float:
    """What a typical force of the step is, in kinetic scaling [sqrt(kg) m/s^2].

    The largest of weight, h, dry friction, inertia, and what the rounding of the velocities amounts to.
    """
    a, friction = ev.x[: equations.nv], equations.system.joint_friction
    h = ev.dynamics.residual - ev.dynamics.M @ a
    rounding = ROUNDING / (equations.parameters.tol * equations.dt)
    f = max(
        equations.system.weight,
        float((np.abs(h) / root_M).max()),
        float((root_M * np.maximum(np.abs(a), rounding * np.abs(ev.v))).max()),
        SMALLEST,
    )
    if friction.f:
        f = max(f, float((np.maximum(friction.upper, -friction.lower) / root_M[friction.dofs]).max()))
    return f
