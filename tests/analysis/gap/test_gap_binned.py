"""Large sensors are diagnosed by means over n x n pixels; what is told is of the sensor's own pixels."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.gap.diagnose import Diagnosed
from analysis.gap.finding import Estimate, Finding
from analysis.gap.processed.binned import LARGEST, Binning, binned_camera, binned_captures, times_binned
from analysis.gap.processed.encoded import Encoding
from analysis.gap.processed.own_pixels import of_own_pixels
from analysis.gap.sensor.expected import expected
from interchange.camera import Camera, Lens, Sensor
from interchange.captures import Capture, Captures
from interchange.effects.defocus import Defocus
from interchange.exposure import expose
from interchange.formats.document import open_scene
from interchange.image import Image, Quantity
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.sensor import Response
from tests.analysis.gap.bench import Rig, rig_in

N = 3
SENSOR = Sensor((92, 61), (5e-6, 5e-6), 80.0, 9000.0, 12, 64.0, 8.0, prnu=0.01, dsnu=4.0, dark_current=50.0)
CAMERA = Camera(
    "/World/Camera", lens=Lens(12e-3, blur=1.5, field_blur=(0.0, 3.0, 1.0, 0.0)), sensor=SENSOR, t_exp=0.02
)


@pytest.mark.parametrize("level", [20.0, 1500.0])
def test_a_mean_over_pixels_is_what_a_sensor_that_bins_reads(level: float) -> None:
    """Mean and both variances, of the sensor's own model, against frames of its pixels: 500 frames of 600 means. In the
    dark a code's rounding would be 5 % of the variance."""
    camera = replace(CAMERA, lens=Lens(12e-3))
    rng = np.random.default_rng(2)
    flat = Image(np.full((61, 92, 3), level, np.float32), Quantity.RADIANCE, camera)
    frames = []
    for _ in range(500):
        dn = expose(flat, camera, camera.t_exp, rng=rng).pixels
        frames.append(dn[:60, :90].reshape(20, N, 30, N, 3).mean(axis=(1, 3)))
    few = binned_camera(camera, N)
    model = expected(np.full((20, 30, 3), level, np.float32), few)
    seen = np.array(frames)
    assert seen.mean() == pytest.approx(model.dn.mean(), abs=0.3)  # 4 DN of fixed pattern over 1800 means
    assert seen.var(axis=0, ddof=1).mean() == pytest.approx(model.temporal.mean(), rel=0.01)
    pattern = seen.mean(axis=0).var() - seen.var(axis=0).mean() / len(seen)
    assert pattern == pytest.approx(
        model.fixed.mean(), rel=0.15
    )  # a variance of 1800 values: 3.3 %, four times


@pytest.mark.parametrize("said", [True, False])
def test_means_are_of_light_whatever_the_curve(said: bool) -> None:
    """Bright and dark columns, of which each mean has both, in files of 8 bits by sRGB's curve, whether the scene says
    so or captures have told it: the mean of codes lies 19 DN lower. Mean and variance are the model's of a sensor that
    bins."""
    curved = replace(SENSOR, response=Response.SRGB, output_bit_depth=8, prnu=0.0, dsnu=0.0)
    camera = replace(CAMERA, lens=Lens(12e-3), sensor=curved)
    silent = replace(curved, response=Response.LINEAR, output_bit_depth=0)
    scene = Scene(cameras=(replace(camera, sensor=curved if said else silent),))
    document: Any = SimpleNamespace(scene=lambda time=None: scene, stage=None, path=None, problems=[])
    radiance = np.empty((61, 92, 3), np.float32)
    radiance[:, ::2], radiance[:, 1::2] = 200.0, 2500.0
    rng = np.random.default_rng(4)
    frames = [
        expose(Image(radiance, Quantity.RADIANCE, camera), camera, camera.t_exp, rng=rng).pixels
        for _ in range(40)
    ]
    given = tuple(Capture(f"{k}.png", camera.name, 0.0, 0.02, x, bits=8) for k, x in enumerate(frames))
    by, told = Binning(2, cameras=frozenset({camera.name})), [Encoding(camera.name, black_off=False)]
    few = binned_captures(Captures(Path("c"), Path("s"), given), document, by, () if said else told).captures
    assert not any(c.has_codes for c in few)
    assert {c.bits for c in few} == {8}
    seen = np.array([c.pixels for c in few])
    model = expected(np.full((30, 46, 3), 1350, np.float32), binned_camera(camera, 2))
    codes = np.array(frames)[:, :60].reshape(40, 30, 2, 46, 2, 3).mean(axis=(2, 4))
    assert codes.mean() < model.dn.mean() - 18
    assert seen.mean() == pytest.approx(model.dn.mean(), abs=0.1)  # codes of a curve, a tenth of one
    assert seen.var(axis=0, ddof=1).mean() == pytest.approx(model.temporal.mean(), rel=0.05)


