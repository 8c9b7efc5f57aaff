"""A scene file with scenes that are taken for others than it says."""

from collections.abc import Callable

from interchange.formats.document import Document
from interchange.scene import Scene


class Taken(Document):
    """``document`` with scenes as ``changed`` makes them; the stage is the file's own."""

    def __init__(self, document: Document, changed: Callable[[Scene], Scene]) -> None:
        super().__init__(document.stage, document.path, document.problems)
        self.own, self.changed = document, changed

    def scene(self, time: float | None = None) -> Scene:
        return self.changed(self.own.scene(time))
