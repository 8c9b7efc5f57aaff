"""What is chosen by name: materials, shapes, profiles as axes, to the manifest, the renders and the tuning."""

from pathlib import Path

import numpy as np
import pandas
import pytest

from analysis.sweep.choices import with_values
from analysis.sweep.datasets import write_datasets
from analysis.sweep.design import design, kept_design
from analysis.sweep.job import read_record, work
from analysis.sweep.plan_file import read
from analysis.sweep.run import jobs_of
from analysis.tune.features import parse
from analysis.tune.reading import read_sweep
from composer.contact_sheet import write_contact_sheet
from interchange.formats import exr, parquet
from interchange.formats.document import open_scene
from interchange.problems import FileError
from offline.batch import Report
from realtime.renderers.rasterizer import Rasterizer

ROOT = Path(__file__).parents[3]
STATION = (ROOT / "docs/examples/station.usda").read_text(encoding="utf-8")
BRASS = """        def Material "{name}"
        {{
            token outputs:brdf:surface.connect = <{path}/Brdf.outputs:surface>

            def Shader "Brdf"
            {{
                uniform token info:id = "Lambert"
                color3f inputs:diffuse = ({rho}, {rho}, {rho})
                token outputs:surface
            }}
        }}
"""
SIDES = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
# a cube of 10 mm, its lowest corner at its origin; such files have no unit
CUBE = "\n".join(
    [f"v {x} {y} {z}" for x in (0, 10) for y in (0, 10) for z in (0, 10)]
    + [f"f {' '.join(map(str, side))}" for side in SIDES]
)


@pytest.fixture(scope="module")
def stand(tmp_path_factory):
    """The example's scene with a material that nothing is bound to, and files beside it."""
    folder = tmp_path_factory.mktemp("stand")
    spare = BRASS.format(name="spare", path="/World/Materials/spare", rho=0.8)
    head = '    def Scope "Materials"\n    {\n'
    assert head in STATION
    (folder / "station.usda").write_text(STATION.replace(head, head + spare), encoding="utf-8")
    library = "".join(BRASS.format(name=n, path=f"/{n}", rho=r) for n, r in (("chalk", 0.9), ("soot", 0.03)))
    (folder / "library.usda").write_text(
        f"#usda 1.0\n(\n    metersPerUnit = 1\n)\n{library}", encoding="utf-8"
    )
    (folder / "cube.obj").write_text(CUBE + "\n", encoding="utf-8")
    source = ROOT / "assets/photometry/luxpy_test_lid_file.ies"
    (folder / "lamp.ies").write_bytes(source.read_bytes())
    return folder


def planned(folder, text, name="plan.yaml"):
    (folder / name).write_text(
        f"scene: station.usda\nwidth: 64\nrenderer: {{samples: 1}}\n{text}", encoding="utf-8"
    )
    return read(folder / name)


def body(scene, name):
    return next(b for b in scene.bodies if b.name.endswith(name))


def test_materials_shapes_and_profiles_are_put_where_they_belong(stand):
    scene = open_scene(stand / "station.usda").scene()
    found = with_values(scene, {"Plate.material": "rubber", "Plug.material": "steel", "steel.alpha_x": 0.2})
    assert body(found, "Plate").material is body(scene, "Plug").material
    assert body(found, "Plug").material.brdf.alpha_x == 0.2  # the number goes with the material
    for name, rho in (("spare", 0.8), ("library.usda:soot", 0.03), ("library.usda:/chalk", 0.9)):
        assert body(with_values(scene, {"Plate.material": name}), "Plate").material.brdf.diffuse[0] == (
            pytest.approx(rho)
        )
    kept = with_values(scene, {"Plate.material": "scene", "Plug.shape": "scene", "Led0.profile": "scene"})
    assert kept.bodies == scene.bodies
    assert kept.lights == scene.lights

    shaped = body(with_values(scene, {"Plug.shape": "cube.obj in mm"}), "Plug")
    corners = shaped.mesh.vertices @ shaped.world_from_body[:3, :3].T + shaped.world_from_body[:3, 3]
    origin = body(scene, "Plug").world_from_body[:3, 3]  # 12, 8, 7 mm
    np.testing.assert_allclose([corners.min(0), corners.max(0)], [origin, origin + 0.01], atol=1e-9)
    assert shaped.material is body(scene, "Plug").material

    lamp = with_values(scene, {"Led0.profile": "lamp.ies"}).lights[0]
    assert lamp.profile.power() == pytest.approx(4 * np.pi)  # a mean of 1: the lamp's power stays


