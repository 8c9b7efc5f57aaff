"""IES LM-63: the North American photometric file, 1986 to 2019, and the nameless one before.

    header · [KEYWORD] lines · TILT= · lamps, lumens a lamp, multiplier, vertical and horizontal angles, type,
    unit, width, length, height · ballast factor, second factor, watts · angles · candela, plane by plane

Candela are the file's numbers times multiplier, ballast factor and, up to 1991, the ballast-lamp photometric
factor (later editions reserve that place, or code there how the file was made). ANSI/IES LM-63-19.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interchange.formats.luminous_intensity import BadAngles, Photometry, all_around, as_type_c
from interchange.light import Profile
from interchange.problems import FileError, Problem, Severity, Where

HEADERS = {
    "IESNA86": 1986,
    "IESNA91": 1991,
    "IESNA:LM-63-1986": 1986,
    "IESNA:LM-63-1991": 1991,
    "IESNA:LM-63-1995": 1995,
    "IESNA:LM-63-2002": 2002,
    "IES:LM-63-2019": 2019,
}
GONIOMETERS = {1: "C", 2: "B", 3: "A"}
METRES = {1: 0.3048, 2: 1.0}
MAX_ANGLES = 100_000
TILT = re.compile(r"^\s*TILT\s*=\s*(.*?)\s*$", re.IGNORECASE)
KEYWORD = re.compile(r"^\s*\[(\w+)\]\s*(.*?)\s*$")
BETWEEN = re.compile(r"[\s,]+")
HEAD = (
    "number of lamps",
    "lumens a lamp",
    "candela multiplier",
    "number of vertical angles",
    "number of horizontal angles",
    "photometric type",
    "unit of length",
    "width",
    "length",
    "height",
    "ballast factor",
    "second factor",
    "watts",
)


@dataclass
class _Numbers:
    """The numbers after TILT, one after another, each with its line; problems are collected."""

    path: Path
    words: list[tuple[str, int]]
    problems: list[Problem]
    at: int = 0

    def take(self, count: int, what: str) -> np.ndarray:
        given = self.words[self.at : self.at + count]
        values = np.full(count, np.nan)
        for i, (word, line) in enumerate(given):
            try:
                values[i] = float(word)
            except ValueError:
                self.error(f'{what} must be a number; got "{word[:40]}".', line)
            else:
                if not np.isfinite(values[i]):
                    self.error(f"{what} must be finite; got {word}.", line)
        if len(given) < count:
            message = f"{count} numbers ({what}) must follow; the file ends after {len(given)}."
            raise FileError([*self.problems, self.problem(message, self.last_line)])
        self.at += count
        return values

    @property
    def line(self) -> int:
        return self.words[min(self.at, len(self.words) - 1)][1] if self.words else 0

    @property
    def last_line(self) -> int:
        return self.words[-1][1] if self.words else 0

    def problem(self, message: str, line: int) -> Problem:
        return Problem(message, Where(str(self.path), f"line {line}" if line else ""))

    def error(self, message: str, line: int) -> None:
        self.problems.append(self.problem(message, line))

    def stop_on_errors(self) -> None:
        if self.problems:
            raise FileError(self.problems[:20])


def parse(text: str, path: Path) -> Photometry:
    """Raises FileError with every problem of the part at which reading has to stop."""
    lines = text.splitlines()
    found = [(i, m[1]) for i, line in enumerate(lines) if (m := TILT.match(line))]
    if not found:
        message = "An IES file must have a line TILT=NONE, TILT=INCLUDE or TILT=<file>; there is none."
        raise FileError(Problem(message, Where(str(path))))
    tilt_line, tilt = found[0]
    notes: list[Problem] = []
    year, standard = _edition(lines, path, notes)
    keywords = _keywords(lines[:tilt_line])
    words = [(w, i + 1) for i in range(tilt_line + 1, len(lines)) for w in BETWEEN.split(lines[i]) if w]
    numbers = _Numbers(path, words, [])
    scale = _tilt(tilt, tilt_line + 1, numbers)

    head = numbers.take(3, "lamps, lumens, multiplier")
    counts_line = numbers.line
    head = np.concatenate([head, numbers.take(10, "counts, type, unit, sizes, factors, watts")])
    numbers.stop_on_errors()
    value = dict(zip(HEAD, head, strict=True))
    for name, allowed in (
        ("photometric type", GONIOMETERS),
        ("unit of length", METRES),
    ):
        if value[name] not in allowed:
            listed = ", ".join(map(str, allowed))
            numbers.error(f"The {name} must be one of {listed}; got {value[name]:g}.", counts_line)
    for name in ("number of vertical angles", "number of horizontal angles"):
        if not (1 <= value[name] <= MAX_ANGLES and value[name] == int(value[name])):
            numbers.error(f"The {name} must be whole, 1 to {MAX_ANGLES}; got {value[name]:g}.", counts_line)
    for name in ("candela multiplier", "ballast factor"):
        if not value[name] > 0:
            numbers.error(f"The {name} must be positive; got {value[name]:g}.", counts_line)
    numbers.stop_on_errors()

    nv, nh = int(value["number of vertical angles"]), int(value["number of horizontal angles"])
    if nv * nh > len(words):
        message = f"{nv} x {nh} candela values must follow; the file has {len(words)} numbers in all."
        numbers.error(message, counts_line)
    numbers.stop_on_errors()
    angles = {}
    for name, count in (("Vertical", nv), ("Horizontal", nh)):
        line = numbers.line
        angles[name] = numbers.take(count, f"{name.lower()} angles")
        if not (np.diff(angles[name]) > 0).all():
            numbers.error(f"{name} angles must increase.", line)
    vertical, horizontal = angles["Vertical"], angles["Horizontal"]
    goniometer = GONIOMETERS[int(value["photometric type"])]
    low, high = (0, 180) if goniometer == "C" else (-180, 180)
    if nv < 2:
        numbers.error("There must be two or more vertical angles.", counts_line)
    if not (low <= vertical[0] and vertical[-1] <= high):
        numbers.error(f"Vertical angles must lie in [{low}, {high}] degrees.", counts_line)
    start = numbers.line
    candela = numbers.take(nv * nh, "candela").reshape(nh, nv)
    if (candela < 0).any():
        lowest = int(np.argmin(candela))
        line = words[numbers.at - nv * nh + lowest][1]
        numbers.error(f"Candela must not be negative; got {candela.min():g}.", line)
    numbers.stop_on_errors()
    if numbers.at < len(words):
        message = f"{len(words) - numbers.at} words after the last candela value were left out."
        where = Where(str(path), f"line {words[numbers.at][1]}")
        notes.append(Problem(message, where, Severity.LOSS))

    factor = value["candela multiplier"] * value["ballast factor"] * scale
    if year <= 1991 and value["second factor"] > 0:
        factor *= value["second factor"]
    try:
        if goniometer == "C":
            phi, full, symmetry = all_around(horizontal, candela * factor)
            theta = np.radians(vertical)
        else:
            phi, theta, full = as_type_c(goniometer, horizontal, vertical, candela * factor)
            sides = [n for n, a in (("left-right", horizontal), ("up-down", vertical)) if a[0] >= 0]
            symmetry = " and ".join(sides) or "none"
    except BadAngles as error:
        raise FileError(numbers.problem(f"{error}.", start)) from None
    metre = METRES[int(value["unit of length"])]
    flux = value["lumens a lamp"]
    return Photometry(
        profile=Profile(phi, theta, full, str(path)),
        standard=standard,
        goniometer=goniometer,
        symmetry=symmetry,
        horizontal=horizontal,
        vertical=vertical,
        lamps=int(abs(value["number of lamps"])),
        lumens=None if flux < 0 else float(flux * value["number of lamps"]),
        efficiency=None,
        watts=float(value["watts"]),
        size=(float(value["width"] * metre), float(value["length"] * metre), float(value["height"] * metre)),
        factor=float(factor),
        keywords=keywords,
        notes=tuple(notes),
    )


def _edition(lines: list[str], path: Path, notes: list[Problem]) -> tuple[int, str]:
    first = lines[0].strip().lstrip("\ufeff") if lines else ""
    if not first.upper().startswith("IES"):
        return 1986, "LM-63 before 1991"
    year = HEADERS.get(first.upper())
    if year is None:
        known = ", ".join(HEADERS)
        message = f'The edition "{first[:40]}" is not known ({known}); it is read as the latest.'
        notes.append(Problem(message, Where(str(path), "line 1"), Severity.NOTE))
    return year or 2019, first


def _keywords(lines: list[str]) -> dict[str, str]:
    keywords: dict[str, str] = {}
    last = ""
    for line in lines:
        if not (match := KEYWORD.match(line)):
            continue
        name = match[1].upper()
        if name == "MORE" and last:
            keywords[last] += f"\n{match[2]}"
            continue
        last = name if name not in keywords else f"{name}_{len(keywords)}"
        keywords[last] = match[2]
    return keywords


def _tilt(tilt: str, line: int, numbers: _Numbers) -> float:
    """The lamp's output at no tilt of the luminaire, relative to its rating."""
    if tilt.upper() == "NONE":
        return 1.0
    table = numbers
    if tilt.upper() != "INCLUDE":
        file = numbers.path.with_name(Path(tilt.replace("\\", "/")).name)
        try:
            text = file.read_text("latin-1")
        except OSError as error:
            message = f'The file "{tilt}" that TILT names cannot be read: {error.strerror}.'
            raise FileError(numbers.problem(message, line)) from None
        words = [(w, i + 1) for i, row in enumerate(text.splitlines()) for w in BETWEEN.split(row) if w]
        table = _Numbers(file, words, [])
    _, count = table.take(2, "lamp geometry, number of tilt angles")
    table.stop_on_errors()
    if not (1 <= count <= MAX_ANGLES and count == int(count)):
        message = f"The number of tilt angles must be whole, 1 to {MAX_ANGLES}; got {count:g}."
        raise FileError(table.problem(message, table.line))
    angles = table.take(int(count), "tilt angles")
    factors = table.take(int(count), "tilt factors")
    table.stop_on_errors()
    return float(np.interp(0.0, angles, factors))
