"""MERL and UTIA files, written here by their published layouts: values, angles, masks, and damage."""

from pathlib import Path

import numpy as np
import pytest

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.tabulated_goniometer import TabulatedGoniometer
from interchange.brdf.tabulated_isotropic import TabulatedIsotropic
from interchange.formats import utia
from interchange.formats.document import open_file
from interchange.measurement import directions, from_half_difference, unit_vectors
from interchange.problems import FileError
from interchange.reflectance import ReflectanceSamples

PAINT = Lafortune((0.3, 0.2, 0.1), weight=[(0.5, 0.5, 0.5)], C=[(-1, -1, 1)], n=[8])
SCALE = np.array([1.0, 1.15, 1.66]) / 1500


def merl_bytes(counts, negative=True):
    """A MERL file of PAINT; -1 where a direction is below the surface, as in the published ones."""
    i, j, k = (a.ravel() for a in np.indices(counts))
    h, d, p = counts
    angles = ((i + 0.5) / h) ** 2 * np.pi / 2, (j + 0.5) / d * np.pi / 2, (k + 0.5) / p * np.pi
    wi, wo = from_half_difference(*angles)
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    stored = np.where(above[:, None], PAINT.evaluate(wi, wo) / SCALE, -1.0 if negative else 0.0)
    return np.array(counts, "<i4").tobytes() + np.ascontiguousarray(stored.T).astype("<f8").tobytes(), above


def test_merl(tmp_path: Path) -> None:
    data, above = merl_bytes((12, 10, 16))
    (tmp_path / "paint.binary").write_bytes(data)
    found = open_file(tmp_path / "paint.binary")
    assert found.rows == 1920
    assert isinstance(found.model, TabulatedIsotropic)
    samples = ReflectanceSamples.from_measurement(found)
    assert np.array_equal(samples.usable, above)
    assert samples.f[samples.usable] == pytest.approx(
        PAINT.evaluate(samples.wi, samples.wo)[above], rel=1e-12
    )
    assert (samples.f[~above] < 0).all()  # kept
    assert found.model.evaluate(samples.wi, samples.wo)[above] == pytest.approx(samples.f[above], rel=1e-5)
    assert [n.message for n in found.notes] == []


def test_merl_bins_that_were_never_seen_are_counted_and_take_their_neighbours_value(tmp_path: Path) -> None:
    data, above = merl_bytes((12, 10, 16))
    bins = np.frombuffer(data, "<f8", offset=12).reshape(3, -1).copy()
    hole = int(np.flatnonzero(above)[50])
    bins[1, hole] = -1
    (tmp_path / "paint.binary").write_bytes(data[:12] + bins.tobytes())
    found = open_file(tmp_path / "paint.binary")
    assert "1 of " in str(found.notes[0])
    assert "never seen" in str(found.notes[0])
    near = found.model.values.values[[hole - 1, hole, hole + 1]]
    assert near.min(axis=0) == pytest.approx(near.max(axis=0), rel=0.2)
    assert near.min() > 0


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "empty"),
        (b"\1\0\0", "must begin with three counts"),
        (np.array([90, 90, 180], "<i4").tobytes() + bytes(800), "34992012 bytes; there are 812"),
        (np.array([4000, 4000, 4000], "<i4").tobytes(), "three counts of bins"),
        (np.array([-90, -90, 180], "<i4").tobytes(), "three counts of bins"),
        (np.array([1, 1, 1], "<i4").tobytes() + np.full(3, -1.0).tobytes(), "One bin at least"),
        (np.array([1, 1, 1], "<i4").tobytes() + np.full(3, np.nan).tobytes(), "One bin at least"),
    ],
)
def test_damaged_merl(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "a.binary").write_bytes(data)
    with pytest.raises(FileError, match=message):
        open_file(tmp_path / "a.binary")


def utia_picture() -> np.ndarray:
    """Light in rows, camera in columns; an anisotropic lobe, so that exchanged axes would show."""
    lobe = Lafortune(0.2, weight=[(1.0, 0.7, 0.3)], C=[(-1, -0.5, 0.9)], n=[4])
    theta, phi = (a.ravel() for a in np.meshgrid(utia.THETA, utia.PHI, indexing="ij"))
    w = unit_vectors(theta, phi)
    return lobe.evaluate(w[:, None], w[None])


def test_utia(tmp_path: Path) -> None:
    picture = utia_picture()
    picture[288 // 2, 7, 2] = -0.003
    np.moveaxis(picture, -1, 0).astype("<f8").tofile(tmp_path / "cloth.bin")
    found = open_file(tmp_path / "cloth.bin")
    wi, wo = directions(found)
    f = np.stack([c.values for c in found.values], -1)
    # the file's own order: light's theta 15°, phi 7.5°; camera's theta 30°, phi 15°
    row = ((1 * 48 + 1) * 6 + 2) * 48 + 2
    assert wi[row] == pytest.approx(unit_vectors(np.radians(15), np.radians(7.5)))
    assert wo[row] == pytest.approx(unit_vectors(np.radians(30), np.radians(15)))
    assert f[row] == pytest.approx(picture[48 + 1, 2 * 48 + 2])
    assert ReflectanceSamples.from_measurement(found).negatives.tolist() == [0, 0, 1]
    assert "1 of 82944 readings are negative" in str(found.notes[0])
    assert isinstance(found.model, TabulatedGoniometer)
    away = (wi[:, 2] < 0.99) & (wo[:, 2] < 0.99)
    assert found.model.evaluate(wi, wo)[away] == pytest.approx(np.maximum(f, 0)[away], rel=1e-5, abs=1e-6)


def test_damaged_utia(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(bytes(100))
    with pytest.raises(FileError, match="1990656 bytes; there are 100"):
        open_file(tmp_path / "a.bin")
    with pytest.raises(FileError, match="288 x 288 x 3"):
        utia.measurement_of(np.zeros((2, 2, 3)))
