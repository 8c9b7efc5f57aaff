"""What conditions show of an effect, and how much of it they may differ by."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import invgamma, norm

from analysis.gap.evidence.caution import ALIKE, ALIKE_BY, FOUND, FOUND_BY, LIKELY, LOBES_ALIKE, agreement
from interchange.brdf.lafortune import Lafortune


@pytest.mark.parametrize("by_chance", [0.0, 0.2])
def test_agreement_is_the_ratio_of_what_conditions_show_under_both(by_chance: float) -> None:
    """By integrating over widths and the amount, numerically; two conditions that agree tell less than seven."""
    amounts = np.array([0.9, 1.3, 0.8])
    n, s = 3, float(amounts.std(ddof=1) / np.sqrt(3))
    sigma = np.exp(np.linspace(-7, 5, 2401))
    step = np.log(sigma[1] / sigma[0])

    def under(scale: float, by: float, means: np.ndarray) -> np.ndarray:
        scale = np.hypot(scale, by_chance * np.sqrt(n))
        width = invgamma.pdf(sigma**2, by / 2, scale=by * scale**2 / 2) * 2 * sigma**2 * step
        each = norm.pdf(amounts[:, None, None], means[None, :, None], sigma[None, None, :]).prod(axis=0)
        return np.asarray((each * width).sum(axis=1))

    means = np.linspace(-4, 6, 2001)
    there = under(ALIKE, ALIKE_BY, means).sum() * (means[1] - means[0])
    assert agreement(s, n, by_chance) == pytest.approx(
        np.log(there / under(FOUND, FOUND_BY, np.zeros(1))[0]), abs=1e-3
    )
    assert 2.0 < agreement(0.1, 2) < agreement(0.1, 7)
    assert agreement(0.6, 2) < 0 < agreement(0.2, 2)
    assert agreement(0.25, 9) < 0 < 3 < agreement(0.25, 9, 0.2)  # a weak effect is as uncertain as that
    # other lobes show as much of themselves under each lamp as a formula says
    assert agreement(0.29, 9) < LIKELY < agreement(0.29, 9, alike=LOBES_ALIKE)
    assert agreement(1.0, 9, alike=LOBES_ALIKE) < 0


def _shown(form: Lafortune, metal: Lafortune, grain: float) -> np.ndarray:
    """(8, 475): what a block's top, 120 x 90 mm, shows more of one form than of the other, under each of four lamps to
    two cameras, as bright as they are there."""
    lamps = np.array([(-200, -80, 260), (200, -60, 260), (0, 200, 280), (40, -20, 430)]) / 1e3
    cameras = np.array([(-40, -330, 480), (-320, -200, 430)]) / 1e3
    x, y = np.meshgrid(np.linspace(-0.06, 0.06, 25), np.linspace(-0.045, 0.045, 19))
    top = np.stack([x, y, np.full_like(x, 0.026)], axis=-1).reshape(-1, 3)
    c, s = np.cos(grain), np.sin(grain)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    out = []
    for eye in cameras:
        for lamp in lamps:
            wi, wo = ((to - top) / np.linalg.norm(to - top, axis=1)[:, None] @ turn.T for to in (lamp, eye))
            more = (form.evaluate(wi, wo) - metal.evaluate(wi, wo)).mean(axis=-1)
            out.append(more * wi[:, 2] / ((lamp - top) ** 2).sum(axis=1))
    return np.array(out)


def test_models_of_stretched_lobes_differ_by_as_much_from_lamp_to_lamp() -> None:
    """Of C along one axis alone, each lamp shows another amount of C that is split in two: the median of three ways
    that a grain may run."""
    metal = Lafortune((0.2, 0.2, 0.21), ((0.7, 0.7, 0.72),), ((-0.97, -0.97, 0.99),), (14.0,))
    split, one = (replace(metal, C=(c,)) for c in ((-0.98, -0.96, 0.99), (-0.99, -0.97, 0.99)))
    found = []
    for grain in (0.0, 0.5, 1.2):
        ours, other = _shown(split, metal, grain), _shown(one, metal, grain)
        amounts = (ours * other).sum(axis=1) / (ours**2).sum(axis=1)
        found.append(amounts.std() / abs(amounts.mean()))
    assert np.median(found) > LOBES_ALIKE
