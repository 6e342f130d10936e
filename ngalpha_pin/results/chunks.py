"""Runs in chunks on the disk: each is a file of its own, there as a whole or not at all, and read when asked for."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import overload

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.errors import NotWritten, SceneError
from ngalpha_pin.results.trajectory import Trajectory
from ngalpha_pin.system.state import State

UNDER_WAY = "the run was under way"


class Chunks(Sequence[Trajectory]):
    """The chunks that `simulate(save_to=folder)` has written, in the order of time.

    Each begins with the state with which the one before ended.

    A run that was killed leaves the chunks that were whole; `simulate(scene, state=chunks.final_state, ...,
    save_to=folder)` goes on with the same bits as if nothing had happened.

    Args:
        folder: where they are.

    Raises:
        SceneError: there is no such folder, or it holds no chunks.
    """

    def __init__(self, folder: str | os.PathLike[str]):
        self.folder = checks.path("folder of chunks", folder)
        self.files = _files(self.folder)
        if not self.files:
            raise SceneError(f"{folder} is no folder with chunks of a run")

    def __repr__(self) -> str:
        return f"Chunks({str(self.folder)!r}, {len(self)} of them)"

    def __len__(self) -> int:
        return len(self.files)

    @overload
    def __getitem__(self, i: int) -> Trajectory: ...

    @overload
    def __getitem__(self, i: slice) -> list[Trajectory]: ...

    def __getitem__(self, i: int | slice) -> Trajectory | list[Trajectory]:
        """One chunk, or some of them, read now."""
        if isinstance(i, slice):
            return [Trajectory.load(path) for path in self.files[i]]
        return Trajectory.load(self.files[i])

    def __iter__(self) -> Iterator[Trajectory]:
        """The chunks one after the other, each read when its turn comes."""
        return map(Trajectory.load, self.files)

    def join(self) -> Trajectory:
        """All chunks as one trajectory, read into memory."""
        return Trajectory.join(list(self))

    @property
    def final_state(self) -> State:
        """Where the last chunk ends."""
        return self[-1].final_state


class Store:
    """The folder into which a run writes its chunks.

    Args:
        folder: it is made; chunks that are there must end in the state in which the run starts.
        every: steps of one chunk.
        start: the first state of the run.

    Raises:
        SceneError: the folder holds another run. NotWritten: it cannot be made.
    """

    def __init__(self, folder: str | os.PathLike[str], every: int, start: State):
        self.folder, self.every = checks.path("save_to", folder), checks.integer("every", every, 1)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise NotWritten(f"cannot make the folder {folder}: {error.strerror}") from error
        self._n = len(_files(self.folder))
        other = _differences(Chunks(self.folder).final_state, start) if self._n else ""
        if other:
            raise SceneError(
                f"{folder} holds a run that does not end where this one starts, {other}; continue it with "
                "state=Chunks(folder).final_state, or name another folder"
            )

    def write(self, trajectory: Trajectory, ended: BaseException | None = None) -> None:
        """Add a chunk.

        Args:
            trajectory: the chunk.
            ended: what has ended the run early with it.

        Raises:
            NotWritten: the system does not let it; the error has the trajectory, and says what had ended the run.
        """
        try:
            trajectory.save(self.folder / f"{self._n:06d}.npz")
        except NotWritten as error:
            error.trajectory = trajectory
            if ended is None:
                raise
            both = NotWritten(f"{error}; the run had ended at t = {trajectory.t[-1]:g} s: {trajectory.message}")
            both.trajectory = trajectory
            raise both from ended
        self._n += 1


def _differences(end: State, start: State) -> str:
    """In what a run starts otherwise than another one has ended, in words; "" where it goes on."""
    if end.t != start.t:
        return f"at t = {end.t:g} and not {start.t:g} s"
    ends, starts = end.to_arrays(), start.to_arrays()
    said = []
    for name in {**ends, **starts}:
        a, b = ends.get(name), starts.get(name)
        if a is None or b is None or a.shape != b.shape:
            said.append(f"{name} (of another length)")
        elif not np.array_equal(a, b):
            said.append(name + (f" (by {np.abs(b - a).max():.2g})" if a.dtype.kind == "f" else ""))
    return f"its state differs in {', '.join(said)}" if said else ""


def _files(folder: Path) -> list[Path]:
    """The chunks of a folder; those that were not finished have other names."""
    found = sorted(path for path in folder.glob("[0-9]*.npz") if path.stem.isdigit()) if folder.is_dir() else []
    for i, path in enumerate(found):
        if int(path.stem) != i:
            raise SceneError(f"{folder}: chunk {i:06d}.npz is missing")
    return found
