"""Light by way of other surfaces, which the rasteriser does not draw, is a finding of a diagnosis with it."""

import cv2
import numpy as np
import pytest

from analysis.gap.diagnose import Diagnosed
from analysis.gap.light import radiance
from analysis.gap.renderers import renderer
from tests.analysis.gap.bench import SAMPLES, Rig


@pytest.fixture(scope="module")
def found(rig: Rig) -> Diagnosed:
    return rig.diagnosed(rig.captured("reflected", (), reflected=1.0), "reflected")


def test_the_bench_reflects(rig: Rig) -> None:
    """Some per cent of all light, more in corners."""
    shown = rig.truth[3]
    share = sum(p.sum() for p in shown.undrawn.values()) / sum(p.sum() for p in shown.lamps.values())
    assert 0.02 < share < 0.5
    assert all(np.isfinite(p).all() and p.min() >= 0 for p in shown.undrawn.values())


@pytest.mark.slow
def test_it_is_found_alone_and_all_of_it(found: Diagnosed) -> None:
    d = found.diagnosis
    effects = {e.name: e for e in d.effects if e.probability > 0.5}
    assert set(effects) == {"interreflection"}
    added = effects["interreflection"].parameters["added"]
    assert abs(added.value - 1) < 3 * added.sigma < 0.3
    assert d.gap.explained > 0.9
    assert d.gap.after < 1.1


@pytest.mark.slow
def test_it_says_what_draws_it(found: Diagnosed) -> None:
    assert any("interreflection" in n and "--render offline" in n for n in found.diagnosis.notes)
    assert found.diagnosis.verification is not None
    assert found.diagnosis.verification.holds


@pytest.mark.slow
def test_on_a_large_sensor_it_is_traced_on_a_coarser_grid(rig: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """Away from what a coarser pixel shows two surfaces of it is the same within the denoiser's 1 % of the signal."""
    scene = rig.document.scene(0)
    camera = scene.camera("/World/Camera0").resized(180)
    width, height = camera.sensor.resolution
    found = []
    for most in (width * height, width * height // 9):
        monkeypatch.setattr(radiance, "TRACED", most)
        with renderer("realtime", SAMPLES) as (render, settings):
            found += radiance.render_all([(scene, camera)], render, settings, rig.cache)
    fine, coarse = found
    near = np.ones((7, 7), np.uint8)
    surface = radiance.surfaces(fine.passes).astype(np.float32)
    inside = cv2.erode(surface, near) == cv2.dilate(surface, near)
    assert inside.mean() > 0.5
    for name, plane in fine.undrawn.items():
        signal = fine.lamps[name] + plane
        off = (coarse.undrawn[name] - plane)[inside]
        assert coarse.undrawn[name].shape == plane.shape
        assert np.sqrt(np.mean(off**2)) < 0.01 * np.sqrt(np.mean(signal[inside] ** 2))
        assert off.sum() == pytest.approx(0, abs=0.02 * plane[inside].sum())
