"""The blind scenes' shapes."""

import numpy as np
import pytest

from benchmarks.blind.scenes import SCENES, scene
from benchmarks.blind.tracing import _grained


@pytest.mark.parametrize("name", SCENES)
def test_a_grain_lies_on_every_face_and_turns_with_the_part(name: str) -> None:
    """u and v are lengths on the face: the triangle that they draw is the one in space."""
    for part in scene(name).parts:
        s = _grained(part.solid)
        sides = [np.roll(s.vertices[s.faces], -1, axis=1) - s.vertices[s.faces]]
        sides.append(np.roll(s.uv[s.faces], -1, axis=1) - s.uv[s.faces])
        flat, drawn = (np.linalg.norm(x, axis=-1) for x in sides)
        assert drawn == pytest.approx(flat, rel=1e-6, abs=1e-9)
