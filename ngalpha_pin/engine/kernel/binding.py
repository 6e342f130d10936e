"""The compiled kernel (*.c beside this file): finds it, and puts scenes and steps into the blocks that it works on.

It is in the library of the engine, and the twin of contact/point_rows.py, contact/laws.py, step/equations.py
and newton_matrix.py. They run instead of it where the environment says NGALPHA_KERNEL=0, and for more than contact
points.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import cache, cached_property
from types import ModuleType
from typing import Any, Protocol

import numpy as np
from scipy.linalg import cython_blas, cython_lapack

from ngalpha_pin.engine import library_path

LAPACK = ((cython_lapack, "dgesv"), (cython_lapack, "dposv"), (cython_blas, "dgemm"))
# arguments of each function, all of them addresses
FUNCTIONS = {
    **{"nga_use_lapack": 3, "nga_find_gaps": 3, "nga_find_rows": 4, "nga_find_rates": 5, "nga_begin_step": 2},
    **{"nga_rebound": 3, "nga_move": 3, "nga_sweep": 13, "nga_evaluate": 4, "nga_linearise": 3, "nga_correct": 5},
    **{"nga_advance": 4},
}
VERSION = 12  # of the functions and blocks; the same number is in step.c
# contacts that it takes: its work space grows with their square; and those whose gaps and rates it is asked for alone:
# sizes of blocks of more are no integers of it
COMPILED, PLACED = 256, 4096
BLOCKS = ("table", "index", "step", "iterate", "rows", "work")
# attributes of a table of frames, in the order of kernel.h
FRAME_NUMBERS = ("kind", "a", "b", "group")
FRAME_ARRAYS = ("vector_a", "point_a", "point_b", "vector_b", "length", "support")
# and of a table of couplings
COUPLING_NUMBERS = ("first_part", "part", "first_power")
COUPLING_ARRAYS = ("factor", "power", "turn", "rows")
LIMITS = ("limit_q", "limit_dof", "limit_sign", "limit_value")
_address = ctypes.c_void_p


class Contacts(Protocol):
    """Contacts as the kernel takes them: the arrays of its table by their names, and what it has made of them."""

    k: int
    m: int
    k_fixed: int
    slots: np.ndarray
    bodies: np.ndarray
    of_F: np.ndarray
    points: Any
    plan: Any


class Compiled(Protocol):
    """A scene as the kernel takes it."""

    nq: int
    nv: int
    model: Any
    data: Any
    contacts: Any
    live: Any
    slots: Any
    beams: Any
    constraints: Any
    joint_friction: Any

    def layout(self, sub: Any) -> Any:
        """Where the rows of contacts and constraints are."""


class _Matrix(ctypes.Structure):
    _fields_ = [("at", _address), ("row", ctypes.c_long), ("column", ctypes.c_long)]

    @classmethod
    def of(cls, array: np.ndarray) -> _Matrix:
        return cls(array.ctypes.data, array.strides[0] // 8, array.strides[1] // 8)


class _Live(ctypes.Structure):
    _fields_ = [
        *((name, _address) for name in ("J", "dJ", "dAdv", "residual", "tau", "reach", "q", "features")),
        *((name, _Matrix) for name in ("M", "K", "D", "K_forces", "D_forces")),
        *((name, _address) for name in ("frames", "shapes")),
    ]


class _Frames(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int) for name in ("n", "kb", "nj")),
        *((name, _address) for name in (*FRAME_NUMBERS, *FRAME_ARRAYS, "poses")),
        *((name, ctypes.c_double) for name in ("unit", "vanishes")),
        ("nc", ctypes.c_int),
        *((name, _address) for name in (*COUPLING_NUMBERS, *COUPLING_ARRAYS, "follows", "wanted")),
    ]


class _Plan(ctypes.Structure):
    _fields_ = [
        *((name, ctypes.c_int) for name in ("nv", "nb", "k", "m", "nf", "kb", "mb", "nu", "nw")),
        *((name, _address) for name in ("live", "poses", "table", "work", "index")),
    ]


def load() -> tuple[ctypes.PyDLL | None, str]:
    """The library, or None where numpy is to do the work, and where it is or why not."""
    if os.environ.get("NGALPHA_KERNEL") == "0":
        return None, "the environment says NGALPHA_KERNEL=0"
    path = library_path()
    # it keeps the interpreter lock: calls take microseconds, and one system is not for two threads
    found = ctypes.PyDLL(path)
    if found.nga_version() != VERSION:
        return None, f"{path} is of another version; install this package again"
    for name, count in FUNCTIONS.items():
        getattr(found, name).argtypes = count * (_address,)
    found.nga_evaluate.restype = ctypes.c_double
    for block in BLOCKS:
        getattr(found, f"nga_{block}_names").restype = ctypes.c_char_p
    found.nga_use_lapack(*(_exported(*place) for place in LAPACK))
    return found, path


def _exported(module: ModuleType, name: str) -> int:
    """Address of a function of LAPACK or BLAS, from the capsule that scipy exports for other compiled code."""
    capsule = ctypes.py_object(module.__pyx_capi__[name])
    name_of = ctypes.pythonapi.PyCapsule_GetName
    name_of.restype, name_of.argtypes = ctypes.c_char_p, (ctypes.py_object,)
    pointer_of = ctypes.pythonapi.PyCapsule_GetPointer
    pointer_of.restype, pointer_of.argtypes = _address, (ctypes.py_object, ctypes.c_char_p)
    return int(pointer_of(capsule, name_of(capsule)))


library: Any
library, origin = load()


class Live:
    """The arrays of one system that the kernel reads, and room for the sums over its force laws.

    Attributes:
        tau, K, D: generalized force of the scene's force laws, shape (nv,), and its derivatives, shape (nv, nv).
        q: configuration at which Pinocchio was called last, shape (nq,).
        address: of all of them, for the kernel.
        joints: velocity coordinates of all joints, and the same again where there are beams, 0 elsewhere.
        spaces: work spaces by their size, each for all subsets of that size; nothing in them outlives a correction.
        frames: the constraints, or None where it does not know them all.
    """

    def __init__(self, system: Compiled):
        nv, data = system.nv, system.data
        self.tau, self.K, self.D, self.q = np.zeros(nv), np.zeros((nv, nv)), np.zeros((nv, nv)), np.zeros(system.nq)
        of_scene = self.tau, system.contacts.reach, self.q, system.slots.packed
        vectors = (data.J, data.dJ, data.dAdv, data.tau, *of_scene)
        matrices = (data.M, data.dtau_dq, data.dtau_dv, self.K, self.D)
        poses = [data.oMi[joint] for joint in range(system.model.njoints)]
        self.spaces: dict[int, Any] = {}
        self.poses = np.array([[pose.rotation.ctypes.data, pose.translation.ctypes.data] for pose in poses])
        self.frames = Frames(system.constraints, self.poses) if system.constraints.compiled else None
        frames = 0 if self.frames is None else self.frames.address
        self._struct = _Live(*(x.ctypes.data for x in vectors), *(_Matrix.of(x) for x in matrices), frames, None)
        self.address = ctypes.addressof(self._struct)
        # of the points of beams the engine alone knows where they are
        self.joints = (system.model.nv, 0 if system.beams is None else system.model.nv)


class Frames:
    """The constraints of one system, as the kernel knows them: those that tie frames to each other, and couplings.

    Args:
        constraints: of the system, all of them of these kinds.
        poses: addresses of rotation and translation of every joint, shape (joints, 2).

    Attributes:
        address: for the kernel.
        wanted: what rows follow at the end of the step, see `Constraints.wanted`.
    """

    def __init__(self, constraints: Any, poses: np.ndarray):
        (n, joints, unit), numbers, arrays = frames_of(constraints)
        nc, coupling_numbers, coupling_arrays = couplings_of(constraints)
        tied = np.ascontiguousarray(poses[joints])
        self.wanted = np.zeros(3 * int((constraints.follows >= 0).sum()))
        over_time: list[np.ndarray] = [np.ascontiguousarray(constraints.follows, dtype=np.int32), self.wanted]
        self._arrays: list[np.ndarray] = [*numbers, *arrays, tied, *coupling_numbers, *coupling_arrays, *over_time]
        first, rest = ([x.ctypes.data for x in part] for part in (self._arrays[:11], self._arrays[11:]))
        sizes = (n, constraints.kb, len(joints))
        self._struct = _Frames(*sizes, *first, unit, constraints.vanishes, nc, *rest)
        self.address = ctypes.addressof(self._struct)


def frames_of(constraints: Any) -> tuple[tuple[int, np.ndarray, float], list[np.ndarray], list[np.ndarray]]:
    """Number of rows of frames, the joints they tie and their unit; then their arrays, with the groups of all rows."""
    table = constraints.frames
    given: dict[str, Any] = {} if table is None else {x: getattr(table, x) for x in (*FRAME_NUMBERS, *FRAME_ARRAYS)}
    given["group"] = constraints.group
    numbers, arrays = _flat(given, FRAME_NUMBERS, FRAME_ARRAYS)
    sizes = (0, np.zeros(0, dtype=int), 0.0) if table is None else (table.n, table.joints, float(table.unit))
    return sizes, numbers, arrays


def couplings_of(constraints: Any) -> tuple[int, list[np.ndarray], list[np.ndarray]]:
    """Number of couplings and their arrays."""
    table = constraints.couplings
    given: dict[str, Any] = {} if table is None else table._asdict()
    return (0 if table is None else len(table.turn)), *_flat(given, COUPLING_NUMBERS, COUPLING_ARRAYS)


def _flat(
    given: dict[str, Any], numbers: tuple[str, ...], arrays: tuple[str, ...]
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    none = np.zeros(0)
    return (
        [np.ascontiguousarray(given.get(name, none), dtype=np.int32).ravel() for name in numbers],
        [np.ascontiguousarray(given.get(name, none), dtype=np.float64).ravel() for name in arrays],
    )


class Layout:
    """Where the arrays of a block are.

    Attributes:
        slices: of each array.
        size: of the whole block.
        new: makes a block of zeros.
    """

    def __init__(self, block: str, plan: _Plan):
        names = getattr(library, f"nga_{block}_names")().decode().split()
        sizes = np.zeros(len(names), dtype=np.int32)
        getattr(library, f"nga_{block}_sizes")(ctypes.byref(plan), _address(sizes.ctypes.data))
        ends = np.cumsum(sizes).tolist()
        starts = [0, *ends]
        self.slices = {name: slice(*place) for name, *place in zip(names, starts, ends, strict=False)}
        self.size = ends[-1]
        self._number = ctypes.c_int if block == "index" else ctypes.c_double

    @cached_property
    def new(self) -> Callable[[], Any]:
        """See above; a type of its own, which only blocks that are used have."""
        return self._number * self.size


@cache
def _layouts(*sizes: int) -> dict[str, Layout]:
    return {block: Layout(block, _Plan(*sizes)) for block in BLOCKS}


class Plan:
    """A subset of one system as the kernel knows it.

    Attributes:
        address: for the kernel.
        nv, n: velocity coordinates, and multipliers.
        step, iterate, rows, work: layouts of the blocks.
        n_given: how many numbers at the beginning of a step are given; the kernel finds the others.
        work_view: the work space as an array.
        T: place in it for the derivative of `pin.integrate`, shape (nv, nv).
    """

    def __init__(self, live: Live, sub: Contacts, layout: Any, friction: Any):
        k, self.live, self.nv, self.n = sub.k, live, len(live.tau), layout.n
        points = sub.points
        sizes = (self.nv, len(points.bodies), k, sub.m, layout.f, layout.kb, layout.mb, *live.joints)
        self._struct, layouts = _Plan(*sizes), _layouts(*sizes)
        self.step, self.iterate, self.rows, self.work = (layouts[name] for name in BLOCKS[2:])
        self.n_given = self.step.slices["c"].start
        multipliers, rows = np.arange(layout.n), np.arange(layout.rows)
        indices = {
            "first_F": np.searchsorted(sub.of_F, np.arange(k + 1)),
            "row_g": rows[layout.position_rows],
            **{name: multipliers[getattr(layout, name)] for name in ("at_g", "at_v", "at_a")},
            **{name: getattr(layout, name) for name in ("scale_rows", "levels")},
        }
        laws = {name: getattr(sub, name) for name in ("mu", "e", "kind_F")}
        laws |= {name: getattr(friction, name) for name in ("lower", "upper", "dofs")}
        # points come before limits, which have no geometry
        no_limits = {"limit_q": np.full(points.k, -1), **{x: np.zeros(points.k) for x in LIMITS[1:]}}
        limits = {name: np.concatenate((none, getattr(sub, name, none[:0]))) for name, none in no_limits.items()}
        indices["slot"] = np.concatenate((np.full(sub.k_fixed, -1), sub.slots, np.full(k - points.k, -1)))
        self._blocks = []
        for name, given in (("table", laws | limits), ("index", laws | limits | indices)):
            block = layouts[name].new()
            view = np.frombuffer(block, dtype=np.int32 if name == "index" else np.float64)
            for field, place in layouts[name].slices.items():
                values = np.ravel(given[field] if field in given else getattr(points, field))
                view[place][: len(values)] = values
            self._blocks.append(block)
        self._poses = np.ascontiguousarray(live.poses[points.bodies])
        self._struct.live, self._struct.poses = live.address, self._poses.ctypes.data
        self._struct.table, self._struct.index = (ctypes.addressof(block) for block in self._blocks)
        self.address = ctypes.addressof(self._struct)

    def make_room(self) -> None:
        """Find a work space; a subset that is only asked for its gaps needs none."""
        if self._struct.work is None:
            space = self.live.spaces.get(self.work.size)
            if space is None:
                space = self.live.spaces[self.work.size] = self.work.new()
            self.work_view = np.frombuffer(space)
            self.T = self.work_view[self.work.slices["T"]].reshape(self.nv, self.nv).T
            self._struct.work = ctypes.addressof(space)


def plan_of(system: Compiled, sub: Contacts) -> Plan:
    """The subset as the kernel knows it, made at the first request."""
    if sub.plan is None:
        if system.live is None:
            system.live = Live(system)
        sub.plan = Plan(system.live, sub, system.layout(sub), system.joint_friction)
    return sub.plan


def gaps(system: Compiled, sub: Contacts) -> tuple[np.ndarray, np.ndarray]:
    """g_N of a subset where Pinocchio has put the bodies, shape (k,) [m], and normals in the world, shape (k, 3)."""
    if sub.k == 0:
        return np.zeros(0), np.zeros((0, 3))
    found = np.zeros((4, sub.k))
    library.nga_find_gaps(plan_of(system, sub).address, found.ctypes.data, found[1:].ctypes.data)
    return found[0], found[1:].reshape(-1, 3)
