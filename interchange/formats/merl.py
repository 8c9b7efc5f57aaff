"""MERL's isotropic BRDFs (.binary): three 32-bit counts, then red, green and blue planes of 64-bit numbers.

    f = s_c v,    s = 1/1500, 1.15/1500, 1.66/1500

The counts are those of theta_h, theta_d and phi_d (90, 90, 180 in the published files), phi_d runs fastest; a number
below zero says that its bin was never seen. Matusik et al.: A data-driven reflectance model. SIGGRAPH 2003.
"""

from pathlib import Path

import numpy as np

from interchange.brdf.tabulated_isotropic import TabulatedIsotropic
from interchange.formats.base import Format, Options
from interchange.formats.binary_file import bytes_of
from interchange.measurement import Column, Kind, Measurement, from_half_difference
from interchange.problems import FileError, Problem, Severity, Where
from interchange.table import Table

SCALE = np.array([1.0, 1.15, 1.66]) / 1500
MAX_BINS = (1 << 24) - 1
LARGEST = 1e30


class Merl(Format):
    name = "MERL BRDF"
    extensions = (".binary",)
    holds = "measurement"

    def read(self, path: Path, options: Options) -> Measurement:
        return read(path)


def read(path: Path | str) -> Measurement:
    """Every bin with the angles of its middle; ``model`` is the table itself. Raises FileError.

    Bins that were never seen have ``use`` False and keep their number; in the model they take the value of the nearest
    bin that was, so that the last ones before the horizon are not mixed with nothing.
    """
    path = Path(path)
    where = Where(str(path))
    data = bytes_of(path)
    counts = np.frombuffer(data[: min(len(data), 12)].ljust(12, b"\0"), "<i4")
    bins = int(np.prod(counts.astype(np.int64))) if (counts > 0).all() and (counts <= 4096).all() else 0
    if not 0 < bins <= MAX_BINS:
        got = " x ".join(map(str, counts))
        message = f"The file must begin with three counts of bins, 90 x 90 x 180, say; got {got}."
        raise FileError(Problem(message, where))
    expected = 12 + 24 * bins
    if len(data) != expected:
        got = " x ".join(map(str, counts))
        message = f"{got} bins of three channels must take {expected} bytes; there are {len(data)}."
        raise FileError(Problem(message, where))
    stored = np.frombuffer(data, "<f8", offset=12).reshape(3, bins).T
    sane = np.abs(stored) < LARGEST  # neither infinite nor beyond single precision
    finite = sane.all(axis=1)
    f = np.where(sane, stored, -1.0) * SCALE
    use = finite & (f >= 0).all(axis=1)
    if not use.any():
        raise FileError(Problem("One bin at least must have been seen; every number is below zero.", where))
    h, d, p = (int(n) for n in counts)
    i, j, k = (a.ravel() for a in np.indices((h, d, p)))
    angles = ((i + 0.5) / h) ** 2 * np.pi / 2, (j + 0.5) / d * np.pi / 2, (k + 0.5) / p * np.pi
    wi, wo = from_half_difference(*angles)
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    return Measurement(
        Kind.BRDF,
        tuple(Column(n, "rad", a) for n, a in zip(("theta_h", "theta_d", "phi_d"), angles, strict=True)),
        tuple(Column(name, "1/sr", f[:, c]) for c, name in enumerate("RGB")),
        notes=tuple(_notes(use, above, finite, where)),
        file=str(path),
        use=use,
        model=TabulatedIsotropic((1.0, 1.0, 1.0), h, d, p, Table(filled(f, use, (h, d, p)))),
    )


def filled(f: np.ndarray, use: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """``f`` (N, 3) with each row that is not to be used replaced by the nearest that is, in bins of ``shape``."""
    from scipy.ndimage import distance_transform_edt

    if use.all():
        return f
    nearest = distance_transform_edt(~use.reshape(shape), return_distances=False, return_indices=True)
    return np.asarray(f[np.ravel_multi_index(tuple(nearest), shape).ravel()])


def _notes(use: np.ndarray, above: np.ndarray, finite: np.ndarray, where: Where) -> list[Problem]:
    unseen = int((~use & above).sum())
    said = [
        (unseen, f"{unseen} of {int(above.sum())} bins above the surface were never seen; they are left out"),
        (int((~finite).sum()), f"{int((~finite).sum())} bins hold no finite number"),
    ]
    return [Problem(f"{text}.", where, Severity.NOTE) for count, text in said if count]
