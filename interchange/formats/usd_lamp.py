"""What UsdLux has no words for, as custom attributes of a light: power, spectrum, strobe, a projector's lens and
image.

Other software sees a UsdLux light with its ``inputs:intensity``; README.md of ``interchange`` lists the attributes.
"""

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd

from interchange.colorimetry import luminous_efficacy, srgb_color
from interchange.distortion import LensModel, padded
from interchange.formats.usd_response import Curves, color_through
from interchange.formats.usd_values import Finder, asset
from interchange.illuminants import illuminant
from interchange.light import Light
from interchange.material import Texture
from interchange.parameter import ParameterError
from interchange.power import WHITE, with_power
from interchange.problems import BrightfieldError, FileError, did_you_mean
from interchange.projector import Projector
from interchange.scene import Scene
from interchange.spectrum import Spectrum, from_measurement
from interchange.strobe import Strobe

NAMES = Sdf.ValueTypeNames
SPACES = ("auto", "raw", "sRGB")
STROBE = {f.name: f"lamp:strobe:{f.name}" for f in fields(Strobe)}


def read_power(
    prim: Usd.Prim, time: Usd.TimeCode, find: Finder, light: Light, curves: Callable[[], Curves]
) -> Light:
    """The light with the power that ``lamp:power`` (W) or ``lamp:flux`` (lm) give it, in place of its intensity.

    Its colour is that of ``lamp:spectrum`` through the response of the scene's camera, ``curves()``, or without one in
    linear sRGB; else that of the light's intensity, whose mean over the channels a spectrum keeps.
    """
    watts, lumens = (find.value(prim, f"lamp:{name}", time) for name in ("power", "flux"))
    at = "lamp:power" if watts is not None else "lamp:flux" if lumens is not None else "lamp:spectrum"
    own = np.asarray(light.intensity)
    try:
        spectrum = read_spectrum(prim, time, find)
        if watts is None and lumens is None and spectrum is None:
            return light
        color = WHITE
        if spectrum is not None:
            color = _color(spectrum, curves())
        elif own.mean() > 0:
            r, g, b = own / own.mean()
            color = (float(r), float(g), float(b))
        if watts is None and lumens is None:
            r, g, b = own.mean() * np.asarray(color)
            return replace(light, intensity=(float(r), float(g), float(b)))
        return with_power(
            light,
            None if watts is None else float(watts),
            None if lumens is None else float(lumens),
            spectrum,
            color,
        )
    except BrightfieldError as error:
        find.error(str(error), prim, at)
        return light


def _color(spectrum: Spectrum, curves: Curves) -> tuple[float, float, float]:
    if curves:
        return color_through(spectrum, curves)
    return srgb_color(spectrum) if luminous_efficacy(spectrum) > 1e-3 else WHITE


def has_spectrum(prim: Usd.Prim) -> bool:
    return any(prim.GetAttribute(f"lamp:spectrum{end}").HasAuthoredValue() for end in ("", ":file"))


def read_spectrum(prim: Usd.Prim, time: Usd.TimeCode, find: Finder) -> Spectrum | None:
    """``lamp:spectrum``, a name that ``illuminant`` knows, or ``lamp:spectrum:file``, a table of it."""
    name = find.value(prim, "lamp:spectrum", time)
    written, file = asset(prim.GetAttribute("lamp:spectrum:file"), time)
    if written and not file:
        raise BrightfieldError(f'The spectrum "{written}" is not there.')
    if file:
        from interchange.formats import measurements

        return from_measurement(measurements.read(file), name or "")
    return illuminant(name) if name else None


def read_strobe(prim: Usd.Prim, time: Usd.TimeCode, find: Finder) -> Strobe:
    """The strobe that ``lamp:strobe:*`` describe; one that is not there where none is authored."""
    names = [n for n in prim.GetAuthoredPropertyNames() if n.startswith("lamp:strobe:")]
    for name in names:
        if name not in STROBE.values():
            find.error(f"{name} is not known.{did_you_mean(name, STROBE.values())}", prim, name)
    given = {field: find.value(prim, name, time) for field, name in STROBE.items()}
    given = {field: value for field, value in given.items() if value is not None}
    if given and "duration" not in given:
        find.error("A strobe needs lamp:strobe:duration, s; 0 is a lamp that is always on.", prim)
        return Strobe()
    try:
        return Strobe(**given)
    except ParameterError as error:
        wrong = next((n for f, n in STROBE.items() if f"Strobe.{f} " in str(error)), "")
        find.error(str(error), prim, wrong)
        return Strobe()


