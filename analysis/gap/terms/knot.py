"""Terms of effects that must be rendered: of lamps, gloss, anisotropy, place and size of objects, shadows.

Each is the difference of two renderings over the step between them (analysis.gap.light.knots), in DN as each
condition's lamps give it; where the scene stands elsewhere already, from there. Penumbrae wider than a pixel change
with the width of the lamp, narrower ones with its square: the step is such that they are wider.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.light.knots import Knots
from analysis.gap.terms.base import NUISANCE, Term
from analysis.gap.terms.geometry import FLAT, moved_objects, outlines
from analysis.gap.terms.left import EDGED, SHADOWED
from analysis.gap.terms.mounts import MOUNT, lamps_of, on_one_mount
from analysis.gap.terms.roundness import is_round
from analysis.gap.terms.stepped import Sizes, in_dn, rendered, there
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lobes import has_lobes, is_isotropic
from interchange.camera import Projection
from interchange.captures import Tolerances
from interchange.effects import MODELS
from interchange.effects.parts import SEVERAL, bounds, members
from interchange.frames import apply
from interchange.light import LightKind
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.parameter import ParameterError

STANDS = 2.0  # times the tolerance of an object's place: how far it may stand off
LEAST_PIXELS = 200  # that a material or an object must cover, of an image of 480 x 360
MOST_TRACED = 4  # materials whose lobes are looked at by way of other surfaces, too: those of most pixels
MOST_OBJECTS = 6  # that are moved and resized by renderings: the largest in the image
TILTS = ("rx", "ry")  # as where a chip lies under it
MOST_GROUPS = 2  # of objects that are one
GROUND = 0.35  # share of the image above which an object is what the others stand on
SIZE = 0.02  # growth of a lamp's half width, over its distance from the scene's middle
STEPS = {"width": 0.1, "level": 0.1, "ratio": 0.2, "diagonal": 0.2, "split": 0.02, "cross": 0.02}
STANDS_AT = 0.25  # steps of anisotropy: what a grain does that runs aslant is told where it runs
OFFSET = 0.1  # mm, of the step that what stands off its ground is told by
MOVED = 2.0  # mm, of the step that a lamp's place is told by
OUTLINE = 0.3  # px that the step of an object's place or size moves its outline by
LINEAR = 0.1  # px that an outline moves by before it is drawn anew


def knot_terms(conditions: Sequence[Condition], tolerances: Tolerances, knots: Knots) -> list[Term]:
    """Rendered as their fields are asked for, once for each arrangement that the conditions show."""
    sizes: Sizes = {}
    return [
        _standing_off(tolerances, knots),
        *_lamps(conditions, tolerances, knots, sizes),
        *_materials(conditions, tolerances, knots, sizes),
        *_objects(conditions, tolerances, knots, sizes),
    ]


def _standing_off(t: Tolerances, knots: Knots) -> Term:
    """How far what casts shadows stands off what it lies on: burrs, glue, paint, and the place where another renderer
    lets its rays begin. No cause: the tolerance of where shadows end."""

    def field(s: State) -> np.ndarray | None:
        weights = s.shown.weights(s.condition.scene)
        if not any(w.any() for w in weights.values()):
            return None
        return in_dn(s, there(s, knots.standing_off(s.condition.shown, 1e-3 * OFFSET), weights), OFFSET)

    return Term(NUISANCE, "", "standing off", "mm", STANDS * t.object_pose_mm, field)


def _lamps(conditions: Sequence[Condition], t: Tolerances, knots: Knots, sizes: Sizes) -> list[Term]:
    lights = {x.name: x for c in conditions for x in c.shown.scene.lights if x.kind is not LightKind.DOME}
    near = [n for n, x in lights.items() if x.kind is not LightKind.DISTANT]
    terms: list[Term] = []
    for name in [*near, *on_one_mount(near)]:
        several = name not in near
        for axis in "xyz":
            field = rendered(
                knots,
                "light_position",
                name,
                axis,
                MOVED,
                lamps=lamps_of(near, name),
                together=True,
                sizes=sizes,
            )
            spike = t.light_position_mm * (MOUNT if several else 1.0)
            terms.append(Term("light_position", name, axis, "mm", spike, field,
                              kind="scene", step=MOVED, form=several))  # fmt: skip
    if near:
        middle = conditions[0].shown.scene.bounds.mean(axis=0)
        away = [np.linalg.norm(lights[n].world_from_light[:3, 3] - middle) for n in near]
        step = float(f"{1e3 * SIZE * np.median(away):.2g}")  # mm
        for name in ["", *near] if len(near) > 1 else near:
            field = rendered(
                knots,
                "light_size",
                name,
                "spread",
                step,
                lamps=lamps_of(near, name),
                together=True,
                sizes=sizes,
            )
            terms.append(Term("light_size", name, "spread", "mm", EDGED * t.flat_field, field,
                              relative=True, low=0.0, kind="scene", step=step))  # fmt: skip
    shading = [n for n, x in lights.items() if x.casts_shadows]
    several = len(shading) > 1
    for name in ["", *shading] if several else shading:
        field = rendered(
            knots, "shadow", name, "share", 1.0, lamps=lamps_of(shading, name), together=True, sizes=sizes
        )
        spike = (SHADOWED if several and name else EDGED) * t.flat_field
        terms.append(Term("shadow", name, "share", "1", spike, field, relative=True, low=0.0))
    return terms


def _materials(conditions: Sequence[Condition], t: Tolerances, knots: Knots, sizes: Sizes) -> list[Term]:
    materials = {b.material.name: b.material for c in conditions for b in c.shown.scene.bodies}
    seen = covered(conditions, "material_id")
    terms: list[Term] = []
    shiny = [n for n, m in materials.items() if has_lobes(m.brdf)]
    traced = sorted(shiny, key=lambda n: -seen.get(n, 0.0))[:MOST_TRACED]

    def term(cause: str, name: str, parameter: str, step: float, spike: float, together: bool) -> Term:
        field = rendered(
            knots, cause, name, parameter, step, together=together, material=name, among=shiny, sizes=sizes,
            both_ways=parameter in ("diagonal", "cross"), reflected=name in traced,
        )  # fmt: skip
        start = float(getattr(MODELS[cause](), parameter))
        return Term(cause, name, parameter, "1", spike, field, start=start, kind="scene", step=abs(step))

    for name in (n for n in shiny if seen.get(n, 0) >= LEAST_PIXELS):
        for parameter in ("width", "level"):
            step = _step(materials[name], parameter)
            alike = all(_step(materials[n], parameter) == step for n in shiny)  # one rendering does for all
            terms.append(term("gloss", name, parameter, step, t.gloss, alike))
        # a grain runs along the tangent or any other way: both of its parts, where nothing else turns with it
        turns = materials[name].normal_map is None and is_isotropic(materials[name].brdf)
        ways = ("split", "cross") if isinstance(materials[name].brdf, Lafortune) else ("ratio", "diagonal")
        for way in ways if turns else ways[:1]:  # no tolerance speaks of it
            told = term("anisotropy", name, way, STEPS[way], EDGED * t.flat_field / np.sqrt(2), True)
            terms.append(replace(told, relative=True, stands_at=STANDS_AT))
    return terms


def _step(material: Material, parameter: str) -> float:
    """As far as the model's bounds allow, up or else down."""
    from interchange.effects.shine import shone

    for step in (STEPS[parameter], -STEPS[parameter]):
        width, level = (1 + step, 1.0) if parameter == "width" else (1.0, 1 + step)
        try:
            shone(material, width, width, level)
        except ParameterError:
            continue
        return step
    return STEPS[parameter]


