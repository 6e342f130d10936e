"""A file as MuJoCo itself takes it, at states in Pinocchio's convention: what a scene of that file is compared with."""

import importlib.util
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

import ngalpha_pin as nga
from ngalpha_pin.scene.mjcf.compiler import Names, compiled
from ngalpha_pin.system.system import System

APART = 1e4  # margin in which MuJoCo finds every pair that may touch [m]
FLAG = mujoco.mjtDisableBit
OWN = sorted((Path(__file__).parent / "scene" / "mjcf").glob("*.xml"))
_GYMNASIUM = importlib.util.find_spec("gymnasium")
GYMNASIUM = sorted((Path(_GYMNASIUM.origin).parent / "envs" / "mujoco" / "assets").glob("*.xml")) if _GYMNASIUM else []  # type: ignore[arg-type]


class Reference:
    """A file as MuJoCo compiles it."""

    def __init__(self, path, model):
        self.m, _ = compiled(path)
        self.d, self.model, self.names = mujoco.MjData(self.m), model, Names(self.m)
        # free bodies among gears and stops would need a soft constraint solver: only smooth forces are compared
        self.m.opt.disableflags |= FLAG.mjDSBL_CONSTRAINT | FLAG.mjDSBL_CONTACT

    def place(self, q, v):
        """Everything at a state of the scene."""
        self.v = v
        self.d.qpos[:], self.d.qvel[:] = nga.q_to_mujoco(self.model, q), nga.v_to_mujoco(self.model, q, v)
        mujoco.mj_forward(self.m, self.d)
        mujoco.mj_energyPos(self.m, self.d)
        mujoco.mj_energyVel(self.m, self.d)
        self.M = np.zeros((self.m.nv, self.m.nv))
        mujoco.mj_fullM(self.m, self.d, self.M)
        # v of MuJoCo = J v, and J_dot v: both are of free joints
        self.J, self.turned = np.eye(self.m.nv), np.zeros(self.m.nv)
        for joint, i, k in zip(
            list(self.model.joints)[1:], list(self.model.idx_qs)[1:], list(self.model.idx_vs)[1:], strict=True
        ):
            if joint.nq == 7:
                R = pin.Quaternion(q[i + 3 : i + 7]).matrix()
                self.J[k : k + 3, k : k + 3] = R
                self.turned[k : k + 3] = R @ np.cross(v[k + 3 : k + 6], v[k : k + 3])

    def quantities(self):
        """Kinetic and potential energy, M, and all forces but M a, of what a scene takes from a file."""
        force = self.d.qfrc_bias - (self.d.qfrc_passive - self.d.qfrc_fluid) - self.d.qfrc_actuator
        M = self.J.T @ self.M @ self.J
        return self.d.energy[1], self.d.energy[0] - self._static(), M, self.J.T @ (force + self.M @ self.turned)

    def _static(self):
        """Potential energy of bodies that cannot move [J]."""
        if self.m.opt.disableflags & FLAG.mjDSBL_GRAVITY:
            return 0.0
        moves = [False]
        for b in range(1, self.m.nbody):  # a mocap body, which is welded to nothing, does not move either
            moves.append(moves[self.m.body_parentid[b]] or self.m.body_dofnum[b] > 0)
        still = [b for b in range(1, self.m.nbody) if not moves[b]]
        return -sum(self.m.body_mass[b] * self.m.opt.gravity @ self.d.xipos[b] for b in still)

    def pairs(self, path):
        """Friction of every pair of geoms that may touch, by their names: MuJoCo finds them all at a huge margin."""
        m, _ = compiled(path)
        # far away from each other its boxes miss some contacts that others have
        m.geom_type[m.geom_type == mujoco.mjtGeom.mjGEOM_BOX] = mujoco.mjtGeom.mjGEOM_SPHERE
        m.geom_margin[:], m.pair_margin[:], m.body_margin[:] = APART, APART, APART
        d, names = mujoco.MjData(m), Names(m).geoms
        mujoco.mj_forward(m, d)
        contacts = [d.contact[i] for i in range(d.ncon)]
        return {frozenset(names[g] for g in c.geom): c.friction[0] if c.dim > 1 else 0.0 for c in contacts}


def quantities(scene, q, v):
    """The same of a scene."""
    system = System(scene)
    M = system.mass_matrix(q)
    U = float(pin.computePotentialEnergy(scene.model, scene.model.createData(), q))
    U += sum(force.energy(q) for force in system.forces if force.energy is not None)
    residual = np.array(system.dynamics(0.0, q, v, np.zeros(system.nv)).residual)
    return 0.5 * float(v @ M @ v), U, M, residual


def random_state(model, rng):
    """A configuration and a velocity."""
    return pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)), rng.normal(size=model.nv)
