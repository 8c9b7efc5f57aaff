"""The diagnosis of a folder with scene.usda and captures.json, as its users run it."""

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from interchange.formats.usd_author import author_scene
from interchange.scene import Scene

ROOT = Path(__file__).parents[1]


def written(
    folder: Path,
    frames: Sequence[Scene],
    entries: Sequence[dict[str, Any]],
    tolerances: dict[str, float],
    held: Sequence[str] = (),
) -> None:
    """Write scene.usda, a frame a time code, and captures.json to ``folder``."""
    author_scene(frames[0], frames=frames[1:]).Export(str(folder / "scene.usda"))
    head = {"scene": "scene.usda", "captures": list(entries), "tolerances": tolerances}
    if held:
        head["holdout"] = list(held)
    (folder / "captures.json").write_text(json.dumps(head, indent=1))


def diagnosed(folder: Path) -> dict[str, Any]:
    """What ``brightfield diagnose`` writes of captures.json in ``folder``."""
    command = [sys.executable, "-m", "composer", "diagnose", str(folder / "captures.json"), "--render", "realtime",
               "--out", str(folder), "--cache", str(folder / "cache"), "--bin", "1"]  # fmt: skip
    print(f"{folder.name}:", flush=True)
    subprocess.run(command, cwd=ROOT, check=True)
    found: dict[str, Any] = json.loads((folder / "diagnosis.json").read_text())
    gap = found["gap"]
    print(
        f"  as written chi {gap['as_written']:.2f}; explained {100 * gap['explained']:.1f} %; {found['seconds']:.0f} s"
    )
    for note in found["notes"]:
        print(f"  note: {note}")
    return found
