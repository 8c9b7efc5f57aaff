"""RGL's adaptive parameterisation: against Mitsuba's numbers, its own data points, and damaged files.

Mitsuba 3.9.1's `measured` evaluates files of random tables (phi_i of 1, 2, 3 and 5 nodes, with two and four mirror
images, three channels and spectra) as ``brdf.rgl`` does, to 2.5e-6 of each of 200 random pairs. For one or two
azimuths it leaves `m_reduction` unset: the files compared were mirror images of themselves there, as real ones are.
"""

import struct
from pathlib import Path

import numpy as np
import pytest

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.rgl import Rgl, sums
from interchange.formats.document import open_file
from interchange.formats.rgl import data_points, mapped
from interchange.formats.tensor_file import read_tensors, write_tensors
from interchange.measurement import directions
from interchange.problems import FileError
from interchange.reflectance import ReflectanceSamples


def arrays(phi: list[float], n: int = 6) -> dict[str, np.ndarray]:
    """Random tables, the same in every environment: numbers of a sine."""
    f4, p = np.float32, len(phi)

    def some(*shape: int, start: float = 0.0) -> np.ndarray:
        count = int(np.prod(shape))
        return (0.6 + 0.4 * np.sin(12.9898 * np.arange(count) + start)).reshape(shape).astype(f4)

    sigma = np.repeat(some(1, 3, start=1), 2, axis=0) if p <= 2 else some(2, 3, start=1)
    return {
        "description": np.frombuffer(b"synthetic", np.uint8),
        "phi_i": np.array(phi, f4),
        "theta_i": np.array([0, 0.4, 1.0, 1.5], f4),
        "ndf": some(3, 5),
        "sigma": sigma,
        "vndf": some(p, 4, 4, 5, start=2),
        "luminance": some(p, 4, n, n),
        "rgb": some(p, 4, 3, n, n, start=3),
        "jacobian": np.array([1], np.uint8),
    }


W = np.array(
    [
        [[0.3, 0.1, 0.9], [-0.5, 0.2, 0.6]],
        [[-0.4, -0.6, 0.5], [0.2, 0.7, 0.8]],
        [[0.1, -0.8, 0.3], [0.1, -0.7, 0.4]],
    ]
)
MITSUBA = [  # measured.eval(camera, light), which is f times the light's cosine, of files of arrays(phi)
    (
        [0.0],
        [
            [0.05573331192135811, 0.060636967420578, 0.06953161209821701],
            [0.12283238768577576, 0.13174913823604584, 0.08661538362503052],
            [0.0733017548918724, 0.05864138528704643, 0.07621756941080093],
        ],
    ),
    (
        [-np.pi, -1.5, 0.0],
        [
            [0.08124856650829315, 0.13755512237548828, 0.11265692114830017],
            [0.19112379848957062, 0.079384945333004, 0.16321399807929993],
            [0.10967938601970673, 0.13599511981010437, 0.08593548089265823],
        ],
    ),
    (
        [-np.pi, -2.3, -np.pi / 2],
        [
            [0.07040291279554367, 0.15064099431037903, 0.10010392963886261],
            [0.19030213356018066, 0.0667630061507225, 0.18660473823547363],
            [0.13630540668964386, 0.12022984027862549, 0.10986640304327011],
        ],
    ),
]


@pytest.mark.parametrize(("phi", "expected"), MITSUBA)
def test_evaluation_is_mitsubas(phi: list[float], expected: list[list[float]], tmp_path: Path) -> None:
    write_tensors(tmp_path / "a.bsdf", arrays(phi))
    wo, wi = np.moveaxis(W / np.linalg.norm(W, axis=-1, keepdims=True), 1, 0)
    got = open_file(tmp_path / "a.bsdf").model.evaluate(wi, wo) * wi[:, 2:]
    assert got == pytest.approx(np.array(expected), rel=1e-5)  # single precision


