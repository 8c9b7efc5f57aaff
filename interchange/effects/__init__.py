"""The effects of the gap catalogue, one file each, under the names of the file contract."""

from collections import Counter
from collections.abc import Sequence
from functools import lru_cache

from interchange.camera import Camera
from interchange.catalogue import catalogue
from interchange.effects.base import Effect, Stage

MODELS = catalogue(__name__, Effect)  # by file name, which is the effect's name

# numbers of a camera that more than one effect stands for
SHARED = {
    path for path, n in Counter(p for m in MODELS.values() for p in m.carried_by.values()).items() if n > 1
}


def chain(camera: Camera, given: Sequence[Effect] = ()) -> tuple[tuple[Effect, ...], Camera]:
    """The effects that a camera's image goes through, in order, and the camera that has those that are ``given``.

    A given effect stands for the camera's own of that kind. Raises ParameterError.
    """
    before = camera
    for effect in given:
        camera = effect.on(camera)
    kinds = {type(effect) for effect in given}
    # others are as the new camera has them where what is given says more of it than its own numbers
    one = any(kind.on is not Effect.on or SHARED & set(kind.carried_by.values()) for kind in kinds)
    own = [effect for effect in _own(camera if one else before) if type(effect) not in kinds]
    there = [effect for effect in (*own, *given) if effect.is_of_the_chain() and effect.is_there]
    return tuple(sorted(there, key=lambda e: (e.stage, e.order))), camera


@lru_cache(maxsize=64)
def _own(camera: Camera) -> tuple[Effect, ...]:
    """The effects of the chain as a camera has them; cameras are told apart by identity."""
    return tuple(model.of(camera) for model in MODELS.values() if model.is_of_the_chain())


__all__ = ["MODELS", "Effect", "Stage", "chain"]
