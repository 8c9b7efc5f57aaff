"""The user's own algorithm, by ``module:function``: parameters are declared in its signature.

    from typing import Annotated
    import numpy as np
    from interchange.parameter import Parameter

    def bright(
        image: np.ndarray,
        threshold: Annotated[float, Parameter("t", "grey level", 1, 250, "what counts as bright")] = 80,
    ) -> np.ndarray:
        return image > threshold

``image`` (H, W) float32, grey levels of 8 bits. What it returns says what it finds: an array (n, 2) of floats is edge
points (column, row), an array (H, W) of bool or labels is blobs; a gauge takes a second argument ``near`` annotated
with analysis.tune.found.Circle, Line or Place and returns one such, or None. A subclass of Algorithm may be named too.
"""

import inspect
from collections.abc import Callable
from dataclasses import make_dataclass
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import cv2
import numpy as np

from analysis.tune.algorithms.base import Algorithm
from analysis.tune.algorithms.template_match import Pattern
from analysis.tune.found import Blobs, Circle, Edges, Found, Line, Place
from analysis.users_own import users_own
from interchange.parameter import Parameter, parameter
from interchange.problems import BrightfieldError

KINDS = {"edges": Edges, "blobs": Blobs}


def load(name: str, finds: str = "") -> type[Algorithm]:
    """The algorithm ``module:name``, the working directory being searched first. Raises BrightfieldError."""
    found = users_own(name, "An algorithm of your own")
    if isinstance(found, type) and issubclass(found, Algorithm):
        return found
    return of_function(found, name)


def of_function(function: Callable[..., Any], name: str) -> type[Algorithm]:
    """An algorithm whose ``run`` calls ``function``. Raises BrightfieldError where its signature says too little."""
    try:
        hints = get_type_hints(function, include_extras=True)
    except NameError as error:
        raise BrightfieldError(f"The annotations of {name} cannot be read: {error}.") from None
    places = list(inspect.signature(function).parameters.values())
    if not places:
        raise BrightfieldError(f"{name} must take an image as its first argument.")
    near = len(places) > 1 and places[1].name == "near"
    declared = []
    for place in places[2 if near else 1 :]:
        hint = hints.get(place.name)
        about = next((a for a in get_args(hint)[1:] if isinstance(a, Parameter)), None)
        if get_origin(hint) is not Annotated or about is None:
            raise BrightfieldError(
                f"Each argument of {name} after the image must be annotated with its bounds, Annotated[float, "
                f'Parameter(symbol, unit, low, high, meaning)]; "{place.name}" is not.'
            )
        if place.default is place.empty:
            raise BrightfieldError(f'The argument "{place.name}" of {name} must have a default.')
        made = parameter(place.default, about.symbol, about.unit, about.low, about.high, about.meaning)
        declared.append((place.name, float, made))
    kind = _finds(function, hints, near, name)

    def run(self: Any, image: np.ndarray, near_it: Any = None) -> Found | None:
        values = {n: getattr(self, n) for n, _, _ in declared}
        given = (image, near_it) if near else (image,)
        try:
            result = function(*given, **values)
        except Exception as error:  # the user's own function may raise anything
            raise BrightfieldError(f"{name} failed: {type(error).__name__}: {error}.") from None
        return _found(result, kind, image, name)

    made_class = make_dataclass(
        function.__name__,
        declared,
        bases=(Algorithm,),
        namespace={"run": run, "finds": kind, "source": name, "function": staticmethod(function)},
        frozen=True,
    )
    return made_class


def _finds(function: Callable[..., Any], hints: dict[str, Any], near: bool, name: str) -> type:
    if near:
        kind = hints.get("near")
        if kind in (Circle, Line):
            return kind
        if kind in (Place, Pattern):
            return Place
        raise BrightfieldError(
            f'The argument "near" of {name} must be annotated with Circle, Line or Pattern.'
        )
    returned = hints.get("return")
    if returned in (Edges, Blobs):
        return returned
    said = getattr(function, "finds", "")
    if said in KINDS:
        return KINDS[said]
    probe = np.zeros((48, 64), np.float32)
    probe[:, 32:] = 200
    try:
        result = np.asarray(function(probe))
    except Exception as error:  # the user's own function may raise anything
        raise BrightfieldError(
            f"{name} failed on a picture of a step: {type(error).__name__}: {error}."
        ) from None
    if result.ndim == 2 and result.shape == probe.shape:
        return Blobs
    if result.size == 0 or (result.ndim == 2 and result.shape[1] == 2):
        return Edges
    raise BrightfieldError(
        f"{name} must return edge points (n, 2) or an image (H, W) of blobs; got an array {result.shape}."
    )


def _found(result: Any, kind: type, image: np.ndarray, name: str) -> Found | None:
    if result is None and kind in (Circle, Line, Place):
        return None
    if isinstance(result, Edges | Blobs | Circle | Line | Place) and isinstance(result, kind):
        return result
    array = np.asarray(result)
    if kind is Edges and (array.size == 0 or (array.ndim == 2 and array.shape[1] == 2)):
        points = array.reshape(-1, 2).astype(np.float64)
        if np.isfinite(points).all():
            return Edges(points)
    if kind is Blobs and array.shape == image.shape:
        if array.dtype == bool:
            return Blobs(cv2.connectedComponents(array.astype(np.uint8))[1].astype(np.int32))
        return Blobs(array.astype(np.int32))
    raise BrightfieldError(f"{name} must return {kind.__name__} each time; got {type(result).__name__}.")
