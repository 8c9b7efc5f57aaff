"""OpenEXR: linear images with their passes, and a header attribute ``brightfield`` that says what they mean.

| part of the image            | channels                                          |
|------------------------------|---------------------------------------------------|
| pixels of 3, 1, other planes | ``R G B``, ``Y``, ``band.000 band.001 ...``       |
| pass of 3 planes             | ``NAME.R .G .B``; ``position``, ``normal``: X Y Z |
| pass of 2 planes             | ``NAME.X .Y``                                     |
| pass of 1 plane              | ``NAME.V``; ``depth.Z``; of integers ``NAME.I``   |

Floats are 32 bits wide, integers UINT (-1 is 0xFFFFFFFF), packed by ZIP. ``brightfield`` is JSON: version,
quantity, unit, camera, made_by, object_names, material_names, and which channels make up which pass.
"""

import json
import os
from dataclasses import asdict, fields
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.distortion import LensModel
from interchange.formats.atomic import written_beside
from interchange.formats.base import Format, Options
from interchange.formats.exr_header import MAGIC, Header, read_header, size
from interchange.formats.exr_pixels import read_channels
from interchange.image import Image, Quantity
from interchange.problems import BrightfieldError, FileError, Problem, Where

__all__ = ["read", "read_header", "write"]

ATTRIBUTE = "brightfield"
VERSION = 1
XYZ = ("position", "normal")
MAX_NAME = 240  # bytes; OpenEXR allows 255 with the suffix
NOTHING = {"depth": np.inf, "position": np.nan, "normal": np.nan}  # where a pass shows no surface


def write(path: Path | str, image: Image) -> None:
    """Write pixels and passes as float32, packed without loss, beside and renamed.

    Raises BrightfieldError where a pass does not fit the pixels, or the folder cannot be written.
    """
    import OpenEXR

    path = Path(path)
    pixels = np.asarray(image.pixels)
    if pixels.ndim != 3 or 0 in pixels.shape:
        raise BrightfieldError(f"An image must have pixels (H, W, C); got {pixels.shape}. ({path})")
    planes: dict[str, np.ndarray] = {}
    layout = {"": _add(planes, "", pixels, path)}
    for number, (name, values) in enumerate(image.passes.items()):
        values = np.asarray(values)
        if values.shape[:2] != pixels.shape[:2] or values.ndim not in (2, 3):
            raise BrightfieldError(
                f'Pass "{name}" must have the image\'s size {pixels.shape[:2]}; got {values.shape}. ({path})'
            )
        layer = name if name.isascii() and 0 < len(name) <= MAX_NAME else f"pass{number}"
        layout[name] = _add(planes, layer, values, path)
    about = {
        "version": VERSION,
        "quantity": image.quantity.value,
        "unit": image.quantity.unit,
        "camera": None if image.camera is None else _camera_record(image.camera),
        "made_by": image.made_by,
        "object_names": image.object_names,
        "material_names": image.material_names,
        "passes": layout,
    }
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        ATTRIBUTE: json.dumps(about, default=_plain, ensure_ascii=True),
    }
    beside = written_beside(path)
    try:
        with OpenEXR.File(header, planes) as file:
            file.write(str(beside))
        os.replace(beside, path)
    except (OSError, RuntimeError) as error:
        raise FileError(Problem(f"The file cannot be written: {error}", Where(str(path)))) from None
    finally:
        beside.unlink(missing_ok=True)


