"""A motion whose speed changes while the shutter is open, told by the term that follows it on the finer grid."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.corrected.scene import Change, changed
from analysis.gap.light.radiance import Rendered
from analysis.gap.terms.base import Term
from analysis.gap.terms.chain import VIBRATION, chain_terms, effects_at
from analysis.gap.terms.subpixel import PRODUCT, UNEVENLY
from interchange.camera import Camera, Sensor
from interchange.captures import Tolerances
from interchange.effects.motion_blur import MotionBlur
from interchange.scene import Scene
from tests.analysis.gap.test_gap_moved import seen_by_a_sensor, shown

EDGES = np.arange(12.0, 13.0, 0.1)  # px: anywhere in a pixel
FINE_EDGES = tuple(seen_by_a_sensor(shown(edge)) for edge in EDGES)


def motion(condition: Condition) -> list[Term]:
    return [t for t in chain_terms(State(condition), Tolerances()) if t.cause == "motion_blur"]


def followed(truth: MotionBlur) -> MotionBlur:
    """By Gauss and Newton over edges anywhere in a pixel, without noise."""
    own = [t for t in motion(FINE_EDGES[0]) if t.parameter in ("u", UNEVENLY)]
    at = {t.key: 1.0 if t.parameter == "u" else 0.0 for t in own}
    for _ in range(12):
        rows, rest = [], []
        for c in FINE_EDGES:
            stands = State(c, effects_at(own, at, State(c)))
            rows.append(np.stack([np.asarray(t.field(stands))[4].ravel() for t in own]))
            rest.append((State(c).dn([truth]) - stands.simulation.dn)[4].ravel())
        step, *_ = np.linalg.lstsq(np.concatenate(rows, axis=1).T, np.concatenate(rest), rcond=None)
        at = {t.key: max(at[t.key] + float(x), t.low) for t, x in zip(own, step, strict=True)}
    (found,) = effects_at(own, at, State(FINE_EDGES[0]))
    assert isinstance(found, MotionBlur)
    return found


@pytest.mark.parametrize(
    "acceleration", [-2.5, 3.0, *(pytest.param(x, marks=pytest.mark.slow) for x in (0.0, 1.0))]
)
def test_a_motion_is_told_with_how_its_speed_changes(acceleration: float) -> None:
    """1.5 px: the same model without noise, so what is left is where Gauss and Newton stop."""
    found = followed(MotionBlur(u=1.5, acceleration=acceleration))
    assert found.u == pytest.approx(1.5, rel=0.01)
    assert found.acceleration == pytest.approx(acceleration, abs=0.05)


def test_where_there_is_no_path_its_speed_is_not_to_be_seen() -> None:
    here = FINE_EDGES[4]
    terms = {t.parameter: t for t in motion(here)}
    assert list(terms) == ["u", "v", PRODUCT, UNEVENLY]
    assert terms[UNEVENLY].field(State(here)) is None
    change = np.asarray(terms[UNEVENLY].field(State(here, [MotionBlur(u=1.5)])))
    assert np.abs(change).max() > 1


def test_without_a_finer_grid_no_path_is_run_through_unevenly() -> None:
    """There a path's shape within a pixel is not to be seen."""
    coarse: Rendered = replace(FINE_EDGES[0].shown, fine={})
    assert UNEVENLY not in {t.parameter for t in motion(replace(FINE_EDGES[0], rendered=coarse))}


def test_a_corrected_scene_has_what_was_found_beside_its_own() -> None:
    own = Camera("c", sensor=Sensor(image_path=(0.5, 0.0), image_acceleration=0.5))
    scene = replace(Scene(), cameras=(own,))
    values = {"u": 1.2, "v": 0.0, UNEVENLY: 2.0}, {"u": 0.5, "v": 0.0, UNEVENLY: 0.5}
    (camera,) = changed(scene, scene, Change("motion_blur", VIBRATION, *values)).cameras
    assert camera.sensor.image_acceleration == pytest.approx(2.0)
    assert camera.sensor.image_path[0] == pytest.approx(1.2)
