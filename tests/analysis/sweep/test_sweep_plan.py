"""A plan is read strictly: what it says, in the declared units, and everything that is wrong with it at once."""

from pathlib import Path

import numpy as np
import pytest

from analysis.sweep.laws import Choice, LogUniform, Normal, Uniform
from analysis.sweep.plan_file import read
from analysis.sweep.sampling import Method
from interchange.problems import FileError

EXAMPLES = Path(__file__).parents[3] / "docs/examples"


def plan(tmp_path, text, scene="station.usda"):
    file = tmp_path / "plan.yaml"
    file.write_text(f"scene: {EXAMPLES / scene}\n{text}", encoding="utf-8")
    return read(file)


def problems(tmp_path, text):
    with pytest.raises(FileError) as error:
        plan(tmp_path, text)
    return [str(p).split("plan.yaml: ", 1)[1] for p in error.value.problems]


def test_the_example_says_what_it_says():
    found = read(EXAMPLES / "sweep.yaml")
    axes = {a.address: a for a in found.axes}
    assert found.method is Method.SOBOL
    assert axes["Led0.intensity"].law == LogUniform(0.01, 0.1)
    assert axes["Camera.sensor.t_exp"].law == Uniform(8e-3, 16e-3)  # given in ms, declared in s
    assert axes["defects.scratch[0].depth"].law == Uniform(0.02, 0.2)  # µm, mm
    assert axes["defects.scratch[0].present"].nature == Choice((0.0, 1.0), (0.95, 0.05))
    assert axes["defects.scratch[0].angle"].law.high == pytest.approx(1000 * np.pi)  # degrees, mrad
    assert found.fixed["defects.scratch[0].width"] == 0.6
    assert [d.on for d in found.defects] == ["/World/Plate"] * 3 + ["/World/Plug"]
    assert found.objects == ("/World/Plate", "/World/Plug")
    assert [type(c).__name__ for c in found.constraints] == ["InView", "NotHidden"]


def test_numbers_may_be_fixed_listed_ranged_and_moving(tmp_path):
    found = plan(
        tmp_path,
        """
sampling: {method: latin_hypercube, count: 5}
times: [0, 5]
parameters:
  Led0.intensity: {value: 50, unit: mW/sr}
  steel.alpha_x: [0.1, 0.2]
  steel.alpha_y: {range: [1e-1, 3e-1], law: normal, mean: 0.2, sigma: 5e-2}
  Plug.pose.tx_mm: {samples: {0: -3, 10: 3}}
  Camera.own.tz_mm: {range: [-1, 1]}
""",
    )
    assert found.fixed == {"Led0.intensity": 0.05}
    assert [a.law for a in found.axes] == [
        Choice((0.1, 0.2), (0.5, 0.5)), Normal(0.2, 0.05, 0.1, 0.3), Uniform(-1, 1),
    ]  # fmt: skip
    assert [found.values_at(np.array([0.1, 0.2, 0.3]), t)["Plug.pose.tx_mm"] for t in (0, 5, 20)] == [
        -3,
        0,
        3,
    ]


