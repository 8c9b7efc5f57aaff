"""Cameras that were measured, as a scene of their own or inside another one."""

from collections.abc import Sequence
from pathlib import Path

from interchange.camera import Camera
from interchange.formats.base import Options
from interchange.formats.document import Document, open_scene


def camera_document(cameras: Sequence[Camera], path: Path) -> Document:
    """A scene of cameras alone; ``path``: the file that told of them."""
    from interchange.formats.usd_author import author_camera, free_path, new_stage

    stage = new_stage()
    for camera in cameras:
        author_camera(stage, free_path(stage, "/World", camera.name.rsplit("/", 1)[-1]), camera)
    return Document(stage, path)


def write_cameras(cameras: Sequence[Camera], path: Path, scene: Path | None = None) -> None:
    """Write cameras to a USD file; with ``scene``, a copy of it with the cameras in it, in place of those that have
    their names. Raises FileError."""
    if scene is None:
        camera_document(cameras, path).save(path)
        return
    from interchange.formats.usd_author import author_camera, free_path

    document = open_scene(scene, Options())
    stage = document.stage
    named = {str(p.GetPath()): p for p in stage.Traverse() if p.GetTypeName() == "Camera"}
    default = stage.GetDefaultPrim()
    parent = str(default.GetPath()) if default else ""
    for camera in cameras:
        last = camera.name.rsplit("/", 1)[-1]
        same = [place for place in named if camera.name == place or last == place.rsplit("/", 1)[-1]]
        for place in same:
            stage.RemovePrim(place)
        author_camera(stage, free_path(stage, parent, last), camera)
    document.save(path)
