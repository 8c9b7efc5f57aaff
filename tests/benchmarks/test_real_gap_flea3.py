"""What benchmarks/real_gap.py makes of the Flea3's raw pictures: composites, discs' middles, a scene of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from benchmarks import flea3_discs, real_gap_exposures, real_gap_filters
from benchmarks.twin_flea3 import SITES, camera_of
from interchange.effects.lateral_chromatic_aberration import LateralChromaticAberration
from interchange.image import Image, Quantity

SIZE = (408, 344)  # px, columns and rows
FINE = 5  # parts of a pixel that a drawn disc's edge has


def printed(middles: np.ndarray, radius: float) -> np.ndarray:
    """A picture (344, 408) of black discs on paper under a slope of light, blurred by 0.8 px."""
    y, x = ((np.mgrid[: FINE * SIZE[1], : FINE * SIZE[0]] + 0.5) / FINE) - 0.5
    share = np.ones(y.shape, np.float32)
    for u, v in middles:
        near = (
            slice(int(FINE * (v - 20)), int(FINE * (v + 20))),
            slice(int(FINE * (u - 20)), int(FINE * (u + 20))),
        )
        share[near] = np.where(np.hypot(x[near] - u, y[near] - v) < radius, 0.06, share[near])
    share = gaussian_filter(share, 0.8 * FINE).reshape(SIZE[1], FINE, SIZE[0], FINE).mean(axis=(1, 3))
    column, row = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    return share * (150 + 0.1 * column - 0.15 * row)


@pytest.fixture(scope="module")
def discs() -> flea3_discs.Discs:
    return flea3_discs.taught(flea3_discs.picture(550, 25))


def test_a_composite_has_each_colours_sites_from_its_own_picture():
    frames = {colour: np.full((6, 8), n, np.uint8) for n, colour in enumerate(("red", "green", "blue"), 10)}
    whole = flea3_discs.composite(frames)
    assert whole[:2, :2].tolist() == [[11, 12], [10, 11]]  # G B over R G
    for n, colour in enumerate(frames, 10):
        columns, rows, values = flea3_discs.sites(whole, colour)
        assert set(values) == {n}
        assert len(values) == 12 * len(SITES[colour])
        assert (whole[rows.astype(int), columns.astype(int)] == n).all()


def test_middles_of_discs_are_found_between_the_sites_of_a_colour():
    """Sites of one colour are 2 px apart, edges 0.8 px wide: 0.1 px for a disc, 0.02 px for the mean of twenty."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(np.arange(5), np.arange(4)), -1).reshape(-1, 2) * [68, 66] + [60, 60]
    middles = grid + rng.uniform(-1, 1, grid.shape)
    image = printed(middles, 14.7)
    for colour in SITES:
        off = flea3_discs.centroids(image, colour, np.rint(middles), 15.0) - middles
        assert np.abs(off).max() < 0.1
        assert np.abs(off.mean(axis=0)).max() < 0.02


def test_a_magnification_and_what_it_leaves_are_told_apart():
    rng = np.random.default_rng(4)
    at = rng.uniform([30, 30], [380, 310], (30, 2))
    away = at - np.array(flea3_discs.AXIS)
    across = np.array([-away.mean(axis=0)[1], away.mean(axis=0)[0]])
    aside = 0.4 * across / np.linalg.norm(across)
    found = real_gap_filters.Apart(at, 2.5e-3 * away + aside + rng.normal(0, 0.05, at.shape))
    c, sigma = found.magnification
    assert abs(c - 2.5e-3) < 5 * sigma
    assert found.aside == pytest.approx(aside, abs=0.05)
    numbers = {"blue": 1e-3, "blue3": 2e-4, "blue_u": -1e-3, "red": 0.3}
    only = real_gap_filters.Apart(at, real_gap_filters.shifted(at, numbers, "blue"))
    assert only.left(numbers, "blue") == pytest.approx(0, abs=1e-12)


