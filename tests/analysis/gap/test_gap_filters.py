"""Colour sensors are diagnosed by what their pixels measured, each channel where its filters lie."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from analysis.gap.diagnosis import Diagnosis
from analysis.gap.finding import Estimate, Finding
from analysis.gap.processed.binned import Binning, binned_camera, binning_of, times_binned
from analysis.gap.processed.declared import without_declared
from analysis.gap.processed.matrices import Matrix
from analysis.gap.processed.own_pixels import notes, of_own_pixels
from analysis.gap.processed.raw import raw, tells_its_pixels
from analysis.gap.report.words import sentence
from analysis.gap.sensor.expected import expected
from analysis.gap.sensor.filters import BehindFilters, at_filters, offsets, seen_through, shares, sites
from interchange.camera import Camera, Lens
from interchange.captures import Capture, Captures
from interchange.effects.white_balance import WhiteBalance
from interchange.exposure import expose
from interchange.formats import captures as captures_file
from interchange.formats.document import Document, open_scene
from interchange.image import Image, Quantity
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.sensor import IDENTITY, Demosaic, Mosaic, Sensor
from tests.analysis.gap.bench import Rig, little_bench, rig_in

SENSOR = Sensor(
    (96, 64),
    (5e-6, 5e-6),
    80.0,
    9000.0,
    12,
    64.0,
    8.0,
    prnu=0.01,
    dsnu=4.0,
    row_noise=2.0,
    mosaic=Mosaic.GRBG,
)
CAMERA = Camera("/World/Camera", lens=Lens(12e-3), sensor=SENSOR, t_exp=0.02)
MIXED = (1.4, -0.3, -0.1, -0.2, 1.5, -0.3, 0.0, -0.4, 1.4)


def of_mosaic(pattern: Mosaic, n: int) -> Camera:
    return binned_camera(replace(CAMERA, sensor=replace(SENSOR, resolution=(192, 96), mosaic=pattern)), n)


@pytest.mark.parametrize("pattern", [Mosaic.RGGB, Mosaic.BGGR, Mosaic.GRBG, Mosaic.GBRG])
@pytest.mark.parametrize(("n", "finer"), [(2, 6), (4, 4), (6, 6)])
def test_light_is_that_of_the_pixels_behind_each_filter(pattern: Mosaic, n: int, finer: int) -> None:
    """Against a mosaic that is written pixel by pixel."""
    h, w = 3, 4
    fine = np.random.default_rng(1).random((finer * h, finer * w, 3), np.float32)
    part = finer // n  # of the grid, along a pixel of the mosaic
    own = fine.reshape(n * h, part, n * w, part, 3).mean(axis=(1, 3))
    taken: dict[tuple[int, int, int], list[float]] = {}
    greens = [k for k, letter in enumerate(pattern.value) if letter == "G"]
    for y in range(n * h):
        for x in range(n * w):
            place = 2 * (y % 2) + x % 2
            if place != greens[1]:
                channel = "RGB".index(pattern.value[place])
                taken.setdefault((y // n, x // n, channel), []).append(float(own[y, x, channel]))
    sensor = of_mosaic(pattern, n).sensor
    assert isinstance(sensor, BehindFilters)
    found = seen_through(fine, finer, sensor)
    for (y, x, channel), values in taken.items():
        assert len(values) == n * n // 4
        assert found[y, x, channel] == pytest.approx(np.mean(values), abs=1e-6)


@pytest.mark.parametrize("n", [2, 4])
def test_what_is_rendered_on_the_sensor_s_grid_is_moved_as_far(n: int) -> None:
    camera = of_mosaic(Mosaic.RGGB, n)
    sensor = camera.sensor
    assert isinstance(sensor, BehindFilters)
    aside = offsets(camera)
    assert aside is not None
    assert aside == pytest.approx(np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5]]) / n)
    middles = (np.arange(12) + 0.5) / 12 - 0.5
    for share, (u, v) in zip(shares(sensor, 12), aside, strict=True):
        assert share.sum() == pytest.approx(1)
        assert (share.sum(axis=0) @ middles, share.sum(axis=1) @ middles) == pytest.approx((u, v))
    row, column = np.mgrid[:30, :40].astype(np.float32)
    plane = np.repeat((column**2 + 2 * row + column * row)[..., None], 3, axis=2)
    there = at_filters(plane, camera)
    for k, (u, v) in enumerate(aside):
        x, y = column + u, row + v
        assert there[2:-2, 2:-2, k] == pytest.approx((x**2 + 2 * y + x * y)[2:-2, 2:-2], rel=1e-4, abs=0.02)


@pytest.mark.parametrize("method", [Demosaic.BILINEAR, Demosaic.EDGE_AWARE])
@pytest.mark.parametrize("mixed", [False, True])
def test_demosaiced_captures_tell_what_pixels_measured(method: Demosaic, mixed: bool) -> None:
    light = Image(np.random.default_rng(2).uniform(300, 500, (64, 96, 3)).astype(np.float32), camera=CAMERA)
    plain = replace(SENSOR, demosaic=Demosaic.NONE)
    processed = replace(SENSOR, demosaic=method, **({"color_correction": MIXED} if mixed else {}))
    measured, given = (
        expose(light, replace(CAMERA, sensor=s), rng=np.random.default_rng(3)).pixels
        for s in (plain, processed)
    )
    camera = replace(CAMERA, sensor=processed)
    capture = Capture("a.png", CAMERA.name, 0.0, CAMERA.t_exp, given)
    document: Any = SimpleNamespace(
        scene=lambda time=None: Scene(cameras=(camera,)), stage=None, path=None, problems=[]
    )
    plain = without_declared(Captures(Path("c.json"), Path("s.usda"), (capture,)), document)
    assert plain.document.scene().cameras[0].sensor.color_correction == IDENTITY
    assert not plain.processed
    told = raw(plain.captures.captures[0], camera)
    assert told.pixels.shape == measured.shape
    assert told.mask is not None
    assert told.mask.sum() == 62 * 94
    # rounded after the matrix, of whose inverse the rows have a norm of 1 at most, and no DN is cut off
    assert np.abs(told.pixels - measured)[told.mask].max() <= (1.0 if mixed else 0.0)
    assert told.has_codes is not mixed


@pytest.mark.parametrize("n", [2, 4])
def test_a_mean_of_one_filter_s_pixels_is_what_a_sensor_that_bins_reads(n: int) -> None:
    """Mean and both variances of each channel against frames of the mosaic: 500 frames of 384 or 96 means."""
    level = np.array([400.0, 900.0, 150.0], np.float32)
    camera = replace(CAMERA, sensor=replace(SENSOR, demosaic=Demosaic.NONE, row_noise=0.0))
    flat = Image(np.broadcast_to(level, (64, 96, 3)).copy(), Quantity.RADIANCE, camera)
    rng = np.random.default_rng(2)
    h, w = 64 // n, 96 // n
    frames = []
    for _ in range(500):
        dn = expose(flat, camera, rng=rng).pixels.reshape(h, n, w, n)
        frames.append(
            np.stack([dn[:, i::2, :, j::2].mean(axis=(1, 3)) for i, j in sites(Mosaic.GRBG)], axis=2)
        )
    seen = np.array(frames)
    model = expected(np.broadcast_to(level, (h, w, 3)).copy(), binned_camera(camera, n))
    for k in range(3):
        values = seen[..., k]
        assert values.mean() == pytest.approx(model.dn[..., k].mean(), rel=0.002)
        assert values.var(axis=0, ddof=1).mean() == pytest.approx(model.temporal[..., k].mean(), rel=0.02)
        pattern = values.mean(axis=0).var() - values.var(axis=0).mean() / len(values)
        spread = np.sqrt(2 / values[0].size)  # of a variance, relative
        assert pattern == pytest.approx(model.fixed[..., k].mean(), rel=4 * spread)


def test_numbers_are_told_of_own_pixels() -> None:
    def told(effect: str, name: str, unit: str) -> float:
        finding = Finding(effect, 0.9, {name: Estimate(2.0, 0.5, unit)}, (), "", 2.0, 1.0, 0.5)
        return of_own_pixels(finding, Binning(4, colours=True)).parameters[name].value

    assert told("principal_point", "cx", "px") == pytest.approx(8)
    assert told("sensor_noise", "K", "DN/e-") == pytest.approx(8)
    assert told("rolling_shutter", "line_time", "s") == pytest.approx(0.5)


@pytest.fixture(scope="module")
def colours(tmp_path_factory: pytest.TempPathFactory, kept: Path) -> Rig:
    """A pin before prints, seen by one camera behind a mosaic, which demosaics."""
    without = ("bracket", "ball", "wall_a", "wall_b")
    return rig_in(
        tmp_path_factory.mktemp("colours"), kept, without, False, (0, 1, 4, 6, 7, 10, 12), mosaic="RGGB"
    )


GAINS = WhiteBalance(red=1.06, blue=0.95)


@pytest.fixture(scope="module")
def captures(colours: Rig) -> Captures:
    return colours.captured("balance", (GAINS,))


@pytest.fixture(scope="module")
def declared(colours: Rig, captures: Captures) -> Diagnosis:
    n = times_binned(captures, colours.document)
    assert n == 2
    return colours.diagnosed(captures, "balance", binning=n, reflected=False).diagnosis


@pytest.mark.slow
def test_a_colour_camera_s_channels_are_told_apart(captures: Captures, declared: Diagnosis) -> None:
    """Demosaiced captures with repeats: their noise is the sensor's, where interpolated values would have less; what
    its filters do is no aberration, and channels are off by what they are off by."""
    assert captures.captures[0].pixels.shape[2] == 3
    d = declared
    assert {e.name for e in d.effects} == {"white_balance"}
    for name, true in (("red", GAINS.red), ("blue", GAINS.blue)):
        found = d.effects[0].parameters[name]
        assert abs(found.value - true) < 4 * found.sigma < 0.05
    assert d.gap.after < 1.1
    assert any("mosaic of colours" in note for note in d.notes)
    assert not any("Not tried" in note and "sensor noise" in note for note in d.notes)
    assert d.verification is not None
    assert d.verification.holds


@pytest.mark.slow
def test_a_mosaic_that_the_scene_file_does_not_say_is_taken_as_one(
    colours: Rig, captures: Captures, declared: Diagnosis, tmp_path: Path
) -> None:
    """The same is told as where the file says it, and the corrected scene has it."""
    file = tmp_path / "scene.usda"
    file.write_text((colours.folder / "scene.usda").read_text().replace('token sensor:mosaic = "RGGB"', ""))
    silent = replace(colours, document=open_scene(file))
    assert times_binned(captures, silent.document) == 2
    d = silent.diagnosed(captures, "undeclared", binning=2, reflected=False).diagnosis
    assert [(e.name, e.parameters) for e in d.effects] == [(e.name, e.parameters) for e in declared.effects]
    assert d.gap == declared.gap
    assert any("interpolated from a mosaic of colours (RGGB)" in note for note in d.notes)
    assert d.verification == declared.verification
    sensor = open_scene(colours.folder / "undeclared" / d.corrected_scene).scene().cameras[0].sensor
    assert (sensor.mosaic, sensor.demosaic) == (Mosaic.RGGB, Demosaic.BILINEAR)
    assert any("--bin 2 takes" in note for note in notes(captures, binning_of(captures, silent.document, 1)))


@pytest.mark.slow
def test_a_matrix_is_taken_back_before_the_pixels_are(
    colours: Rig, captures: Captures, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Captures that were interpolated and then mixed; which matrix it was is given here, as this bench has too few
    colours to tell it. All else is told as without it."""
    rows = np.array([[1.5, -0.4, -0.1], [-0.25, 1.45, -0.2], [-0.05, -0.5, 1.55]])
    black = colours.document.scene().cameras[0].sensor.black_level
    mixed = replace(
        captures,
        captures=tuple(
            replace(c, pixels=np.rint((c.pixels - black) @ rows.T + black).astype(np.float32))
            for c in captures.captures
        ),
    )
    found = Matrix(captures.captures[0].camera, rows, (0.005,) * 6)
    monkeypatch.setattr("analysis.gap.processed.beforehand.matrices", lambda conditions: [found])
    d = colours.diagnosed(mixed, "mixed", binning=2, reflected=False).diagnosis
    of = {e.name: e for e in d.effects}
    assert set(of) == {"white_balance", "color_crosstalk"}
    for name, true in (("red", GAINS.red), ("blue", GAINS.blue)):
        told = of["white_balance"].parameters[name]
        assert abs(told.value - true) < 4 * told.sigma < 0.05
    assert of["color_crosstalk"].parameters["rg"].value == -0.4
    assert d.gap.after < 1.1
    assert d.verification is not None
    assert d.verification.holds
    assert any("went through a colour matrix" in note for note in d.notes)
    assert "colour matrix (color crosstalk)" in sentence(d)
    corrected = open_scene(colours.folder / "mixed" / d.corrected_scene)
    assert corrected.scene().cameras[0].sensor.color_correction == pytest.approx(rows.ravel())
    monkeypatch.undo()
    again = replace(colours, document=corrected).diagnosed(mixed, "again", binning=2, reflected=False)
    assert again.diagnosis.verdict == "none"
    assert again.diagnosis.gap.before < 1.1


