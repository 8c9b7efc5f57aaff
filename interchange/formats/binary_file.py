"""The bytes of a binary measurement, with the checks that every reader of one needs."""

from pathlib import Path

from interchange.problems import FileError, Problem, Where

MAX_BYTES = 1 << 30


def bytes_of(path: Path) -> bytes:
    """The whole file. Raises FileError where it cannot be read, is empty, or is larger than a GiB."""
    where = Where(str(path))
    try:
        if path.stat().st_size > MAX_BYTES:
            raise FileError(Problem(f"A measurement must fit into {MAX_BYTES >> 20} MiB.", where))
        data = path.read_bytes()
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    if not data:
        raise FileError(Problem("The file is empty.", where))
    return data
