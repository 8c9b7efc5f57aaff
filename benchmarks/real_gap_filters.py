"""The discs under 450, 550 and 650 nm, put together as one picture, against a lens without lateral chromatic
aberration.

A raw mosaic whose blue sites are those of a picture under 450 nm, green of 550 nm, red of 650 nm, is what the camera
would have seen under the three lines at once. Reference: how the discs' middles lie apart from filter to filter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from benchmarks.diagnosed import diagnosed, written
from benchmarks.flea3_discs import (
    AXIS,
    COLOURS,
    FULL_WELL,
    Discs,
    centroids,
    composite,
    falling_off,
    ink,
    lamp,
    light,
    picture,
    sheet,
    smaller,
    taught,
)
from benchmarks.twin_flea3 import rims
from interchange.camera import Camera, Lens, Sensor
from interchange.effects.demosaic import Demosaic
from interchange.exposure import expose
from interchange.formats import exr
from interchange.image import Image
from interchange.scene import Scene
from interchange.sensor import Demosaic as Method
from interchange.sensor import Mosaic
from realtime.renderers.rasterizer import Rasterizer

SHUTTERS = ({"red": 100, "green": 25, "blue": 25}, {"red": 250, "green": 25, "blue": 50},
            {"red": 50, "green": 50, "blue": 100})  # fmt: skip  # ms of each condition
HELD = 2  # of them: it shares no picture with the others
STEP = 256  # DN of 16 bits that one of the pictures' 8 is written as: interpolation does not round it then
EFFECT = "lateral_chromatic_aberration"
NUMBERS = ("red", "blue", "red3", "blue3", "red_u", "red_v", "blue_u", "blue_v")
BLURS = 4  # times that the twin's blur is corrected by what its edges show
SIZES = (4, 2)  # times that pictures are reduced


@dataclass(frozen=True, eq=False)
class Apart:
    """How discs of one colour lie off those of green: ``at`` (n, 2) px are green's, ``shift`` (n, 2) px."""

    at: np.ndarray
    shift: np.ndarray

    @property
    def magnification(self) -> tuple[float, float]:
        """c of shift = c (at - axis), and its standard deviation."""
        away = self.at - np.array(AXIS)
        c = float((self.shift * away).sum() / (away**2).sum())
        left = self.shift - c * away
        return c, float(np.sqrt((left**2).sum() / (left.size - 1) / (away**2).sum()))

    @property
    def aside(self) -> np.ndarray:
        """(2,) px: what c leaves in the mean."""
        return np.asarray((self.shift - self.magnification[0] * (self.at - np.array(AXIS))).mean(axis=0))

    def left(self, numbers: dict[str, float], colour: str) -> np.ndarray:
        """(n, 2) px: what the effect's numbers leave."""
        return np.asarray(self.shift - shifted(self.at, numbers, colour))


def shifted(at: np.ndarray, numbers: dict[str, float], colour: str) -> np.ndarray:
    """px by which the effect moves what green has ``at`` (n, 2) px of the cut: r (c + d r²) from the axis and (u, v);
    1 is half the cut's diagonal."""
    h, w = picture(550, 25).shape
    unit = np.hypot(w / 2, h / 2)
    away = (at - np.array(AXIS)) / unit
    c, d, u, v = (numbers.get(colour + which, 0.0) for which in ("", "3", "_u", "_v"))
    return np.asarray(unit * (away * (c + d * (away**2).sum(axis=1, keepdims=True)) + np.array([u, v])))


def reference(discs: Discs) -> dict[str, Apart]:
    """Of red and blue, each the mean over its shutter times."""
    px = np.linalg.norm(
        discs.camera.project(discs.centres[0] + [discs.radius, 0, 0]) - discs.camera.project(discs.centres[0])
    )
    middle = {
        colour: np.mean(
            [
                centroids(picture(nm, ms), colour, discs.near, px)
                for ms in sorted({s[colour] for s in SHUTTERS})
                if picture(nm, ms).max() < 255
            ],
            axis=0,
        )
        for colour, nm in COLOURS.items()
    }
    return {c: Apart(middle["green"], middle[c] - middle["green"]) for c in ("red", "blue")}


