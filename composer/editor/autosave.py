"""Copies of unsaved scenes in the user's state folder, which outlive a crash.

One file a running editor: the root layer (``NAME.usdc``), and ``NAME.json`` with whose it is. A copy whose process is
gone is offered for recovery.
"""

import json
import os
import uuid
from dataclasses import asdict, dataclass
from pathlib import Path

from interchange.formats.atomic import written_beside
from interchange.formats.usd_edit import LiveStage


@dataclass(frozen=True)
class Saved:
    """``scene``: the file that was edited, "" for one without a file; ``started``: of the process, s since 1970."""

    file: str
    scene: str
    pid: int
    started: float
    steps: int


def folder() -> Path:
    """XDG's state folder."""
    state = os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local" / "state")
    return Path(state) / "brightfield" / "autosave"


class Autosave:
    """Of one editor."""

    def __init__(self, where: Path | None = None) -> None:
        self.folder = where or folder()
        self.name = uuid.uuid4().hex[:12]

    @property
    def file(self) -> Path:
        return self.folder / f"{self.name}.usdc"

    def keep(self, live: LiveStage, scene: str, steps: int) -> None:
        """Raises FileError or OSError where it cannot be written."""
        import psutil  # a tenth of a second of a window's start

        self.folder.mkdir(parents=True, exist_ok=True)
        beside = written_beside(self.file)
        live.keep_in(beside)
        os.replace(beside, self.file)
        about = Saved(str(self.file), scene, os.getpid(), psutil.Process().create_time(), steps)
        note = self.file.with_suffix(".json")
        beside = written_beside(note)
        beside.write_text(json.dumps(asdict(about)), encoding="utf8")
        os.replace(beside, note)

    def drop(self) -> None:
        """Saved or thrown away on purpose: nothing is left to recover."""
        drop(self.file)


def drop(file: Path) -> None:
    for each in (file.with_suffix(".json"), file):
        each.unlink(missing_ok=True)


def orphans(where: Path | None = None) -> list[Saved]:
    """What editors that are gone left behind, the newest first. Notes that cannot be read are passed over: they were
    cut short while the machine went down, and the scene file beside them is whole."""
    found = []
    for note in (where or folder()).glob("[!.]*.json"):
        try:
            saved = Saved(**json.loads(note.read_text(encoding="utf8")))
        except (OSError, ValueError, TypeError):
            continue
        if not _runs(saved) and Path(saved.file).is_file():
            found.append((note.stat().st_mtime, saved))
    return [saved for _, saved in sorted(found, key=lambda pair: -pair[0])]


def _runs(saved: Saved) -> bool:
    import psutil

    try:
        return abs(psutil.Process(saved.pid).create_time() - saved.started) < 1.0
    except psutil.NoSuchProcess:
        return False