def test_shifts_are_those_that_the_effect_gives():
    """A Gaussian spot that red's magnification moves: its middle by what is told, to 0.01 px of the effect's own shift
    by cubic interpolation."""
    numbers = {"red": 2.6e-3, "blue": -1.4e-3, "red3": 1e-4, "blue3": -5e-5, "red_u": 1e-3, "blue_v": 2e-3}
    effect = LateralChromaticAberration(**numbers)
    camera = replace(camera_of(SIZE), principal_point=flea3_discs.AXIS)
    column, row = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    for u, v in ((60.3, 70.8), (340.1, 290.6)):
        spot = np.exp(-((column - u) ** 2 + (row - v) ** 2) / (2 * 3.0**2))
        image = Image(np.repeat(spot[..., None], 3, axis=2).astype(np.float32), Quantity.IRRADIANCE, camera)
        moved = effect.apply(image, camera, None).pixels
        for k, colour in ((0, "red"), (2, "blue")):
            w = moved[..., k] / moved[..., k].sum()
            shift = np.array([(w * column).sum() - u, (w * row).sum() - v])
            told = real_gap_filters.shifted(np.array([[u, v]]), numbers, colour)[0]
            assert shift == pytest.approx(told, abs=0.01)


def test_pictures_reduced_keep_their_means_and_their_colours():
    shutter = real_gap_filters.SHUTTERS[0]
    full, half = (real_gap_filters.captured(shutter, size) for size in (1, 2))
    assert full.shape == (344, 408, 3)
    assert half == pytest.approx(full.reshape(172, 2, 204, 2, 3).mean(axis=(1, 3)), abs=0.1)
    own = flea3_discs.picture(650, shutter["red"])[3:-1:2, 2:-1:2]  # OpenCV repeats the outermost pixels
    assert full[3:-1:2, 2:-1:2, 0] == pytest.approx(real_gap_filters.STEP * own.astype(float))


def test_the_lattice_is_where_the_discs_are(discs):
    """0.1 px is the print's own (docs/twin.md); where the cut lies says the source, the focal length its data sheet."""
    assert len(discs.centres) == 30
    assert discs.off < 0.12
    assert 0.2 < discs.radius / flea3_discs.PITCH < 0.25
    z = discs.camera.world_from_camera[2, 3]
    assert 0.25 < z < 0.40  # the pitch is taken as 10 mm: 32 cm was told


def test_paper_and_discs_tile_the_plane(discs):
    paper, ink = flea3_discs.sheet(discs, (0.05, 0.06, 0.07))

    def area(mesh) -> float:
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        return float(np.cross(b - a, c - a)[:, 2].sum() / 2)  # signed: they face the camera

    cells = 17**2
    assert area(ink.mesh) == pytest.approx(cells * np.pi * discs.radius**2, rel=1e-9)
    assert area(paper.mesh) + area(ink.mesh) == pytest.approx(cells * flea3_discs.PITCH**2, rel=1e-9)


def test_the_lens_falls_off_as_cos4(discs):
    """Two terms over the cut, which lies between 13 and 25 degrees off the axis: to 0.4 %."""
    camera = flea3_discs.falling_off(discs.camera)
    at = np.array([[0.0, 0.0], [407, 0], [0, 343], [407, 343], [200, 170]])
    away = at - np.array(flea3_discs.AXIS)
    r2 = (away**2).sum(axis=1) / ((SIZE[0] / 2) ** 2 + (SIZE[1] / 2) ** 2)
    a2, a4 = camera.lens.vignetting
    cos4 = (1 + (away**2).sum(axis=1) / camera.K[0, 0] ** 2) ** -2
    assert 1 + a2 * r2 + a4 * r2**2 == pytest.approx(cos4, rel=4e-3)


def test_hot_sites_are_those_of_both_dark_frames():
    dark = {25: np.zeros((2, 3, 4)), 3916: np.zeros((2, 3, 4))}
    dark[3916][:, 1, 2] = 80, 90
    dark[3916][0, 0, 0] = 200  # in one alone: no dark current
    dark[25][:, 1, 2] = 0, 1
    series = real_gap_exposures.Series({25: np.full((3, 4), 7)}, dark)
    assert series.grown(3916).tolist() == [85]
    assert series.grown(25).tolist() == [0.5]
    assert series.highest == 7
