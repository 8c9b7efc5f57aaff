"""The scene of a sample: numbers set, then defects put in, one after the other."""

from collections.abc import Mapping, Sequence

from analysis.sweep.choices import with_values
from analysis.sweep.defect import Placed
from analysis.sweep.defects import MODELS
from analysis.sweep.plan import PlannedDefect
from interchange.scene import Scene

PREFIX = "defects."


def scene_of(
    base: Scene, values: Mapping[str, float | str], defects: Sequence[PlannedDefect]
) -> tuple[Scene, list[tuple[PlannedDefect, Placed]]]:
    """The scene, and the defects that are there. ``values`` by address, in the declared units. Raises
    BrightfieldError; OffSurface where there is no room for a defect."""
    scene = with_values(base, {a: x for a, x in values.items() if not a.startswith(PREFIX)})
    found = []
    for defect in defects:
        start = defect.name + "."
        given = {a.removeprefix(start): float(x) for a, x in values.items() if a.startswith(start)}
        model = MODELS[defect.kind](**given)
        if model.present < 0.5:
            continue
        placed = model.on(scene, defect.on, defect.anchor, defect.label)
        scene = placed.scene
        found.append((defect, placed))
    return scene, found
