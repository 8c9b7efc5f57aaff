"""Measured reflectance as a BRDF that renderers draw: a table on a regular grid.

What a file itself tabulates (MERL, UTIA, RGL) is taken as it is. Scattered samples are spread over a grid of half and
difference angles (one azimuth of the light: isotropic) or of the goniometer's own angles (several: anisotropic), by
least squares with the model's own interpolation, relative to the size of each value:

    min_x  |(f_0 W sinh(x) - f) / (|f| + f_0)|² + smoothness |S x|²

The unknown x is the value's magnitude, so that a highlight counts as one step among many. ``S`` are second
differences, and a little of first ones; they fill nodes that no sample touches, within the range of the samples, and
hardly move the others.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from analysis.projection.gridding import along, bends, smooth_fit, steps
from analysis.projection.residual import prepared, residual
from interchange.brdf import Brdf
from interchange.brdf.tabulated_goniometer import TabulatedGoniometer
from interchange.brdf.tabulated_isotropic import TabulatedIsotropic
from interchange.measurement import Kind, Measurement
from interchange.problems import BrightfieldError, Problem, Severity, Where
from interchange.reflectance import ReflectanceSamples
from interchange.table import Table

STEPS = 5
MOST = 16_000  # rows of a goniometer's table, unless asked for
FLAT = 0.1  # weight of first differences: what lies far from every sample goes on level
Grid = TabulatedIsotropic | TabulatedGoniometer


@dataclass(frozen=True)
class Tabulated:
    """``brdf``: the model; ``residual`` (3,): its rms error over the samples relative to their rms, NaN where a file's
    own table was taken; ``filled``: share of the table's rows that no sample touches; ``notes``: what was done."""

    brdf: Brdf
    residual: np.ndarray
    filled: float
    notes: tuple[Problem, ...]


def to_model(
    data: ReflectanceSamples | Measurement,
    shape: tuple[int, ...] = (),
    reciprocal: bool = False,
    symmetric: bool = True,
    smoothness: float = 1e-2,
) -> Tabulated:
    """A table of ``data``.

    ``shape``: bins of theta_h, theta_d, phi_d (isotropic) or nodes of theta_i, phi_i, theta_o, phi_o; by the number of
    samples if not given. ``reciprocal``: use every sample with light and camera exchanged, too, which fills what an
    instrument cannot reach (half and difference angles are reciprocal anyway). ``symmetric``: an isotropic surface is
    its own mirror image. Raises BrightfieldError for no usable sample or a shape of another length.
    """
    if isinstance(data, Measurement):
        if data.model is not None and not shape:
            return Tabulated(data.model, np.full(3, np.nan), 0.0, data.notes)
        if data.kind is not Kind.BRDF:
            raise BrightfieldError(f"A BRDF was expected; this is a {data.kind.value}. ({data.file})")
        data = ReflectanceSamples.from_measurement(data)
    samples = prepared(data)
    where = Where(samples.file)
    azimuth = _azimuth(samples.wi)[samples.theta[0] > 1e-3]
    isotropic = len(shape) == 3 if shape else len(np.unique(np.round(azimuth, 3) % 6.283)) <= 1
    notes = [
        Problem(f"{int(n)} values of {c} are negative.", where, Severity.NOTE) for c, n in _negatives(samples)
    ]
    known = samples.mirrored() if reciprocal else samples
    if isotropic:
        if symmetric:
            known = _with_mirror_image(known)
        halves = _half_angles(shape, len(samples))
        model: Grid = halves
        smooth = _isotropic_bends(halves)
    else:
        model = plain = _goniometer(shape, samples)
        smooth = _goniometer_bends(plain)
    values, filled = _on_nodes(model, known, smooth, smoothness)
    low = int((values < 0).any(axis=1).sum())
    if low:
        text = f"{low} of {len(values)} rows of the table came out negative; they are 0."
        notes.append(Problem(text, where, Severity.NOTE))
    brdf = replace(model, values=Table(np.maximum(values, 0.0)))
    notes.append(_beyond(samples, where))
    error = residual(brdf, samples)
    notes.append(
        Problem(
            f"The table of {len(values)} rows leaves {100 * error.max():.2g} % (rms, of the data's rms); "
            f"{100 * filled:.3g} % of its rows lie between or beyond the samples.",
            where,
            Severity.NOTE,
        )
    )
    return Tabulated(brdf, error, filled, (*samples.notes, *notes))


def _negatives(samples: ReflectanceSamples) -> list[tuple[str, int]]:
    return [(c, n) for c, n in zip(samples.channels, samples.negatives, strict=True) if n]


def _beyond(samples: ReflectanceSamples, where: Where) -> Problem:
    i, o = (np.degrees(t.max()) for t in samples.theta)
    text = (
        f"Nothing was measured beyond {i:.3g}° of the light and {o:.3g}° of the camera; the table goes on smoothly, "
        "within the range of the samples."
    )
    return Problem(text, where, Severity.NOTE)


def _with_mirror_image(samples: ReflectanceSamples) -> ReflectanceSamples:
    """The samples and their mirror images in the plane of x and z."""
    flip = np.array([1.0, -1.0, 1.0])
    twice = np.arange(2 * len(samples)) % len(samples)
    both = samples.take(twice)
    sign = np.where(np.arange(2 * len(samples)) < len(samples), 1.0, flip[1])[:, None] ** np.array([0, 1, 0])
    return replace(both, wi=both.wi * sign, wo=both.wo * sign)


