"""Light by way of other surfaces, which the rasteriser does not draw, is a finding of a diagnosis with it."""

import numpy as np
import pytest

from analysis.gap.diagnose import Diagnosed
from tests.analysis.gap_bench import Rig


@pytest.fixture(scope="module")
def found(rig: Rig) -> Diagnosed:
    return rig.diagnosed(rig.captured("reflected", (), reflected=1.0), "reflected")


def test_the_bench_reflects(rig: Rig) -> None:
    """Some per cent of all light, more in corners."""
    shown = rig.truth[3]
    share = sum(p.sum() for p in shown.undrawn.values()) / sum(p.sum() for p in shown.lamps.values())
    assert 0.02 < share < 0.5
    assert all(np.isfinite(p).all() and p.min() >= 0 for p in shown.undrawn.values())


def test_it_is_found_alone_and_all_of_it(found: Diagnosed) -> None:
    d = found.diagnosis
    effects = {e.name: e for e in d.effects if e.probability > 0.5}
    assert set(effects) == {"interreflection"}
    added = effects["interreflection"].parameters["added"]
    assert abs(added.value - 1) < 3 * added.sigma < 0.3
    assert d.gap.explained > 0.9
    assert d.gap.after < 1.1


def test_it_says_what_draws_it(found: Diagnosed) -> None:
    assert any("interreflection" in n and "--render offline" in n for n in found.diagnosis.notes)
    assert found.diagnosis.verification is not None
    assert found.diagnosis.verification.holds
