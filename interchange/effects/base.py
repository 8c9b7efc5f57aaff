"""What every effect is: declared parameters, a stage, and one function on pixels or on the scene.

An effect of the image chain takes an image of its stage's quantity and gives one of the same quantity (``apply``):

| stage | pixels are | unit |
|---|---|---|
| ``OPTICS`` | irradiance on the sensor, three channels | W/m² |
| ``SENSOR`` | electrons, three channels or one | e- |
| ``READOUT`` | digital numbers, not rounded before ``quantization`` | DN |

``SCENE`` and ``MATERIAL`` effects, and the lens where it bends rays, change what is rendered; ``expose`` leaves them
alone. In place of ``apply`` they have ``on_scene``, which gives the scene to be rendered instead, or, where no scene
can say the effect, ``on_radiance``, which gives a rendering after it. ``target`` is the prim path of the lamp, object,
material or camera that they are about, or its last part, or several (``interchange.effects.parts.members``); "" is all
of them.

Their parameters are what reality differs by from what the scene says, in the units that rigs are measured in: mm, mrad,
factors. Within a stage light meets the effect of lower ``order`` first. The defaults of a model are the effect that
is not there.

``identified_by``, ``confused_with`` and ``separated_by`` are for a diagnosis: what only this effect does, which effects
look alike, and the one more capture that tells it from them.

``carried_by`` says which number of the camera each parameter is ("lens.vignetting.0"): a scene file's attribute is
read into the effect and written back through it.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from enum import IntEnum
from typing import Any, ClassVar, Self

import numpy as np

from interchange.camera import Camera
from interchange.image import Image
from interchange.local import Local
from interchange.parameter import freeze, parameters
from interchange.scene import Scene


class Stage(IntEnum):
    SCENE = 0
    MATERIAL = 1
    OPTICS = 2
    SENSOR = 3
    READOUT = 4


class Effect:
    stage: ClassVar[Stage]
    order: ClassVar[int]
    source: ClassVar[str]
    pointwise: ClassVar[bool] = False  # a pixel depends on itself alone: the image may come in bands of rows
    achromatic: ClassVar[bool] = False  # linear, and alike for all channels: it may act on their mean
    always: ClassVar[bool] = False  # part of every camera, whatever its parameters
    per_second: ClassVar[
        dict[str, str]
    ] = {}  # parameters that may grow with the exposure time, each with the one that says how fast
    physical: ClassVar[
        dict[str, float]
    ] = {}  # least values that nature gives, where the formula allows for less
    carried_by: ClassVar[dict[str, str]] = {}
    identified_by: ClassVar[str]
    confused_with: ClassVar[tuple[str, ...]]
    separated_by: ClassVar[str]

    def __post_init__(self) -> None:
        freeze(self)

    @classmethod
    def name(cls) -> str:
        """What scene and diagnosis files call it: its file's name."""
        return cls.__module__.rsplit(".", 1)[-1]

    @classmethod
    def within(cls, values: Mapping[str, float]) -> dict[str, float]:
        """Those of ``values`` that it has, as near as may be."""
        about = parameters(cls)
        return {n: min(max(x, about[n].low), about[n].high) for n, x in values.items() if n in about}

    @property
    def is_there(self) -> bool:
        return self.always or self._values() != _default(type(self))._values()

    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, f.name) for f in fields(self))  # type: ignore[arg-type]

    def apply(self, image: Image, camera: Camera, rng: np.random.Generator | None) -> Image:
        """The image after the effect. Without ``rng``: its mean over many frames."""
        return image

    def on_scene(self, scene: Scene, target: str = "") -> Scene:
        """The scene that has the effect on ``target``. Raises BrightfieldError where there is no such target, or where
        the scene cannot have the effect."""
        return scene

    def on_radiance(self, image: Image, target: str = "") -> Image:
        """The rendering, radiance with passes, after the effect on ``target``. Raises BrightfieldError where a pass is
        missing."""
        return image

    @classmethod
    def is_of_the_chain(cls) -> bool:
        """Whether ``expose`` applies it."""
        return cls.apply is not Effect.apply

    def kernels(self, image: Image, camera: Camera) -> list[np.ndarray] | None:
        """Where the effect is a convolution alike all over this image: its kernel, one for all channels or one each.

        ``expose`` applies neighbouring convolutions as one.
        """
        return None

    def local(self, image: Image, camera: Camera) -> Local | None:
        """Where a pixel depends on pixels near it alone, and not on other passes: what ``expose`` runs in bands."""
        return None

    @classmethod
    def of(cls, camera: Camera) -> Self:
        """The effect as a camera's lens and sensor have it."""
        return cls(**{name: _get(camera, path) for name, path in cls.carried_by.items()})

    def on(self, camera: Camera) -> Camera:
        """The camera that has this effect, as far as a camera can carry it."""
        new: dict[str, dict[str, Any]] = {}
        for name, path in self.carried_by.items():
            part, field, *index = path.split(".")
            value = getattr(self, name)
            if index:
                numbers = list(new.get(part, {}).get(field, getattr(getattr(camera, part), field)))
                numbers[int(index[0])] = value
                value = tuple(numbers)
            new.setdefault(part, {})[field] = value
        if new:
            camera = replace(camera, **{p: replace(getattr(camera, p), **v) for p, v in new.items()})
        return camera


def carried(**paths: str) -> dict[str, str]:
    """``carried_by`` of an effect: ``carried(a2="lens.vignetting.0")``."""
    return paths


def _get(camera: Camera, path: str) -> Any:
    part, name, *index = path.split(".")
    value = getattr(getattr(camera, part), name)
    return value[int(index[0])] if index else value


_DEFAULTS: dict[str, Any] = {}


def _default(model: Any) -> Any:
    """What is not there, made once."""
    key = f"{model.__module__}.{model.__qualname__}"
    if key not in _DEFAULTS:
        _DEFAULTS[key] = model()
    return _DEFAULTS[key]
