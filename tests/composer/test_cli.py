"""The command line as a person uses it."""

from pathlib import Path

import numpy as np
import pytest

from composer.cli import main, names
from composer.frames import file_name, parse_frames
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.formats import exr, gprims
from interchange.formats.document import Document, open_scene
from interchange.formats.usd_author import author_scene
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene

ASSETS = Path(__file__).parents[2] / "assets"


def moment(x: float) -> Scene:
    lamp = np.eye(4)
    lamp[:3, 3] = x, 0, 0.3
    return Scene(
        (Body("plate", gprims.plane(0.2, 0.2), Material("matte", Lambert((0.5, 0.5, 0.5)))),),
        (
            Light("Left", LightKind.SPHERE, (1, 1, 1), lamp),
            Light("Right", LightKind.SPHERE, (2, 2, 2), lamp),
        ),
        (
            Camera(
                "Top",
                look_at(np.array([0, 0, 0.4]), np.zeros(3)),
                Lens(16e-3),
                Sensor((40, 30), (1e-4, 1e-4)),
            ),
            Camera(
                "Side",
                look_at(np.array([0, -0.3, 0.3]), np.zeros(3)),
                Lens(16e-3),
                Sensor((40, 30), (1e-4, 1e-4)),
            ),
        ),
    )


@pytest.fixture
def scene(tmp_path) -> Path:
    Document(author_scene(moment(0.0), 0.001, [moment(0.05), moment(0.1)]), Path("memory")).save(
        tmp_path / "s.usda"
    )
    return tmp_path / "s.usda"


def said(capsys) -> list[str]:
    return capsys.readouterr().err.strip().splitlines()


def test_every_command_says_what_it_does(capsys):
    assert main(["--help"]) == 0
    text = capsys.readouterr().out
    assert {"convert", "demo", "doctor", "info", "render"} <= set(names())
    assert all(name in text for name in names())


def test_an_unknown_command_is_one_line_with_a_suggestion(capsys):
    assert main(["rendr"]) == 2
    (line,) = said(capsys)
    assert 'Did you mean "render"?' in line


def test_a_part_is_converted_with_its_size(tmp_path, capsys):
    assert (
        main(["convert", str(ASSETS / "cad/featuretype.STL"), str(tmp_path / "p.usda"), "--unit", "inch"])
        == 0
    )
    assert "nothing was lost" in capsys.readouterr().out
    low, high = open_scene(tmp_path / "p.usda").scene().bounds
    assert (high - low) * 1e3 == pytest.approx([127, 63.5, 34.925], abs=1e-3)


def test_what_is_lost_is_listed_and_strict_fails(tmp_path, capsys):
    words = ["convert", str(ASSETS / "cad/fixture.igs"), str(tmp_path / "p.usda")]
    assert main(words) == 0
    assert any(line.startswith("loss:") for line in said(capsys))
    assert main([*words, "--strict"]) == 1


def test_a_missing_unit_is_asked_for(tmp_path, capsys):
    assert main(["convert", str(ASSETS / "cad/featuretype.STL"), str(tmp_path / "p.usda")]) == 2
    assert "--unit" in said(capsys)[0]
    assert not list(tmp_path.iterdir())


def test_one_frame_real_time(scene, tmp_path):
    out = tmp_path / "a.exr"
    assert (
        main(["render", str(scene), "--camera", "Top", "--out", str(out), "--passes", "all", "--preview"])
        == 0
    )
    image = exr.read(out)
    assert image.pixels.shape == (30, 40, 3)
    assert {"depth", "normal", "object_id", "motion", "lit:/World/Left"} <= set(image.passes)
    centre = image.pixels[14:16, 19:21].mean()
    assert centre == pytest.approx(3 * 0.5 / np.pi / 0.3**2, rel=1e-3)  # both lamps, I cos / r² at 0.3 m
    assert out.with_suffix(".png").is_file()


