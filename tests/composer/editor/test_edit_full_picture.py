"""Images in full are made beside the window's own drawing, and are what one rendering gives, to the bit."""

import time
from dataclasses import replace

import moderngl
import numpy as np
import pytest

from composer.editor.window.full_picture import FullPictures
from composer.editor.workspace import Workspace
from interchange.problems import BrightfieldError
from realtime.context import headless_context
from realtime.renderers.rasterizer import Rasterizer


@pytest.fixture(scope="module")
def workspace() -> Workspace:
    made = Workspace()
    made.run(
        [
            "add_solid kind=sphere name=Part size=[0.1,0.1,0.1]",
            "add_lamp kind=rect position=[0.2,-0.1,0.4] intensity=2 size=0.1",
            "add_lamp kind=sphere position=[-0.2,-0.1,0.4] intensity=2",
            "add_camera name=Top position=[0,-0.1,0.4] resolution=[64,48] pixel_pitch=4e-5",
        ]
    )
    return made


@pytest.fixture(scope="module")
def context() -> moderngl.Context:
    return headless_context()


def test_pieces_are_the_image_whatever_else_is_drawn_or_was_begun(
    workspace: Workspace, context: moderngl.Context
) -> None:
    scene = workspace.scene
    camera, other = scene.cameras[0], scene.cameras[0].resized(32)
    patient, window = Rasterizer(context), Rasterizer(context)
    for samples, shading in ((1, "sample"), (4, "pixel"), (4, "sample")):
        whole = patient.render(scene, camera, samples=samples, shading=shading)
        given_up = patient.pieces(scene, other, samples=samples, shading=shading)
        next(given_up)
        given_up.close()
        pieces, count = patient.pieces(scene, camera, samples=samples, shading=shading), 0
        while True:
            try:
                next(pieces)
            except StopIteration as end:
                image = end.value
                break
            count += 1
            context.enable(moderngl.BLEND)
            window.render(scene, other, samples=4)
        assert count >= 2
        np.testing.assert_array_equal(image.pixels, whole.pixels)


def test_one_image_at_a_time(workspace: Workspace, context: moderngl.Context) -> None:
    renderer, camera = Rasterizer(context), workspace.scene.cameras[0]
    pieces = renderer.pieces(workspace.scene, camera, samples=8)
    next(pieces)
    renderer.render(workspace.scene, camera, samples=1)
    with pytest.raises(BrightfieldError, match="one image at a time"):
        next(pieces)


def test_a_window_goes_on_while_its_views_wait_in_turn(
    workspace: Workspace, context: moderngl.Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("composer.editor.window.full_picture.SHARE", 0.0)  # a piece a frame
    full = FullPictures()
    full.start(context)
    assert full.renderer is not None
    full.ready.result()
    scene = workspace.scene
    camera = scene.cameras[0]
    assert full.radiance("a", scene, camera, 4, frame=1) is None
    assert full.radiance("b", scene, camera.resized(32), 4, frame=1) is None
    assert full.making.key == "a", "the other view waits"
    assert full.busy(2)
    assert not full.busy(9), "nobody asks any more: the window may rest"
    assert full.radiance("b", scene, camera.resized(32), 4, frame=9) is None
    assert full.making.key == "b", "what nobody asks for any more is given up"

    frames = 10
    while (image := full.radiance("b", scene, camera.resized(32), 4, frame=frames)) is None:
        frames += 1
        assert frames < 100
    assert frames >= 11, "in several frames"
    whole = full.renderer.render(scene, camera.resized(32), samples=4, shading="pixel")
    np.testing.assert_array_equal(image.pixels, whole.pixels)
    assert full.radiance("b", scene, camera.resized(32), 4, frame=2000) is image


def test_an_error_is_told_and_the_next_image_is_made(workspace: Workspace, context: moderngl.Context) -> None:
    full = FullPictures()
    full.start(context)
    camera = workspace.scene.cameras[0]
    thin = replace(camera, lens=replace(camera.lens, f_stop=4.0, focus_distance=0.4))
    with pytest.raises(BrightfieldError, match="thin lens"):
        full.radiance("thin", workspace.scene, thin, 1, frame=1)
    end = time.monotonic() + 60
    while (image := full.radiance("whole", workspace.scene, camera, 4, frame=1)) is None:
        assert time.monotonic() < end
    assert image.pixels.shape == (48, 64, 3)
