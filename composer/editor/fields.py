"""What the panels show of a thing: one record a number, made from the parameters that its class declares.

Adding a parameter to a BRDF, a lens, a sensor or an effect adds its slider; nothing here names it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np

from composer.editor.numbers import number
from interchange.camera import Camera, Lens, Projection
from interchange.distortion import LensModel
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.parameter import Kind, Parameter, parameters, settings
from interchange.sensor import Demosaic, Mosaic, Response, Sensor
from interchange.strobe import Strobe

SHOWN = {"m": ("mm", 1e3), "s": ("ms", 1e3), "rad": ("°", 180 / np.pi)}  # the unit that people use
PITCH = ("µm", 1e6)


class Widget(StrEnum):
    NUMBER = "number"
    INTEGER = "integer"
    COLOR = "color"
    VECTOR = "vector"
    CHOICE = "choice"
    SWITCH = "switch"
    TEXT = "text"


@dataclass(frozen=True)
class Field:
    """``name`` and ``value`` as ``SetParameter`` takes them; shown is ``value * scale`` in ``unit``.

    ``lobe`` is the entry of a per-lobe parameter that this is, or -1.
    """

    group: str
    name: str
    label: str
    value: Any
    widget: Widget = Widget.NUMBER
    symbol: str = ""
    unit: str = ""
    scale: float = 1.0
    low: float = -np.inf
    high: float = np.inf
    meaning: str = ""
    source: str = ""
    choices: tuple[str, ...] = ()
    lobe: int = -1

    @property
    def tooltip(self) -> str:
        """Symbol, meaning, bounds and source, a line each."""
        unit = f" {self.unit}" if self.unit else ""
        lines = [f"{self.symbol}  ·  {self.meaning}" if self.symbol else self.meaning]
        if np.isfinite([self.low, self.high]).all():
            lines.append(f"{self.low * self.scale:g} … {self.high * self.scale:g}{unit}")
        return "\n".join([*filter(None, lines), *filter(None, [self.source])])

    @property
    def logarithmic(self) -> bool:
        """Whether its range spans magnitudes."""
        return self.low >= 0 and self.high > 50


def of_material(material: Material) -> list[Field]:
    """The BRDF's parameters, then emission and opacity."""
    found = list(_of_brdf(material.brdf, "", type(material.brdf).__name__, set(material.maps)))
    beside = "Beside the BRDF"
    glow = "radiance that the surface itself sends out"
    found.append(
        Field(
            beside,
            "emission",
            "Emission",
            material.emission,
            Widget.COLOR,
            "L_e",
            "W/(m² sr)",
            1,
            0,
            1e6,
            glow,
        )
    )
    share = "share of rays that meet the surface"
    found.append(Field(beside, "opacity", "Opacity", material.opacity, Widget.NUMBER, "", "", 1, 0, 1, share))
    return found


def _of_brdf(brdf: Any, prefix: str, group: str, textured: set[str]) -> Iterator[Field]:
    parts = getattr(brdf, "parts", None)
    if parts is not None:
        for k, weight in enumerate(brdf.weight):
            yield Field(group, f"{prefix}weight{k}", f"weight {k + 1}", weight, Widget.COLOR, f"w_{k + 1}")
        for k, part in enumerate(parts):
            yield from _of_brdf(part, f"{prefix}part{k}.", f"{k + 1}: {type(part).__name__}", textured)
        return
    own = {n: p for n, p in parameters(brdf).items() if n not in textured}
    for name, about in own.items():
        if not about.per_lobe:
            yield _field(group, prefix + name, about, getattr(brdf, name), brdf.source)
    for k in range(brdf.lobes):
        for name, about in own.items():
            if about.per_lobe:
                value = getattr(brdf, name)
                yield _field(f"{group} · lobe {k + 1}", prefix + name, about, value, brdf.source, k)
    for name, rule in settings(brdf).items():
        meaning = f"{rule.meaning} (decided with the model)"
        yield Field(
            group, prefix + name, name, getattr(brdf, name), Widget.TEXT, rule.symbol, "", 1, meaning=meaning
        )


