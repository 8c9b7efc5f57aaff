"""Derivatives of a BRDF by its own NumPy formula: forward-mode differentiation (Wengert 1964).

    (a, a') op (b, b') = (a op b, ∂op/∂a a' + ∂op/∂b b')

A ``Dual`` is a value with its derivatives by P unknowns. Bound to a BRDF in the place of its numbers, it carries the
chain rule through every operation that ``interchange.shader`` can spell, so ``f`` gives ∂f/∂p exactly, without steps.

At a kink (``np.maximum``, ``np.where``, ``np.absolute``) the derivative is that of the branch that is taken. Where a
slope is infinite and nothing arrives at it (the root of a constant 0), the product counts as 0.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from interchange.brdf.base import Brdf
from interchange.shader import COMPARISON, LOGIC

Slope = Callable[..., Any]


def _power_by_base(y: Any, x: Any, n: Any) -> Any:
    return np.where(np.asarray(x) > 0, n * np.power(np.where(np.asarray(x) > 0, x, 1.0), n - 1.0), 0.0)


def _power_by_exponent(y: Any, x: Any, n: Any) -> Any:
    return np.where(np.asarray(x) > 0, y * np.log(np.where(np.asarray(x) > 0, x, 1.0)), 0.0)


_POWER: tuple[Slope, ...] = (_power_by_base, _power_by_exponent)
_DIVIDE: tuple[Slope, ...] = (lambda y, a, b: 1.0 / b, lambda y, a, b: -y / b)

# ∂y/∂(each argument), from the result y and the arguments
SLOPES: dict[str, tuple[Slope, ...]] = {
    "add": (lambda y, a, b: 1.0, lambda y, a, b: 1.0),
    "subtract": (lambda y, a, b: 1.0, lambda y, a, b: -1.0),
    "multiply": (lambda y, a, b: b, lambda y, a, b: a),
    "divide": _DIVIDE,
    "true_divide": _DIVIDE,
    "negative": (lambda y, a: -1.0,),
    "square": (lambda y, a: 2.0 * a,),
    "power": _POWER,
    "float_power": _POWER,
    "sqrt": (lambda y, a: 0.5 / y,),
    "exp": (lambda y, a: y,),
    "log": (lambda y, a: 1.0 / a,),
    "maximum": (lambda y, a, b: np.greater(a, b), lambda y, a, b: np.less_equal(a, b)),
    "minimum": (lambda y, a, b: np.less(a, b), lambda y, a, b: np.greater_equal(a, b)),
    "cos": (lambda y, a: -np.sin(a),),
    "sin": (lambda y, a: np.cos(a),),
    "tan": (lambda y, a: 1.0 + y * y,),
    "arccos": (lambda y, a: -1.0 / np.sqrt(1.0 - a * a),),
    "arcsin": (lambda y, a: 1.0 / np.sqrt(1.0 - a * a),),
    "arctan": (lambda y, a: 1.0 / (1.0 + a * a),),
    "arctan2": (lambda y, a, b: b / (a * a + b * b), lambda y, a, b: -a / (a * a + b * b)),
    "absolute": (lambda y, a: np.sign(a),),
    "erf": (lambda y, a: 2.0 / np.sqrt(np.pi) * np.exp(-a * a),),
}
FLAT = {"floor", *COMPARISON, *LOGIC}  # piecewise constant: the result is a plain array


class Dual(NDArrayOperatorsMixin):
    """``value`` (...) and ``slopes`` (P, ...): its derivatives by P unknowns, of a shape that broadcasts behind P."""

    __slots__ = ("slopes", "value")

    def __init__(self, value: Any, slopes: np.ndarray) -> None:
        self.value, self.slopes = np.asarray(value), slopes

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        name = ufunc.__name__
        if method != "__call__" or kwargs or name not in SLOPES.keys() | FLAT:
            raise TypeError(f"np.{name} has no derivative in interchange.dual.SLOPES.")
        values = [x.value if isinstance(x, Dual) else x for x in inputs]
        y = ufunc(*values)
        if name in FLAT:
            return y
        total: Any = 0.0
        for x, slope in zip(inputs, SLOPES[name], strict=True):
            if isinstance(x, Dual):
                total = total + _times(_raised(x.slopes, np.ndim(y)), np.asarray(slope(y, *values)))
        return Dual(y, total)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> "Dual":
        if function is not np.where or len(args) != 3:
            raise TypeError(f"np.{function.__name__} has no derivative; np.where(c, a, b) has.")
        c, a, b = args
        va, vb = (x.value if isinstance(x, Dual) else x for x in (a, b))
        y = np.where(c, va, vb)
        da, db = (_raised(x.slopes, y.ndim) if isinstance(x, Dual) else 0.0 for x in (a, b))
        return Dual(y, np.where(c, da, db))


def _raised(slopes: np.ndarray, dimensions: int) -> np.ndarray:
    """Slopes (P, ...) with as many axes behind P as the value has that they are combined with."""
    missing = 1 + dimensions - slopes.ndim
    return slopes.reshape(slopes.shape[0], *(1,) * missing, *slopes.shape[1:]) if missing > 0 else slopes


def _times(arriving: np.ndarray, slope: np.ndarray) -> np.ndarray:
    if np.isfinite(slope).all():
        return arriving * slope
    return np.where(arriving == 0, 0.0, arriving * slope)


def derivatives(
    brdf: Brdf, wi: np.ndarray, wo: np.ndarray, channel: int, wanted: Sequence[int] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """``f`` (N,) of one channel in 1/sr and its derivatives (P, N) by the numbers ``wanted`` of ``brdf.flat()`` (all).

    ``wi``, ``wo``: (N, 3) unit vectors in the shading frame, above the surface.
    """
    numbers = brdf.flat()
    order = range(len(numbers)) if wanted is None else wanted
    seeds: list[Any] = list(numbers)
    for row, index in enumerate(order):
        seeds[index] = Dual(numbers[index], np.eye(len(order))[row])
    i, o = (tuple(np.moveaxis(np.asarray(w, np.float64), -1, 0)) for w in (wi, wo))
    with np.errstate(all="ignore"):
        result = brdf.bind(seeds, channel).f(i, o)
    shape = np.broadcast(i[2], o[2]).shape
    if not isinstance(result, Dual):
        return np.array(np.broadcast_to(result, shape), np.float64), np.zeros((len(order), *shape))
    slopes = np.broadcast_to(_raised(np.asarray(result.slopes), len(shape)), (len(order), *shape))
    return np.array(np.broadcast_to(result.value, shape)), np.array(slopes)
