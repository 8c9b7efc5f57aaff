"""BRDFs of the RGL material database (.bsdf): tensor files in the parameterisation of Dupuy and Jakob 2018.

Files with full spectra and files with three channels are read. ``brdf.rgl`` is the formula; here the map of the unit
square onto half vectors goes forward, which tells where each number of the table was measured.
"""

from pathlib import Path

import numpy as np

from interchange.brdf.rgl import Rgl, sums
from interchange.formats.base import Format, Options
from interchange.formats.tensor_file import MAGIC, read_tensors
from interchange.measurement import Column, Kind, Measurement, unit_vectors
from interchange.problems import BrightfieldError, FileError, Problem, Severity, Where
from interchange.reflectance import ReflectanceSamples

NAMES = ("phi_i", "theta_i", "ndf", "sigma", "vndf", "jacobian")
MAX_READINGS = 1 << 23
LARGEST = 1e30


class RglFormat(Format):
    name = "RGL BRDF"
    extensions = (".bsdf",)
    holds = "measurement"

    def recognises(self, head: bytes) -> bool:
        return head.startswith(MAGIC)

    def read(self, path: Path, options: Options) -> Measurement:
        return read(path)


def read(path: Path | str) -> Measurement:
    """Every number of the table with the directions that it stands for; ``model`` is the table itself, its spectra
    averaged over the bands of ``ReflectanceSamples.bands``, or None where they hold no wavelength. Raises FileError."""
    path = Path(path)
    where = Where(str(path))
    fields = read_tensors(path)
    spectra, nm = _spectra(fields, where)
    phi_i, theta_i, ndf, sigma, vndf = (np.asarray(fields[n], np.float64) for n in NAMES[:5])
    jacobian = bool(fields["jacobian"].ravel()[0])
    wi, wo, f = data_points(phi_i, theta_i, ndf, sigma, vndf, spectra, jacobian)
    use = np.isfinite(f).all(axis=1) & (wo[:, 2] > 1e-3) & (wi[:, 2] > 1e-3)
    channels = tuple(f"{w:g} nm" for w in nm) if nm is not None else ("R", "G", "B")
    model, said = None, []
    try:
        three = _bands(spectra, nm, str(path))
    except BrightfieldError as error:
        said.append((1, f"There is no model of it in three channels: {str(error).rstrip('.')}"))
    else:
        low, lost = (int(bad.any(axis=-1).sum()) for bad in (three < 0, ~(np.abs(three) < LARGEST)))
        said.append(
            (low, f"{low} of {three.size // 3} cells are negative; they are kept, and 0 in the model")
        )
        said.append((lost, f"{lost} cells hold no finite number; they are left out, and 0 in the model"))
        held = np.where(np.abs(three) < LARGEST, np.maximum(three, 0.0), 0.0)
        reach = f"{np.degrees(theta_i[-1]):.3g}° of incidence"
        said.append((1, f"Nothing was measured beyond {reach}; the model holds what is there"))
        model = Rgl.of(theta_i, phi_i, ndf, sigma, vndf, held, jacobian)
    return Measurement(
        Kind.BRDF,
        tuple(
            Column(name, "rad", angle)
            for name, angle in zip(
                ("theta_i", "phi_i", "theta_s", "phi_s"), (*_angles(wi), *_angles(wo)), strict=True
            )
        ),
        tuple(Column(name, "1/sr", f[:, k]) for k, name in enumerate(channels)),
        wavelength_nm=nm,
        comments=_description(fields),
        notes=tuple(Problem(f"{text}.", where, Severity.NOTE) for count, text in said if count),
        file=str(path),
        use=use,
        model=model,
    )


def _bands(spectra: np.ndarray, nm: np.ndarray | None, file: str) -> np.ndarray:
    """(P, T, n, n, 3) means over the bands of red, green and blue."""
    cells = np.moveaxis(spectra, 2, -1)
    flat = cells.reshape(-1, cells.shape[-1])
    anywhere = np.broadcast_to([0.0, 0.0, 1.0], (len(flat), 3))
    bands = ReflectanceSamples(anywhere, anywhere, flat, wavelength_nm=nm, file=file).bands()
    return np.asarray(bands.f.reshape(*cells.shape[:-1], 3))


