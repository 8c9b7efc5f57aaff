"""Which of the YAML dialects a calibration is written in: told by its names, for all of them end in .yaml."""

from pathlib import Path

from interchange.formats.base import Options
from interchange.formats.calibration_tree import Entry, read_yaml
from interchange.formats.document import Document
from interchange.problems import FileError, Problem, Where


def read_any(path: Path, options: Options) -> Document:
    """Read OpenCV's, ROS's or Kalibr's YAML. Raises FileError."""
    from interchange.formats import calibration_kalibr, calibration_opencv, calibration_ros

    tree = read_yaml(path)
    for module in (calibration_kalibr, calibration_ros, calibration_opencv):
        if module.speaks(tree):
            return module.cameras(tree, path, options).document()
    raise FileError(
        Problem(
            "A calibration in YAML must be OpenCV's (camera_matrix), ROS's camera_info (distortion_model) or Kalibr's "
            f"(cam0); this one begins with {_names(tree)}.",
            Where(str(path)),
        )
    )


def _names(tree: Entry) -> str:
    return ", ".join(f'"{n[:30]}"' for n in tree.names()[:5]) or "no names at all"
