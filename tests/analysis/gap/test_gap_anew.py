"""A camera that moved by pixels is rendered from where it stands, beside what the scene file says; 128 x 96 px."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.light.margin import MOST
from analysis.gap.light.radiance import Paths, render_all
from analysis.gap.processed.compressed import Compressed, processings, with_errors
from analysis.gap.search.anew import Anew, rendered_anew, wanted
from analysis.gap.search.approach import _levels
from analysis.gap.search.model import Model
from analysis.gap.search.search import Search
from analysis.gap.terms.base import Term
from analysis.gap.terms.geometry import geometry_terms, stand
from interchange.camera import Camera
from interchange.captures import Tolerances
from interchange.effects.camera_pose import CameraPose
from interchange.image import Image
from interchange.scene import Scene
from realtime.renderers.rasterizer import Rasterizer

POSE = CameraPose(tx=12.0, ty=-5.0, rx=4.0, rz=30.0)  # some 5 px
SETTINGS = {"renderer": "rasteriser", "samples": 36}


@pytest.fixture(scope="module")
def render(rasterizer: Rasterizer):
    def drawn(
        scene: Scene, camera: Camera, passes: Sequence[str], per_light: bool, parts: int, paths: Paths
    ) -> Image:
        return rasterizer.render(scene, camera, passes, per_light, 4)

    return drawn


@pytest.fixture(scope="module")
def found(small_bench, render, tmp_path_factory) -> list[Condition]:
    folder = tmp_path_factory.mktemp("anew")
    bare = small_bench(folder, {0: "Camera0", 2: "Camera0", 16: "Camera1"}, 4)
    shown = render_all([(c.scene, c.camera) for c in bare], render, SETTINGS, folder / "cache")
    return [replace(c, rendered=r) for c, r in zip(bare, shown, strict=True)]


@pytest.fixture(scope="module")
def terms(found: list[Condition]) -> tuple[Term, ...]:
    return tuple(geometry_terms(found, Tolerances()))


def at_pose(terms: Sequence[Term], name: str, share: float = 1.0) -> np.ndarray:
    own = [t.candidate == ("camera_pose", name) for t in terms]
    return np.array(
        [share * getattr(POSE, t.parameter) if o else 0.0 for o, t in zip(own, terms, strict=True)]
    )


def test_a_camera_that_moved_is_seen_from_where_it_stands(found, terms, render, tmp_path: Path) -> None:
    """Exactly what a camera there renders, of which a motion of the written one's rendering misses more than 1 % of the
    light; nearer to that than half the way the written one's is moved. The other camera is as it was."""
    name = stand(found[0])
    at = at_pose(terms, name)
    anew = wanted(found, terms, at, ())
    assert list(anew.poses) == [name]
    assert anew.poses[name] == {
        t.key: x for t, x in zip(terms, at, strict=True) if t.candidate[1] == name and x
    } | {("camera_pose", name, p): 0.0 for p in ("tz", "ry")}
    assert not anew.standing
    assert not anew.beyond  # what is rendered from there looks at nothing outside of its frame
    written = {c.name: c.shown for c in found}
    there = rendered_anew(found, written, anew, render, SETTINGS, tmp_path)
    assert there[2].shown.moved is None
    camera = POSE.on_scene(replace(found[0].scene, cameras=(found[0].camera,))).cameras[0]
    (truth,) = render_all([(found[0].shown.scene, camera)], render, SETTINGS, tmp_path)
    state = Model(terms, at, at).state(there[0])
    assert state.flow is None or not state.flow.any()
    for lamp, L in truth.lamps.items():
        assert np.array_equal(state.shown.lamps[lamp], L)
        by_first_order = Model(terms, at, at).state(found[0]).shown.lamps[lamp]
        assert np.abs(by_first_order - L).mean() > 0.01 * L.mean()
    near = at_pose(terms, name, 0.4)
    home = Model(terms, near, near)
    assert home.state(there[0]).simulation.dn == pytest.approx(home.state(found[0]).simulation.dn)
    assert np.array_equal(there[0].simulated().dn, found[0].simulated().dn)  # as the file says
    assert np.array_equal(state.usable, found[0].compared)


