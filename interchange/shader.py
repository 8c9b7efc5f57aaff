"""Write a BRDF's NumPy formula as GLSL, OSL or plain Python: it is called on values that note what is done to them.

The three channels are traced into one body, in which an expression that was met before is not written again:
what the channels share (angles, powers, rows of a table) costs once.
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
    "floor": "floor({})",
    "arctan2": "{arctan2}({}, {})",
    "erf": "erf({})",
}
LOGIC = ("logical_and", "logical_or", "logical_not")
COMPARISON = {"greater": ">", "greater_equal": ">=", "less": "<", "less_equal": "<="}


@dataclass(frozen=True)
class Dialect:
    """``prelude`` must stand before a function; ``row`` reads row ``{1}`` of table ``{0}`` as a color."""

    name: str
    vector: str
    color: str
    components: tuple[str, str, str]
    arctan2: str
    prelude: str
    row: str
    statement: str = "{kind} {name} = {expression};"
    choice: str = "{0} ? {1} : {2}"
    logic: tuple[str, str, str] = ("({} && {})", "({} || {})", "(!{})")


POWER = "float power(float x, float n) { return x > 0.0 ? pow(x, n) : 0.0; }\n"
# Abramowitz & Stegun 7.1.26 within 1.5e-7; the series keeps small arguments exact
ERF = """float erf(float x)
{
    float a = abs(x), t = 1.0 / (1.0 + 0.3275911 * a);
    float far = 1.0 - ((((1.061405429 * t - 1.453152027) * t + 1.421413741) * t - 0.284496736) * t
        + 0.254829592) * t * exp(-a * a);
    float near = 1.1283791670955 * a * (1.0 - a * a * (1.0 / 3.0 - 0.1 * a * a));
    float e = a < 0.1 ? near : far;
    return x < 0.0 ? -e : e;
}
"""
ROW = "vec3 row(sampler2D t, float i) { int k = int(i); return texelFetch(t, ivec2(k % 1024, k / 1024), 0).rgb; }\n"
GLSL = Dialect(
    "GLSL",
    "vec3",
    "vec3",
    (".x", ".y", ".z"),
    "atan",
    POWER + ERF,
    "row({}, {})",
)
OSL = Dialect(
    "OSL",
    "vector",
    "color",
    ("[0]", "[1]", "[2]"),
    "atan2",
    POWER,
    "{}({})",
)
PYTHON = Dialect(  # for a compiler of Python; ``math`` and ``power`` must be at hand
    "Python",
    "",
    "",
    ("[0]", "[1]", "[2]"),
    "atan2",
    "",
    "{}[int({})]",
    statement="{name} = {expression}",
    choice="{1} if {0} else {2}",
    logic=("({} and {})", "({} or {})", "(not {})"),
)


class Body:
    """The lines written so far, each expression once."""

    def __init__(self, dialect: Dialect) -> None:
        self.dialect = dialect
        self.lines: list[str] = []
        self.known: dict[str, str] = {}

    def name_of(self, expression: str, kind: str = "float") -> str:
        if expression not in self.known:
            name = f"t{len(self.lines)}"
            self.lines.append(self.dialect.statement.format(kind=kind, name=name, expression=expression))
            self.known[expression] = name
        return self.known[expression]


class Traced(NDArrayOperatorsMixin):
    """A shader's float: every NumPy operation on it appends a line to the body. A comparison stays an expression,
    for ``np.where`` and the logical functions alone."""

    def __init__(self, name: str, body: Body) -> None:
        self.name, self.body = name, body

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> "Traced":
        if any(
            hasattr(x, "__array_ufunc__") and not isinstance(x, Traced | np.generic | np.ndarray)
            for x in inputs
        ):
            return NotImplemented  # a value that carries more, such as derivatives
        terms = [spell(x) for x in inputs]
        name = ufunc.__name__
        if method != "__call__" or name not in {*SPELLING, *COMPARISON, *LOGIC}:
            raise TypeError(f"np.{name} has no spelling in interchange.shader.SPELLING.")
        if name in COMPARISON:
            return Traced(f"({terms[0]} {COMPARISON[name]} {terms[1]})", self.body)
        if name in LOGIC:
            return Traced(self.body.dialect.logic[LOGIC.index(name)].format(*terms), self.body)
        text = SPELLING[name].format(*terms, arctan2=self.body.dialect.arctan2)
        return Traced(self.body.name_of(text), self.body)

    def __array_function__(self, function: Any, types: Any, args: Any, kwargs: Any) -> "Traced":
        if function is not np.where or len(args) != 3:
            raise TypeError(f"np.{function.__name__} has no spelling in a shader; np.where(c, a, b) has.")
        if any(
            hasattr(x, "__array_function__") and not isinstance(x, Traced | np.generic | np.ndarray)
            for x in args
        ):
            return NotImplemented
        c, a, b = (spell(x) for x in args)
        return Traced(self.body.name_of(self.body.dialect.choice.format(c, a, b)), self.body)


@dataclass(frozen=True)
class TracedColumn:
    """One channel of a table (their mean for None) in a shader; the row is read once for all channels."""

    name: str
    channel: int | None
    size: int
    body: Body

    def take(self, index: Any) -> Traced:
        top: Any = index
        if isinstance(index, Traced):
            top = np.minimum(np.maximum(top, 0.0), float(self.size - 1))
        row = self.body.name_of(self.body.dialect.row.format(self.name, spell(top)), self.body.dialect.color)
        parts = (
            [f"{row}{c}" for c in (".x", ".y", ".z")]
            if self.body.dialect is GLSL
            else [f"{row}[{c}]" for c in range(3)]
        )
        if self.channel is None:
            return Traced(self.body.name_of(f"({' + '.join(parts)}) / 3.0"), self.body)
        return Traced(parts[self.channel], self.body)


def spell(x: Any) -> str:
    if isinstance(x, Traced):
        return x.name
    text = repr(float(x))
    return f"({text})" if text.startswith("-") else text


def bound(brdf: Brdf, body: Body, channel: int | None) -> Brdf:
    """``brdf`` whose numbers are ``p[i]`` and whose tables are ``table_i`` in the body's language."""
    p = [Traced(f"p[{i}]", body) for i in range(len(brdf.flat()))]
    columns = [TracedColumn(f"table_{k}", channel, len(t), body) for k, t in enumerate(brdf.tables)]
    return brdf.bind(p, channel, columns)


def vector(name: str, body: Body) -> tuple[Traced, Traced, Traced]:
    x, y, z = (Traced(name + c, body) for c in body.dialect.components)
    return x, y, z


def function(brdf: Brdf, dialect: Dialect, name: str) -> str:
    """The shader function ``color NAME(vector wi, vector wo, float p[N])`` of a BRDF, in 1/sr.

    ``p`` takes the numbers of ``brdf.flat()``, or a texture's in their place; only ``brdf.structure`` enters the text,
    and the sizes of its tables. Needs ``dialect.prelude`` before it, and for every table ``table_0``, ``table_1`` ...
    (GLSL: a sampler2D, and ``ROW``; OSL: a function that returns a row). Directions above the surface only.
    """
    body = Body(dialect)
    wi, wo = vector("wi", body), vector("wo", body)
    channels = [spell(bound(brdf, body, c).f(wi, wo)) for c in range(3)]
    lines = "\n    ".join([*body.lines, f"return {dialect.color}({', '.join(channels)});"])
    v, count = dialect.vector, max(len(brdf.flat()), 1)
    return f"{dialect.color} {name}({v} wi, {v} wo, float p[{count}])\n{{\n    {lines}\n}}\n"