def test_what_cannot_be_is_told(colours: Rig, tmp_path: Path) -> None:
    captures = colours.captured("odd", ())
    with pytest.raises(BrightfieldError, match="--bin must be even"):
        binning_of(captures, colours.document, 3)
    file = tmp_path / "scene.usda"
    little_bench(file, 112, 84, mosaic="RGGB")
    text = file.read_text()
    entries = []
    for k in range(2):
        (tmp_path / f"{k}.png").write_bytes((colours.folder / "odd" / "00.png").read_bytes())
        entries.append({"image": f"{k}.png", "camera": f"/World/Camera{k}", "time": 0, "exposure": 1.0})
    (tmp_path / "captures.json").write_text(json.dumps({"scene": "scene.usda", "captures": entries}))

    def with_other(words: str) -> tuple[Captures, Document]:
        """Its second camera has these attributes."""
        head, tail = text.rsplit('token sensor:mosaic = "RGGB"', 1)
        file.write_text(head + words + tail)
        return captures_file.read(tmp_path / "captures.json"), open_scene(file)

    with pytest.raises(BrightfieldError, match="must be diagnosed apart"):
        binning_of(*with_other('token sensor:mosaic = "mono"'), 2)
    processed = with_other(
        'token sensor:mosaic = "RGGB"\n int sensor:outputBitDepth = 8\n int sensor:jpegQuality = 90'
    )
    assert times_binned(*processed) == 1
    with pytest.raises(BrightfieldError, match="mosaic of colours that is processed, cannot be binned"):
        binning_of(*processed, 2)


def test_one_channel_of_a_colour_camera_is_raw() -> None:
    """Also where the scene file says that the camera demosaics."""
    capture = Capture("a.png", CAMERA.name, 0.0, CAMERA.t_exp, np.ones((64, 96, 1), np.float32))
    assert tells_its_pixels(capture, CAMERA)
    assert raw(capture, CAMERA) is capture
