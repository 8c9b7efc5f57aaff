"""The effects of the gap catalogue, one file each, under the names of the file contract."""

from collections.abc import Sequence

from interchange.camera import Camera
from interchange.catalogue import catalogue
from interchange.effects.base import Effect, Stage

MODELS = catalogue(__name__, Effect)  # by file name, which is the effect's name


def chain(camera: Camera, given: Sequence[Effect] = ()) -> tuple[tuple[Effect, ...], Camera]:
    """The effects that a camera's image goes through, in order, and the camera that has those that are ``given``.

    A given effect stands for the camera's own of that kind. Raises ParameterError.
    """
    for effect in given:
        camera = effect.on(camera)
    kinds = {type(effect) for effect in given}
    own = [model.of(camera) for model in MODELS.values() if model.is_of_the_chain() and model not in kinds]
    there = [effect for effect in (*own, *given) if effect.is_of_the_chain() and effect.is_there]
    return tuple(sorted(there, key=lambda e: (e.stage, e.order))), camera


__all__ = ["MODELS", "Effect", "Stage", "chain"]
