"""EULUMDAT (.ldt): the European photometric file, one value a line.

    1 company · 2 type · 3 symmetry · 4, 5 C planes, their distance · 6, 7 gamma angles, theirs · 8 - 12 names
    · 13 - 21 sizes, mm · 22 downward share, % · 23 light output ratio, % · 24 factor · 25 tilt
    · 26 sets of lamps, six lines each · ten direct ratios · C angles · gamma angles · cd/klm, plane by plane

Candela are the file's numbers times the lamps' flux / 1000 times the factor of line 24. Stockmar: EULUMDAT, a
format for data exchange of luminaires. 1990.
"""

from pathlib import Path

import numpy as np

from interchange.formats.luminous_intensity import BadAngles, Photometry, all_around
from interchange.light import Profile
from interchange.problems import FileError, Problem, Severity, Where

SYMMETRY = {0: "none", 1: "rotational", 2: "plane 0-180", 3: "plane 90-270", 4: "quadrants"}
MAX_PLANES, MAX_ANGLES, MAX_SETS = 3600, 3600, 100


class _Lines:
    """The lines of the file by number (from 1), read as numbers; problems are collected."""

    def __init__(self, text: str, path: Path) -> None:
        self.lines = [line.strip() for line in text.splitlines()]
        self.path = path
        self.problems: list[Problem] = []

    def text(self, line: int) -> str:
        return self.lines[line - 1] if line <= len(self.lines) else ""

    def number(self, line: int, what: str, low: float = -np.inf, high: float = np.inf) -> float:
        word = self.text(line).replace(",", ".")
        try:
            value = float(word)
        except ValueError:
            got = f'got "{word[:40]}"' if line <= len(self.lines) else "the file has ended"
            self.error(f"{what} must be a number; {got}.", line)
            return np.nan
        if not low <= value <= high:  # written so that NaN is outside
            self.error(f"{what} must lie in [{low:g}, {high:g}]; got {value:g}.", line)
            return np.nan
        return value

    def whole(self, line: int, what: str, low: int, high: int) -> int:
        value = self.number(line, what, low, high)
        if np.isnan(value):
            return 0
        if value != int(value):
            self.error(f"{what} must be a whole number; got {value:g}.", line)
        return int(value)

    def numbers(self, start: int, count: int, what: str, low: float, high: float) -> np.ndarray:
        if start + count - 1 > len(self.lines):
            given = max(0, len(self.lines) - start + 1)
            self.error(f"{count} lines ({what}) must follow; the file ends after {given}.", len(self.lines))
            self.stop_on_errors()
        return np.array([self.number(start + i, what, low, high) for i in range(count)])

    def error(self, message: str, line: int) -> None:
        self.problems.append(Problem(message, Where(str(self.path), f"line {line}")))

    def stop_on_errors(self) -> None:
        if self.problems:
            raise FileError(self.problems[:20])


def parse(text: str, path: Path) -> Photometry:
    """Raises FileError with every problem of the part at which reading has to stop."""
    file = _Lines(text, path)
    symmetry = file.whole(3, "The symmetry indicator", 0, 4)
    planes = file.whole(4, "The number of C planes", 1, MAX_PLANES)
    angles = file.whole(6, "The number of gamma angles", 2, MAX_ANGLES)
    width, length, height = (file.number(n, "A size in mm", 0, 1e6) for n in (17, 16, 15))
    efficiency = file.number(23, "The light output ratio in %", 0, 1000)
    factor = file.number(24, "The factor of the intensities", 0, 1e9)
    sets = file.whole(26, "The number of sets of lamps", 1, MAX_SETS)
    file.stop_on_errors()
    if symmetry > 1 and planes % (2 if symmetry == 2 else 4):
        message = f"The number of C planes must be a multiple of {2 if symmetry == 2 else 4}; got {planes}."
        file.error(message, 4)
    lamps = file.number(27, "The number of lamps", -1e6, 1e6)
    lumens = file.number(29, "The luminous flux of the lamps", 0, 1e9)
    watts = file.number(32, "The power in W", 0, 1e9)
    notes: list[Problem] = []
    if sets > 1:
        message = f"Of {sets} sets of lamps the first was taken; the others were left out."
        notes.append(Problem(message, Where(str(path), "line 26"), Severity.LOSS))
    at = 27 + 6 * sets + 10
    c = file.numbers(at, planes, "C angles", -360, 360)
    gamma = file.numbers(at + planes, angles, "gamma angles", 0, 180)
    for name, values, line in (("C", c, at), ("Gamma", gamma, at + planes)):
        if not (np.diff(values) > 0).all():
            file.error(f"{name} angles must increase.", line)
    file.stop_on_errors()
    first, count = {
        0: (0, planes),
        1: (0, 1),
        2: (0, planes // 2 + 1),
        3: (3 * planes // 4, planes // 2 + 1),
        4: (0, planes // 4 + 1),
    }[symmetry]
    index = np.arange(first, first + count) % planes
    values = file.numbers(at + planes + angles, count * angles, "cd/klm", 0, 1e9)
    file.stop_on_errors()
    candela = values.reshape(count, angles) * (lumens / 1000 * factor)
    horizontal = c[index]
    if symmetry == 3:
        horizontal = np.where(np.arange(count) < planes // 4, horizontal - 360, horizontal)  # -90 .. 90
    try:
        whole = horizontal if symmetry != 0 or planes > 1 else np.zeros(1)
        phi, full, _ = all_around(whole, candela)
    except BadAngles as error:
        raise FileError(Problem(f"{error}.", Where(str(path), f"line {at}"))) from None
    labels = {"company": 1, "report": 8, "luminaire": 9, "number": 10, "date": 12, "lamp": 28, "color": 30}
    return Photometry(
        profile=Profile(phi, np.radians(gamma), full, str(path)),
        standard="EULUMDAT",
        goniometer="C",
        symmetry=SYMMETRY[symmetry],
        horizontal=c[index],
        vertical=gamma,
        lamps=int(abs(lamps)),
        lumens=float(lumens) if lamps >= 0 else None,
        efficiency=float(efficiency) / 100,
        watts=float(watts),
        size=(width / 1000, length / 1000, height / 1000),
        factor=float(lumens / 1000 * factor),
        keywords={name: file.text(line) for name, line in labels.items() if file.text(line)},
        notes=tuple(notes),
    )
