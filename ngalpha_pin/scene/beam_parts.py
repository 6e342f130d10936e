"""The beams of a scene: their declarations, their named points and the loads on them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ngalpha_pin.common import checks
from ngalpha_pin.errors import SceneError, UnknownName
from ngalpha_pin.flexible.beams import BeamPoint, Slices, slices_of, with_points
from ngalpha_pin.flexible.loads import LineLoad, Load, PointLoad
from ngalpha_pin.flexible.planar_beam import PlanarBeam
from ngalpha_pin.scene.extra_states import ExtraState
from ngalpha_pin.scene.forces import Force
from ngalpha_pin.scene.strand_parts import StrandParts
from ngalpha_pin.scene.strands import StrandForce, StrandLoad
from ngalpha_pin.scene.unilateral import UnilateralConstraint


class BeamParts(StrandParts):
    """What `Scene` offers for beams."""

    model: pin.Model
    beams: dict[str, PlanarBeam]
    beam_points: list[BeamPoint]
    loads: list[Load]
    add_force: Callable[[Force], Force]
    states: list[ExtraState]
    unilaterals: list[UnilateralConstraint]
    add_geometry: Callable[[str, coal.CollisionGeometry, str], str]

    def add_beam(self, beam: PlanarBeam, name: str) -> PlanarBeam:
        """Add a beam: its coordinates follow those of the model, and of the beams before, in q and in v.

        Args:
            beam: the beam.
            name: of the beam, for `add_beam_point`.

        Returns:
            The beam, whose places in q and v are `scene.slices[beam]`.

        Raises:
            SceneError: the beam or its name is in the scene already.
        """
        checks.instance("beam", beam, PlanarBeam)
        if checks.name("name of a beam", name) in self.beams or any(beam is other for other in self.beams.values()):
            raise SceneError(f"the scene has this beam or the name {name!r} already; choose another name")
        if self.states or self.unilaterals:
            raise SceneError(f"beam {name!r}: a scene with states or own unilateral constraints cannot have beams")
        self.beams[name] = beam
        return beam

    def add_beam_point(self, name: str, beam: str, xi: float, radius: float = 0.0) -> str:
        """Give a point of the centreline of a beam a name, for constraints, contacts, geometries and loads.

        It is a frame with its x-axis along the centreline and its z-axis normal to the plane of the beam, and a
        geometry of the same name for contacts.

        Args:
            name: must be new.
            beam: name of the beam.
            xi: place on the centreline, in [0, 1].
            radius: of the beam for contacts there [m].

        Raises:
            SceneError: the name is taken or xi outside [0, 1]. UnknownName: there is no such beam.
        """
        if checks.name("beam", beam) not in self.beams:
            raise UnknownName("beam", beam, self.beams)
        checks.name("name of a beam point", name)
        xi = checks.number(f"beam point {name!r}: xi", xi, 0.0, 1.0)
        radius = checks.number(f"beam point {name!r}: radius", radius, 0.0)
        model = with_points(self.model, self.beams, self.beam_points)
        if model.existFrame(name) or model.existJointName(name):
            raise SceneError(f"the scene has a frame or joint named {name!r} already; choose another name")
        self.beam_points.append(BeamPoint(name, beam, xi))
        return self.add_geometry(name, coal.Sphere(radius), name)

    def add_load(self, load: Load) -> Load:
        """Add a dead load: a `LineLoad` on a beam, rod or cable, a `PointLoad` on a beam.

        On a point of a rod or cable, a `Wrench` is one.

        Raises:
            UnknownName: there is no such beam point, beam or rod.
        """
        checks.instance("load", load, (PointLoad, LineLoad), "a PointLoad or a LineLoad")
        if isinstance(load, LineLoad) and load.beam in self.strands:
            self.add_force(StrandLoad(load.beam, self.strands[load.beam], load.force))
            return load
        if isinstance(load, LineLoad):
            if load.beam not in self.beams:
                raise UnknownName("beam, rod or cable", load.beam, [*self.beams, *self.strands])
        elif load.point not in {point.name for point in self.beam_points}:
            raise UnknownName("beam point", load.point, [point.name for point in self.beam_points])
        self.loads.append(load)
        return load

    @property
    def slices(self) -> dict[Any, Slices]:
        """Places of every beam, rod and cable in q and in v."""
        strands = {force.strand: force.slices for force in self.forces if isinstance(force, StrandForce)}
        return {**slices_of(self.model, self.beams), **strands}

    @property
    def q_ref(self) -> np.ndarray:
        """The neutral configuration of the model with undeformed beams, rods and cables, shape (nq,)."""
        found = np.concatenate((pin.neutral(self.model), *(beam.q_ref for beam in self.beams.values())))
        for strand in self.strands.values():
            found[self.slices[strand].q] = strand.q_ref
        return found
