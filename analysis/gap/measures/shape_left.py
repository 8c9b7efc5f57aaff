"""Where what is left without a cause lies: parts of the images that have far more of it than of the pixels."""

from collections import defaultdict
from collections.abc import Iterator, Sequence

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.regions import lamp_shares, light_regions, zones
from analysis.gap.compared.state import State
from analysis.gap.measures.ledger import LEVELS, bands

MOST = 0.5  # of what is left, from which a part is told
MORE, TIMES = 1.25, 3.0  # times its share of the pixels, and the odds of that, from which it is
SURE = 0.999  # of which odds can be told
TOLD = 3
LIGHT = {
    "saturated": "where images end",
    "edge": "at edges",
    "penumbra": "in half-shadows",
    "highlight": "in highlights",
    "shadow": "in shadows",
    "lit": "on lit faces",
}


def shape_left(conditions: Sequence[Condition], simulated: Sequence[np.ndarray]) -> str:
    """Of (mean of captures - ``simulated``)² / σ² - 1, (H, W, C) DN each: each kind's part with most of it, told if
    that is half of it or more, and clearly more than its share of the pixels."""
    left: defaultdict[tuple[str, str], float] = defaultdict(float)
    size: defaultdict[tuple[str, str], float] = defaultdict(float)
    for condition, dn in zip(conditions, simulated, strict=True):
        ok = condition.usable(condition.simulated())[..., None] & np.ones(dn.shape, bool)
        temporal, pattern = condition.variance_at(dn)
        sigma = np.sqrt(temporal / len(condition.captures) + pattern)
        z = np.where(ok, (condition.mean - dn) / sigma, 0.0)
        for kind, words, weight in _parts(condition):
            left[kind, words] += float(((z**2 - ok) * weight).sum())
            size[kind, words] += float((ok * weight).sum())
        for level, energy in enumerate(bands(z)):
            part = 4.0**-level * (1.0 if level == LEVELS else 0.75)
            words = f"in detail of {2**level} px and more" if level == LEVELS else _detail(level)
            left["frequency", words] += energy - part * float(ok.sum())
            size["frequency", words] += part * float(ok.sum())
    found = []
    for kind in dict.fromkeys(kind for kind, _ in left):
        own = {words: x for (k, words), x in left.items() if k == kind}
        whole, pixels = sum(own.values()), sum(size[kind, words] for words in own)
        words, most = max(own.items(), key=lambda x: x[1])
        share = min(most / max(whole, 1e-30), SURE)
        of = min(size[kind, words] / max(pixels, 1e-30), SURE)
        odds = share / (1 - share) * (1 - of) / max(of, 1e-30)
        if whole > 0 and share >= max(MOST, MORE * of) and odds >= TIMES:
            of_it = "" if kind == "frequency" else f", {100 * of:.0f} % of the pixels"
            found.append((odds, f"{100 * share:.0f} % of it {words}{of_it}"))
    found.sort(key=lambda x: -x[0])
    return "; ".join(words for _, words in found[:TOLD]) or "spread evenly over all that was looked at"


def _detail(level: int) -> str:
    return f"in detail of {2**level} to {2 ** (level + 1)} px"


def _parts(condition: Condition) -> Iterator[tuple[str, str, np.ndarray]]:
    """Kind, words, and which pixels (H, W, 1), or what share of each value (H, W, C), belong to it."""
    shown, one = condition.shown, np.ones((*condition.mean.shape[:2], 1))
    yield "camera", f"in {condition.camera.name.rsplit('/', 1)[-1]}", one
    yield "capture", f"in {condition.captures[0].image}", one
    ids = shown.passes["material_id"]
    for k in np.unique(ids):
        name = shown.scene.material_names[k].rsplit("/", 1)[-1] if k >= 0 else "the background"
        yield "material", f"on {name}", (ids == k)[..., None]
    for name, mask in light_regions(condition).items():
        yield "light", LIGHT[name], mask[..., None]
    for name, mask in zones(condition.mean.shape[:2]).items():
        yield "zone", f"in the {name} of the image", mask[..., None]
    for name, share in lamp_shares(State(condition)).items():
        yield "lamp", f"under {name}" if name != "no lamp" else "in light of no lamp", share