def filters(out: Path, sizes: Sequence[int], drawn_to: Path | None) -> None:
    first = {colour: picture(nm, SHUTTERS[0][colour]) for colour, nm in COLOURS.items()}
    discs = taught(first["green"])
    print(f"{len(discs.centres)} discs; the lattice misses them by {discs.off:.3f} px rms an axis")
    there = reference(discs)
    for colour, a in there.items():
        c, sigma = a.magnification
        mean, own = a.shift.mean(axis=0), np.sqrt(np.mean(a.left({colour: c}, colour) ** 2))
        print(
            f"  {COLOURS[colour]} nm: discs ({mean[0]:+.3f}, {mean[1]:+.3f}) px from those under 550 nm; about the "
            f"axis {c:+.5f} ± {sigma:.5f}, which leaves ({a.aside[0]:+.3f}, {a.aside[1]:+.3f}) px, "
            f"{own:.3f} px rms an axis"
        )
    known = dict.fromkeys(NUMBERS, 0.0)
    for size in sizes:
        found = of_size(out / f"size{size}", size, discs, known)
        told = next((f["parameters"] for f in found["effects"] if f["name"] == EFFECT), {})
        for name in (n for n in NUMBERS if n in told):
            value, sigma = told[name]["value"], told[name]["sigma"]
            known[name] = value if abs(value) > sigma else 0.0
        compared(known, told, there)
    if drawn_to is not None:
        drawn(first, discs, there, known).savefig(drawn_to, dpi=110)


def compared(known: dict[str, float], told: dict[str, Any], there: dict[str, Apart]) -> None:
    for name in NUMBERS:
        sigma = f" ± {told[name]['sigma']:.5f}" if name in told else ", not found here"
        print(f"  {name} {known[name]:+.5f}{sigma}")
    for colour, a in there.items():
        mean, off = shifted(a.at, known, colour).mean(axis=0), a.left(known, colour)
        print(
            f"  {colour}: discs moved by ({mean[0]:+.3f}, {mean[1]:+.3f}) px in the mean; of the shifts seen, "
            f"{np.sqrt(np.mean(a.shift**2)):.3f} px rms an axis, {np.sqrt(np.mean(off**2)):.3f} are left, "
            f"({off.mean(axis=0)[0]:+.3f}, {off.mean(axis=0)[1]:+.3f}) in the mean",
            flush=True,
        )


def of_size(folder: Path, size: int, discs: Discs, known: dict[str, float]) -> dict[str, Any]:
    """The diagnosis of the pictures reduced ``size`` times, of a lens that has ``known`` already."""
    folder.mkdir(parents=True, exist_ok=True)
    first = {c: picture(nm, SHUTTERS[0][c]) for c, nm in COLOURS.items()}
    places = {c: lamp(discs, y, c) for c, y in first.items()}
    bodies = sheet(discs, [ink(discs, first[c], c) for c in COLOURS])
    pixels = [captured(shutter, size) for shutter in SHUTTERS]
    camera = twin(discs.camera, size, pixels[0].shape)

    def scene(shutter: dict[str, int]) -> Scene:
        lamps = []
        for k, (colour, (at, power)) in enumerate(places.items()):
            whole = power * shutter[colour] / SHUTTERS[0][colour]
            lamps.append(light(f"/World/Lamp{COLOURS[colour]}", at, np.eye(3)[k] * whole))
        return Scene(bodies, tuple(lamps), (camera,))

    camera = as_sharp(camera, scene(SHUTTERS[0]), pixels[0], discs)
    numbers = tuple(known[n] for n in NUMBERS)
    camera = replace(camera, lens=replace(camera.lens, lateral_chromatic_aberration=numbers))
    entries = []
    for n, (image, shutter) in enumerate(zip(pixels, SHUTTERS, strict=True)):
        name = "_".join(f"{COLOURS[c]}nm{ms:04d}ms" for c, ms in shutter.items()) + ".exr"
        exr.write(folder / name, Image(image))
        entries.append({"image": name, "camera": "/World/Camera", "time": n, "exposure": 1.0})
    registration = discs.off / np.sqrt(len(discs.centres)) / size  # the pose is a mean over the discs
    tolerances = {"registration_px": round(registration, 4), "light_intensity": 0.02, "light_position_mm": 2,
                  "flat_field": 0.01, "black_level_dn": STEP, "albedo": 0.05, "object_pose_mm": 0.01}  # fmt: skip
    written(folder, [scene(s) for s in SHUTTERS], entries, tolerances, [entries[HELD]["image"]])
    return diagnosed(folder)


