"""A series on disk: ``series.json`` beside its images.

    { "quantity": "DN", "black_level": 64, "saturation": 4095, "exposure": 0.01, "plane": 0.0, "view": [0, 0, 1],
      "images": [ { "image": "images/000.png", "direction": [0.2, 0, 0.98], "strength": 1.0 },
                  { "image": "images/001.png", "position": [0.1, 0, 0.3], "strength": 2.0, "exposure": 0.02 } ] }

``direction``: to a distant lamp, of any length; ``position``: of a near one, m. ``strength``: irradiance W/m² or
intensity W/sr, or in a unit common to all; 1 where it is not said. ``camera`` or ``view`` (a direction) says where the
camera stands; neither means above, along z. ``plane``: height z, m, of the surface that near lamps are seen from.
``exposure`` s of all or of one. ``responsivity``: DN per radiance and second, images then are radiance. Images: PNG or
TIFF (DN above ``black_level``) or EXR, all of one size; ``mask`` of an image: 0 leaves a pixel out.
Read strictly: every problem at once.
"""

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from analysis.series.lightings import Lighting
from analysis.series.near_lamps import on_plane, seen_from
from interchange.camera import Camera, Lens, Projection
from interchange.distortion import LensModel
from interchange.exposure import responsivity
from interchange.formats import exr, images
from interchange.formats.atomic import written_beside
from interchange.image import Quantity
from interchange.problems import BrightfieldError, FileError, Problem, Where, did_you_mean
from interchange.sensor import Sensor
from interchange.series import Series, Z

FILE = "series.json"
HEAD = {
    "quantity", "black_level", "saturation", "exposure", "responsivity", "plane", "view", "camera", "made_by", "images",
}  # fmt: skip
ENTRY = {"image", "direction", "position", "strength", "exposure", "mask"}


def read(path: Path | str, without_missing: bool = False, lamps_unknown: bool = False) -> Series:
    """The series of a folder, or of its ``series.json``. Images are divided by their exposure where it is given.

    Saturated samples are marked in ``valid``. ``without_missing`` leaves out images whose files are not there, which
    is otherwise an error. ``lamps_unknown``: images may lack directions, as those of a mirror sphere do; z stands for
    them. Raises FileError with every problem of the file.
    """
    path = Path(path)
    path = path / FILE if path.is_dir() else path
    data = _json(path)
    problems: list[Problem] = []

    def wrong(key: str, message: str) -> None:
        problems.append(Problem(message, Where(str(path), key)))

    _strange(data, HEAD, "", wrong)
    entries = data.get("images")
    if not isinstance(entries, list) or not entries:
        wrong("images", "There must be a list of one image or more.")
        entries = []
    head = _head(data, wrong)
    if lamps_unknown:
        entries = [
            {**e, "direction": [0, 0, 1]}
            if isinstance(e, dict) and not {"direction", "position"} & set(e)
            else e
            for e in entries
        ]
    checked = [_entry(e, f"images[{k}]", head["exposure"], wrong) for k, e in enumerate(entries)]
    if problems:
        raise FileError(problems)
    entries = [e for e in checked if e is not None]
    if len({"direction" in e for e in entries}) > 1:
        wrong("images", "All lamps of a series must have a direction, or all a position.")
    there = [(path.parent / e["image"]).is_file() for e in entries]
    missing = [e["image"] for e, found in zip(entries, there, strict=True) if not found]
    if missing and not without_missing:
        shown = ", ".join(missing[:5]) + (" …" if len(missing) > 5 else "")
        wrong(
            "images",
            f"{len(missing)} of {len(entries)} images are missing: {shown}. Capture again into the same folder to "
            "finish the series, or leave them out with --without-missing.",
        )
    entries = [e for e, found in zip(entries, there, strict=True) if found]
    if not entries and not problems:
        wrong("images", "None of the images is there.")
    if problems:
        raise FileError(problems)
    return _series(path, entries, head, data, wrong, problems)


