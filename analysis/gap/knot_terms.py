"""Terms of effects that must be rendered: size of lamps, gloss, anisotropy, size of objects, shadows.

Each is the difference of two renderings over the step between them (analysis.gap.knots), in DN as each condition's
lamps give it. Penumbrae wider than a pixel change with the width of the lamp, narrower ones with its square: the step
is such that they are wider.
"""

from collections.abc import Callable, Sequence

import numpy as np

from analysis.gap.conditions import Condition
from analysis.gap.knots import MANY, SPOTS, Change, Knots
from analysis.gap.radiance import Rendered
from analysis.gap.state import State
from analysis.gap.terms import NUISANCE, Field, Term
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lobes import has_lobes
from interchange.captures import Tolerances
from interchange.effects import Effect
from interchange.effects.anisotropy import Anisotropy
from interchange.effects.geometry import Geometry
from interchange.effects.gloss import Gloss
from interchange.effects.light_size import LightSize
from interchange.effects.parts import bounds
from interchange.effects.shadow import Shadow
from interchange.light import LightKind
from interchange.material import Material
from interchange.parameter import ParameterError
from interchange.scene import Scene

STANDS = 2.0  # times the tolerance of an object's place: how far it may stand off
LEAST_PIXELS = 200  # that a material or an object must cover, of an image of 480 x 360
MOST_OBJECTS = 6  # that have a size of their own: the largest in the image
GROUND = 0.35  # share of the image above which an object is what the others stand on
SIZE = 0.02  # growth of a lamp's half width, over its distance from the scene's middle
FLAT = 0.02  # thickness over length of what is printed on something, whose size is not its own
STEP = 0.1  # of gloss
OFFSET = 0.1  # mm, of the step that what stands off its ground is told by
RATIO, SPLIT = 0.2, 0.02  # of anisotropy
OUTLINE = 0.3  # px that the step of an object's size moves its outline by

Changed = Callable[[Rendered], Change]


def knot_terms(conditions: Sequence[Condition], tolerances: Tolerances, knots: Knots) -> list[Term]:
    """Rendered as their fields are asked for, once for each arrangement that the conditions show."""
    return [
        *_standing_off(tolerances, knots),
        *_lamps(conditions, tolerances, knots),
        *_materials(conditions, tolerances, knots),
        *_objects(conditions, tolerances, knots),
    ]


def _standing_off(t: Tolerances, knots: Knots) -> list[Term]:
    """How far what casts shadows stands off what it lies on: burrs, glue, paint, and the place where another renderer
    lets its rays begin. No cause: the tolerance of where shadows end."""
    field = difference(lambda shown: knots.standing_off(shown, 1e-3 * OFFSET, MANY), OFFSET)
    return [Term(NUISANCE, "", "standing off", "mm", STANDS * t.object_pose_mm, field)]


def _lamps(conditions: Sequence[Condition], t: Tolerances, knots: Knots) -> list[Term]:
    lights = {x.name: x for c in conditions for x in c.shown.scene.lights if x.kind is not LightKind.DOME}
    near = [n for n, x in lights.items() if x.kind is not LightKind.DISTANT]
    terms: list[Term] = []
    if near:
        middle = conditions[0].shown.scene.bounds.mean(axis=0)
        away = [np.linalg.norm(lights[n].world_from_light[:3, 3] - middle) for n in near]
        step = float(f"{1e3 * SIZE * np.median(away):.2g}")  # mm
        for name in ["", *near] if len(near) > 1 else near:
            field = difference(_of(knots, LightSize(step), spots=MANY), step, lamp=name)
            terms.append(Term("light_size", name, "spread", "mm", t.flat_field / 2, field,
                              relative=True, low=0.0))  # fmt: skip
    shading = [n for n, x in lights.items() if x.casts_shadows]
    for name in ["", *shading] if len(shading) > 1 else shading:
        field = difference(_of(knots, Shadow(1.0)), 1.0, lamp=name)
        terms.append(Term("shadow", name, "share", "1", t.flat_field / 2, field, relative=True, low=0.0))
    return terms


