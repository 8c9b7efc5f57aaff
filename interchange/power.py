"""A lamp's power: what it sends out in all directions, W, and the intensity that it needs for a given power.

    Φ = ∫ I(ω) dω,     I(ω) = intensity · g(ω) · shaping(ω)

| kind         | g(ω)                          | Φ of a lamp without shaping       |
|--------------|-------------------------------|-----------------------------------|
| sphere       | 1                             | 4π I, or that of a projector      |
| disk, rect   | cos θ on the side of -z       | π I = π L A                       |
| cylinder     | sine of the angle to x        | π² I = π L · 2π r l (no caps)     |
| distant      | power through an area         | E A on a plane that faces it      |
| dome         | power through an area         | π L A on a plane, from one side   |

Shaping is integrated exactly in pieces: between the edges of cone and profile, by Gauss and Legendre's rule. Three
channels have each their own power; the power of a lamp whose spectrum is not known is that of every channel. In
lumens a lamp needs a spectrum: Φ_v = K Φ_e with K of ``colorimetry.luminous_efficacy``.
"""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.special import roots_legendre

from interchange.colorimetry import luminous_efficacy, srgb_color, watts_of
from interchange.light import Light, LightKind, latlong_uv
from interchange.material import evaluate_texture
from interchange.problems import BrightfieldError
from interchange.spectrum import Spectrum

Color = tuple[float, float, float]
WHITE = (1.0, 1.0, 1.0)
DECIDES: tuple[str, ...] = (
    "kind",
    "cone_angle",
    "cone_softness",
    "focus",
    "focus_tint",
    "profile",
    "profile_angle_scale",
    "projector",
    "texture",
)
NODES = 8  # of a piece
RINGS = 48  # pieces from axis to axis, where neither cone nor profile asks for more
FACE = 256  # rows and columns at which a face's texture is summed up
PLANE = 1024  # and a projector's image


def emitted_power(light: Light, area: float | None = None) -> np.ndarray:
    """(3,) W that leave the lamp; of distant and dome light what passes an ``area``, m², of a plane that faces -z.

    Raises BrightfieldError where an area is missing, or given for a lamp that has a place.
    """
    return np.asarray(light.intensity) * power_per_intensity(light, area)


def power_per_intensity(light: Light, area: float | None = None) -> np.ndarray:
    """(3,) what one unit of each channel's ``Light.intensity`` is in W."""
    far = light.kind in (LightKind.DISTANT, LightKind.DOME)
    if far != (area is not None):
        need = "need an area that it passes" if far else "must be asked for without an area"
        raise BrightfieldError(
            f"The power of a {light.kind.value} light {need}. ({light.where or light.name})"
        )
    return _per_unit(*(getattr(light, name) for name in DECIDES)) * (area if area is not None else 1.0)


@lru_cache(maxsize=256)
def _per_unit(*about: Any) -> np.ndarray:
    """(3,) W, or W/m² on a plane, by all that decides it: ``DECIDES``. The lamp's size does not."""
    light = Light("", intensity=WHITE, **dict(zip(DECIDES, about, strict=True)))
    if light.kind is LightKind.DISTANT:
        return np.ones(3) * light.shaping(np.array([0.0, 0.0, -1.0]))
    if light.projector is not None:
        return _projected(light)
    weight, direction = directions(light)
    match light.kind:
        case LightKind.SPHERE:
            g = np.ones(weight.shape)
        case LightKind.CYLINDER:
            g = np.sqrt(np.maximum(1 - direction[..., 0] ** 2, 0.0))
        case _:
            g = np.maximum(-direction[..., 2], 0.0)
    value = light.shaping(direction)
    if light.texture is not None and light.kind is LightKind.DOME:
        value = value * _dome_texture(light, direction)
    total = np.einsum("ij,ij,ijc->c", weight, g, value)
    if light.texture is not None and light.kind is LightKind.RECT:
        total = total * _face_mean(light)
    return np.asarray(total)


def intensity_from_power(
    light: Light, watts: float, color: Color = WHITE, area: float | None = None
) -> Color:
    """``Light.intensity`` of a lamp of this shape, profile and shaping that emits ``watts``, W.

    ``color``: the power of each channel over ``watts``. A lamp whose texture, image or tint has a colour keeps it: the
    mean of the channels of white light is then ``watts``. Raises BrightfieldError for a negative power, or a lamp
    whose shaping lets nothing out.
    """
    if not (np.isfinite(watts) and watts >= 0):
        raise BrightfieldError(
            f"A lamp's power must be finite and not negative; got {watts:g} W. ({light.name})"
        )
    factor = float(power_per_intensity(light, area).mean())
    if not factor > 0:
        raise BrightfieldError(
            f"A lamp with a power must let light out; its shaping or its image lets none out. ({light.name})"
        )
    r, g, b = watts / factor * np.asarray(color)
    return (float(r), float(g), float(b))


