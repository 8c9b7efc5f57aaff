"""What of a scene an algorithm is to find, written by the user: bodies whose edges count, lines and circles, blobs.

    edges: [/World/Part]                  # all CAD edges of these bodies, by prim path or its last part
    angle: 30                             # degrees: faces that meet at less are one smooth surface
    blobs: [/World/Scratch]               # bodies that are to be found as regions
    lines:
      top: {body: /World/Part, start: [-10, 5, 2], end: [10, 5, 2]}             # mm, in the body's frame
    circles:
      bore: {body: /World/Part, middle: [0, 0, 2], normal: [0, 0, 1], diameter: 8}
    patterns:
      mark: {body: /World/Part, middle: [4, 4, 2], size: 5}                     # side of the template, mm

Without ``body`` a feature is in the world's frame.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from interchange.problems import FileError, Problem, Where, did_you_mean

KEYS = ("edges", "angle", "blobs", "lines", "circles", "patterns")


@dataclass(frozen=True, eq=False)
class LineFeature:
    body: str
    start: np.ndarray  # (3,) m, body frame
    end: np.ndarray


@dataclass(frozen=True, eq=False)
class CircleFeature:
    body: str
    middle: np.ndarray  # (3,) m, body frame
    normal: np.ndarray
    radius: float  # m


@dataclass(frozen=True, eq=False)
class PatternFeature:
    body: str
    middle: np.ndarray  # (3,) m, body frame
    size: float  # m, side


@dataclass(frozen=True, eq=False)
class Features:
    edges: tuple[str, ...] = ()
    angle: float = float(np.radians(30))
    blobs: tuple[str, ...] = ()
    lines: Mapping[str, LineFeature] = field(default_factory=dict)
    circles: Mapping[str, CircleFeature] = field(default_factory=dict)
    patterns: Mapping[str, PatternFeature] = field(default_factory=dict)


def read(path: Path) -> Features:
    """Raises FileError with every problem of the file."""
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", Where(str(path)))) from None
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        raise FileError(Problem(f"The file must be YAML: {error}", Where(str(path)))) from None
    return parse(data, str(path))


def parse(data: Any, file: str = "") -> Features:
    """Raises FileError with every problem of ``data``."""
    wrong: list[Problem] = []

    def add(key: str, message: str) -> None:
        wrong.append(Problem(message, Where(file, key)))

    if not isinstance(data, dict) or not data:
        raise FileError(
            Problem(f"Features must be a mapping with one or more of {', '.join(KEYS)}.", Where(file))
        )
    for key in data:
        if key not in KEYS:
            add(str(key), f'The key "{key}" is not known.{did_you_mean(str(key), KEYS)}')

    def words(key: str) -> tuple[str, ...]:
        value = data.get(key) or []
        if not isinstance(value, list) or not all(isinstance(v, str) and v for v in value):
            add(key, f"There must be a list of bodies; got {value!r}.")
            return ()
        return tuple(value)

    def entries(key: str, fields: tuple[str, ...]) -> dict[str, dict[str, Any]]:
        value = data.get(key) or {}
        if not isinstance(value, dict):
            add(key, f"There must be features by name; got {value!r}.")
            return {}
        good = {}
        for name, one in value.items():
            place = f"{key}.{name}"
            if not isinstance(one, dict) or set(one) - {"body"} != set(fields):
                add(place, f"A feature must have {', '.join(fields)}, and may have body; got {one!r}.")
                continue
            read = {"body": one.get("body", "")}
            for f in fields:
                scalar = f in ("diameter", "size")
                number = _numbers(one[f], 1 if scalar else 3)
                if number is None or (scalar and not number[0] > 0) or (f == "normal" and not number.any()):
                    kind = "a number above 0" if scalar else "three numbers"
                    add(f"{place}.{f}", f"There must be {kind}; got {one[f]!r}.")
                    break
                read[f] = number if f == "normal" else number * 1e-3
            else:
                good[str(name)] = read
        return good

    angle = _numbers(data.get("angle", 30), 1)
    if angle is None or not 0 < angle[0] < 180:
        add("angle", f"The angle must lie between 0 and 180 degrees; got {data.get('angle')!r}.")
        angle = np.array([30.0])
    found = Features(
        words("edges"),
        float(np.radians(angle[0])),
        words("blobs"),
        {n: LineFeature(**x) for n, x in entries("lines", ("start", "end")).items()},
        {
            n: CircleFeature(x["body"], x["middle"], x["normal"], float(x["diameter"][0] / 2))
            for n, x in entries("circles", ("middle", "normal", "diameter")).items()
        },
        {
            n: PatternFeature(x["body"], x["middle"], float(x["size"][0]))
            for n, x in entries("patterns", ("middle", "size")).items()
        },
    )
    if wrong:
        raise FileError(wrong)
    return found


def _numbers(value: Any, count: int) -> np.ndarray | None:
    try:
        array = np.atleast_1d(np.asarray(value, np.float64))
    except (TypeError, ValueError):
        return None
    return array if array.shape == (count,) and np.isfinite(array).all() else None
