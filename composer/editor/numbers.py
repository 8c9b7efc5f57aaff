"""One number of a camera by its dotted name: ``lens.f_stop``, ``lens.vignetting.0``, ``t_exp``."""

from dataclasses import fields, is_dataclass, replace
from enum import StrEnum
from typing import Any

from interchange.camera import Camera
from interchange.problems import BrightfieldError, did_you_mean

OWN = ("t_exp", "clip", "principal_point")


def number(camera: Camera, name: str) -> Any:
    """BrightfieldError where the camera has none of that name."""
    value: Any = camera
    for word in _words(camera, name):
        value = value[int(word)] if word.isdecimal() else getattr(value, word)
    return value


def with_number(camera: Camera, name: str, value: Any) -> Camera:
    """The camera with another value there; checked as its record checks it."""
    words = _words(camera, name)
    if words[0] in OWN:
        own: dict[str, Any] = {words[0]: tuple(value) if isinstance(value, list | tuple) else value}
        return replace(camera, **own)
    part, field, *index = words
    record = getattr(camera, part)
    if index:
        numbers = list(getattr(record, field))
        if int(index[0]) >= len(numbers):
            raise BrightfieldError(f"{name}: there are {len(numbers)} numbers, counted from 0.")
        numbers[int(index[0])] = float(value)
        value = tuple(numbers)
    now = getattr(record, field)
    if isinstance(now, StrEnum):
        words_known = [str(w) for w in type(now)]
        if value not in words_known:
            raise BrightfieldError(
                f'{name} must be one of {", ".join(words_known)}; got "{value}".'
                f"{did_you_mean(str(value), words_known)}"
            )
        value = type(now)(value)
    try:
        changed = replace(record, **{field: value})
    except (TypeError, ValueError) as error:
        if isinstance(error, BrightfieldError):
            raise
        raise BrightfieldError(f"{name} cannot be {value!r}: {error}.") from None
    return replace(camera, **{part: changed})


def _words(camera: Camera, name: str) -> list[str]:
    words = name.split(".")
    if words[0] in OWN and len(words) == 1:
        return words
    known = [f"{p}.{f.name}" for p in ("lens", "sensor") for f in fields(getattr(camera, p))]
    if ".".join(words[:2]) not in known or not all(w.isdecimal() for w in words[2:]) or len(words) > 3:
        hint = did_you_mean(name, [*known, *OWN])
        raise BrightfieldError(f'A camera has no number "{name}".{hint}')
    assert is_dataclass(camera)
    return words
