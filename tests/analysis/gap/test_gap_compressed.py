"""JPEGs that the scene does not say: told by the files, and colour at half the resolution as libjpeg leaves it."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.radiance import Rendered
from analysis.gap.measures.ledger import temporal_scale
from analysis.gap.noise.variance import noise_findings
from analysis.gap.processed.compressed import (
    GROUNDS,
    OF_FILES,
    SHALLOW,
    Compressed,
    compressed,
    dip,
    grounds,
    notes,
    processings,
    qualities,
    with_errors,
)
from analysis.gap.processed.matrices import Matrix, unmixed
from analysis.gap.processed.processing import Processing
from analysis.gap.processed.processing import notes as notes_on_mosaics
from analysis.gap.sensor.expected import expected, mean_dn
from analysis.gap.sensor.halved_colour import LUMA, halved_colour
from interchange.camera import Camera, Sensor
from interchange.captures import Capture, Captures
from interchange.effects.jpeg import Jpeg, decoded
from interchange.formats.document import open_scene
from interchange.image import Image, Quantity
from interchange.light import Light, LightKind
from interchange.scene import Scene
from interchange.sensor import Mosaic
from tests.analysis.gap.bench import Rig, rig_in

CAMERA = Camera("/World/eye", sensor=Sensor((160, 120), (5e-6, 5e-6), 2e4, 2e4, bit_depth=8, read_noise=60))


def colours(rng: np.random.Generator, noise: float = 1.0) -> np.ndarray:
    """(120, 160, 3) DN: tiles of many colours, 13 px wide, under light that falls off, with noise."""
    tiles = np.kron(rng.uniform(20, 200, (10, 13, 3)), np.ones((13, 13, 1)))[:120, :160]
    fall = np.linspace(1, 0.6, 160)[None, :, None]
    return np.asarray(tiles * fall + noise * rng.standard_normal((120, 160, 3)))


def packed(dn: np.ndarray, quality: float, halved: bool) -> np.ndarray:
    y = np.clip(np.rint(dn), 0, 255).astype(np.float32)
    return decoded(Jpeg(quality, halved).encoded(Image(y))).astype(np.float32) if quality else y


def taken(pixels: np.ndarray, camera: Camera = CAMERA, repeats: int = 1) -> Condition:
    capture = Capture("a.png", camera.name, 0.0, 1.0, pixels, bits=8)
    spread = np.zeros_like(pixels) if repeats > 1 else None
    return Condition((capture,) * repeats, Scene(), camera, pixels, spread, np.ones(pixels.shape[:2], bool))


def jpegs(found: list[Condition]) -> list[Compressed]:
    return compressed([(c.camera, c.captures[0]) for c in found])


@pytest.mark.parametrize("halved", [True, False])
@pytest.mark.parametrize("quality", [0, 40, 75, 90, 95, 98])
def test_compression_is_seen_and_its_quality_found(quality: int, halved: bool) -> None:
    told = jpegs([taken(packed(colours(np.random.default_rng(quality)), quality, halved))])
    if not quality:
        assert told == []
        return
    (found,) = told
    assert abs(found.quality - quality) <= 1
    assert found.halved is halved


def test_grey_has_no_colour_to_halve() -> None:
    (found,) = jpegs([taken(packed(colours(np.random.default_rng(1))[..., :1], 80, False))])
    assert found == Compressed(CAMERA.name, 80, False)


@pytest.mark.parametrize("quality", [60, 100])
def test_what_files_say_is_taken_for_it(quality: int) -> None:
    """Also of a quality that no pixels tell, and with grounds and a number that say so."""
    bare = taken(packed(colours(np.random.default_rng(1)), quality, False))
    file = replace(bare, captures=tuple(replace(x, jpeg=(quality, True)) for x in bare.captures))
    found = jpegs([file])
    assert found == [Compressed(CAMERA.name, quality, True, stated=True)]
    assert (qualities(found)["quality"].sigma, grounds(found)) == (0.0, OF_FILES)
    untold = Compressed(CAMERA.name, quality, True)
    assert (qualities([untold])["quality"].sigma, grounds([*found, untold])) == (1.0, GROUNDS)


def test_what_is_even_or_noise_alone_is_no_jpeg() -> None:
    """A dark, even image is rounded now this way and now that, at whatever quality."""
    noise = np.random.default_rng(2).standard_normal((120, 160, 3))
    for dn in (np.full((120, 160, 3), 4.0), 4 + 0.3 * noise, 90 + 2 * noise):
        pixels = packed(dn, 0, False)
        assert dip(pixels)[1] > SHALLOW + 0.1
        assert jpegs([taken(pixels)]) == []


def test_what_the_scene_says_is_not_told_again() -> None:
    known = Compressed(CAMERA.name, 90, True).of(CAMERA)
    assert jpegs([taken(packed(colours(np.random.default_rng(1)), 90, True), known)]) == []


def test_colour_is_halved_as_libjpeg_halves_it() -> None:
    """At the best quality, where blocks are rounded to a DN or so: sharp colour is off by 8 DN rms."""
    dn = colours(np.random.default_rng(3), 0.0)
    through = packed(dn, 100, True)
    assert np.sqrt(np.mean((through - dn) ** 2)) > 5
    inside = np.zeros(dn.shape[:2], bool)
    inside[1:-1, 1:-1] = True
    assert (
        np.sqrt(np.mean((through - halved_colour(dn))[inside] ** 2)) < 0.9
    )  # rounding of YCbCr and RGB: 0.7
    odd = dn[:119, :157]
    assert np.sqrt(np.mean((packed(odd, 100, True) - halved_colour(odd)) ** 2)) < 1.2


def test_brightness_is_kept_and_grey_is_as_it_was() -> None:
    dn = colours(np.random.default_rng(4), 0.0)
    assert halved_colour(dn) @ LUMA == pytest.approx(dn @ LUMA, abs=1e-3)
    grey = np.repeat(dn[..., :1], 3, axis=2)
    assert halved_colour(grey) == pytest.approx(grey, abs=1e-3)
    assert np.array_equal(halved_colour(dn[..., :1]), dn[..., :1])


def test_a_camera_s_mean_has_its_jpeg() -> None:
    radiance = (colours(np.random.default_rng(5), 0.0) / 300).astype(np.float32)
    image = Image(radiance, Quantity.RADIANCE, CAMERA)
    plain = mean_dn(image, CAMERA)
    halved = Compressed(CAMERA.name, 90, True).of(CAMERA)
    assert mean_dn(image, halved) == pytest.approx(halved_colour(plain), abs=1e-3)
    assert expected(radiance, halved).dn == pytest.approx(halved_colour(plain), abs=1e-3)
    assert np.array_equal(mean_dn(image, Compressed(CAMERA.name, 90, False).of(CAMERA)), plain)


def test_files_of_a_camera_of_more_bits_have_eight() -> None:
    camera = replace(CAMERA, sensor=replace(CAMERA.sensor, bit_depth=12))
    sensor = Compressed(CAMERA.name, 90, True).of(camera).sensor
    assert (sensor.bit_depth, sensor.bits_out, sensor.jpeg_quality) == (12, 8, 90)
    other = replace(camera, name="/World/other")
    assert Compressed(CAMERA.name, 90, True).of(other) is other


def test_repeats_of_a_jpeg_tell_no_noise() -> None:
    pixels = packed(colours(np.random.default_rng(6)), 90, True)
    c = taken(pixels, Compressed(CAMERA.name, 90, True).of(CAMERA), repeats=2)
    assert temporal_scale([c]) is None
    assert {n.name for n in noise_findings([c], [pixels])} <= {"quantization", "saturation"}


def test_qualities_and_notes_say_which_camera() -> None:
    one, two = Compressed("/World/a", 90, True), Compressed("/World/b", 80, False)
    assert list(qualities([one])) == ["quality"]
    assert {n: x.value for n, x in qualities([one, two]).items()} == {"a quality": 90, "b quality": 80}
    assert "colour at half" in notes([one])[0]
    assert "colour at half" not in notes([two])[0]
    assert notes([]) == []
    assert len(notes([one, two], ["/World/c"])) == 1
    assert "JPEGs of b, and" in notes([one, two], ["/World/b"])[1]


def lit(camera: Camera) -> Condition:
    """Tiles of many colours, simulated; nothing is captured."""
    lamp = "/lamp"
    scene = Scene(lights=(Light(lamp, LightKind.SPHERE, (1.0, 1.0, 1.0)),))
    radiance = (colours(np.random.default_rng(7), 0.0) / 300).astype(np.float32)
    nothing = np.zeros_like(radiance)
    shown = Rendered(scene, CAMERA, {lamp: radiance}, {lamp: np.ones(3)}, nothing, nothing, {}, {})
    return replace(taken(nothing, camera), scene=scene, rendered=shown)


@pytest.mark.parametrize("quality", [50, 75, 92])
def test_what_compressing_leaves_is_weighed(quality: int) -> None:
    """Captures of their own simulation, compressed: no more is left than is expected, and less than before."""
    bare = lit(Compressed(CAMERA.name, quality, True).of(CAMERA))
    plain = replace(bare, camera=CAMERA).simulated()
    noise = np.sqrt(plain.variance) * np.random.default_rng(8).standard_normal(plain.dn.shape)
    taken_in = [replace(bare, mean=packed(plain.dn + noise, quality, True))]
    (c,) = with_errors(taken_in, processings(taken_in))
    simulated = c.simulated()
    left = np.square(c.mean - simulated.dn)
    assert left.mean() < 0.9 * np.square(packed(plain.dn + noise, quality, True) - simulated.dn).mean()
    unweighed = np.square(c.mean - bare.simulated().dn) / bare.simulated().variance
    assert unweighed.mean() > 1.5
    temporal, fixed = c.variance_at(simulated.dn)
    for variance in (simulated.variance, temporal + fixed):
        assert (left / variance).mean() < 1.1


def blurred(dn: np.ndarray) -> np.ndarray:
    return np.asarray(cv2.GaussianBlur(dn, (0, 0), 0.7))


@pytest.mark.parametrize("pattern", [p for p in Mosaic if p is not Mosaic.MONO])
def test_the_mosaic_before_a_jpeg_is_told_and_blur_is_none(pattern: Mosaic) -> None:
    bare = lit(Compressed(CAMERA.name, 95, True).of(CAMERA))
    plain = replace(bare, camera=CAMERA).simulated()
    noise = np.sqrt(plain.variance) * np.random.default_rng(8).standard_normal(plain.dn.shape)
    for fall in (1.0, np.linspace(1, 0.8, 160)[:, None]):  # a vignetting that is not simulated
        by = Processing(CAMERA, None, pattern)
        through = packed(by.applied(fall * plain.dn + noise), 95, True)
        told = processings([replace(bare, mean=through)])[CAMERA.name]
        assert told.mosaic is pattern
    soft = packed(blurred(plain.dn) + noise, 95, True)
    assert processings([replace(bare, mean=soft)])[CAMERA.name].mosaic is Mosaic.NONE
    beside = packed(
        np.roll(plain.dn, (0, 1), (0, 1)) + noise, 95, True
    )  # a camera that is not yet registered
    assert processings([replace(bare, mean=beside)])[CAMERA.name].mosaic is Mosaic.NONE


def test_a_mosaic_that_was_told_is_said() -> None:
    by = [Processing(CAMERA, None, Mosaic.GBRG), Processing(replace(CAMERA, name="/World/other"))]
    (note,) = notes_on_mosaics(by)
    assert "eye (GBRG)" in note
    assert "other" not in note
    assert notes_on_mosaics(by[1:]) == []


def test_what_a_matrix_and_a_mosaic_make_of_a_jpeg_is_weighed() -> None:
    """Captures of their own simulation, interpolated, mixed, compressed and unmixed: most of what that does is
    gone from them, and the rest is weighed."""
    rows = np.array([[1.5, -0.4, -0.1], [-0.25, 1.45, -0.2], [-0.05, -0.5, 1.55]])
    matrix = Matrix(CAMERA.name, rows, (0.0,) * 6)
    bare = lit(Compressed(CAMERA.name, 95, True).of(CAMERA))
    plain = replace(bare, camera=CAMERA).simulated()
    noise = np.sqrt(plain.variance) * np.random.default_rng(8).standard_normal(plain.dn.shape)
    through = packed(Processing(CAMERA, matrix, Mosaic.RGGB).applied(plain.dn + noise), 95, True)
    file = Capture("a.png", CAMERA.name, 0.0, 1.0, through, bits=8)
    files = Captures(Path("captures.json"), Path("scene.usda"), (file,))
    (back,) = unmixed(files, {CAMERA.name: CAMERA}, [matrix]).captures
    assert back.mask is not None
    captured = replace(bare, captures=(back,), mean=back.pixels, mask=back.mask)

    (c,) = with_errors([captured], processings([captured], [matrix]))
    simulated = c.simulated()
    ok = captured.compared
    left, before = (np.square(x - simulated.dn)[ok] for x in (c.mean, captured.mean))
    assert left.mean() < 0.5 * before.mean()
    assert (left / simulated.variance[ok]).mean() < 1.15


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory, kept: Path) -> Rig:
    """A pin before prints, seen by one camera: whatever else could have moved takes most of a diagnosis's time."""
    without = ("bracket", "ball", "wall_a", "wall_b")
    folder = tmp_path_factory.mktemp("compressed")
    return rig_in(folder, kept, without, reflected=False, times=(0, 1, 4, 6, 10, 12))


@pytest.mark.slow
def test_captures_that_are_jpegs_are_told_and_nothing_else(bare: Rig) -> None:
    """Of 8 bits, colour halved: the file is found, the corrected scene says it, and rendered anew the claim holds."""
    captures = bare.captured("jpegs", ())
    files = [replace(c, pixels=packed(c.pixels * (255 / 4095), 85, True), bits=8) for c in captures.captures]
    d = bare.diagnosed(replace(captures, captures=tuple(files)), "jpegs", reflected=False).diagnosis
    assert [e.name for e in d.effects] == ["jpeg"]
    assert d.unknown == ()
    assert d.effects[0].parameters["quality"].value == pytest.approx(85, abs=1)
    assert d.gap.after < min(1.1, d.gap.before)
    sensor = open_scene(bare.folder / "jpegs" / d.corrected_scene).scene().cameras[0].sensor
    assert (sensor.bits_out, sensor.jpeg_subsampling) == (8, True)
    assert abs(sensor.jpeg_quality - 85) <= 1
    assert d.verification is not None
    assert d.verification.holds
    assert any("are JPEGs" in note for note in d.notes)
    assert not any("Not tried" in note and "jpeg" in note for note in d.notes)
