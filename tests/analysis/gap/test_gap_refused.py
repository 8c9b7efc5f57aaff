"""Captures that the scene does not show, or not enough of it: told, or refused with one clear error."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition, conditions
from analysis.gap.light.radiance import Rendered
from analysis.gap.processed.overlap import must_overlap, notes_on_files, shifts, with_files_bits
from interchange.formats import captures as captures_file
from interchange.formats import images
from interchange.problems import BrightfieldError, FileError
from interchange.sensor import Response
from tests.analysis.gap.bench import HEIGHT, TIMES, WIDTH, Rig


def _of(rig: Rig) -> list[Rendered]:
    """One rendering a condition: times 6 and 7 are repeats."""
    return [r for time, r in zip(TIMES, rig.truth, strict=True) if time != 7]


def _found(rig: Rig) -> list[Condition]:
    found = conditions(rig.captured("null", ()), rig.document)
    return [replace(c, rendered=r) for c, r in zip(found, _of(rig), strict=True)]


def test_captures_that_do_not_fit_the_scene_are_told_together(rig: Rig) -> None:
    rig.captured("null", ())
    path = rig.folder / "wrong.json"
    images.write(rig.folder / "small.png", np.zeros((5, 5, 3), np.uint16))
    images.write(rig.folder / "bright.png", np.full((HEIGHT, WIDTH, 3), 60000, np.uint16))
    entry = {"time": 0, "exposure": 1}
    entries = [
        {**entry, "image": "small.png", "camera": "/World/Camera0"},
        {**entry, "image": "bright.png", "camera": "/World/Camera0"},
        {**entry, "image": "null/00.png", "camera": "/World/Camra0"},
    ]
    path.write_text(json.dumps({"scene": "scene.usda", "captures": entries}))
    with pytest.raises(FileError) as error:
        conditions(captures_file.read(path), rig.document)
    said = str(error.value).splitlines()
    assert len(said) == 3
    assert "captures[0].image" in said[0]
    assert "112 x 84 px" in said[0]
    assert "4095" in said[1]
    assert 'Did you mean "/World/Camera0"' in said[2]


def test_a_camera_that_looks_elsewhere_is_named(rig: Rig) -> None:
    """Half an image further down stands for a grossly wrong pose; the other camera's captures are right."""
    found = _found(rig)
    must_overlap(found)
    turned = [
        replace(c, mean=np.roll(c.mean, HEIGHT // 2, axis=0)) if c.camera.name == "/World/Camera1" else c
        for c in found
    ]
    with pytest.raises(BrightfieldError, match=r"those of /World/Camera1 \(correlation"):
        must_overlap(turned)


def test_captures_that_lie_off_are_told(rig: Rig) -> None:
    found = _found(rig)
    assert shifts(found) == {}
    rolled = [replace(c, mean=np.roll(c.mean, (4, 3), (0, 1))) for c in found]
    assert shifts(rolled) == {
        name: pytest.approx(5, abs=0.3) for name in ("/World/Camera0", "/World/Camera1")
    }


def test_8_bit_images_are_compared_in_their_own_steps(rig: Rig) -> None:
    """The sensor's 4095 DN in 255: what differs is temporal noise and the rounding, 1/12 of a step squared."""
    captures = rig.captured("null", ())
    eight = tuple(replace(c, pixels=np.rint(c.pixels * 255 / 4095), bits=8) for c in captures.captures)
    found = with_files_bits(conditions(replace(captures, captures=eight), rig.document))
    found = [replace(c, rendered=r) for c, r in zip(found, _of(rig), strict=True)]
    for c in (c for c in found if c.lamps):
        model = c.simulated()
        assert model.top == 255
        ok = c.usable(model)[..., None] & (model.dn > 20)  # in the dark all values round alike
        z = (c.captures[0].pixels - model.dn)[ok] / np.sqrt(model.temporal[ok])
        assert np.sqrt(np.mean(z**2)) == pytest.approx(1, abs=0.1)
    first, second = notes_on_files(found)
    assert "a step is 16.1 DN" in first
    assert "processed" in second
    assert notes_on_files(_found(rig)) == []


def test_a_curves_steps_are_told_of_the_dark_and_of_the_bright(rig: Rig) -> None:
    """sRGB's slope is 12.92 at 0 and 1.055 / 2.4 at 1: steps of 1 / 255 are (2^12 - 1 - black) / 255 over that."""
    captures = rig.captured("null", ())
    eight = replace(captures.captures[0], bits=8)
    (c, *_) = conditions(replace(captures, captures=(eight, *captures.captures[1:])), rig.document)
    sensor = replace(c.camera.sensor, response=Response.SRGB, output_bit_depth=8, black_level=0.0)
    (words,) = notes_on_files([replace(c, camera=replace(c.camera, sensor=sensor))])
    told = [float(x) for x in re.findall(r"([0-9.]+) DN", words)]
    assert told == pytest.approx([4095 / 255 / 12.92, 4095 / 255 * 2.4 / 1.055], rel=0.02)


def test_captures_of_something_else_are_refused(rig: Rig) -> None:
    captures = rig.captured("null", ())
    rng = np.random.default_rng(0)
    other = tuple(
        replace(c, pixels=rng.permuted(c.pixels.reshape(-1)).reshape(c.pixels.shape))
        for c in captures.captures
    )
    with pytest.raises(BrightfieldError, match="must show what the scene shows"):
        rig.diagnosed(replace(captures, captures=other), "other")


def test_two_conditions_are_too_few(rig: Rig) -> None:
    captures = rig.captured("null", ())
    with pytest.raises(BrightfieldError, match="three different conditions"):
        conditions(replace(captures, captures=captures.captures[:2]), rig.document)
