"""The reference page of the reflectance models says what the files say."""

from pathlib import Path

import numpy as np

from analysis.sphere import ball
from composer.gallery.reflectance import lobe_plot, slug, text
from interchange.brdf import MODELS
from interchange.brdf.phong import Phong

DOCS = Path(__file__).parents[2] / "docs"


def test_the_page_is_what_the_files_say():
    """After a change of a model: make reference."""
    assert (DOCS / "reflectance.md").read_text(encoding="utf8") == text()


def test_every_model_has_its_pictures():
    for model in MODELS.values():
        for end in (".png", "_lobes.png"):
            assert (DOCS / "reflectance" / f"{slug(model)}{end}").stat().st_size > 1000


def test_a_plot_is_drawn(tmp_path):
    lobe_plot(Phong(), tmp_path / "phong.png")
    assert (tmp_path / "phong.png").read_bytes().startswith(b"\x89PNG")


def test_the_ball_is_round_and_closed():
    mesh = ball()
    corners = mesh.vertices[mesh.faces]
    volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert abs(abs(volume) / (4 / 3 * np.pi) - 1) < 1e-3
    assert volume > 0  # faces turn outward
