"""The opened scene and all that a person does to it, without a window.

A step is taken whole or not at all: where a command raises, or leaves a scene that cannot be read, the stage is what
it was before.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from composer.editor.autosave import Autosave, Saved, drop
from composer.editor.command_text import as_text, parse
from composer.editor.commands import Command
from composer.editor.history import History, Step
from interchange.formats.base import Options
from interchange.formats.document import format_for_writing, open_scene
from interchange.formats.usd_edit import LiveStage, Node, kind_of, reread
from interchange.formats.usd_edit_prims import world_pose
from interchange.material import Material
from interchange.problems import BrightfieldError
from interchange.scene import Scene

NEW = "untitled.usda"
EDITABLE = (".usd", ".usda", ".usdc")


class Workspace:
    """``revision`` grows with every change of what is shown: whoever drew an older one draws anew."""

    def __init__(self, autosave: Autosave | None = None) -> None:
        self.autosave = autosave
        self.revision = 0
        self.log: list[str] = []  # every step as text, for scripts
        self.notes: list[str] = []  # what was noticed on reading files
        self.watchers: list[Callable[[Scene], None]] = []  # each is called with the scene after a change
        self.selection: tuple[str, ...] = ()
        self._take(LiveStage.empty(Path(NEW)), None)

    def _take(self, live: LiveStage, path: Path | None) -> None:
        scene = live.scene(live.times()[0])
        self.live, self.path, self.scene = live, path, scene
        self.time = scene.time
        self.times = live.times()
        self.history = History()
        self._saved: Step | None = None
        self._kept: Step | None = None
        self.select(())
        self._changed()

    def _changed(self) -> None:
        self.revision += 1
        self._outline: tuple[Node, ...] | None = None
        for watcher in tuple(self.watchers):
            watcher(self.scene)

    @property
    def stage(self) -> Any:
        """The USD stage, for the functions of interchange.formats."""
        return self.live.stage

    # files

    def new(self) -> None:
        self._take(LiveStage.empty(Path(NEW)), None)
        self._forget()

    def open(self, file: Path | str, options: Options = Options()) -> None:  # noqa: B008  frozen
        """A scene of any format; what is not USD is then saved under another name. Raises FileError; the scene that
        was open then stays."""
        path = Path(file)
        document = open_scene(path, options)
        reread(document)
        own = path if path.suffix.lower() in EDITABLE else None
        self.notes = [str(p) for p in document.problems]
        self._take(LiveStage(document), own)
        self._forget()
        self.notes += [str(p) for p in self.live.problems(self.time) if str(p) not in self.notes]

    def recover(self, saved: Saved) -> None:
        """What an editor that crashed had not saved. One undo leads back to the file as it is on disk."""
        if saved.scene and Path(saved.scene).is_file():
            self.open(saved.scene)
        else:
            self.new()
        before = self.live.snapshot()
        self.live.recall(Path(saved.file))
        try:
            self._look()
        except BrightfieldError:
            self.live.restore(before)
            raise
        step = Step(_Recovered(), before, self.live.snapshot(), (), ())
        self.history = self.history.then(step)
        self._changed()
        drop(Path(saved.file))

    def save(self, file: Path | str | None = None) -> list[str]:
        """Write to ``file``, by default where the scene came from; beside and renamed. Returns what was lost."""
        path = Path(file) if file is not None else self.path
        if path is None:
            raise BrightfieldError("The scene has no file yet; name one to save it.")
        if not path.suffix:
            path = path.with_suffix(".usda")
        format_for_writing(path)
        lost = [str(p) for p in self.live.document.save(path)]
        if path.suffix.lower() in EDITABLE:
            self.path = path
            self._saved = self.history.last
            self._forget()
        return lost

    @property
    def unsaved(self) -> bool:
        return self.history.last is not self._saved

    @property
    def name(self) -> str:
        return self.path.name if self.path else Path(self.live.document.path).stem + ".usda"

    def keep(self) -> None:
        """Write an autosave where something changed since the last one."""
        if self.autosave is not None and self.unsaved and self._kept is not self.history.last:
            self.autosave.keep(
                self.live, str(self.path.resolve()) if self.path else "", len(self.history.done)
            )
            self._kept = self.history.last

    def _forget(self) -> None:
        if self.autosave is not None:
            self.autosave.drop()
        self._kept = self.history.last

    # edits

    def do(self, command: Command | str, continuing: bool = False) -> None:
        """Take a step. ``continuing``: as part of the last one, while a slider is held. Raises BrightfieldError."""
        command = parse(command) if isinstance(command, str) else command
        last = self.history.last
        before = last.after if last is not None else self.live.snapshot()
        selected = self.selection
        try:
            chosen = command.apply(self)
            self._look()
        except BrightfieldError:
            self.live.restore(before)
            self._look()
            raise
        after = self.live.snapshot()
        if chosen is not None:
            self.selection = chosen
        count = len(self.history.done)
        self.history = self.history.then(Step(command, before, after, selected, self.selection), continuing)
        if len(self.history.done) == count and count:
            self.log[-1:] = [as_text(command)]
        else:
            self.log.append(as_text(command))
        self._changed()

    def run(self, script: Iterable[str]) -> None:
        """Commands one a line; empty lines and those that begin with # are passed over."""
        for number, line in enumerate(script, 1):
            if line.strip() and not line.lstrip().startswith("#"):
                try:
                    self.do(line)
                except BrightfieldError as error:
                    raise BrightfieldError(f"{error} (edit {number}: {line.strip()})") from None

    def undo(self) -> str:
        """Returns the title of what was undone, "" where there was nothing."""
        step = self.history.last
        if step is None:
            return ""
        self.live.restore(step.before)
        self.history = self.history.undo()
        self._look()
        self.select(step.selected_before)
        self.log.append(f"# undo {step.command.title}")
        self._changed()
        return step.command.title

    def redo(self) -> str:
        if not self.history.undone:
            return ""
        step = self.history.undone[-1]
        self.live.restore(step.after)
        self.history = self.history.redo()
        self._look()
        self.select(step.selected_after)
        self.log.append(as_text(step.command))
        self._changed()
        return step.command.title

    def _look(self) -> None:
        scene = self.live.scene(self.time)
        self.scene = replace(scene, digest=f"{id(self):x}.{self.revision + 1}")
        self.times = self.live.times()

    # what is looked at

    def select(self, paths: Iterable[str]) -> None:
        self.selection = tuple(p for p in dict.fromkeys(paths) if self.live.exists(p))

    def go_to(self, time: float) -> None:
        """Show another time code."""
        old, self.time = self.time, time
        try:
            self._look()
        except BrightfieldError:
            self.time = old
            raise
        self._changed()

    @property
    def outline(self) -> tuple[Node, ...]:
        if self._outline is None:
            self._outline = self.live.outline()
        return self._outline

    def kind(self, path: str) -> str | None:
        """group, mesh, light, camera, material; None where nothing is."""
        return kind_of(self.stage.GetPrimAtPath(path)) if self.live.exists(path) else None

    def pose(self, path: str) -> np.ndarray:
        """``world_from_prim`` (4, 4), m."""
        return world_pose(self.stage, path, self.time)

    def material(self, path: str) -> Material | None:
        """A material of the stage, whether a body shows it or not; None where it cannot be read."""
        return self.live.material(path, self.time)

    def movable(self) -> tuple[str, ...]:
        """What of the selection has a place in space."""
        return tuple(p for p in self.selection if self.kind(p) in ("group", "mesh", "light", "camera"))

    def bounds(self, paths: Iterable[str] = ()) -> np.ndarray | None:
        """(2, 3) m of the bodies at or below these paths, of all without any; None where there are none. Lamps and
        cameras count as points."""
        wanted = tuple(paths)

        def meant(name: str) -> bool:
            return not wanted or any(name == p or name.startswith((p + "/", p + "[")) for p in wanted)

        corners = [_box(b) for b in self.scene.bodies if meant(b.name) and len(b.mesh.vertices)]
        points = [x.world_from_light[:3, 3] for x in self.scene.lights if wanted and meant(x.name)]
        points += [c.world_from_camera[:3, 3] for c in self.scene.cameras if wanted and meant(c.name)]
        every = [*corners, *(np.atleast_2d(p) for p in points)]
        if not every:
            return None
        stacked = np.concatenate(every)
        return np.stack([stacked.min(0), stacked.max(0)])


def _box(body: Any) -> np.ndarray:
    low, high = _mesh_bounds(body.mesh)
    corners = np.array(
        [[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    )
    return np.asarray(corners @ body.world_from_body[:3, :3].T + body.world_from_body[:3, 3])


_BOUNDS: dict[int, tuple[Any, np.ndarray]] = {}  # by mesh: they are frozen, and compared by identity


def _mesh_bounds(mesh: Any) -> np.ndarray:
    if id(mesh) not in _BOUNDS:
        if len(_BOUNDS) > 10_000:
            _BOUNDS.clear()
        _BOUNDS[id(mesh)] = (mesh, mesh.bounds)
    return _BOUNDS[id(mesh)][1]


class _Recovered(Command):
    """The step from a file on disk to what was recovered."""

    title = "Recover"
