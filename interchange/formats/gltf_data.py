"""glTF 2.0 as arrays: the tree of nodes, and triangles as ``Mesh`` records. No USD here.

Khronos: glTF 2.0 Specification, 2.0.1 (ISO/IEC 12113:2022). Lengths are metres, y up; normals are as in the
file, or flat where it has none, as section 3.7.2.1 asks. Runs in isolation: whatever the file claims is
checked before it is believed, and what is left out is listed.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interchange.formats.gltf_buffers import Buffers, Damaged, container
from interchange.formats.surface import Findings, unit_normals, with_area
from interchange.mesh import Mesh, from_corners
from interchange.problems import FileError, Problem, Where

POINTS, LINES, LINE_LOOP, LINE_STRIP, TRIANGLES, STRIP, FAN = range(7)
UNDERSTOOD = {
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
}
HARMLESS = {"TM_brep_faces"}  # extensions that change nothing one can see
MAX_DEPTH = 1000  # of the tree of nodes


@dataclass(frozen=True, eq=False)
class Primitive:
    mesh: Mesh
    material: int  # -1: none


@dataclass(frozen=True)
class Node:
    name: str
    matrix: np.ndarray  # (4, 4) parent_from_node
    children: tuple[int, ...] = ()
    mesh: int = -1
    camera: int = -1
    light: int = -1


@dataclass(frozen=True)
class Gltf:
    """The tree in ``nodes`` from ``roots`` down. ``json`` keeps materials, textures, cameras and lights as
    they are written; ``images[i]`` is the file's bytes, or the path of the file that it names."""

    nodes: tuple[Node, ...]
    roots: tuple[int, ...]
    meshes: tuple[tuple[str, tuple[Primitive, ...]], ...]
    images: tuple[bytes | str, ...]
    json: dict[str, Any] = field(default_factory=dict)
    problems: tuple[Problem, ...] = ()


def read_gltf(path: str) -> Gltf:
    """A .glb or .gltf file. Raises FileError with every problem."""
    return parse(Path(path).read_bytes(), path)


def parse(data: bytes, path: str) -> Gltf:
    """``data``: the contents of a .glb or .gltf file; ``path`` names it and anchors what it refers to."""
    document, chunk = container(data, path)
    find = Findings(path)
    version = str(document.get("asset", {}).get("version", ""))
    if not version.startswith("2."):
        raise FileError(Problem(f'glTF must be of version 2; got "{version}".', Where(path)))
    for name in document.get("extensionsRequired", []):
        if name not in UNDERSTOOD | HARMLESS:
            find.error(f"The file cannot be shown without the extension {name}, which is not known here.", "")
    find.stop()
    for name in document.get("extensionsUsed", []):
        if name not in UNDERSTOOD | HARMLESS:
            find.loss(f"The extension {name} is left out.", "")
    for key, what in (("animations", "animation"), ("skins", "skin")):
        if count := len(document.get(key, [])):
            find.loss(f"{count} {what}{'s are' if count > 1 else ' is'} left out.", "")
    buffers = Buffers(document, chunk, path, find)
    find.stop()
    meshes = tuple(_mesh(m, i, document, buffers, find) for i, m in enumerate(document.get("meshes", [])))
    nodes, roots = _tree(document, find)
    images = tuple(_image(image, i, buffers, find) for i, image in enumerate(document.get("images", [])))
    find.stop()
    kept = ("materials", "textures", "samplers", "cameras", "images", "extensions", "asset")
    rest = {key: document[key] for key in kept if key in document}
    return Gltf(nodes, roots, meshes, images, rest, tuple(find.problems))


def _mesh(
    mesh: dict[str, Any], index: int, document: dict[str, Any], buffers: Buffers, find: Findings
) -> tuple[str, tuple[Primitive, ...]]:
    name = str(mesh.get("name", ""))
    primitives = []
    for i, primitive in enumerate(mesh.get("primitives", [])):
        place = f"meshes[{index}].primitives[{i}]" + (f' "{name}"' if name else "")
        if primitive.get("targets"):
            find.loss("Morph targets are left out.", place)
        try:
            made = _triangles(primitive, document, buffers, place, find)
        except Damaged as error:
            find.error(f"{error}.", place)
            continue
        if made is not None:
            primitives.append(Primitive(made, int(primitive.get("material", -1))))
    return name, tuple(primitives)


