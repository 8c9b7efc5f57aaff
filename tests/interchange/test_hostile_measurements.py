"""Files of measurements with bytes changed, cut out and put in: read, or refused in words, and nothing else."""

import warnings
from pathlib import Path

import numpy as np
import pytest

from interchange.formats.document import open_file
from interchange.formats.tensor_file import write_tensors
from interchange.problems import FileError
from interchange.reflectance import ReflectanceSamples

TEXTS = {
    "wide.csv": "theta_i (deg),phi_i (deg),theta_s (deg),phi_s (deg),BRDF 550 nm,sigma (%)\n"
    "30,0,40,180,0.2,5\n60,10,5,45,0.1,4\n",
    "long.csv": "theta_i (deg),theta_s (deg),wavelength (nm),CCBSDF\n"
    "30,40,500,1\n30,40,600,2\n30,-5,500,3\n30,-5,600,0\n",
    "e1392.astm": "A b\nVARS theta_i,phi_i,theta_s,phi_s,450nm,550nm\n0.5,0,0.6,3,1,2\n0.5,0,0.7,3,-1,2\n",
}


def seeds(folder: Path) -> dict[str, bytes]:
    table = np.linspace(-1, 100, 108)
    found = {name: text.encode() for name, text in TEXTS.items()}
    found["table.binary"] = np.array([3, 3, 4], "<i4").tobytes() + table.astype("<f8").tobytes()
    some = np.linspace(0.2, 1, 4 * 4 * 5).reshape(1, 4, 4, 5).astype(np.float32)
    fields = {
        "phi_i": np.zeros(1, np.float32),
        "theta_i": np.array([0, 0.4, 1.0, 1.5], np.float32),
        "ndf": some[0, 0],
        "sigma": some[0, 1],
        "vndf": some,
        "rgb": np.ones((1, 4, 3, 2, 2), np.float32),
        "jacobian": np.ones(1, np.uint8),
    }
    write_tensors(folder / "whole.bsdf", fields)
    return {**found, "adaptive.bsdf": (folder / "whole.bsdf").read_bytes()}


def damaged(data: bytes, rng: np.random.Generator, words: bool) -> bytes:
    found = bytearray(data)
    for _ in range(rng.integers(1, 6)):
        i = int(rng.integers(0, max(min(len(found), 400), 1)))
        match int(rng.integers(0, 4)):
            case 0 if found:
                found[i] = int(rng.integers(0, 256))
            case 1:
                del found[i : i + int(rng.integers(1, 9))]
            case 2:
                pool = list(b"0123456789.,;-e\n \tnaN()") if words else list(range(256))
                found[i:i] = bytes(rng.choice(pool, int(rng.integers(1, 9))).tolist())
            case _:
                found = found[: int(rng.integers(0, len(found) + 1))]
    return bytes(found)


@pytest.mark.parametrize("name", [*TEXTS, "table.binary", "adaptive.bsdf"])
def test_damage_is_read_or_refused(name: str, tmp_path: Path) -> None:
    data = seeds(tmp_path)[name]
    (tmp_path / name).write_bytes(data)
    assert open_file(tmp_path / name).rows > 0
    rng = np.random.default_rng(7)
    refused = 0
    for _ in range(200):
        (tmp_path / name).write_bytes(damaged(data, rng, name in TEXTS))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                found = open_file(tmp_path / name)
        except FileError:
            refused += 1
            continue
        if found.kind.value == "BRDF":
            samples = ReflectanceSamples.from_measurement(found)
            assert samples.usable.shape == (len(samples),)
    assert refused > 40
