"""A series by its path: a ``captures.json``, a folder that holds one, or a folder that `brightfield sweep` wrote."""

from pathlib import Path

from analysis.tune.features import Features
from analysis.tune.frames import Frame, read_captures
from analysis.view.visibility import Renderer
from interchange.problems import FileError, Problem, Where


def read_series(path: Path, wanted: Features, renderer: Renderer) -> list[Frame]:
    """Raises FileError and BrightfieldError."""
    if path.is_dir():
        if (path / "captures.json").is_file():
            return read_captures(path / "captures.json", wanted, renderer)
        raise FileError(
            Problem("The folder of a series must hold captures.json or manifest.parquet.", Where(str(path)))
        )
    return read_captures(path, wanted, renderer)
