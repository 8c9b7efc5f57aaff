"""Captures put together: repeats are one condition, and some conditions are kept for the verdict alone."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from analysis.gap.light.radiance import Rendered
from analysis.gap.light.views import seen
from analysis.gap.parallel import own_property
from analysis.gap.sensor import cut
from analysis.gap.sensor.expected import SATURATED, Expected, Noise, expected, noise_variance, rounding
from analysis.gap.sensor.fine_optics import told_apart
from interchange.camera import Camera
from interchange.captures import Capture, Captures
from interchange.effects import Effect
from interchange.formats.document import Document
from interchange.lamps.exposed import exposed
from interchange.problems import BrightfieldError, FileError, Problem
from interchange.scene import Scene

AROUND = np.ones((7, 7), np.uint8)  # px
BLOCKS = (24, 24)  # px, three of a JPEG's along a side: how large its errors are is told over so many
SEEN = 1e-3  # of them, that must be compared
CUT = 3.0  # standard deviations of noise that lie above DN 0
HELD_OUT_SHARE = 4  # one condition in so many is held out


@dataclass(frozen=True, eq=False)
class Condition:
    """Repeats of one thing: ``mean`` (H, W, C) DN over them, ``spread`` their variance (None without repeats)."""

    captures: tuple[Capture, ...]
    scene: Scene
    camera: Camera  # with the captures' exposure and gain
    mean: np.ndarray
    spread: np.ndarray | None
    mask: np.ndarray  # (H, W) bool
    held_out: bool = False
    rendered: Rendered | None = None
    step: float = 1.0  # DN from one code that occurs to the next
    uneven: dict[int, float] = field(
        default_factory=dict
    )  # DN rms of lines that were evened, by axis (lines.py)
    noise: Noise | None = None  # where it is not the data sheet's
    allowed: np.ndarray | None = None  # (H, W) bool: what is ``compared``, where another rendering told it
    packed: np.ndarray | None = None  # (H, W, C) DN by which compressing is off (compressed.py)
    when: float = 0.0  # 0 for the first of its camera, 1 for the last, in the order of the captures

    @property
    def name(self) -> str:
        return self.captures[0].image

    @property
    def images(self) -> tuple[str, ...]:
        return tuple(c.image for c in self.captures)

    @property
    def shown(self) -> Rendered:
        if self.rendered is None:
            raise BrightfieldError("A condition must be rendered before it is compared.")
        return self.rendered

    @own_property
    def moved(self) -> "Condition":
        """The same from where its camera was found to stand, if it was rendered from there."""
        if self.shown.moved is None:
            return self
        return replace(self, rendered=self.shown.moved, allowed=self.compared)

    @property
    def lamps(self) -> tuple[str, ...]:
        """Names of the lamps that are on."""
        return tuple(light.name for light in self.scene.lights if light.is_on)

    def simulated(self, effects: Sequence[Effect] = ()) -> Expected:
        """Expected DN, with the channels that the captures have."""
        shown, camera = self.shown, self.camera
        if shown.fine:
            optics, camera, effects = told_apart(camera, effects, self.mean.shape[2])
            if optics.is_there:
                shown = seen(shown, optics.flow(self.camera, None), blur=optics.blur).here
        e = expected(shown.radiance(self.scene), camera, effects, self.noise)
        if self.mean.shape[2] == e.dn.shape[2]:
            return replace(e, fixed=e.fixed + self._compression(e.temporal, e.fixed))

        def fitting(plane: np.ndarray) -> np.ndarray:
            one = self.mean.shape[2] == 1
            return plane.mean(axis=2, keepdims=True) if one else np.repeat(plane, 3, axis=2)

        temporal, fixed = fitting(e.temporal), fitting(e.fixed)
        fixed = fixed + self._compression(temporal, fixed)
        return Expected(fitting(e.dn), temporal, fixed, e.black, e.top)

    def variance_at(self, dn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Temporal and lasting variance, DN², of pixels whose mean is ``dn`` (H, W, C), by the data sheet; what
        compressing adds lasts."""
        temporal, fixed = noise_variance(dn, self.camera)
        return temporal, fixed + self._compression(temporal, fixed)

    def _compression(self, temporal: np.ndarray, fixed: np.ndarray) -> np.ndarray | np.float32:
        """DN² that what compressing leaves, over some blocks of it, is more than noise, or less: it takes noise off,
        and rounds coefficients of what has edges. Of a code's rounding at least."""
        if self.packed is None:
            return np.float32(0)
        seen = self.mask.astype(np.float32)[..., None]  # what is masked is so for what it is off by
        off, share = (cv2.blur(x, BLOCKS).reshape(x.shape) for x in (np.square(self.packed) * seen, seen))
        off = np.divide(off, share, out=np.zeros_like(off), where=share > SEEN)
        return (np.maximum(off, rounding(self.camera.sensor)) - temporal / len(self.captures) - fixed).astype(
            np.float32
        )

    @own_property
    def compared(self) -> np.ndarray:
        """(H, W) bool: pixels that the scene file's own simulation lets compare."""
        return self.usable(self.simulated()) if self.allowed is None else self.allowed

    @own_property
    def above_zero(self) -> np.ndarray:
        """(H, W) bool: so far above DN 0, captured and simulated, that no noise is cut off there. Of dark captures hot
        pixels alone are captured so."""
        simulated = self.simulated()
        dn = np.minimum(self.mean, simulated.dn)
        return np.asarray((dn > CUT * np.sqrt(simulated.temporal)).all(axis=2))

    def usable(self, simulation: Expected) -> np.ndarray:
        """(H, W) bool: inside the mask, more than three pixels from what is saturated here or there, and not cut off at
        DN 0."""
        limit = SATURATED * simulation.top
        hot = (simulation.dn.max(axis=2) >= limit) | (self.mean.max(axis=2) >= limit)
        wide = cv2.dilate(hot.astype(np.uint8), AROUND) > 0
        return np.asarray(self.mask & ~wide & ~self.cut_off)

    @own_property
    def cut_off(self) -> np.ndarray:
        """(H, W) bool: captured at DN 0 by a camera whose black level lies above all noise there, so that no lack of
        light makes it: the black level lies lower, by that much at least, and how much nobody can tell there. Of whole
        neighbourhoods, so that no noise is chosen by its sign."""
        if cut.is_cut(self.camera.sensor):
            return np.zeros(self.mask.shape, bool)
        zero = (self.mean.min(axis=2) <= 0).astype(np.uint8)
        return np.asarray(cv2.morphologyEx(zero, cv2.MORPH_OPEN, AROUND) > 0)


