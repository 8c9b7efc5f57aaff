"""Which frames and cameras a command line means."""

import re
from collections.abc import Sequence

from interchange.camera import Camera
from interchange.problems import BrightfieldError
from interchange.scene import Scene


def parse_frames(text: str, times: Sequence[float]) -> list[float]:
    """Time codes of ``all``, ``5``, ``0:99`` (both ends included) or ``0:99:10``, several joined by commas.

    ``times``: the scene's own frames, which ``all`` stands for. Raises BrightfieldError.
    """
    chosen: list[float] = []
    for piece in text.split(","):
        if piece.strip() == "all":
            chosen += times
            continue
        match = re.fullmatch(r"\s*(-?[\d.]+)(?::(-?[\d.]+)(?::([\d.]+))?)?\s*", piece)
        try:
            assert match
            first = float(match[1])
            last, step = float(match[2] or first), float(match[3] or 1)
            assert step > 0
        except (AssertionError, ValueError):
            raise BrightfieldError(
                f'Frames are given as "5", "0:99", "0:99:10" or "all"; got "{piece}".'
            ) from None
        if last < first:
            raise BrightfieldError(f'A range of frames must not end before it begins; got "{piece}".')
        chosen += [first + k * step for k in range(int((last - first) / step + 1e-9) + 1)]
    return list(dict.fromkeys(chosen))


def choose_cameras(scene: Scene, names: Sequence[str]) -> list[Camera]:
    """The cameras of those names, or all for ``all``; without a name the only one."""
    if "all" in names:
        if not scene.cameras:
            scene.camera()  # raises
        return list(scene.cameras)
    return [scene.camera(n) for n in names] if names else [scene.camera()]


def file_name(camera: str, time: float) -> str:
    """``Top.0005.exr``; fractions of a frame follow an underscore, minus signs an m."""
    whole = f"{abs(time):g}"
    number = whole.replace(".", "_").zfill(4 if "." not in whole else 0)
    safe = re.sub(r"[^\w-]+", "_", camera.strip("/"))
    return f"{safe.removeprefix('World_')}.{'m' if time < 0 else ''}{number}.exr"
