"""Write a BRDF's NumPy formula as GLSL or OSL, by calling it on values that note down what is done to them.

The three channels are traced into one body, in which an expression that was met before is not written again:
what the channels share (angles, powers) costs once.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from interchange.brdf.base import Brdf

SPELLING = {
    "add": "{} + {}",
    "subtract": "{} - {}",
    "multiply": "{} * {}",
    "divide": "{} / {}",
    "true_divide": "{} / {}",
    "negative": "-{}",
    "square": "{0} * {0}",
    "power": "power({}, {})",
    "float_power": "power({}, {})",
    "sqrt": "sqrt({})",
    "exp": "exp({})",
    "log": "log({})",
    "maximum": "max({}, {})",
    "minimum": "min({}, {})",
    "cos": "cos({})",
    "sin": "sin({})",
    "tan": "tan({})",
    "arccos": "acos({})",
    "arcsin": "asin({})",
    "arctan": "atan({})",
    "absolute": "abs({})",
}
COMPARISON = {"greater": ">", "greater_equal": ">=", "less": "<", "less_equal": "<="}


@dataclass(frozen=True)
class Dialect:
    name: str
    vector: str
    color: str
    components: tuple[str, str, str]
    power: str


GLSL = Dialect(
    "GLSL",
    "vec3",
    "vec3",
    (".x", ".y", ".z"),
    "float power(float x, float n) { return x > 0.0 ? pow(x, n) : 0.0; }",
)
OSL = Dialect(
    "OSL",
    "vector",
    "color",
    ("[0]", "[1]", "[2]"),
    "float power(float x, float n) { return x > 0.0 ? pow(x, n) : 0.0; }",
)


class Body:
    """The lines written so far, each expression once."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.known: dict[str, str] = {}

    def name_of(self, expression: str) -> str:
        if expression not in self.known:
            name = f"t{len(self.lines)}"
            self.lines.append(f"float {name} = {expression};")
            self.known[expression] = name
        return self.known[expression]


class Traced(NDArrayOperatorsMixin):
    """A shader's float: every NumPy operation on it appends a line to the body. A comparison stays an expression,
    for ``np.where`` alone."""

    def __init__(self, name: str, body: Body) -> None:
        self.name, self.body = name, body

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> "Traced":
        terms = [_spell(x) for x in inputs]
        if method == "__call__" and ufunc.__name__ in COMPARISON:
            return Traced(f"({terms[0]} {COMPARISON[ufunc.__name__]} {terms[1]})", self.body)
        if method != "__call__" or ufunc.__name__ not in SPELLING:
            raise TypeError(f"np.{ufunc.__name__} has no spelling in interchange.shader.SPELLING.")
        return Traced(self.body.name_of(SPELLING[ufunc.__name__].format(*terms)), self.body)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> "Traced":
        if function is not np.where or len(args) != 3:
            raise TypeError(f"np.{function.__name__} has no spelling in a shader; np.where(c, a, b) has.")
        c, a, b = (_spell(x) for x in args)
        return Traced(self.body.name_of(f"{c} ? {a} : {b}"), self.body)


def _spell(x: Any) -> str:
    if isinstance(x, Traced):
        return x.name
    text = repr(float(x))
    return f"({text})" if text.startswith("-") else text


def function(brdf: Brdf, dialect: Dialect, name: str) -> str:
    """The shader function ``color NAME(vector wi, vector wo, float p[N])`` of a BRDF, in 1/sr.

    ``p`` takes the numbers of ``brdf.flat()``, or a texture's in their place; only the kind of model and its
    number of lobes enter the text. Needs ``dialect.power`` before it. Directions above the surface only.
    """
    body = Body()
    p = [Traced(f"p[{i}]", body) for i in range(len(brdf.flat()))]
    wi, wo = (tuple(Traced(w + c, body) for c in dialect.components) for w in ("wi", "wo"))
    channels = [_spell(brdf.bind(p, c).f(wi, wo)) for c in range(3)]
    lines = "\n    ".join([*body.lines, f"return {dialect.color}({', '.join(channels)});"])
    v = dialect.vector
    return f"{dialect.color} {name}({v} wi, {v} wo, float p[{len(p)}])\n{{\n    {lines}\n}}\n"


def structure(brdf: Brdf) -> tuple[str, int]:
    """What decides a shader's text: BRDFs with an equal structure share one function."""
    return type(brdf).__name__, brdf.lobes
