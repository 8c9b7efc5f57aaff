"""Focus brackets: a blurred and magnified wedge gives back its depth and its magnification, a real board its order."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from analysis.series.focus import fine_contrast, similarities, stack
from composer.cli import main
from interchange.formats import images
from interchange.problems import BrightfieldError

BOARD = sorted((Path(__file__).parents[3] / "assets" / "focus_pcb").glob("*.jpg"))
SIZE, COUNT = 192, 5
SCALES = 1 + 0.006 * (2 - np.arange(COUNT))  # a lens that is focused farther away magnifies less


@pytest.fixture(scope="module")
def wedge() -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """A texture, coarse and fine, whose depth grows from frame 0's on the left to the last one's on the right: it, its
    depth, frames of it blurred by 1.2 px a step of defocus, then magnified about the middle."""
    rng = np.random.default_rng(0)
    octaves = [gaussian_filter(rng.standard_normal((SIZE, SIZE)), s) for s in (0.7, 2, 5, 12)]
    sharp = 100 + 12 * sum(x / x.std() for x in octaves)
    depth = np.tile(np.linspace(0, COUNT - 1, SIZE), (SIZE, 1))
    sigmas = np.arange(0, 6.5, 0.25)
    blurred = np.stack([gaussian_filter(sharp, s) for s in sigmas])
    row, column = np.indices(sharp.shape)
    frames = []
    for k, scale in enumerate(SCALES):
        which = np.rint(1.2 * np.abs(depth - k) / 0.25).astype(int)
        turn = cv2.getRotationMatrix2D(((SIZE - 1) / 2,) * 2, 0, scale)
        own = cv2.warpAffine(
            blurred[which, row, column], turn, sharp.shape, flags=cv2.INTER_CUBIC, borderMode=2
        )
        frames.append((own + rng.normal(0, 0.5, own.shape))[..., None])
    return sharp, depth, frames


def test_a_wedge_gives_back_its_depth_and_its_magnification(wedge) -> None:
    sharp, depth, frames = wedge
    found = stack(frames, smoothness=0.3)
    np.testing.assert_allclose(found.scales, SCALES, atol=1e-3)  # 0.1 px at the border
    inner = np.s_[16:-16, 16:-16]
    # the nearest frame is half a step off at most, 0.29 rms
    assert np.sqrt(np.mean((found.frame - depth)[inner] ** 2)) < 0.45
    error = [np.std((x[..., 0] - sharp)[inner]) for x in (found.image, frames[2])]
    assert error[0] < 0.5 * error[1]  # than the best single frame's
    unaligned = stack(frames, smoothness=0.3, aligned=True)
    assert np.std((unaligned.image[..., 0] - sharp)[inner]) > 1.2 * error[0]


def test_frames_of_something_else_are_named(wedge) -> None:
    frames = list(wedge[2])
    frames[4] = np.random.default_rng(3).uniform(0, 200, frames[0].shape)
    with pytest.raises(BrightfieldError, match="frame 4 does not fit frame 3"):
        similarities(frames)
    with pytest.raises(BrightfieldError, match="two images or more of one size"):
        stack([frames[0], frames[1][:-1]])


def test_a_real_board_is_sharp_everywhere_and_ordered_from_front_to_back(tmp_path) -> None:
    """The camera went from the board's front edge to the barcode behind it: what stands in front is sharpest in the
    first frames, the barcode in the last; magnification falls from frame to frame, as a thin lens has it. No frame is
    anywhere much sharper than the fused image."""
    assert main(["series", "focus", *map(str, BOARD), "--out", str(tmp_path)]) == 0
    about = json.loads((tmp_path / "focus.json").read_text())
    assert (np.diff(about["scales"]) < 0).all()
    assert about["contrast_over_best_single"] > 1.4
    assert min(about["share_of_each"]) > 0.01  # each is needed
    fused, colors = images.read(tmp_path / "fused.png"), images.read(tmp_path / "frame.png").astype(int)
    assert fused.shape[:2] == colors.shape[:2] == tuple(about["size_px"][::-1])
    yellow, violet = colors[20:100, 150:250], colors[280:340, 100:270]  # barcode, socket
    assert np.abs(yellow - [253, 231, 37]).max() < 40
    assert np.abs(violet - [68, 1, 84]).max() < 40
    frames = [images.read(f).astype(np.float32).mean(axis=2) for f in BOARD]
    sharp = fine_contrast(fused.astype(np.float32).mean(axis=2), 3.0)
    tiles = [
        [c[r : r + 48, q : q + 48].mean() for r in range(24, 320, 48) for q in range(24, 440, 48)]
        for c in (sharp, *(fine_contrast(f, 3.0) for f in frames))
    ]
    # alignment resamples, and a tile of 48 px has several depths
    assert np.median(tiles[0] / np.max(tiles[1:], axis=0)) > 0.9
