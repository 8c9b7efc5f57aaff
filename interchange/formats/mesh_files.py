"""What the files of triangles without units or scenes have in common: STL, OBJ, PLY, OFF.

Such a file does not say what a length of 1 is, so ``--unit`` must. Its axes are kept: z is up, as on the machines
that read STL. Vertices at one place are welded; where the file gives no normals they are smooth up to a crease
angle (``surface.CREASE_DEG``). What makes a surface unusable (faces on vertices that are not there, vertices that
are not finite, no faces) is an error; what is merely odd (open or badly wound surfaces, triangles without area) is
noted.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from interchange.formats.base import Options
from interchange.formats.document import Document
from interchange.formats.gltf_data import Gltf, Node, Primitive
from interchange.formats.isolation import isolated
from interchange.formats.surface import (
    Findings,
    check,
    crease_mesh,
    describe,
    unit_normals,
    weld,
    with_area,
)
from interchange.mesh import Mesh, from_corners
from interchange.problems import FileError, Problem, Where, did_you_mean

PRELOAD = ("trimesh.exchange.load", "scipy.sparse.csgraph")
UNITS = {
    "nm": 1e-9,
    "um": 1e-6,
    "mm": 1e-3,
    "cm": 1e-2,
    "dm": 0.1,
    "m": 1.0,
    "km": 1e3,
    "mil": 25.4e-6,
    "in": 0.0254,
    "ft": 0.3048,
    "yd": 0.9144,
}
ALSO = {
    "µm": "um",
    "μm": "um",
    "micron": "um",
    "microns": "um",
    "micrometer": "um",
    "micrometre": "um",
    "millimeter": "mm",
    "millimetre": "mm",
    "millimeters": "mm",
    "millimetres": "mm",
    "centimeter": "cm",
    "centimetre": "cm",
    "meter": "m",
    "metre": "m",
    "meters": "m",
    "metres": "m",
    "thou": "mil",
    "inch": "in",
    "inches": "in",
    '"': "in",
    "foot": "ft",
    "feet": "ft",
    "yard": "yd",
}
SECONDS, SECONDS_PER_MEGABYTE = 30.0, 2.0


@dataclass(frozen=True, eq=False)
class Part:
    """A parser's result, in the file's unit. ``material`` names one of the file's; "" is none."""

    name: str
    points: np.ndarray  # (V, 3)
    faces: np.ndarray  # (F, 3)
    normals: np.ndarray | None = None  # (F, 3, 3) at the corners
    uv: np.ndarray | None = None  # (F, 3, 2) at the corners, v up
    material: str = ""


Parser = Callable[[str, Findings], list[Part]]


def metres_per_unit(name: str) -> float:
    """How many metres a unit has. Raises LookupError with a hint."""
    word = name.strip().lower()
    word = ALSO.get(word, word)
    if word not in UNITS:
        hint = did_you_mean(word, [*UNITS, *ALSO])
        raise LookupError(f'"{name}" is not a known unit of length.{hint} Known: {", ".join(UNITS)}.')
    return UNITS[word]


def read_mesh(
    path: Path,
    options: Options,
    parser: Parser,
    materials: Callable[[Any, set[str]], Mapping[str, Any]] | None = None,
) -> Document:
    """A stage in the file's unit, one mesh prim a part. ``materials`` authors those that the parts name.

    Raises FileError with every problem; without ``options.unit`` it says how large the part would be.
    """
    from interchange.formats.gltf_author import author_tree
    from interchange.formats.usd_author import new_stage

    where = Where(str(path))
    unit = None
    if options.unit is not None:
        try:
            unit = metres_per_unit(options.unit)
        except LookupError as error:
            raise FileError(Problem(str(error.args[0]), where)) from None
    megabytes = path.stat().st_size / 1e6
    tree = isolated(assemble, path, parser, unit, seconds=SECONDS + SECONDS_PER_MEGABYTE * megabytes)
    assert unit is not None  # else assemble has raised
    stage = new_stage(unit)
    named = materials(stage, set(tree.json["materials"])) if materials else {}
    numbered = {i: named[name] for i, name in enumerate(tree.json["materials"]) if name in named}
    author_tree(stage, tree, numbered, [n.name or path.stem for n in tree.nodes])
    return Document(stage, path, list(tree.problems))


def assemble(path: str, parser: Parser, unit: float | None) -> Gltf:
    """Parse, check, weld and smooth; lengths in metres. Runs in isolation."""
    find = Findings(path)
    parts = parser(path, find)
    find.stop()
    sound = [part for part in parts if check(part.points, part.faces, find, part.name)]
    if not parts:
        find.error("A mesh must have faces; this file has none.")
    if unit is None and sound:
        find.error(_unit_wanted(sound))
    find.stop()
    assert unit is not None
    materials = list(dict.fromkeys(p.material for p in sound if p.material))
    meshes: dict[str, list[Primitive]] = {}
    for part in sound:
        mesh = _surface(part, unit, find)
        if mesh is not None:
            number = materials.index(part.material) if part.material else -1
            meshes.setdefault(part.name, []).append(Primitive(mesh, number))
    if not meshes:
        find.error("A mesh must have a triangle with an area; this file has none.")
    find.stop()
    nodes = tuple(Node(name, np.eye(4), mesh=i) for i, name in enumerate(meshes))
    return Gltf(
        nodes,
        tuple(range(len(nodes))),
        tuple((name, tuple(primitives)) for name, primitives in meshes.items()),
        (),
        {"materials": materials},
        tuple(find.problems),
    )


def _unit_wanted(parts: Sequence[Part]) -> str:
    used = [p.points[p.faces.ravel()] for p in parts]
    size = float((np.max([u.max(0) for u in used], 0) - np.min([u.min(0) for u in used], 0)).max())
    sizes = ", ".join(f"--unit {word}: {_length(size * UNITS[word])}" for word in ("mm", "in", "m"))
    return f"The file has no unit of length; one must be given. Its largest side would be, by {sizes}."


def _length(metres: float) -> str:
    for word, scale in (("m", 1.0), ("mm", 1e-3)):
        if metres >= scale:
            return f"{metres / scale:.4g} {word}"
    return f"{metres / 1e-6:.4g} um"


def _surface(part: Part, unit: float, find: Findings) -> Mesh | None:
    points, faces = weld(part.points, part.faces)
    rows = with_area(points, faces, find, part.name)
    if not rows.any():
        return None
    faces, uv = faces[rows], None if part.uv is None else part.uv[rows]
    describe(points, faces, find, part.name)
    if part.normals is None:
        return crease_mesh(points * unit, faces, uv)
    corners = np.arange(faces.size).reshape(-1, 3)
    normals = unit_normals(points[faces.ravel()], corners, part.normals[rows].reshape(-1, 3))
    return from_corners(points * unit, faces, normals.reshape(-1, 3, 3), uv)


def trimesh_parts(path: str, kind: str) -> list[Part]:
    """What trimesh reads from a file: every geometry with faces, unprocessed."""
    import trimesh

    scene = trimesh.load_scene(path, file_type=kind, process=False)
    alone = len(scene.geometry) == 1
    parts = []
    for name, mesh in scene.geometry.items():
        if isinstance(mesh, trimesh.Trimesh):
            points = np.asarray(mesh.vertices, np.float64)
            parts.append(
                Part("" if alone and name == Path(path).name else str(name), points, np.asarray(mesh.faces))
            )
    return parts