def _triangles(
    primitive: dict[str, Any], document: dict[str, Any], buffers: Buffers, place: str, find: Findings
) -> Mesh | None:
    mode = primitive.get("mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN):
        what = "points" if mode == POINTS else "lines"
        find.loss(f"A set of {what} is left out.", place)
        return None
    attributes = primitive["attributes"]
    if "POSITION" not in attributes:
        find.error("A primitive must have the attribute POSITION.", place)
        return None
    points = buffers.accessor(attributes["POSITION"]).astype(np.float64)
    order = buffers.accessor(primitive["indices"]) if "indices" in primitive else np.arange(len(points))
    order = np.asarray(order, np.int64)
    if order.size and order.max() >= len(points):
        raise Damaged(f"An index must be below {len(points)}, the number of vertices; got {order.max()}")
    if mode == TRIANGLES:
        faces = order[: len(order) // 3 * 3].reshape(-1, 3)
    elif mode == FAN:
        faces = np.stack([np.full(max(len(order) - 2, 0), order[:1].sum()), order[1:-1], order[2:]], axis=1)
    else:
        faces = np.stack([order[:-2], order[1:-1], order[2:]], axis=1)
        faces[1::2] = faces[1::2, ::-1]
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise Damaged(f"Every vertex must be finite; vertex {row} is {tuple(points[row].tolist())}")
    if "COLOR_0" in attributes:
        find.loss("Colours at the vertices are left out.", place)
    faces = faces[with_area(points, faces, find, place)]
    if not len(faces):
        find.loss("A mesh without any triangle that has an area is left out.", place)
        return None
    uv = None
    which = uv_set(document, primitive.get("material", -1))
    if f"TEXCOORD_{which}" in attributes:
        uv = buffers.accessor(attributes[f"TEXCOORD_{which}"]).astype(np.float64)
        uv = np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)  # v goes down in glTF
    if "NORMAL" not in attributes:
        return from_corners(points, faces, uv=None if uv is None else uv[faces])
    normals = buffers.accessor(attributes["NORMAL"]).astype(np.float64)
    if len(normals) != len(points) or (uv is not None and len(uv) != len(points)):
        raise Damaged("All attributes of a primitive must be equally many")
    return Mesh(points, faces.astype(np.int32), unit_normals(points, faces, normals), uv)


def texture_uses(material: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The texture references of a material, by what they are for."""
    pbr = material.get("pbrMetallicRoughness", {})
    coat = material.get("extensions", {}).get("KHR_materials_clearcoat", {})
    found = {
        "baseColor": pbr.get("baseColorTexture"),
        "metallicRoughness": pbr.get("metallicRoughnessTexture"),
        "normal": material.get("normalTexture"),
        "occlusion": material.get("occlusionTexture"),
        "emissive": material.get("emissiveTexture"),
        "clearcoat": coat.get("clearcoatTexture"),
        "clearcoatRoughness": coat.get("clearcoatRoughnessTexture"),
    }
    return {use: reference for use, reference in found.items() if reference is not None}


def uv_set(document: dict[str, Any], material: int) -> int:
    """The set of texture coordinates that a material's first texture reads."""
    materials = document.get("materials", [])
    if not 0 <= material < len(materials):
        return 0
    for reference in texture_uses(materials[material]).values():
        transform = reference.get("extensions", {}).get("KHR_texture_transform", {})
        return int(transform.get("texCoord", reference.get("texCoord", 0)))
    return 0


def _tree(document: dict[str, Any], find: Findings) -> tuple[tuple[Node, ...], tuple[int, ...]]:
    written = document.get("nodes", [])
    nodes = []
    for i, node in enumerate(written):
        matrix = _matrix(node)
        if not np.isfinite(matrix).all():
            find.error("A transform must be finite.", f"nodes[{i}]")
        for key in ("mesh", "camera"):
            have = len(document.get(f"{key}es" if key == "mesh" else f"{key}s", []))
            if key in node and not 0 <= node[key] < have:
                find.error(f"There are {have} {key} entries; got index {node[key]}.", f"nodes[{i}].{key}")
        light = node.get("extensions", {}).get("KHR_lights_punctual", {}).get("light", -1)
        nodes.append(
            Node(
                str(node.get("name", "")),
                matrix,
                tuple(node.get("children", [])),
                node.get("mesh", -1),
                node.get("camera", -1),
                light,
            )
        )
    children = [c for n in nodes for c in n.children]
    scenes = document.get("scenes", [])
    if scenes:
        number = document.get("scene", 0)
        if not 0 <= number < len(scenes):
            find.error(f"There are {len(scenes)} scenes; got index {number}.", "scene")
            number = 0
        roots = tuple(scenes[number].get("nodes", []))
        if len(scenes) > 1:
            find.loss(f"Of {len(scenes)} scenes only scene {number} is read.", "scenes")
    else:
        roots = tuple(i for i in range(len(nodes)) if i not in set(children))
    if any(not isinstance(i, int) or not 0 <= i < len(nodes) for i in (*children, *roots)):
        find.error(f"A child must be one of the {len(nodes)} nodes.", "nodes")
    elif len(set((*children, *roots))) < len(children) + len(roots):
        find.error("Every node must have one parent at most.", "nodes")
    else:
        level, depth = list(roots), 0
        while level and depth <= MAX_DEPTH:
            level, depth = [c for i in level for c in nodes[i].children], depth + 1
        if level:
            find.error(f"The tree of nodes must not be deeper than {MAX_DEPTH}.", "nodes")
    return tuple(nodes), roots


def _matrix(node: dict[str, Any]) -> np.ndarray:
    if "matrix" in node:
        return np.array(node["matrix"], np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.asarray(node.get("scale", (1, 1, 1)), np.float64)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix


def _image(image: dict[str, Any], index: int, buffers: Buffers, find: Findings) -> bytes | str:
    place = f"images[{index}]"
    if "uri" in image:
        return buffers.uri(image["uri"], place)
    try:
        return bytes(buffers.view(image["bufferView"])[0])
    except Damaged as error:
        find.error(f"{error}.", place)
        return b""
