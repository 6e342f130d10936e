"""A run as its judges see it."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ngalpha_pin.scene.scene import Scene
from ngalpha_pin.system.state import State
from ngalpha_pin.system.system import System


class Recorded(Protocol):
    """The arrays of a `Trajectory`, whose docstring says what they are, and what its judges tell each other."""

    scene: Scene
    method: str
    dt: float
    success: bool
    message: str
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    contact_names: tuple[str, ...]
    contact_columns: np.ndarray
    friction_rows: tuple[slice, ...]
    P_N: np.ndarray
    la_N: np.ndarray
    La_N: np.ndarray
    P_F: np.ndarray
    la_F: np.ndarray
    La_F: np.ndarray
    constraint_names: tuple[str, ...]
    n_g: int
    la_g: np.ndarray
    La_g: np.ndarray
    la_gamma: np.ndarray
    La_gamma: np.ndarray
    friction_names: tuple[str, ...]
    adhesion: np.ndarray
    tau: np.ndarray
    tau_step: np.ndarray
    tau_f: np.ndarray
    P_f: np.ndarray
    slots: np.ndarray
    slot_ends: np.ndarray
    n_iter: np.ndarray
    solver_path: np.ndarray
    impacts: Any
    final_state: State
    chosen: Any
    kept: Any
    entry: Any
    parts: Any
    changes: Any

    @property
    def system(self) -> System:
        """The compiled scene."""

    @property
    def g_N(self) -> np.ndarray:
        """Gaps, shape (n + 1, n_contacts) [m]."""

    @property
    def on_velocity_level(self) -> bool:
        """The method asks its laws of the velocities alone."""

    @property
    def pair_wrenches(self) -> Any:
        """Forces of the contacts by pair."""

    @property
    def joint_wrenches(self) -> np.ndarray:
        """What every joint carries."""

    @property
    def replay(self) -> Any:
        """What the scene says along the motion."""

    @property
    def contact_motion(self) -> Any:
        """Gaps and slip velocities."""

    @property
    def constraint_motion(self) -> Any:
        """How well the constraints are fulfilled."""

    @property
    def impact_laws(self) -> Any:
        """The located impacts against their laws."""

    @property
    def energy(self) -> Any:
        """Kinetic and potential energy over time."""

    @property
    def events(self) -> Any:
        """What happened when."""

    def audit(self) -> Any:
        """How well the run keeps the laws of mechanics."""
