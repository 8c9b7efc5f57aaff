"""``captures.json``: what is read, and every problem at once, with its place."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Pillow

from interchange.captures import Tolerances
from interchange.formats import captures, exr, images
from interchange.image import Image, Quantity
from interchange.problems import FileError

ENTRY = {"image": "a.png", "camera": "/World/C", "time": 0, "exposure": 0.5}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "scene.usda").write_text("#usda 1.0\n")
    images.write(tmp_path / "a.png", np.full((4, 6, 3), 700, np.uint16))
    images.write(tmp_path / "b.tif", np.full((4, 6), 7, np.uint8))
    images.write(tmp_path / "m.png", np.eye(4, 6, dtype=np.uint8)[..., None])
    images.write(tmp_path / "small.png", np.ones((2, 2), np.uint8))
    return tmp_path


def _read(folder: Path, **head: object) -> captures.Captures:
    path = folder / "captures.json"
    path.write_text(json.dumps({"scene": "scene.usda", "captures": [ENTRY], **head}))
    return captures.read(path)


def _messages(folder: Path, **head: object) -> list[str]:
    with pytest.raises(FileError) as error:
        _read(folder, **head)
    return [str(p) for p in error.value.problems]


def test_defaults_are_the_contracts(folder: Path) -> None:
    found = _read(folder)
    (capture,) = found.captures
    assert found.tolerances == Tolerances(0.05, 0.005, 0.5, 0.003, 1.0, 0.005, 0.02, 0.05)
    assert (found.holdout, capture.gain_dB, capture.mask, capture.bits) == ((), None, None, 16)
    assert capture.pixels.shape == (4, 6, 3)
    assert (capture.pixels == 700).all()


def test_all_that_can_be_said_is_read(folder: Path) -> None:
    exr.write(folder / "c.exr", Image(np.full((4, 6, 3), 0.25, np.float32), Quantity.DN))
    entries = [
        {**ENTRY, "gain": 6, "mask": "m.png"},
        {**ENTRY, "image": "b.tif"},
        {**ENTRY, "image": "c.exr", "time": 2.5},
    ]
    found = _read(folder, captures=entries, holdout=["b.tif"], tolerances={"albedo": 0.02})
    first, grey, linear = found.captures
    assert first.gain_dB == 6
    assert first.mask is not None
    assert np.array_equal(first.mask, np.eye(4, 6, dtype=bool))
    assert (grey.pixels.shape, grey.bits, linear.bits, linear.time) == ((4, 6, 1), 8, 0, 2.5)
    assert found.holdout == ("b.tif",)
    assert found.tolerances == Tolerances(albedo=0.02)


def test_what_cameras_store_as_bmp_or_jpeg_is_read(folder: Path) -> None:
    for name in ("a.bmp", "a.JPG"):
        Pillow.fromarray(np.full((4, 6, 3), (40, 90, 140), np.uint8)).save(folder / name, quality=98)
    exact, lossy = _read(folder, captures=[{**ENTRY, "image": n} for n in ("a.bmp", "a.JPG")]).captures
    assert (exact.bits, lossy.bits) == (8, 8)
    assert (exact.pixels == (40, 90, 140)).all()
    assert lossy.pixels == pytest.approx(exact.pixels, abs=2)


def test_a_mask_is_no_jpeg(folder: Path) -> None:
    """Its 0 would be 3 beside an edge."""
    Pillow.fromarray(np.eye(4, 6, dtype=np.uint8)).save(folder / "m.jpg")
    (said,) = _messages(folder, captures=[{**ENTRY, "mask": "m.jpg"}])
    assert "A mask must be PNG, TIFF, BMP or EXR; got m.jpg." in said


def test_every_problem_is_told_at_once(folder: Path) -> None:
    entries = [
        {**ENTRY, "exposur": 1},
        {"image": "none.png", "camera": "/World/C", "time": 0, "exposure": 1},
        {**ENTRY, "image": "b.tif", "exposure": -1, "camera": 3},
        {**ENTRY, "image": "small.png", "mask": "m.png"},
        "x",
    ]
    said = _messages(
        folder,
        scene="nothing.usda",
        captures=entries,
        holdout=["a.pgn"],
        tolerances={"albdo": 1, "gloss": -1},
    )
    for place, words in (
        ("captures[0].exposur", 'Did you mean "exposure"?'),
        ("captures[1].image", "none.png"),
        ("captures[2].camera", "must be named"),
        ("captures[2].exposure", "[1e-12, 1e+06]"),
        ("captures[3].mask", "2 x 2 px; it has 6 x 4 px"),
        ("captures[4]", "must be an object"),
        ("scene", "nothing.usda"),
        ("holdout[0]", 'Did you mean "a.png"?'),
        ("tolerances.albdo", 'Did you mean "albedo"?'),
        ("tolerances.gloss", "must lie in"),
    ):
        assert any(f"captures.json: {place}:" in s and words in s for s in said), (place, said)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "must be JSON"),
        ("[]", "must hold a JSON object"),
        ('{"scene": "a", "scene": "b"}', "stands twice"),
        ('{"scene": "scene.usda", "captures": []}', "one capture or more"),
        ("[" * 100000, "must be JSON"),
    ],
)
def test_damaged_files(folder: Path, text: str, words: str) -> None:
    (folder / "captures.json").write_text(text)
    with pytest.raises(FileError, match=words):
        captures.read(folder / "captures.json")


def test_nothing_left_to_fit_to(folder: Path) -> None:
    assert "nothing is left to fit to" in " ".join(_messages(folder, holdout=["a.png"]))


def test_numbers_that_are_none(folder: Path) -> None:
    said = _messages(folder, captures=[{**ENTRY, "time": True, "exposure": None}])
    assert len(said) == 2
