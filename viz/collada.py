"""COLLADA meshes with their materials, as three.js objects: meshcat's own reader gives up on many of them."""

from __future__ import annotations

import base64
import uuid
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

NS = "{http://www.collada.org/2005/11/COLLADASchema}"
GREY = (0.7, 0.7, 0.7, 1.0)


@dataclass(frozen=True)
class Part:
    """Triangles of one material.

    Attributes:
        vertices: positions in the frame of the file [m], shape (n, 3).
        normals: shape (n, 3), or None.
        uv: texture coordinates, shape (n, 2), or None.
        faces: indices of vertices, shape (m, 3).
        color: RGBA in [0, 1].
        texture: image file, or None.
    """

    vertices: np.ndarray
    normals: np.ndarray | None
    uv: np.ndarray | None
    faces: np.ndarray
    color: tuple[float, float, float, float]
    texture: Path | None


@lru_cache(maxsize=64)
def read_collada(path: Path) -> tuple[Part, ...]:
    """Every triangle of a file, by material, with the transforms of its nodes applied."""
    return tuple(_File(path).parts())


def collada_object(path: Path) -> dict[str, Any]:
    """A file as a three.js group in meshcat's form, with arrays of numpy in place of packed ones."""
    data: dict[str, Any] = {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [],
        "materials": [],
        "textures": [],
        "images": [],
        "object": {"uuid": str(uuid.uuid4()), "type": "Group", "matrix": np.eye(4).ravel().tolist(), "children": []},
    }
    for part in read_collada(path):
        geometry, material = _geometry(part), _material(part, data)
        data["geometries"].append(geometry)
        data["materials"].append(material)
        mesh = {"uuid": str(uuid.uuid4()), "type": "Mesh", "geometry": geometry["uuid"], "material": material["uuid"]}
        data["object"]["children"].append(mesh)
    return data


def _geometry(part: Part) -> dict[str, Any]:
    arrays = {"position": part.vertices, "normal": part.normals, "uv": part.uv}
    attributes = {
        name: {"itemSize": array.shape[1], "type": "Float32Array", "array": array.astype("<f4"), "normalized": False}
        for name, array in arrays.items()
        if array is not None
    }
    index = {"itemSize": 3, "type": "Uint32Array", "array": part.faces.astype("<u4"), "normalized": False}
    return {"uuid": str(uuid.uuid4()), "type": "BufferGeometry", "data": {"attributes": attributes, "index": index}}


def _material(part: Part, data: dict[str, Any]) -> dict[str, Any]:
    red, green, blue, alpha = part.color
    material = {
        "uuid": str(uuid.uuid4()),
        "type": "MeshPhongMaterial",
        "color": int(red * 255) * 65536 + int(green * 255) * 256 + int(blue * 255),
        "specular": 0x2A2A2A,
        "shininess": 30,
        "side": 2,
        "opacity": alpha,
        "transparent": alpha < 1,
    }
    if part.texture is not None and part.uv is not None:
        image, texture = str(uuid.uuid4()), str(uuid.uuid4())
        kind = "png" if part.texture.suffix.lower() == ".png" else "jpeg"
        content = base64.b64encode(part.texture.read_bytes()).decode("ascii")
        data["images"].append({"uuid": image, "url": f"data:image/{kind};base64,{content}"})
        data["textures"].append({"uuid": texture, "image": image, "wrap": [1000, 1000], "repeat": [1, 1]})
        material["map"] = texture
    return material


