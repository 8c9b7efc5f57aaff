"""``captures.json``, read strictly: every problem at once, each with the file and the key."""

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from interchange.captures import Capture, Captures, Tolerances
from interchange.formats import exr, images
from interchange.formats.jpeg_tables import stated
from interchange.parameter import ParameterError
from interchange.problems import FileError, Problem, Where, did_you_mean

HEAD = {"scene", "captures", "holdout", "tolerances"}
ENTRY = {"image", "camera", "time", "exposure", "gain", "mask"}
EXACT = (".png", ".tif", ".tiff", ".bmp")
LOSSY = (".jpg", ".jpeg")  # no masks, as edges ring
LIMITS = {"time": (-1e12, 1e12), "exposure": (1e-12, 1e6), "gain": (-60.0, 120.0)}


def read(path: Path | str) -> Captures:
    """The captures of a ``captures.json`` with their images. Raises FileError with every problem of the file."""
    path = Path(path)
    problems: list[Problem] = []

    def wrong(key: str, message: str) -> None:
        problems.append(Problem(message, Where(str(path), key)))

    data = _json(path)
    _strange(data, HEAD, "", wrong)
    scene = data.get("scene")
    if not isinstance(scene, str) or not scene:
        wrong("scene", f"The scene's file must be named; got {json.dumps(scene)}.")
    elif not (path.parent / scene).is_file():
        wrong("scene", f"The scene's file does not exist: {scene}.")
    tolerances = _tolerances(data.get("tolerances", {}), wrong)
    entries = data.get("captures")
    if not isinstance(entries, list) or not entries:
        wrong("captures", "There must be a list of one capture or more.")
        entries = []
    captures = [_capture(path, entry, f"captures[{i}]", wrong) for i, entry in enumerate(entries)]
    found = tuple(c for c in captures if c is not None)
    names = [e.get("image") for e in entries if isinstance(e, dict)]
    for name in sorted({n for n in names if isinstance(n, str) and names.count(n) > 1}):
        wrong("captures", f"An image must be listed once; {name} is there {names.count(name)} times.")
    holdout = data.get("holdout", [])
    if not isinstance(holdout, list) or not all(isinstance(h, str) for h in holdout):
        wrong("holdout", "Captures that are held out must be a list of their images.")
        holdout = []
    for i, name in enumerate(holdout):
        if name not in names:
            known = [n for n in names if isinstance(n, str)]
            wrong(f"holdout[{i}]", f'No capture has the image "{name}".{did_you_mean(name, known)}')
    if holdout and set(names) <= set(holdout):
        wrong("holdout", "One capture or more must not be held out; nothing is left to fit to.")
    if problems:
        raise FileError(problems)
    return Captures(path, path.parent / str(scene), found, tuple(holdout), tolerances)


def _json(path: Path) -> dict[str, Any]:
    where = Where(str(path))
    try:
        data = json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=_once)
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    except UnicodeDecodeError:
        raise FileError(Problem("The file must be UTF-8 text.", where)) from None
    except json.JSONDecodeError as error:
        place = Where(str(path), f"line {error.lineno}")
        raise FileError(Problem(f"The file must be JSON: {error.msg}.", place)) from None
    except (ValueError, RecursionError) as error:
        raise FileError(Problem(f"The file must be JSON: {error}.", where)) from None
    if not isinstance(data, dict):
        raise FileError(Problem("The file must hold a JSON object.", where))
    return data


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    names = [name for name, _ in pairs]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise ValueError(f'the key "{twice}" stands twice in one object')
    return dict(pairs)


