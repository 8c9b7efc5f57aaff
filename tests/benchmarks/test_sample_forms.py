"""The sample captures in other forms, as the diagnosis reads them."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks import sample_forms
from interchange.captures import Captures
from interchange.formats import captures
from interchange.formats.document import open_scene
from interchange.sensor import Demosaic, Mosaic, Response

SAMPLE = Path(__file__).parents[2] / "assets/bench_sample"


@pytest.fixture(scope="module")
def forms(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Captures]:
    out = tmp_path_factory.mktemp("forms")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["sample_forms.py", str(SAMPLE), str(out)])
        sample_forms.main()
    return {folder.name: captures.read(folder / "captures.json") for folder in out.iterdir()}


def test_every_form_can_be_read(forms: dict[str, Captures]) -> None:
    assert set(forms) == {*sample_forms.FORMS, "few", "undeclared"}
    assert {n for n, c in forms.items() if c.captures[0].bits == 8} == {
        "eight",
        "srgb",
        "picture",
        "jpeg",
        "declared",
        "compressed",
        "gamma_0.45",
        "gamma_0.7",
        "rec709",
        "toned",
    }
    assert {n for n, c in forms.items() if c.captures[0].pixels.shape[2] == 1} == {"grey", "raw"}
    assert len(forms["few"].captures) == len(sample_forms.FEW)
    assert "tolerances" not in json.loads(forms["undeclared"].file.read_text())


def test_the_scene_of_what_is_declared_says_it(forms: dict[str, Captures]) -> None:
    for camera in open_scene(forms["declared"].scene).scene().cameras:
        s = camera.sensor
        assert (s.mosaic, s.demosaic, s.response) == (Mosaic.RGGB, Demosaic.BILINEAR, Response.SRGB)
        assert (s.black_level, s.bits_out, s.jpeg_quality, s.jpeg_subsampling) == (0, 8, 95, True)
        assert s.color_correction == pytest.approx(sample_forms.SATURATING.ravel())
    assert open_scene(forms["jpeg"].scene).scene().cameras[0].sensor.mosaic is Mosaic.NONE


def test_what_a_filter_let_through_stays_where_it_was(forms: dict[str, Captures]) -> None:
    """RGGB: red at even rows and columns, blue at odd ones, as measured, interpolated or not; and a matrix whose rows
    have the sum 1 leaves grey as it is."""
    whole, raw, between = (captures.read(SAMPLE / "captures.json"), forms["raw"], forms["interpolated"])
    for a, b, c in zip(whole.captures, raw.captures, between.captures, strict=True):
        for channel, (row, column) in ((0, (0, 0)), (2, (1, 1))):
            here = slice(row, None, 2), slice(column, None, 2)
            inside = slice(1, -1), slice(1, -1)  # OpenCV repeats what is inside along the rim
            assert np.array_equal(b.pixels[here][..., 0], a.pixels[here][..., channel])
            assert np.array_equal(c.pixels[here][inside][..., channel], a.pixels[here][inside][..., channel])
    assert sample_forms.SATURATING.sum(axis=1) == pytest.approx(1)