def _objects(conditions: Sequence[Condition], t: Tolerances, knots: Knots, sizes: Sizes) -> list[Term]:
    terms: list[Term] = []

    def term(
        cause: str, name: str, parameter: str, unit: str, spike: float, moves: float, mm_a_px: float
    ) -> Term:
        """``moves``: mm that a unit moves most of the outline by. What lies on an object would vanish in it if that
        rose or grew: steps go downwards and inwards."""
        step = float(f"{OUTLINE * mm_a_px / moves:.2g}")
        inwards = parameter in ("z", "scale", "height")
        field = rendered(knots, cause, name, parameter, -step if inwards else step, sizes=sizes)
        start = float(getattr(MODELS[cause](), parameter))
        linear = step * LINEAR / OUTLINE
        return Term(cause, name, parameter, unit, spike, field, start=start, kind="scene", step=linear)

    outlined = outlines(conditions)
    chosen = standing(conditions)
    spike = t.object_pose_mm
    for name in [*chosen, *together(conditions)]:
        px = _mm_a_px(conditions, name)
        size = 1e3 * np.ptp(_box(conditions, name), axis=0)
        if any(n in outlined for n in members(list(outlined), name)):
            terms += [term("object_pose", name, axis, "mm", spike, 1.0, px) for axis in "xyz"]
            mesh = _mesh(conditions, name)
            reach = float(np.hypot(*size[:2])) / 2
            turning = ("mrad", 1e3 * spike / reach, 1e-3 * reach / 2, px)
            if mesh is None or not is_round(mesh):
                terms.append(term("object_pose", name, "rz", *turning))
            terms += [term("object_pose", name, way, *turning) for way in TILTS]
        if name in chosen:
            half, top = float(size.max()) / 2, float(size[2]) / 2  # px of it, as most cameras look down
            for parameter, moves in (("scale", half), ("height", top)):
                terms.append(term("geometry", name, parameter, "1", spike / half, moves, px))
    return [*terms, *moved_objects(conditions, t, besides=chosen)]


