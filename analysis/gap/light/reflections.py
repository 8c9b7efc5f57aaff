"""What other lobes change of the light that comes by way of surfaces: a pocket in polished metal shows its walls.

A difference of direct light (analysis.gap.light.knots) has none of it; of a milled block's anisotropy it is all that
some lamps show (docs/diagnosis_method.md). It is told by two renderings with the same paths, on a grid of some thousand
pixels, laid onto the surfaces (analysis.gap.light.room.coarsely), at knots of a parameter; in between it is on straight
lines from one to the next. What a width changes is as much as there is of the lobes, their level. An anisotropy is
told by the ways that its grain may run: on what stands upright a grain that is laid from above runs level whichever
way it does (interchange.mesh).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from analysis.gap.light.light_change import Change, difference, read, small, write
from analysis.gap.light.named import drawn, fingerprint
from analysis.gap.light.radiance import Changes, Paths, Render, Rendered, changed, surfaces
from analysis.gap.light.room import coarsely
from analysis.gap.parallel import by_asker
from interchange.camera import Camera
from interchange.effects import Effect
from interchange.effects.anisotropy import Anisotropy
from interchange.effects.gloss import Gloss
from interchange.problems import BrightfieldError
from interchange.scene import Scene

SIZE = 60_000  # px that a change is laid onto at most
TRACED = 8000  # of them that are traced, about
STEPS = {"width": 0.2, "level": 0.2}  # of gloss, to the first knot: paths' noise is as large of shorter ones
STRETCHED = {"ratio": 0.5, "split": 0.06}  # the same of anisotropy, of ln ratio and of a split
ASLANT = {"ratio": "diagonal", "split": "cross"}
WAYS = 16  # of twice a grain's angle that are traced, around
FURTHEST = 6  # knots, each twice as far as the one before
Weighted = tuple[tuple[float, Change], ...]
Knot = Callable[[float], Effect]  # a number's effect
Planes = dict[str, np.ndarray]


class Reflections:
    """``render`` as ``settings`` say (analysis.gap.light.radiance); ``cache``: where changes are kept."""

    def __init__(self, render: Render, settings: dict[str, Any], cache: Path) -> None:
        self.render, self.settings, self.cache = render, settings, cache
        self._changes: dict[tuple[int, Effect, str], Change] = {}
        self._before: dict[int, Planes] = {}
        self._shown: dict[int, Rendered] = {}  # which live as long as their ids are used

    def changes(self, shown: Rendered, effects: Changes) -> Weighted:
        """What those of ``effects`` that change lobes add to what was ``shown``, as a sum of changes at knots."""
        out: list[tuple[float, Change]] = []
        for effect, target in effects:
            if isinstance(effect, Gloss):
                out += self._of_gloss(shown, "level", effect, target)
                out += times(effect.level, self._of_gloss(shown, "width", effect, target))
            elif isinstance(effect, Anisotropy):
                for along, step in STRETCHED.items():
                    x, y = _stretched(effect, along)
                    for own, way in _between_ways(x, y) if x or y else ():
                        stretched = partial(_anisotropy, along, way)
                        out += times(own, self._secant(shown, stretched, target, float(np.hypot(x, y)), step))
        return tuple(out)

    def slope(self, shown: Rendered, effect: Effect, target: str, parameter: str) -> Weighted:
        """The same of a unit more of a parameter, where it is as ``effect`` has it. At home a grain that runs aslant
        has none: the one and the other way come to the same on what stands upright."""
        if isinstance(effect, Gloss):
            x = getattr(effect, parameter) - 1.0
            own = self._tangent(shown, partial(_gloss, parameter), target, x, STEPS[parameter])
            if parameter == "width":
                return times(effect.level, own)
            return (*own, *self._of_gloss(shown, "width", effect, target))
        along = parameter if parameter in ASLANT else next(a for a, b in ASLANT.items() if b == parameter)
        assert isinstance(effect, Anisotropy)
        x, y = _stretched(effect, along)
        r = float(np.hypot(x, y))
        if parameter == along:
            shares = _between_ways(1.0, 0.0, x, y) if r else ((1.0, 0),)
            unit = 1 / effect.ratio if along == "ratio" else 1.0
        else:
            shares, unit = _between_ways(0.0, 1.0, x, y) if r else (), 1.0
        out: list[tuple[float, Change]] = []
        for share, way in shares:
            stretched = partial(_anisotropy, along, way)
            out += times(share * unit, self._secant(shown, stretched, target, r, STRETCHED[along]))
        return tuple(out)

    def _of_gloss(self, shown: Rendered, parameter: str, effect: Gloss, target: str) -> Weighted:
        x = getattr(effect, parameter) - 1.0
        if not x:
            return ()
        return times(x, self._secant(shown, partial(_gloss, parameter), target, x, STEPS[parameter]))

    def _secant(self, shown: Rendered, of: Knot, target: str, x: float, step: float) -> Weighted:
        """A unit's part of what ``x`` from home changes."""
        ends = self._ends(shown, of, target, x, step)
        if len(ends) < 2:
            return tuple((1 / a, change) for a, change in ends)
        (a, near), (b, far) = ends
        return ((x - a) / (b - a) / x, far), ((b - x) / (b - a) / x, near)

    def _tangent(self, shown: Rendered, of: Knot, target: str, x: float, step: float) -> Weighted:
        """Of a unit more."""
        ends = self._ends(shown, of, target, x, step) or self._ends(shown, of, target, -x or -1e-9, step)
        if len(ends) < 2:
            return tuple((1 / a, change) for a, change in ends)
        (a, near), (b, far) = ends
        return (1 / (b - a), far), (-1 / (b - a), near)

    def _ends(
        self, shown: Rendered, of: Knot, target: str, x: float, step: float
    ) -> list[tuple[float, Change]]:
        """The knots that ``x`` from home lies between, without home, and those that cannot be."""
        told = [(k * step, self._knot(shown, of, target, k * step)) for k in around(x / step) if k]
        return [(x, change) for x, change in told if change is not None]

    def _knot(self, shown: Rendered, of: Knot, target: str, x: float) -> Change | None:
        try:
            own = of(x)
            after = changed(shown.scene, ((own, target),))
        except BrightfieldError:  # more than it may be
            return None
        key = (id(shown), own, target)

        def traced() -> Change:
            if key not in self._changes:
                self._shown[id(shown)] = shown
                self._changes[key] = self._between(shown, after)
            return self._changes[key]

        return self._changes[key] if key in self._changes else by_asker(traced)

    def _between(self, shown: Rendered, after: Scene) -> Change:
        before = shown.scene
        both = (before.bodies, before.lights, after.bodies, after.lights)
        name = fingerprint((*both, drawn(shown.camera), self.settings, SIZE, TRACED, "by way of surfaces"))
        file = self.cache / f"{name[:32]}.knot.npz"
        if file.is_file():
            return read(file)
        if id(shown) not in self._before:
            self._before[id(shown)] = self._traced(shown, before)
        change = difference(self._traced(shown, after), self._before[id(shown)])
        self.cache.mkdir(parents=True, exist_ok=True)
        write(file, change)
        return change

    def _traced(self, shown: Rendered, scene: Scene) -> Planes:
        """{lamp: (h, w, 3)} radiance by way of surfaces, of a camera of ``SIZE`` pixels at most."""
        camera = small(drawn(shown.camera), SIZE)
        w, h = camera.sensor.resolution
        lamps = list(shown.indirect)
        surface, normal = (
            cv2.resize(plane, (w, h), interpolation=cv2.INTER_NEAREST)
            for plane in (surfaces(shown.passes).astype(np.int32), shown.passes["normal"])
        )

        def traced(eye: Camera) -> list[np.ndarray]:
            around = self.render(replace(scene, cameras=()), eye, ("indirect",), True, 1, Paths.REFLECTED)
            return [around.passes[f"indirect:{name}"] for name in lamps]

        coarser = int(np.ceil(np.sqrt(w * h / TRACED))) // 2 * 2 + 1  # odd
        return dict(zip(lamps, coarsely(traced, camera, coarser, surface, normal), strict=True))