def _add(planes: dict[str, np.ndarray], layer: str, values: np.ndarray, path: Path) -> list[str]:
    """Put the planes of one pass under their channel names; returns the names in the order of the planes."""
    values = values[..., None] if values.ndim == 2 else values
    if values.dtype.kind in "iub":
        values, whole = values.astype(np.int64), True
        if values.size and not (values.min() >= -1 and values.max() < 2**32 - 1):
            raise BrightfieldError(f'Whole numbers of pass "{layer}" must lie in [-1, 2^32 - 2]. ({path})')
        values = (values & 0xFFFFFFFF).astype(np.uint32)
    else:
        values, whole = values.astype(np.float32), False
    count = values.shape[2]
    ends: tuple[str, ...]
    if count == 1:
        ends = ("I",) if whole else ("Z",) if layer == "depth" else ("V",) if layer else ("Y",)
    elif count == 2 and layer:
        ends = ("X", "Y")
    elif count == 3:
        ends = ("X", "Y", "Z") if layer in XYZ else ("R", "G", "B")
    else:
        ends = tuple(f"{i:03d}" for i in range(count))
        layer = layer or "band"
    names = [f"{layer}.{end}" if layer else end for end in ends]
    if taken := [n for n in names if n in planes]:
        raise BrightfieldError(f"Two passes must not share a channel; both have {taken[0]}. ({path})")
    for i, name in enumerate(names):
        planes[name] = np.ascontiguousarray(values[..., i])
    return names


def read(path: Path | str) -> Image:
    """What ``write`` wrote, number by number; or a foreign file as radiance, which ``made_by`` then says.

    A foreign file's R, G, B (or Y) are the pixels, in the frame of its display window; its other channels are
    passes, layer by layer, A as "alpha". Raises FileError for damaged files and for those without colour.
    """
    path = Path(path)
    header = read_header(path)
    channels = read_channels(path, header)
    if isinstance(text := header.attributes.get(ATTRIBUTE), str):
        return _own(path, text, channels)
    return _foreign(path, header, channels)


def _own(path: Path, text: str, channels: dict[str, np.ndarray]) -> Image:
    try:
        about = json.loads(text)
        if about["version"] > VERSION:
            message = f"The version must be at most {VERSION}; got {about['version']}."
            raise FileError(Problem(message, Where(str(path), "", ATTRIBUTE)))
        pixels = np.stack([channels[name] for name in about["passes"].pop("")], axis=-1)
        passes = {name: _stack([channels[c] for c in names]) for name, names in about["passes"].items()}
        return Image(
            pixels=pixels,
            quantity=Quantity(about["quantity"]),
            camera=None if about["camera"] is None else _camera(about["camera"]),
            made_by=about["made_by"],
            passes=passes,
            object_names=tuple(about["object_names"]),
            material_names=tuple(about["material_names"]),
        )
    except (ValueError, KeyError, TypeError, AttributeError, BrightfieldError) as error:
        if isinstance(error, FileError):
            raise
        message = f"The header attribute must hold this program's JSON; got {type(error).__name__}: {error}."
        raise FileError(Problem(message, Where(str(path), "", ATTRIBUTE))) from None


def _stack(planes: list[np.ndarray]) -> np.ndarray:
    signed = [p.view(np.int32) if p.dtype.kind == "u" else p for p in planes]
    return signed[0] if len(signed) == 1 else np.stack(signed, axis=-1)


