"""Where the gap is: an exact account of the mean of (capture - simulation)² / σ².

    total = noise + Σ regions,    region g = Σ over g of (e² - V) / σ² / N

V is what the sensor's noise gives: its model's variance, the temporal part scaled to what repeats showed. Every kind
of region (material, lamp, frequency, ...) adds up to the total with the same noise; a region may come out below 0
where there is nothing but noise, and is told so.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.regions import lamp_shares, light_regions, names_of_ids, zones
from analysis.gap.compared.state import State
from analysis.gap.parallel import each
from analysis.gap.sensor.expected import noise_variance

NOISE = "noise"
LEVELS = 5
LEAST = 800  # values whose repeats tell how large noise is: to a share of √(2 / n), 5 %


@dataclass(frozen=True)
class Share:
    kind: str
    name: str
    share: float


@dataclass(frozen=True, eq=False)
class Ledger:
    """``total``: mean χ²; ``noise``: the part that is the sensor's; ``measured``: whether repeats say so."""

    total: float
    noise: float
    measured: bool
    shares: tuple[Share, ...]

    def of(self, kind: str) -> list[Share]:
        return [s for s in self.shares if s.kind == kind]


def temporal_scale(conditions: Sequence[Condition]) -> float | None:
    """Measured temporal variance over the sensor model's, from repeats; None without any, and of fewer than ``LEAST``
    values, which know it to worse than 5 %. Repeats of a JPEG tell none."""
    measured, modelled, count = 0.0, 0.0, 0
    for c in conditions:
        if c.spread is not None and c.packed is None and not c.camera.sensor.jpeg_quality:
            ok = c.usable(c.simulated()) & c.above_zero
            dof = len(c.captures) - 1
            count += dof * c.spread[ok].size
            measured += dof * float(c.spread[ok].sum())
            modelled += dof * float(noise_variance(c.mean[ok], c.camera)[0].sum())
    return measured / modelled if modelled > 0 and count >= LEAST else None


def ledger(
    conditions: Sequence[Condition],
    simulated: Sequence[np.ndarray],
    best: Sequence[np.ndarray],
    fixed: dict[str, float] | None = None,
) -> Ledger:
    """``simulated`` (H, W, C) DN for each condition; ``best``: the simulation that noise is reckoned from.

    ``fixed``: what share of Σ e² / σ² goes with the image, the surface and the lamps (``fixed_to``).
    """
    scale = temporal_scale(conditions)

    def counted(
        one: tuple[Condition, np.ndarray, np.ndarray],
    ) -> tuple[float, int, list[tuple[str, str, float]]]:
        condition, dn, true = one
        ok = condition.usable(condition.simulated())[..., None] & np.ones(dn.shape, bool)
        temporal, pattern = condition.variance_at(true)
        variance = (temporal + pattern).astype(np.float64)
        noise = np.where(ok, ((scale or 1.0) * temporal + pattern) / variance, 0.0)
        square = 0.0
        parts: list[tuple[str, str, float]] = []
        for capture in condition.captures:
            z = np.where(ok, (capture.pixels - dn) / np.sqrt(variance), 0.0)
            square += float((z**2).sum())
            parts += _parts(condition, capture.image, z, noise)
        return square, len(condition.captures) * int(ok.sum()), parts

    sums: dict[tuple[str, str], float] = {}
    noises: dict[str, float] = {}
    total, count = 0.0, 0
    for square, values, parts in each(counted, zip(conditions, simulated, best, strict=True)):
        total, count = total + square, count + values
        for kind, name, value in parts:
            sums[kind, name] = sums.get((kind, name), 0.0) + value
            noises[kind] = noises.get(kind, 0.0) + value
    kinds = list(dict.fromkeys(kind for kind, _ in sums))
    shares = [Share(kind, name, value / total) for (kind, name), value in sums.items()]
    shares += [Share(kind, NOISE, 1.0 - noises[kind] / total) for kind in kinds]
    floor = shares[-1].share if shares else 0.0
    if fixed is not None:
        found = [Share("fixed to", name, share) for name, share in fixed.items()]
        rest = 1.0 - floor - sum(fixed.values())
        shares += [*found, Share("fixed to", "nothing", rest), Share("fixed to", NOISE, floor)]
    order = {kind: i for i, kind in enumerate([*kinds, "fixed to"])}
    shares.sort(key=lambda s: (order[s.kind], s.name == NOISE, -s.share))
    return Ledger(total / count, floor * total / count, scale is not None, tuple(shares))


