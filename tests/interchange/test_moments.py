"""An exposure of several moments: an edge that moves, under every shutter and flash, against where it is."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.camera import Camera, Sensor
from interchange.image import Image
from interchange.lamps.exposed import exposed
from interchange.light import Light, LightKind
from interchange.moments import over_exposure
from interchange.problems import BrightfieldError
from interchange.scene import Scene
from interchange.strobe import Strobe

RATE = 50.0  # time codes a second
SPEED = 2000.0  # px/s
T_EXP = 10e-3
WIDTH, HEIGHT = 128, 9


def edge(scene: Scene, camera: Camera, k: int, passes: tuple[str, ...]) -> Image:
    """A renderer of one edge at column 64 + SPEED · t, box-filtered, of radiance as bright as the lamp."""
    lit, rows = exposed(scene, camera)
    at = 64 + SPEED * scene.time / RATE
    row = np.clip(np.arange(WIDTH) + 0.5 - at, 0, 1).astype(np.float32)
    light = np.float32(sum(x.intensity[0] for x in lit.lights)) * np.broadcast_to(
        row[None, :, None], (HEIGHT, WIDTH, 3)
    )
    assert not rows  # slices have no rolling shutter
    return Image(light, camera=camera, made_by={"k": k}, passes={name: light[..., 0] for name in passes})


def image(strobe: Strobe = Strobe(), line_time: float = 0.0, count: int = 400, time: float = 0.0) -> Image:  # noqa: B008
    camera = Camera("/eye", sensor=Sensor((WIDTH, HEIGHT), line_time=line_time), t_exp=T_EXP)
    lamp = Light("/lamp", LightKind.SPHERE, (1.0, 1.0, 1.0), strobe=strobe)

    def scene_at(code: float) -> Scene:
        return Scene(lights=(lamp,), cameras=(camera,), time=code, seconds=code / RATE)

    return over_exposure(scene_at, lambda s: s.cameras[0], edge, time, RATE, count, ("depth",))


def place(row: np.ndarray) -> float:
    return WIDTH - 0.5 - float(row.sum() / row.max())


def test_an_edge_is_blurred_along_its_path() -> None:
    row = image().pixels[3, :, 0]
    assert place(row) == pytest.approx(64, abs=0.02)  # the frame's time is the middle
    ramp = np.clip((np.arange(WIDTH) + 0.5 - 64 + SPEED * T_EXP / 2) / (SPEED * T_EXP), 0, 1)
    assert row == pytest.approx(ramp, abs=0.05 / 2 + 1 / 400)  # a pixel is a twentieth of the path


def test_a_rolling_shutters_rows_lean() -> None:
    pixels = image(line_time=1e-3).pixels
    places = [place(row[:, 0]) for row in pixels]
    assert np.diff(places) == pytest.approx(np.full(HEIGHT - 1, SPEED * 1e-3), abs=0.1)
    assert pixels.max() == pytest.approx(1, abs=1e-5)  # a row's shares add up


def test_a_flash_freezes_all_rows_at_once() -> None:
    """0.5 ms of light, 9 ms into an exposure whose rows start 1 ms after each other."""
    frame = image(Strobe(9e-3, 5e-4, overdrive=20.0), line_time=1e-3, count=360)
    assert frame.pixels[:, -1, 0] == pytest.approx(np.ones(HEIGHT), abs=1e-4)  # 20 times for a 20th of it
    for row in frame.pixels[..., 0]:
        assert place(row) == pytest.approx(64 + SPEED * (9.25e-3 - T_EXP / 2), abs=0.05)
        assert np.count_nonzero((row > 0.02) & (row < 0.98)) <= 3


def test_a_triggered_flash_goes_by_the_frames_own_clock() -> None:
    flash = Strobe(9e-3, 5e-4, overdrive=20.0)
    first = image(flash, line_time=1e-3, count=36)
    later = image(replace(flash, triggered=True), line_time=1e-3, count=36, time=0.2)
    assert later.pixels[:, -1] == pytest.approx(first.pixels[:, -1], abs=1e-5)
    assert place(later.pixels[0, :, 0]) - place(first.pixels[0, :, 0]) == pytest.approx(
        SPEED * 0.2 / RATE, abs=0.05
    )


def test_bands_are_where_the_flash_meets_a_row() -> None:
    flash = Strobe(15e-3, 2e-3)
    lit = image(flash, line_time=1e-3, count=360).pixels[:, -1, 0]
    late = 1e-3 * np.arange(HEIGHT)
    assert lit == pytest.approx(np.clip(late + T_EXP - 15e-3, 0, 2e-3) / T_EXP, abs=1e-5)


def test_what_the_image_says_of_itself() -> None:
    frame = image(Strobe(0, 1e-3), count=5)
    assert frame.made_by["moments"] == 5
    assert frame.made_by["strobed"]["t_exp_s"] == T_EXP
    assert list(frame.passes) == ["depth"]
    assert frame.camera is not None
    assert frame.camera.t_exp == T_EXP


def test_what_no_moment_has_is_refused() -> None:
    camera = Camera("/eye", sensor=Sensor((4, 4)), t_exp=T_EXP)
    scene = Scene(cameras=(camera,))

    def asked(passes: tuple[str, ...], one: Camera) -> Image:
        return over_exposure(lambda _: scene, lambda _: one, edge, 0.0, RATE, 4, passes)

    with pytest.raises(BrightfieldError, match="has no pass direct, light"):
        asked(("depth", "direct", "light"), camera)
    with pytest.raises(BrightfieldError, match="lasts longer than 0 s; got 4 in 0 s"):
        asked((), replace(camera, t_exp=0.0))