class _File:
    """One file while it is read."""

    def __init__(self, path: Path):
        self.path = path
        self.root = ElementTree.parse(path).getroot()
        self.by_id = {element.get("id"): element for element in self.root.iter() if element.get("id")}
        self.sources: dict[str, np.ndarray] = {}

    def parts(self) -> Iterator[Part]:
        # the up axis of the file is ignored, as coal and most readers of URDF do
        unit = self.root.find(f"{NS}asset/{NS}unit")
        scale = float(unit.get("meter", 1)) if unit is not None else 1.0
        world = np.diag([scale, scale, scale, 1.0])
        scene = self.follow(self.root.find(f"{NS}scene/{NS}instance_visual_scene"), "url")
        for node in scene.findall(f"{NS}node") if scene is not None else ():
            yield from self.node(node, world)

    def follow(self, element: ElementTree.Element | None, attribute: str) -> ElementTree.Element | None:
        """The element that an attribute such as url="#id" points to."""
        return None if element is None else self.by_id.get(element.get(attribute, "").removeprefix("#"))

    def node(self, node: ElementTree.Element, parent: np.ndarray) -> Iterator[Part]:
        placement = parent @ _transform(node)
        for instance in node.findall(f"{NS}instance_geometry"):
            geometry = self.follow(instance, "url")
            mesh = geometry.find(f"{NS}mesh") if geometry is not None else None
            bound = {m.get("symbol"): m.get("target", "") for m in instance.iter(f"{NS}instance_material")}
            for kind in ("triangles", "polylist", "polygons"):
                for primitive in mesh.findall(f"{NS}{kind}") if mesh is not None else ():
                    symbol = primitive.get("material", "")
                    part = self.primitive(primitive, placement, bound.get(symbol, symbol).removeprefix("#"))
                    if part is not None:
                        yield part
        for instance in node.findall(f"{NS}instance_node"):
            other = self.follow(instance, "url")
            if other is not None:
                yield from self.node(other, placement)
        for child in node.findall(f"{NS}node"):
            yield from self.node(child, placement)

    def primitive(self, primitive: ElementTree.Element, placement: np.ndarray, material: str) -> Part | None:
        inputs = {i.get("semantic"): i for i in reversed(primitive.findall(f"{NS}input"))}
        width = 1 + max(int(i.get("offset", 0)) for i in primitive.findall(f"{NS}input"))
        corners = _triangles(primitive, width)
        if len(corners) == 0:
            return None
        own = {i.get("semantic"): i for i in self.by_id[inputs["VERTEX"].get("source", "").removeprefix("#")]}
        offset = {name: int(element.get("offset", 0)) for name, element in inputs.items()}
        columns = [corners[:, offset[name]] for name in ("VERTEX", "NORMAL", "TEXCOORD") if name in offset]
        first, inverse = _distinct(columns)
        position = self.values(own["POSITION"])[corners[first, offset["VERTEX"]], :3]
        normal = uv = None
        if "NORMAL" in inputs:
            normal = self.values(inputs["NORMAL"])[corners[first, offset["NORMAL"]], :3]
        elif "NORMAL" in own:
            normal = self.values(own["NORMAL"])[corners[first, offset["VERTEX"]], :3]
        if "TEXCOORD" in inputs:
            uv = self.values(inputs["TEXCOORD"])[corners[first, offset["TEXCOORD"]], :2]
        if normal is not None:
            normal = normal @ np.linalg.inv(placement[:3, :3])
            normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
        faces = inverse.reshape(-1, 3)
        if np.linalg.det(placement[:3, :3]) < 0:  # a mirror turns the faces inside out
            faces = faces[:, ::-1]
        color, texture = self.look(material)
        return Part(position @ placement[:3, :3].T + placement[:3, 3], normal, uv, faces, color, texture)

    def values(self, entry: ElementTree.Element) -> np.ndarray:
        """The array behind an input, one row per entry."""
        key = entry.get("source", "").removeprefix("#")
        if key not in self.sources:
            source = self.by_id[key]
            accessor = source.find(f"{NS}technique_common/{NS}accessor")
            stride = int(accessor.get("stride", 1)) if accessor is not None else 3
            self.sources[key] = _numbers(source.find(f"{NS}float_array")).reshape(-1, stride)
        return self.sources[key]

    def look(self, material: str) -> tuple[tuple[float, float, float, float], Path | None]:
        """Diffuse colour and texture of a material."""
        found = self.by_id.get(material)
        effect = self.follow(found.find(f"{NS}instance_effect"), "url") if found is not None else None
        diffuse = next(effect.iter(f"{NS}diffuse"), None) if effect is not None else None
        if effect is None or diffuse is None:
            return GREY, None
        color = diffuse.find(f"{NS}color")
        if color is not None:
            red, green, blue, alpha = [*np.clip(_numbers(color), 0, 1).tolist(), 1.0][:4]
            return (red, green, blue, alpha), None
        texture = diffuse.find(f"{NS}texture")
        path = self.image(effect, texture.get("texture", "")) if texture is not None else None
        return ((1.0, 1.0, 1.0, 1.0) if path is not None else GREY), path

    def image(self, effect: ElementTree.Element, name: str) -> Path | None:
        """The file behind a texture: sampler, surface, image, or the image itself."""
        params = {p.get("sid"): p for p in effect.iter(f"{NS}newparam")}
        for tag in ("source", "init_from"):
            if name in params:
                name = next((e.text.strip() for e in params[name].iter(f"{NS}{tag}") if e.text), "")
        image = self.by_id.get(name)
        content = image.findtext(f"{NS}init_from") if image is not None else None
        path = self.path.parent / content.strip().removeprefix("file://") if content else None
        return path if path is not None and path.is_file() else None


def _transform(node: ElementTree.Element) -> np.ndarray:
    """Placement of a node in its parent, shape (4, 4): the product of its transforms in the order of the file."""
    placement = np.eye(4)
    for element in node:
        kind = element.tag.removeprefix(NS)
        step = np.eye(4)
        if kind == "matrix":
            step = _numbers(element).reshape(4, 4)
        elif kind == "translate":
            step[:3, 3] = _numbers(element)
        elif kind == "scale":
            step[:3, :3] = np.diag(_numbers(element))
        elif kind == "rotate":
            *axis, degrees = _numbers(element)
            length = np.linalg.norm(axis)
            if length > 0:
                step[:3, :3] = pin.AngleAxis(np.deg2rad(degrees), np.array(axis) / length).matrix()
        placement = placement @ step
    return placement


def _numbers(element: ElementTree.Element | None, dtype: type = float) -> np.ndarray:
    text = element.text if element is not None else None
    return np.array((text or "").split(), dtype=dtype)


def _triangles(primitive: ElementTree.Element, width: int) -> np.ndarray:
    """Index rows of the corners of all triangles, three by three, polygons cut into fans: (3 m, width)."""
    rows = [_numbers(p, int).reshape(-1, width) for p in primitive.findall(f"{NS}p")]
    if not rows:
        return np.zeros((0, width), int)
    if primitive.tag == f"{NS}triangles":
        return np.concatenate(rows)
    if primitive.tag == f"{NS}polylist":
        sizes = _numbers(primitive.find(f"{NS}vcount"), int)
        rows = np.split(np.concatenate(rows), np.cumsum(sizes)[:-1])
    fans = [row[[k for n in range(1, len(row) - 1) for k in (0, n, n + 1)]] for row in rows if len(row) > 2]
    return np.concatenate(fans) if fans else np.zeros((0, width), int)


def _distinct(columns: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """First occurrence of every distinct row, and for every row which of them it is."""
    key = np.zeros(len(columns[0]), dtype=np.int64)
    for column in columns:
        key = key * (int(column.max(initial=0)) + 1) + column
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    return first, inverse
