"""Position and velocity gains of the joints about a motion that may be given over time."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError
from ngalpha_pin.scene.breakpoints import as_polynomials, checked_breakpoints, knots
from ngalpha_pin.scene.forces import without_model
from ngalpha_pin.scene.protocols import Declared, Kinematics
from ngalpha_pin.scene.user_function import array_of, called

# an array, a function of time, or a spline of scipy.interpolate
Given = Any


class JointPD:
    """Proportional-derivative law of the actuated joints, tau = kp (q_ref - q) + kd (v_ref - v) + tau_ff.

    The error of the configuration is `pin.difference(q, q_ref)`, so that every joint type works. A root joint that
    moves freely (free flyer, planar) is not actuated and gets no torque; a scene may have several of them.

    Args:
        q_ref: configuration to hold, shape (nq,), or a function of t [s] that returns it: a function of your own or a
            spline of scipy.interpolate, whose knots are breakpoints.
        kp: stiffness [N m / rad or N / m], a number or shape (nv,).
        kd: damping [N m s / rad or N s / m], a number or shape (nv,).
        v_ref: velocity, shape (nv,), or a function of t; by default zero for a q_ref that stands still and the
            derivative of a spline, where all actuated joints have plain coordinates. With a function of
            your own it must be given.
        tau_ff: torque that is added, shape (nv,), or a function of t; None is none [N m or N].
        breakpoints: times at which one of the functions jumps or has a kink, increasing [s].
    """

    actuated = True
    curve = None

    def __init__(
        self,
        q_ref: Given,
        kp: float | np.ndarray,
        kd: float | np.ndarray,
        v_ref: Given = None,
        tau_ff: Given = None,
        breakpoints: Sequence[float] = (),
    ):
        self.name, self.moves = "JointPD", callable(q_ref)
        if v_ref is None and self.moves:
            if not hasattr(q_ref, "derivative"):
                raise SceneError(
                    "JointPD: v_ref is missing: q_ref is a function whose derivative is not known. Give "
                    "v_ref=function of t that returns the velocity, shape (nv,); or make q_ref a spline of "
                    "scipy.interpolate, which brings it"
                )
            v_ref = as_polynomials(q_ref).derivative()
            self._derived = True
        else:
            self._derived = False
        given = {"q_ref": q_ref, "v_ref": v_ref, "tau_ff": tau_ff}
        self.q_ref, self.v_ref, self.tau_ff = (
            x if x is None or callable(x) else checks.array(f"JointPD: {name}", x, (None,)) for name, x in given.items()
        )
        self._gains = checks.number_or_array("JointPD: kp", kp, 0.0), checks.number_or_array("JointPD: kd", kd, 0.0)
        found = [knots(x) for x in given.values() if callable(x)]
        self.breakpoints = np.unique(np.concatenate((checked_breakpoints(self.name, breakpoints), *found)))
        self._model: pin.Model | None = None

    def __getstate__(self) -> dict[str, object]:
        return without_model(self)

    @property
    def gains(self) -> tuple[np.ndarray, np.ndarray]:
        """Kp and kd as they were given, numbers or shape (nv,)."""
        return self._gains

    def with_gains(self, kp: float | np.ndarray | None = None, kd: float | np.ndarray | None = None) -> JointPD:
        """The same law with other gains; None leaves one as it is."""
        new = copy.copy(self)
        kp, kd = (x if given is None else given for x, given in zip(self._gains, (kp, kd), strict=True))
        new._gains = checks.number_or_array("JointPD: kp", kp, 0.0), checks.number_or_array("JointPD: kd", kd, 0.0)
        return new

    def check(self, scene: Declared) -> None:
        """Expand the gains to (nv,), mute the root joint, and look at what is given at t = 0."""
        model = scene.model
        actuated = np.ones(model.nv)
        for j in range(1, model.njoints):
            if model.parents[j] == 0 and (model.nvs[j] == 6 or model.joints[j].shortname() == "JointModelPlanar"):
                actuated[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = 0.0
        if self._derived:
            self._find_speeds(model, actuated)
        gains = []
        for name, gain in zip(("kp", "kd"), self._gains, strict=True):
            if gain.shape not in ((), (model.nv,)):
                raise SceneError(f"JointPD: {name} has shape {gain.shape}, give a number or ({model.nv},)")
            gains.append(gain * actuated)
        self.kp, self.kd = gains
        self._actuated, self._model = actuated, model
        for name, n in (("q_ref", model.nq), ("v_ref", model.nv), ("tau_ff", model.nv)):
            value = getattr(self, name)
            if isinstance(value, np.ndarray) and value.shape != (n,):
                raise SceneError(f"JointPD: {name} has shape {value.shape}, the model needs ({n},)")
            self._at(name, 0.0, n)
        # where q - q_ref is a plain difference, its derivative is the identity
        self._flat = all(
            model.nqs[j] == model.nvs[j] or not self.kp[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]].any()
            for j in range(1, model.njoints)
        )
        self._diagonal = np.arange(model.nv)

    def _find_speeds(self, model: pin.Model, actuated: np.ndarray) -> None:
        """Where the derivative of q_ref has the velocity of each coordinate; a body that moves freely needs none."""
        plain = [j for j in range(1, model.njoints) if model.nqs[j] == model.nvs[j]]
        for j in set(range(1, model.njoints)).difference(plain):
            if actuated[model.idx_vs[j]]:
                raise SceneError(
                    f"JointPD: v_ref is missing: joint {model.names[j]!r} has more coordinates than "
                    "velocities, so that the derivative of q_ref is no velocity. Give v_ref=function of t, shape (nv,)"
                )
        self._speeds = [
            np.concatenate([first[j] + np.arange(model.nvs[j]) for j in plain] or [np.zeros(0, dtype=int)])
            for first in (model.idx_vs, model.idx_qs)
        ]

    def _at(self, name: str, t: float, n: int) -> Any:
        """What is given at a time: shape (n,), or None."""
        given = getattr(self, name)
        if name == "v_ref" and self._derived:
            assert self._model is not None
            of_q = array_of("JointPD: derivative of q_ref", given(t), t, (self._model.nq,))
            found = np.zeros(n)
            found[self._speeds[0]] = of_q[self._speeds[1]]
            return found
        return array_of(f"JointPD: {name}", called(f"JointPD: {name}", given, t), t, (n,)) if callable(given) else given

    def add_to(self, t: float, q: np.ndarray, v: np.ndarray, tau: np.ndarray, K: np.ndarray, D: np.ndarray) -> None:
        """See `Force`."""
        q_ref, v_ref, tau_ff = self._at("q_ref", t, len(q)), self._at("v_ref", t, len(v)), self._at("tau_ff", t, len(v))
        tau += self.kp * pin.difference(self._model, q, q_ref) - self.kd * (v if v_ref is None else v - v_ref)
        if tau_ff is not None:
            tau += self._actuated * tau_ff
        if self._flat:
            K[self._diagonal, self._diagonal] -= self.kp
        else:
            K += self.kp[:, None] * pin.dDifference(self._model, q, q_ref)[0]
        D[self._diagonal, self._diagonal] -= self.kd

    def bind(self, kinematics: Kinematics) -> JointPD:
        """See `Force`."""
        return self

    @property
    def servo(self) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """kp, kd and q_ref, where the law is constant and linear in coordinates of one number each; otherwise None."""
        constant = not self.moves and self.v_ref is None and self.tau_ff is None
        return (self.kp, self.kd, self.q_ref) if self._flat and constant else None

    def sample(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """The torque at a time, at a fixed motion."""
        tau = np.zeros(len(v))
        self.add_to(t, q, v, tau, np.zeros((len(v), len(v))), np.zeros((len(v), len(v))))
        return tau

    @property
    def energy(self) -> Callable[[np.ndarray], float] | None:
        """Energy stored in the position gains at q [J]; None where what is given can feed energy in."""
        return self._stored if not self.moves and self.v_ref is None and self.tau_ff is None else None

    def _stored(self, q: np.ndarray) -> float:
        error = pin.difference(self._model, q, self.q_ref)
        return float(0.5 * error @ (self.kp * error))
