"""What the sensor of a case gets: layers of light, through the lens, onto pixels, as electrons and DN.

    e(shot) = sensor( responsivity · t · flat · optics( Σ lamps gain · bin( fine( flow( layer ))) ) )

Everything up to the pixels is linear, so that each layer goes through the lens once a case.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from benchmarks.blind import chain
from benchmarks.blind.bench import Bench, Lamp, Shot
from benchmarks.blind.chain import Cause, Frame
from benchmarks.blind.errors import CalibrationErrors
from benchmarks.blind.scene_causes import changed
from benchmarks.blind.tracing import Quality, beam, guide, layer

SPARE = 3  # px: of the image's own place on the sensor, of interpolation, and of a last step of an amplitude
LIGHT = ("one lamp", "one lamp's colour", *chain.SKY, "bounces", "extra lamp", "translucent")


@dataclass(frozen=True, eq=False)
class Setup:
    """``bench``: the scene as it stands, calibration errors and all. ``filter``: "box", or another engine's."""

    bench: Bench
    errors: CalibrationErrors
    quality: Quality
    seed: int
    cache: Path
    filter: str = "box"

    @property
    def frame(self) -> Frame:
        return Frame(self.bench.size)


def means(setup: Setup, causes: Sequence[Cause], shots: Sequence[Shot] | None = None) -> list[np.ndarray]:
    """(h, w, 3) mean DN above black over K, e-, of each shot: no noise, no rounding."""
    shots = setup.bench.shots if shots is None else shots
    if any(c.eye is not None for c in causes):
        return _by_eye(setup, causes, shots)
    bench = changed(setup.bench, list(causes))
    light = [c for c in causes if c.form in LIGHT and c.amplitude]
    pixels = _Pixels(setup, bench, causes)
    out = []
    for shot in shots:
        E = np.zeros((setup.bench.size[1], setup.bench.size[0], 3))
        bounce = 1 + sum(c.shape["sign"] * c.amplitude for c in light if c.form == "bounces")
        for k in shot.lamps:
            lamp = bench.lamps[k]
            gain = setup.errors.lamp(k, shot)
            for c in light:
                if c.place == lamp.name and c.form == "one lamp":
                    gain = gain * (1 + c.shape["sign"] * c.amplitude)
                if c.place == lamp.name and c.form == "one lamp's colour":
                    gain = gain * np.exp(c.amplitude * np.array(c.shape["color"]))
            direct, indirect = pixels(shot, lamp)
            E += gain * (direct + bounce * indirect)
        for c in light:
            if c.form in chain.SKY:
                E += c.amplitude * np.array(c.shape["color"]) * sum(pixels(shot, None))
            if c.form == "extra lamp":
                E += c.amplitude * np.array(c.shape["color"]) * sum(pixels(shot, Lamp(**c.shape["lamp"])))
        out.append(_sensed(setup, causes, shot, E))
    return chain.series(causes, shots, out)