def test_one_image_a_lamp(scene, tmp_path):
    out = tmp_path / "a.exr"
    assert main(["render", str(scene), "--camera", "Top", "--out", str(out), "--per-light"]) == 0
    left, right, both = (exr.read(tmp_path / n).pixels for n in ("a.Left.exr", "a.Right.exr", "a.exr"))
    assert right == pytest.approx(2 * left, rel=1e-5)
    assert both == pytest.approx(left + right, rel=1e-5)


def test_a_batch_resumes_and_a_changed_scene_is_rendered_anew(scene, tmp_path):
    out = tmp_path / "frames"
    words = ["render", str(scene), "--cameras", "all", "--frames", "all", "--out", str(out), "--samples", "1"]
    assert main(words) == 0
    files = sorted(out.iterdir())
    assert [f.name for f in files] == sorted(f"{c}.000{t}.exr" for c in ("Top", "Side") for t in range(3))
    stamps = [f.stat().st_mtime_ns for f in files]
    files[0].write_bytes(
        files[0].read_bytes()[:500]
    )  # as a killed process would not leave it, but a full disk may
    assert main(words) == 0
    again = [f.stat().st_mtime_ns for f in files]
    assert again[1:] == stamps[1:]
    assert exr.read(files[0]).pixels.shape == (30, 40, 3)
    scene.write_text(scene.read_text().replace("(0.5, 0.5, 0.5)", "(0.25, 0.25, 0.25)"))
    assert main(words) == 0
    assert all(a != b for a, b in zip([f.stat().st_mtime_ns for f in files], again, strict=True))


def test_one_frame_path_traced(scene, tmp_path):
    out = tmp_path / "a.exr"
    words = [
        "render",
        str(scene),
        "--offline",
        "--camera",
        "Top",
        "--time",
        "1",
        "--samples",
        "4",
        "--width",
        "20",
    ]
    assert main([*words, "--out", str(out)]) == 0
    image = exr.read(out)
    assert image.pixels.shape == (15, 20, 3)
    assert image.made_by["renderer"] == "cycles"
    assert image.made_by["time"] == 1


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--camera", "Topp", "--out", "a.exr"], 'Did you mean "Top"?'),
        (["--out", "a.exr"], "2 cameras"),
        (["--camera", "Top", "--out", "a.jpg"], "ends in .exr, .png, .tif, .tiff"),
        (["--camera", "all", "--out", "a.exr"], "to a folder"),
        (["--camera", "Top", "--out", "a.exr", "--passes", "dept"], "Unknown pass dept"),
        (["--camera", "Top", "--out", "a.exr", "--passes", "indirect"], "no pass indirect"),
        (["--camera", "Top", "--out", "a.exr", "--samples", "0"], "--samples"),
        (["--camera", "Top", "--out", "frames", "--frames", "5:1"], "before it begins"),
        (["--camera", "Top", "--out", "frames", "--frames", "x"], "Frames are given as"),
    ],
)
def test_bad_words_are_one_clear_line(scene, tmp_path, monkeypatch, capsys, words, part):
    monkeypatch.chdir(tmp_path)
    assert main(["render", str(scene), *words]) == 2
    (line,) = said(capsys)
    assert part in line
    assert not (tmp_path / "a.exr").exists()


def test_frames_are_parsed_with_both_ends():
    assert parse_frames("0:4:2,7,all", [1.0, 2.0]) == [0, 2, 4, 7, 1]
    with pytest.raises(BrightfieldError):
        parse_frames("1:2:0", [])


def test_file_names_are_distinct_and_safe():
    assert file_name("/World/Rig/Top", 5) == "Rig_Top.0005.exr"
    assert file_name("/World/Top", -2.5) == "Top.m2_5.exr"


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("brightfield 0.")


def test_of_a_file_with_hundreds_of_problems_the_first_are_told(capsys, tmp_path) -> None:
    wrong = tmp_path / "numbers.txt"
    wrong.write_text("x y z\n" * 300)
    assert main(["emva", str(wrong), "--out", str(tmp_path / "sensor.json")]) == 2
    told = said(capsys)
    assert "line 1:" in told[0]
    assert len(told) == 21
    assert told[-1] == "brightfield: ... and 281 more."  # 300 lines and the size that none of them says
