"""Lamps in USD: power and spectrum, projectors, what the camera sees of a lamp."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdLux

from composer.cli import main
from interchange.camera import Camera, Lens, Sensor
from interchange.colorimetry import luminous_efficacy, srgb_color
from interchange.distortion import LensModel
from interchange.exposure import LIGHT, PLANCK, expose
from interchange.formats import ies_write, images
from interchange.formats.document import open_scene
from interchange.formats.usd_author import author_scene
from interchange.formats.usd_edit_values import set_light
from interchange.formats.usd_read import SceneReader
from interchange.frames import look_at
from interchange.illuminants import illuminant
from interchange.image import Image, Quantity
from interchange.lamps import composite
from interchange.lamps.projecting import projector
from interchange.light import Light
from interchange.power import emitted_power
from interchange.problems import BrightfieldError, FileError
from interchange.scene import Scene

SPECTRUM = "# a lamp\nwavelength (nm),cold (W/nm),warm (W/nm)\n400,1,0\n550,2,2\n700,0,3\n"


def read(text: str, tmp_path: Path) -> tuple[Light, ...]:
    text = re.sub(r" (?=(double|string|asset|float|int2|color3f|token|bool)\S* [\w:]+ =|}$)", "\n", text)
    (tmp_path / "s.usda").write_text(f'#usda 1.0\n(\n    upAxis = "Z"\n    metersPerUnit = 0.001\n)\n{text}')
    return open_scene(tmp_path / "s.usda").scene().lights


def test_power_in_watts(tmp_path: Path) -> None:
    (light,) = read(
        'def DiskLight "L" (prepend apiSchemas = ["ShapingAPI"]) { float inputs:radius = 5 color3f inputs:color = '
        "(1, 0.5, 0) float inputs:shaping:cone:angle = 30 double lamp:power = 2.5 }",
        tmp_path,
    )
    assert emitted_power(light) == pytest.approx([2.5 * 2, 2.5, 0])
    assert light.radius == pytest.approx(0.005)


def test_flux_of_a_named_spectrum_and_of_a_table(tmp_path: Path) -> None:
    (light,) = read(
        'def SphereLight "L" { double lamp:flux = 806 string lamp:spectrum = "LED-B3" }', tmp_path
    )
    spectrum = illuminant("LED-B3")
    expected = 806 / luminous_efficacy(spectrum) * np.array(srgb_color(spectrum))
    assert emitted_power(light) == pytest.approx(expected)
    (tmp_path / "lamp.csv").write_text(SPECTRUM)
    (light,) = read(
        'def SphereLight "L" { double lamp:power = 3 string lamp:spectrum = "warm" asset lamp:spectrum:file = '
        "@lamp.csv@ }",
        tmp_path,
    )
    assert emitted_power(light).mean() == pytest.approx(3)
    assert light.intensity[0] > light.intensity[2]


def test_a_radial_profile_with_a_power(tmp_path: Path) -> None:
    (tmp_path / "led.csv").write_text("angle (deg),relative intensity\n0,1\n20,0.5\n40,0\n")
    (light,) = read(
        'def SphereLight "L" (prepend apiSchemas = ["ShapingAPI"]) { bool treatAsPoint = true double lamp:power = 1.5 '
        "float inputs:shaping:cone:angle = 180 asset inputs:shaping:ies:file = @led.csv@ }",
        tmp_path,
    )
    assert emitted_power(light) == pytest.approx([1.5] * 3)
    assert light.profile is not None
    assert light.profile.evaluate(np.radians(20), 0.0) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ("double lamp:flux = 800", "Lumens need a spectrum"),
        ('double lamp:flux = 800 string lamp:spectrum = "850 nm"', "visible spectrum"),
        ('double lamp:power = 8 string lamp:spectrum = "D66"', 'Did you mean "D65"'),
        ("double lamp:power = -8", "not negative; got -8 W"),
        ("double lamp:power = 8 double lamp:flux = 800", "in watts or in lumens, once"),
        ("double lamp:power = 1 asset lamp:spectrum:file = @gone.csv@", "is not there"),
        ("asset projector:image = @gone.png@", 'The projected image "gone.png" is not there'),
    ],
)
def test_mistakes_are_told_with_their_place(attributes: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=message) as caught:
        read(f'def SphereLight "L" {{ {attributes} }}', tmp_path)
    assert caught.value.problems[0].where.prim == "/L"


def test_projectors_without_a_lens_or_with_an_unknown_one(tmp_path: Path) -> None:
    images.write_png(tmp_path / "i.png", np.zeros((4, 6, 1), np.uint8))
    for attributes, message in (
        ("", "focal lengths, px, must be above 0; got nothing"),
        ("double2 projector:focalLength = (5, -5)", r"got \(5.0, -5.0\)"),
        ('double2 projector:focalLength = (5, 5) token projector:model = "fish"', 'Did you mean "fisheye"'),
        (
            "double2 projector:focalLength = (5, 5) double[] projector:distortion = [1" + 14 * ", 2" + "]",
            "14",
        ),
    ):
        with pytest.raises(FileError, match=message):
            read(f'def SphereLight "L" {{ asset projector:image = @i.png@ {attributes} }}', tmp_path)


@pytest.mark.parametrize(
    "lens",
    [
        Lens(8e-3, distortion=(-0.2, 0.08, 0.002, -0.001)),
        Lens(8e-3, distortion=(0.05, -0.01, 0, 0), model=LensModel.FISHEYE),
    ],
)
def test_a_projector_comes_back_from_usd(lens: Lens, tmp_path: Path) -> None:
    values = np.random.default_rng(0).integers(0, 255, (12, 16, 3)).astype(np.uint8)
    path = tmp_path / "pattern.png"
    images.write_png(path, values)
    pose = look_at(np.array([0.1, -0.2, 0.5]), np.zeros(3))
    camera = Camera("/p", pose, lens, Sensor((16, 12), (3e-4, 3e-4)), principal_point=(7.0, 6.5))
    light = projector(camera, images.texture(path), power=2.0, file=str(path), name="/World/Beamer")
    stage = author_scene(Scene(lights=(light,)))
    prim = stage.GetPrimAtPath("/World/Beamer")
    assert prim.IsA(UsdLux.SphereLight)  # what other software sees
    assert UsdLux.SphereLight(prim).GetTreatAsPointAttr().Get()
    stage.Export(str(tmp_path / "s.usda"))
    reader = SceneReader(Usd.Stage.Open(str(tmp_path / "s.usda")), "s.usda")
    (back,) = reader.scene(0.0).lights
    assert reader.scene(1.0).lights[0] is back  # renderers keep what they uploaded
    assert emitted_power(back) == pytest.approx(emitted_power(light), rel=1e-5)
    points = np.random.default_rng(1).uniform(-0.03, 0.03, (50, 3))
    for x in (light, back):
        d = (points - x.world_from_light[:3, 3]) @ x.world_from_light[:3, :3]
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        assert x.projector is not None
        assert x.projector.pixels(d) == pytest.approx(camera.project(points), abs=1e-6)
        assert x.shaping(d).max() > 0
    assert back.cone_angle == pytest.approx(light.cone_angle, abs=1e-4)
    prim.RemoveAPI(UsdLux.ShapingAPI)  # as written by hand
    (bare,) = SceneReader(stage, "s.usda").scene(0.0).lights
    assert bare.cone_angle == pytest.approx(light.cone_angle, abs=1e-9)


def test_what_has_no_file_cannot_be_written(tmp_path: Path) -> None:
    camera = Camera(sensor=Sensor((4, 3)))
    with pytest.raises(BrightfieldError, match="image must be in a file"):
        author_scene(Scene(lights=(projector(camera, np.ones((3, 4, 1)), intensity=1.0),)))
    with pytest.raises(BrightfieldError, match="profile must be in a file"):
        author_scene(Scene(lights=composite.dome(1.0, 0.1, 0.01)))


def test_a_backlight_stays_visible() -> None:
    (light,) = composite.backlight(1.0, 0.1, 0.1)
    (back,) = SceneReader(author_scene(Scene(lights=(light,))), "s.usda").scene(0.0).lights
    assert back.visible
    assert back.radiance == pytest.approx(light.radiance, rel=1e-6)


def test_power_and_projector_survive_collada(tmp_path: Path) -> None:
    images.write_png(tmp_path / "i.png", np.full((4, 6, 3), 200, np.uint8))
    text = (
        '#usda 1.0\n(\n    upAxis = "Z"\n    metersPerUnit = 0.001\n)\ndef SphereLight "L"\n{\n'
        "    bool treatAsPoint = true\n    double lamp:power = 2\n    asset projector:image = @i.png@\n"
        "    double2 projector:focalLength = (5, 5)\n}\n"
        'def Mesh "M"\n{\n    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n    int[] faceVertexCounts = [3]\n'
        "    int[] faceVertexIndices = [0, 1, 2]\n}\n"
    )
    (tmp_path / "s.usda").write_text(text)
    assert main(["convert", str(tmp_path / "s.usda"), str(tmp_path / "s.dae")]) == 0
    (a,), (b,) = (open_scene(tmp_path / name).scene().lights for name in ("s.usda", "s.dae"))
    assert b.projector is not None
    assert emitted_power(b) == pytest.approx([2] * 3, rel=1e-6)
    assert b.intensity == pytest.approx(a.intensity, rel=1e-6)


def test_a_dome_keeps_its_hole_and_its_axis(tmp_path: Path) -> None:
    pose = look_at(np.array([0.1, -0.2, 0.5]), np.zeros(3))
    lights = ies_write.saved(composite.dome(2.0, 0.1, 0.04, world_from_lamp=pose), tmp_path)
    (back,) = SceneReader(author_scene(Scene(lights=lights)), "s.usda").scene(0.0).lights
    assert emitted_power(back, area=np.pi * 0.1**2) == pytest.approx([2.0] * 3, rel=1e-5)
    theta = np.radians([0, 11, 12, 89, 91])  # the hole ends at asin(0.2) = 11.5 degrees
    local = np.stack([np.sin(theta), 0 * theta, -np.cos(theta)], axis=-1)
    world = local @ lights[0].world_from_light[:3, :3].T
    assert back.shaping(world @ back.world_from_light[:3, :3])[:, 0] == pytest.approx(
        [0, 0, 1, 1, 0], abs=1e-6
    )


RESPONSE = """wavelength (nm),red (%),green (%),blue (%)
400,2,4,40
500,5,55,30
600,45,20,3
700,30,5,1
850,12,11,10
1000,0,0,0
"""
EYE = (
    'def Camera "eye" {{ float fStop = 4 asset sensor:quantumEfficiency:file = @{file}@ '
    "int2 sensor:resolution = (4, 3)\n}}"
)


@pytest.mark.parametrize("spectrum", ["3000 K", "D65", "525 nm / 30 nm", "850 nm"])
def test_a_spectrum_goes_through_the_cameras_response(tmp_path: Path, spectrum: str) -> None:
    """Photons counted wavelength by wavelength, of a disk that the camera looks at, against its electrons."""
    (tmp_path / "qe.csv").write_text(RESPONSE)
    read(
        f'def DiskLight "L" {{ double lamp:power = 0.5 string lamp:spectrum = "{spectrum}"\n}}\n'
        + EYE.format(file="qe.csv"),
        tmp_path,
    )
    scene = open_scene(tmp_path / "s.usda").scene()
    camera, (light,) = scene.cameras[0], scene.lights
    assert camera.sensor.responsivity == 0
    camera = replace(camera, t_exp=1e-9, sensor=replace(camera.sensor, full_well=1e9))
    image = Image(np.broadcast_to(np.float32(light.radiance), (3, 4, 3)))
    got = expose(image, camera, until=Quantity.ELECTRONS).pixels[1, 1]
    curve = illuminant(spectrum).normalized(0.5 / (np.pi * light.projected_area))  # Lambertian, W/(m² sr nm)
    table = np.loadtxt((tmp_path / "qe.csv").read_text().splitlines()[1:], delimiter=",")
    step = 0.125
    grid = np.arange(300, 1100, step)
    area, solid_angle = np.prod(camera.sensor.pixel_pitch), np.pi / (4 * 4**2)
    for c in range(3):
        eta = np.interp(grid, table[:, 0], table[:, 1 + c] / 100, left=0, right=0)
        photons = curve(grid) * grid * 1e-9 / (PLANCK * LIGHT) * area * solid_angle * camera.t_exp
        assert got[c] == pytest.approx(np.sum(photons * eta) * step, rel=5e-3)  # two integrations by chords


def test_a_spectrum_alone_colours_a_lamp(tmp_path: Path) -> None:
    (light,) = read(
        'def DomeLight "L" { float inputs:intensity = 7 string lamp:spectrum = "3000 K" }', tmp_path
    )
    assert light.intensity == pytest.approx(7 * np.array(srgb_color(illuminant("3000 K"))))
    with pytest.raises(BrightfieldError, match="has the colour of its spectrum"):
        set_light(open_scene(tmp_path / "s.usda").stage, light, "color", (1, 0, 0), None)


@pytest.mark.parametrize(
    ("files", "message"),
    [
        (("a.csv", "b.csv"), "/eye and /other have one each of their own"),
        (("gone.csv",), 'The response "gone.csv" is not there'),
        (("two.csv",), "one column of values, or one a channel; got 2"),
        (("many.csv",), "Sensor.quantum_efficiency"),
    ],
)
def test_a_response_that_cannot_be_is_an_error(tmp_path: Path, files: tuple[str, ...], message: str) -> None:
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text(RESPONSE)
    (tmp_path / "two.csv").write_text("wavelength (nm),a,b\n400,0.1,0.2\n500,0.1,0.2\n")
    (tmp_path / "many.csv").write_text("wavelength (nm),a\n400,10\n500,20\n")
    eyes = [
        EYE.format(file=f).replace('"eye"', f'"{n}"') for f, n in zip(files, ("eye", "other"), strict=False)
    ]
    with pytest.raises(FileError, match=message):
        read(
            'def DiskLight "L" { double lamp:power = 1 string lamp:spectrum = "A"\n}\n' + "\n".join(eyes),
            tmp_path,
        )