def test_the_map_forward_is_the_inverse_of_the_formula_s() -> None:
    rng = np.random.default_rng(0)
    model = Rgl.drawn(rng, 1)
    vndf = rng.uniform(0.1, 1, (4, 5))
    density, columns, rows = sums(vndf)
    u, v = rng.uniform(0, 1, (2, 500))
    x, y = mapped(u, v, density, columns, rows)
    flat = Rgl.of(
        np.array([0.5]),
        np.array([0.0]),
        np.ones((2, 2)),
        np.ones((2, 2)),
        vndf[None, None],
        np.ones((1, 1, 2, 2, 3)),
        False,
    )
    back = flat.bind(flat.flat(), 0)._inverted((x, y), [(0.0, 1.0)])
    assert back[0] == pytest.approx(u, abs=1e-5)
    assert back[1] == pytest.approx(v, abs=1e-5)
    assert model.jacobian == 1


@pytest.mark.parametrize("phi", [[0.0], [-np.pi, -1.5, 0.0]])
def test_the_model_is_its_own_file_at_every_data_point(phi: list[float], tmp_path: Path) -> None:
    write_tensors(tmp_path / "a.bsdf", arrays(phi))
    found = open_file(tmp_path / "a.bsdf")
    assert found.comments == ("synthetic",)
    samples = ReflectanceSamples.from_measurement(found)
    assert len(samples) == len(phi) * 4 * 36
    inner = (samples.wi[:, 2] < 0.999) & samples.usable & (samples.wo[:, 2] > 0.05)
    # random tables say different numbers along the normal, on either side of azimuth 180°, and on a mirror's seam
    column, row = np.arange(len(samples)) % 6, np.arange(len(samples)) // 6 % 6
    inner &= (column > 0) & (row > 0) & (row < 5)
    inner &= np.abs(samples.wi[:, 1]) > (1e-3 if len(phi) > 2 else -1)
    assert inner.sum() > 20
    got = found.model.evaluate(samples.wo, samples.wi)  # the model's camera is the measurement's lamp
    assert got[inner] == pytest.approx(samples.f[inner], rel=2e-3)


def test_a_lobe_comes_back_from_a_file_that_was_made_of_it(tmp_path: Path) -> None:
    """S filled from a formula at the data points of a fine grid; what is left is its straight pieces."""
    brdf = Lafortune((0.3, 0.2, 0.1), weight=[(0.5, 0.5, 0.5)], C=[(-1, -1, 1)], n=[8])
    theta, n = np.linspace(0, 1.4, 15), 24
    x = np.linspace(0, 1, 20)
    width = np.exp(-((x**2 * np.pi / 2) ** 2) / 0.3) * np.maximum(x, 0.05)  # more cells near the normal
    vndf = np.broadcast_to(width, (1, 15, 8, 20))
    ones = np.ones((2, 2))
    wi, wo, cosine = data_points(np.zeros(1), theta, ones, ones, vndf, np.ones((1, 15, 1, n, n)), False)
    values = np.where(np.isfinite(cosine), brdf.evaluate(wi, wo) * wo[:, 2:], 0.0)
    fields = {
        **arrays([0.0]),
        "theta_i": theta.astype(np.float32),
        "ndf": ones.astype(np.float32),
        "sigma": ones.astype(np.float32),
        "vndf": np.ascontiguousarray(vndf, np.float32),
        "rgb": np.moveaxis(values.reshape(1, 15, n, n, 3), -1, 2).astype(np.float32),
        "jacobian": np.array([0], np.uint8),
    }
    write_tensors(tmp_path / "lobe.bsdf", fields)
    model = open_file(tmp_path / "lobe.bsdf").model
    rng = np.random.default_rng(1)
    w = rng.normal(size=(2, 2000, 3))
    w[..., 2] = np.abs(w[..., 2]) + 0.5
    wi, wo = w / np.linalg.norm(w, axis=-1, keepdims=True)
    h = wi + wo
    # the last cells, which reach below the surface, are wide
    inner = h[:, 2] > 0.7 * np.linalg.norm(h, axis=1)
    error = np.abs(model.evaluate(wi, wo) - brdf.evaluate(wi, wo))[inner] / brdf.evaluate(wi, wo).max()
    assert np.median(error) < 0.002
    assert error.max() < 0.06  # second differences of the lobe over cells of 4°