def conditions(captures: Captures, document: Document) -> list[Condition]:
    """The captures by condition, each with the scene and the camera it shows, those to be held out marked.

    Raises FileError with every capture that does not fit the scene.
    """
    found = [
        _condition(tuple(members), scene, camera) for members, scene, camera in _grouped(captures, document)
    ]
    return _split(_in_order(found), captures.holdout)


def _in_order(found: Sequence[Condition]) -> list[Condition]:
    of = {name: [c for c in found if c.camera.name == name] for name in {c.camera.name for c in found}}
    return [
        replace(c, when=own.index(c) / max(len(own) - 1, 1)) for c in found for own in [of[c.camera.name]]
    ]


def must_fit(captures: Captures, document: Document) -> None:
    """Raises FileError with every capture that does not fit the scene."""
    _grouped(captures, document)


def _grouped(captures: Captures, document: Document) -> list[tuple[list[Capture], Scene, Camera]]:
    problems: list[Problem] = []
    groups: dict[tuple[object, ...], list[Capture]] = {}
    stands: dict[tuple[object, ...], tuple[Scene, Camera]] = {}
    scenes: dict[float, Scene] = {}
    for capture in captures.captures:
        scene = scenes.setdefault(capture.time, document.scene(capture.time))
        try:
            camera = scene.camera(capture.camera)
        except BrightfieldError as error:
            problems.append(Problem(str(error), replace(capture.where, prim=f"{capture.where.prim}.camera")))
            continue
        (w, h), shape = camera.sensor.resolution, capture.pixels.shape
        if shape[:2] != (h, w):
            message = f"A capture must have its camera's {w} x {h} px; {capture.image} has {shape[1]} x {shape[0]} px."
            problems.append(Problem(message, replace(capture.where, prim=f"{capture.where.prim}.image")))
            continue
        if capture.bits and capture.pixels.max() > 2**camera.sensor.bits_out - 1:
            message = (
                f"DN must not exceed the camera's highest, {2**camera.sensor.bits_out - 1}; {capture.image} has "
                f"{capture.pixels.max():g}: it is stretched, or sensor:bitDepth is wrong."
            )
            problems.append(Problem(message, replace(capture.where, prim=f"{capture.where.prim}.image")))
            continue
        gain = camera.sensor.gain_dB if capture.gain_dB is None else capture.gain_dB
        camera = replace(camera, t_exp=capture.exposure, sensor=replace(camera.sensor, gain_dB=gain))
        scene = _steady(scene, camera)
        lights = tuple((x.name, x.intensity, x.world_from_light.tobytes()) for x in scene.lights)
        bodies = tuple((id(b.mesh), b.world_from_body.tobytes(), b.material.name) for b in scene.bodies)
        key = (
            camera.name,
            camera.world_from_camera.tobytes(),
            capture.exposure,
            gain,
            lights,
            bodies,
            shape[2],
        )
        groups.setdefault(key, []).append(capture)
        stands.setdefault(key, (scene, camera))
    if problems:
        raise FileError(problems)
    return [(members, *stands[key]) for key, members in groups.items()]


