"""UTIA's anisotropic BRDFs (.bin): red, green and blue planes of 288 x 288 64-bit numbers, 1/sr.

A row is a direction of the light, a column one of the camera: theta 0, 15 ... 75° slow, phi 0, 7.5 ... 352.5° fast in
both. The same picture in one OpenEXR image is read by ``measurement_of``.
Filip, Vávra: Template-based sampling of anisotropic BRDFs. Computer Graphics Forum 33(7), 2014.
"""

from pathlib import Path

import numpy as np

from interchange.brdf.tabulated_goniometer import TabulatedGoniometer
from interchange.formats.base import Format, Options
from interchange.formats.binary_file import bytes_of
from interchange.measurement import Column, Kind, Measurement
from interchange.problems import FileError, Problem, Severity, Where
from interchange.table import Table

THETA, PHI = np.radians(15.0 * np.arange(6)), np.radians(7.5 * np.arange(48))
SIDE = len(THETA) * len(PHI)
BYTES = 3 * SIDE * SIDE * 8


class Utia(Format):
    name = "UTIA BRDF"
    extensions = (".bin",)
    holds = "measurement"

    def read(self, path: Path, options: Options) -> Measurement:
        return read(path)


def read(path: Path | str) -> Measurement:
    """Every pair of directions; ``model`` is the table itself. Raises FileError."""
    path = Path(path)
    data = bytes_of(path)
    if len(data) != BYTES:
        message = f"UTIA's BRDF must be 3 x {SIDE} x {SIDE} numbers of 8 bytes, {BYTES} bytes; there are {len(data)}."
        raise FileError(Problem(message, Where(str(path))))
    return measurement_of(np.moveaxis(np.frombuffer(data, "<f8").reshape(3, SIDE, SIDE), 0, -1), str(path))


def measurement_of(picture: np.ndarray, file: str = "") -> Measurement:
    """The measurement of a (288, 288, 3) picture, light in rows, camera in columns, 1/sr. Raises FileError.

    Negative values are noise and stay; in the model they are 0, and a note counts them.
    """
    where = Where(file)
    if picture.shape != (SIDE, SIDE, 3):
        raise FileError(Problem(f"The picture must be {SIDE} x {SIDE} x 3; got {picture.shape}.", where))
    f = np.asarray(picture, np.float64).reshape(-1, 3)
    use = (np.abs(f) < 1e30).all(axis=1)  # neither infinite nor beyond single precision
    if not use.any():
        raise FileError(Problem("The file must hold numbers; none of them is finite.", where))
    angles = (a.ravel() for a in np.meshgrid(THETA, PHI, THETA, PHI, indexing="ij"))
    low, lost = int((f < 0).any(axis=1).sum()), int((~use).sum())
    said = [
        (low, f"{low} of {len(f)} readings are negative; they are kept, and 0 in the model"),
        (lost, f"{lost} readings hold no finite number; they are left out, and 0 in the model"),
        (1, "Nothing was measured beyond 75° from the normal; the model holds the value at 75°"),
    ]
    held = np.maximum(np.where(use[:, None], f, 0.0), 0.0)
    return Measurement(
        Kind.BRDF,
        tuple(
            Column(name, "rad", a)
            for name, a in zip(("theta_i", "phi_i", "theta_s", "phi_s"), angles, strict=True)
        ),
        tuple(Column(name, "1/sr", f[:, c]) for c, name in enumerate("RGB")),
        notes=tuple(Problem(f"{text}.", where, Severity.NOTE) for count, text in said if count),
        file=file,
        use=use,
        model=TabulatedGoniometer((1.0, 1.0, 1.0), THETA[-1], THETA[-1], 6, 48, 6, 48, 0, Table(held)),
    )