def around(x: float) -> tuple[int, int]:
    """The knots that ``x`` lies between, of 0, 1, 2, 4 and so on to its side; the nearer to home first."""
    side = -1 if x < 0 else 1
    if abs(x) < 1:
        return 0, side
    k = min(int(np.log2(abs(x))), FURTHEST - 2)
    return side << k, side << (k + 1)


def times(x: float, parts: Weighted) -> Weighted:
    return tuple((x * share, change) for share, change in parts)


def _gloss(parameter: str, x: float) -> Effect:
    return Gloss(**{parameter: 1 + x})


def _anisotropy(along: str, way: int, x: float) -> Effect:
    """``x`` in the direction ``way`` of the plane of both numbers."""
    angle = 2 * np.pi * way / WAYS
    own, aslant = x * float(np.cos(angle)), x * float(np.sin(angle))
    return Anisotropy(**{along: float(np.exp(own)) if along == "ratio" else own, ASLANT[along]: aslant})


def _stretched(effect: Anisotropy, along: str) -> tuple[float, float]:
    """ln ratio and that of both diagonals, or the splits."""
    if along == "ratio":
        return float(np.log(effect.ratio)), effect.diagonal
    return effect.split, effect.cross


def _between_ways(x: float, y: float, at_x: float = 0.0, at_y: float = 0.0) -> tuple[tuple[float, int], ...]:
    """(x, y) as a sum of the two directions that (``at_x``, ``at_y``), or itself, lies between: how much of which."""
    angle = 2 * np.pi / WAYS
    place = np.arctan2(at_y, at_x) if at_x or at_y else np.arctan2(y, x)
    way = int(np.floor(place / angle + 1e-9))
    a, b = way * angle, (way + 1) * angle
    shares = np.array([x * np.sin(b) - y * np.cos(b), y * np.cos(a) - x * np.sin(a)]) / np.sin(angle)
    return tuple((float(s), w % WAYS) for s, w in zip(shares, (way, way + 1), strict=True) if abs(s) > 1e-9)
