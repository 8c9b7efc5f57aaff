"""Photometric files of luminaires: IES LM-63 (.ies), EULUMDAT (.ldt), and radial profiles of data sheets (.csv)."""

import re
from pathlib import Path

from interchange.formats import eulumdat, ies, measurements, radial_profile
from interchange.formats.base import Format, Options
from interchange.formats.luminous_intensity import Photometry
from interchange.light import Profile
from interchange.problems import FileError, Problem, Where

MAX_BYTES = 64 << 20


def read(path: Path | str) -> Profile:
    """The luminous intensity all around, candela. Raises FileError with every problem."""
    return load(path).profile


def load(path: Path | str) -> Photometry:
    """The intensities with what the file says of its luminaire. Raises FileError with every problem."""
    path = Path(path)
    if path.suffix.lower() in (".csv", ".tsv"):
        return radial_profile.parse(measurements.read(path), path)
    where = Where(str(path))
    try:
        if path.stat().st_size > MAX_BYTES:
            raise FileError(Problem(f"A photometric file must fit into {MAX_BYTES >> 20} MiB.", where))
        data = path.read_bytes()
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    if not data.strip():
        raise FileError(Problem("The file is empty.", where))
    if b"\0" in data:
        raise FileError(Problem("A photometric file must be text; this is not.", where))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if path.suffix.lower() == ".ldt":
        return eulumdat.parse(text, path)
    return ies.parse(text, path)


class Photometric(Format):
    name = "photometric file"
    extensions = (".ies", ".ldt")
    holds = "photometry"

    def recognises(self, head: bytes) -> bool:
        return head.startswith((b"IESNA", b"IES:")) or bool(re.search(rb"^\s*TILT\s*=", head, re.MULTILINE))

    def read(self, path: Path, options: Options) -> Photometry:
        return load(path)
