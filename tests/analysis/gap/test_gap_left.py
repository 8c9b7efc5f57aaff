"""What calibration leaves, and what can be told from it at all."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.terms.base import Term
from analysis.gap.terms.generic import DRIFTS, _surroundings, generic_terms
from analysis.gap.terms.left import falling
from analysis.gap.terms.material import matte_share
from analysis.gap.terms.normal_equations import NormalEquations
from interchange.brdf.ggx import Ggx
from interchange.brdf.lambert import Lambert
from interchange.captures import Tolerances
from tests.analysis.gap.conftest import Bench


def test_a_tolerance_is_of_the_images_that_show_a_term() -> None:
    """Of 25 conditions one alone shows b, by as much as all show a: the same width, where the rms over all of them
    would leave b five times as much."""
    parts = []
    for k in range(25):
        X = np.stack([np.ones(200), np.full(200, 1.0 if k == 0 else 0.0)], axis=1)
        own = np.array([200 * 10.0**2, 200 * 10.0**2 if k == 0 else 0.0])
        parts.append(NormalEquations(X.T @ X, X.T @ np.zeros(200), 0.0, 200 * 10.0**2, own))
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    terms = [Term(name, "", "gain", "1", 0.002, lambda s: None, relative=True) for name in "ab"]
    evidence = Evidence(total, terms)
    assert evidence.spike == pytest.approx([0.02, 0.02])  # 0.2 % of 10 DN, at 1 DN a unit
    assert evidence.share == pytest.approx([0.1, 0.02])  # and b is a fifth of it over all
    assert total.of(np.array([1])).own_share == pytest.approx([0.1])


def test_a_smooth_field_has_the_rms_that_is_declared() -> None:
    waves = [(i, j) for i in range(5) for j in range(5) if 0 < i + j < 6]
    part = falling(waves)
    assert sum(x * x for x in part.values()) == pytest.approx(1)
    assert part[1, 0] / part[2, 0] == pytest.approx(4)


def test_each_family_is_as_wide_as_the_tolerances_say(small_bench: Bench, tmp_path: Path) -> None:
    t = Tolerances(flat_field=0.006, albedo=0.01)
    terms = generic_terms(small_bench(tmp_path, {k: "Camera0" for k in range(1, 4)}, 1), t)
    for cause, rms in (("fixed to the image, multiplicative", 0.006), ("fixed to the surface", 0.005)):
        own = [x.spike for x in terms if x.cause == cause]
        assert np.sqrt(np.sum(np.square(own))) == pytest.approx(rms)
    capture = next(x for x in terms if x.cause == "fixed to a capture")
    assert capture.spike == pytest.approx(DRIFTS * t.light_intensity)


def test_the_share_of_a_body_colour() -> None:
    """All of a matte surface, none of a bare lobe; of both, what drawing directions says, known to 0.3 %."""
    assert matte_share(Lambert((0.5, 0.4, 0.3))) == 1
    both = Ggx(diffuse=(0.2, 0.2, 0.2), alpha_x=0.4, alpha_y=0.4, eta=(3.0, 3.0, 3.0))
    assert matte_share(replace(both, diffuse=(0.0, 0.0, 0.0))) == 0
    rng = np.random.default_rng(0)
    r, p = np.sqrt(rng.random(400_000)), 2 * np.pi * rng.random(400_000)  # cos θ / π
    wi = np.stack([r * np.cos(p), r * np.sin(p), np.sqrt(1 - r * r)], axis=-1)
    whole = np.pi * both.evaluate(wi, np.array([np.sqrt(0.5), 0, np.sqrt(0.5)])).mean()
    assert matte_share(both) == pytest.approx(0.2 / whole, abs=0.005)


@pytest.mark.parametrize("light", [0.0, -1e-6, 1e-6])
def test_an_image_of_the_dark_has_no_surroundings(light: float) -> None:
    """What rounding leaves of it, over its own mean, was 1e14 times any effect, and no evidence could be told."""
    dn = np.full((84, 112, 3), 64.0) + light
    dn[0, 0] += 0.001
    dark = SimpleNamespace(
        simulation=SimpleNamespace(dn=dn, black=64.0), signal=dn - 64.0, take=lambda plane: plane
    )
    assert _surroundings(dark) is None
