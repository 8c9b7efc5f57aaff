"""What is wrong with a plan, gathered while it is read."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from interchange.problems import Problem, Where, did_you_mean


class Findings:
    """What is wrong with the file so far."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems: list[Problem] = []

    def __call__(self, key: str, message: str) -> None:
        self.problems.append(Problem(message, Where(str(self.path), key)))

    def strange(self, data: Mapping[Any, Any], known: set[str], key: str) -> None:
        """Keys that are not known, each with what may have been meant."""
        for name in data:
            if name not in known:
                hint = did_you_mean(str(name), known) or f" There are {', '.join(sorted(known))}."
                self(f"{key}.{name}" if key else str(name), f'The key "{name}" is not known.{hint}')

    def number(
        self, data: Mapping[str, Any], name: str, key: str, low: float, high: float, default: Any
    ) -> Any:
        """A number of a mapping within bounds, or the default where it is not there or wrong."""
        value = data.get(name, default)
        whole = isinstance(default, int)
        good = isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high
        if name in data and (not good or (whole and value != int(value))):
            self(
                f"{key}.{name}" if key else name,
                f"It must be a {'whole ' if whole else ''}number in [{low:g}, {high:g}]; got {value!r}.",
            )
            return default
        return int(value) if whole else value

    def flag(self, data: Mapping[str, Any], name: str, key: str, default: bool) -> bool:
        value = data.get(name, default)
        if not isinstance(value, bool):
            self(f"{key}.{name}" if key else name, f"It must be true or false; got {value!r}.")
            return default
        return value