def _strange(data: Mapping[str, Any], known: set[str], key: str, wrong: Any) -> None:
    for name in data:
        if name not in known:
            place = f"{key}.{name}" if key else name
            wrong(place, f'The key "{name}" is not known.{did_you_mean(name, known)}')


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _tolerances(data: Any, wrong: Any) -> Tolerances:
    if not isinstance(data, dict):
        wrong("tolerances", "Tolerances must be an object of names and numbers.")
        return Tolerances()
    _strange(data, {f.name for f in fields(Tolerances)}, "tolerances", wrong)
    given = {}
    for f in fields(Tolerances):
        if f.name not in data:
            continue
        value = data[f.name]
        try:
            if not _number(value):
                raise ParameterError(f"A tolerance must be a number; got {json.dumps(value)}.")
            Tolerances(**{f.name: value})
        except ParameterError as error:
            wrong(f"tolerances.{f.name}", str(error))
        else:
            given[f.name] = value
    return Tolerances(**given)


def _capture(path: Path, entry: Any, key: str, wrong: Any) -> Capture | None:
    if not isinstance(entry, dict):
        wrong(key, f"A capture must be an object; got {json.dumps(entry)[:60]}.")
        return None
    _strange(entry, ENTRY, key, wrong)
    good = True
    for name in ("image", "camera"):
        if not isinstance(entry.get(name), str) or not entry[name]:
            wrong(f"{key}.{name}", f"A capture's {name} must be named; got {json.dumps(entry.get(name))}.")
            good = False
    for name, (low, high) in LIMITS.items():
        value = entry.get(name)
        if value is None and name == "gain":
            continue
        if value is None or not _number(value) or not low <= value <= high:
            wrong(
                f"{key}.{name}",
                f"A capture's {name} must be a number in [{low:g}, {high:g}]; got {json.dumps(value)}.",
            )
            good = False
    if not good:
        return None
    try:
        pixels, bits = _pixels(path.parent / entry["image"], "capture", EXACT + LOSSY)
        mask = None
        if entry.get("mask") is not None:
            if not isinstance(entry["mask"], str):
                raise FileError(
                    Problem("A mask must be the name of an image.", Where(str(path), f"{key}.mask"))
                )
            mask = _pixels(path.parent / entry["mask"], "mask", EXACT)[0].max(axis=-1) > 0
    except FileError as error:
        for problem in error.problems:
            wrong(f"{key}.image", str(problem))
        return None
    if mask is not None and mask.shape != pixels.shape[:2]:
        (h, w), (mh, mw) = pixels.shape[:2], mask.shape
        wrong(f"{key}.mask", f"A mask must have its image's size, {w} x {h} px; it has {mw} x {mh} px.")
        return None
    gain = entry.get("gain")
    return Capture(
        image=entry["image"],
        camera=entry["camera"],
        time=float(entry["time"]),
        exposure=float(entry["exposure"]),
        pixels=pixels,
        gain_dB=None if gain is None else float(gain),
        mask=mask,
        bits=bits,
        jpeg=stated(path.parent / entry["image"]) if Path(entry["image"]).suffix.lower() in LOSSY else None,
        where=Where(str(path), key),
    )


def _pixels(path: Path, what: str, kinds: tuple[str, ...]) -> tuple[np.ndarray, int]:
    """(H, W, 1) or (H, W, 3) float32 DN, and the bits of the file: 8, 16, or 0 for EXR."""
    where = Where(str(path))
    if path.suffix.lower() == ".exr":
        pixels, bits = exr.read(path).pixels, 0
        if not np.isfinite(pixels).all():
            raise FileError(Problem(f"Every pixel of a {what} must be a finite number.", where))
    elif path.suffix.lower() in kinds:
        array = images.read(path)
        if array.dtype not in (np.uint8, np.uint16):
            raise FileError(Problem(f"A {what} must have 8 or 16 bits; got {array.dtype}.", where))
        pixels, bits = array.astype(np.float32), 8 * array.dtype.itemsize
    else:
        may = ("PNG, TIFF, BMP, JPEG" if LOSSY[0] in kinds else "PNG, TIFF, BMP") + " or EXR"
        raise FileError(Problem(f"A {what} must be {may}; got {path.name}.", where))
    if pixels.shape[2] not in (1, 3):
        raise FileError(Problem(f"A {what} must be grey or RGB; it has {pixels.shape[2]} channels.", where))
    return np.asarray(pixels, np.float32), bits