def _half_angles(shape: tuple[int, ...], count: int) -> TabulatedIsotropic:
    if not shape:
        k = min(np.cbrt(count / 1500), 1.8)  # at most some 16 000 rows, which take seconds; more on request
        shape = (int(np.clip(24 * k, 8, 90)), int(np.clip(10 * k, 4, 90)), int(np.clip(12 * k, 4, 180)))
    h, d, p = shape
    return TabulatedIsotropic((1.0, 1.0, 1.0), h, d, p, Table(np.zeros(h * d * p)))


def _goniometer(shape: tuple[int, ...], samples: ReflectanceSamples) -> TabulatedGoniometer:
    theta_i, theta_o = (float(np.clip(t.max(), 0.1, np.pi / 2)) for t in samples.theta)
    if not shape:
        angles = [
            t for w, t in zip((samples.wi, samples.wo), samples.theta, strict=True) for t in (t, _azimuth(w))
        ]
        counts = np.array([len(np.unique(np.round(a, 3))) for a in angles], float)
        counts = np.clip(counts, (2, 4, 2, 4), (19, 48, 19, 48))
        most = min(len(samples), MOST)
        shape = tuple(
            int(n) for n in np.maximum(counts * min((most / counts.prod()) ** 0.25, 1.0), (2, 4, 2, 4))
        )
    if len(shape) != 4:
        raise BrightfieldError(
            f"A table's shape must have 3 numbers (isotropic) or 4 (goniometer); got {len(shape)}."
        )
    rows = int(np.prod(shape))
    return TabulatedGoniometer((1.0, 1.0, 1.0), theta_i, theta_o, *shape, values=Table(np.zeros(rows)))


def _azimuth(w: np.ndarray) -> np.ndarray:
    return np.arctan2(w[:, 1], w[:, 0])


def _on_nodes(
    model: Grid, samples: ReflectanceSamples, smooth: sparse.csr_matrix, smoothness: float
) -> tuple[np.ndarray, float]:
    """Values (rows, 3) of the table, and the share of rows that no sample touches."""
    corners = model.corners(tuple(samples.wi.T), tuple(samples.wo.T))
    count = len(samples)
    rows = np.concatenate([np.broadcast_to(np.asarray(r, np.float64), count) for r, _ in corners]).astype(
        np.int64
    )
    weights = np.concatenate([np.broadcast_to(w, count) for _, w in corners])
    place = np.tile(np.arange(count), len(corners))
    spread = sparse.csr_matrix((weights, (place, rows)), (count, len(model.values)))
    touched = np.asarray(spread.sum(axis=0)).ravel() > 0.05
    values = np.stack([_settled(spread, f, smooth, smoothness) for f in samples.f.T], axis=1)
    guessed = np.clip(values, samples.f.min(axis=0), samples.f.max(axis=0))
    return np.where(touched[:, None], values, guessed), float(1 - touched.mean())


def _settled(
    spread: sparse.csr_matrix, f: np.ndarray, smooth: sparse.csr_matrix, smoothness: float
) -> np.ndarray:
    """Node values of one channel, by Gauss-Newton steps on their magnitudes; the best of the steps."""
    small = max(0.1 * float(np.median(np.abs(f))), 1e-3 * float(np.abs(f).max()), 1e-9)
    size = np.abs(f) + small
    x = smooth_fit(spread, np.arcsinh(f / small)[:, None], smooth, smoothness, np.ones((len(f), 1)))[:, 0]
    best, least = x, np.inf
    for _ in range(STEPS):
        left = f - small * (spread @ np.sinh(x))
        cost = float(np.sum((left / size) ** 2))
        settled = 0.98 * least < cost <= least
        if cost < least:
            best, least = x, cost
        if settled:
            break
        slope = spread @ sparse.diags(small * np.cosh(x))
        weight = (1 / size)[:, None]
        x = smooth_fit(slope.tocsr(), (left + slope @ x)[:, None], smooth, smoothness, weight)[:, 0]
        x = np.clip(x, best - 1.0, best + 1.0)  # a step of a factor e at most
    return np.asarray(small * np.sinh(best))


def _isotropic_bends(model: TabulatedIsotropic) -> sparse.csr_matrix:
    sizes = (model.n_theta_h, model.n_theta_d, model.n_phi_d)
    return _differences(sizes, (2,))


def _goniometer_bends(model: TabulatedGoniometer) -> sparse.csr_matrix:
    sizes = (model.n_theta_i, model.n_phi_i, model.n_theta_o, model.n_phi_o)
    return _differences(sizes, (1, 3))


def _differences(sizes: tuple[int, ...], periodic: tuple[int, ...]) -> sparse.csr_matrix:
    """Second differences along every axis, and first ones at a tenth of their weight."""
    parts = []
    for axis, n in enumerate(sizes):
        parts.append(along(axis, sizes, bends(n, axis in periodic)))
        parts.append(FLAT * along(axis, sizes, steps(n, axis in periodic)))
    return sparse.vstack(parts).tocsr()
