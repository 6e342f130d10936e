"""The step of the paper as one would write it on a blackboard, in dense numpy, one contact at a time.

G. Capobianco, J. Harsch, S. R. Eugster, R. I. Leine: A nonsmooth generalized-alpha method for mechanical systems with
frictional contact, International Journal for Numerical Methods in Engineering 122 (2021) 6497-6526,
doi:10.1002/nme.6801. Equation numbers are those of the paper.

It is for reading, for trying another law, and for holding a faster implementation against: every function depends on
its arguments alone, and nothing but declarations is shared with the rest of the package. It runs the six systems of the
paper, and slowly: the Jacobian comes from differences.

    from ngalpha_pin import oracle, robots

    scene, q0, v0 = robots.load("rotating_ball")
    run = oracle.simulate(scene, q0, v0, t_end=1.0, dt=1e-2, laws="paper")       # run.t, .q, .v, .a, .P_N, .P_F, ...

    problem = oracle.problem_of(scene)
    step = oracle.make_step(problem, oracle.Parameters(), run.states[50], 1e-2, np.ones(1, dtype=bool), "paper")
    oracle.residual(step, x), oracle.jacobian(step, x)                           # R and dR/dx at any x

Read in this order:

    kinematics.py   contacts (148)-(157) and constraints (153) to second order
    laws.py         the laws of one contact (128)-(142): change these to try others
    equations.py    R(x) (126), (127), and its Jacobian
    solvers.py      Newton's method (143) and fixed-point iterations (146)
    impact.py       impacts (43)-(53) and consistent forces (52), (60)
    steps.py        a step, with the impacts in it, and what is done where Newton's method runs in circles
    run.py          a motion
    problem.py      what is read of a scene

Two things are not of the paper: positions are updated on the Lie group, q_(i+1) = q_i (+) dq, so that quaternions stay
unit ones where (125) needs a normalisation; and `laws="second-order"`, with impacts at their own moment (see `laws` and
`steps`). xi_N and xi_F (44), (48) take the velocity of the start with the directions of the start, where (88) takes
those of the end.
"""

from ngalpha_pin.oracle.equations import (
    Parameters,
    State,
    Step,
    contact_sets,
    end_of_step,
    jacobian,
    make_step,
    residual,
)
from ngalpha_pin.oracle.run import Run, problem_of, simulate

__all__ = [
    "Parameters",
    "Run",
    "State",
    "Step",
    "contact_sets",
    "end_of_step",
    "jacobian",
    "make_step",
    "problem_of",
    "residual",
    "simulate",
]
