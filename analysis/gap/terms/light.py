"""Terms of lamps and materials, from what each lamp gives to each pixel.

∂S/∂p = S_l (n / (n · d) - 3 d / r²),  d = p - x     position of a small lamp
∂S/∂m = Σ S_l ln cos θ                               beam cos^m θ about the lamp's axis
∂S/∂q = Σ S_l (1 - cos θ)²                            what a power of a cosine leaves of it
∂S/∂r = S_l of red less that of green                 a lamp's colour, the sum of its channels kept

A paint that is another is so in all channels, and a little more in one: a number for all beside one for each.
"""

from collections.abc import Callable, Sequence

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.light.radiance import single, weighted
from analysis.gap.light.views import placed
from analysis.gap.terms.base import NUISANCE, Field, Term
from analysis.gap.terms.bounced import Bounced
from analysis.gap.terms.left import LAMP, REFLECTED, SMOOTH
from analysis.gap.terms.mounts import MOUNT, lamps_of, on_one_mount
from interchange.brdf.lobes import has_lobes
from interchange.captures import Tolerances
from interchange.effects.ambient_light import AXES, TINTS, AmbientLight
from interchange.effects.light_beam import beam_axes
from interchange.light import Light, LightKind

FAR = (LightKind.DISTANT, LightKind.DOME)
# shares as the blind engine draws them (0.8 and 0.5), which was read before
# of an albedo's tolerance: alike in all channels, as a reference tile's or a place's; and in each
GRAY = (0.8, 0.6)
# of what is more of all channels, how much more of one: rooms are lit white, paint is dusty or worn
TINTED = 0.3
FURTHER = 0.3  # of a beam, what is no power of a cosine
LEANING = 0.3  # of ambient light, how much more comes from one side: windows, a ceiling
# of the reflected light on a material with lobes: what these give far from their peaks, where light from all around
# meets them, is measured least and differs from model to model
SHINY = 0.03
COLOR = 0.4  # of a lamp's calibrated intensity: what is left of its colour, which needs no absolute standard


