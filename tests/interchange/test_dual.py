"""The derivatives of every model are those of its formula. A new file in interchange/brdf is tested here unasked."""

import numpy as np
import pytest

from interchange.brdf import MODELS
from interchange.brdf.lafortune import Lafortune
from interchange.dual import FLAT, SLOPES, Dual, derivatives
from interchange.shader import COMPARISON, LOGIC, SPELLING

every_brdf = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())


def directions(rng, n):
    """(n, 3) unit vectors, not below 3 degrees of elevation."""
    cos, phi = rng.uniform(0.05, 1.0, n), rng.uniform(0, 2 * np.pi, n)
    sin = np.sqrt(1 - cos * cos)
    return np.stack([sin * np.cos(phi), sin * np.sin(phi), cos], -1)


def number_of(brdf, wi, wo):
    """Extended precision, but for formulas with erf, which SciPy has in double precision alone."""
    try:
        brdf.bind([np.longdouble(x) for x in brdf.flat()], 1).f(
            *(tuple(w.astype(np.longdouble)) for w in (wi[0], wo[0]))
        )
    except TypeError:
        return np.float64
    return np.longdouble


def central(brdf, numbers, index, h, i, o, channel):
    """Fourth-order central difference in the precision of the directions: error h⁴ f⁗/30."""
    total = 0.0
    for step, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1)):
        moved = [i[0].dtype.type(x) for x in numbers]
        moved[index] += step * h
        with np.errstate(all="ignore"):
            total = total + weight * np.asarray(brdf.bind(moved, channel).f(i, o))
    with np.errstate(over="ignore"):
        return np.broadcast_to(np.asarray(total / (12 * h), np.float64), i[2].shape)


@every_brdf
def test_is_the_limit_of_differences(model):
    """Differences of two steps bracket their own error: where they agree to 1e-4 (no kink between the steps), the
    derivative must agree with them to ten times their difference, 1e-5 of itself (formulas that cancel) and rounding.
    At least 85 % of the points must be free of kinks, so the test cannot pass by leaving them out."""
    rng = np.random.default_rng(5)
    wi, wo = directions(rng, 40), directions(rng, 40)
    number = number_of(model.drawn(np.random.default_rng(0), 2), wi, wo)
    i, o = (tuple(np.moveaxis(w.astype(number), -1, 0)) for w in (wi, wo))
    ulp = 1e-15 if number is np.longdouble else 1e-13  # of f, after sums and exponentials
    counted = agreed = 0
    for _ in range(6):
        brdf = model.drawn(rng, 2)
        value, slopes = derivatives(brdf, wi, wo, 1)
        assert value == pytest.approx(brdf.evaluate(wi, wo)[:, 1], rel=1e-12, abs=1e-300)
        assert np.isfinite(slopes[:, np.abs(value) < 1e4]).all()
        for k, value_k in enumerate(brdf.flat()):
            h = 1e-4 * max(abs(value_k), 1e-2)
            coarse, fine = (central(brdf, brdf.flat(), k, s, i, o, 1) for s in (h, h / 2))
            rounding = ulp * np.abs(value) / h + 1e-12
            with np.errstate(invalid="ignore"):
                gap = np.abs(coarse - fine)
            smooth = (np.abs(value) < 1e4) & (gap <= 1e-4 * np.abs(fine) + rounding)
            counted, agreed = counted + (np.abs(value) < 1e4).sum(), agreed + smooth.sum()
            error = np.abs(slopes[k][smooth] - fine[smooth])
            bound = (10 * gap + 1e-5 * np.abs(fine) + rounding)[smooth]
            assert (error <= bound).all(), (list(brdf.slots()), k, (error / bound).max(initial=0))
    assert counted == 0 or agreed > 0.85 * counted


def test_knows_every_operation_that_a_shader_can_spell():
    assert SLOPES.keys() | FLAT == {*SPELLING, *COMPARISON, *LOGIC}


@pytest.mark.parametrize("name", sorted(SLOPES))
def test_every_rule_is_the_limit_of_differences(name):
    import scipy.special

    function = getattr(np, name, None) or getattr(scipy.special, name)
    rng, h = np.random.default_rng(1), 1e-6
    values = rng.uniform(0.1, 0.9, (len(SLOPES[name]), 50))
    result = function(*Dual.variables(values))
    for k in range(len(values)):
        up, down = values.copy(), values.copy()
        up[k] += h
        down[k] -= h
        # truncation h² and rounding 1e-16 / h: 1e-9 of values of order ten
        slope = np.broadcast_to(result.partials[k], 50)
        assert slope == pytest.approx((function(*up) - function(*down)) / (2 * h), rel=1e-7, abs=1e-8)


def test_lafortune_is_the_derivative_on_paper():
    """∂f/∂w = c^n, ∂f/∂n = w c^n ln c, ∂f/∂Cz = w n c^(n-1) wi.z wo.z."""
    brdf = Lafortune(0.1, weight=[2.0], C=[(-0.9, -0.9, 1.1)], n=[7.0])
    wi, wo = np.array([[0.6, 0.0, 0.8]]), np.array([[-0.48, 0.36, 0.8]])
    c = 0.9 * 0.6 * 0.48 + 1.1 * 0.64
    _, slopes = derivatives(brdf, wi, wo, 0)
    slots = brdf.slots()
    assert slopes[slots["weight"][0], 0] == pytest.approx(c**7)
    assert slopes[slots["n"][0], 0] == pytest.approx(2 * c**7 * np.log(c))
    assert slopes[slots["C"][2], 0] == pytest.approx(14 * c**6 * 0.64)
    assert slopes[slots["weight"][1], 0] == 0.0  # another channel's


def test_a_lobe_that_is_not_reached_has_no_slope():
    """0^n and all its derivatives are 0, logarithm or not."""
    brdf = Lafortune(0.1, weight=[2.0], C=[(1.0, 1.0, 0.0)], n=[0.5])
    _, slopes = derivatives(brdf, np.array([[0.6, 0.0, 0.8]]), np.array([[-0.6, 0.0, 0.8]]), 0)
    assert (slopes[3:] == 0).all()


def test_what_has_no_rule_is_refused():
    with pytest.raises(TypeError, match=r"np\.sinh has no derivative"):
        np.sinh(Dual.variables([1.0])[0])


def test_writes_the_derivative_as_code():
    """Lines of Python written from the formula give the numbers of the arrays."""
    import math

    from interchange.shader import PYTHON, Body, Traced, spell

    brdf = Lafortune(0.1, weight=[2.0], C=[(-0.9, -0.9, 1.1)], n=[7.0])
    wi, wo = (0.6, 0.0, 0.8), (-0.48, 0.36, 0.8)
    body = Body(PYTHON)
    p = Dual.variables([Traced(f"p[{k}]", body) for k in range(len(brdf.flat()))])
    i, o = (tuple(Traced(f"{w}[{k}]", body) for k in range(3)) for w in ("wi", "wo"))
    result = brdf.bind(p, 0).f(i, o)
    names = {"p": brdf.flat(), "wi": wi, "wo": wo, "log": math.log, "power": math.pow}
    exec("\n".join(body.lines), names)
    expected = derivatives(brdf, np.array([wi]), np.array([wo]), 0)[1][:, 0]
    assert [eval(spell(x), names) for x in result.partials] == pytest.approx(list(expected))
