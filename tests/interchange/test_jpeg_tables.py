"""What JPEG files say of their compression, of files that libjpeg and OpenCV wrote."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from interchange.formats.jpeg_tables import stated

PIXELS = np.random.default_rng(0).integers(0, 255, (24, 32, 3), np.uint8)


@pytest.mark.parametrize("quality", [1, 30, 75, 90, 95, 99, 100])
@pytest.mark.parametrize(("sampling", "halved"), [("4:4:4", False), ("4:2:2", False), ("4:2:0", True)])
def test_quality_and_colours_are_those_of_the_writer(tmp_path, quality, sampling, halved):
    Image.fromarray(PIXELS).save(tmp_path / "a.jpg", quality=quality, subsampling=sampling)
    assert stated(tmp_path / "a.jpg") == (quality, halved)


def test_another_writer_is_told_alike(tmp_path):
    cv2.imwrite(str(tmp_path / "a.jpg"), PIXELS, [cv2.IMWRITE_JPEG_QUALITY, 83])
    assert stated(tmp_path / "a.jpg") == (83, True)  # OpenCV halves colours


def test_grey_has_no_colour_to_halve(tmp_path):
    Image.fromarray(PIXELS[..., 0]).save(tmp_path / "a.jpg", quality=60)
    assert stated(tmp_path / "a.jpg") == (60, False)


def test_tables_of_somebody_else_are_the_nearest(tmp_path):
    Image.fromarray(PIXELS).save(tmp_path / "a.jpg", quality=85)
    with Image.open(tmp_path / "a.jpg") as image:
        tables = {k: [max(t + t // 16, 1) for t in v] for k, v in image.quantization.items()}
    Image.fromarray(PIXELS).save(tmp_path / "b.jpg", qtables=tables)
    quality, _ = stated(tmp_path / "b.jpg")
    assert 83 <= quality <= 85


@pytest.mark.parametrize("data", [b"", b"\xff\xd8\xff", b"\x89PNG"])
def test_what_is_no_jpeg_says_nothing(tmp_path: Path, data):
    (tmp_path / "a.jpg").write_bytes(data)
    assert stated(tmp_path / "a.jpg") is None
