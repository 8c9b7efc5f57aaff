"""The one door to files: ``open_file`` for every kind, ``open_scene`` for scenes, ``Document.save`` out again."""

import hashlib
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from interchange.catalogue import catalogue
from interchange.formats.base import Format, Options
from interchange.problems import FileError, Problem, Where, did_you_mean, errors
from interchange.scene import Scene

if TYPE_CHECKING:
    from interchange.formats.usd_read import SceneReader
    from interchange.material import Material


@dataclass
class Document:
    """An opened scene file: a USD stage, whatever the file's own format, and what was noticed on the way in."""

    stage: Any  # pxr.Usd.Stage
    path: Path
    problems: list[Problem] = field(default_factory=list)

    @cached_property
    def _reader(self) -> "SceneReader":
        from interchange.formats.usd_read import SceneReader

        return SceneReader(self.stage, str(self.path), self.digest)

    @cached_property
    def times(self) -> list[float]:
        """The time codes of the frames, in order: the authored range, else those of the time samples, else 0."""
        from interchange.formats.usd_read import frame_times

        return frame_times(self.stage)

    @property
    def codes_per_second(self) -> float:
        return float(self.stage.GetTimeCodesPerSecond())

    def following(self, time: float) -> float:
        """The time code of the frame after ``time``, whichever frames are rendered; after the last, as far on as the
        last but one is before."""
        after = [t for t in self.times if t > time]
        step = self.times[-1] - self.times[-2] if len(self.times) > 1 else 0.0
        return after[0] if after else time + step

    def scene(self, time: float | None = None) -> Scene:
        """The scene at a time code; without one, at the first frame. Raises FileError with every problem."""
        wrong = errors(self.problems)
        if wrong:
            raise FileError(wrong)
        return self._reader.scene(self.times[0] if time is None else time)

    def materials(self) -> tuple["Material", ...]:
        """All materials of the file, bound or not, at the first frame. Raises FileError with every problem."""
        return self._reader.materials(self.times[0])

    def scene_problems(self) -> list[Problem]:
        """What ``scene`` would leave out or refuse at the first frame, errors included."""
        return self._reader.problems(self.times[0])

    @cached_property
    def digest(self) -> str:
        """SHA-256 over the composed stage and the contents of every asset file it names."""
        from interchange.formats.usd_read import asset_files

        sha = hashlib.sha256(self.stage.Flatten().ExportToString().encode())
        for file in sorted(asset_files(self.stage)):
            with open(file, "rb") as stream:
                sha.update(hashlib.file_digest(stream, "sha256").digest())
        return sha.hexdigest()

    def save(self, path: Path | str) -> list[Problem]:
        """Write to the format of the extension, beside and renamed; returns what that format could not carry."""
        path = Path(path)
        return format_for_writing(path).write(self, path)


@cache
def formats() -> tuple[Format, ...]:
    return tuple(kind() for kind in catalogue("interchange.formats", Format).values())


def format_of(path: Path) -> Format:
    """The format by extension, else by the first bytes. Raises FileError where the file is none that is known."""
    where = Where(str(path))
    if path.is_dir():
        raise FileError(Problem("A file was expected; this is a folder.", where))
    try:
        with open(path, "rb") as stream:
            head = stream.read(512)
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    if not head:
        raise FileError(Problem("The file is empty.", where))
    extension = path.suffix.lower()
    named = [f for f in formats() if extension in f.extensions]
    known_by_content = [f for f in named or formats() if f.recognises(head)]
    found = known_by_content or named  # several formats may end alike: .yaml, .xml, .txt
    if found:
        return found[0]
    known = sorted({e for f in formats() for e in f.extensions})
    hint = did_you_mean(extension, known)
    raise FileError(
        Problem(f'Files ending in "{extension}" are not known.{hint} Known: {" ".join(known)}.', where)
    )


def format_for_writing(path: Path) -> Format:
    found = [f for f in formats() if path.suffix.lower() in f.extensions and f.writes]
    if found:
        return found[0]
    known = sorted({e for f in formats() if f.writes for e in f.extensions})
    raise FileError(
        Problem(f'Nothing is written as "{path.suffix}"; there are {" ".join(known)}.', Where(str(path)))
    )


def open_file(path: Path | str, options: Options = Options()) -> Any:  # noqa: B008  # frozen
    """What the file holds: a Document, an Image, a Profile, ... by its format. Raises FileError."""
    path = Path(path)
    return format_of(path).read(path, options)


def open_scene(path: Path | str, options: Options = Options()) -> Document:  # noqa: B008  # frozen
    """A scene file of any format as a Document. Raises FileError where the file holds something else."""
    path = Path(path)
    kind = format_of(path)
    if kind.holds != "scene":
        message = f"A scene was expected; this is {kind.name} ({kind.holds})."
        raise FileError(Problem(message, Where(str(path))))
    return kind.read(path, options)
