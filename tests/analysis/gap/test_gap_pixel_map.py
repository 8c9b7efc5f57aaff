"""Pixels' own gains, from two lamps' captures of a stripe plane, in those of a third; 160 x 120 px, no renderer."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.judgement.attribution import PATTERN, attribution
from analysis.gap.measures.shrinkage import yardstick
from analysis.gap.noise.fixed_pattern import flat
from analysis.gap.noise.pixel_map import AROUND, PixelMaps, pixel_maps
from analysis.gap.sensor.expected import Noise, noise_variance
from interchange.effects.fixed_pattern import FixedPattern
from tests.analysis.gap.test_gap_noise import SHEET, _rig

PRNU = 0.02


def held_out(prnu: float, told: float) -> tuple[list[Condition], list[np.ndarray], PixelMaps]:
    """The last condition held out; its pixels' gains spread by ``prnu``, and said to by ``told``."""
    found, said = _rig(4, (FixedPattern(prnu, 1.0, "own"),), repeats=4)
    noise = Noise(1.0, SHEET.read_noise, told, 1.0)
    found = [replace(c, noise=noise, held_out=k == 2) for k, c in enumerate(found)]
    return found, said, pixel_maps(found, said)


def test_the_map_takes_off_what_two_conditions_can_tell() -> None:
    """The error variance that is left of a pixel's gain is 1 / (1/PRNU² + Σ s²/σ²) and that of the mean around it, 1/49
    of PRNU². 10 % of what is left: pixels near edges have fewer around them, and the offset is left out."""
    found, said, maps = held_out(PRNU, PRNU)
    c, dn = found[2], said[2]
    s, seen = flat(c, dn)
    ok = seen > 0
    precision = np.full(dn.shape, PRNU**-2)
    for other, its in zip(found[:2], said[:2], strict=True):
        own, also = flat(other, its)
        ok &= also > 0
        precision += own**2 / noise_variance(its, c.camera)[0] * 4
    error = (c.mean - maps.applied([c], [dn])[0])[ok]
    noise = noise_variance(dn, c.camera)[0][ok] / 4
    left = float((s[ok] ** 2 * (1 / precision[ok] + PRNU**2 / AROUND**2)).mean())
    assert float((error**2).mean() - noise.mean()) == pytest.approx(left, rel=0.1)
    whole = float(((c.mean - dn)[ok] ** 2).mean() - noise.mean())
    assert whole == pytest.approx(PRNU**2 * float((s[ok] ** 2).mean()), rel=0.03)
    assert left < 0.25 * whole


def test_no_pattern_leaves_a_map_of_next_to_nothing() -> None:
    found, said, maps = held_out(0.0, 1e-4)
    gain, _ = maps.of["/Top"]
    assert gain.std() < 2e-5
    assert maps.applied(found[2:], said[2:])[0] == pytest.approx(said[2], rel=1e-3)


def test_held_out_captures_do_not_make_their_own_map() -> None:
    found, said, maps = held_out(PRNU, PRNU)
    other = replace(found[2], mean=found[2].mean * 1.1)
    again = pixel_maps([*found[:2], other], said)
    assert all((a == b).all() for a, b in zip(maps.of["/Top"], again.of["/Top"], strict=True))


def test_a_camera_without_a_map_stays() -> None:
    found, said = _rig(1)
    assert PixelMaps({}).applied(found, said)[0] == pytest.approx(said[0])


def test_what_the_map_takes_off_is_the_patterns_share() -> None:
    found, said, maps = held_out(PRNU, PRNU)
    held, before = found[2:], said[2:]
    by = yardstick(held, before, 1.0)
    nothing = cast(Any, SimpleNamespace(best=SimpleNamespace(causes=()), terms=(), probability={}))
    taken = attribution(nothing, held, by, before, before, maps, lambda what, share: None)
    assert taken.players == {}
    off = by.chi2(before) - by.chi2(maps.applied(held, before))
    assert taken.share == pytest.approx({PATTERN: off})
    assert off > 0.5 * (by.chi2(before) - 1)
    assert taken.lacking(PATTERN) == by.chi2(before)
