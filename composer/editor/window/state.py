"""What the panels share: the workspace, the renderer, what is held by the mouse, and what to tell."""

import time
from dataclasses import dataclass, field
from typing import Any

import moderngl
import numpy as np

from composer.editor.commands import Command
from composer.editor.live_camera import LiveCamera
from composer.editor.offline_job import OfflineJob
from composer.editor.orbit import Orbit
from composer.editor.presets import Preset
from composer.editor.preview import moved
from composer.editor.window.full_picture import FullPictures
from composer.editor.workspace import Workspace
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer

QUIET = 0.30  # s without a change after which pictures are made in full


@dataclass
class Dragged:
    """What the gizmo or a modal tool moves; ``by`` (4, 4) is the motion so far, m."""

    paths: tuple[str, ...]
    start: np.ndarray  # pose of the pivot when it began
    by: np.ndarray = field(default_factory=lambda: np.eye(4))


@dataclass
class State:
    workspace: Workspace
    context: moderngl.Context | None = None
    renderer: Rasterizer | None = None
    orbit: Orbit = field(default_factory=Orbit)
    shading: str = "solid"  # or "lamps"
    operation: str = "move"  # or rotate, scale
    local: bool = False
    snapping: bool = False
    snap_mm: float = 5.0
    snap_degrees: float = 15.0
    show_grid: bool = True
    show_field: bool = True
    dragged: Dragged | None = None
    held: tuple[str, str] | None = None  # (path, parameter) of the slider that is held
    message: str = ""
    message_is_error: bool = False
    message_at: float = 0.0
    job: OfflineJob | None = None
    stream: LiveCamera | None = None
    job_camera: str = ""
    shown_camera: str = ""  # in the camera views
    carried: str | Preset = ""  # the material that is dragged from the tree or the library
    dialog: Any = None
    asked: str = ""  # what waits for an answer about unsaved changes: new, open, quit
    rename_to: str = ""
    changed_at: float = 0.0
    quit: bool = False
    full: FullPictures = field(default_factory=FullPictures)
    _moved: tuple[Any, Scene] | None = None
    _seen: Any = None

    @property
    def scene(self) -> Scene:
        """As it is shown now, with what is being dragged."""
        if self.dragged is None:
            return self.workspace.scene
        key = (self.workspace.revision, self.dragged.by.tobytes())
        if self._moved is None or self._moved[0] != key:
            self._moved = key, moved(self.workspace.scene, self.dragged.paths, self.dragged.by)
        return self._moved[1]

    @property
    def scene_key(self) -> Any:
        """Changes whenever ``scene`` does."""
        return self.workspace.revision, None if self.dragged is None else self.dragged.by.tobytes()

    @property
    def quiet(self) -> bool:
        """Nothing has changed for a while: time for pictures in full."""
        return time.monotonic() - self.changed_at > QUIET

    def notice(self) -> None:
        """To be called every frame: sees whether the scene or the view has changed."""
        now = (self.scene_key, self.orbit, self.shading)
        if now != self._seen:
            dragged = self._seen is not None and self._seen[0] != self.scene_key
            self._seen, self.changed_at = now, time.monotonic()
            if dragged and self.stream is not None:
                self.stream.show(self.scene)
        if self.stream is not None and self.stream.problem:
            self.tell(self.stream.problem, error=True)
            self.stream = None

    def tell(self, text: str, error: bool = False) -> None:
        self.message, self.message_is_error, self.message_at = text, error, time.monotonic()

    def do(self, command: Command, continuing: bool = False) -> bool:
        """Take a step; what cannot be is told in the status bar. Whether it was taken."""
        try:
            self.workspace.do(command, continuing)
        except BrightfieldError as error:
            self.tell(str(error), error=True)
            return False
        if self.workspace.notes:
            self.tell("; ".join(self.workspace.notes[-3:]))
            self.workspace.notes.clear()
        return True

    def attempt(self, action: Any, *arguments: Any) -> Any:
        """The result of something that may raise a BrightfieldError or OSError, which is then told; None then."""
        try:
            return action(*arguments)
        except BrightfieldError as error:
            self.tell(str(error), error=True)
        except OSError as error:
            self.tell(f"{error.strerror or error} ({error.filename or ''})", error=True)
        return None

    def undo(self) -> None:
        title = self.workspace.undo()
        self.tell(f"Undone: {title}" if title else "Nothing to undo.")

    def redo(self) -> None:
        title = self.workspace.redo()
        self.tell(f"Redone: {title}" if title else "Nothing to redo.")

    def fit(self, everything: bool = False) -> None:
        """The selection in view, else all bodies; with lamps and cameras if ``everything``."""
        workspace = self.workspace
        bounds = None
        if everything:
            near = [x.name for x in workspace.scene.lights if x.kind not in ("distant", "dome")]
            things = [*(b.name for b in workspace.scene.bodies), *(c.name for c in workspace.scene.cameras)]
            bounds = workspace.bounds([*things, *near]) if things or near else None
        elif workspace.selection:
            bounds = workspace.bounds(workspace.selection)
        bounds = workspace.bounds() if bounds is None else bounds
        self.orbit = self.orbit.fitted(bounds)
