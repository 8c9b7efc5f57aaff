"""Measurements as text: BRDFs of Cornell's goniometer (.brdf), spectra (.spd, .csv), goniometer tables and any other
(.csv, .tsv, .astm)."""

import csv
import io
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from interchange.formats import goniometer
from interchange.formats.base import Format, Options
from interchange.measurement import Column, Kind, Measurement, directions
from interchange.problems import FileError, Problem, Severity, Where

MAX_BYTES = 256 << 20
ANGLES = ("theta_i", "phi_i", "theta_s", "phi_s")
WAVELENGTH = re.compile(r"^(wave_?length|wl|lambda|λ|nm)\b", re.IGNORECASE)
UNIT = re.compile(r"^(.*?)\s*[(\[]([^)\]]*)[)\]]\s*$")
__all__ = ["Column", "Kind", "Measurement", "directions", "read"]
NO_DATA = ("", "-", "na", "n/a", "nan", "null")


def read(path: Path | str) -> Measurement:
    """A measurement by its extension. Raises FileError with every problem and its line."""
    path = Path(path)
    where = Where(str(path))
    try:
        if path.stat().st_size > MAX_BYTES:
            raise FileError(Problem(f"A measurement must fit into {MAX_BYTES >> 20} MiB.", where))
        data = path.read_bytes()
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    if b"\0" in data:
        raise FileError(Problem("A measurement must be text; this is not.", where))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if not text.strip():
        raise FileError(Problem("The file is empty.", where))
    if path.suffix.lower() == ".brdf":
        return _brdf(text, path)
    table = _table(text, path)
    if path.suffix.lower() == ".astm" and table.kind is not Kind.BRDF:
        raise FileError(
            Problem("An .astm file must hold a BRDF: VARS that name its angles, and rows.", where)
        )
    return table


def _numbers(text: str, path: Path) -> tuple[np.ndarray, list[int], tuple[str, ...]]:
    """All numbers of a file with their lines, and its comments (#)."""
    words: list[str] = []
    lines: list[int] = []
    comments: list[str] = []
    for number, line in enumerate(text.splitlines(), 1):
        content, _, comment = line.partition("#")
        if comment.strip():
            comments.append(comment.strip())
        found = content.replace(",", " ").split()
        words += found
        lines += [number] * len(found)
    try:
        values = np.array(words, np.float64)
    except ValueError:
        wrong = [(w, n) for w, n in zip(words, lines, strict=True) if not _is_number(w)]
        raise FileError(
            Problem(f'A number was expected; got "{w[:40]}".', Where(str(path), f"line {n}"))
            for w, n in wrong[:20]
        ) from None
    if not np.isfinite(values).all():
        place = f"line {lines[int(np.argmin(np.isfinite(values)))]}"
        raise FileError(Problem("Every number must be finite.", Where(str(path), place)))
    return values, lines, tuple(comments)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _brdf(text: str, path: Path) -> Measurement:
    """Number of wavelengths, the wavelengths, then rows: four angles and a value a wavelength."""
    values, lines, comments = _numbers(text, path)

    def error(message: str, index: int = 0) -> FileError:
        line = f"line {lines[min(index, len(lines) - 1)]}" if lines else ""
        return FileError(Problem(message, Where(str(path), line)))

    count = int(values[0]) if len(values) and 1 <= values[0] <= 10_000 else 0
    if not count or values[0] != count or len(values) < 1 + count:
        raise error("The file must begin with the number of wavelengths and the wavelengths.")
    wavelengths = values[1 : 1 + count]
    if not ((np.diff(wavelengths) > 0).all() and wavelengths[0] > 0):
        raise error("Wavelengths must be positive and increase.", 1)
    start, width = 1 + count, len(ANGLES) + count
    rows, rest = divmod(len(values) - start, width)
    if rest or not rows:
        message = (
            f"Rows of 4 angles and {count} values must follow; {rest} of {width} numbers are in the last."
        )
        raise error(message, len(values) - 1)
    table = values[start:].reshape(rows, width)
    theta = table[:, [0, 2]]
    if (wrong := (theta < 0) | (theta > np.pi / 2)).any():
        row, column = np.argwhere(wrong)[0]
        message = f"theta must lie in [0, pi/2]; got {theta[row, column]:g}."
        raise error(message, start + int(row) * width)
    return Measurement(
        kind=Kind.BRDF,
        axes=tuple(Column(name, "rad", table[:, i]) for i, name in enumerate(ANGLES)),
        values=tuple(Column(f"{w:g} nm", "1/sr", table[:, 4 + k]) for k, w in enumerate(wavelengths)),
        wavelength_nm=wavelengths,
        comments=comments,
        file=str(path),
    )


VARS = re.compile(r"^VARS\s+(.+)$", re.MULTILINE)