def _materials(conditions: Sequence[Condition], t: Tolerances, knots: Knots) -> list[Term]:
    materials = {b.material.name: b.material for c in conditions for b in c.shown.scene.bodies}
    seen = _counts(conditions, "material_id")
    terms: list[Term] = []
    shiny = [n for n, m in materials.items() if has_lobes(m.brdf)]
    for name in (n for n in shiny if seen.get(n, 0) >= LEAST_PIXELS):
        for parameter in ("width", "level"):
            step = _step(materials[name], parameter)
            alike = all(_step(materials[n], parameter) == step for n in shiny)  # one rendering does for all
            effect = Gloss(**{parameter: 1 + step})
            field = difference(_of(knots, effect, "" if alike else name), step, material=name, among=shiny)
            terms.append(Term("gloss", name, parameter, "1", t.gloss, field, start=1.0))
        field = difference(_of(knots, Anisotropy(1 + RATIO)), RATIO, material=name, among=shiny)
        terms.append(Term("anisotropy", name, "ratio", "1", t.gloss, field, start=1.0))
        if isinstance(materials[name].brdf, Lafortune):
            field = difference(_of(knots, Anisotropy(split=SPLIT)), SPLIT, material=name, among=shiny)
            terms.append(Term("anisotropy", name, "split", "1", t.gloss / 2, field))
    return terms


def _step(material: Material, parameter: str) -> float:
    """As far as the model's bounds allow, up or else down."""
    from interchange.effects.shine import shone

    for step in (STEP, -STEP):
        width, level = (1 + step, 1.0) if parameter == "width" else (1.0, 1 + step)
        try:
            shone(material, width, width, level)
        except ParameterError:
            continue
        return step
    return STEP


def _objects(conditions: Sequence[Condition], t: Tolerances, knots: Knots) -> list[Term]:
    pixels = min(c.mean.shape[0] * c.mean.shape[1] for c in conditions)
    seen = {n: k for n, k in _counts(conditions, "object_id").items() if k >= LEAST_PIXELS}
    boxes = {
        n: np.ptp(bounds(c.shown.scene, n), axis=0) for c in conditions for n in c.shown.scene.object_names
    }
    solid = [n for n in seen if boxes[n].min() > FLAT * boxes[n].max() and seen[n] < GROUND * 480 * 360]
    chosen = sorted(solid, key=lambda n: -seen[n])
    terms: list[Term] = []
    for name in chosen[:MOST_OBJECTS]:
        half_px = np.sqrt(seen[name] * pixels / (480 * 360)) / 2
        step = float(f"{min(OUTLINE / half_px, 0.1):.2g}")
        half_mm = 1e3 * float(boxes[name].max()) / 2
        for parameter in ("scale", "height"):
            field = difference(_of(knots, Geometry(**{parameter: 1 + step}), name), step, name)
            terms.append(Term("geometry", name, parameter, "1", t.object_pose_mm / half_mm, field, start=1.0))
    return terms


def _counts(conditions: Sequence[Condition], of: str) -> dict[str, float]:
    """The most pixels that each has in a condition, in an image of 480 x 360."""
    found: dict[str, float] = {}
    for condition in conditions:
        ids, scene = condition.shown.passes[of], condition.shown.scene
        names = scene.material_names if of == "material_id" else scene.object_names
        for k, n in zip(*np.unique(ids[ids >= 0], return_counts=True), strict=True):
            found[names[k]] = max(found.get(names[k], 0.0), n * 480 * 360 / ids.size)
    return found


def _of(knots: Knots, effect: Effect, target: str = "", spots: int = SPOTS) -> Changed:
    return lambda shown: knots.change(shown, effect, target, spots)


def difference(
    changed: Changed,
    step: float,
    target: str = "",
    lamp: str = "",
    material: str = "",
    among: Sequence[str] = (),
) -> Field:
    """DN a unit of the term, where ``changed`` is what ``step`` of it does to a rendering. ``target``: the object it is
    about; ``lamp``, ``material``: the part of the change that is theirs; "" is all of it.

    ``among``: materials that the effect changes; the pixels of all others show the edge of one that it does.
    """

    def field(s: State) -> np.ndarray | None:
        weights = s.shown.weights(s.condition.scene)
        if lamp:
            weights = {n: w for n, w in weights.items() if n == lamp}
        if not any(w.any() for w in weights.values()) or not _there(s.shown.scene, target, material):
            return None
        radiance = changed(s.shown).radiance(weights, s.camera.sensor.resolution)
        out = s.per_radiance * s.channels(s.take(radiance)) / np.float32(step)
        if material:
            names = s.shown.scene.material_names
            others = [names.index(n) for n in among if n != material and n in names]
            out = out * ~np.isin(s.take(s.shown.passes["material_id"]), others)[..., None]
        return np.asarray(out, np.float32)

    return field


def _there(scene: Scene, target: str, material: str) -> bool:
    known = {"", *scene.object_names, *scene.material_names}
    return target in known and material in known
