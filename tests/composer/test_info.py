"""`brightfield info` for every kind of file, as text and as JSON."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from composer.cli import main
from composer.describe import describe
from interchange.camera import Camera
from interchange.formats import exr, images
from interchange.image import Image

ROOT = Path(__file__).parents[2]
SCENE = """#usda 1.0
(
    metersPerUnit = 0.001
    upAxis = "Z"
    startTimeCode = 0
    endTimeCode = 4
)
def Xform "World"
{
    def Mesh "Plate" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        rel material:binding = </World/Metal>
        point3f[] points = [(0, 0, 5), (40, 0, 5), (40, 30, 5), (0, 30, 5)]
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        uniform token subdivisionScheme = "none"
    }
    def Material "Metal"
    {
        token outputs:brdf:surface.connect = </World/Metal/Brdf.outputs:surface>
        def Shader "Brdf"
        {
            uniform token info:id = "Phong"
            color3f inputs:diffuse = (0.1, 0.2, 0.3)
            color3f inputs:specular = (0.5, 0.5, 0.5)
            float inputs:n = 25
            token outputs:surface
        }
    }
    def SphereLight "Lamp"
    {
        float inputs:intensity = 8
        bool inputs:normalize = 1
        float inputs:radius = 2
        double3 xformOp:translate = (0, 0, 100)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Camera "Camera"
    {
        float focalLength = 160
        float horizontalAperture = 64
        float verticalAperture = 48
        custom int2 sensor:resolution = (640, 480)
    }
}
"""


def printed(path: Path, capsys: pytest.CaptureFixture[str], *flags: str) -> str:
    assert main(["info", str(path), *flags]) == 0
    return capsys.readouterr().out


def test_a_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.usda"
    path.write_text(SCENE)
    found = json.loads(printed(path, capsys, "--json"))
    assert found["size_mm"] == pytest.approx([40, 30, 0])
    assert (found["frames"], found["last_time"], found["triangles"], found["objects"]) == (5, 4, 2, 1)
    plate = next(row for row in found["tree"] if row["name"] == "Plate")
    assert (plate["depth"], plate["type"], plate["triangles"], plate["material"]) == (1, "Mesh", 2, "Metal")
    (material,) = found["materials"]
    assert (material["brdf"], material["n"], material["diffuse"]) == (
        "Phong",
        25,
        pytest.approx([0.1, 0.2, 0.3]),
    )
    (light,) = found["lights"]
    # a normalised sphere light has a quarter of its number in W/sr, whatever its radius
    assert (light["intensity"], light["unit"]) == (pytest.approx([2, 2, 2]), "W/sr")
    assert light["extent_mm"] == {"radius": pytest.approx(2)}
    assert light["position_mm"] == pytest.approx([0, 0, 100])
    (camera,) = found["cameras"]
    # 160 tenths of a millimetre; 6.4 mm and 4.8 mm of sensor
    assert camera["focal_length_mm"] == pytest.approx(16)
    expected = np.degrees(2 * np.arctan(np.array([6.4, 4.8]) / 32))
    assert camera["field_of_view_deg"] == pytest.approx(list(expected), rel=1e-6)
    text = printed(path, capsys)
    for line in (
        "size (mm)           40 × 30 × 0",
        "    Plate",
        "Phong  diffuse 0.1, 0.2, 0.3",
        "2, 2, 2    W/sr",
    ):
        assert line in text


def test_a_scene_with_an_error_still_shows_its_tree(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "scene.usda"
    path.write_text(SCENE.replace('"Phong"', '"Fong"'))
    assert main(["info", str(path)]) == 1
    text = capsys.readouterr().out
    assert "PROBLEMS\n  error: " in text
    assert "Fong" in text
    assert re.search(r"^    Plate +Mesh$", text, re.MULTILINE)


def test_an_exr(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    depth = np.full((4, 5), 2.0, np.float32)
    depth[0, :3] = np.inf
    made_by = {"renderer": "offline", "fit": {"metal": {"residual": 0.004}}, "seed": 3}
    pixels = np.arange(60, dtype=np.float32).reshape(4, 5, 3)
    pixels[1, 1, 2] = np.nan
    image = Image(pixels, camera=Camera("/World/Camera"), made_by=made_by, passes={"depth": depth})
    exr.write(tmp_path / "a.exr", image)
    found = json.loads(printed(tmp_path / "a.exr", capsys, "--json"))
    assert found["resolution_px"] == [5, 4]
    assert (found["quantity"], found["unit"], found["camera"]) == ("radiance", "W/(m^2 sr)", "/World/Camera")
    channels = {c["name"]: c for c in found["channels"]}
    assert (channels["depth.Z"]["inf"], channels["depth.Z"]["mean"]) == (3, 2)
    assert (channels["B"]["nan"], channels["R"]["max"]) == (1, 57)
    assert found["made_by"] == made_by
    assert "fit.metal.residual  0.004" in printed(tmp_path / "a.exr", capsys)


def test_an_image_a_lamp_and_measurements(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    array = np.zeros((4, 5, 1), np.uint16)
    array[0, 0] = 65535
    images.write_png(tmp_path / "a.png", array)
    found = describe(tmp_path / "a.png")
    assert (found["bits"], found["channels"], found["values"][0]["at_65535"]) == (16, "Y", 1)
    assert "at 65535" in printed(tmp_path / "a.png", capsys)

    lamp = describe(ROOT / "assets/photometry/luxpy_test_lid_file.ldt")
    assert lamp["light_output_ratio"] == pytest.approx(lamp["stated_output_ratio"], rel=5e-4)
    assert lamp["efficacy_lm_per_W"] == pytest.approx(0.88 * 6000 / 43.5, rel=5e-4)
    assert "flux (lm)" in printed(ROOT / "assets/photometry/luxpy_test_lid_file.ies", capsys)

    paint = json.loads(printed(ROOT / "assets/measurements/garnet_red_60.brdf", capsys, "--json"))
    assert (paint["kind"], paint["readings"], len(paint["values"])) == ("BRDF", 60, 31)
    assert [a["name"] for a in paint["axes"]] == ["theta_i", "phi_i", "theta_s", "phi_s"]
    assert {v["negative"] for v in paint["values"]} == {0}
    text = printed(ROOT / "assets/measurements/cie.stdillum.A.spd", capsys)
    assert "wavelength  nm         107  300" in text


def test_what_cannot_be_read_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, data in (("a.exr", b"x"), ("a.png", b"x"), ("a.ies", b"x"), ("a.brdf", b"x"), ("a.xyz", b"x")):
        (tmp_path / name).write_bytes(data)
        assert main(["info", str(tmp_path / name)]) == 2
        streams = capsys.readouterr()
        assert streams.out == ""
        assert len(streams.err.splitlines()) == 1


def test_long_lists_are_cut_unless_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    prims = "\n".join(f'def Xform "P{i}" {{}}' for i in range(100))
    path = tmp_path / "many.usda"
    path.write_text(f"#usda 1.0\n{prims}\n")
    assert "... 40 more; --all shows them" in printed(path, capsys)
    assert "P99" in printed(path, capsys, "--all")
