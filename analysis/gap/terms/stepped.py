"""DN a unit of an effect that must be rendered: the difference of two renderings over the step between them.

From home, or, where the scene stands elsewhere already, from there (analysis.gap.light.knots).
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from analysis.gap.compared.state import State
from analysis.gap.light.knots import Knots
from analysis.gap.light.light_change import Change
from analysis.gap.light.radiance import Changes, Rendered, means
from analysis.gap.light.views import placed
from analysis.gap.sensor.filters import offsets
from analysis.gap.terms.base import Field
from analysis.gap.terms.mounts import ALL
from interchange.effects import MODELS, Effect
from interchange.effects.parts import has, members
from interchange.parameter import parameters
from interchange.problems import BrightfieldError

APART = 4.0  # steps, to which what else is in force about the target is rounded
LARGEST_SHARE = 0.25  # of a size or a gloss: no step is longer on a coarse grid either

Sizes = dict[
    tuple[str, str], dict[str, float]
]  # of an effect and what it is about: the step of each parameter


def rendered(
    knots: Knots,
    cause: str,
    target: str,
    parameter: str,
    step: float,
    *,
    together: bool = False,
    lamps: Collection[str] = (),
    material: str = "",
    among: Sequence[str] = (),
    sizes: Sizes,
    both_ways: bool = False,
    reflected: bool = False,
) -> Field:
    """DN a unit of an effect's parameter, about ``target``, told by a rendering with ``step`` more of it; where the
    scene stands ``FAR`` steps away, from there.

    ``together``: the step is taken of all targets at once, one rendering for all, and the part of it that is ``lamps``'
    or ``material``'s is the term's. ``among``: materials that it changes then; pixels of all others may show the edge
    of this one. ``sizes``: the steps of all parameters, which this one's is added to. ``both_ways``: by as much less of
    it, too, as what either way does alike is no part of a unit. ``reflected``: with what it changes of the light that
    other surfaces give.
    """
    start = float(getattr(MODELS[cause](), parameter))
    unit = parameters(MODELS[cause])[parameter].unit
    once, less = (
        ((MODELS[cause](**{parameter: start + x}), "" if together else target),)
        for x in (step, -step if both_ways else step)
    )
    sizes.setdefault((cause, target), {})[parameter] = abs(step)

    def bounced(s: State, drawn: Rendered, weights: dict[str, np.ndarray]) -> np.ndarray | float:
        own = next((e for e, t in s.scene if e.name() == cause and t == target), MODELS[cause]())
        parts = knots.reflected_step(drawn, own, target, parameter) if reflected else ()
        return in_dn(s, np.sum([w * there(s, x, weights) for w, x in parts], axis=0), 1.0) if parts else 0.0

    def field(s: State) -> np.ndarray | None:
        home = s.condition.shown
        weights = home.weights(s.condition.scene)
        if lamps:
            weights = {n: w for n, w in weights.items() if n in lamps}
        if not any(w.any() for w in weights.values()) or not has(home.scene, target):
            return None
        drawn = home.origin or home
        here = _about_lamps(s, sizes) if lamps else _about(s, target, sizes)
        if here:
            moved = ALL if lamps else target  # a lamp's light is its own: one rendering does for all of them
            further = step * home.coarse
            if unit == "1":
                further = float(np.clip(further, -LARGEST_SHARE, LARGEST_SHARE))
            try:
                more = _more(here, cause, moved, parameter, further)
                back = (
                    _more(here, cause, moved, parameter, -further) if step < 0 else here
                )  # inwards alone is half of it
                further_on, before = (there(s, knots.step(drawn, x), weights) for x in (more, back))
                direct = in_dn(s, further_on - before, 2 * further if step < 0 else further)
                return direct + bounced(s, drawn, weights)
            except BrightfieldError:  # at the end of what it may be: what it does at home has to do
                pass
        out = in_dn(s, there(s, knots.step(drawn, once), weights), step)
        if both_ways:
            out = 0.5 * (out - in_dn(s, there(s, knots.step(drawn, less), weights), step))
        if material:
            names = s.shown.scene.material_names
            others = [names.index(n) for n in among if n != material and n in names]
            out = out * ~np.isin(s.take(s.shown.passes["material_id"]), others)[..., None]
        return out + bounced(s, drawn, weights)

    return field


def _about(s: State, target: str, sizes: Sizes) -> Changes:
    """What is in force of the same object, lamp or material; to whole steps on the sensor's own grid, so that places
    near each other share their renderings, and to ``APART`` steps of what is more than the target or a part of it."""
    names = s.condition.shown.scene.object_names
    own = set(members(names, target)) if target else set()
    near = [
        (effect, t, 1.0 if t == target else APART)
        for effect, t in s.scene
        if t == target or own & set(members(names, t))
    ]
    return _on_grid(s, near, sizes)


def _about_lamps(s: State, sizes: Sizes) -> Changes:
    """What is in force of lamps, to whole steps as above."""
    names = [x.name for x in s.condition.shown.scene.lights]
    return _on_grid(s, [(effect, t, 1.0) for effect, t in s.scene if t == ALL or members(names, t)], sizes)


def _on_grid(s: State, changes: Sequence[tuple[Effect, str, float]], sizes: Sizes) -> Changes:
    found = []
    for effect, t, apart in changes:
        steps = sizes.get((effect.name(), t), {})
        on_grid = s.condition.shown.coarse == 1
        near = _rounded(effect, {n: apart * x for n, x in steps.items()}) if on_grid else effect
        if near.is_there:
            found.append((near, t))
    return tuple(found)


def _rounded(effect: Effect, steps: dict[str, float]) -> Effect:
    """To whole steps, no further than the effect's bounds."""
    none, about = type(effect)(), parameters(type(effect))
    values = {}
    for name, step in steps.items():
        start = getattr(none, name)
        value = start + step * round((getattr(effect, name) - start) / step)
        if not about[name].low <= value <= about[name].high:
            value = start + step * int((getattr(effect, name) - start) / step)
        values[name] = value
    return replace(effect, **values)  # type: ignore[type-var]


def _more(here: Changes, cause: str, target: str, parameter: str, step: float) -> Changes:
    """``here`` with ``step`` more of one parameter. Raises ParameterError where that is more than it may be."""
    own = next((e for e, t in here if e.name() == cause and t == target), None)
    before = own or MODELS[cause]()
    more = replace(before, **{parameter: getattr(before, parameter) + step})  # type: ignore[type-var]
    if own is None:
        return (*here, (more, target))
    return tuple((more if e is own else e, t) for e, t in here)


def there(s: State, change: Change, weights: dict[str, np.ndarray]) -> np.ndarray:
    """(h, w, 3): a change of radiance as the image is moved; the mean of it where a pixel stands for several."""
    home = s.condition.shown
    if home.origin is None:
        size, (column, row), aside = s.camera.sensor.resolution, s.source, offsets(s.camera)
        if aside is None:
            return change.at(weights, size, column, row)
        own = [
            change.at(weights, size, column + np.float32(u), row + np.float32(v))[..., k]
            for k, (u, v) in enumerate(aside)
        ]
        return np.stack(own, axis=-1)
    whole = change.radiance(weights, home.origin.camera.sensor.resolution)
    return s.take(placed(means(whole, home.coarse), s.flow))


def in_dn(s: State, radiance: np.ndarray, step: float) -> np.ndarray:
    return np.asarray(s.per_radiance * s.channels(radiance) / np.float32(step), np.float32)
