"""Characterise a camera by EMVA 1288, release 4 Linear, from images at several exposures, bright and dark.

    µ_y - µ_dark = R µ_p          R: slope over 0 .. 70 % of saturation, through the origin
    σ²_y - σ²_dark = K (µ_y - µ_dark)       the photon transfer curve, alike;   η = R / K
    σ_d² = (σ²_y.dark(t = 0) - 1/12) / K²,  µ_I = slope of the dark signal over the exposure time / K
    DSNU² = s²_dark / K²,   PRNU² = (s²_50 - s²_dark) / (µ_50 - µ_dark)²
    split over an M x N image of row averages s²_r, column averages s²_c and what is left of each pixel, s²_p:
    row² = s²_r - s²_p / N,   column² = s²_c - s²_p / M,   pixel² = s²_p - σ²/repeats
    LE: relative deviations from the line through 5 .. 95 % of saturation that keeps them small

σ² are variances between repeats, s² those over the pixels of their mean less what the noise leaves in it.
Uncertainties are the spread of the results over ``BLOCKS`` parts of the image, over its root.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from interchange.formats.emva_sheet import DataSheet, Result
from interchange.problems import BrightfieldError

PARTS = ("row", "col", "pixel")
BLOCKS = 16  # stripes of rows
QUANTIZATION = 1 / 12  # DN²
LEAST_DARK = 0.24  # DN²: below, the converter hides the noise (release 4, section 6.6)


@dataclass(frozen=True, eq=False)
class Level:
    """One exposure, reduced: sums over the pixels of ``BLOCKS`` stripes of rows."""

    t_exp: float  # s
    photons: float  # a pixel; 0 in the dark, NaN where not known
    repeats: int
    pixels: np.ndarray  # (B,) in each stripe
    mean: np.ndarray  # (B,) DN
    temporal: np.ndarray  # (B,) DN², σ²
    spatial: np.ndarray  # (B,) DN² over the pixels of the mean image, about the mean of the whole of it
    split: (
        np.ndarray
    )  # (B + 1, 3) DN² of rows, columns and pixels: of each stripe, and last of the whole image

    @property
    def mu(self) -> float:
        return float(np.average(self.mean, weights=self.pixels))


def level(t_exp: float, photons: float, images: Iterable[np.ndarray]) -> Level:
    """Reduce two or more images (H, W) of one exposure. Images may come one by one; only sums are kept."""
    count, total, squares, means = 0, None, None, []
    for image in images:
        y = np.asarray(image, np.float64)
        if y.ndim != 2 or (total is not None and y.shape != total.shape):
            raise BrightfieldError(f"Images must be grey and of one size; got {y.shape}.")
        total = y.copy() if total is None else total + y
        squares = y * y if squares is None else squares + y * y
        means.append(y.mean())
        count += 1
    if total is None or squares is None or count < 2:
        raise BrightfieldError(f"An exposure needs two images or more; got {count}.")
    average = total / count
    drift = float(np.var(means, ddof=1))  # of the lamp between repeats, which is no noise of a pixel
    variance = (squares - count * average**2) / (count - 1) - drift
    about = average.mean()
    rows = np.array_split(np.arange(len(average)), min(BLOCKS, len(average)))
    return Level(
        t_exp,
        photons,
        count,
        pixels=np.array([average[r].size for r in rows], np.float64),
        mean=np.array([average[r].mean() for r in rows]),
        temporal=np.array([variance[r].mean() for r in rows]),
        spatial=np.array([((average[r] - about) ** 2).mean() for r in rows]),
        split=np.array(
            [
                split(part) - (0, 0, noise.mean() / count)
                for part, noise in [*((average[r], variance[r]) for r in rows), (average, variance)]
            ]
        ),
    )


def split(image: np.ndarray) -> np.ndarray:
    """(3,) variances of the rows, the columns and the pixels of an image (M, N) that is the sum of the three.

    Unbiased; the three linear equations of release 4 of the standard, section 4, to 1 / (M N). NaN of a single row or
    column. A variance may come out below zero where there is none.
    """
    M, N = image.shape
    if M < 2 or N < 2:
        return np.full(3, np.nan)
    row, column = image.mean(axis=1), image.mean(axis=0)
    left = ((image - row[:, None] - column + row.mean()) ** 2).sum() / ((M - 1) * (N - 1))
    return np.array([row.var(ddof=1) - left / N, column.var(ddof=1) - left / M, left])


@dataclass(frozen=True, eq=False)
class Curve:
    """The levels as arrays over exposures: what the standard's figures show."""

    t_exp: np.ndarray
    photons: np.ndarray
    signal: np.ndarray  # µ_y - µ_dark, DN
    variance: np.ndarray  # σ²_y - σ²_dark, DN²
    total_variance: np.ndarray  # σ²_y, DN²
    saturation: int  # index of the last exposure below saturation: the variance's maximum


