"""Axial force and bending moment over the length of the beams."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ngalpha_pin.common import checks
from ngalpha_pin.common.files import replacing
from ngalpha_pin.errors import SceneError

from .figure import ROW, WIDTH, new_figure, paper_style
from .frames import nearest_step

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ngalpha_pin import Trajectory

PLACES = np.linspace(0.0, 1.0, 101)


def plot_beams(
    trajectory: Trajectory, times: Sequence[float] | None = None, path: str | os.PathLike[str] | None = None
) -> Figure:
    """Draw the axial force and the bending moment of every beam over xi.

    Args:
        trajectory: a run with beams.
        times: when [s]; by default at the end.
        path: file to write, its ending says the format; None leaves the figure to `matplotlib.pyplot.show()`.

    Returns:
        The figure.

    Raises:
        SceneError: the scene has no beam, or the times are no numbers.
        MissingPackageError: matplotlib is not installed.
    """
    beams = trajectory.scene.beams
    if not beams:
        raise SceneError("the scene has no beam whose section forces could be drawn")
    style = paper_style()
    wanted = np.array([trajectory.t[-1]]) if times is None else checks.array("times", times, (None,))
    steps = nearest_step(np.asarray(trajectory.t), wanted)
    with style:
        figure = new_figure(path is None, (WIDTH, ROW * len(beams)))
        rows = figure.subplots(len(beams), 2, squeeze=False, sharex=True)
        for (name, beam), axes in zip(beams.items(), rows, strict=True):
            place = trajectory.scene.slices[beam]
            for i in steps:
                forces = beam.section_forces(trajectory.q[i, place.q], trajectory.v[i, place.v], PLACES)
                for ax, values in zip(axes, forces, strict=True):
                    ax.plot(PLACES, values, label=f"t = {trajectory.t[i]:.4g} s")
            for ax, what in zip(axes, ("$N$ [N]", "$M$ [N m]"), strict=True):
                ax.set_title(name, loc="left")
                ax.set_ylabel(what)
                ax.margins(x=0)
        for ax in rows[-1]:
            ax.set_xlabel(r"$\xi$")
        rows[0, 0].legend()
        if path is not None:
            with replacing(path) as beside:
                figure.savefig(beside)
    return figure