def _series(
    path: Path,
    entries: list[dict[str, Any]],
    head: dict[str, Any],
    data: dict[str, Any],
    wrong: Any,
    problems: list[Problem],
) -> Series:
    planes: list[np.ndarray] = []
    valid: list[np.ndarray] = []
    for e in entries:
        try:
            pixels, good = _pixels(path.parent / e["image"], head)
            if e["mask"] is not None:
                good &= images.read(path.parent / e["mask"]).max(axis=-1) > 0
        except FileError as error:
            problems.extend(error.problems)
            continue
        except ValueError:
            wrong("images", f"The mask {e['mask']} must have its image's size.")
            continue
        if planes and pixels.shape != planes[0].shape:
            (h, w, c), (h0, w0, c0) = pixels.shape, planes[0].shape
            wrong(
                "images",
                f"All images must have one size; {e['image']} has {w} x {h} px and {c} channels, the first "
                f"{w0} x {h0} px and {c0}.",
            )
            continue
        planes.append(pixels / np.float32(e["exposure"] * (head["responsivity"] or 1.0)))
        valid.append(good)
    if problems:
        raise FileError(problems)
    strength = np.array([e["strength"] for e in entries])
    stack, camera = np.stack(planes), head["camera"]
    shape = stack.shape[1], stack.shape[2]
    if camera is not None:
        points = on_plane(camera, shape, head["plane"])
        wo = np.asarray(_to_camera(camera, points))
    else:
        wo, points = head["view"], None
    positions, irradiance = None, strength
    if "position" in entries[0]:
        if points is None:
            message = "Lamps with positions need a camera, which says where a pixel lies."
            raise FileError(Problem(message, Where(str(path), "camera")))
        positions = np.array([e["position"] for e in entries])
        wi, irradiance = seen_from(points, positions, strength)
    else:
        wi = np.array([e["direction"] for e in entries])
    good = np.stack(valid)
    return Series(
        stack,
        wi,
        irradiance,
        wo,
        positions,
        None if good.all() else good,
        Quantity.RADIANCE if head["responsivity"] else head["quantity"],
        camera,
        tuple(e["image"] for e in entries),
        dict(data.get("made_by", {})),
    )


def _to_camera(camera: Camera, points: np.ndarray) -> np.ndarray:
    """(3,) of a telecentric camera, else (H, W, 3): unit vectors to the camera."""
    if camera.lens.projection is Projection.ORTHOGRAPHIC:
        return -np.asarray(camera.world_from_camera)[:3, 2]
    to = camera.world_from_camera[:3, 3] - points
    return to / np.linalg.norm(to, axis=-1, keepdims=True)


