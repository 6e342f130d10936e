"""Geometries that are drawn: declared by the files that have them, and loaded when something is drawn."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio as pin

from ngalpha_pin.scene.mjcf.reader import read_mjcf_visuals
from ngalpha_pin.scene.urdf import read_urdf_visuals

WORLD = "universe"  # the frame of every model that does not move


@dataclass(frozen=True)
class VisualFile:
    """The visual geometries of a file on the frames of a scene.

    Attributes:
        path: of the URDF or MJCF file.
        kind: "urdf" or "mjcf".
        package_dirs: of a URDF, folders in which `package://` paths are looked up; None is every folder above the file.
        prefix: of the names of its frames in the scene.
        base: frame of the scene that its world is fixed to.
        placement: where, 4 x 4.
    """

    path: str
    kind: str
    package_dirs: tuple[str, ...] | None = None
    prefix: str = ""
    base: str = WORLD
    placement: list[list[float]] = field(default_factory=lambda: np.eye(4).tolist())

    def moved(self, prefix: str, on: str | None, placement: pin.SE3) -> VisualFile:
        """The same as part of another scene, in which its frames have names behind a prefix."""
        if self.base != WORLD:
            return replace(self, prefix=prefix + self.prefix, base=prefix + self.base)
        pose = (placement * pin.SE3(np.array(self.placement))).homogeneous.tolist()
        return replace(self, prefix=prefix + self.prefix, base=on or WORLD, placement=pose)

    def geometries(self, model: pin.Model) -> pin.GeometryModel:
        """Load them for the model of a scene.

        Raises:
            SceneError: the file or one of its meshes is gone.
        """
        if self.kind == "mjcf":
            own, loaded = read_mjcf_visuals(self.path)
        else:
            own, loaded = read_urdf_visuals(self.path, self.package_dirs)
        found = pin.GeometryModel()
        for geometry in loaded.geometryObjects:
            frame = own.frames[geometry.parentFrame]
            in_frame = frame.placement.inverse() * geometry.placement
            on = self.prefix + frame.name
            if frame.name == WORLD:
                on, in_frame = self.base, pin.SE3(np.array(self.placement)) * in_frame
            named = [f for f in model.frames if f.name == on]
            if not named:
                continue  # a body that has been removed
            place = next((f for f in named if f.type == frame.type), named[0])
            copied = geometry.copy()
            copied.name = self.prefix + geometry.name
            copied.parentJoint, copied.parentFrame = place.parentJoint, model.getFrameId(on, place.type)
            copied.placement = place.placement * in_frame
            found.addGeometryObject(copied)
        return found
