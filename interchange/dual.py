"""Derivatives of a BRDF by its own NumPy formula: forward-mode differentiation (Wengert 1964).

    (a, a') op (b, b') = (a op b, ∂op/∂a a' + ∂op/∂b b')

A ``Dual`` is a value with its partial derivatives. Bound to a BRDF in the place of its numbers, it carries the chain
rule through every operation that ``interchange.shader`` can spell, so ``f`` gives ∂f/∂p exactly, without steps. The
value may be an array, or a shader's float: then the derivatives are written as code, like the formula itself.

At a kink (``np.maximum``, ``np.where``, ``np.absolute``) the derivative is that of the branch that is taken. Where a
slope is infinite and nothing arrives at it (the root of a constant 0), the product counts as 0.
"""

from collections.abc import Callable, Sequence
from typing import Any, Self

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from interchange.brdf.base import Brdf
from interchange.shader import COMPARISON, LOGIC

Slope = Callable[..., Any]


def _positive(x: Any) -> Any:
    return np.where(x > 0.0, x, 1.0)


_POWER: tuple[Slope, ...] = (
    lambda y, x, n: np.where(x > 0.0, n * np.power(_positive(x), n - 1.0), 0.0),
    lambda y, x, n: np.where(x > 0.0, y * np.log(_positive(x)), 0.0),
)
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
    "maximum": (lambda y, a, b: np.where(a > b, 1.0, 0.0), lambda y, a, b: np.where(a > b, 0.0, 1.0)),
    "minimum": (lambda y, a, b: np.where(a < b, 1.0, 0.0), lambda y, a, b: np.where(a < b, 0.0, 1.0)),
    "cos": (lambda y, a: -np.sin(a),),
    "sin": (lambda y, a: np.cos(a),),
    "tan": (lambda y, a: 1.0 + np.square(y),),
    "arccos": (lambda y, a: -1.0 / np.sqrt(1.0 - np.square(a)),),
    "arcsin": (lambda y, a: 1.0 / np.sqrt(1.0 - np.square(a)),),
    "arctan": (lambda y, a: 1.0 / (1.0 + np.square(a)),),
    "arctan2": (
        lambda y, a, b: b / (np.square(a) + np.square(b)),
        lambda y, a, b: -a / (np.square(a) + np.square(b)),
    ),
    "absolute": (lambda y, a: np.where(a < 0.0, -1.0, 1.0),),
    "erf": (lambda y, a: 2.0 / np.sqrt(np.pi) * np.exp(-np.square(a)),),
}
FLAT = {"floor", *COMPARISON, *LOGIC}  # piecewise constant: the result is no dual


class Dual(NDArrayOperatorsMixin):
    """``value`` and ``partials``: its derivatives by P unknowns, the float 0 for one that it does not depend on."""

    __slots__ = ("partials", "value")

    def __init__(self, value: Any, partials: Sequence[Any]) -> None:
        self.value, self.partials = value, tuple(partials)

    @classmethod
    def variables(cls, values: Sequence[Any]) -> list[Self]:
        """One unknown a value: each with the derivative 1 by itself."""
        return [cls(v, [float(i == k) for i in range(len(values))]) for k, v in enumerate(values)]

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        name = ufunc.__name__
        if method != "__call__" or kwargs or name not in SLOPES.keys() | FLAT:
            raise TypeError(f"np.{name} has no derivative in interchange.dual.SLOPES.")
        values = [x.value if isinstance(x, Dual) else x for x in inputs]
        y = ufunc(*values)
        if name in FLAT:
            return y
        totals: list[Any] = [0.0] * len(self.partials)
        for x, slope in zip(inputs, SLOPES[name], strict=True):
            if isinstance(x, Dual):
                rate = slope(y, *values)
                for k, partial in enumerate(x.partials):
                    if not _is(0.0, partial):
                        term = _times(partial, rate)
                        totals[k] = term if _is(0.0, totals[k]) else totals[k] + term
        return Dual(y, totals)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> "Dual":
        if function is not np.where or len(args) != 3:
            raise TypeError(f"np.{function.__name__} has no derivative; np.where(c, a, b) has.")
        c, a, b = args
        nothing = (0.0,) * len(self.partials)
        pairs = zip(*(x.partials if isinstance(x, Dual) else nothing for x in (a, b)), strict=True)
        va, vb = (x.value if isinstance(x, Dual) else x for x in (a, b))
        chosen = [0.0 if _is(0.0, p) and _is(0.0, q) else np.where(c, p, q) for p, q in pairs]
        return Dual(np.where(c, va, vb), chosen)


def _is(number: float, x: Any) -> bool:
    return type(x) is float and x == number


def _times(arriving: Any, rate: Any) -> Any:
    if _is(1.0, rate):
        return arriving
    if _is(1.0, arriving):
        return rate
    if isinstance(rate, np.ndarray) and not np.isfinite(rate).all():
        return np.where(np.equal(arriving, 0.0), 0.0, arriving * rate)
    return arriving * rate


def derivatives(
    brdf: Brdf, wi: np.ndarray, wo: np.ndarray, channel: int, wanted: Sequence[int] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """``f`` (N,) of one channel in 1/sr and its derivatives (P, N) by the numbers ``wanted`` of ``brdf.flat()`` (all).

    ``wi``, ``wo``: (N, 3) unit vectors in the shading frame, above the surface.
    """
    seeds: list[Any] = brdf.flat()
    order = range(len(seeds)) if wanted is None else wanted
    for index, dual in zip(order, Dual.variables([np.float64(seeds[i]) for i in order]), strict=True):
        seeds[index] = dual
    i, o = (tuple(np.moveaxis(np.asarray(w, np.float64), -1, 0)) for w in (wi, wo))
    with np.errstate(all="ignore"):
        result = brdf.bind(seeds, channel).f(i, o)
    shape = np.broadcast(i[2], o[2]).shape
    slopes = np.zeros((len(order), *shape))
    if not isinstance(result, Dual):
        return np.array(np.broadcast_to(result, shape), np.float64), slopes
    for row, partial in zip(slopes, result.partials, strict=True):
        row[...] = partial
    return np.array(np.broadcast_to(result.value, shape)), slopes
