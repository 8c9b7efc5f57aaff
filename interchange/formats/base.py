"""What every file format is: one class a module, found by its folder.

A scene file, whatever its format, becomes a USD stage in memory (a ``Document``): reading a scene, editing and
writing then know one kind of thing. Images, photometric files and measurements become their own types.
Heavy libraries are imported inside the functions that need them, so that the catalogue costs nothing.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from interchange.problems import FileError, Problem, Where

if TYPE_CHECKING:
    from interchange.formats.document import Document


@dataclass(frozen=True)
class Options:
    """How to read what a file leaves open."""

    unit: str | None = None  # for files without one: "mm", "inch", ...
    chord_mm: float = 0.1  # largest distance between a CAD surface and its triangles
    angle_deg: float = 20.0  # largest angle between neighbouring triangles' normals on a CAD surface
    resolution: tuple[int, int] | None = None  # px, for calibrations that do not say it
    pixel_um: float | None = None  # pixel pitch, for calibrations: they know focal lengths in pixels alone


class Format:
    name: ClassVar[str]  # as a person says it: "STEP", "OpenEXR"
    extensions: ClassVar[tuple[str, ...]]  # lower case, with the dot
    holds: ClassVar[str] = "scene"  # or "image", "photometry", "measurement"
    writes: ClassVar[bool] = False

    def recognises(self, head: bytes) -> bool:
        """Whether a file that begins with these bytes (up to 512) is of this format, whatever its extension."""
        return False

    def read(self, path: Path, options: Options) -> Any:
        """A ``Document`` for a scene, else the format's own type. Raises FileError with every problem."""
        raise NotImplementedError

    def write(self, document: "Document", path: Path) -> list[Problem]:
        """Write a scene; returns what the format could not carry."""
        raise FileError(Problem(f"{self.name} files can be read here, not written.", Where(str(path))))