def _parts(
    condition: Condition, image: str, z: np.ndarray, noise: np.ndarray
) -> Iterator[tuple[str, str, float]]:
    """Every region's Σ (z² - V / σ²); each kind's add up to the whole."""
    excess = z**2 - noise
    plane = excess.sum(axis=2)
    shown = condition.shown
    yield "capture", image, float(plane.sum())
    for k in range(z.shape[2]):
        yield "channel", "RGB"[k] if z.shape[2] == 3 else "grey", float(excess[..., k].sum())
    for kind, ids, names in (
        ("material", shown.passes["material_id"], shown.scene.material_names),
        ("object", shown.passes["object_id"], shown.scene.object_names),
    ):
        for name, value in names_of_ids(ids, names, plane):
            yield kind, name, value
    for kind, regions in (("light", light_regions(condition)), ("zone", zones(plane.shape))):
        for name, mask in regions.items():
            yield kind, name, float(plane[mask].sum())
    for name, share in lamp_shares(State(condition)).items():
        yield "lamp", name, float((excess * share).sum())
    energy, white = bands(z), float(noise.sum())
    for level, value in enumerate(energy):
        last = level == len(energy) - 1
        part = 4.0**-level if last else 3 * 4.0 ** -(level + 1)
        name = f"over {2**level} px" if last else f"{2**level} to {2 ** (level + 1)} px"
        yield "frequency", name, value - part * white


def bands(z: np.ndarray) -> list[float]:
    """Energy of ``z`` (H, W, C) in the levels of an orthonormal Haar transform, finest first; adds up to Σ z²."""
    h, w = (-(-n // 2**LEVELS) * 2**LEVELS for n in z.shape[:2])
    a = np.zeros((h, w, z.shape[2]))
    a[: z.shape[0], : z.shape[1]] = z
    out = []
    for _ in range(LEVELS):
        before = float((a**2).sum())
        a = (a[0::2, 0::2] + a[1::2, 0::2] + a[0::2, 1::2] + a[1::2, 1::2]) / 2
        out.append(before - float((a**2).sum()))
    return [*out, float((a**2).sum())]


def fixed_to(
    families: dict[str, np.ndarray], G: np.ndarray, b: np.ndarray, rr: float, spike: np.ndarray
) -> dict[str, float]:
    """Share of the residual's r' W r that each family of terms explains: Shapley's, which adds up to what they
    explain together. ``families``: indices of terms; ``spike`` (q,) a weak prior that keeps them finite."""

    def explained(names: tuple[str, ...]) -> float:
        i = np.concatenate([families[n] for n in names]) if names else np.array([], int)
        if not len(i):
            return 0.0
        A = G[np.ix_(i, i)] + np.diag((30 * spike[i]) ** -2.0)
        return float(b[i] @ np.linalg.solve(A, b[i]))

    value = {
        frozenset(s): explained(tuple(s)) for n in range(len(families) + 1) for s in _subsets(families, n)
    }
    orders = list(permutations(families))
    out = dict.fromkeys(families, 0.0)
    for order in orders:
        for i, name in enumerate(order):
            gain = value[frozenset(order[: i + 1])] - value[frozenset(order[:i])]
            out[name] += gain / len(orders) / max(rr, 1e-30)
    return out


def _subsets(families: dict[str, np.ndarray], n: int) -> Iterator[tuple[str, ...]]:
    yield from combinations(families, n)