@pytest.mark.parametrize("light", [0.0, 10.0, 60.0])
@pytest.mark.parametrize(("response", "bits"), [(Response.LINEAR, 12), (Response.SRGB, 8)])
def test_means_of_the_dark_are_of_codes_that_were_cut_off(
    response: Response, bits: int, light: float
) -> None:
    """Without a black level the dark is brighter than its light by 0.4 of an own pixel's noise, not of a mean's. Within
    a twentieth of a code, which is four standard errors, and 5 % of the variance."""
    sensor = replace(
        SENSOR, response=response, output_bit_depth=bits, prnu=0.0, dsnu=0.0, black_level=0.0, read_noise=12.0
    )
    camera = replace(CAMERA, lens=Lens(12e-3), sensor=sensor)
    document: Any = SimpleNamespace(
        scene=lambda time=None: Scene(cameras=(camera,)), stage=None, path=None, problems=[]
    )
    image = Image(np.full((61, 92, 3), light, np.float32), Quantity.RADIANCE, camera)
    rng = np.random.default_rng(4)
    frames = [expose(image, camera, camera.t_exp, rng=rng).pixels for _ in range(40)]
    file_bits = 8 if bits == 8 else 16
    given = tuple(
        Capture(f"{k}.png", camera.name, 0.0, 0.02, x, bits=file_bits) for k, x in enumerate(frames)
    )
    by = Binning(2, cameras=frozenset({camera.name}))
    few = binned_captures(Captures(Path("c"), Path("s"), given), document, by).captures
    seen = np.array([c.pixels for c in few])
    model = expected(np.full((30, 46, 3), light, np.float32), binned_camera(camera, 2))
    assert seen.mean() == pytest.approx(model.dn.mean(), abs=0.05)
    assert seen.var(axis=0, ddof=1).mean() == pytest.approx(model.temporal.mean(), rel=0.05)


def test_what_is_left_over_at_the_rim_is_not_read_out() -> None:
    few = binned_camera(CAMERA, N)
    assert few.sensor.resolution == (30, 20)
    points = np.random.default_rng(1).uniform([-0.3, -0.3, 1.7], [0.3, 0.3, 2.3], (20, 3))
    assert few.project(points) == pytest.approx((CAMERA.project(points) + 0.5) / N - 0.5)


def test_lengths_in_pixels_are_fewer() -> None:
    few = binned_camera(CAMERA, N)
    assert few.lens.blur == pytest.approx(0.5)
    assert few.lens.field_blur == pytest.approx((0, 1.0, 1 / 3, 0))


def test_read_noise_of_own_pixels_is_the_sensor_s() -> None:
    """A mean of codes is rounded less than a code: what is taken off for that when binned is put back."""
    few = binned_camera(CAMERA, N).sensor
    told = {"K": Estimate(few.K, 0.0, "DN/e-"), "read_noise": Estimate(few.read_noise, 0.1, "e-")}
    own = of_own_pixels(Finding("sensor_noise", 0.9, told, (), "", 2.0, 1.0, 0.5), Binning(N)).parameters
    assert own["K"].value == pytest.approx(SENSOR.K)
    assert own["read_noise"].value == pytest.approx(SENSOR.read_noise)