def test_spectra_become_three_bands(tmp_path: Path) -> None:
    fields = arrays([0.0])
    nm = np.array([400, 500, 600, 700], np.float32)
    del fields["rgb"]
    fields["wavelengths"] = nm
    fields["spectra"] = np.repeat((nm / 1000)[None, None, :, None, None], 4, axis=1) * np.ones(
        (1, 1, 1, 6, 6), np.float32
    )
    write_tensors(tmp_path / "a.bsdf", fields)
    found = open_file(tmp_path / "a.bsdf")
    assert found.wavelength_nm.tolist() == [400, 500, 600, 700]
    assert found.model.values.values[7] == pytest.approx([0.65, 0.55, 0.45])
    assert directions(found)[0][0] == pytest.approx([0, 0, 1])


def test_cells_that_are_no_numbers_and_bands_that_were_not_measured(tmp_path: Path) -> None:
    fields = arrays([0.0])
    fields["rgb"] = fields["rgb"].copy()
    fields["rgb"][0, 1, 0, 2, 2], fields["rgb"][0, 1, 0, 2, 3] = np.nan, -1
    write_tensors(tmp_path / "a.bsdf", fields)
    found = open_file(tmp_path / "a.bsdf")
    said = "\n".join(map(str, found.notes))
    assert "1 of 144 cells are negative" in said
    assert "1 cells hold no finite number" in said
    assert (found.model.values.values[36 + 14] == [0, *fields["rgb"][0, 1, 1:, 2, 2]]).all()
    del fields["rgb"]
    fields |= {"wavelengths": np.array([900], np.float32), "spectra": np.ones((1, 4, 1, 6, 6), np.float32)}
    write_tensors(tmp_path / "a.bsdf", fields)
    near_infrared = open_file(tmp_path / "a.bsdf")
    assert near_infrared.model is None
    assert near_infrared.rows == 144
    assert "no model" in str(near_infrared.notes[0])


def changed(name: str, value: np.ndarray) -> dict[str, np.ndarray]:
    return {**arrays([0.0]), name: value}


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({k: v for k, v in arrays([0.0]).items() if k != "ndf"}, "must have ndf"),
        (changed("rgb", np.ones((1, 4, 3, 6, 5), np.float32)), "must agree; got rgb"),
        (changed("vndf", np.ones((2, 2), np.float32)), "must agree; got vndf"),
        (changed("vndf", np.zeros((1, 4, 4, 5), np.float32)), "not all zero"),
        (changed("ndf", np.full((3, 5), np.nan, np.float32)), "must be finite"),
        (changed("theta_i", np.array([0, 1, 0.5, 1.5], np.float32)), "theta_i must increase"),
    ],
)
def test_damaged_tables(fields: dict[str, np.ndarray], message: str, tmp_path: Path) -> None:
    write_tensors(tmp_path / "a.bsdf", fields)
    with pytest.raises(FileError, match=message):
        open_file(tmp_path / "a.bsdf")


def test_damaged_tensor_files(tmp_path: Path) -> None:
    file = tmp_path / "a.bsdf"
    write_tensors(file, arrays([0.0]))
    whole = file.read_bytes()
    assert read_tensors(file)["rgb"].shape == (1, 4, 3, 6, 6)
    for cut in (5, 14, 20, 60, len(whole) - 3):
        file.write_bytes(whole[:cut])
        with pytest.raises(FileError, match=r"cut short|must begin|must take"):
            open_file(file)
    huge = whole[:14] + struct.pack("<I", 1 << 31) + whole[18:]
    file.write_bytes(huge)
    with pytest.raises(FileError, match="up to 256 fields"):
        open_file(file)
    at = whole.index(b"phi_i") + 5 + 3
    file.write_bytes(whole[: at + 8] + struct.pack("<Q", 1 << 62) + whole[at + 16 :])
    with pytest.raises(FileError, match='"phi_i" has a type or a shape'):
        open_file(file)
