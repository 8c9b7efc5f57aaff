"""Logarithm, exponential and power that a compiler can vectorise, against NumPy's."""

import numba
import numpy as np

from analysis.fit import vector_math


@numba.njit(error_model="numpy")
def over(x, n, logs, exps, powers):
    for i in range(len(x)):
        logs[i] = vector_math.log(x[i])
        exps[i] = vector_math.exp(n[i])
        powers[i] = vector_math.power(x[i], n[i])


def test_the_last_bits_agree():
    """Two roundings or so: log within 1e-15 of itself, exp within 1e-15; a power's error grows with its exponent."""
    rng = np.random.default_rng(0)
    x = np.exp(rng.uniform(-300, 300, 100_000))
    x[::2] = rng.uniform(0.5, 2, 50_000)
    n = rng.uniform(-700, 700, 100_000)
    logs, exps, powers = np.empty((3, 100_000))
    over(x, n, logs, exps, powers)
    assert np.max(np.abs(logs - np.log(x)) / np.maximum(np.abs(np.log(x)), 1e-300)) < 1e-15
    assert np.max(np.abs(exps / np.exp(n) - 1)) < 1e-15
    with np.errstate(over="ignore"):
        expected = x**n
    held = (expected > 1e-300) & (expected < 1e300)
    error = np.abs(powers[held] / expected[held] - 1)
    assert (error < 1e-15 * (1 + np.abs(n * np.log(x))[held])).all()


def test_edges():
    x = np.array([0.0, -1.0, 1.0, 2.0])
    n = np.array([-800.0, 800.0, 0.0, 1.0])
    _, exps, powers = out = np.empty((3, 4))
    over(x, n, *out)
    assert exps[:3].tolist() == [0.0, np.inf, 1.0]
    assert abs(exps[3] / np.e - 1) < 1e-15
    assert powers[:3].tolist() == [0.0, 0.0, 1.0]
    assert abs(powers[3] / 2 - 1) < 1e-15
