"""STEP parts (AP203, AP214, AP242): exact surfaces cut into triangles no farther from them than a chord tolerance.

Open CASCADE, by way of cascadio, reads the file and meshes it; its normals are the surface's own. The kernel
keeps the chord tolerance on cylinders; on a sphere it leaves up to 1.8 times as much, on a spline surface 20
times was seen. ``refine`` brings the triangles closer where that is so.

Part names, the tree of assemblies and the colours of parts and faces come along. A STEP colour is sRGB; here it
is a Lambert albedo, linear. What a file shows beside its parts (points, curves, product and manufacturing
information, construction geometry) is left out and listed.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from interchange.brdf.lambert import Lambert
from interchange.formats.base import Format, Options
from interchange.formats.document import Document
from interchange.formats.gltf_data import Gltf, Primitive, parse
from interchange.formats.isolation import isolated
from interchange.formats.refine import deviation, refine
from interchange.material import Material
from interchange.problems import BrightfieldError, FileError, Problem, Severity, Where

PRELOAD = ("cascadio",)
MILLIMETRE = 1e-3
Kind = Literal["step", "iges"]
SECONDS, SECONDS_PER_MEGABYTE = 60.0, 60.0
UNNAMED = re.compile(
    r"=>\[|(SOLID|COMPOUND|COMPSOLID|SHELL|FACE|WIRE|EDGE|VERTEX)?$"
)  # the kernel's own words


@dataclass(frozen=True)
class Tessellation:
    """``tree``: lengths in metres, z up. ``deviation``: largest distance of the triangles from the surface, m."""

    tree: Gltf
    deviation: float


class StepFormat(Format):
    name = "STEP"
    extensions = (".step", ".stp", ".p21")

    def recognises(self, head: bytes) -> bool:
        return head.lstrip().startswith(b"ISO-10303-21")

    def read(self, path: Path, options: Options) -> Document:
        """A stage in millimetres with one mesh prim a part. Raises FileError."""
        return read_cad(path, options, tessellate_step)


def read_cad(path: Path, options: Options, parser: Callable[[str, float, float], Tessellation]) -> Document:
    for name, value, high in (("chord", options.chord_mm, 1e6), ("angle", options.angle_deg, 180.0)):
        if not 0 < value <= high:
            unit = "mm" if name == "chord" else "degrees"
            raise BrightfieldError(f"The {name} tolerance must lie in (0, {high:g}] {unit}; got {value:g}.")
    megabytes = path.stat().st_size / 1e6
    parts: Tessellation = isolated(
        parser,
        path,
        options.chord_mm,
        options.angle_deg,
        seconds=SECONDS + SECONDS_PER_MEGABYTE * megabytes,
    )
    return Document(_stage(parts.tree, path.stem), path, list(parts.tree.problems))


def _stage(tree: Gltf, name: str) -> Any:
    from pxr import UsdGeom

    from interchange.formats.gltf_author import author_tree
    from interchange.formats.usd_author import author_material, free_path, new_stage

    stage = new_stage(MILLIMETRE)
    shown = {p.material for n in tree.nodes if n.mesh >= 0 for p in tree.meshes[n.mesh][1]}
    materials = {}
    if shown - {-1}:
        UsdGeom.Scope.Define(stage, "/World/Materials")
    for i, colour in enumerate(_colours(tree)):
        if i in shown:
            material = Material("colour_" + _hexadecimal(colour), Lambert(colour))
            place = free_path(stage, "/World/Materials", material.name)
            materials[i] = author_material(stage, place, material)
    author_tree(stage, tree, materials, part_names(tree, name))
    return stage


def _colours(tree: Gltf) -> list[tuple[float, float, float]]:
    found = []
    for material in tree.json.get("materials", []):
        r, g, b = material.get("pbrMetallicRoughness", {}).get("baseColorFactor", [1, 1, 1, 1])[:3]
        found.append((float(np.clip(r, 0, 1)), float(np.clip(g, 0, 1)), float(np.clip(b, 0, 1))))
    return found


def _hexadecimal(colour: tuple[float, float, float]) -> str:
    """A linear colour in sRGB's usual six digits, as a CAD program shows it."""
    c = np.array(colour)
    srgb = np.where(c <= 0.0031308, 12.92 * c, 1.055 * np.power(c, 1 / 2.4) - 0.055)
    return bytes(np.round(srgb * 255).astype(np.uint8)).hex()


def part_names(tree: Gltf, default: str = "part") -> list[str]:
    """What each node is called: by its own name, its shape's, or its product's where those are the kernel's."""
    names = [n.name for n in tree.nodes]
    stack = [(i, default) for i in tree.roots]
    while stack:
        i, above = stack.pop()
        node = tree.nodes[i]
        shape = tree.meshes[node.mesh][0] if node.mesh >= 0 else ""
        names[i] = next((n for n in (node.name, shape) if not UNNAMED.match(n)), above)
        stack += [(child, names[i]) for child in node.children]
    return names


def tessellate_step(path: str, chord_mm: float, angle_deg: float) -> Tessellation:
    """Runs in isolation."""
    return tessellate(path, "step", chord_mm, angle_deg)