def _field(
    group: str, name: str, about: Parameter, value: Any, source: str, lobe: int = -1, label: str = ""
) -> Field:
    widget = {Kind.FLOAT: Widget.NUMBER, Kind.COLOR: Widget.COLOR, Kind.VECTOR: Widget.VECTOR}[about.kind]
    unit, scale = SHOWN.get(about.unit, (about.unit, 1.0))
    label = label or name.rsplit(".", 1)[-1].replace("_", " ")
    unit = "" if unit == "1" else unit
    return Field(
        group, name, label, value, widget, about.symbol, unit, scale, about.low, about.high, about.meaning,
        source, (), lobe,
    )  # fmt: skip


def of_light(light: Light) -> list[Field]:
    """What a lamp has, by its kind."""
    peak = max(light.intensity)
    quantity = {
        LightKind.DISTANT: ("E", "W/m²", "irradiance on a plane that faces the light"),
        LightKind.DOME: ("L", "W/(m² sr)", "radiance"),
    }.get(light.kind, ("I", "W/sr", "radiant intensity, brightest channel"))
    symbol, unit, meaning = quantity
    color = tuple(float(x / peak) for x in light.intensity) if peak > 0 else (1.0, 1.0, 1.0)
    lux = "UsdLux; interchange/light.py"
    found = [
        Field(
            "Emission", "intensity", "intensity", peak, Widget.NUMBER, symbol, unit, 1, 0, 1e9, meaning, lux
        ),
        Field("Emission", "color", "colour", color, Widget.COLOR, "", "", 1, 0, 1, "channels, relative", lux),
    ]
    sizes = {
        LightKind.SPHERE: ("radius",), LightKind.DISK: ("radius",), LightKind.RECT: ("width", "height"),
        LightKind.CYLINDER: ("radius", "length"),
    }.get(light.kind, ())  # fmt: skip
    for name in sizes:
        found.append(
            Field(
                "Shape", name, name, getattr(light, name), Widget.NUMBER, "", "mm", 1e3, 0, 1e3,
                f"{name} of the emitting surface; 0 is a point" if name == "radius" else name, lux,
            )
        )  # fmt: skip
    degrees = SHOWN["rad"]
    if light.kind is LightKind.DISTANT:
        meaning = "full angle that the source fills; the sun's is 0.53°"
        found.append(
            Field("Shape", "angle", "angle", light.angle, Widget.NUMBER, "", *degrees, 0, np.pi, meaning)
        )
    elif light.kind is not LightKind.DOME:
        found += [
            Field(
                "Beam", "cone_angle", "half angle", light.cone_angle, Widget.NUMBER, "", *degrees, 0, np.pi,
                "from the axis to the edge of the beam; 180° is no cone", lux,
            ),
            Field(
                "Beam", "cone_softness", "softness", light.cone_softness, Widget.NUMBER, "", "", 1, 0, 1,
                "share of the cone over which it fades", lux,
            ),
            Field("Beam", "focus", "focus", light.focus, Widget.NUMBER, "", "", 1, 0, 1e3, "cos^focus fall-off", lux),
        ]  # fmt: skip
    for name, about in parameters(Strobe).items():
        value = getattr(light.strobe, name)
        found.append(_field("Strobe", f"strobe.{name}", about, value, "interchange/strobe.py"))
    found += [
        Field(
            "Strobe",
            "strobe.triggered",
            "triggered",
            light.strobe.triggered,
            Widget.SWITCH,
            meaning="the clock begins with each exposure, not with the scene",
        ),
        Field("Seen", "casts_shadows", "casts shadows", light.casts_shadows, Widget.SWITCH),
        Field(
            "Seen", "visible", "seen by cameras", light.visible, Widget.SWITCH, meaning="as a backlight is"
        ),
    ]
    return found