@dataclass(frozen=True, eq=False)
class Characterisation:
    sheet: DataSheet
    curve: Curve
    linearity: np.ndarray  # relative deviation from the line at each exposure; NaN outside 5 .. 95 %
    notes: tuple[str, ...] = field(default=())


def characterise(
    bright: Sequence[Level],
    dark: Sequence[Level],
    bits: int,
    pixel_um: float = 0.0,
    wavelength_nm: float = 0.0,
    serial_number: str = "",
    size: tuple[int, int] = (0, 0),
) -> Characterisation:
    """The data sheet of a camera, from its ``bright`` and ``dark`` levels (one of them dark at least an exposure time).

    Raises BrightfieldError where the levels do not reach: fewer than three below saturation, no dark level of a
    bright one's exposure time, no rise of the noise with the signal.
    """
    curve = transfer_curve(bright, dark, None)
    values = _results(bright, dark, curve, None)
    blocks = len(bright[0].mean)
    parts = [
        _results(bright, dark, transfer_curve(bright, dark, b, curve.saturation), b) for b in range(blocks)
    ]
    results = {}
    for symbol, value in values.items():
        spread = np.array([p.get(symbol, np.nan) for p in parts])
        known = len(spread) > 3 and np.isfinite(spread).all()
        counted = symbol not in (
            "mu_p.sat",
            "LE_min",
            "LE_max",
        )  # steps and extremes, which parts do not average to
        sigma = float(spread.std(ddof=1) / np.sqrt(len(spread))) if known and counted else None
        results[symbol] = Result(float(value), sigma)
    notes = _notes(values, curve)
    sheet = DataSheet(
        results,
        bits=bits,
        serial_number=serial_number,
        pixel_um=pixel_um,
        wavelength_nm=wavelength_nm,
        width=size[0],
        height=size[1],
    )
    return Characterisation(sheet, curve, _deviations(curve), notes)


def transfer_curve(
    bright: Sequence[Level], dark: Sequence[Level], block: int | None = None, saturation: int | None = None
) -> Curve:
    """Signal and variance above the dark ones of the same exposure time, in order of signal; of one stripe or all."""
    if not dark:
        raise BrightfieldError("A characterisation needs dark images; there are none.")
    if len(bright) < 3:
        raise BrightfieldError(
            f"A characterisation needs three bright exposures or more; there are {len(bright)}."
        )
    rows = []
    for b in bright:
        near = min(dark, key=lambda d: abs(d.t_exp - b.t_exp))
        if abs(near.t_exp - b.t_exp) > 1e-6 * max(b.t_exp, 1e-9):
            raise BrightfieldError(
                f"The exposure time {b.t_exp:g} s needs dark images; the nearest have {near.t_exp:g} s."
            )
        variance = _at(b, "temporal", block)
        signal = _at(b, "mean", block) - _at(near, "mean", block)
        rows.append(
            (signal, b.t_exp, b.photons, variance - _at(near, "temporal", block), variance, b.mu - near.mu)
        )
    signal, t, photons, above, variance, _ = np.array(sorted(rows, key=lambda r: r[-1])).T
    top = int(np.argmax(variance)) if saturation is None else saturation
    return Curve(t, photons, signal, above, variance, top)


def _at(of: Level, name: str, block: int | None) -> float:
    values: np.ndarray = getattr(of, name)
    return float(np.average(values, weights=of.pixels)) if block is None else float(values[block])