def test_a_little_further_from_there(found, terms, render, tmp_path: Path) -> None:
    """A tenth more of the pose moves what was rendered with it: within half of what that changes, as it is half a px
    and every rendering has spots of its own."""
    name = stand(found[0])
    pose = {
        t.key: x
        for t, x in zip(terms, at_pose(terms, name), strict=True)
        if t.candidate == ("camera_pose", name)
    }
    written = {c.name: c.shown for c in found}
    there = rendered_anew(found, written, Anew(poses={name: pose}), render, SETTINGS, tmp_path)[0]
    further = at_pose(terms, name, 1.1)
    said = Model(terms, further, further).state(there)
    camera = (
        replace(POSE, **{p: 1.1 * getattr(POSE, p) for p in ("tx", "ty", "rx", "rz")})
        .on_scene(replace(there.scene, cameras=(there.camera,)))
        .cameras[0]
    )
    (truth,) = render_all([(there.shown.scene, camera)], render, SETTINGS, tmp_path)
    inner = (slice(4, -4), slice(4, -4))
    lamp, L = max(truth.lamps.items(), key=lambda both: both[1].mean())
    before = there.shown.moved.lamps[lamp]
    off, moved = (np.sqrt(np.mean((x - L)[inner] ** 2)) for x in (said.shown.lamps[lamp], before))
    assert off < 0.5 * moved
    assert said.flow is not None
    assert 0.2 < np.linalg.norm(said.flow, axis=-1).max() < 2


def test_what_is_near_needs_nothing(found, terms) -> None:
    assert not wanted(found, terms, at_pose(terms, stand(found[0]), 0.05), ()).is_there


def test_both_a_camera_and_what_it_cannot_see(found, terms, render, tmp_path: Path) -> None:
    name = stand(found[0])
    pose = {("camera_pose", name, "tx"): 12.0}
    written = {c.name: c.shown for c in found}
    shares: list[float] = []
    wide = rendered_anew(
        [*found, found[0]],
        written,
        Anew(poses={name: pose}, beyond={found[0].camera.name: 3.0}),
        render,
        SETTINGS,
        tmp_path,
        shares.append,
    )
    assert wide[3].shown is wide[0].shown
    assert shares == [k / len(shares) for k in range(len(shares))]
    assert wide[0].shown.margin == wide[0].shown.moved.margin > 3
    assert wide[0].shown.margin < MOST * 96
    assert wide[2].shown.margin == 0


def test_means_over_pixels_are_of_what_the_file_says(found, terms, render, tmp_path: Path) -> None:
    """What is approached from coarse to fine starts from home, whatever was rendered elsewhere."""
    name = stand(found[0])
    pose = {("camera_pose", name, "tx"): 12.0}
    written = {c.name: c.shown for c in found}
    there = rendered_anew(found, written, Anew(poses={name: pose}), render, SETTINGS, tmp_path)
    search = Search(there, terms, None, lambda what, share: None)
    at = at_pose(terms, name)
    for level in _levels(search):
        state = search.model(at, at).state(level.conditions[0])
        assert state.shown.rest.shape[:2] == level.conditions[0].mean.shape[:2]


def test_what_compressing_leaves_is_of_the_own_pixels_alone(found, terms) -> None:
    """Coarse levels have neither a JPEG's blocks nor the errors that were told of them."""
    taken = [replace(c, camera=Compressed(c.camera.name, 85, True).of(c.camera)) for c in found]
    jpegs = with_errors(taken, processings(taken))
    assert all(c.packed is not None for c in jpegs)
    home = np.zeros(len(terms))
    search = Search(jpegs, terms, None, lambda what, share: None)
    for level in _levels(search):
        for c in level.conditions:
            assert not c.camera.sensor.jpeg_quality
            assert search.model(home, home).state(c).simulation.variance.shape == c.mean.shape
