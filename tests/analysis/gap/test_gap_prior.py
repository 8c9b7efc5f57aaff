"""What is believed before captures are seen: effects alike, whatever they may be of."""

from itertools import combinations

import numpy as np
import pytest

from analysis.gap.evidence.likelihood import SLABS, SLIGHT, Evidence
from analysis.gap.evidence.prior import NONE, PAIR, SINGLE, Prior
from analysis.gap.terms.base import Cause, Term
from analysis.gap.terms.normal_equations import NormalEquations


def test_an_effect_is_as_probable_of_eight_lamps_together_as_one_of_the_image() -> None:
    cameras: dict[Cause, str] = {("light_intensity", f"LED{i}"): "" for i in range(8)} | {
        ("vignetting", ""): ""
    }
    prior = Prior(cameras)
    of_lamps = np.exp([prior((c,)) for c in cameras if c[0] == "light_intensity"])
    assert of_lamps.sum() == pytest.approx(SINGLE / 2)
    assert np.exp(prior((("vignetting", ""),))) == pytest.approx(SINGLE / 2)
    assert np.exp(prior(())) == pytest.approx(NONE)


def test_all_cameras_have_half_of_an_effect_and_each_of_them_the_rest() -> None:
    a, b = "/World/A", "/World/B"
    prior = Prior({("defocus", ""): "", ("defocus", a): a, ("defocus", b): b})
    every, one, other = (np.exp(prior((("defocus", x),))) / SINGLE for x in ("", a, b))
    assert every == pytest.approx(0.5)
    assert one == other == pytest.approx(0.25)


def test_a_rare_cause_takes_little_from_the_others_of_its_effect() -> None:
    off, leaking, glare = ("black_level", ""), ("black_level", "sensor"), ("veiling_glare", "")
    prior = Prior(dict.fromkeys((off, leaking, glare), ""), {leaking: 0.01})
    assert np.exp(prior((leaking,)) - prior((off,))) == pytest.approx(0.01)
    assert np.exp([prior((c,)) for c in (off, leaking)]).sum() == pytest.approx(np.exp(prior((glare,))))


def test_pairs_of_many_effects_have_together_what_pairs_have() -> None:
    causes: list[Cause] = [(f"e{i}", "") for i in range(60)]
    prior = Prior(dict.fromkeys(causes, ""))
    total = np.exp([prior(pair) for pair in combinations(causes, 2)]).sum()
    assert total == pytest.approx(PAIR, rel=0.02)  # a cause beside itself is no pair


@pytest.mark.parametrize("seen", [0.0, 0.004, 0.02])
def test_widths_are_averaged_over(seen: float) -> None:
    """One number that is seen with a known error: a normal distribution in closed form for each width."""
    spike, weight = 1e-3, 1e6
    term = Term("vignetting", "", "a2", "1", spike, lambda s: None)
    G = np.array([[weight]])
    e = NormalEquations(G, G[0] * seen, weight * seen**2, weight, np.array([weight]), 0.0, 1)
    evidence = Evidence(e, [term], spikes=np.array([spike]))
    cause = ("vignetting", "")
    widths = np.array((SLIGHT, *SLABS)) / evidence.together[0]
    variance = np.append(np.clip(widths, 2 * spike, 40 * spike), spike) ** 2 + 1 / weight
    log_p = -0.5 * seen**2 / variance - 0.5 * np.log(variance)
    want = np.log(np.exp(log_p[:-1]).mean()) - log_p[-1]
    assert evidence.best((cause,), {}).log_Z - evidence.at((), ()).log_Z == pytest.approx(want, abs=1e-6)


def test_a_part_that_hardly_shows_is_no_larger_than_the_whole_is() -> None:
    """Ambient light that is seen with 1e-3 of it, what of it leans to one side with a thousandth of its share: both are
    as wide as the light is, in closed form. As wide as its own share tells, the lean would cost ln 1000 more."""
    spike, weight, seen = 1e-3, 1e6, 0.02
    both = [
        Term("ambient_light", "", p, "W/(m^2 sr)", spike, lambda s: None, sized_by="L") for p in ("L", "x")
    ]
    share = np.array([1.0, 1e-3])
    G = weight * np.diag(share**2)
    e = NormalEquations(G, G[0] * seen, weight * seen**2, weight, np.full(2, weight), 0.0, 1)
    (cause,) = Evidence(e, both).members
    for slab in SLABS:
        evidence = Evidence(e, both, spikes=np.full(2, spike))
        wide = np.clip(slab / np.sqrt(2), 2 * spike, 40 * spike)
        by_width = [
            -0.5 * np.log1p(sd**2 * weight * share**2)
            + 0.5 * (weight * seen * share) ** 2 * [1, 0] / (weight * share**2 + sd**-2)
            for sd in (wide, spike)
        ]
        want = (by_width[0] - by_width[1]).sum()
        assert evidence.log_Z((cause,), (slab,)) - evidence.log_Z((), ()) == pytest.approx(want, abs=1e-6)