def light_terms(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    t = tolerances
    lights = {x.name: x for c in conditions for x in c.shown.scene.lights}
    channels = max(c.mean.shape[2] for c in conditions)
    terms = [Term("light_intensity", n, "scale", "1", t.light_intensity, _lamp(n), start=1.0) for n in lights]
    near = [n for n, x in lights.items() if x.kind not in FAR]
    if near:
        spike = LAMP * t.flat_field
        terms += [
            Term("light_beam", "", word, "1", spike, _beam(near, way), relative=True, part=part)
            for word, way, part in (("m", _logarithm, 1.0), ("q", _square, FURTHER))
        ]
    terms += [
        Term(
            "fixed to the lamp",
            n,
            "xy"[axis],
            "1",
            LAMP * t.flat_field,
            _gradient(n, axis),
            relative=True,
            generic=True,
        )
        for n in near
        for axis in range(2)
    ]
    if channels == 3:
        terms += [
            Term("light_spectrum", n, word, "1", COLOR * t.light_intensity, _color(n, k))
            for n in lights
            for k, word in ((0, "red"), (2, "blue"))
        ]
    tints = tuple((word, TINTED) for word in TINTS) if channels == 3 else ()
    leans = tuple((axis, LEANING) for axis in AXES) if all(c.shown.leaning for c in conditions) else ()
    ways = (("L", 1.0), *tints, *leans)
    spike = SMOOTH * t.flat_field
    terms += [
        Term("ambient_light", "", word, "W/(m^2 sr)", spike, _ambient(word), True,
             low=0.0 if word == "L" else -np.inf, part=part, sized_by="L")
        for word, part in ways
    ]  # fmt: skip
    if any(c.shown.indirect for c in conditions):
        spike = REFLECTED * t.flat_field
        terms.append(Term("interreflection", "", "scale", "1", spike, _indirect, relative=True, start=1.0))
        materials = {b.material.name: b.material for c in conditions for b in c.shown.scene.bodies}
        terms += [
            Term(NUISANCE, name, "reflected", "1", SHINY, _indirect_on(name))
            for name, material in materials.items()
            if has_lobes(material.brdf)
        ]
    if any(c.shown.undrawn for c in conditions):
        spike = REFLECTED * t.flat_field
        terms.append(
            Term("interreflection", "", "added", "1", spike, _undrawn, True, low=0.0, kind="reflected")
        )
    bounced = Bounced(conditions)
    for name in dict.fromkeys(m for c in conditions for m in c.shown.scene.material_names):
        own = GRAY[1] if channels == 3 else 1.0
        terms += [
            Term("albedo", name, _channel(k, channels), "1", own * t.albedo, _albedo(name, k, bounced), start=1.0,
                 part=TINTED if channels == 3 else 1.0)
            for k in range(channels)
        ]  # fmt: skip
        if channels == 3:
            gray = Term(
                "albedo", name, "gray", "1", GRAY[0] * t.albedo, _gray(name, bounced), adds_to=tuple("RGB")
            )
            terms.append(gray)
    return terms


def _channel(k: int, channels: int) -> str:
    return "RGB"[k] if channels == 3 else "Y"


def _lamp(name: str) -> Field:
    return lambda s: s.lamps.get(name)


def _color(name: str, k: int) -> Field:
    """More of channel ``k`` and less of green, over the mean of the lamp's channels."""

    def field(s: State) -> np.ndarray | None:
        if name not in s.lamps:
            return None
        own = np.asarray(_light(s, name).intensity)
        share = np.divide(own.mean(), own, out=np.zeros(3), where=own > 0).astype(np.float32)
        out = np.zeros_like(s.lamps[name])
        out[..., k] = s.lamps[name][..., k] * share[k]
        out[..., 1] = -s.lamps[name][..., 1] * share[1]
        return out

    return field


def _light(state: State, name: str) -> Light:
    return next(x for x in state.shown.scene.lights if x.name == name)


def _from_lamp(state: State, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Vectors (h, w, 3) m from points to the lamp, and their lengths (h, w, 1)."""
    d = _light(state, name).world_from_light[:3, 3] - state.position
    return d, np.maximum(np.linalg.norm(d, axis=-1, keepdims=True), 1e-6)


def shaded(conditions: Sequence[Condition], tolerances: Tolerances) -> list[Term]:
    """The lamps' places where nothing may be rendered: their shading moves, shadows and highlights stay."""
    near = list(dict.fromkeys(x.name for c in conditions for x in c.shown.scene.lights if x.kind not in FAR))
    spike = tolerances.light_position_mm
    return [
        Term("light_position", n, "xyz"[axis], "mm", spike * (1.0 if n in near else MOUNT),
             _shading(lamps_of(near, n), axis), form=n not in near)
        for n in [*near, *on_one_mount(near)]
        for axis in range(3)
    ]  # fmt: skip


def _shading(names: Sequence[str], axis: int) -> Field:
    def field(s: State) -> np.ndarray | None:
        parts = [_shaded(s, name, axis) for name in names if name in s.lamps]
        return sum(parts[1:], parts[0]) if parts else None

    return field


def _shaded(s: State, name: str, axis: int) -> np.ndarray:
    d, r = _from_lamp(s, name)
    n = s.normal
    cos = np.maximum(np.sum(n * d, axis=-1, keepdims=True), 0.05 * r)
    slope = 1e-3 * (n[..., axis, None] / cos - 3 * d[..., axis, None] / r**2)
    return np.asarray(s.lamps[name] * slope.astype(np.float32))


def _axes(state: State, name: str) -> np.ndarray:
    return beam_axes(_light(state, name), state.shown.scene.bounds.mean(axis=0))


def _logarithm(cos: np.ndarray) -> np.ndarray:
    return np.log(np.clip(cos, 0.05, 1.0))


def _square(cos: np.ndarray) -> np.ndarray:
    return np.square(1 - np.clip(cos, 0.0, 1.0))


def _beam(names: Sequence[str], way: Callable[[np.ndarray], np.ndarray]) -> Field:
    def field(s: State) -> np.ndarray | None:
        total = None
        for name in names:
            if name in s.lamps:
                d, r = _from_lamp(s, name)
                part = s.lamps[name] * way((d / r) @ _axes(s, name)[:, 2])[..., None].astype(np.float32)
                total = part if total is None else total + part
        return total

    return field


def _gradient(name: str, axis: int) -> Field:
    def field(s: State) -> np.ndarray | None:
        if name not in s.lamps:
            return None
        d, r = _from_lamp(s, name)
        return s.lamps[name] * ((d / r) @ _axes(s, name)[:, axis])[..., None].astype(np.float32)

    return field


def _ambient(word: str) -> Field:
    def field(s: State) -> np.ndarray:
        if word in AXES:
            share = placed(single(s.shown.leaning[word]), s.flow)
            return s.per_radiance * s.channels(s.take(s.shown.ambient * share))
        column = s.per_radiance * s.channels(s.take(s.shown.ambient))
        tint = np.array(AmbientLight(**{word: 1.0}).channels, np.float32)
        return np.asarray(column * tint) if column.shape[-1] == 3 else column

    return field


def _indirect(s: State) -> np.ndarray | None:
    """Each lamp's own: where one lamp's light goes is not where another's does."""
    share = s.shown.indirect
    parts = [L * s.channels(s.take(share[name])) for name, L in s.lamps.items() if name in share]
    return sum(parts[1:], parts[0]) if parts else None


def _indirect_on(material: str) -> Field:
    def field(s: State) -> np.ndarray | None:
        given, names = _indirect(s), s.shown.scene.material_names
        if given is None or material not in names:
            return None
        return given * (s.take(s.shown.passes["material_id"]) == names.index(material))[..., None]

    return field


def _undrawn(s: State) -> np.ndarray | None:
    undrawn, weights = s.shown.undrawn, s.shown.weights(s.condition.scene)
    parts = [weighted(undrawn[n], w) for n, w in weights.items() if n in undrawn and w.any()]
    return s.per_radiance * s.channels(s.take(sum(parts[1:], parts[0]))) if parts else None


def _albedo(name: str, k: int, bounced: Bounced) -> Field:
    """What the material gives to the camera, and to other surfaces."""

    def field(s: State) -> np.ndarray | None:
        names = s.shown.scene.material_names
        if name not in names or not s.lamps:
            return None
        mask = s.take(s.shown.passes["material_id"]) == names.index(name)
        out = np.zeros_like(s.signal)
        out[..., k] = s.signal[..., k] * mask
        if (given := bounced.light(s, name)) is not None:
            out[..., k] += given[..., k]
        return out

    return field


def _gray(name: str, bounced: Bounced) -> Field:
    def field(s: State) -> np.ndarray | None:
        parts = [x for k in range(s.signal.shape[2]) if (x := _albedo(name, k, bounced)(s)) is not None]
        return sum(parts[1:], parts[0]) if parts else None

    return field
