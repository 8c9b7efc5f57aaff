"""STL, binary and ASCII, several solids included. 3D Systems: StereoLithography Interface Specification, 1989.

The facets' own normals are not used: they are flat, and often wrong.
"""

import re
import struct
from pathlib import Path

from interchange.formats.base import Format, Options
from interchange.formats.document import Document
from interchange.formats.mesh_files import Part, read_mesh, trimesh_parts
from interchange.formats.surface import Findings

HEADER, RECORD = 84, 50  # bytes


class StlFormat(Format):
    name = "STL"
    extensions = (".stl",)

    def recognises(self, head: bytes) -> bool:
        return head.startswith(b"solid") and b"facet" in head

    def read(self, path: Path, options: Options) -> Document:
        """A stage in ``options.unit``. Raises FileError."""
        return read_mesh(path, options, parse)


def parse(path: str, find: Findings) -> list[Part]:
    data = Path(path).read_bytes()
    count = struct.unpack_from("<I", data, HEADER - 4)[0] if len(data) >= HEADER else -1
    if len(data) != HEADER + RECORD * count:
        if not re.match(rb"\s*solid\b", data):
            says = f"{count} triangles" if count >= 0 else "no complete header"
            want = f", {HEADER + RECORD * count} bytes" if count >= 0 else ""
            find.error(f"The file is damaged: a binary STL of {says}{want}; it has {len(data)} bytes.")
        else:
            _check_text(data, find)
    find.stop()
    return trimesh_parts(path, "stl")


def _check_text(data: bytes, find: Findings) -> None:
    """trimesh reads numbers wherever it finds them; that they are facets is checked here."""
    facets, ends, vertices = (
        len(re.findall(word, data)) for word in (rb"\bfacet\b", rb"\bendfacet\b", rb"\bvertex\b")
    )
    if vertices != 3 * facets or ends != facets:
        find.error(
            f"The file is damaged: {facets} facets need as many endfacet and three times as many vertex lines; "
            f"got {ends} and {vertices}."
        )
    elif not facets:
        find.error("A mesh must have faces; this file has none.")
    elif not re.search(rb"\bendsolid\b", data):
        find.error('The file ends early: "endsolid" is missing.')
