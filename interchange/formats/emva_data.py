"""The descriptor of an EMVA 1288 measurement: which images were taken at which exposure time and photon number.

    v 3.0                       release of the standard
    n 12 640 480                bits, width, height
    b 1760000.0 5289.0          bright: exposure time in ns, photons a pixel; its images follow
    i b_006_snap_001.png
    i b_006_snap_002.png
    d 1760000.0                 dark: exposure time in ns

As the standard's reference implementation (PyPI emva1288) and its data sets have it.
"""

import math
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath

from interchange.problems import FileError, Problem, Where


@dataclass(frozen=True)
class Point:
    """Repeats of one exposure; ``photons`` a pixel is 0 in the dark."""

    t_exp: float  # s
    photons: float
    images: tuple[Path, ...]


@dataclass(frozen=True)
class Descriptor:
    bits: int
    width: int
    height: int
    points: tuple[Point, ...]
    file: str = ""


def read(path: Path | str) -> Descriptor:
    """Raises FileError with every problem and its line."""
    path = Path(path)
    try:
        text = path.read_text("utf-8-sig")
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", Where(str(path)))) from None
    except UnicodeDecodeError:
        raise FileError(Problem("A descriptor must be text; this is not.", Where(str(path)))) from None
    problems: list[Problem] = []
    size: tuple[int, int, int] | None = None
    points: list[tuple[float, float, list[Path], str]] = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#") or words[0] in ("v", "l"):
            continue
        place = f"line {number}"
        numbers = [_number(w) for w in words[1:]]
        good = all(math.isfinite(x) and x >= 0 for x in numbers)
        match words[0], len(words):
            case "n", 4 if good:
                size = (int(numbers[0]), int(numbers[1]), int(numbers[2]))
            case "b", 3 if good:
                points.append((numbers[0] * 1e-9, numbers[1], [], place))
            case "d", 2 if good:
                points.append((numbers[0] * 1e-9, 0.0, [], place))
            case "i", n if n >= 2 and points:
                name = line.split(None, 1)[1].strip()
                points[-1][2].append(path.parent / Path(*PureWindowsPath(name).parts))
            case _:
                known = '"n bits width height", "b ns photons", "d ns" or "i image"'
                message = f'A line must be {known}; got "{line.strip()[:60]}".'
                problems.append(Problem(message, Where(str(path), place)))
    if size is None:
        problems.append(Problem('A descriptor must have a line "n bits width height".', Where(str(path))))
    for _, _, images, place in points:
        if len(images) < 2:
            problems.append(
                Problem(f"A point needs two images or more; it has {len(images)}.", Where(str(path), place))
            )
    if problems or size is None:
        raise FileError(problems)
    return Descriptor(*size, tuple(Point(t, p, tuple(i)) for t, p, i, _ in points), str(path))


def _number(word: str) -> float:
    try:
        return float(word.replace(",", "."))
    except ValueError:
        return math.nan