def _foreign(path: Path, header: Header, channels: dict[str, np.ndarray]) -> Image:
    layers: dict[str, list[str]] = {}
    for name in channels:
        layer, _, end = name.rpartition(".")
        layers.setdefault(layer, []).append(end)
    root = layers.pop("", [])
    color = next((c for c in (["R", "G", "B"], ["Y"]) if set(c) <= set(root)), None)
    prefix = ""
    if color is None:  # Blender's multilayer files: "ViewLayer.Combined.R"
        found = [n for n, ends in layers.items() if n.endswith("Combined") and {"R", "G", "B"} <= set(ends)]
        if not found:
            names = ", ".join(channels)
            message = f"An image must have channels R, G, B or Y; this file has {names}."
            raise FileError(Problem(message, Where(str(path))))
        prefix, color = f"{found[0]}.", ["R", "G", "B"]
        layers[found[0]] = [e for e in layers[found[0]] if e not in color]
    pixels = np.stack([channels[prefix + c] for c in color], axis=-1).astype(np.float32)
    passes: dict[str, np.ndarray] = {}
    for end in (e for e in root if e not in color or prefix):
        passes["alpha" if end == "A" else end] = channels[end]
    for layer, ends in layers.items():
        for order in (["R", "G", "B"], ["X", "Y", "Z"], ["X", "Y"]):
            if sorted(ends) == sorted(order):
                passes[layer] = np.stack([channels[f"{layer}.{e}"] for e in order], axis=-1)
                break
        else:
            single = len(ends) == 1 and ends[0] in ("V", "Z", "Y", "I")
            passes.update({layer if single else f"{layer}.{e}": channels[f"{layer}.{e}"] for e in ends})
    as_float = {n: p.astype(np.float32) if p.dtype == np.float16 else p for n, p in passes.items()}
    made_by: dict[str, Any] = {
        "note": "the file does not say which quantity its numbers are; they are taken as radiance",
        **{k: v for k, v in header.attributes.items() if isinstance(v, str | int | float)},
    }
    if header.data_window != header.display_window:
        made_by["data_window"], made_by["display_window"] = header.data_window, header.display_window
        pixels = _placed(header, pixels, 0.0)
        as_float = {n: _placed(header, p, NOTHING.get(n, 0.0)) for n, p in as_float.items()}
    if len(header.parts) > 1:
        made_by["part"], made_by["parts"] = header.parts[0], list(header.parts)
    return Image(pixels=pixels, quantity=Quantity.RADIANCE, made_by=made_by, passes=as_float)


def _placed(header: Header, values: np.ndarray, outside: float) -> np.ndarray:
    """Values of the data window in the frame of the display window."""
    (x0, y0, _, _), (X0, Y0, _, _) = header.data_window, header.display_window
    (w, h), (W, H) = size(header.data_window), size(header.display_window)
    placed = np.full((H, W, *values.shape[2:]), outside).astype(values.dtype)
    left, top = max(x0, X0), max(y0, Y0)
    right, bottom = min(x0 + w, X0 + W), min(y0 + h, Y0 + H)
    if left < right and top < bottom:
        inside = values[top - y0 : bottom - y0, left - x0 : right - x0]
        placed[top - Y0 : bottom - Y0, left - X0 : right - X0] = inside
    return placed


def _camera_record(camera: Camera) -> dict[str, Any]:
    skip = ("lens", "sensor", "where")
    record = {f.name: getattr(camera, f.name) for f in fields(camera) if f.name not in skip}
    return {**record, "lens": asdict(camera.lens), "sensor": asdict(camera.sensor)}


def _camera(record: dict[str, Any]) -> Camera:
    lens, sensor = dict(record["lens"]), dict(record["sensor"])
    point = record["principal_point"]
    return Camera(
        name=record["name"],
        world_from_camera=np.array(record["world_from_camera"], np.float64).reshape(4, 4),
        lens=Lens(
            **{
                **lens,
                "distortion": tuple(lens["distortion"]),
                "projection": Projection(lens["projection"]),
                "model": LensModel(lens.get("model", "opencv")),
            }
        ),
        sensor=Sensor(
            **{
                **sensor,
                "resolution": tuple(sensor["resolution"]),
                "pixel_pitch": tuple(sensor["pixel_pitch"]),
            }
        ),
        principal_point=None if point is None else tuple(point),
        clip=tuple(record["clip"]),
        t_exp=record["t_exp"],
    )


def _plain(value: Any) -> Any:
    """What JSON has no word for, as what it has one for."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Path | Enum):
        return str(value)
    raise BrightfieldError(f"What made_by says of an image must be plain data; got {type(value).__name__}.")


class Exr(Format):
    name = "OpenEXR"
    extensions = (".exr",)
    holds = "image"

    def recognises(self, head: bytes) -> bool:
        return head.startswith(MAGIC)

    def read(self, path: Path, options: Options) -> Image:
        return read(path)
