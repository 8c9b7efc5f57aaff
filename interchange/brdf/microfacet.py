"""What models of rough surfaces share: mirror facets whose normals h are spread by a distribution D(h).

    f = F(wi.h) D(h) G(wi, wo) / (4 wi.z wo.z),    integral of D(h) h.z over the hemisphere = 1

F is Fresnel's reflectance of a facet, G the part of the facets that is neither shadowed nor masked. All functions
take one channel and may be traced (``interchange.shader``); directions are (x, y, z) triples in the shading frame.
sin² of h is taken as h.x² + h.y², never as 1 - h.z², which single precision cancels.

Walter et al.: Microfacet models for refraction through rough surfaces. EGSR 2007.
Heitz: Understanding the masking-shadowing function in microfacet-based BRDFs. JCGT 3(2), 2014.
"""

from typing import Any

import numpy as np
from scipy.special import erf

Vector = tuple[Any, Any, Any]


def dot(a: Vector, b: Vector) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def half_vector(wi: Vector, wo: Vector) -> tuple[Vector, Any]:
    """h = (wi + wo) / |wi + wo| and wi.h = wo.h = |wi + wo| / 2."""
    x, y, z = (a + b for a, b in zip(wi, wo, strict=True))
    length = np.sqrt(np.square(x) + np.square(y) + np.square(z))
    return (x / length, y / length, z / length), np.minimum(0.5 * length, 1.0)


def polar_angle(w: Vector) -> Any:
    """Angle between ``w`` and the normal in rad, 0 to pi / 2, within 1e-8.

    By the arc sine's series of a quarter of the angle: graphics drivers' atan and acos are off by up to 1e-4 of their
    value, which a narrow lobe shows.
    """
    half = np.sqrt(0.5 + 0.5 * w[2])  # its cosine
    sin = np.sqrt(np.square(w[0]) + np.square(w[1])) / (2.0 * half * np.sqrt(2.0 + 2.0 * half))
    q = np.square(sin)
    series: Any = 143 / 10240
    for coefficient in (231 / 13312, 63 / 2816, 35 / 1152, 5 / 112, 3 / 40, 1 / 6, 1.0):
        series = coefficient + q * series
    return 4.0 * sin * series


def fresnel_dielectric(cos: Any, eta: Any) -> Any:
    """Reflectance of unpolarised light at a smooth clear surface, 0 to 1.

    ``eta``: index behind the surface over the index before it; below 1 with total reflection. Exact at head-on
    incidence: ((eta - 1) / (eta + 1))². In the form of Cook and Torrance 1982.
    """
    g = np.sqrt(np.maximum(np.square(eta) - 1.0 + np.square(cos), 0.0))
    near, far = g - cos, np.maximum(g + cos, 1e-9)
    ratio = (cos * far - 1.0) / (cos * near + 1.0)
    return 0.5 * np.square(near / far) * (1.0 + np.square(ratio))


def fresnel_conductor(cos: Any, eta: Any, k: Any) -> Any:
    """Reflectance of unpolarised light at a smooth metal of complex index eta + i k, seen from air, 0 to 1.

    Without approximation (Born & Wolf, section 14.2); k = 0 is ``fresnel_dielectric``. ``eta`` > 0, ``k`` >= 0.
    """
    cos2 = np.square(cos)
    sin2 = 1.0 - cos2
    # (a + i b)² = (eta + i k)² - sin²; the larger of a, b by a sum, the other by a b = eta k: nothing cancels
    real = np.square(eta) - np.square(k) - sin2
    size = np.sqrt(np.square(real) + np.square(2.0 * eta * k))
    large = np.sqrt(np.maximum(0.5 * (size + np.absolute(real)), 1e-20))
    a = np.where(real > 0.0, large, eta * k / large)
    cross = 2.0 * a * cos
    s = (size + cos2 - cross) / (size + cos2 + cross)
    p = s * (cos2 * size + np.square(sin2) - cross * sin2) / (cos2 * size + np.square(sin2) + cross * sin2)
    return 0.5 * (s + p)


def fresnel_schlick(cos: Any, f0: Any) -> Any:
    """Schlick's F0 + (1 - F0) (1 - cos)^5 (Schlick 1994)."""
    return f0 + (1.0 - f0) * np.power(np.maximum(1.0 - cos, 0.0), 5.0)


def beckmann(h: Vector, alpha_x: Any, alpha_y: Any) -> Any:
    """D in 1/sr of Gaussian slopes: exp(-(h.x²/alpha_x² + h.y²/alpha_y²) / h.z²) / (pi alpha_x alpha_y h.z^4).

    alpha: rms slope times sqrt 2 (Beckmann's m).
    """
    cos2 = np.square(h[2])
    tan2 = (np.square(h[0] / alpha_x) + np.square(h[1] / alpha_y)) / cos2
    return np.exp(-tan2) / (np.pi * alpha_x * alpha_y * np.square(cos2))


def ggx(h: Vector, alpha_x: Any, alpha_y: Any) -> Any:
    """D in 1/sr of Trowbridge and Reitz: 1 / (pi alpha_x alpha_y (h.x²/alpha_x² + h.y²/alpha_y² + h.z²)²)."""
    q = np.square(h[0] / alpha_x) + np.square(h[1] / alpha_y) + np.square(h[2])
    return 1.0 / (np.pi * alpha_x * alpha_y * np.square(q))


def lambda_ggx(w: Vector, alpha_x: Any, alpha_y: Any) -> Any:
    """Smith's Lambda for ``ggx``: G1 = 1 / (1 + Lambda); both directions, heights correlated:
    G = 1 / (1 + Lambda(wi) + Lambda(wo)); uncorrelated: the product of both G1."""
    tan2 = (np.square(alpha_x * w[0]) + np.square(alpha_y * w[1])) / np.square(w[2])
    return 0.5 * (np.sqrt(1.0 + tan2) - 1.0)


def lambda_beckmann(w: Vector, alpha_x: Any, alpha_y: Any) -> Any:
    """Smith's Lambda for ``beckmann``, exact: (erf(a) - 1) / 2 + exp(-a²) / (2 a sqrt pi), a = 1 / (alpha tan)."""
    width = np.sqrt(np.square(alpha_x * w[0]) + np.square(alpha_y * w[1]))
    a = w[2] / np.maximum(width, 1e-10)
    tail = np.exp(-np.square(a)) / (2.0 * np.sqrt(np.pi) * a)
    return np.maximum(0.5 * (erf(a) - 1.0) + tail, 0.0)


def v_grooves(wi: Vector, wo: Vector, h: Vector, cos: Any) -> Any:
    """G of symmetric V-shaped grooves: min(1, 2 h.z wo.z / cos, 2 h.z wi.z / cos), ``cos`` = wi.h.

    Torrance & Sparrow 1967 in the form of Blinn 1977.
    """
    return np.minimum(1.0, 2.0 * h[2] * np.minimum(wi[2], wo[2]) / cos)
