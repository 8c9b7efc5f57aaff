"""A frame of a series: its image in grey levels, what it truly shows, and what was varied to make it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from analysis.tune.algorithms.template_match import Pattern
from analysis.tune.features import Features
from analysis.tune.truth import Truth, truth
from analysis.tune.wireframe import Wireframe, wireframe
from analysis.view.visibility import Renderer, named
from interchange.camera import Camera
from interchange.captures import Capture
from interchange.formats import captures as captures_file
from interchange.formats.document import Document, open_scene
from interchange.problems import BrightfieldError, FileError, Problem
from interchange.scene import Scene


@dataclass(frozen=True, eq=False)
class Frame:
    """``image`` (H, W) float32, grey levels of 8 bits; ``usable`` (H, W) bool or None for all of it; ``variation``:
    what was varied, by name."""

    name: str
    image: np.ndarray
    camera: Camera
    truth: Truth
    variation: Mapping[str, float] = field(default_factory=dict)
    usable: np.ndarray | None = None


def grey_levels(pixels: np.ndarray, bits: int) -> np.ndarray:
    """(H, W) float32 in [0, 255] of DN (H, W, C) with ``bits``."""
    return (np.asarray(pixels, np.float32).mean(axis=2) * np.float32(255 / (2**bits - 1))).astype(np.float32)


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
    seen = Views(document, wanted, renderer)
    frames = []
    for c in captures.captures:
        scene, camera, shown = seen.at(c.time, c.camera)
        bits = min(camera.sensor.bits_out, c.bits) if c.pixels.max() < 2**camera.sensor.bits_out else c.bits
        if c.pixels.shape[:2] != camera.sensor.resolution[::-1]:
            width, height = camera.sensor.resolution
            h, w = c.pixels.shape[:2]
            message = f"An image must have its camera's {width} x {height} px; it has {w} x {h} px."
            raise FileError(Problem(message, c.where))
        image = grey_levels(c.pixels, bits)
        frames.append(Frame(c.image, image, camera, shown, conditions(scene, camera, c), c.mask))
    return with_what_varies(frames)


class Views:
    """The truth of a document's moments and cameras, each worked out once."""

    def __init__(self, document: Document, wanted: Features, renderer: Renderer) -> None:
        self.document, self.wanted, self.renderer = document, wanted, renderer
        self._wires: dict[tuple[object, ...], Wireframe] = {}
        self._known: dict[tuple[float, str], tuple[Scene, Camera, Truth]] = {}

    def at(self, time: float, camera_name: str) -> tuple[Scene, Camera, Truth]:
        key = (time, camera_name)
        if key not in self._known:
            scene = self.document.scene(time)
            camera = scene.camera(camera_name)
            check_bodies(scene, self.wanted)
            shown = truth(self.renderer, scene, camera, self.wanted, self._wireframe(scene))
            self._known[key] = scene, camera, shown
        return self._known[key]

    def _wireframe(self, scene: Scene) -> Wireframe:
        bodies = named(scene, list(self.wanted.edges)) if self.wanted.edges else []
        key = tuple((id(b.mesh), b.world_from_body.tobytes()) for b in bodies)
        if key not in self._wires:
            self._wires[key] = wireframe(bodies, self.wanted.angle)
        return self._wires[key]


def check_bodies(scene: Scene, wanted: Features) -> None:
    """Raises BrightfieldError for features on bodies that the scene lacks."""
    own = {b.name for b in scene.bodies}
    for kind in (wanted.lines, wanted.circles, wanted.patterns):
        for name, feature in kind.items():
            if feature.body and feature.body not in own:
                known = ", ".join(sorted(own))
                raise BrightfieldError(
                    f'The feature "{name}" must be on a body of the scene; "{feature.body}" is none of {known}.'
                )


def conditions(scene: Scene, camera: Camera, capture: Capture) -> dict[str, float]:
    """Numbers of a capture that a series may vary, under names for people."""
    found = {"time": capture.time, "exposure, s": capture.exposure}
    if capture.gain_dB is not None:
        found["gain, dB"] = capture.gain_dB
    for light in scene.lights:
        short = light.name.rsplit("/", 1)[-1]
        found[f"{short} intensity"] = float(max(light.intensity))
        found |= {
            f"{short} {axis}, mm": 1e3 * float(light.world_from_light[k, 3]) for k, axis in enumerate("xyz")
        }
    eye = camera.world_from_camera[:3, 3]
    found |= {f"camera {axis}, mm": 1e3 * float(eye[k]) for k, axis in enumerate("xyz")}
    found["blur, px"] = camera.lens.blur
    for body in {b.name: b for b in scene.bodies}.values():
        short = body.name.rsplit("/", 1)[-1]
        found |= {
            f"{short} {axis}, mm": 1e3 * float(body.world_from_body[k, 3]) for k, axis in enumerate("xyz")
        }
    return found


def with_what_varies(frames: Sequence[Frame]) -> list[Frame]:
    """The frames with those variations alone that differ between them; ``time`` only where nothing else does."""
    names = [n for n in frames[0].variation if all(n in f.variation for f in frames)] if frames else []
    values = {n: np.array([f.variation[n] for f in frames]) for n in names}
    differ = [n for n, v in values.items() if np.ptp(v) > 1e-6 * max(float(np.abs(v).max()), 1e-12)]
    if set(differ) - {"time"}:
        differ = [n for n in differ if n != "time"]
    return [replace(f, variation={n: f.variation[n] for n in differ}) for f in frames]


def pattern_of(frame: Frame, name: str) -> tuple[Pattern, np.ndarray]:
    """The template of a pattern, cut from a frame at its whole pixels and looked for where it is; and the pattern's
    middle less the template's (2,), px. Raises BrightfieldError where it is not seen as a whole."""
    square = frame.truth.patterns[name]
    h, w = frame.image.shape
    side = round(square.side) if np.isfinite(square.side) else 0
    column, row = (round(v - (side - 1) / 2) if np.isfinite(v) else -1 for v in square.middle)
    if side < 4 or column < 0 or row < 0 or column + side > w or row + side > h:
        x, y = square.middle
        raise BrightfieldError(
            f'The pattern "{name}" must be seen as a whole and be 4 px wide or more in {frame.name}; it is {side} px '
            f"wide at ({x:.0f}, {y:.0f})."
        )
    middle = (column + (side - 1) / 2, row + (side - 1) / 2)
    pixels = frame.image[row : row + side, column : column + side]
    return Pattern(pixels, square.middle), np.asarray(square.middle) - middle