def test_a_plan_over_names_says_what_made_each_frame(stand, tmp_path):
    """Two materials of a plate under one light: brightness goes with the albedo, 0.9 against 0.03; the frame of a name
    is the frame of the scene with it."""
    plan = planned(
        stand,
        """
sampling: grid
objects: [Plate]
noise: false
parameters:
  Plate.material: {values: ["library.usda:chalk", "library.usda:soot"], shares: [0.5, 0.5], nature: [0.9, 0.1]}
  Plug.shape: [scene, cube.obj in mm]
  Led0.intensity: {value: 0.01, unit: W/sr}
""",
    )
    assert plan.notes == ("BOP is not written: Plug.shape is no one model.",)
    assert set(plan.files) == {"library.usda:chalk", "library.usda:soot", "cube.obj in mm"}
    found = design(plan)
    jobs = jobs_of(plan, found.rows, tmp_path, open_scene(plan.scene).digest)
    for job in jobs:
        work(job)
    write_datasets(plan, found, [read_record(job) for job in jobs], tmp_path, Report((), ()))
    table = pandas.read_parquet(tmp_path / "manifest.parquet")
    assert list(table["Plate.material"]) == ["library.usda:chalk"] * 2 + ["library.usda:soot"] * 2
    assert list(table["Plug.shape"]) == ["scene", "cube.obj in mm"] * 2
    np.testing.assert_allclose(table["weight"], [1.8, 1.8, 0.2, 0.2])
    images = [exr.read(tmp_path / f) for f in table["file.exr"]]
    plate = [(x.pixels[x.passes["object_id"] == x.object_names.index("/World/Plate")]) for x in images]
    # light reflected onto the plate by the plug beside it is not of the plate's albedo; the rasteriser has none
    assert np.median(plate[0]) / np.median(plate[2]) == pytest.approx(30, rel=0.02)
    assert not np.array_equal(images[0].passes["object_id"], images[1].passes["object_id"])
    rows, _ = parquet.read(tmp_path / "manifest.parquet")
    write_contact_sheet(tmp_path / "sheet.png", tmp_path, rows, [a.address for a in plan.axes])

    with Rasterizer() as renderer:
        frames = read_sweep(tmp_path, parse({"edges": ["Plate"]}), renderer)
    chalk = [f.variation["Plate.material = library.usda:chalk"] for f in frames]
    assert chalk == [1, 1, 0, 0]  # what a score's robustness is told over


def test_another_file_behind_a_name_is_another_sweep(stand, tmp_path):
    text = "sampling: grid\nparameters:\n  Plug.shape: [cube.obj in mm]\n"
    before = planned(stand, text, "first.yaml")
    (job,) = jobs_of(before, design(before).rows, tmp_path, "d")
    kept_design(before, tmp_path, "d", lambda kept, count: None)
    (stand / "cube.obj").write_text(CUBE.replace("10", "20") + "\n", encoding="utf-8")
    after = planned(stand, text, "first.yaml")
    (other,) = jobs_of(after, design(after).rows, tmp_path, "d")
    (stand / "cube.obj").write_text(CUBE + "\n", encoding="utf-8")
    assert job.key != other.key
    assert job.values == other.values


def test_what_is_wrong_with_names_is_told_at_once(stand):
    with pytest.raises(FileError) as error:
        planned(
            stand,
            """
sampling: grid
write: [bop]
parameters:
  Plate.material: [stel, "library.usda", "nowhere.usda:chalk"]
  Plug.shape: [1, 2]
  Housing.shape: [lamp.ies, library.usda]
  Led0.profile: cube.obj
  Plate.materiel: [steel]
  Table.material: [steel, steel]
""",
            "wrong.yaml",
        )
    told = "\n".join(str(p) for p in error.value.problems)
    for part in (
        'There is no material "stel". Did you mean "steel"?',
        "must hold one; it has 2: write library.usda:NAME",
        "nowhere.usda",
        "Plug.shape",
        "so it must be one or a list of them; got [1, 2]",
        "A scene was expected; this is photometric file",
        "A shape must have a surface; there is none.",
        "Every name must stand once.",
        "BOP cannot be written: Plug.shape is no one model",
    ):
        assert part in told, part
    assert "Led0.profile" in told
    assert "Plate.materiel" in told
