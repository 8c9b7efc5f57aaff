"""A scene file whose cameras are taken for others: the stage is the file's own."""

from collections.abc import Callable
from dataclasses import replace

from interchange.camera import Camera
from interchange.formats.document import Document
from interchange.scene import Scene


class CamerasAs(Document):
    """``document`` with every camera as ``other`` makes it."""

    def __init__(self, document: Document, other: Callable[[Camera], Camera]) -> None:
        super().__init__(document.stage, document.path, document.problems)
        self.own, self.other = document, other

    def scene(self, time: float | None = None) -> Scene:
        scene = self.own.scene(time)
        return replace(scene, cameras=tuple(self.other(c) for c in scene.cameras))
