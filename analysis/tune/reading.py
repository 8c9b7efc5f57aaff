"""A series by its path: a ``captures.json``, or a folder that `brightfield sweep` wrote."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from analysis.sweep.choices import with_values
from analysis.tune.features import Features
from analysis.tune.frames import Frame, grey_levels, with_what_varies
from analysis.tune.truth import Truth, truth
from analysis.tune.wireframe import Wires
from analysis.view.visibility import Renderer
from interchange.camera import Camera
from interchange.captures import Capture
from interchange.formats import captures as captures_file
from interchange.formats import images, parquet, rle
from interchange.formats.document import open_scene
from interchange.problems import FileError, Problem, Where
from interchange.scene import Scene


def read_series(path: Path, wanted: Features, renderer: Renderer) -> list[Frame]:
    """Raises FileError and BrightfieldError."""
    if not path.is_dir():
        return read_captures(path, wanted, renderer)
    if (path / "manifest.parquet").is_file():
        return read_sweep(path, wanted, renderer)
    if (path / "captures.json").is_file():
        return read_captures(path / "captures.json", wanted, renderer)
    raise FileError(
        Problem("The folder of a series must hold manifest.parquet or captures.json.", Where(str(path)))
    )


def read_captures(path: Path, wanted: Features, renderer: Renderer) -> list[Frame]:
    """The frames of a ``captures.json``, their truth from its scene. Raises FileError and BrightfieldError."""
    captures = captures_file.read(path)
    document = open_scene(captures.scene)
    floats = [c for c in captures.captures if c.bits == 0]
    if floats:
        raise FileError(
            [
                Problem("An image to be tuned for must hold DN (PNG, TIFF); it is EXR.", c.where)
                for c in floats
            ]
        )
    wires = Wires(wanted.angle)
    known: dict[tuple[float, str], tuple[Scene, Camera, Truth]] = {}
    frames = []
    for c in captures.captures:
        key = c.time, c.camera
        if key not in known:
            scene = document.scene(c.time)
            camera = scene.camera(c.camera)
            known[key] = scene, camera, truth(renderer, scene, camera, wanted, wires)
        scene, camera, shown = known[key]
        if c.mask is not None and shown.edges is not None:
            shown = replace(shown, edges=shown.edges.within(c.mask))
        image = _image(c.pixels, min(camera.sensor.bits_out, c.bits), camera, c.where)
        frames.append(Frame(c.image, image, camera, shown, conditions(scene, camera, c), c.mask))
    return with_what_varies(frames)


def read_sweep(folder: Path, wanted: Features, renderer: Renderer) -> list[Frame]:
    """The frames of a sweep: scenes as its plan set them, masks of its defects. Raises FileError and BrightfieldError.

    ``wanted.blobs`` may name objects by their paths, a defect ("defects.scratch[0]"), a kind ("scratch"), or "defects"
    for all of them.
    """
    rows, about = parquet.read(folder / "manifest.parquet")
    file = Where(str(folder / "manifest.parquet"))
    if not rows or "file.image" not in rows[0]:
        raise FileError(
            Problem("A series to be tuned on must have images of DN; sweep with write: png.", file)
        )
    document = open_scene(_scene_file(folder, about.get("brightfield.scene", ""), file))
    units = json.loads(about.get("brightfield.units", "{}"))
    bases: dict[float, Scene] = {}
    wires, frames = Wires(wanted.angle), []
    called: set[str] = set()
    named = {(a, v) for r in rows for a, v in r.items() if a in units and isinstance(v, str)}
    for row in rows:
        record = _record(folder / "frames" / f"{row['frame']:06d}.json")
        base = bases.setdefault(row["time"], document.scene(row["time"]))
        scene = with_values(base, {a: v for a, v in record["values"].items() if not a.startswith("defects.")})
        camera = scene.camera(row["camera"])
        if camera.sensor.resolution[0] != row["width"]:
            camera = camera.resized(row["width"])
        shown = truth(renderer, scene, camera, replace(wanted, blobs=()), wires)
        if wanted.blobs:
            shown = replace(shown, regions=_regions(record, wanted.blobs))
            called |= {w for w in wanted.blobs if any(_is_called(i, w) for i in record["instances"])}
        path = folder / row["file.image"]
        array = images.read(path)
        image = _image(array.astype(np.float32), camera.sensor.bits_out, camera, Where(str(path)))
        values = record["values"]
        varied = {_named(n, units): float(v) for n, v in values.items() if not isinstance(v, str)}
        varied |= {f"{a} = {v}": float(values[a] == v) for a, v in sorted(named)}
        varied["time"] = float(row["time"])
        frames.append(Frame(row["file.image"], image, camera, shown, varied, weight=float(row["weight"])))
    for word in set(wanted.blobs) - called:
        raise FileError(Problem(f'No frame of the sweep shows an object or a defect "{word}".', file))
    return with_what_varies(frames)


def conditions(scene: Scene, camera: Camera, capture: Capture) -> dict[str, float]:
    """Numbers of a capture that a series may vary, under names for people."""
    found = {"time": capture.time, "exposure, s": capture.exposure}
    if capture.gain_dB is not None:
        found["gain, dB"] = capture.gain_dB

    def place(name: str, pose: np.ndarray) -> None:
        found.update({f"{name} {axis}, mm": 1e3 * float(pose[k, 3]) for k, axis in enumerate("xyz")})

    for light in scene.lights:
        short = light.name.rsplit("/", 1)[-1]
        found[f"{short} intensity"] = float(max(light.intensity))
        place(short, light.world_from_light)
    place("camera", camera.world_from_camera)
    found |= {"blur, px": camera.lens.blur, "black level, DN": camera.sensor.black_level}
    for body in {b.name: b for b in scene.bodies}.values():
        place(body.name.rsplit("/", 1)[-1], body.world_from_body)
    return found


def _image(pixels: np.ndarray, bits: int, camera: Camera, where: Where) -> np.ndarray:
    width, height = camera.sensor.resolution
    if pixels.shape[:2] != (height, width):
        h, w = pixels.shape[:2]
        message = f"An image must have its camera's {width} x {height} px; it has {w} x {h} px."
        raise FileError(Problem(message, where))
    if pixels.max() >= 2**bits:
        message = f"DN must fit into the sensor's {bits} bits; got {pixels.max():g}. Set sensor:bitDepth."
        raise FileError(Problem(message, where))
    return grey_levels(pixels, bits)


def _scene_file(folder: Path, name: str, where: Where) -> Path:
    for path in (Path(name), folder / name, folder.parent / Path(name).name):
        if name and path.is_file():
            return path
    raise FileError(Problem(f'The scene of the sweep must be there; "{name}" is not.', where))


def _record(path: Path) -> dict[str, Any]:
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise FileError(
            Problem(f"The frame's record cannot be read: {error.strerror}.", Where(str(path)))
        ) from None
    except ValueError as error:
        raise FileError(Problem(f"The frame's record must be JSON: {error}.", Where(str(path)))) from None


def _regions(record: dict[str, Any], words: Sequence[str]) -> np.ndarray:
    width, height = record["size"]
    regions = np.zeros((height, width), np.int32)
    fits = [i for i in record["instances"] if any(_is_called(i, word) for word in words)]
    for k, instance in enumerate(fits):
        regions[rle.decode(instance["rle"])] = k + 1
    return regions


def _is_called(instance: dict[str, Any], word: str) -> bool:
    name, kind = str(instance["name"]), str(instance["kind"])
    if word == "defects":
        return kind != "object"
    return word in (name, kind) or (kind == "object" and name.endswith("/" + word.lstrip("/")))


def _named(address: str, units: dict[str, str]) -> str:
    unit = units.get(address, "1")
    return address if unit == "1" else f"{address}, {unit}"
