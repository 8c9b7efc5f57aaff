"""The demo's captures fit their scene, and the page says what was found of them. `make demo` diagnoses them."""

from pathlib import Path

import pytest

from analysis.gap.compared.conditions import conditions
from composer.commands.demo import ASSETS
from composer.demo.diagnosis import CAPTURES, Shown
from composer.demo.make import _diagnosis, make
from interchange.formats import captures
from interchange.formats.document import open_scene
from interchange.problems import FileError


def test_the_captures_are_of_the_scene_and_some_are_held_out() -> None:
    given = captures.read(ASSETS / CAPTURES)
    found = conditions(given, open_scene(given.scene))
    assert len(given.captures) == 8
    assert [len(c.captures) for c in found] == [1, 1, 1, 1, 2, 1, 1]
    assert 0 < sum(c.held_out for c in found) < 4
    assert all(c.mean.shape == (360, 480, 3) for c in found)


def test_the_page_says_verdict_and_numbers() -> None:
    text = _diagnosis(
        Shown(8, "It is <dust>.", ("dust a = 0.1 ± 0.2",), (4.5, 1.135, 1.0), "d.png", "d/report.html")
    )
    for part in (
        "It is &lt;dust&gt;.",
        "8 captures of a bench",
        "from 4.50 to 1.14",
        "dust a = 0.1 ± 0.2",
        'href="d/report.html"',
        'src="d.png"',
    ):
        assert part in text


def test_missing_captures_are_told_before_anything_is_rendered(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=CAPTURES):
        make(tmp_path / "out", tmp_path, 1, lambda text: None)
    assert not (tmp_path / "out").exists()
