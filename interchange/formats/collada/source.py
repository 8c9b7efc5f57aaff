"""Numbers in XML text, and COLLADA's <source>: an array and an accessor that says how to step through it."""

from typing import Any

import numpy as np

from interchange.formats.collada.library import Library

ARRAYS = (
    "float_array",
    "int_array",
    "bool_array",
    "Name_array",
    "IDREF_array",
    "SIDREF_array",
    "token_array",
)
NUMERIC = ("float_array", "int_array")


def floats(element: Any, lib: Library, count: int | None = None) -> np.ndarray | None:
    """The numbers (N,) of an element's text; None, with a finding, if they are none or not ``count`` many."""
    try:
        values = np.array((element.text or "").split(), dtype=np.float64)
    except ValueError as error:
        lib.find.error(f"<{element.tag}> must hold numbers: {error}.", element)
        return None
    if count is not None and len(values) != count:
        lib.find.error(f"<{element.tag}> must hold {count} numbers; got {len(values)}.", element)
        return None
    return values


def integers(element: Any, lib: Library) -> np.ndarray | None:
    """The integers (N,) of an element's text, or None with a finding."""
    try:
        return np.array((element.text or "").split(), dtype=np.int64)
    except (ValueError, OverflowError) as error:
        lib.find.error(f"<{element.tag}> must hold integers: {error}.", element)
        return None


def whole(element: Any, name: str, lib: Library, default: int | None = None) -> int | None:
    """A non-negative integer attribute, ``default`` where it is missing, None with a finding where it is bad."""
    text = element.get(name)
    if text is None:
        if default is None:
            lib.find.error(f"<{element.tag}> must have the attribute {name}.", element)
        return default
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        lib.find.error(f'{name} of <{element.tag}> must be a whole number; got "{text[:40]}".', element)
        return None
    return value


class Sources:
    """Reads each <source> once."""

    def __init__(self, lib: Library) -> None:
        self.lib = lib
        self._numbers: dict[Any, np.ndarray | None] = {}

    def numbers(self, source: Any) -> np.ndarray | None:
        """(N, width) float64: one row an accessor step, named parameters only. None with a finding."""
        if source not in self._numbers:
            self._numbers[source] = self._read(source)
        return self._numbers[source]

    def names(self, source: Any) -> list[str]:
        """The words of a <source> of names."""
        array = next((c for c in source if c.tag in ARRAYS), None)
        return [] if array is None else (array.text or "").split()

    def _read(self, source: Any) -> np.ndarray | None:
        find = self.lib.find
        accessor = source.find("technique_common/accessor")
        if accessor is None:
            find.error("A source must have an accessor.", source)
            return None
        array = self.lib.resolve(accessor.get("source"), accessor, NUMERIC)
        if array is None:
            return None
        values = floats(array, self.lib)
        count = whole(array, "count", self.lib)
        steps = whole(accessor, "count", self.lib)
        stride = whole(accessor, "stride", self.lib, 1)
        offset = whole(accessor, "offset", self.lib, 0)
        if values is None or count is None or steps is None or stride is None or offset is None:
            return None
        if len(values) < count:
            find.error(f"The array must hold the {count} numbers of its count; got {len(values)}.", array)
            return None
        if len(values) > count:
            find.note(f"The array holds {len(values)} numbers, more than its count {count}.", array)
        if stride > max(len(values), 1):
            find.error(
                f"The accessor's stride {stride} is more than the {len(values)} numbers there are.", accessor
            )
            return None
        params = accessor.findall("param")
        columns = [i for i, p in enumerate(params) if p.get("name")] or list(range(len(params)))
        widths = [16 if p.get("type") == "float4x4" else 1 for p in params]
        if params and widths[0] == 16:
            columns = list(range(16))
        if not params:
            columns = list(range(max(stride, 1)))
        width = max(stride, 1)
        if columns[-1] >= width:
            find.error(
                f"The accessor has {columns[-1] + 1} parameters, more than its stride {width}.", accessor
            )
            return None
        needed = offset + (steps - 1) * width + columns[-1] + 1 if steps else 0
        if needed > len(values):
            find.error(f"The accessor reaches for {needed} numbers; the array holds {len(values)}.", accessor)
            return None
        index = offset + np.arange(steps)[:, None] * width + np.array(columns)
        return values[index]