def tessellate(path: str, kind: Kind, chord_mm: float, angle_deg: float, scale: float = 1.0) -> Tessellation:
    """Runs in isolation. ``scale``: metres in one unit of what the kernel gives back."""
    data = Path(path).read_bytes()
    where = Where(path)
    glb, said = kernel_mesh(data, kind, chord_mm, angle_deg)
    if not glb:
        raise FileError(Problem(_reason(said), where))
    tree = _scaled(_without_construction(parse(glb, path), data, path), scale)
    chord, angle = chord_mm * MILLIMETRE, float(np.radians(angle_deg))
    meshes = tuple(
        (name, tuple(replace(p, mesh=refine(p.mesh, chord, angle)) for p in primitives))
        for name, primitives in tree.meshes
    )
    worst = max((deviation(p.mesh) for _, primitives in meshes for p in primitives), default=-1.0)
    if worst < 0:
        raise FileError(Problem("The file holds no surface that could be meshed.", where))
    problems = _named(tree)
    if worst > chord:
        text = f"The triangles keep to {worst / MILLIMETRE:.3g} mm of the surface; {chord_mm:g} mm were asked for."
        problems.append(Problem(text, where, Severity.NOTE))
    problems += [
        Problem(f"The CAD kernel reports: {line}; something may be missing.", where, Severity.LOSS)
        for line in dict.fromkeys(re.findall(r"\*+ ERR (.*?)\s*\*+", said))
    ]
    return Tessellation(_shared(replace(tree, meshes=meshes, problems=tuple(problems))), worst)


def _named(tree: Gltf) -> list[Problem]:
    """What the kernel's tree left out, by part; not what is a matter of its triangles alone."""
    part = {node.mesh: name for node, name in zip(tree.nodes, part_names(tree), strict=True)}
    found = []
    for problem in tree.problems:
        number = re.match(r"meshes\[(\d+)\]", problem.where.prim)
        if problem.severity is not Severity.NOTE:
            prim = part.get(int(number[1]), "") if number else problem.where.prim
            found.append(replace(problem, where=replace(problem.where, prim=prim)))
    return found


def kernel_mesh(data: bytes, kind: Kind, tolerance: float, angle_deg: float) -> tuple[bytes, str]:
    """The kernel's GLB, empty where it failed, and what it printed."""
    import cascadio

    printed = os.memfd_create("printed")
    kept = os.dup(1), os.dup(2)
    os.dup2(printed, 1), os.dup2(printed, 2)
    try:
        glb = cascadio.load(
            data,
            file_type=kind,
            tol_linear=tolerance,
            tol_angular=float(np.radians(angle_deg)),
            tol_relative=False,
        )
    finally:
        os.dup2(kept[0], 1), os.dup2(kept[1], 2)
        for fd in kept:
            os.close(fd)
    with os.fdopen(printed, "rb") as file:
        file.seek(0)
        said = file.read(1 << 16).decode(errors="replace")
    return glb, re.sub(r"\x1b\[[0-9;]*m", "", said)


def _reason(said: str) -> str:
    if found := re.search(r"Line (\d+): Incorrect syntax: ([^*]*)", said):
        return f"The file is damaged: {found[2].strip()} at line {found[1]}."
    if "No shapes" in said or "Failed to transfer" in said:
        return "The file holds no shape that could be read."
    return "The file is damaged, or not what its extension says: the CAD kernel cannot read it."


def _without_construction(tree: Gltf, data: bytes, path: str) -> Gltf:
    """Leave out open surfaces beside a solid where the file says that it carries construction geometry."""
    if b"CONSTRUCTIVE_GEOMETRY_REPRESENTATION" not in data:
        return tree
    names = [name for name, _ in tree.meshes]
    if "SOLID" not in names or "COMPOUND" not in names:
        return tree
    loose = [i for i, (name, primitives) in enumerate(tree.meshes) if name == "COMPOUND" and primitives]
    if not loose:
        return tree
    text = f"{len(loose)} set(s) of construction surfaces are left out."
    meshes = tuple((name, () if i in loose else p) for i, (name, p) in enumerate(tree.meshes))
    return replace(tree, meshes=meshes, problems=(*tree.problems, Problem(text, Where(path), Severity.LOSS)))


def _scaled(tree: Gltf, scale: float) -> Gltf:
    if scale == 1.0:
        return tree
    meshes = tuple(
        (name, tuple(replace(p, mesh=replace(p.mesh, vertices=p.mesh.vertices * scale)) for p in primitives))
        for name, primitives in tree.meshes
    )
    return replace(tree, meshes=meshes)


def _shared(tree: Gltf) -> Gltf:
    """Nodes that show equal meshes show the same one; nodes that show nothing are gone, and so are the kernel's
    own nodes between a product and its only shape."""
    first: dict[tuple[Any, ...], int] = {}
    to = [first.setdefault(_key(primitives), i) for i, (_, primitives) in enumerate(tree.meshes)]
    nodes = [
        replace(n, mesh=to[n.mesh] if n.mesh >= 0 and tree.meshes[n.mesh][1] else -1) for n in tree.nodes
    ]
    order, stack = list[int](), list(tree.roots)
    while stack:
        order.append(stack.pop())
        stack += nodes[order[-1]].children
    shows = [n.mesh >= 0 for n in nodes]
    for i in reversed(order):
        children = tuple(c for c in nodes[i].children if shows[c])
        shows[i] = shows[i] or bool(children)
        nodes[i] = replace(nodes[i], children=children)
        if len(children) == 1 and nodes[i].mesh < 0 and UNNAMED.match(nodes[children[0]].name):
            only = nodes[children[0]]
            nodes[i] = replace(only, name=nodes[i].name, matrix=nodes[i].matrix @ only.matrix)
    return replace(tree, nodes=tuple(nodes), roots=tuple(i for i in tree.roots if shows[i]))


def _key(primitives: tuple[Primitive, ...]) -> tuple[Any, ...]:
    return tuple(
        (p.material, p.mesh.vertices.tobytes(), p.mesh.faces.tobytes(), p.mesh.normals.tobytes())
        for p in primitives
    )
