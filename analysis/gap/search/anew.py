"""What captures are rendered anew with once it is known where the image stands, and the conditions that have it.

A camera that moved by pixels uncovers what the rendering hides, and a first-order motion bends it; effects of the
scene change the light between surfaces; a lens images what lies beyond the frame. Each is kept beside what the scene
file says (``Rendered.moved``, ``Rendered.elsewhere``), and a model takes what is nearest to where it stands.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.margin import beyond, margin_for, widened
from analysis.gap.light.radiance import Changes, Key, Render, Rendered, render_all
from analysis.gap.light.redrawn import redrawn
from analysis.gap.search.model import Model
from analysis.gap.terms.base import Term
from analysis.gap.terms.geometry import stand
from interchange.effects.camera_pose import CameraPose

MOVED = 1.0  # px, from which on a camera that moved is rendered from where it stands
POSE = CameraPose.name()
Pose = dict[Key, float]  # its terms, of one stand


@dataclass(frozen=True)
class Anew:
    """``standing``: effects of the scene. ``poses`` {stand: its pose}: cameras that moved. ``beyond`` {camera: px}: how
    far outside the frame the image lies where it is furthest."""

    standing: Changes = ()
    poses: Mapping[str, Pose] = field(default_factory=dict)
    beyond: Mapping[str, float] = field(default_factory=dict)

    @property
    def is_there(self) -> bool:
        return bool(self.standing or self.poses or self.beyond)


def wanted(found: Sequence[Condition], terms: Sequence[Term], at: np.ndarray, standing: Changes) -> Anew:
    """What the conditions have to be rendered anew with where ``terms`` stand ``at`` (q,), beside ``standing``."""
    arrangements = list({id(c.shown): c for c in found}.values())
    own = np.array([t.cause == POSE for t in terms])
    moves = Model(tuple(terms), at, np.where(own, at, 0.0))
    poses: dict[str, Pose] = {}
    for c in arrangements:
        flow, name = moves.flow(c), stand(c)
        if flow is not None and np.linalg.norm(flow, axis=-1).max() > MOVED:
            poses[name] = {
                t.key: float(x) for t, x in zip(terms, at, strict=True) if t.candidate == (POSE, name)
            }
    gone = {key for pose in poses.values() for key in pose}
    rest = Model(tuple(terms), at, np.where([t.key in gone for t in terms], 0.0, at))
    outside: dict[str, float] = {}
    for c in arrangements:
        far = beyond(rest.flow(c))
        if margin_for(far, c.camera):
            outside[c.camera.name] = max(outside.get(c.camera.name, 0.0), far)
    return Anew(standing, poses, outside)


def rendered_anew(
    found: Sequence[Condition],
    written: Mapping[str, Rendered],
    anew: Anew,
    render: Render,
    settings: dict[str, Any],
    cache: Path,
    told: Callable[[float], None] = lambda share: None,
) -> list[Condition]:
    """Conditions with what is rendered anew beside what was ``written`` {name: what the scene file says}; those that
    share a rendering share the new ones. ``told(share)`` hears how much is done."""
    total = len({id(written[c.name]) for c in found})
    made: dict[int, Rendered] = {}
    out = []
    for c in found:
        base = written[c.name]
        if id(base) not in made:
            told(len(made) / total)
            new = _standing(base, anew.standing, render, settings, cache)
            pose = anew.poses.get(stand(c))
            if pose:
                moved = _standing(
                    seen_from(base, pose, render, settings, cache), anew.standing, render, settings, cache
                )
                new = replace(new, moved=moved)
            margin = margin_for(anew.beyond.get(c.camera.name, 0.0), c.camera)
            made[id(base)] = widened(new, margin, render, settings, cache)
        out.append(replace(c, rendered=made[id(base)]))
    return out


def seen_from(base: Rendered, pose: Pose, render: Render, settings: dict[str, Any], cache: Path) -> Rendered:
    """``base`` from where its camera stands with ``pose``. Kept in ``cache``."""
    effect = CameraPose(**{parameter: x for (_, _, parameter), x in pose.items()})
    there = effect.on_scene(replace(base.scene, cameras=(base.camera,)))
    (shown,) = render_all([(base.scene, there.cameras[0])], render, settings, cache)
    return replace(shown, pose=pose)


def _standing(
    base: Rendered, standing: Changes, render: Render, settings: dict[str, Any], cache: Path
) -> Rendered:
    if not standing:
        return base
    return replace(base, elsewhere=(redrawn(base, standing, render, settings, cache),))