def _table(text: str, path: Path) -> Measurement:
    """A table, with the columns' names in its first row or, as in files by ASTM E1392, behind the keyword VARS."""
    head = VARS.search(text[:65536])
    if head:  # the lines before it, each a keyword and a value, become comments; line numbers stay
        before = "".join(f"# {line}\n" for line in text[: head.start()].splitlines())
        text = f"{before}{head[1]}{text[head.end() :]}"
    comments, rows = _cells(text, path)
    where = Where(str(path))
    if not rows:
        raise FileError(Problem("The file has no numbers.", where))
    width = len(rows[0][1])
    ragged = [(n, len(cells)) for n, cells in rows if len(cells) != width]
    if ragged:
        raise FileError(
            Problem(
                f"Every row must have {width} columns as the first; got {got}.", Where(str(path), f"line {n}")
            )
            for n, got in ragged[:20]
        )
    first = rows[0][1]
    worded = not any(_is_number(c) for c in first if c.lower() not in NO_DATA)
    has_header = len(rows) > 1 and (worded or goniometer.names_angles(first))  # wavelengths are names, too
    names = first if has_header else [f"column {i + 1}" for i in range(width)]
    body = rows[1:] if has_header else rows
    columns: list[Column] = []
    labels: dict[str, tuple[str, ...]] = {}
    for i, title in enumerate(names):
        cells = [cells[i] for _, cells in body]
        name, unit = (m[1], m[2]) if (m := UNIT.match(title)) else (title, "")
        if all(_is_number(c) or c.lower() in NO_DATA for c in cells) and any(_is_number(c) for c in cells):
            numbers = np.array([np.nan if c.lower() in NO_DATA else float(c) for c in cells])
            columns.append(Column(name, unit, numbers))
        else:
            labels[name] = tuple(cells)
    is_spectrum = bool(columns) and not labels and len(columns) >= 2
    named = path.suffix.lower() == ".spd" or bool(
        has_header and WAVELENGTH.match(columns[0].name if columns else "")
    )
    notes = []
    if unequal := sum(int(np.isnan(c.values).sum()) for c in columns):
        notes.append(Problem(f"{unequal} cells hold no number.", where, Severity.NOTE))
    lines = [number for number, _ in body]
    angle_unit = "rad" if head else ""
    table = goniometer.Table(columns, labels, lines, comments, tuple(notes), path, angle_unit)
    if has_header and (found := goniometer.measurement(table)):
        return found
    if named and is_spectrum:
        return _spectrum(columns, body, comments, tuple(notes), path)
    if path.suffix.lower() == ".spd":
        raise FileError(
            Problem("A spectrum must have columns of numbers: wavelength in nm and values.", where)
        )
    return Measurement(
        Kind.TABLE, (), tuple(columns), labels, comments=comments, notes=tuple(notes), file=str(path)
    )


def _spectrum(
    columns: list[Column],
    body: list[tuple[int, list[str]]],
    comments: tuple[str, ...],
    notes: tuple[Problem, ...],
    path: Path,
) -> Measurement:
    wavelength = columns[0].values
    bad = ~(wavelength > 0) | np.append(False, ~(np.diff(wavelength) > 0))
    if bad.any():
        line = body[int(np.argmax(bad))][0]
        message = "Wavelengths must be positive numbers that increase."
        raise FileError(Problem(message, Where(str(path), f"line {line}")))
    if columns[0].unit.lower() in ("µm", "um", "micron"):
        wavelength = wavelength * 1000
    names = [
        Column("value" if c.name.startswith("column ") else c.name, c.unit, c.values) for c in columns[1:]
    ]
    return Measurement(
        Kind.SPECTRUM,
        (Column("wavelength", "nm", wavelength),),
        tuple(names),
        wavelength_nm=wavelength,
        comments=comments,
        notes=notes,
        file=str(path),
    )


def _cells(text: str, path: Path) -> tuple[tuple[str, ...], list[tuple[int, list[str]]]]:
    """Comments, and the cells of every row with its line; the delimiter is the one of tab ; , or blanks that the
    first row has. Beside ; a comma is a decimal one."""
    comments: list[str] = []
    content: list[tuple[int, str]] = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith(("#", "%")):
            comments.append(line.strip().lstrip("#% "))
        elif line.strip(" \t,;"):
            content.append((number, line))
    first = content[0][1] if content else ""
    delimiter = next((d for d in ("\t", ";", ",") if d in first), None)
    rows = list(_split(content, delimiter, path))
    if delimiter == ";":
        rows = [
            (n, [c.replace(",", ".") if _is_number(c.replace(",", ".")) else c for c in r]) for n, r in rows
        ]
    return tuple(comments), rows


def _split(
    content: list[tuple[int, str]], delimiter: str | None, path: Path
) -> Iterator[tuple[int, list[str]]]:
    for number, line in content:
        if delimiter is None:
            yield number, line.split()
            continue
        try:
            (cells,) = csv.reader(io.StringIO(line), delimiter=delimiter, strict=True)
        except (csv.Error, ValueError) as error:
            message = f"The row cannot be split into cells: {error}."
            raise FileError(Problem(message, Where(str(path), f"line {number}"))) from None
        yield number, [c.strip() for c in cells]


class Measurements(Format):
    name = "measurement"
    extensions = (".brdf", ".spd", ".csv", ".tsv", ".astm")
    holds = "measurement"

    def read(self, path: Path, options: Options) -> Measurement:
        return read(path)