def _results(
    bright: Sequence[Level], dark: Sequence[Level], curve: Curve, block: int | None
) -> dict[str, float]:
    use = curve.signal <= 0.7 * curve.signal[curve.saturation]
    x, y = curve.signal[use], curve.variance[use]
    if len(x) < 2 or (x * y).sum() <= 0:
        raise BrightfieldError(
            "The noise must rise with the signal over two exposures below 70 % of saturation."
        )
    K = float((x * y).sum() / (x * x).sum())
    found = {"K": K}
    times = np.array([d.t_exp for d in dark])
    mean = np.array([_at(d, "mean", block) for d in dark])
    variance = np.array([_at(d, "temporal", block) for d in dark])
    first = int(np.argmin(times))
    if len(np.unique(times)) > 2:
        slope, offset = np.polyfit(times, mean, 1)
        slope_var, dark_var = np.polyfit(times, variance, 1)
        found["mu_I.mean"] = float(slope / K)
        if slope_var > 0:
            found["mu_I.var"] = float(slope_var / K**2)
    else:
        offset, dark_var = mean[first], variance[first]
    dark_var = max(float(dark_var), LEAST_DARK)
    found["mu_y.dark"] = float(offset)
    found["sigma_y.dark"] = float(np.sqrt(dark_var))
    found["sigma_d"] = float(np.sqrt(dark_var - QUANTIZATION) / K)
    found["mu_e.min"] = found["sigma_y.dark"] / K + 0.5
    photons = curve.photons
    if np.isfinite(photons).all() and (photons > 0).all():
        p = photons[use]
        R = float((p * x).sum() / (p * p).sum())
        found |= {"R": R, "eta": R / K, "mu_p.sat": float(photons[curve.saturation])}
        found["mu_e.sat"] = found["eta"] * found["mu_p.sat"]
        found["mu_p.min"] = found["mu_e.min"] / found["eta"]
        found["DR"] = found["mu_p.sat"] / found["mu_p.min"]
    else:
        found["mu_e.sat"] = float(curve.signal[curve.saturation] / K)
        found["DR"] = found["mu_e.sat"] / found["mu_e.min"]
    found["SNR_max"] = float(np.sqrt(found["mu_e.sat"]))
    deviations = _deviations(curve)
    if np.isfinite(deviations).any():
        found |= {"LE_min": float(np.nanmin(deviations)), "LE_max": float(np.nanmax(deviations))}
    return found | _spatial(bright, dark, K, block)


def _spatial(bright: Sequence[Level], dark: Sequence[Level], K: float, block: int | None) -> dict[str, float]:
    """DSNU and PRNU from the level with most repeats, of those the nearest to half of saturation, and its dark one."""
    most = max(b.repeats for b in bright)
    fit = [b for b in bright if b.repeats == most]
    whole = max(b.mu for b in bright)
    low = min(d.mu for d in dark)
    b = min(fit, key=lambda b: abs((b.mu - low) - 0.5 * (whole - low)))
    d = max((d for d in dark if np.isclose(d.t_exp, b.t_exp, rtol=1e-6)), key=lambda d: d.repeats)
    s2_bright = _at(b, "spatial", block) - _at(b, "temporal", block) / b.repeats
    s2_dark = _at(d, "spatial", block) - _at(d, "temporal", block) / d.repeats
    found = {}
    if s2_dark > 0:
        found["DSNU1288"] = float(np.sqrt(s2_dark) / K)
    if s2_bright > max(s2_dark, 0):
        signal = _at(b, "mean", block) - _at(d, "mean", block)
        found["PRNU1288"] = float(np.sqrt(s2_bright - s2_dark) / signal)
    at = -1 if block is None else block
    signal = _at(b, "mean", block) - _at(d, "mean", block)
    for k, part in enumerate(PARTS):
        dark_part, bright_part = d.split[at, k], b.split[at, k] - d.split[at, k]
        if dark_part > 0:
            found[f"DSNU1288.{part}"] = float(np.sqrt(dark_part) / K)
        if bright_part > 0 and signal > 0:
            found[f"PRNU1288.{part}"] = float(np.sqrt(bright_part) / signal)
    return found


def _deviations(curve: Curve) -> np.ndarray:
    """Relative deviations of the signal from a + b p, fitted with weights 1 / signal over 5 .. 95 % of saturation."""
    top = curve.signal[curve.saturation]
    p = curve.photons if np.isfinite(curve.photons).all() and (curve.photons > 0).all() else curve.t_exp
    use = (curve.signal >= 0.05 * top) & (curve.signal <= 0.95 * top)
    out = np.full(len(p), np.nan)
    if use.sum() >= 3 and len(np.unique(p[use])) >= 3:
        line = np.polyval(np.polyfit(p[use], curve.signal[use], 1, w=1 / curve.signal[use]), p[use])
        out[use] = (curve.signal[use] - line) / line
    return out


def _notes(values: dict[str, float], curve: Curve) -> tuple[str, ...]:
    notes = []
    if "eta" not in values:
        notes.append("No photon numbers are given: quantum efficiency and responsivity are left out.")
    if "DSNU1288" not in values:
        notes.append("The dark image shows no fixed pattern above its noise: DSNU1288 is left out.")
    if "PRNU1288" not in values:
        notes.append("The bright image shows no fixed pattern above its noise: PRNU1288 is left out.")
    if "mu_I.mean" not in values:
        notes.append("The dark images have fewer than three exposure times: the dark current is left out.")
    if curve.saturation == len(curve.signal) - 1:
        notes.append("The noise rises up to the brightest exposure: saturation was not reached.")
    return tuple(notes)
