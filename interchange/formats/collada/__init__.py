"""COLLADA 1.4.1 and 1.5 both ways: .dae files as USD stages, and stages as .dae files."""

from pathlib import Path

from interchange.formats.base import Format, Options
from interchange.formats.document import Document
from interchange.problems import Problem


class Collada(Format):
    name = "COLLADA"
    extensions = (".dae",)
    writes = True

    def recognises(self, head: bytes) -> bool:
        return (
            b"<COLLADA" in head
            or "<COLLADA".encode("utf-16-le") in head
            or "<COLLADA".encode("utf-16-be") in head
        )

    def read(self, path: Path, options: Options) -> Document:
        from interchange.formats.collada.reader import read

        stage, problems = read(path)
        return Document(stage, path, problems)

    def write(self, document: Document, path: Path) -> list[Problem]:
        """Written as 1.4.1. Returns what COLLADA could not carry."""
        from interchange.formats.collada.writer import write

        return write(document.stage, path, str(document.path))