def captured(shutter: dict[str, int], size: int) -> np.ndarray:
    """(h, w, 3) float32 DN of 16 bits: red, green, blue, each from the sites of its own colour."""
    mosaic = composite({colour: picture(nm, shutter[colour]) for colour, nm in COLOURS.items()})
    camera = Camera(sensor=Sensor(mosaic.shape[::-1], bit_depth=16))
    whole = Demosaic(Method.BILINEAR, Mosaic.GBRG).apply(
        Image(STEP * mosaic[..., None].astype(np.float32)), camera, None
    )
    h, w = (n // size for n in mosaic.shape)
    parts = whole.pixels[: h * size, : w * size].reshape(h, size, w, size, 3)
    return parts.mean(axis=(1, 3), dtype=np.float64).astype(np.float32)


def twin(camera: Camera, size: int, shape: tuple[int, ...]) -> Camera:
    """Radiance 1 for a second is a DN of the pictures' 8 bits. Pictures at full size are interpolated by the chain, as
    the captures are; what those reduced have of it counts as blur."""
    sensor = Sensor(
        responsivity=FULL_WELL / 255,
        full_well=FULL_WELL * (2**16 - 1) / (255 * STEP),
        bit_depth=16,
        read_noise=FULL_WELL / 255 / np.sqrt(12) / size,  # what rounding to 8 bits leaves
        mosaic="GBRG" if size == 1 else "",
    )
    own = replace(smaller(camera, size, (shape[1], shape[0]), sensor), lens=Lens(camera.lens.focal_length))
    return falling_off(own)


def as_sharp(camera: Camera, scene: Scene, real: np.ndarray, discs: Discs) -> Camera:
    """The camera with the blur of the discs' edges in ``real``: the least, and what other colours have more, as they
    are out of focus."""

    def widths(image: np.ndarray) -> np.ndarray:
        planes = [rims(image[..., k] / STEP, camera, discs.centres, discs.radius)[0].sigma for k in range(3)]
        return np.nanmedian(np.array(planes), axis=1)

    wanted, variance = widths(real), np.zeros(3)
    with Rasterizer() as renderer:
        image = renderer.render(scene, camera, samples=16)
    for _ in range(BLURS):
        blur, more = (
            np.sqrt(variance.min()),
            4 * np.sqrt(variance - variance.min()),
        )  # a disc's variance is d² / 16
        lens = replace(
            camera.lens, blur=float(blur), axial_chromatic_aberration=tuple(float(d) for d in more)
        )
        camera = replace(camera, lens=lens)
        variance = np.maximum(variance + wanted**2 - widths(expose(image, camera).pixels) ** 2, 0)
    print(
        f"  blur {blur:.2f} px rms; discs of confusion of red, green, blue "
        + ", ".join(f"{d:.2f}" for d in more)
    )
    return camera


def drawn(
    first: dict[str, np.ndarray], discs: Discs, there: dict[str, Apart], known: dict[str, float]
) -> Figure:
    """A part of the picture as seen, and with red and blue put back; shifts of all discs, seen and found."""
    seen = np.clip(captured(SHUTTERS[0], 1) / STEP, 0, 255)
    paper = np.percentile(seen, 80, axis=(0, 1))
    h, w = seen.shape[:2]
    column, row = np.meshgrid(np.arange(w), np.arange(h))
    grid = np.stack([column, row], -1).reshape(-1, 2).astype(float)
    back = seen.copy()
    for k, colour in ((0, "red"), (2, "blue")):
        to = (grid + shifted(grid, known, colour)).reshape(h, w, 2).astype(np.float32)
        back[..., k] = cv2.remap(
            np.ascontiguousarray(seen[..., k], np.float32), to[..., 0], to[..., 1], cv2.INTER_CUBIC
        )
    figure = Figure(figsize=(12, 3.7), layout="tight")
    axes = figure.subplots(1, 3)
    part = slice(120, 240), slice(140, 280)
    for ax, image, words in (
        (axes[0], seen, "650, 550, 450 nm as red, green, blue"),
        (axes[1], back, "put back by what was found"),
    ):
        ax.imshow(np.clip(image[part] / paper, 0, 1), interpolation="nearest")
        ax.set_title(words)
        ax.set_axis_off()
    ax = axes[2]
    for colour, a in there.items():
        told = shifted(a.at, known, colour)
        style = {"angles": "xy", "scale_units": "xy", "scale": 1 / 20}
        ax.quiver(*a.at.T, *a.shift.T, color=colour, alpha=0.4, width=0.006, **style)
        ax.quiver(*a.at.T, *told.T, color="black", width=0.003, **style)
    ax.set(
        xlim=(0, w), ylim=(h, 0), aspect="equal", title="shifts x 20: 650 (red), 450 (blue), found (black)"
    )
    return figure
