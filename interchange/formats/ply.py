"""PLY, the Polygon File Format of Stanford: ASCII and binary; vertex normals are kept, colours are not."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from interchange.formats.base import Format, Options
from interchange.formats.document import Document
from interchange.formats.mesh_files import Part, read_mesh, trimesh_parts
from interchange.formats.surface import Findings


class PlyFormat(Format):
    name = "PLY"
    extensions = (".ply",)

    def recognises(self, head: bytes) -> bool:
        return head.startswith((b"ply\n", b"ply\r"))

    def read(self, path: Path, options: Options) -> Document:
        """A stage in ``options.unit``. Raises FileError."""
        return read_mesh(path, options, parse)


def parse(path: str, find: Findings) -> list[Part]:
    data = Path(path).read_bytes()
    head, end, body = data.partition(b"end_header")
    if not head.startswith(b"ply") or not end:
        find.error('A PLY file must have a header from "ply" to "end_header".')
        find.stop()
    text = head.decode("latin-1")
    counts = {name: int(n) for name, n in re.findall(r"^element\s+(\w+)\s+(\d+)\s*$", text, re.MULTILINE)}
    if not counts.get("vertex") or not counts.get("face"):
        got = f"{counts.get('vertex', 0)} vertices and {counts.get('face', 0)} faces"
        find.error(f"A mesh must have vertices and faces; this file announces {got}.")
    elif counts["vertex"] + counts["face"] > len(body):
        find.error(f"The file announces {counts}; its {len(body)} bytes of data cannot hold them.")
    find.stop()
    if re.search(r"^property\s+\w+\s+(red|r)\s*$", text, re.MULTILINE):
        find.loss("Colours at the vertices or faces are left out.")
    parts = trimesh_parts(path, "ply")
    if parts and re.search(r"^property\s+\w+\s+nx\s*$", text, re.MULTILINE):
        parts = [replace(parts[0], normals=_normals(path)[parts[0].faces])]
    return parts


def _normals(path: str) -> np.ndarray:
    import trimesh

    return np.array(trimesh.load_mesh(path, process=False).vertex_normals, np.float64)
