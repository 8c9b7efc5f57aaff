"""`brightfield edit --headless`: the same edits without a window."""

from pathlib import Path

import pytest

from composer.cli import main
from interchange.formats.document import open_scene

ASSETS = Path(__file__).parents[3] / "assets"


def test_a_part_becomes_a_scene_by_a_script(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / "station.txt"
    script.write_text(
        "# a lamp over the part\n\nadd_lamp kind=rect name=Bar position=[0,0,0.3] intensity=2 size=0.05\n"
        "add_camera name=Top position=[0,0,0.5] resolution=[320,240]\n"
        "set_parameter path=/World/Top name=lens.f_stop value=4\n"
    )
    out = tmp_path / "scene.usda"
    part = str(ASSETS / "cad" / "featuretype.STL")
    words = ["edit", part, "--unit", "mm", "--headless", "--out", str(out), "--script", str(script)]
    assert main([*words, "--do", "add_solid kind=plane name=Table size=[1,1,0]"]) == 0
    assert "4 edits" in capsys.readouterr().out
    scene = open_scene(out).scene()
    assert scene.camera("Top").lens.f_stop == 4
    assert scene.camera("Top").sensor.resolution == (320, 240)
    assert scene.lights[0].intensity == pytest.approx((2, 2, 2))
    assert {b.name.rsplit("/", 1)[-1] for b in scene.bodies} >= {"Table"}


@pytest.mark.parametrize(
    ("edit", "told"),
    [
        ("ad_lamp", 'Did you mean "add_lamp"?'),
        ("add_lamp kind=candle", "must be one of sphere"),
        ("add_lamp knd=rect", 'Did you mean "kind"?'),
        ("place position=[0,0,0]", "place needs path"),
        ("place path=/World position=[0,nothing]", "Numbers were expected"),
        ("add_lamp intensity=bright", "A number was expected"),
        ("delete paths=/World/Gone", 'no prim "/World/Gone"'),
        ("add_lamp 'kind=rect", "quotes must match"),
    ],
)
def test_what_cannot_be_done_is_told_in_a_line(
    edit: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scene.usda"
    assert main(["edit", "--headless", "--out", str(out), "--do", edit]) == 2
    text = capsys.readouterr().err
    assert told in text
    assert len(text.strip().splitlines()) == 1
    assert not out.exists()


def test_a_file_that_is_no_usd_needs_a_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["edit", str(ASSETS / "cad" / "featuretype.STL"), "--unit", "mm", "--headless"]) == 2
    assert "--headless needs --out" in capsys.readouterr().err


def test_the_list_names_every_edit(capsys: pytest.CaptureFixture[str]) -> None:
    from composer.editor.command_text import COMMANDS

    assert main(["edit", "--list"]) == 0
    text = capsys.readouterr().out
    assert all(f"{name}: " in text for name in COMMANDS)
