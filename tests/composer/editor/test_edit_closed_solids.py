"""Which surfaces hide their own back faces."""

import numpy as np
import pytest

from composer.editor.solids import solid
from realtime.closed import is_closed


@pytest.mark.parametrize("kind", ["box", "cylinder", "sphere"])
def test_solids_are_closed_until_a_face_is_missing_or_they_are_turned_inside_out(kind: str) -> None:
    mesh = solid(kind, (0.1, 0.2, 0.3))
    v, f = mesh.vertices, mesh.faces
    assert is_closed(v, f)
    assert is_closed(v + 5.0, f)
    assert not is_closed(v, f[1:])
    assert not is_closed(v, f[:, ::-1])
    two = np.concatenate([v, v + 1.0])
    assert is_closed(two, np.concatenate([f, f + len(v)]))
    hollow = np.concatenate([v, v.mean(axis=0) + 0.5 * (v - v.mean(axis=0))])
    assert not is_closed(hollow, np.concatenate([f, f[:, ::-1] + len(v)])), "a cavity shows its faces' backs"
    seam = v + 1e-9 * np.random.default_rng(0).standard_normal(v.shape)
    assert is_closed(seam, f)