def author_strobe(prim: Any, strobe: Strobe) -> None:
    """The attributes that ``read_strobe`` reads, without those that are the default."""
    for field, name in STROBE.items():
        value = getattr(strobe, field)
        if field == "duration" or value != getattr(Strobe(), field):
            prim.GetPrim().CreateAttribute(name, strobe_type(field), custom=True).Set(value)


def strobe_type(field: str) -> Any:
    return NAMES.Bool if field == "triggered" else NAMES.Double


def by_stage_time(light: Light, seconds: float) -> Light:
    """The lamp, its flashes counted from the stage's first time code on."""
    strobe = light.strobe
    if strobe.triggered or not seconds:
        return light
    return replace(light, strobe=replace(strobe, start=strobe.start - seconds))


def frame_rate(scenes: Sequence[Scene]) -> float:
    """Time codes a second. Raises BrightfieldError where lamps flash by a time that no one rate gives."""
    steps = np.diff([s.seconds for s in scenes])
    if steps[0] > 0 and np.allclose(steps, steps[0], rtol=1e-9, atol=0):
        return float(1 / steps[0])
    if flashing := [x.name for x in scenes[0].lights if x.strobe.is_there and not x.strobe.triggered]:
        raise BrightfieldError(
            f"Frames with a lamp that flashes must follow each other at equal steps of Scene.seconds to be written as "
            f"USD; {flashing[0]} flashes."
        )
    return 1.0


def read_projector(
    prim: Usd.Prim,
    time: Usd.TimeCode,
    find: Finder,
    texture: Callable[..., Texture],
    keep: Callable[..., Projector],
) -> Projector | None:
    """The projector that ``projector:*`` describe; None where there is no image."""
    name = "projector:image"
    written, file = asset(prim.GetAttribute(name), time)
    if not written:
        return None
    if not file:
        find.error(f'The projected image "{written}" is not there.', prim, name)
        return None
    if find.value(prim, "inputs:shaping:ies:file", time):
        find.error("A lamp must have a projected image or a profile, not both.", prim, name)
        return None
    space = str(find.value(prim, "projector:colorSpace", time) or "auto")
    model = str(find.value(prim, "projector:model", time) or LensModel.OPENCV.value)
    for word, known, attribute in (
        (space, SPACES, "colorSpace"),
        (model, tuple(m.value for m in LensModel), "model"),
    ):
        if word not in known:
            message = (
                f'{attribute} must be one of {", ".join(known)}; got "{word}".{did_you_mean(word, known)}'
            )
            find.error(message, prim, f"projector:{attribute}")
            return None
    try:
        image = texture(file, space)
        distortion = padded(find.value(prim, "projector:distortion", time) or (), LensModel(model))
    except (FileError, ValueError) as error:
        find.error(str(error), prim, name if isinstance(error, FileError) else "projector:distortion")
        return None
    height, width = image.pixels.shape[:2]
    focal = find.value(prim, "projector:focalLength", time)
    if focal is None or not (min(focal) > 0 and np.isfinite(focal).all()):
        got = "nothing" if focal is None else tuple(focal)
        find.error(
            f"A projector's focal lengths, px, must be above 0; got {got}.", prim, "projector:focalLength"
        )
        return None
    centre = find.value(prim, "projector:principalPoint", time) or ((width - 1) / 2, (height - 1) / 2)
    K = (float(focal[0]), 0.0, float(centre[0]), 0.0, float(focal[1]), float(centre[1]), 0.0, 0.0, 1.0)
    return keep(image, K, distortion, LensModel(model))


def author_projector(prim: Any, projector: Projector, name: str) -> None:
    """The attributes that ``read_projector`` reads. Raises BrightfieldError where the image is in no file."""
    if not projector.image.file:
        raise BrightfieldError(f"A projector's image must be in a file to be written as USD. ({name})")
    usd = prim.GetPrim()

    def put(attribute: str, kind: Any, value: Any) -> None:
        usd.CreateAttribute(f"projector:{attribute}", kind, custom=True).Set(value)

    prim.CreateTreatAsPointAttr(True)
    K = projector.K
    put("image", NAMES.Asset, projector.image.file)
    put("focalLength", NAMES.Double2, Gf.Vec2d(float(K[0, 0]), float(K[1, 1])))
    put("principalPoint", NAMES.Double2, Gf.Vec2d(float(K[0, 2]), float(K[1, 2])))
    if any(projector.distortion):
        put("distortion", NAMES.DoubleArray, list(projector.distortion))
    if projector.model is not LensModel.OPENCV:
        put("model", NAMES.Token, projector.model.value)
