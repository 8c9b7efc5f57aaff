"""COLLADA's groups of polygons as flat arrays: corners a face, and each corner's indices into the sources."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from interchange.formats.collada.library import Library
from interchange.formats.collada.polygon import is_convex, triangulate
from interchange.formats.collada.source import Sources, integers, whole

SURFACES = ("triangles", "tristrips", "trifans", "polylist", "polygons")
CURVES = ("lines", "linestrips")
DRAWN = ("POSITION", "NORMAL", "TEXCOORD", "COLOR")


@dataclass(frozen=True)
class Input:
    semantic: str
    set: int
    offset: int
    values: Any  # (N, width) array; None for what is not drawn


@dataclass(frozen=True)
class Group:
    """``counts`` (F,) corners a face; ``corners`` (sum of counts, K) indices, one column an input offset."""

    symbol: str
    counts: np.ndarray
    corners: np.ndarray
    inputs: tuple[Input, ...]
    element: Any

    def first(self, semantic: str, set_: int | None = None) -> Input | None:
        return next((i for i in self.inputs if i.semantic == semantic and set_ in (None, i.set)), None)


def read_group(element: Any, lib: Library, sources: Sources) -> Group | None:
    """One of ``SURFACES``, concave faces and holes cut into triangles. None, with findings, if it cannot be read."""
    inputs = _inputs(element, lib, sources)
    if inputs is None:
        return None
    stride = 1 + max(i.offset for i in inputs)
    faces = _faces(element, stride, lib)
    if faces is None:
        return None
    counts, corners, holes = faces
    position = next(i for i in inputs if i.semantic == "POSITION")
    for one in inputs:
        column = corners[:, one.offset]
        if one.values is not None and column.size and (column.min() < 0 or column.max() >= len(one.values)):
            message = f"Indices into {one.semantic} must lie in [0, {len(one.values) - 1}]; got "
            lib.find.error(f"{message}{column.min()} to {column.max()}.", element)
            return None
    points = position.values[corners[:, position.offset]]
    points = np.pad(points[:, :3], ((0, 0), (0, max(0, 3 - points.shape[1]))))
    if not (np.abs(points) < np.finfo(np.float32).max).all():
        lib.find.error("Positions that are used must be finite numbers (of single precision).", element)
        return None
    try:
        counts, corners = _simple_faces(counts, corners, holes, points)
    except ValueError as error:
        lib.find.error(str(error), element)
        return None
    return Group(element.get("material") or "", counts, corners, inputs, element)


def _inputs(element: Any, lib: Library, sources: Sources) -> tuple[Input, ...] | None:
    found: list[Input] = []
    bad = False
    sets: dict[str, int] = {}

    def add(given: Any, offset: int, set_: int) -> None:
        nonlocal bad
        semantic = given.get("semantic") or ""
        if semantic not in DRAWN:  # may be names, or anything
            found.append(Input(semantic, set_, offset, None))
            return
        source = lib.resolve(given.get("source"), given, "source")
        values = None if source is None else sources.numbers(source)
        if values is None:
            bad = True
        else:
            found.append(Input(semantic, set_, offset, values))

    for given in element.findall("input"):
        offset = whole(given, "offset", lib, 0)
        semantic = given.get("semantic") or ""
        set_ = whole(given, "set", lib, sets.get(semantic, -1) + 1)
        if offset is None or set_ is None or offset > 1000:
            lib.find.error("An input's offset must be a small whole number.", given)
            bad = True
            continue
        sets[semantic] = max(sets.get(semantic, -1), set_)
        if semantic != "VERTEX":
            add(given, offset, set_)
            continue
        vertices = lib.resolve(given.get("source"), given, "vertices")
        if vertices is None:
            bad = True
            continue
        count: dict[str, int] = {}
        for inner in vertices.findall("input"):
            name = inner.get("semantic") or ""
            add(inner, offset, count.setdefault(name, 0))
            count[name] += 1
    if bad:
        return None
    if not any(i.semantic == "POSITION" for i in found):
        lib.find.error("Polygons must have an input VERTEX with positions.", element)
        return None
    return tuple(found)


Faces = tuple[np.ndarray, np.ndarray, dict[int, list[int]]]


def _faces(element: Any, stride: int, lib: Library) -> Faces | None:
    """Counts, corners, and for faces with holes the corners of each of their rings."""
    count = whole(element, "count", lib)
    if count is None:
        return None
    holes: dict[int, list[int]] = {}
    runs: list[np.ndarray] = []
    for child in element:
        if child.tag == "p":
            run = _indices(child, stride, lib)
            if run is None:
                return None
            runs.append(run)
        elif child.tag == "ph":
            rings = [_indices(r, stride, lib) for r in child if r.tag in ("p", "h")]
            if not rings or any(r is None for r in rings):
                lib.find.error("A polygon with holes must hold <p> and <h>.", child)
                return None
            holes[len(runs)] = [len(r) for r in rings if r is not None]
            runs.append(np.concatenate([r for r in rings if r is not None]))
    nothing = np.zeros((0, stride), np.int64)
    corners = np.concatenate(runs) if runs else nothing
    counts: np.ndarray
    match element.tag:
        case "triangles":
            counts = np.full(len(corners) // 3, 3, np.int64)
            given = len(corners) / 3
        case "polylist":
            vcount = element.find("vcount")
            sizes = np.zeros(0, np.int64) if vcount is None else integers(vcount, lib)
            if sizes is None:
                return None
            if (sizes < 0).any() or sizes.sum() != len(corners):
                message = f"vcount adds up to {sizes.sum()} corners; <p> holds {len(corners)}."
                lib.find.error(message, element)
                return None
            counts, given = sizes, float(len(sizes))
        case "polygons":
            counts = np.array([len(r) for r in runs], np.int64)
            given = float(len(runs))
        case _:
            given = float(len(runs))
            corners = np.concatenate([_strip(r, element.tag) for r in runs]) if runs else nothing
            counts = np.full(len(corners) // 3, 3, np.int64)
    if given != count:
        lib.find.error(f"The count says {count} {element.tag}; there are {given:g}.", element)
        return None
    return counts, corners, holes


def _indices(p: Any, stride: int, lib: Library) -> np.ndarray | None:
    values = integers(p, lib)
    if values is None:
        return None
    if len(values) % stride:
        lib.find.error(f"<{p.tag}> must hold {stride} indices a corner; {len(values)} do not divide.", p)
        return None
    return values.reshape(-1, stride)


def _strip(run: np.ndarray, tag: str) -> np.ndarray:
    """(3 T, K) corners of a strip's or fan's triangles, all turning as the first."""
    n = max(len(run) - 2, 0)
    i = np.arange(n)
    if tag == "trifans":
        triangles = np.stack([np.zeros(n, int), i + 1, i + 2], axis=1)
    else:
        odd = i % 2
        triangles = np.stack([i, i + 1 + odd, i + 2 - odd], axis=1)
    return run[triangles.ravel()]


def _simple_faces(
    counts: np.ndarray, corners: np.ndarray, holes: dict[int, list[int]], points: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Convex faces as they are, the others as triangles in their place; faces with less than three corners go."""
    starts = np.cumsum(counts) - counts
    keep = counts == 3
    for n in np.unique(counts[counts > 3]):
        which = np.flatnonzero(counts == n)
        keep[which] = is_convex(points[starts[which][:, None] + np.arange(n)])
    for face in holes:
        keep[face] = False
    pieces: dict[int, np.ndarray] = {}
    for face in np.flatnonzero(~keep & (counts > 2)):
        start = starts[face]
        sizes = holes.get(int(face), [int(counts[face])])
        ends = start + np.cumsum(sizes)
        rings = [points[end - size : end] for end, size in zip(ends, sizes, strict=True)]
        pieces[int(face)] = start + triangulate(rings).ravel()
    if keep.all():
        return counts, corners
    new_counts, index = [], []
    for face in range(len(counts)):
        if keep[face]:
            new_counts.append([counts[face]])
            index.append(np.arange(starts[face], starts[face] + counts[face]))
        elif face in pieces:
            new_counts.append([3] * (len(pieces[face]) // 3))
            index.append(pieces[face])
    empty = np.zeros(0, np.int64)
    return np.concatenate([empty, *new_counts]).astype(np.int64), corners[
        np.concatenate([empty, *index]).astype(int)
    ]