def with_power(
    light: Light,
    watts: float | None = None,
    lumens: float | None = None,
    spectrum: Spectrum | None = None,
    color: Color | None = None,
    area: float | None = None,
) -> Light:
    """``light`` with the intensity that gives it a radiant power, or a luminous flux of a ``spectrum``.

    ``color``: each channel's share as in ``intensity_from_power``; without it that of ``spectrum`` in linear sRGB
    with a mean of 1 (``spectral_channels.channels`` knows what a camera makes of it), or grey. Raises BrightfieldError
    unless one of ``watts`` and ``lumens`` is given, and a spectrum with the latter.
    """
    if (watts is None) == (lumens is None):
        raise BrightfieldError(f"A lamp's power must be given in watts or in lumens, once. ({light.name})")
    if lumens is not None:
        if spectrum is None:
            raise BrightfieldError(f"Lumens need a spectrum to become watts. ({light.name})")
        watts = watts_of(lumens, spectrum)
    if color is None:
        visible = spectrum is not None and luminous_efficacy(spectrum) > 1e-3
        color = srgb_color(spectrum) if spectrum is not None and visible else WHITE
    return replace(light, intensity=intensity_from_power(light, float(watts or 0.0), color, area))


def from_candela(spectrum: Spectrum, color: Color = WHITE) -> Color:
    """``Light.intensity`` of a lamp whose profile is in candela, as of a photometric file: W/sr per candela."""
    per_candela = watts_of(1.0, spectrum)
    r, g, b = color
    return (r * per_candela, g * per_candela, b * per_candela)


def directions(light: Light) -> tuple[np.ndarray, np.ndarray]:
    """Weights (T, P), sr, and directions (T, P, 3) of the light's frame that integrate its emission piecewise."""
    theta_edges = [*np.linspace(0, np.pi, RINGS + 1), light.cone_angle]
    theta_edges += [(1 - light.cone_softness) * light.cone_angle]
    phi_edges = list(np.linspace(0, 2 * np.pi, 9))
    if light.profile is not None:
        scale, knots = light.profile_angle_scale, light.profile.vertical
        theta_edges += list(
            knots * scale if scale > 0 else (knots - np.pi) * -scale + np.pi if scale < 0 else knots
        )
        phi_edges += list(light.profile.horizontal)
    if light.texture is not None:
        theta_edges += list(np.linspace(0, np.pi, 2 * FACE + 1))
        phi_edges = list(np.linspace(0, 2 * np.pi, 4 * FACE + 1))
    theta, theta_weight = _pieces(np.clip(theta_edges, 0, np.pi), 2 if light.texture is not None else NODES)
    phi, phi_weight = _pieces(np.array(phi_edges), 1 if light.texture is not None else NODES)
    sine = np.sin(theta)[:, None]
    direction = np.stack(
        [
            sine * np.cos(phi),
            sine * np.sin(phi),
            np.broadcast_to(-np.cos(theta)[:, None], (len(theta), len(phi))),
        ],
        axis=-1,
    )
    return theta_weight[:, None] * phi_weight * sine, direction


def _projected(light: Light) -> np.ndarray:
    """(3,) over the image plane (x, y) at distance 1, where dω = dx dy / (1 + x² + y²)^1.5."""
    assert light.projector is not None
    border = light.projector.border()
    low, high = (np.array(f(border[:, :2] / -border[:, 2:], axis=0)) for f in (np.min, np.max))
    steps = [(np.arange(PLANE) + 0.5) / PLANE * (high[i] - low[i]) + low[i] for i in (0, 1)]
    x, y = np.meshgrid(*steps)
    direction = np.stack([x, y, -np.ones_like(x)], axis=-1)
    length = np.linalg.norm(direction, axis=-1, keepdims=True)
    cell = np.prod(high - low) / PLANE**2
    return np.sum(light.shaping(direction / length) / length**3, axis=(0, 1)) * cell


def _pieces(edges: np.ndarray, nodes: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights of Gauss and Legendre's rule between neighbouring edges."""
    edges = np.unique(edges)
    x, w = roots_legendre(nodes)
    half = np.diff(edges)[:, None] / 2
    return (edges[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()


def _face_mean(light: Light) -> np.ndarray:
    """(3,) mean of a rect's texture over its face."""
    assert light.texture is not None
    at = (np.arange(FACE) + 0.5) / FACE
    values = evaluate_texture(light.texture, np.stack(np.meshgrid(at, at), axis=-1))
    return np.broadcast_to(values, (FACE, FACE, values.shape[-1])).mean(axis=(0, 1)) * np.ones(3)


def _dome_texture(light: Light, emission: np.ndarray) -> np.ndarray:
    """(..., 3) or (..., 1): a dome's map where the light that travels along ``emission`` comes from."""
    assert light.texture is not None
    return evaluate_texture(light.texture, latlong_uv(-emission))
