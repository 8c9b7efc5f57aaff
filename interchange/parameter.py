"""What a model's parameter is: a value with a unit, bounds and a meaning, declared once.

The same declaration feeds the constructor, the check, the editor's slider, the sweep's axis,
the fit's bounds, the shader's uniforms, the USD attribute and the reference page.

Beside its parameters a model may have settings (whole numbers that decide the formula's text, such as a degree)
and tables (measured values that the formula looks up).
"""

from dataclasses import dataclass, field, fields
from enum import StrEnum
from functools import cache, cached_property
from typing import Any

import numpy as np

from interchange.problems import BrightfieldError
from interchange.table import Table


class Kind(StrEnum):
    """How many numbers a parameter has, under the name of its USD type."""

    FLOAT = "float"
    COLOR = "color3f"  # one number a channel
    VECTOR = "float3"

    @property
    def width(self) -> int:
        return 1 if self is Kind.FLOAT else 3


@dataclass(frozen=True)
class Parameter:
    symbol: str
    unit: str
    low: float
    high: float
    meaning: str
    kind: Kind = Kind.FLOAT
    per_lobe: bool = False  # a list with one entry a lobe

    @cached_property
    def bounds(self) -> tuple[float, float]:
        """As files hold them, in single precision, if that is further out."""
        return min(self.low, float(np.float32(self.low))), max(self.high, float(np.float32(self.high)))

    def is_frozen(self, value: Any) -> bool:
        """Whether a value is what ``freeze`` would make of it: most are, as models are made of other models."""
        low, high = self.bounds
        if self.per_lobe:
            return False
        if self.kind is Kind.FLOAT:
            return type(value) is float and low <= value <= high
        return (
            type(value) is tuple
            and len(value) == 3
            and all(type(x) is float and low <= x <= high for x in value)
        )


@dataclass(frozen=True)
class Setting:
    """A whole number that decides the text of a model's formula: a degree, a number of bins."""

    symbol: str
    low: int
    high: int
    meaning: str


@dataclass(frozen=True)
class TableOf:
    """A field that holds a ``Table``."""

    symbol: str
    unit: str
    meaning: str


class ParameterError(BrightfieldError, ValueError):
    """A parameter outside its declared bounds, or of the wrong shape."""


def parameter(
    default: Any,
    symbol: str,
    unit: str,
    low: float,
    high: float,
    meaning: str,
    kind: Kind = Kind.FLOAT,
    per_lobe: bool = False,
) -> Any:
    """Declare one field of a model, e.g. ``n: float = parameter(20, "n", "1", 0, 1e4, "exponent")``."""
    about = Parameter(symbol, unit, low, high, meaning, kind, per_lobe)
    return field(default=default, metadata={"parameter": about})


def setting(default: int, symbol: str, low: int, high: int, meaning: str) -> Any:
    """Declare a field that decides the formula's text: ``degree: int = setting(4, "l", 0, 20, "highest degree")``."""
    return field(default=default, metadata={"setting": Setting(symbol, low, high, meaning)})


def table(default: Table, symbol: str, unit: str, meaning: str) -> Any:
    """Declare a field of values that the formula looks up with ``self.NAME.take(index)``."""
    return field(default=default, metadata={"table": TableOf(symbol, unit, meaning)})


def settings(model: Any) -> dict[str, Setting]:
    return dict(_declared(_class(model), "setting"))


def tables(model: Any) -> dict[str, TableOf]:
    return dict(_declared(_class(model), "table"))


def parameters(model: Any) -> dict[str, Parameter]:
    """The declared parameters of a model or of its class, by field name, in the order of declaration."""
    return dict(_declared(_class(model), "parameter"))


def _class(model: Any) -> Any:
    return model if isinstance(model, type) else type(model)


@cache
def _declared(model: Any, what: str) -> dict[str, Any]:
    return {f.name: f.metadata[what] for f in fields(model) if what in f.metadata}


def freeze(model: Any) -> None:
    """Bring a frozen model's parameters to tuples of floats, its tables to ``Table``; check shapes and bounds.

    A colour given as one number stands for all three channels. Raises ParameterError, which names
    every parameter that is wrong.
    """
    wrong: list[str] = []
    lobes: dict[str, int] = {}
    for name, about in _declared(_class(model), "parameter").items():
        if about.is_frozen(getattr(model, name)):
            continue
        label = f"{type(model).__name__}.{name} ({about.symbol}, {about.meaning})"
        unit = "" if about.unit == "1" else f" {about.unit}"
        try:
            value = np.asarray(getattr(model, name), np.float64)
        except (TypeError, ValueError):
            wrong.append(f"{label} must be numbers; got {getattr(model, name)!r}.")
            continue
        shape: tuple[int, ...] = () if about.kind is Kind.FLOAT else (3,)
        if about.per_lobe:
            value = value.reshape(0, *shape) if value.size == 0 else value
            lobes[name] = len(value) if value.ndim else -1
            shape = (max(lobes[name], 0), *shape)
        if about.kind is Kind.COLOR and value.shape == shape[:-1]:
            value = np.repeat(value[..., None], 3, axis=-1)
        if value.shape != shape:
            wrong.append(f"{label} must have shape {shape}; got {value.shape}.")
            continue
        low, high = about.bounds
        outside = value[~((value >= low) & (value <= high))]  # written so that NaN is outside
        if outside.size:
            wrong.append(
                f"{label} must lie in [{about.low:g}, {about.high:g}]{unit}; got {outside.flat[0]:g}{unit}."
            )
        object.__setattr__(model, name, as_tuple(value))
    for name, rule in _declared(_class(model), "setting").items():
        number = getattr(model, name)
        label = f"{type(model).__name__}.{name} ({rule.symbol}, {rule.meaning})"
        if not isinstance(number, int | float | np.integer) or number != int(number):
            wrong.append(f"{label} must be a whole number; got {number!r}.")
        elif not rule.low <= number <= rule.high:
            wrong.append(f"{label} must lie in [{rule.low}, {rule.high}]; got {number}.")
        else:
            object.__setattr__(model, name, int(number))
    for name, content in _declared(_class(model), "table").items():
        try:
            object.__setattr__(model, name, Table.of(getattr(model, name)))
        except ValueError as error:
            wrong.append(f"{type(model).__name__}.{name} ({content.symbol}, {content.meaning}) {error}")
    if len(set(lobes.values())) > 1:
        counts = ", ".join(f"{name} has {count}" for name, count in lobes.items())
        wrong.append(f"{type(model).__name__} must have as many entries in every lobe parameter; {counts}.")
    if wrong:
        raise ParameterError(" ".join(wrong))


def as_tuple(value: np.ndarray) -> Any:
    """Nested tuples of floats, which hash and compare by value."""
    return tuple(as_tuple(v) for v in value) if value.ndim else float(value)
