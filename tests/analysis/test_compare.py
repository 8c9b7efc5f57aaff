"""A pair of images: differences in closed form, and algorithms' results that move as the images do."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.special import ndtr

from analysis.compare.algorithms import edge_points, results
from analysis.compare.comparison import compare, record
from analysis.compare.numbers import difference
from analysis.compare.reading import read_pair
from composer.cli import main
from interchange.formats import exr, images
from interchange.image import Image, Quantity
from interchange.problems import BrightfieldError

H, W = 120, 160


def _board(dx: float = 0.0, dy: float = 0.0, blur: float = 0.7) -> np.ndarray:
    """(H, W, 1): squares of 20 px, dark 200 and bright 1000, their edges moved by (dx, dy) px."""
    y, x = np.mgrid[:H, :W]

    def wave(t: np.ndarray) -> np.ndarray:
        return sum((-1.0) ** k * 2 * ndtr((t - 20 * k) / blur) for k in range(-2, 12)) - 1

    return (600 + 400 * wave(x - 9.5 - dx) * wave(y - 9.5 - dy))[..., None].astype(np.float32)


def _dn(pixels: np.ndarray) -> Image:
    return Image(np.rint(pixels).astype(np.float32), Quantity.DN, made_by={"bits": 16})


def test_more_edge_points_than_opencv_takes_in_a_column() -> None:
    """Stripes of 4 px, of which the edges are every 4 px: 100 columns of 396 places and more than 2^15 in all."""
    x = np.broadcast_to(np.arange(400.0), (400, 400))
    stripes = np.round(600 + 400 * np.sin(2 * np.pi * (x - 0.3) / 8)).astype(np.float32)[..., None]
    found = results(Image(stripes), Image(stripes))
    assert min(found.edges.found) > 2**15
    assert found.edges.f1 == 1
    assert found.edges.rms_px == 0


def test_gradients_too_weak_for_an_edge_have_none() -> None:
    plane = np.tile(np.arange(64, dtype=np.float32), (48, 1))
    assert edge_points(plane, 1e3).shape == (0, 5)


def test_gain_and_offset_show_as_they_are() -> None:
    a = _board()
    d = difference(Image(a), Image(1.1 * a + 5))
    assert d.bias == pytest.approx(0.1 * a.mean() + 5, rel=1e-5)
    assert d.rms == pytest.approx(np.sqrt(np.mean((0.1 * a + 5) ** 2)), rel=1e-5)
    assert (d.gain, d.offset) == pytest.approx((1.1, 5), rel=1e-3)


def test_noise_gives_its_psnr() -> None:
    """PSNR = 20 log10(4095 / 8) = 54.2 dB; 19,200 values: ± 0.04 dB."""
    noise = 8 * np.random.default_rng(1).standard_normal((H, W, 1))
    a = np.full((H, W, 1), 3000.0)
    d = difference(_dn(a), _dn(a + noise))
    assert d.peak == 4095
    assert d.psnr_dB == pytest.approx(20 * np.log10(4095 / np.hypot(8, np.sqrt(1 / 12))), abs=0.15)
    assert d.ssim < 1


def test_equal_images_agree_in_everything() -> None:
    c = compare(_dn(_board()), _dn(_board()))
    assert c.difference.rms == 0
    assert c.difference.ssim == pytest.approx(1)
    r = c.results
    assert r.edges.f1 == r.corners.f1 == r.segmentation.overlap == r.segmentation.agreement == 1
    assert r.edges.rms_px == r.corners.rms_px == 0
    data = json.loads(json.dumps(record(c), allow_nan=False))
    assert data["difference"]["psnr_dB"] is None
    assert data["edges"]["f1"] == 1


@pytest.mark.parametrize("dx", [0.1, 0.45])
def test_a_shift_shows_in_edges_and_corners(dx: float) -> None:
    """Half of the edges stand upright and move by dx, half lie and do not: rms dx / √2, mean 0."""
    r = results(_dn(_board()), _dn(_board(dx=dx)))
    assert r.edges.f1 > 0.98
    assert r.edges.mean_px == pytest.approx(0, abs=0.02)
    assert r.edges.rms_px == pytest.approx(
        dx / np.sqrt(2), abs=0.04
    )  # an edge's place by a parabola: some 0.02 px
    assert r.corners.found[0] >= 30
    assert r.corners.rms_px == pytest.approx(dx, abs=0.05)


def test_what_is_missing_is_told() -> None:
    a, b = _board(), _board()
    b[:, W // 2 :] = 200
    r = results(_dn(a), _dn(b))
    assert r.edges.recall == pytest.approx(0.5, abs=0.06)
    assert r.edges.precision > 0.9  # the new border is an edge of its own
    bright = a[..., 0] > r.segmentation.threshold[0]
    assert r.segmentation.overlap == pytest.approx(bright[:, : W // 2].sum() / bright.sum(), abs=0.02)


def test_nothing_to_find() -> None:
    r = results(_dn(np.full((H, W, 1), 100)), _dn(np.full((H, W, 1), 120)))
    assert r.edges.found == r.corners.found == (0, 0)
    assert np.isnan(r.edges.rms_px)


def test_only_equal_quantities_compare(tmp_path: Path) -> None:
    images.write(tmp_path / "a.png", _board().astype(np.uint16))
    images.write(tmp_path / "b.png", (_board() / 8).astype(np.uint8))
    images.write(tmp_path / "small.png", np.zeros((5, 6, 1), np.uint16))
    images.write(tmp_path / "colour.png", np.zeros((H, W, 3), np.uint16))
    exr.write(tmp_path / "c.exr", Image(np.repeat(_board(), 3, axis=2)))
    for other, said in (
        ("b.png", "bits"),
        ("small.png", "size"),
        ("colour.png", "channels"),
        ("c.exr", "same quantity"),
    ):
        with pytest.raises(BrightfieldError, match=said):
            read_pair(tmp_path / "a.png", tmp_path / other)


def test_the_command_writes_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    images.write(tmp_path / "a.png", _board().astype(np.uint16))
    images.write(tmp_path / "b.png", _board(dx=0.3).astype(np.uint16))
    words = ["compare", str(tmp_path / "a.png"), str(tmp_path / "b.png"), "--out", str(tmp_path / "out")]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "rms difference" in said
    assert {p.name for p in (tmp_path / "out").iterdir()} == {
        "compare.html",
        "compare.json",
        "difference.png",
    }
    page = (tmp_path / "out/compare.html").read_text()
    assert page.count("data:image/") >= 5
    assert "http" not in page
    assert json.loads((tmp_path / "out/compare.json").read_text())["a"] == "a.png"
    assert main(["compare", str(tmp_path / "a.png"), str(tmp_path / "no.png")]) == 2
