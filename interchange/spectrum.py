"""A spectrum: values over wavelength, linear in between and zero outside.

What a lamp emits (W/nm, or relative), what a sensor responds to, what a filter lets through: products of spectra are
integrated over wavelength, by the trapezium rule on the union of their wavelengths, refined to a nanometre.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from interchange.measurement import Kind, Measurement
from interchange.problems import BrightfieldError

STEP = 1.0  # nm: the widest step of an integral


@dataclass(frozen=True, eq=False)
class Spectrum:
    """``values`` (N,) over ``wavelength_nm`` (N,), which increases; N is 2 or more.

    ``unit``: of the values, "W/nm" or the like; "1" where they are relative. Raises BrightfieldError where the two do
    not fit, a number is not finite, or a wavelength is not positive.
    """

    wavelength_nm: np.ndarray
    values: np.ndarray
    unit: str = "1"
    name: str = ""

    def __post_init__(self) -> None:
        for field in ("wavelength_nm", "values"):
            array = np.array(getattr(self, field), np.float64)
            array.flags.writeable = False
            object.__setattr__(self, field, array)
        w, v = self.wavelength_nm, self.values
        label = f" ({self.name})" if self.name else ""
        if w.ndim != 1 or w.shape != v.shape or len(w) < 2:
            raise BrightfieldError(
                f"A spectrum must have two or more wavelengths and a value each; got {w.shape} and {v.shape}.{label}"
            )
        if not (np.isfinite(w).all() and np.isfinite(v).all()):
            raise BrightfieldError(f"A spectrum's numbers must be finite.{label}")
        if not (w[0] > 0 and (np.diff(w) > 0).all()):
            raise BrightfieldError(f"Wavelengths must be positive numbers that increase.{label}")

    def __call__(self, wavelength_nm: np.ndarray | float) -> np.ndarray:
        """Values at these wavelengths, nm."""
        return np.interp(wavelength_nm, self.wavelength_nm, self.values, left=0.0, right=0.0)

    def __mul__(self, other: "Spectrum | float") -> "Spectrum":
        """A product with a number, or with another spectrum, over the wavelengths that both have."""
        if not isinstance(other, Spectrum):
            return Spectrum(self.wavelength_nm, self.values * other, self.unit, self.name)
        grid = common(self, other)
        unit = (
            other.unit
            if self.unit == "1"
            else self.unit
            if other.unit == "1"
            else f"{self.unit} {other.unit}"
        )
        return Spectrum(grid, self(grid) * other(grid), unit)

    def integral(self) -> float:
        """∫ values dλ, in the unit times nm."""
        from scipy.integrate import trapezoid  # half a second to import

        return float(trapezoid(self.values, self.wavelength_nm))

    def mean_wavelength(self) -> float:
        """nm, weighted by the values."""
        from scipy.integrate import trapezoid

        return float(trapezoid(self.values * self.wavelength_nm, self.wavelength_nm)) / self.integral()

    def normalized(self, total: float = 1.0) -> "Spectrum":
        """The same shape with the integral ``total``. Raises BrightfieldError where there is none to scale."""
        if not self.integral() > 0:
            raise BrightfieldError(f"A spectrum to be normalised must not be dark. ({self.name})")
        return self * (total / self.integral())


def common(*spectra: Spectrum) -> np.ndarray:
    """The wavelengths at which a product of spectra is taken: all of theirs in the range that they share, and whole
    nanometres in between. Raises BrightfieldError where they share none."""
    low = max(s.wavelength_nm[0] for s in spectra)
    high = min(s.wavelength_nm[-1] for s in spectra)
    if not low < high:
        ranges = ", ".join(f"{s.wavelength_nm[0]:g} to {s.wavelength_nm[-1]:g} nm" for s in spectra)
        raise BrightfieldError(f"Spectra must overlap to be multiplied; got {ranges}.")
    every = np.concatenate(
        [np.arange(np.ceil(low), high, STEP), *(s.wavelength_nm for s in spectra), [low, high]]
    )
    return np.unique(every[(every >= low) & (every <= high)])


def from_measurement(found: Measurement, column: str = "") -> Spectrum:
    """A column of a spectrum that was read from a file; without a name, the only one. BrightfieldError otherwise."""
    name = Path(found.file).name
    if found.kind is not Kind.SPECTRUM or found.wavelength_nm is None:
        raise BrightfieldError(
            f"A spectrum was expected; the file holds a {found.kind.value}. ({found.file})"
        )
    columns = {c.name: c for c in found.values}
    if (not column and len(columns) > 1) or (column and column not in columns):
        raise BrightfieldError(
            f"The file has the spectra {', '.join(columns)}; name one of them; got {column!r}. ({found.file})"
        )
    chosen = columns[column] if column else found.values[0]
    given = np.isfinite(chosen.values)
    return Spectrum(found.wavelength_nm[given], chosen.values[given], chosen.unit or "1", name)
