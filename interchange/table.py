"""Measured values that a formula looks up: rows of three channels, found by their number.

``take`` reads a row; the formula itself finds the rows and weighs them, so that NumPy, GLSL and OSL interpolate alike.
"""

from functools import cached_property
from hashlib import sha256
from typing import Any

import numpy as np

WIDTH = 1024  # texels in a row of the image that shaders read


class Table:
    """``values`` (N, 3) float32, read-only, one row an entry; N < 2^24, so that single precision can count them."""

    def __init__(self, values: Any) -> None:
        array = np.array(values, np.float32)
        if array.ndim == 1:
            array = np.repeat(array[:, None], 3, axis=1)
        if array.ndim != 2 or array.shape[1] != 3 or not 1 <= len(array) < 2**24:
            raise ValueError(f"must have shape (N, 3) with 1 to 2^24 - 1 rows; got {array.shape}.")
        if not np.isfinite(array).all():
            raise ValueError(f"must be finite; {int((~np.isfinite(array)).sum())} numbers are not.")
        array.flags.writeable = False
        self.values = array

    @classmethod
    def of(cls, values: "Table | Any") -> "Table":
        return values if isinstance(values, Table) else cls(values)

    def __len__(self) -> int:
        return len(self.values)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Table) and (other is self or self.digest == other.digest)

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        return f"Table({len(self)} rows, {self.digest[:8]})"

    @cached_property
    def digest(self) -> str:
        return sha256(self.values.tobytes()).hexdigest()

    @cached_property
    def pixels(self) -> np.ndarray:
        """(H, WIDTH, 3) float32: the rows in reading order, for a shader's texture."""
        padded = np.zeros((-(-len(self) // WIDTH) * WIDTH, 3), np.float32)
        padded[: len(self)] = self.values
        return padded.reshape(-1, WIDTH, 3)

    def channel(self, channel: int | None) -> "Column":
        """One channel, or the mean of the three for None."""
        values = self.values.mean(axis=1) if channel is None else self.values[:, channel]
        return Column(values.astype(np.float64))


class Column:
    """One channel of a table."""

    def __init__(self, values: np.ndarray) -> None:
        self.values = values

    def take(self, index: Any) -> np.ndarray:
        """The entries at ``index`` (whole numbers, any shape; held within the table)."""
        return self.values[np.clip(np.asarray(index), 0, len(self.values) - 1).astype(np.int64)]