def _steady(scene: Scene, camera: Camera) -> Scene:
    """The scene with lamps that flash as bright as the capture has them."""
    lit, rows = exposed(scene, camera)
    if rows:
        raise BrightfieldError(
            f"A diagnosis takes a lamp as alike in all rows of a capture; the rolling shutter of {camera.name} "
            f"({camera.sensor.line_time:g} s a line) shows flashes of {next(iter(rows))} as bands."
        )
    return lit


def _condition(members: tuple[Capture, ...], scene: Scene, camera: Camera) -> Condition:
    stack = np.stack([c.pixels for c in members])
    mask = np.all(
        [c.mask if c.mask is not None else np.ones(stack.shape[1:3], bool) for c in members], axis=0
    )
    spread = stack.var(axis=0, ddof=1) if len(members) > 1 else None
    return Condition(members, scene, camera, stack.mean(axis=0), spread, mask)


def _split(found: list[Condition], holdout: Sequence[str]) -> list[Condition]:
    """Whole conditions are held out: those named, else one in ``HELD_OUT_SHARE``, never the last of its camera."""
    if holdout:
        split = [replace(c, held_out=any(i in holdout for i in c.images)) for c in found]
        if all(c.held_out for c in split):
            raise BrightfieldError(
                "holdout must leave one condition to fit to; it names one of every condition."
            )
        return split
    if len(found) < 3:
        raise BrightfieldError(
            f"A diagnosis needs three different conditions or more (a lamp, a pose, an exposure), so that one can be "
            f"held out; got {len(found)}."
        )
    chosen: set[int] = set()
    order = [k for start in (HELD_OUT_SHARE - 1, 1, 2, 0) for k in range(start, len(found), HELD_OUT_SHARE)]
    for k in order:
        rest = [c for i, c in enumerate(found) if i != k and i not in chosen]
        same_camera = [c for c in rest if c.camera.name == found[k].camera.name]
        lamps = {name for c in rest for name in c.lamps}
        if same_camera and set(found[k].lamps) <= lamps and found[k].lamps:
            chosen.add(k)
        if len(chosen) >= max(1, round(len(found) / HELD_OUT_SHARE)):
            break
    if not chosen:
        chosen = {len(found) - 1}
    return [replace(c, held_out=i in chosen) for i, c in enumerate(found)]
