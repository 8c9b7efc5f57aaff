"""Write a profile as IES LM-63-2002, type C, so that other software reads it as well; ``ies`` reads it back."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from interchange.formats.atomic import written_beside
from interchange.light import Light, Profile
from interchange.problems import BrightfieldError

CUT = 1e-4  # degrees between the profile's last angle and the dark beyond it


def write(path: Path | str, profile: Profile, keywords: dict[str, str] | None = None) -> None:
    """The candela at the profile's own angles, zero beyond. Raises BrightfieldError where LM-63 has no place for it."""
    path = Path(path)
    vertical, candela = np.degrees(profile.vertical), np.asarray(profile.candela, np.float64)
    if len(vertical) < 2 or vertical[0] > CUT:
        raise BrightfieldError(
            f"To be written as IES a profile must begin on its axis; this begins at {vertical[0]:g}°."
        )
    end = 90.0 if vertical[-1] <= 90 else 180.0
    beyond = [a for a in (vertical[-1] + CUT, end) if vertical[-1] < a <= end]
    vertical = np.concatenate([vertical, beyond])
    candela = np.concatenate([candela, np.zeros((len(candela), len(beyond)))], axis=1)
    horizontal = np.degrees(profile.horizontal)
    lines = ["IESNA:LM-63-2002"]
    lines += [f"[{k.upper()}] {v}" for k, v in (keywords or {}).items()]
    lines += ["TILT=NONE", f"1 -1 1 {len(vertical)} {len(horizontal)} 1 2 0 0 0", "1 1 0"]
    lines += [_row(vertical), _row(horizontal), *map(_row, candela)]
    new = written_beside(path)
    new.write_text("\n".join(lines) + "\n", "ascii", "replace")
    os.replace(new, path)


def saved(lights: tuple[Light, ...], folder: Path | str) -> tuple[Light, ...]:
    """The lamps with each profile that has no file yet written to ``folder``, as a USD scene needs them."""
    folder = Path(folder)
    files: dict[int, Profile] = {}
    found = []
    for light in lights:
        profile = light.profile
        if profile is None or profile.file:
            found.append(light)
            continue
        if id(profile) not in files:
            count = len(files)
            path = folder / f"profile{count}.ies"
            while path.exists():
                count += 1
                path = folder / f"profile{count}.ies"
            write(path, profile)
            files[id(profile)] = replace(profile, file=str(path))
        found.append(replace(light, profile=files[id(profile)]))
    return tuple(found)


def _row(numbers: np.ndarray) -> str:
    return "\n".join(" ".join(f"{x:.9g}" for x in numbers[i : i + 12]) for i in range(0, len(numbers), 12))
