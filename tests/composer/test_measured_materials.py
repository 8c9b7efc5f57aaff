"""Measured BRDFs on the command line: `convert` makes a material of one, `info` says what it holds."""

import json
from pathlib import Path

import numpy as np
import pytest

from composer.cli import main
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.tabulated_isotropic import TabulatedIsotropic
from interchange.formats import exr
from interchange.formats.document import open_file, open_scene
from interchange.image import Image
from interchange.measurement import from_half_difference

ROOT = Path(__file__).parents[2]
MEASURED = ROOT / "assets" / "measurements" / "garnet_red_60.brdf"
SHAPE = (10, 8, 12)


@pytest.fixture
def merl(tmp_path: Path) -> Path:
    i, j, k = (a.ravel() for a in np.indices(SHAPE))
    h, d, p = SHAPE
    wi, wo = from_half_difference(
        ((i + 0.5) / h) ** 2 * np.pi / 2, (j + 0.5) / d * np.pi / 2, (k + 0.5) / p * np.pi
    )
    paint = Lafortune((0.3, 0.2, 0.1), weight=[(0.5, 0.5, 0.5)], C=[(-1, -1, 1)], n=[8])
    above = (wi[:, 2] > 0) & (wo[:, 2] > 0)
    stored = np.where(above[:, None], paint.evaluate(wi, wo) / (np.array([1.0, 1.15, 1.66]) / 1500), -1.0)
    path = tmp_path / "red-paint.binary"
    path.write_bytes(
        np.array(SHAPE, "<i4").tobytes() + np.ascontiguousarray(stored.T).astype("<f8").tobytes()
    )
    return path


def scene_of(material: Path) -> Path:
    """A scene that binds what stands in a material's file."""
    text = f"""#usda 1.0
( metersPerUnit = 1
  upAxis = "Z" )
def Mesh "Plate" (prepend apiSchemas = ["MaterialBindingAPI"])
{{
    rel material:binding = </Material>
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    uniform token subdivisionScheme = "none"
}}
def "Material" (references = @{material.name}@) {{}}
"""
    scene = material.with_name("scene.usda")
    scene.write_text(text)
    return scene


@pytest.mark.parametrize("extension", ["usda", "usdc"])
def test_a_merl_file_becomes_a_material_that_scenes_refer_to(merl: Path, extension: str, capsys) -> None:
    target = merl.with_name(f"material.{extension}")
    assert main(["convert", str(merl), str(target)]) == 0
    assert "written; nothing was lost" in capsys.readouterr().out
    (body,) = open_scene(scene_of(target)).scene().bodies
    assert body.material.brdf == open_file(merl).model  # every number of it


def test_scattered_readings_become_a_table(tmp_path: Path, capsys) -> None:
    target = tmp_path / "material.usda"
    assert main(["convert", str(MEASURED), str(target), "--grid", "8,5,6"]) == 0
    said = capsys.readouterr().err
    assert "The table of 240 rows leaves" in said
    (body,) = open_scene(scene_of(target)).scene().bodies
    brdf = body.material.brdf
    assert isinstance(brdf, TabulatedIsotropic)
    assert (brdf.n_theta_h, brdf.n_theta_d, brdf.n_phi_d) == (8, 5, 6)
    wo = np.array([0.6, 0, 0.8])
    red, green, _ = brdf.evaluate(np.array([0, 0, 1.0]), wo)
    assert red > 3 * green  # Garnet Red


def test_utias_picture_of_a_cloth(tmp_path: Path, capsys) -> None:
    picture = np.full((288, 288, 3), 0.25, np.float32)
    picture[:, 0] = 0.5  # camera along the normal
    exr.write(tmp_path / "cloth.exr", Image(picture))
    target = tmp_path / "material.usdc"
    assert main(["convert", str(tmp_path / "cloth.exr"), str(target), "--utia"]) == 0
    assert "Nothing was measured beyond 75°" in capsys.readouterr().err
    (body,) = open_scene(scene_of(target)).scene().bodies
    wi = np.array([0.6, 0, 0.8])
    assert body.material.brdf.evaluate(wi, np.array([0, 0, 1.0])) == pytest.approx([0.5] * 3)
    assert body.material.brdf.evaluate(wi, np.array([-0.8, 0, 0.6])) == pytest.approx([0.25] * 3)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([str(MEASURED), "OUT", "--grid", "8,5"], "--grid must be three or four whole numbers"),
        (
            [str(ROOT / "assets/measurements/cie.stdillum.A.spd"), "OUT"],
            "A BRDF was expected; this is a spectrum",
        ),
        ([str(MEASURED), "OUT", "--utia"], "--utia is for OpenEXR images"),
        ([str(ROOT / "assets/bench_sample/scene.usda"), "OUT", "--grid", "8,5,6"], "are for measured BRDFs"),
    ],
)
def test_what_cannot_be_converted_is_one_line(words: list[str], message: str, tmp_path: Path, capsys) -> None:
    assert main(["convert", *(str(tmp_path / "o.usda") if w == "OUT" else w for w in words)]) == 2
    assert message in capsys.readouterr().err


def test_info(merl: Path, tmp_path: Path, capsys) -> None:
    assert main(["info", str(merl), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["format"] == "MERL BRDF"
    assert found["model"] == "TabulatedIsotropic (10 x 8 x 12)"
    assert (found["readings"], found["kind"]) == (960, "BRDF")
    assert 400 < found["usable"] < 960
    table = tmp_path / "scan.csv"
    table.write_text(
        "theta_i (deg),theta_s (deg),phi_s (deg),BRDF,sigma (%)\n30,20,180,0.2,5\n30,40,180,-0.1,5\n"
    )
    assert main(["info", str(table), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["kind"], found["usable"], found["median_sigma_percent"]) == ("BRDF", 2, 5)
    assert found["values"][0]["negative"] == 1
