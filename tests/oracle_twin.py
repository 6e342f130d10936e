"""The oracle beside the package: states, friction velocities and unknowns of one in the order of the other."""

import numpy as np

import ngalpha_pin as nga
from ngalpha_pin import oracle, robots
from ngalpha_pin.oracle.kinematics import Motion
from ngalpha_pin.system.system import System


class Twin:
    """A system of the paper in both.

    Attributes:
        signs: friction velocities of the oracle times these are those of the package, shape (n_F,).
    """

    def __init__(self, name, fall=0.0, **parameters):
        self.scene, self.q0, self.v0 = robots.load(name, **parameters)
        if fall:  # of a hopper, as one body
            self.v0[0], self.v0[3::2] = -fall, -fall
        self.problem, self.system = oracle.problem_of(self.scene), System(self.scene)
        self.every = self.system.contacts.subset(np.arange(self.system.contacts.n))
        v = np.random.default_rng(1).normal(size=self.problem.nv)
        ours = np.concatenate([c.gamma_F for c in Motion(self.problem, 0.0, self.q0, v, v).contacts])
        theirs = self.system.contact_rates(self.every, self.q0, v)[self.every.k :]
        self.signs = np.sign(ours * theirs)
        assert np.allclose(ours * self.signs, theirs)

    def run(self, steps, dt, rho_inf, laws, first=0):
        """Both runs over so many steps; the oracle starts from the package's state after the first ones."""
        method = nga.GeneralizedAlpha(rho_inf, laws=laws, tol=1e-13)
        simulator = nga.Simulator(self.scene, dt, method)
        state = simulator.initial_state(self.q0, self.v0)
        for _ in range(first):
            state = simulator.step(state)
        t_end = (first + steps) * dt
        theirs = nga.simulate(self.scene, state=state, t_end=t_end, dt=dt, method=method)
        start = self.state(state) if first else None
        ours = oracle.simulate(
            self.problem, self.q0, self.v0, t_end=t_end, dt=dt, rho_inf=rho_inf, laws=laws, state=start
        )
        return ours, theirs

    def state(self, state):
        """A state of the package as one of the oracle."""
        sub, bar = self.system.contacts.subset(state.contacts), state.auxiliary

        def all_of(name):
            whole = np.zeros(self.every.m if "_F" in name else self.every.k)
            whole[sub.rows_F if "_F" in name else sub.index] = getattr(bar if "bar" in name else state, name)
            return whole * self.signs if "_F" in name else whole

        names = ("la_N", "la_N_bar", "la_F", "la_F_bar", "P_N", "P_F", "La_N", "La_F")
        arrays = {name: all_of(name) for name in names}
        la_g = np.zeros(len(self.problem.rows))  # only a first guess: no law looks at them
        return oracle.State(state.t, state.q, state.v, state.a, bar.a_bar, la_g=la_g, dt=state.dt, **arrays)

    def differences(self, ours, theirs):
        """Largest difference of each quantity, absolute and in parts of its largest value."""
        pairs = {name: (getattr(ours, name), getattr(theirs, name)) for name in ("q", "v", "a", "P_N", "la_N")}
        pairs |= {name: (getattr(ours, name) * self.signs, getattr(theirs, name)) for name in ("P_F", "la_F")}
        found = {}
        for name, (x, y) in pairs.items():
            assert x.shape == y.shape and np.isfinite(x).all()
            error = float(np.abs(x - y).max(initial=0.0))
            found[name] = error, error / max(float(np.abs(y).max(initial=0.0)), 1e-300)
        return found
