"""Files of parts, written and opened, for the tests of their formats."""

from interchange.formats.base import Options
from interchange.formats.document import open_file


def read(path, unit="mm"):
    return open_file(path, Options(unit=unit))


def only_body(document):
    (body,) = document.scene().bodies
    return body


def write(folder, name, text):
    path = folder / name
    if isinstance(text, bytes):
        path.write_bytes(text)
    else:
        path.write_text(text)
    return path
