"""Spectra that have a name or a formula: CIE illuminants, black bodies, daylight, LEDs.

black body   M(λ, T) = 2 π h c² / λ⁵ / (exp(h c / λ k T) - 1)              Planck; W m⁻² nm⁻¹
A            a black body of 2848 K with c2 = 0.01435 m K, 100 at 560 nm   CIE S 014-2
D            S0 + M1 S1 + M2 S2, with M1 and M2 by correlated colour temperature   CIE 15:2004, 3.1
FL1 .. FL12, LED-B1 .. LED-V2   published tables                           CIE 15:2018
LED          a Gaussian of its full width at half maximum
"""

import csv
import re
from functools import cache
from importlib.resources import files

import numpy as np

from interchange.problems import BrightfieldError, did_you_mean
from interchange.spectrum import Spectrum

H, C, K_B = 6.62607015e-34, 299792458.0, 1.380649e-23  # exact by the SI
STEFAN_BOLTZMANN = 2 * np.pi**5 * K_B**4 / (15 * H**3 * C**2)  # W m⁻² K⁻⁴
VISIBLE = np.arange(300.0, 1101.0, 1.0)  # nm: what a silicon sensor may see
# correlated colour temperatures of the D illuminants: their nominal ones by today's c2 (CIE 15:2004, note 4)
DAYLIGHT = {"D50": 5000, "D55": 5500, "D65": 6500, "D75": 7500}
TABLES = ("fluorescent", "led")


def planck(wavelength_nm: np.ndarray, temperature: float) -> np.ndarray:
    """Spectral exitance of a black body, W m⁻² nm⁻¹, at ``temperature`` K."""
    metres = np.asarray(wavelength_nm, np.float64) * 1e-9
    with np.errstate(over="ignore"):
        return 2e-9 * np.pi * H * C**2 / metres**5 / np.expm1(H * C / (metres * K_B * temperature))


def black_body(temperature: float, wavelength_nm: np.ndarray = VISIBLE) -> Spectrum:
    """Spectral exitance, W m⁻² nm⁻¹. Raises BrightfieldError where ``temperature`` is not positive."""
    if not temperature > 0:
        raise BrightfieldError(f"A black body's temperature must be above 0 K; got {temperature:g} K.")
    return Spectrum(
        wavelength_nm, planck(wavelength_nm, temperature), "W/(m² nm)", f"black body {temperature:g} K"
    )


def daylight(temperature: float) -> Spectrum:
    """The CIE daylight illuminant of a correlated colour temperature, 4000 to 25000 K; 100 at 560 nm, relative.

    Raises BrightfieldError outside that range.
    """
    t = temperature
    if not 4000 <= t <= 25000:
        raise BrightfieldError(f"Daylight must have 4000 to 25000 K; got {t:g} K.")
    if t <= 7000:
        x = -4.6070e9 / t**3 + 2.9678e6 / t**2 + 0.09911e3 / t + 0.244063
    else:
        x = -2.0064e9 / t**3 + 1.9018e6 / t**2 + 0.24748e3 / t + 0.237040
    y = -3.000 * x * x + 2.870 * x - 0.275
    m = 0.0241 + 0.2562 * x - 0.7341 * y
    m1, m2 = np.round([(-1.3515 - 1.7703 * x + 5.9114 * y) / m, (0.0300 - 31.4424 * x + 30.0717 * y) / m], 3)
    wavelength, parts = table("daylight_components")
    return Spectrum(wavelength, parts["S0"] + m1 * parts["S1"] + m2 * parts["S2"], name=f"daylight {t:g} K")


def led(peak_nm: float, width_nm: float) -> Spectrum:
    """A line of unit integral, Gaussian, of ``width_nm`` between the wavelengths of half the peak."""
    if not (width_nm > 0 and peak_nm > 2 * width_nm):
        raise BrightfieldError(
            f"An LED's line must have a width above 0, and a peak beyond twice that; got {width_nm:g} nm "
            f"at {peak_nm:g} nm."
        )
    sigma = width_nm / np.sqrt(8 * np.log(2))
    x = np.linspace(-5, 5, 201)
    values = np.exp(-x * x / 2)
    line = Spectrum(peak_nm + np.minimum(sigma, peak_nm / 6) * x, values, "1/nm", f"LED {peak_nm:g} nm")
    return line.normalized()


def illuminant(name: str) -> Spectrum:
    """A spectrum by its name: ``A``, ``E``, ``D50`` ``D55`` ``D65`` ``D75``, ``FL1`` .. ``FL12`` (or ``F1``),
    ``LED-B1`` .. ``LED-V2``, a black body as ``3000 K``, an LED as ``625 nm`` or ``625 nm / 20 nm`` (peak, width; 25
    where it is not given). Relative. Raises BrightfieldError for another name.
    """
    word = name.strip()
    if match := re.fullmatch(r"([\d.]+) ?K", word):
        return black_body(float(match[1]))
    if match := re.fullmatch(r"([\d.]+) ?nm(?: ?/ ?([\d.]+) ?nm)?", word):
        return led(float(match[1]), float(match[2] or 25.0))
    word = re.sub(r"^F(\d)", r"FL\1", word.upper())
    if word == "A":
        top, bottom = (np.expm1(1.435e7 / (2848 * w)) for w in (560.0, VISIBLE))
        return Spectrum(VISIBLE, 100 * (560 / VISIBLE) ** 5 * top / bottom, name="A")
    if word == "E":
        return Spectrum(VISIBLE, np.full(len(VISIBLE), 100.0), name="E")
    if word in DAYLIGHT:
        found = daylight(DAYLIGHT[word] * 1.4388 / 1.4380)
        return Spectrum(found.wavelength_nm, found.values, name=word)
    known = ["A", "E", *DAYLIGHT]
    for part in TABLES:
        wavelength, columns = table(part)
        if word in columns:
            return Spectrum(wavelength, columns[word], name=word)
        known += columns
    raise BrightfieldError(
        f'No illuminant is called "{name}".{did_you_mean(word, known)} There are {", ".join(known)}, a temperature '
        "(3000 K) and a wavelength (625 nm)."
    )


@cache
def table(name: str) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Wavelengths (N,), nm, and columns (N,) of a table in ``interchange/cie``."""
    rows = list(csv.reader((files("interchange") / "cie" / f"{name}.csv").read_text("utf8").splitlines()))
    numbers = np.array(rows[1:], np.float64)
    return numbers[:, 0], {title: numbers[:, i + 1] for i, title in enumerate(rows[0][1:])}