def test_everything_that_is_wrong_is_told_at_once(tmp_path):
    told = problems(
        tmp_path,
        """
sampling: {method: sobel, count: 0}
renderer: {name: realtme, sample: 4}
cameras: Topp
objects: [Plat]
width: 3
colour: red
times: soon
write: [exr, voc]
noise: maybe
parameters:
  Led0.intensity: {range: [0.1, 2e12], unit: W/sr}
  Led1.intensity: {range: [0.1, 2]}
  Led2.intensity: {range: [2, 0.1], unit: mm, steps: 3}
  Led9.intensity: 3
  steel.alpha_x: {values: [0.1, yes], shares: [1, 2, 3]}
  steel.rougness: 2
  Camera.pose.tx: {low: 3, high: 4, unit: mm}
  Camera.pose.ty: {range: [1, 3], unit: mm, steps: 2, law: bell}
  Camera.pose.tz: {range: [-1, 3], unit: mm, steps: 2, law: log_uniform}
defects:
  - {kind: scrach, on: Plate}
  - {kind: scratch, on: Plat, depth: 3}
  - {kind: dent, on: Plate, deep: {value: 3, unit: mm}, depth: 3, toward: [0, 0, 0]}
constraints:
  - {kind: in_vew, of: Plate}
  - {kind: in_view, of: Plate, at_least: 3}
  - {kind: no_collision, of: Plate, with: Plg, clearance: 2}
""",
    )
    expected = [
        ("colour", "not known"),
        ("times", "must be time codes"),
        ("cameras", 'No camera is called "Topp"'),
        ("objects", 'Did you mean "Plate"'),
        ("renderer.sample", 'Did you mean "samples"'),
        ("renderer", 'Did you mean "realtime"'),
        ("sampling.method", 'Did you mean "sobol"'),
        ("sampling.count", "whole number in [1, 1e+07]; got 0"),
        ("constraints[0].kind", 'Did you mean "in_view"'),
        ("constraints[1]", "must lie in [0, 1]; got 3"),
        ("constraints[2].with", 'Did you mean "Plug"'),
        ("constraints[2]", "must say the unit of its clearance"),
        ("defects[0].kind", 'Did you mean "scratch"'),
        ("defects[1].on", 'Did you mean "Plate"'),
        ("defects[2].deep", 'Did you mean "depth"'),
        ("defects[2].toward", "must not be zero"),
        ("parameters.Led0.intensity.range[1]", "must lie in [0, 1e+09] W/sr; got 2e+12 W/sr"),
        ("parameters.Led1.intensity", "must say its unit, W/sr say"),
        ("parameters.Led2.intensity.unit", 'one of W/sr, mW/sr; got "mm"'),
        ("parameters.Led2.intensity.range", "lowest must lie below"),
        ("parameters.Led9.intensity", 'no camera, lamp, object or material "Led9"'),
        ("parameters.steel.alpha_x.values[1]", "must be a number; got 'yes'"),
        ("parameters.steel.alpha_x.shares", "a share of 0 or more for each of 2 values"),
        ("parameters.steel.rougness", 'no parameter "rougness"'),
        ("parameters.Camera.pose.tx", "must have one of value, values, range, samples"),
        ("parameters.Camera.pose.ty.law", 'one of uniform, log_uniform, normal; got "bell"'),
        ("parameters.Camera.pose.tz.law", "needs a range above 0"),
        ("write", 'got "voc"'),
        ("width", "number in [8, 65536]; got 3"),
        ("noise", "must be true or false; got 'maybe'"),
    ]
    missing = [e for e in expected if not any(t.startswith(e[0] + ":") and e[1] in t for t in told)]
    assert not missing, "\n".join(told)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("width: 30\nwidth: 40", 'the key "width" stands twice'),
        ("width: [30", "must be YAML"),
        ("parameters: {steel.alpha_x: {range: [0.1, 0.2]}}", "A range in a grid must say its steps"),
        (
            "sampling: sobol\nparameters: {steel.alpha_x: {range: [0.1, 0.2], steps: 4}}",
            "Steps belong to a grid",
        ),
        ("sampling: {method: grid, count: 3}", "as many samples as its axes give"),
        ("sampling: list\nparameters: {steel.alpha_x: [0.1, 0.2], steel.alpha_y: [0.1]}", "equally long"),
        ("parameters: {'defects.dent[0].depth': 3}", 'no defect "defects.dent[0]"'),
        (
            "parameters: {steel.alpha_x: {values: [0.1, 0.2], shares: [1, 0], nature: [1, 1]}}",
            "must be sampled",
        ),
        ("parameters: {led.intensity_mm: 3}", "no camera, lamp"),
        ("parameters: {Led0.intensity_mm: 3}", 'one of W/sr, mW/sr; got "mm"'),
        ("parameters: [1, 2]", "must be addresses"),
        ("defects: {kind: dent}", "must be a list"),
    ],
)
def test_one_clear_error_each(tmp_path, text, told):
    with pytest.raises(FileError) as error:
        plan(tmp_path, text)
    assert told in str(error.value)
    assert str(error.value).count("\n") == 0


def test_a_scene_that_cannot_be_read_is_told_with_the_rest(tmp_path):
    file = tmp_path / "plan.yaml"
    file.write_text("scene: nowhere.usda\nrenderer: blender\n", encoding="utf-8")
    with pytest.raises(FileError) as error:
        read(file)
    assert "nowhere.usda" in str(error.value)
    assert "renderer" in str(error.value)


def test_a_file_that_is_none_is_told(tmp_path):
    with pytest.raises(FileError, match="cannot be read"):
        read(tmp_path / "none.yaml")
    (tmp_path / "list.yaml").write_text("- 1\n")
    with pytest.raises(FileError, match="must be a YAML mapping"):
        read(tmp_path / "list.yaml")
