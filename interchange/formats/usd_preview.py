"""The UsdPreviewSurface that looks most like a BRDF, for programs that know no other.

Its matte part is what f falls to away from the highlight, its width that of the highlight, both seen along the light:
there h = wi = wo, and a Trowbridge-Reitz lobe is down to half where tan² = (sqrt 2 - 1) alpha², alpha = roughness².
The rest of the light that is reflected head-on makes a metal of that colour, or, if little, the coat of a dielectric.
"""

import numpy as np

from interchange.brdf.base import Brdf
from interchange.brdf.usd_preview_surface import UsdPreviewSurface

MOST_OF_A_DIELECTRIC = 1 / 12  # F0 of an index of 1.8


def preview_of(brdf: Brdf) -> UsdPreviewSurface:
    """Anisotropic lobes are given the mean of their widths along the tangent and the bitangent."""
    theta = np.radians(np.concatenate([np.geomspace(0.02, 5, 120), np.linspace(5.1, 80, 150)]))
    matte, widths, peaks = [], [], []
    for x, y in ((1, 0), (0, 1)):
        w = np.stack([x * np.sin(theta), y * np.sin(theta), np.cos(theta)], axis=-1)
        f = np.nan_to_num(brdf.evaluate(w, w), posinf=1e6)
        floor = f[theta > np.radians(40)].min(axis=0)
        lobe = (f - floor).mean(axis=-1)
        below = np.flatnonzero(lobe < lobe[0] / 2)
        at = theta[0]
        if below.size and (k := int(below[0])) > 0:
            at = np.interp(-lobe[0] / 2, -lobe[k - 1 : k + 1], theta[k - 1 : k + 1])
        widths.append(np.tan(at) / np.sqrt(np.sqrt(2) - 1) if below.size else 1.0)
        peaks.append(lobe[0])
        matte.append(floor)
    diffuse = np.clip(np.pi * np.mean(matte, axis=0), 0, 1)
    if max(peaks) < 0.02 * max(float(np.mean(matte)), 1e-6):  # matte all over
        return UsdPreviewSurface(diffuseColor=_color(diffuse), roughness=1.0)
    alpha = float(np.clip(np.mean(widths), 1e-4, 1))
    roughness = float(np.sqrt(alpha))
    white = UsdPreviewSurface(diffuseColor=(1.0, 1.0, 1.0), metallic=1.0, roughness=roughness)
    rest = np.clip((_head_on(brdf, alpha) - diffuse) / _head_on(white, alpha), 0, 1)
    if rest.mean() > max(MOST_OF_A_DIELECTRIC, 0.5 * diffuse.mean()):
        return UsdPreviewSurface(
            diffuseColor=_color(np.clip(rest + diffuse, 0, 1)), metallic=1.0, roughness=roughness
        )
    root = np.sqrt(np.clip(rest.mean(), 0, 0.6))
    ior = float((1 + root) / (1 - root))
    return UsdPreviewSurface(diffuseColor=_color(diffuse), roughness=roughness, ior=max(ior, 1.0))


def _color(values: np.ndarray) -> tuple[float, float, float]:
    r, g, b = (round(float(v), 4) for v in values)
    return r, g, b


def _head_on(brdf: Brdf, alpha: float) -> np.ndarray:
    """Share of light along the normal that is reflected, drawn from a lobe of width ``alpha`` and from a matte one."""
    u = (np.arange(4096) + 0.5) / 4096
    phi = 2 * np.pi * ((np.arange(4096) * 0.6180339887498949) % 1)
    half = np.arctan(alpha * np.sqrt(u / (1 - u)))
    total = np.zeros(3)
    for theta in (2 * half, np.arcsin(np.sqrt(u))):
        above = theta < np.pi / 2
        t = np.where(above, theta, 0.0)
        wi = np.stack([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), np.cos(t)], axis=-1)
        d = alpha**2 / (np.pi * (np.cos(t / 2) ** 2 * (alpha**2 - 1) + 1) ** 2)
        density = (
            d / 4 + np.cos(t) / np.pi
        )  # the sum of both: the balance heuristic; D h.z / (4 wo.h), wo.h = h.z
        f = np.nan_to_num(brdf.evaluate(wi, np.array([0.0, 0, 1])))
        total += np.where(above[:, None], f * (np.cos(t) / density)[:, None], 0.0).mean(axis=0)
    return total
