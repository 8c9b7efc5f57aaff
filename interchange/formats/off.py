"""OFF, the Object File Format of Geomview: vertices and polygons as text."""

import re
from pathlib import Path

from interchange.formats.base import Format, Options
from interchange.formats.document import Document
from interchange.formats.mesh_files import Part, read_mesh, trimesh_parts
from interchange.formats.surface import Findings

SHORTEST_VERTEX, SHORTEST_FACE = 6, 8  # bytes: "0 0 0\n" and "3 0 1 2\n"


class OffFormat(Format):
    name = "OFF"
    extensions = (".off",)

    def recognises(self, head: bytes) -> bool:
        return re.match(rb"OFF\s", head) is not None

    def read(self, path: Path, options: Options) -> Document:
        """A stage in ``options.unit``. Raises FileError."""
        return read_mesh(path, options, parse)


def parse(path: str, find: Findings) -> list[Part]:
    data = Path(path).read_bytes()
    text = re.sub(rb"#[^\n]*", b"", data)
    head = re.match(rb"\s*OFF\s+(-?\d+)\s+(-?\d+)\s+(-?\d+)\s", text)
    if head is None:
        find.error("An OFF file must begin with OFF and the numbers of its vertices, faces and edges.")
        find.stop()
        raise AssertionError
    vertices, faces = int(head[1]), int(head[2])
    if vertices < 0 or faces < 0 or vertices * SHORTEST_VERTEX + faces * SHORTEST_FACE > len(data):
        find.error(
            f"The file announces {vertices} vertices and {faces} faces; its {len(data)} bytes cannot hold them."
        )
    find.stop()
    return trimesh_parts(path, "off")