def margin(setup: Setup, causes: Sequence[Cause]) -> int:
    """Pixels around the sensor that an image needs which ``causes`` move: what comes into the frame lies there, and is
    not what the frame's rim shows."""
    (w, h), half = setup.bench.size, setup.frame.half
    x, y = np.meshgrid(np.linspace(-w / 2, w / 2, w + 1) / half, np.linspace(-h / 2, h / 2, h + 1) / half)
    far = 0.0
    for channel in range(3):
        u, v = chain.flow(causes, x, y, channel)
        far = max(far, np.nanmax(np.abs(u)) * half - w / 2, np.nanmax(np.abs(v)) * half - h / 2)
    return min(max(setup.quality.margin, int(np.ceil(far)) + SPARE), h // 2)


def _by_eye(setup: Setup, causes: Sequence[Cause], shots: Sequence[Shot]) -> list[np.ndarray]:
    out: dict[int, np.ndarray] = {}
    for eye in {s.eye for s in shots}:
        own = [k for k, s in enumerate(shots) if s.eye == eye]
        there = [replace(c, eye=None) for c in causes if c.of(eye)]
        out |= dict(zip(own, means(setup, there, [shots[k] for k in own]), strict=True))
    return [out[k] for k in range(len(shots))]


def _sensed(setup: Setup, causes: Sequence[Cause], shot: Shot, E: np.ndarray) -> np.ndarray:
    s, frame = setup.bench.sensor, setup.frame
    e = chain.optics(causes, s.responsivity * shot.exposure * E, frame)
    e = chain.sensor(causes, e * setup.errors.field(shot), shot.exposure, frame)
    curve = [c for c in causes if c.form in chain.ALL["readout"] and c.form != "steps"]
    if curve:
        e = chain.readout(curve, e / s.full_well, frame) * s.full_well
    return e


class _Pixels:
    """Layers on the sensor's pixels, (direct, indirect), each made once."""

    def __init__(self, setup: Setup, bench: Bench, causes: Sequence[Cause]) -> None:
        self.setup, self.bench, self.causes = setup, bench, causes
        self.kept: dict[object, tuple[np.ndarray, np.ndarray | float]] = {}

    def __call__(self, shot: Shot, lamp: Lamp | None) -> tuple[np.ndarray, np.ndarray | float]:
        # a motion goes as far as the shutter is open
        moving = shot.exposure if any(c.form == "smear" for c in self.causes) else 1.0
        causes = [c.at(c.amplitude * moving) if c.form == "smear" else c for c in self.causes]
        moment = self.setup.errors.moment(shot)
        key = (shot.eye, shot.pose, lamp, moving, moment)
        if key not in self.kept:
            s = self.setup
            eye = self.bench.eyes[shot.eye]
            plain = None if lamp is None else replace(lamp, beam=(0.0, 0.0), axis=Lamp.axis)
            found = layer(self.bench, eye, shot.pose, plain, s.quality, s.seed, s.cache)
            where = guide(self.bench, eye, shot.pose, s.quality, s.cache)
            if lamp is not None and any(lamp.beam):
                found = _shaped(found, where, lamp)
            found = chain.layer(causes, found, where, self.bench, lamp)
            gain = s.errors.reflectance(self.bench, where)
            direct = found["direct"]
            for c in self.causes:
                if c.form == "translucent" and c.amplitude:
                    direct = _translucent(direct, where, self.bench, c, s.quality.fine)
            bounced = found["indirect"]
            if not any(c.form == "bounces" for c in self.causes):  # then once through the lens is enough
                direct, bounced = direct + bounced, None
            self.kept[key] = (
                through_lens(s, causes, gain * direct, shot.eye, moment),
                0.0 if bounced is None else through_lens(s, causes, gain * bounced, shot.eye, moment),
            )
        return self.kept[key]


def _shaped(found: dict[str, np.ndarray], where: dict[str, np.ndarray], lamp: Lamp) -> dict[str, np.ndarray]:
    """With the lamp's beam: exact for the light that met one surface; what met more has its mean factor."""
    d = where["position"] - np.array(lamp.position) / 1e3
    axis = np.array(lamp.axis) / np.linalg.norm(lamp.axis)
    factor = beam(lamp, (d @ axis) / np.maximum(np.linalg.norm(d, axis=-1), 1e-9))[..., None].astype(
        np.float32
    )
    direct = factor * found["direct"]
    mean = float(direct.sum() / max(float(found["direct"].sum()), 1e-12))
    return {"direct": direct, "indirect": mean * found["indirect"]}


def _translucent(
    direct: np.ndarray, where: dict[str, np.ndarray], bench: Bench, c: Cause, factor: int
) -> np.ndarray:
    """Light that enters a material comes out beside: a share a, red farther than blue, within the material."""
    names = [p.name for p in bench.parts if p.matter == c.place]
    inside = np.isin(where["part"], [k for k, p in enumerate(bench.parts) if p.name in names])
    mask = inside.astype(np.float32)
    out = direct.copy()
    for k, reach in enumerate((1.5, 1.0, 0.7)):
        sigma = reach * c.shape["reach"] * factor
        weight = cv2.GaussianBlur(mask, (0, 0), sigma)
        spread = cv2.GaussianBlur(direct[..., k] * mask, (0, 0), sigma) / np.maximum(weight, 1e-6)
        out[..., k] = np.where(
            inside, (1 - c.amplitude) * direct[..., k] + c.amplitude * spread, direct[..., k]
        )
    return out


def through_lens(
    setup: Setup, causes: Sequence[Cause], image: np.ndarray, eye: int, moment: int = 0
) -> np.ndarray:
    """A fine image on the pixels of the sensor: where the lens and the mounting put it, blurred, averaged."""
    q, frame = setup.quality, setup.frame
    h, w = image.shape[:2]
    column, row = np.meshgrid(np.arange(w, dtype=float), np.arange(h, dtype=float))
    cx, cy = (w - 1) / 2, (h - 1) / 2
    x, y = ((column - cx) / q.fine / frame.half, (row - cy) / q.fine / frame.half)
    channels = [0, 1, 2] if any(c.form in chain.COLORED for c in causes) else [None]
    still = not setup.errors.moves(eye, moment) and not chain.acting(causes, "flow")
    moved = image
    if not still:
        parts = []
        for channel in channels:
            u, v = chain.flow(causes, x, y, 1 if channel is None else channel)
            px, py = u * frame.half, v * frame.half
            qx, qy = setup.errors.moved(eye, moment, px, py)
            plane = image if channel is None else np.ascontiguousarray(image[..., channel])
            parts.append(
                cv2.remap(
                    plane, (qx * q.fine + cx).astype(np.float32), (qy * q.fine + cy).astype(np.float32),
                    cv2.INTER_LANCZOS4 if q.fine > 1 else cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE,
                )
            )  # fmt: skip
        moved = parts[0] if channels == [None] else np.stack(parts, axis=-1)
    moved = chain.fine(causes, moved, q.fine)
    if setup.filter == "Gaussian":  # 0.45 px, as many engines have it, in place of the box
        moved = cv2.GaussianBlur(moved, (0, 0), 0.45 * q.fine)
        start = q.fine // 2
        pixels = moved[start :: q.fine, start :: q.fine]
    else:
        pixels = moved.reshape(h // q.fine, q.fine, w // q.fine, q.fine, 3).mean(axis=(1, 3))
    m = q.margin
    return np.asarray(pixels[m : pixels.shape[0] - m, m : pixels.shape[1] - m], float)


def capture(
    setup: Setup,
    causes: Sequence[Cause],
    shot: Shot,
    mean: np.ndarray,
    rng: np.random.Generator,
    repeat: int = 0,
) -> np.ndarray:
    """(h, w, 3) uint16 DN of one frame around ``mean`` e-; ``repeat``: which of a shot's."""
    s, frame = setup.bench.sensor, setup.frame
    noise = {c.form: c for c in causes if c.form in chain.NOISE}
    pixels = setup.errors.pixel_gain(shot, repeat)
    _h, w = pixels.shape[:2]
    if (c := noise.get("uneven pixels")) is not None:
        own = np.random.default_rng([c.shape["seed"], shot.eye])
        pixels = pixels + c.amplitude * own.standard_normal(pixels.shape)
    e = mean * pixels
    if (c := noise.get("uneven columns")) is not None:
        own = np.random.default_rng([c.shape["seed"], shot.eye])
        e = e + c.amplitude * s.full_well * own.standard_normal((1, w, 1))
    read = s.read_noise + (noise["read noise"].amplitude if "read noise" in noise else 0.0)
    gain = 1 + (noise["gain error"].amplitude if "gain error" in noise else 0.0)
    # the same mean from fewer electrons, each worth more
    electrons = rng.poisson(np.maximum(e / gain, 0)) * gain + read * rng.standard_normal(e.shape)
    electrons += np.minimum(e, 0)  # an offset may take more than light gives
    dn = s.K * np.minimum(electrons, s.full_well)
    steps = [c for c in causes if c.form == "steps"]
    if steps:
        top = 2**s.bits - 1 - s.black
        dn = chain.readout(steps, dn / top, frame) * top
    return np.clip(np.rint(s.black + setup.errors.offset(shot, repeat) + dn), 0, 2**s.bits - 1).astype(
        np.uint16
    )