def of_camera(camera: Camera) -> list[Field]:
    """Exposure, lens, sensor, then every effect of the catalogue that has numbers of its own."""
    from interchange.effects import MODELS

    sensor = camera.sensor
    gain = parameters(Sensor)["gain_dB"]
    found = [
        Field(
            "Exposure", "t_exp", "exposure time", camera.t_exp, Widget.NUMBER, "t_exp", *SHOWN["s"], 1e-7, 1e3,
            "the shutter is open that long",
        ),
        _field("Exposure", "sensor.gain_dB", gain, sensor.gain_dB, "EMVA 1288", label="gain"),
    ]  # fmt: skip
    shown = {f.name for f in found}
    found.append(_words("Lens", "lens.projection", camera.lens.projection, Projection))
    found.append(_words("Lens", "lens.model", camera.lens.model, LensModel))
    for part, kind, group in (("lens", Lens, "Lens"), ("sensor", Sensor, "Sensor")):
        if part == "sensor":
            found += [
                Field(
                    group, "sensor.resolution", "resolution", sensor.resolution, Widget.VECTOR, "", "px", 1, 1,
                    16384, "width, height",
                ),
                Field(
                    group, "sensor.pixel_pitch", "pixel pitch", sensor.pixel_pitch, Widget.VECTOR, "", *PITCH,
                    1e-7, 1e-2, "x, y; the image's size follows",
                ),
                Field(
                    group, "sensor.bit_depth", "bit depth", sensor.bit_depth, Widget.INTEGER, "", "bit", 1, 1, 16,
                ),
                _words(group, "sensor.mosaic", sensor.mosaic, Mosaic),
                _words(group, "sensor.demosaic", sensor.demosaic, Demosaic),
                _words(group, "sensor.response", sensor.response, Response),
            ]  # fmt: skip
        for name, about in parameters(kind).items():
            full = f"{part}.{name}"
            carried = part == "sensor" and any(full in e.carried_by.values() for e in _optional(MODELS))
            if full not in shown and not carried:
                found.append(_field(group, full, about, number(camera, full), ""))
                shown.add(full)
    distortion = camera.lens.distortion
    names = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "τx", "τy"]
    if camera.lens.model is LensModel.FISHEYE:
        names = ["k1", "k2", "k3", "k4"]
    for k, symbol in enumerate(names[: len(distortion)]):
        found.append(
            Field(
                "Distortion", f"lens.distortion.{k}", symbol, distortion[k], Widget.NUMBER, symbol, "", 1, -10, 10,
                "OpenCV's coefficients, in its order and sense",
            )
        )  # fmt: skip
    for effect in _optional(MODELS):
        title = effect.name().replace("_", " ").capitalize()
        declared = parameters(effect)
        for name, path in effect.carried_by.items():
            if path in shown or name not in declared:
                continue
            field = _field(title, path, declared[name], number(camera, path), effect.source, label=name)
            found.append(field)
            shown.add(path)
    return found


def _optional(models: Any) -> list[Any]:
    """Effects that a camera may have or not, in the order in which light meets them."""
    return sorted((m for m in models.values() if not m.always), key=lambda m: (m.stage, m.order))


def _words(group: str, name: str, value: StrEnum, kind: type[StrEnum]) -> Field:
    label = name.rsplit(".", 1)[-1].replace("_", " ")
    return Field(group, name, label, str(value), Widget.CHOICE, choices=tuple(str(k) for k in kind))


def with_lobe(field: Field, value: Any) -> Any:
    """What ``SetParameter`` takes when one lobe's entry gets a value."""
    if field.lobe < 0:
        return value
    entries = list(field.value)
    entries[field.lobe] = value
    return tuple(entries)


def shown_value(field: Field) -> Any:
    """The number, or the numbers, that the panel shows."""
    value = field.value[field.lobe] if field.lobe >= 0 else field.value
    if field.widget in (Widget.NUMBER, Widget.VECTOR, Widget.COLOR):
        return np.asarray(value, np.float64) * field.scale
    return value


def fields_of(thing: Any) -> list[Field]:
    """Of a ``Light``, a ``Camera`` or a ``Material``."""
    match thing:
        case Light():
            return of_light(thing)
        case Camera():
            return of_camera(thing)
        case Material():
            return of_material(thing)
    return []
