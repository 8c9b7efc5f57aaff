"""Spectra as people see them: luminous flux, CIE 1931 tristimulus values, chromaticity, linear sRGB.

    (X, Y, Z) = ∫ S(λ) (x̄, ȳ, z̄) dλ,   ȳ = V(λ),   luminous flux = K_m Y,   K_m = 683 lm/W

ISO/CIE 11664-3; IEC 61966-2-1.
"""

from functools import cache

import numpy as np

from interchange.illuminants import table
from interchange.problems import BrightfieldError
from interchange.spectrum import Spectrum, common

K_M = 683.0  # lm/W: photopic luminous efficacy of light of 540 THz, 555 nm
RGB_FROM_XYZ = np.linalg.inv(
    np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
)


@cache
def observer() -> tuple[Spectrum, Spectrum, Spectrum]:
    """x̄, ȳ, z̄ of the 2° standard observer."""
    wavelength, columns = table("observer_1931")
    x, y, z = (Spectrum(wavelength, columns[c], name=c) for c in "xyz")
    return x, y, z


def xyz(spectrum: Spectrum) -> np.ndarray:
    """(3,) X, Y, Z in the spectrum's unit times nm, not normalised: K_m Y is lm of a spectrum in W/nm."""
    grid = common(spectrum, observer()[0])
    values = spectrum(grid)
    from scipy.integrate import trapezoid  # half a second to import

    return np.array([trapezoid(values * c(grid), grid) for c in observer()])


def chromaticity(spectrum: Spectrum) -> np.ndarray:
    """(2,) CIE 1931 x, y. Raises BrightfieldError for an invisible spectrum."""
    X = xyz(spectrum)
    if not X.sum() > 0:
        raise BrightfieldError(f"A spectrum that is not visible has no chromaticity. ({spectrum.name})")
    return X[:2] / X.sum()


def luminous_efficacy(spectrum: Spectrum) -> float:
    """Luminous flux per radiant flux, lm/W: K_m ∫ S V dλ / ∫ S dλ, over all wavelengths that the spectrum has."""
    if not spectrum.integral() > 0:
        raise BrightfieldError(f"A spectrum with a luminous efficacy must not be dark. ({spectrum.name})")
    return float(K_M * xyz(spectrum)[1] / spectrum.integral())


def watts_of(lumens: float, spectrum: Spectrum) -> float:
    """Radiant flux, W, of a luminous flux. Raises BrightfieldError where the spectrum is not visible."""
    efficacy = luminous_efficacy(spectrum)
    if not efficacy > 1e-3:
        raise BrightfieldError(
            f"Lumens need a visible spectrum; this has {efficacy:g} lm/W. ({spectrum.name})"
        )
    return lumens / efficacy


def linear_srgb(spectrum: Spectrum) -> np.ndarray:
    """(3,) linear sRGB of X, Y, Z as they are; negative where the colour lies outside the gamut."""
    return RGB_FROM_XYZ @ xyz(spectrum)


def srgb_color(spectrum: Spectrum) -> tuple[float, float, float]:
    """Linear sRGB cut off at the gamut's edge (no negative light) and scaled to a mean of 1: a lamp's colour where
    no camera is known."""
    rgb = np.maximum(linear_srgb(spectrum), 0.0)
    if not rgb.sum() > 0:
        raise BrightfieldError(f"A spectrum that is not visible has no colour in sRGB. ({spectrum.name})")
    r, g, b = rgb / rgb.mean()
    return (float(r), float(g), float(b))
