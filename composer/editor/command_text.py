"""Edits as text: ``place path=/World/Lamp position=[0,0,0.3]``, one a line in a script and in the log."""

import json
import re
import shlex
from collections.abc import Mapping
from dataclasses import MISSING, fields
from typing import Any

import numpy as np

from composer.editor.commands import Command, tuples
from interchange.problems import BrightfieldError, did_you_mean


def snake(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


COMMANDS: dict[str, type[Command]] = {snake(c.__name__): c for c in Command.__subclasses__()}


def as_text(command: Command) -> str:
    """``place path=/World/Lamp position=[0,0,0.3]``: what ``parse`` reads; defaults are left out."""
    words = [snake(type(command).__name__)]
    for f in fields(command):  # type: ignore[arg-type]
        value = getattr(command, f.name)
        default = f.default_factory() if f.default_factory is not MISSING else f.default
        if value == default:
            continue
        plain = value if isinstance(value, str) else json.dumps(_plain(value), separators=(",", ":"))
        words.append(shlex.quote(f"{f.name}={plain}"))
    return " ".join(words)


def parse(text: str) -> Command:
    """A command from ``name field=value ...``. Values are JSON, or else words. BrightfieldError."""
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise BrightfieldError(f"A command's quotes must match ({error}); got {text}") from None
    if not words:
        raise BrightfieldError("A command must begin with its name.")
    name = words[0].replace("-", "_")
    if name not in COMMANDS:
        raise BrightfieldError(
            f'There is no edit "{words[0]}".{did_you_mean(name, COMMANDS)} There are {", ".join(COMMANDS)}.'
        )
    kind = COMMANDS[name]
    declared = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
    given: dict[str, Any] = {}
    for word in words[1:]:
        key, equals, value = word.partition("=")
        if not equals or key not in declared:
            raise BrightfieldError(
                f"{name} has {', '.join(declared)}, each as field=value; got {word}.{did_you_mean(key, declared)}"
            )
        given[key] = _value(value, str(declared[key].type))
    missing = [
        f.name
        for f in declared.values()
        if f.default is MISSING and f.default_factory is MISSING and f.name not in given
    ]
    if missing:
        raise BrightfieldError(f"{name} needs {', '.join(missing)}.")
    return kind(**given)


def _value(text: str, kind: str) -> Any:
    if kind == "<class 'str'>" or kind == "str":
        return text
    try:
        value = tuples(json.loads(text))
    except json.JSONDecodeError:
        value = text
    if kind.startswith("tuple[str") and isinstance(value, str):
        return (value,)
    if kind in ("<class 'float'>", "<class 'int'>", "<class 'bool'>") and not isinstance(value, int | float):
        raise BrightfieldError(f"A number was expected; got {text}.")
    if "Triple" in kind or kind.startswith(("tuple[float", "tuple[int", "float")) or "tuple[float" in kind:
        flat = np.asarray(value if value is not None else 0.0, dtype=object).ravel()
        if not all(isinstance(x, int | float) for x in flat):
            raise BrightfieldError(f"Numbers were expected; got {text}.")
    return value


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray | list | tuple):
        return [_plain(v) for v in value]
    return value.item() if isinstance(value, np.generic) else value
