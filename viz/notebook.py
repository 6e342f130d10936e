"""A trajectory in a notebook: the replay on request."""

from __future__ import annotations

import html
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .page import page

if TYPE_CHECKING:
    from ngalpha_pin import Trajectory


@dataclass(frozen=True)
class Replay:
    """A replay inside a notebook; a cell that ends with it shows it.

    Attributes:
        page: text of the page, complete in itself.
        height: of the frame around it [pixels].
    """

    page: str
    height: int

    def __repr__(self) -> str:
        return f"Replay of {len(self.page) / 1e6:.2f} MB"

    def _repr_html_(self) -> str:
        content = html.escape(self.page, quote=True)
        style = f"width: 100%; height: {self.height}px; border: 0"
        return f'<iframe srcdoc="{content}" style="{style}" allowfullscreen></iframe>'


def embed(
    trajectory: Trajectory | Sequence[Trajectory],
    labels: Sequence[str] | None = None,
    title: str | None = None,
    height: int = 600,
) -> Replay:
    """The replay of `save_html` for a notebook, which keeps it in its file and needs no server.

    Args:
        trajectory: a run, or several to show in one scene.
        labels: names of the runs.
        title: of the page; the name of the model by default.
        height: of the frame [pixels].

    Returns:
        What a notebook displays.

    Raises:
        SceneError: nothing to show, or labels that do not match. MissingPackageError: meshcat is not installed.
    """
    return Replay(page(trajectory, labels, title), height)
