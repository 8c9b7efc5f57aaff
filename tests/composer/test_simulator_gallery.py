"""The chapter's figures 4 to 6 are drawn from renders, and what stands in them holds."""

import numpy as np
import pytest

from composer.gallery.simulator import make
from interchange.formats import images


@pytest.mark.slow
@pytest.mark.timeout(900)  # both renderers start; a busy machine takes minutes
def test_figures_of_the_simulator_are_drawn(tmp_path):
    """Small. The part's front lies behind the lid's edge: from the camera, 0.276 m above the table and 0.3 m before the
    part's middle, the front edge of the opening at 0.1 m and y = -0.11 m stands before all that is low and near."""
    found = make(tmp_path, width=120, samples=2, paths=4)
    for name in ("figure4", "figure5", "figure6"):
        picture = images.read(tmp_path / f"{name}.png").astype(float)
        assert picture.std() > 20, name
    assert 0.15 < found["hidden"] < 0.35
    assert found["least_change"] > 0.2  # the camera moves from frame to frame
    assert (
        abs(found["direct_ratio"] - 1) < 0.01
    )  # one scene: light straight from the lamps is the same in both
    red = images.read(tmp_path / "figure4.png").astype(int)
    assert ((red[..., 0] > 150) & (red[..., 1] < 90) & (red[..., 2] < 90)).mean() > 0.01
    assert np.isfinite(list(found.values())).all()
