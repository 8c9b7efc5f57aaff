"""The scene with the effects written in, in the terms of the file contract, ready to render.

What an effect does to a scene or to a camera its own file says (``interchange.effects``); what that changed is written
into a copy of the scene file, and all else stays as it was: calibration's errors within the tolerances are not
written, since they are no findings.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from analysis.gap.terms.chain import DARK
from analysis.gap.terms.mounts import CREEPING
from analysis.gap.terms.saturation import KNEES, lost_above
from analysis.gap.terms.uneven_blur import CORNER, FOURTH
from interchange.camera import Camera
from interchange.captures import Captures
from interchange.effects import MODELS, Effect
from interchange.effects.anisotropy import Anisotropy
from interchange.effects.defocus import Defocus
from interchange.effects.field_blur import FieldBlur
from interchange.effects.response_curve import ResponseCurve
from interchange.effects.texture import painted
from interchange.formats.document import Document
from interchange.formats.usd_changes import Frame, author_changes
from interchange.parameter import parameters
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.sensor import Response

STRAIGHT = 0.2  # sine of twice what a grain may run beside the tangent, which a scene has it along or across
ALIKE = 0.1  # of a blur's variance: a lens whose corner has no more of it than that has the same everywhere
ENTRIES = 1001  # of a response that fills up: one at every knee
STAND = " at ("  # a camera where it stands is called "/World/Camera at (x, y, z) mm"


@dataclass(frozen=True)
class Change:
    """An effect on ``target`` (a prim path, or "" for all): its parameters, and what they are without it, or None where
    the values stand for whatever the cameras have. ``t_exp`` s: the exposure that values which grow with it are told
    at; 0 where none does. ``patterns`` {body: (h, w)}: of a texture without a formula (interchange.effects.texture)."""

    effect: str
    target: str
    values: dict[str, float]
    without: dict[str, float] | None
    t_exp: float = 0.0
    patterns: Mapping[str, np.ndarray] = field(default_factory=dict)


def write_corrected(
    document: Document,
    captures: Captures,
    changes: Sequence[Change],
    path: Path,
    known: Callable[[Scene], Scene] = lambda scene: scene,
) -> dict[str, str]:
    """Write the scene to ``path``; returns the effects that it cannot carry, each with the reason. ``known``: what was
    known of it before, on which the changes are."""
    times = sorted({*document.times, *(c.time for c in captures.captures)})
    left: dict[str, str] = {}
    frames = []
    for time in times:
        old = document.scene(time)
        new = known(old)
        for change in changes:
            try:
                new, same = changed(new, old, change), new
            except BrightfieldError as error:
                left[change.effect] = str(error)
                continue
            if new is same and not _stands_elsewhere(change, old):
                left.setdefault(change.effect, "No number of a scene file says it.")
        frames.append(Frame(time, old, new))
    stage = document.stage
    for problem in author_changes(stage, frames, path.with_suffix("")):
        for change in changes:
            if change.target in problem.where.prim:
                left.setdefault(change.effect, problem.message)
    document.save(path)
    if not stage.GetRootLayer().anonymous:
        stage.Reload()  # the file that was read stays what it is, in memory too
    return left


def changed(scene: Scene, own: Scene, change: Change) -> Scene:
    """``scene`` with one more effect; the same object where a scene cannot say it. ``own``: what the file gives.

    Raises BrightfieldError where the scene cannot have the effect.
    """
    model = MODELS.get(change.effect)
    if model is None:
        return scene
    if change.patterns:
        return painted(scene, change.target, change.patterns)
    if not model.is_of_the_chain():
        if change.target.endswith(CREEPING):
            raise BrightfieldError(
                "A scene file says where a camera stands, and not that it stands elsewhere for each capture."
            )
        target, _, _ = change.target.partition(STAND)
        if _stands_elsewhere(change, own):
            return scene
        channels = {"R": change.values["Y"], "G": change.values["Y"], "B": change.values["Y"]} if (
            "Y" in change.values
        ) else change.values  # fmt: skip
        effect = model(**model.within(channels))
        if isinstance(effect, Anisotropy):
            if abs(np.sin(2 * effect.grain)) > STRAIGHT:
                raise BrightfieldError("No number of a scene file says which way a grain runs.")
            effect = replace(effect, cross=0.0, diagonal=0.0)
        return effect.on_scene(scene, target)
    name = change.target.partition(", ")[
        0
    ]  # of one, whose effect may be of a kind: "/World/Camera, vibration"
    of_one = name in {camera.name for camera in scene.cameras}
    cameras = tuple(
        _with_effect(c, model, change) if c.name == name or not of_one else c for c in scene.cameras
    )
    if all(a is b for a, b in zip(cameras, scene.cameras, strict=True)):
        return scene
    return replace(scene, cameras=cameras)


def _with_effect(camera: Camera, model: type[Effect], change: Change) -> Camera:
    if change.effect == "saturation":
        return _filling_up(camera, change)
    own = model.of(camera)
    start = change.without
    given = {}
    for n, x in change.values.items():
        speed = model.per_second.get(n) if change.t_exp else None
        if speed is not None and start is not None:
            given[speed] = getattr(own, speed) + (x - start[n]) / change.t_exp
        elif n in parameters(model):
            given[n] = x if start is None else getattr(own, n) + x - start[n]
    if not given and DARK not in change.values:
        return camera
    effect = replace(own, **model.within(given))  # type: ignore[type-var]
    if isinstance(effect, Defocus) and start is not None and CORNER in change.values:
        grown, steeply = (change.values.get(n, 0.0) - start.get(n, 0.0) for n in (CORNER, FOURTH))
        if abs(grown + steeply) > ALIKE * effect.blur**2:
            return _curved(effect.on(camera), grown, steeply)
    if start is not None and DARK in change.values:
        s = camera.sensor
        more = change.values[DARK] - start[DARK]
        camera = replace(camera, sensor=replace(s, dark_current=max(s.dark_current + more, 0.0)))
    if change.effect == "exposure":
        factor = float(getattr(effect, "scale"))  # noqa: B009
        camera = effect.on(camera)
        s = camera.sensor
        if s.responsivity > 0:
            return replace(camera, sensor=replace(s, responsivity=factor * s.responsivity))
        r, g, b = (factor * x for x in s.spectral_response)
        return replace(camera, sensor=replace(s, spectral_response=(r, g, b)))
    return effect.on(camera) if effect.carried_by or type(effect).on is not Effect.on else camera


def _curved(camera: Camera, more: float, steeply: float) -> Camera:
    """With its blur, and ``more`` px² of variance in the corner, and those that grow ``steeply``, by the fourth power,
    as discs that grow with the field: least squares of their rms over a round image. A scene file says no blur that
    leans or that no thin lens gives to depths."""
    if any(camera.lens.field_blur):
        raise BrightfieldError("The lens has a blur over the field already, of which this would be a part.")
    square = (np.arange(ENTRIES) + 0.5) / ENTRIES  # of how far out, each as much of the image
    rms = np.sqrt(np.maximum(camera.lens.blur**2 + more * square + steeply * square**2, 0))
    grown, axis = 4 * np.polyfit(square, rms, 1)
    over_field = FieldBlur(float(axis), float(grown), float(grown))
    return over_field.on(replace(camera, lens=replace(camera.lens, blur=0.0)))


def _filling_up(camera: Camera, change: Change) -> Camera:
    """With a response that bends at the knees (analysis.gap.terms.saturation), or ends where the well is full: a
    camera's full well says its gain, too."""
    s = camera.sensor
    own = ResponseCurve(response=s.response, lut=s.response_lut)
    y = own.curve(np.linspace(0, 1, ENTRIES))
    start = change.without or {}
    above = {k: change.values.get(lost_above(k), 0.0) - start.get(lost_above(k), 0.0) for k in KNEES}
    y = y - np.sum([lost * np.maximum(y - k, 0) for k, lost in above.items()], axis=0)
    if "full_well" in change.values:
        y = np.minimum(y, s.K * change.values["full_well"] / (2**s.bit_depth - 1 - s.black_level))
    if (np.diff(y) < 0).any():
        raise BrightfieldError("A response that falls again is none of a sensor's.")
    return replace(camera, sensor=replace(s, response=Response.LUT, response_lut=tuple(map(float, y))))


def _stands_elsewhere(change: Change, scene: Scene) -> bool:
    """Whether the change is about another place of its camera than the one it has in ``scene``."""
    name, _, place = change.target.partition(STAND)
    if not place:
        return False
    camera = next((c for c in scene.cameras if c.name == name), None)
    if camera is None:
        return True
    there = np.array([float(x) for x in place.removesuffix(") mm").split(",")])
    return bool(np.abs(1e3 * camera.world_from_camera[:3, 3] - there).max() > 0.1)