def _spectra(fields: dict[str, np.ndarray], where: Where) -> tuple[np.ndarray, np.ndarray | None]:
    """(phi_i, theta_i, wavelength, n, n) and the wavelengths, or three channels without any; the shapes are checked."""
    spectral = "spectra" in fields
    missing = [n for n in (*NAMES, *(("wavelengths",) if spectral else ("rgb",))) if n not in fields]
    if missing:
        raise FileError(Problem(f"A BRDF of the RGL database must have {', '.join(missing)}.", where))
    spectra = fields["spectra" if spectral else "rgb"]
    nm = np.asarray(fields["wavelengths"], np.float64).ravel() if spectral else None
    p, t = fields["phi_i"].size, fields["theta_i"].size
    k = nm.size if nm is not None else 3
    n = spectra.shape[-1] if spectra.ndim else 0
    wanted = {"spectra" if spectral else "rgb": (p, t, k, n, n), "vndf": (p, t, *fields["vndf"].shape[2:])}
    wrong = [
        f"{name} {fields[name].shape} instead of {shape}"
        for name, shape in wanted.items()
        if fields[name].shape != shape or fields[name].ndim != len(shape)
    ]
    wrong += [
        f"{n} {fields[n].shape}" for n in ("ndf", "sigma", "vndf") if min(fields[n].shape[-2:], default=0) < 2
    ]
    wrong += [f"{n} with {fields[n].ndim} dimensions" for n in ("ndf", "sigma") if fields[n].ndim != 2]
    wrong += [f"vndf with {fields['vndf'].ndim} dimensions"] * (fields["vndf"].ndim != 4)
    if wrong or n < 2 or not p * t:
        raise FileError(
            Problem(f"The arrays of an RGL file must agree; got {'; '.join(wrong) or 'none'}.", where)
        )
    if p * t * n * n > MAX_READINGS:
        raise FileError(Problem(f"There must be up to {MAX_READINGS} cells; got {p * t * n * n}.", where))
    tables = [np.asarray(fields[name], np.float64) for name in ("ndf", "sigma", "vndf")]
    if any(not np.isfinite(a).all() or (a < 0).any() for a in tables) or not tables[2].any(axis=(2, 3)).all():
        raise FileError(Problem("ndf, sigma and vndf must be finite, not negative, and not all zero.", where))
    for name in ("theta_i", "phi_i"):
        if not (np.diff(fields[name].ravel()) > 0).all():
            raise FileError(Problem(f"{name} must increase.", where))
    if nm is not None and not ((np.diff(nm) > 0).all() and nm[0] > 0):
        raise FileError(Problem("wavelengths must be positive and increase.", where))
    with np.errstate(invalid="ignore"):  # NaN stays NaN
        return np.asarray(spectra, np.float64), nm


def _description(fields: dict[str, np.ndarray]) -> tuple[str, ...]:
    text = fields.get("description", np.zeros(0, np.uint8)).tobytes().decode("utf8", "replace").strip("\0 \n")
    return (text,) if text else ()


def _angles(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.arctan2(np.hypot(w[:, 0], w[:, 1]), w[:, 2]), np.arctan2(w[:, 1], w[:, 0])


def data_points(
    phi_i: np.ndarray,
    theta_i: np.ndarray,
    ndf: np.ndarray,
    sigma: np.ndarray,
    vndf: np.ndarray,
    spectra: np.ndarray,
    jacobian: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """``wi``, ``wo`` (N, 3) and ``f`` (N, K) 1/sr of every cell of ``spectra`` (P, T, K, n, n).

    NaN where ``wo`` is below the surface.
    """
    isotropic = len(phi_i) <= 2
    n = spectra.shape[-1]
    v, u = (a.ravel() / (n - 1) for a in np.indices((n, n)))
    points: list[list[np.ndarray]] = [[], [], []]
    density, columns, rows = sums(vndf)
    for p, t in np.ndindex(len(phi_i), len(theta_i)):
        x, y = mapped(u, v, density[p, t], columns[p, t], rows[p, t])
        m = unit_vectors(x**2 * np.pi / 2, (2 * y - 1) * np.pi + (phi_i[p] if isotropic else 0.0))
        i = unit_vectors(theta_i[t], phi_i[p])
        o = 2 * (m @ i)[:, None] * m - i
        f = np.moveaxis(spectra[p, t], 0, -1).reshape(n * n, -1)
        if jacobian:
            at = np.array([np.sqrt(theta_i[t] * 2 / np.pi)]), np.array([(phi_i[p] + np.pi) / (2 * np.pi)])
            f = f * (bilinear(ndf, x, y) / (4 * np.maximum(bilinear(sigma, *at), 1e-12)))[:, None]
        with np.errstate(all="ignore"):
            f = np.where(o[:, 2:] > 0, f / o[:, 2:], np.nan)
        for store, value in zip(points, (np.broadcast_to(i, o.shape), o, f), strict=True):
            store.append(value)
    wi, wo, values = (np.concatenate(p) for p in points)
    return wi, wo, values


def mapped(
    u: np.ndarray, v: np.ndarray, density: np.ndarray, columns: np.ndarray, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Where the map takes (u, v) of the unit square: the row by its sums, then the column, x and y in [0, 1]."""
    k = np.clip(np.searchsorted(rows, v, side="right") - 1, 0, len(rows) - 2)
    y = _share(columns[k, -1], columns[k + 1, -1], v - rows[k])
    line = (1 - y)[:, None] * columns[k] + y[:, None] * columns[k + 1]
    target = u * line[:, -1]
    j = np.clip((line <= target[:, None]).sum(axis=1) - 1, 0, line.shape[1] - 2)
    c0, c1 = ((1 - y) * density[k, j + s] + y * density[k + 1, j + s] for s in (0, 1))
    x = _share(c0, c1, target - line[np.arange(len(j)), j])
    return (j + x) / (density.shape[1] - 1), (k + y) / (density.shape[0] - 1)


def _share(a: np.ndarray, b: np.ndarray, area: np.ndarray) -> np.ndarray:
    """x in [0, 1] with a x + (b - a) x² / 2 = area."""
    root = np.sqrt(np.maximum(a * a + 2 * (b - a) * area, 0))
    return np.clip(2 * area / np.maximum(a + root, 1e-300), 0, 1)


def bilinear(grid: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Values of ``grid`` (ny, nx), which holds its ends, at x and y in [0, 1]."""
    ny, nx = grid.shape
    px, py = np.clip(x, 0, 1) * (nx - 1), np.clip(y, 0, 1) * (ny - 1)
    j, k = np.minimum(px.astype(int), nx - 2), np.minimum(py.astype(int), ny - 2)
    a, b = px - j, py - k
    return (grid[k, j] * (1 - a) + grid[k, j + 1] * a) * (1 - b) + (
        grid[k + 1, j] * (1 - a) + grid[k + 1, j + 1] * a
    ) * b