def together(conditions: Sequence[Condition]) -> list[str]:
    """Targets of several objects that are one workpiece: those under one prim, and those that move alike from one
    condition to another; the largest first."""
    scenes = list({id(c.shown.scene): c.shown.scene for c in conditions}.values())
    names = list(dict.fromkeys(n for s in scenes for n in s.object_names))
    found: dict[frozenset[str], str] = {}
    parents = {n[:k] for n in names for k, letter in enumerate(n) if letter == "/" and k}
    for parent in sorted(parents, key=len):
        found.setdefault(frozenset(members(names, parent)), parent)
    places = [{b.name: b.world_from_body for b in s.bodies} for s in scenes]
    ways: dict[bytes, list[str]] = {}
    for name in (n for n in names if all(n in p for p in places)):
        way = np.stack([p[name] @ np.linalg.inv(places[0][name]) for p in places]).round(6)
        if np.abs(way - np.eye(4)).max() > 0:
            ways.setdefault((way + 0.0).tobytes(), []).append(name)
    for alike in ways.values():
        found.setdefault(frozenset(alike), SEVERAL.join(alike))
    seen = covered(conditions, "object_id")
    pixels = {target: sum(seen.get(n, 0.0) for n in group) for group, target in found.items()}
    several = [target for group, target in found.items() if 1 < len(group) < len(names)]
    return sorted((x for x in several if pixels[x] >= LEAST_PIXELS), key=lambda x: -pixels[x])[:MOST_GROUPS]


def _box(conditions: Sequence[Condition], target: str) -> np.ndarray:
    return next(
        bounds(c.shown.scene, target)
        for c in conditions
        if all(members(c.shown.scene.object_names, one) for one in target.split(SEVERAL))
    )


def _mesh(conditions: Sequence[Condition], target: str) -> Mesh | None:
    """In the world; None of several bodies, and of one whose material has a picture, which shows a turn."""
    scene = next(c.shown.scene for c in conditions if members(c.shown.scene.object_names, target))
    bodies = [b for b in scene.bodies if b.name in members(scene.object_names, target)]
    if SEVERAL in target or len(bodies) != 1 or bodies[0].material.maps:
        return None
    mesh = bodies[0].mesh
    return replace(mesh, vertices=apply(bodies[0].world_from_body, mesh.vertices))


def standing(conditions: Sequence[Condition]) -> list[str]:
    """Objects that have a thickness and do not fill the image, the largest first."""
    seen = {n: k for n, k in covered(conditions, "object_id").items() if k >= LEAST_PIXELS}
    boxes = {
        n: np.ptp(bounds(c.shown.scene, n), axis=0) for c in conditions for n in c.shown.scene.object_names
    }
    solid = [n for n in seen if boxes[n].min() > FLAT * boxes[n].max() and seen[n] < GROUND * 480 * 360]
    return sorted(solid, key=lambda n: -seen[n])[:MOST_OBJECTS]


def _mm_a_px(conditions: Sequence[Condition], name: str) -> float:
    """Of the image that shows the object largest, so that no step moves it by more than is meant there."""
    found = []
    for c in conditions:
        names = c.shown.scene.object_names
        own = np.isin(c.shown.passes["object_id"], [names.index(n) for n in members(names, name)])
        if own.any():
            perspective = c.camera.lens.projection is Projection.PERSPECTIVE
            far = float(np.median(c.shown.passes["depth"][own])) if perspective else 1.0
            found.append(1e3 * far / c.camera.K[0, 0])
    return min(found)


def covered(conditions: Sequence[Condition], of: str) -> dict[str, float]:
    """The most pixels that each has in a condition, in an image of 480 x 360, of those that the pass ``of`` shows."""
    found: dict[str, float] = {}
    for shown in {id(c.shown): c.shown for c in conditions}.values():
        for name, n in shown.pixels_of[of].items():
            found[name] = max(found.get(name, 0.0), n * 480 * 360 / shown.passes[of].size)
    return found