def _pixels(path: Path, head: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    """(H, W, 1 or 3) float32 above black, and (H, W) whether each is a number below saturation."""
    where = Where(str(path))
    if path.suffix.lower() == ".exr":
        raw = exr.read(path).pixels
    else:
        array = images.read(path)
        if array.dtype not in (np.uint8, np.uint16):
            raise FileError(Problem(f"An image must have 8 or 16 bits; got {array.dtype}.", where))
        raw = array.astype(np.float32)
    if raw.shape[2] not in (1, 3):
        raise FileError(Problem(f"An image must be grey or RGB; it has {raw.shape[2]} channels.", where))
    top = raw.max(axis=-1)
    return (raw - np.float32(head["black_level"])).astype(np.float32), np.isfinite(top) & (
        top < head["saturation"]
    )


def _head(data: dict[str, Any], wrong: Any) -> dict[str, Any]:
    head: dict[str, Any] = {}
    numbers = {"black_level": 0.0, "plane": 0.0, "exposure": 1.0, "saturation": np.inf, "responsivity": 0.0}
    for name, default in numbers.items():
        head[name] = data.get(name, default)
        positive = name in ("exposure", "responsivity")
        if name in data and (not _number(data[name]) or (positive and data[name] <= 0)):
            wrong(name, f"It must be a number{' above 0' if positive else ''}; got {data[name]!r}.")
            head[name] = default
    known = [q.value for q in Quantity]
    word = data.get("quantity", "DN")
    if word not in known:
        wrong(
            "quantity", f'It must be one of {", ".join(known)}; got "{word}".{did_you_mean(str(word), known)}'
        )
        word = "DN"
    head["quantity"] = Quantity(word)
    head["view"] = _vector(data.get("view", [0, 0, 1]), "view", wrong, unit=True)
    head["camera"] = None
    if data.get("camera") is not None:
        if "view" in data:
            wrong("view", "A series must have a camera or a view, not both.")
        try:
            head["camera"] = camera_of(data["camera"])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            wrong("camera", f"The camera cannot be read: {error}.")
    return head


def _entry(entry: Any, key: str, exposure: float, wrong: Any) -> dict[str, Any] | None:
    if not isinstance(entry, dict):
        wrong(key, f"An image must be an object; got {json.dumps(entry)[:60]}.")
        return None
    _strange(entry, ENTRY, key, wrong)
    out: dict[str, Any] = {"mask": entry.get("mask")}
    if not isinstance(entry.get("image"), str) or not entry["image"]:
        wrong(f"{key}.image", f"Its file must be named; got {json.dumps(entry.get('image'))}.")
    out["image"] = str(entry.get("image"))
    if ("direction" in entry) == ("position" in entry):
        wrong(key, "An image must have the direction of its lamp or its position, and not both.")
    for name in ("direction", "position"):
        if name in entry:
            out[name] = _vector(entry[name], f"{key}.{name}", wrong, unit=name == "direction")
    for name, default in (("strength", 1.0), ("exposure", exposure)):
        out[name] = entry.get(name, default)
        if not _number(out[name]) or out[name] <= 0:
            wrong(f"{key}.{name}", f"It must be a number above 0; got {json.dumps(out[name])}.")
    return out


def _vector(value: Any, key: str, wrong: Any, unit: bool) -> np.ndarray:
    if not isinstance(value, list) or len(value) != 3 or not all(map(_number, value)):
        wrong(key, f"It must be three numbers; got {json.dumps(value)[:60]}.")
        return Z
    w = np.array(value, np.float64)
    if unit:
        if np.linalg.norm(w) < 1e-9:
            wrong(key, "A direction must not be zero.")
            return Z
        w = w / np.linalg.norm(w)
    return w


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _strange(data: Mapping[str, Any], known: set[str], key: str, wrong: Any) -> None:
    for name in data:
        if name not in known:
            place = f"{key}.{name}" if key else name
            wrong(place, f'The key "{name}" is not known.{did_you_mean(name, known)}')


def _json(path: Path) -> dict[str, Any]:
    where = Where(str(path))
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileError(Problem(f"The file cannot be read: {error.strerror}.", where)) from None
    except (ValueError, RecursionError) as error:
        raise FileError(Problem(f"The file must be JSON in UTF-8: {error}.", where)) from None
    if not isinstance(data, dict):
        raise FileError(Problem("The file must hold a JSON object.", where))
    return data


def camera_record(camera: Camera) -> dict[str, Any]:
    """What of a camera says where a pixel looks, JSON-ready."""
    lens = camera.lens
    return {
        "name": camera.name,
        "world_from_camera": np.asarray(camera.world_from_camera).tolist(),
        "resolution": list(camera.sensor.resolution),
        "pixel_pitch": list(camera.sensor.pixel_pitch),
        "principal_point": None if camera.principal_point is None else list(camera.principal_point),
        "focal_length": lens.focal_length,
        "projection": str(lens.projection),
        "distortion": list(lens.distortion),
        "model": str(lens.model),
    }


def camera_of(record: dict[str, Any]) -> Camera:
    """The inverse of ``camera_record``. Raises KeyError, TypeError or ValueError for what is not one."""
    (width, height), (px, py) = record["resolution"], record["pixel_pitch"]
    point = record.get("principal_point")
    return Camera(
        str(record.get("name", "camera")),
        np.array(record["world_from_camera"], np.float64).reshape(4, 4),
        Lens(
            float(record["focal_length"]),
            distortion=tuple(record.get("distortion", ())),
            projection=Projection(record.get("projection", "perspective")),
            model=LensModel(record.get("model", "opencv")),
        ),
        Sensor((int(width), int(height)), (float(px), float(py))),
        None if point is None else (float(point[0]), float(point[1])),
    )


def write_plan(
    folder: Path,
    files: Sequence[str],
    lightings: Sequence[Lighting],
    camera: Camera,
    quantity: Quantity,
    made_by: dict[str, Any],
    exposure: float = 1.0,
    plane: float = 0.0,
) -> Path:
    """Write ``series.json`` of images that are still to come."""
    entries = []
    for name, step in zip(files, lightings, strict=True):
        key, w = ("direction", step.direction) if step.position is None else ("position", step.position)
        entries.append({"image": name, key: np.asarray(w).tolist(), "strength": step.strength})
    data: dict[str, Any] = {"quantity": str(quantity), "camera": camera_record(camera), "plane": plane}
    if quantity is Quantity.DN:
        sensor = camera.sensor
        top = 2**sensor.bits_out - 1
        data |= {"black_level": sensor.black_level, "saturation": top, "exposure": exposure}
        data["responsivity"] = float(np.mean(responsivity(camera.lens, sensor))) * sensor.K
    path = folder / FILE
    write_json(path, {**data, "made_by": made_by, "images": entries})
    return path


def write(folder: Path | str, series: Series) -> Path:
    """Write a series of floats as EXR beside ``series.json``. Saturated samples become NaN, which reading leaves out.

    Raises BrightfieldError for a series of near lamps without a camera.
    """
    from interchange.image import Image

    folder = Path(folder)
    (folder / "images").mkdir(parents=True, exist_ok=True)
    near = series.positions is not None
    if near and series.camera is None:
        raise BrightfieldError("A series of near lamps needs its camera to be written.")
    entries = []
    for k in range(len(series)):
        name = f"images/{k:03d}.exr"
        pixels = np.where(series.usable[k][..., None], series.images[k], np.nan).astype(np.float32)
        exr.write(folder / name, Image(pixels, series.quantity, series.camera))
        strength = series.irradiance[k]
        if series.positions is not None:
            h, w = series.shape
            # intensity, from irradiance and distance at the middle pixel
            to = series.positions[k] - on_plane(series.camera, (h, w))[h // 2, w // 2]  # type: ignore[arg-type]
            strength = series.irradiance[k, h // 2, w // 2] * float(to @ to)
            entries.append(
                {"image": name, "position": series.positions[k].tolist(), "strength": float(strength)}
            )
        else:
            direction = series.directions[k].tolist()
            entries.append({"image": name, "direction": direction, "strength": float(np.mean(strength))})
    data: dict[str, Any] = {"quantity": str(series.quantity), "made_by": series.made_by}
    data |= {"camera": camera_record(series.camera)} if series.camera else {"view": series.wo.tolist()}
    write_json(folder / FILE, {**data, "images": entries})
    return folder / FILE


def write_with_directions(path: Path, directions: np.ndarray, to: str = "calibrated.json") -> Path:
    """``series.json`` at ``path`` once more beside itself, as ``to``, its lamps in other ``directions`` (L, 3).

    Raises FileError where it has another number of images.
    """
    path = path / FILE if path.is_dir() else path
    data = _json(path)
    entries = data.get("images", [])
    if len(entries) != len(directions):
        message = f"It must have an image for each of {len(directions)} directions; it has {len(entries)}."
        raise FileError(Problem(message, Where(str(path), "images")))
    data["images"] = [
        {**{k: v for k, v in e.items() if k != "position"}, "direction": w.tolist()}
        for e, w in zip(entries, directions, strict=True)
    ]
    write_json(path.parent / to, data)
    return path.parent / to


def write_json(path: Path, data: dict[str, Any]) -> None:
    """Write beside and rename."""
    beside = written_beside(path)
    beside.write_text(json.dumps(data, indent=1, default=_plain) + "\n", encoding="utf-8")
    os.replace(beside, path)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path):
        return str(value)
    return asdict(value)