def test_means_are_no_jpeg() -> None:
    sensor = replace(SENSOR, output_bit_depth=8, jpeg_quality=90)
    assert binned_camera(replace(CAMERA, sensor=sensor), N).sensor.jpeg_quality == 0


def test_some_pixels_must_be_left() -> None:
    with pytest.raises(BrightfieldError, match="--bin 4 leaves less than 16"):
        binned_camera(CAMERA, 4)


@pytest.mark.parametrize(
    ("effect", "name", "unit", "times"),
    [
        ("principal_point", "cx", "px", N),
        ("defocus", "Camera1 blur", "px", N),
        ("sensor_noise", "K", "DN/e-", N**2),
        ("sensor_noise", "read_noise", "e-", 1 / N),
        ("fixed_pattern", "prnu", "1", N),
        ("saturation", "full_well", "e-", 1 / N**2),
        ("black_level", "black_level", "DN", 1),
        ("vignetting", "a2", "1", 1),
        ("black_level", "Camera0 dark_current", "e-/s", 1 / N**2),
    ],
)
def test_numbers_are_told_of_own_pixels(effect: str, name: str, unit: str, times: float) -> None:
    finding = Finding(effect, 0.9, {name: Estimate(2.0, 0.5, unit)}, (), "", 2.0, 1.0, 0.5)
    told = of_own_pixels(finding, Binning(N)).parameters[name]
    assert (told.value, told.sigma, told.unit) == (pytest.approx(2 * times), pytest.approx(0.5 * times), unit)


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory, kept: Path) -> Rig:
    """A pin before prints, seen by one camera: whatever else could have moved takes most of a diagnosis's time."""
    without = ("bracket", "ball", "wall_a", "wall_b")
    return rig_in(
        tmp_path_factory.mktemp("binned"), kept, without, reflected=False, times=(0, 1, 4, 6, 10, 12)
    )


@pytest.fixture(scope="module")
def found(bare: Rig) -> Diagnosed:
    return bare.diagnosed(bare.captured("binned", (Defocus(blur=2.0),)), "binned", binning=2, reflected=False)


@pytest.mark.slow
def test_captures_that_are_binned_tell_the_same(found: Diagnosed) -> None:
    d = found.diagnosis
    effects = {e.name: e.parameters for e in d.effects if e.probability > 0.5}
    assert set(effects) == {"defocus"}
    blur = effects["defocus"]["blur"]
    assert abs(blur.value - 2.0) < 4 * blur.sigma < 0.4
    assert any("--bin 2" in n for n in d.notes)


@pytest.mark.slow
def test_the_scene_that_is_corrected_is_the_sensor_s_own(bare: Rig, found: Diagnosed) -> None:
    corrected = open_scene(bare.folder / "binned" / found.diagnosis.corrected_scene)
    camera = corrected.scene(0).cameras[0]
    assert camera.sensor.resolution == bare.document.scene(0).cameras[0].sensor.resolution
    assert camera.lens.blur == pytest.approx(2.0, abs=0.1)
    assert found.diagnosis.verification is not None
    assert found.diagnosis.verification.holds


def test_small_captures_are_taken_as_they_are(bare: Rig) -> None:
    captures = bare.captured("small", ())
    assert times_binned(captures, bare.document) == 1
    large = replace(captures.captures[0], pixels=np.zeros((1836, 2448, 1), np.float32))
    n = times_binned(replace(captures, captures=(large,)), bare.document)
    assert 1836 * 2448 / n**2 <= LARGEST < 1836 * 2448 / (n - 1) ** 2
    assert n == 3


def test_a_mean_of_what_is_saturated_is_left_out(bare: Rig) -> None:
    captures = bare.captured("bright", ())
    pixels = np.full_like(captures.captures[0].pixels, 100)
    pixels[10, 11] = 4095
    one = replace(captures, captures=(replace(captures.captures[0], pixels=pixels),))
    few = binned_captures(one, bare.document, Binning(4))
    mask = few.captures[0].mask
    assert mask is not None
    assert [list(x) for x in np.argwhere(~mask)] == [[2, 2]]
    assert few.tolerances.registration_px == pytest.approx(captures.tolerances.registration_px / 4)
