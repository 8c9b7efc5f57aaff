"""Reflectance samples from images of a known shape under known lamps, one a pixel.

    f = L / (E cos theta_i),    E = I(direction) / d²  (a small lamp)  or the irradiance of distant light

Every pixel knows where it is and how it is turned (passes ``position`` and ``normal``), so a curved surface under a
few lamps gives thousands of pairs of directions. Lensch et al.: Image-based reconstruction of spatially varying
materials. EGRW 2001. Light that other surfaces reflect must be kept out of the images or be small.
"""

from collections.abc import Sequence

import numpy as np

from interchange.image import Image, Quantity
from interchange.light import Light, LightKind
from interchange.problems import BrightfieldError, Problem, Severity
from interchange.reflectance import ReflectanceSamples

SMALL = 0.1  # a lamp's radius over its distance, above which it has no one direction


def samples_of_image(
    image: Image,
    light: Light,
    mask: np.ndarray | None = None,
    sigma: np.ndarray | float | None = None,
    tangent: tuple[float, float, float] = (1.0, 0.0, 0.0),
    grazing: float = np.radians(80),
) -> ReflectanceSamples:
    """The samples of every pixel of ``image`` that shows a surface: radiance, with its camera and the passes
    ``position`` and ``normal``, lit by ``light`` alone.

    ``mask`` (H, W): False leaves a pixel out (another material, saturated). ``sigma``: one standard deviation of the
    radiance, (H, W, C) or one number. ``tangent``: world direction that the surface's x axis is nearest to, which
    matters where it is anisotropic. Pixels in shadow (pass ``lit:NAME``, if there) or with a direction beyond
    ``grazing`` rad off the normal have ``use`` False: a pixel's mean is not its middle there. Raises BrightfieldError.
    """
    position, normal = _passes(image)
    camera = image.camera
    if camera is None:
        raise BrightfieldError("The image must know its camera.")
    shown = np.isfinite(position).all(axis=-1) & np.isfinite(normal).all(axis=-1)
    x, n = position[shown].astype(np.float64), normal[shown].astype(np.float64)
    pixels = np.argwhere(shown)[:, ::-1].astype(np.float64)
    _, toward = camera.rays(pixels)
    to_light, irradiance, far_off = _light(light, x)
    frame = _frames(n, np.asarray(tangent, np.float64))
    wi, wo = (np.einsum("nij,nj->ni", frame, w) for w in (to_light, -toward))
    with np.errstate(divide="ignore", invalid="ignore"):
        per = 1 / (irradiance * wi[:, 2:])
        f = image.pixels[shown].astype(np.float64) * per
    spread = None
    if sigma is not None:
        spread = np.broadcast_to(np.asarray(sigma, np.float64), image.pixels.shape)[shown] * np.abs(per)
    use = np.minimum(wi[:, 2], wo[:, 2]) > np.cos(grazing)
    use &= (irradiance > 0).all(axis=1)
    if mask is not None:
        use &= np.asarray(mask, bool)[shown]
    lit = image.passes.get(f"lit:{light.name}")
    dark = lit[shown] < 0.999 if lit is not None else np.zeros(len(x), bool)
    said = [
        (int((use & dark).sum()), "pixels are in shadow; they are left out"),
        (
            int((use & far_off).sum()),
            f"pixels are nearer to the lamp than {1 / SMALL:g} of its radii; left out",
        ),
    ]
    notes = tuple(Problem(f"{count} {text}.", severity=Severity.NOTE) for count, text in said if count)
    return ReflectanceSamples(wi, wo, f, spread, use & ~dark & ~far_off, notes=notes)


def samples_of_series(images: Sequence[tuple[Image, Light]], **options: object) -> ReflectanceSamples:
    """The samples of several images, each under its own lamp, one behind the other; options as of one image."""
    if not images:
        raise BrightfieldError("There must be one image at least.")
    found = [samples_of_image(image, light, **options) for image, light in images]  # type: ignore[arg-type]
    sigma = [s.sigma for s in found if s.sigma is not None]
    return ReflectanceSamples(
        np.concatenate([s.wi for s in found]),
        np.concatenate([s.wo for s in found]),
        np.concatenate([s.f for s in found]),
        np.concatenate(sigma) if sigma else None,
        np.concatenate([s.use for s in found]),
        found[0].channels,
        notes=tuple(n for s in found for n in s.notes),
    )


def _passes(image: Image) -> tuple[np.ndarray, np.ndarray]:
    if image.quantity is not Quantity.RADIANCE:
        raise BrightfieldError(f"The image must hold radiance; it holds {image.quantity.value}.")
    missing = [name for name in ("position", "normal") if name not in image.passes]
    if missing:
        raise BrightfieldError(
            f"The image must have the passes position and normal; {' and '.join(missing)} is missing."
        )
    return image.passes["position"], image.passes["normal"]


def _light(light: Light, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors (N, 3) to the lamp, irradiance (N, 3) of a surface that faces it, and where it is too near."""
    z = light.world_from_light[:3, 2]
    if light.kind is LightKind.DISTANT:
        return np.broadcast_to(z, x.shape), np.broadcast_to(light.intensity, x.shape), np.zeros(len(x), bool)
    if light.kind in (LightKind.DOME, LightKind.CYLINDER) or light.texture is not None:
        raise BrightfieldError(
            f"{light.name} must be a small lamp or distant light; it is a {light.kind.value}."
        )
    to = light.world_from_light[:3, 3] - x
    distance = np.linalg.norm(to, axis=1, keepdims=True)
    to = to / distance
    local = -to @ light.world_from_light[:3, :3]
    cosine = 1.0 if light.kind is LightKind.SPHERE else np.maximum(-local[:, 2:], 0.0)
    irradiance = np.asarray(light.intensity) * light.shaping(local) * cosine / distance**2
    size = max(light.radius, 0.5 * float(np.hypot(light.width, light.height)))
    return to, irradiance, (size > SMALL * distance)[:, 0]


def _frames(n: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    """(N, 3, 3) with tangent, bitangent and normal as rows."""
    t = tangent - n * (n @ tangent)[:, None]
    other = np.array([0.0, 1.0, 0.0]) if abs(tangent[1]) < 0.9 else np.array([0.0, 0.0, 1.0])
    along = np.linalg.norm(t, axis=1) < 1e-3
    t[along] = (other - n * (n @ other)[:, None])[along]
    t = t / np.linalg.norm(t, axis=1, keepdims=True)
    return np.stack([t, np.cross(n, t), n], axis=1)
