"""Lamps that flash: both renderers, live cameras and the command line give what each row's share says."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from composer.cli import main
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.exposure import expose
from interchange.formats import exr, gprims, images
from interchange.formats.usd_author import author_scene
from interchange.frames import look_at
from interchange.lamps.exposed import shares
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from interchange.strobe import Strobe
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer
from realtime.virtual_camera.camera import VirtualCamera

PX, WIDTH = 24, 0.2
DIRECT = CyclesSettings(samples=4, max_bounces=0)
ROLLING = Sensor(
    (PX, PX), (WIDTH / PX,) * 2, responsivity=1e6, full_well=8e3, bit_depth=12, black_level=16.0, line_time=1e-4
)  # fmt: skip
CAMERA = Camera(
    "/World/camera",
    look_at(np.array([0, 0, 2.0]), np.zeros(3), up=(0, 1, 0)),
    Lens(projection=Projection.ORTHOGRAPHIC),
    ROLLING,
    t_exp=5e-4,
)
FLASH = Strobe(8e-4, 3e-4, overdrive=4.0)


def at(x: float, y: float, z: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return pose


def scene(strobe: Strobe, camera: Camera = CAMERA) -> Scene:
    """A matte plane under two points of light, of which one flashes."""
    plane = Body("/World/plane", gprims.plane(1.0, 1.0), Material("/World/Materials/matte", Lambert(0.5)))
    lamps = (
        Light("/World/flash", LightKind.SPHERE, (20.0, 15.0, 10.0), at(0.1, 0, 1), strobe=strobe),
        Light("/World/steady", LightKind.SPHERE, (2.0, 2.0, 2.0), at(-0.1, 0, 1)),
    )
    return Scene((plane,), lamps, (camera,))


@pytest.fixture(scope="module")
def rasterizer():
    with Rasterizer() as renderer:
        yield renderer


@pytest.fixture(scope="module")
def cycles():
    with Cycles(timeout=120) as renderer:
        yield renderer


def expected(one: Scene, camera: Camera, rasterizer: Rasterizer) -> np.ndarray:
    """Radiance by the definition, of steady lamps rendered one by one."""
    total = np.zeros((PX, PX, 3))
    for light in one.lights:
        alone = replace(one, lights=(replace(light, strobe=Strobe()),))
        share = shares(light.strobe, camera, one.seconds)[:, None, None]
        total += rasterizer.render(alone, camera, samples=1).pixels * share
    return total


@pytest.mark.parametrize("line_time", [0.0, 1e-4])
def test_both_renderers_give_each_row_its_share(rasterizer, cycles, line_time: float) -> None:
    """A flash of 0.3 ms in exposures of 0.5 ms, all at once or 0.1 ms from row to row; no noise in either renderer."""
    camera = replace(CAMERA, sensor=replace(ROLLING, line_time=line_time))
    one = scene(replace(FLASH, start=1e-4 if line_time == 0 else 8e-4), camera)
    law = expected(one, camera, rasterizer)
    live = rasterizer.render(one, camera, ("light", "direct"), samples=1)
    true = cycles.render(one, camera, DIRECT, ("direct", "depth"))
    assert live.pixels == pytest.approx(law, rel=1e-5)
    assert live.passes["direct"] == pytest.approx(law, rel=1e-5)
    assert live.passes["light:/World/flash"] + live.passes["light:/World/steady"] == pytest.approx(
        law, rel=1e-5
    )
    assert sorted(true.passes) == ["depth", "direct"]
    assert true.passes["direct"] == pytest.approx(true.pixels, rel=1e-5)
    a, b = (expose(image).pixels for image in (live, true))
    assert np.abs(a - b).max() <= 2  # of 4095 DN: two roundings
    flash = live.passes["light:/World/flash"].mean(axis=(1, 2)) > 0
    # a row r sees light where [0.8, 1.1] ms meets [0.1 r, 0.1 r + 0.5] ms
    assert np.flatnonzero(flash).tolist() == (list(range(4, 11)) if line_time else list(range(PX)))
    assert a.max() < 4095


def test_reflected_light_has_bands_too(cycles) -> None:
    """A wall beside the plane: with the pass indirect, and without it, the sum is the same."""
    one = scene(FLASH)
    wall = Body(
        "/World/wall", gprims.plane(1, 1), one.bodies[0].material,
        look_at(np.array([-0.1, 0, 0]), np.array([1.0, 0, 0])),
    )  # fmt: skip
    one = replace(one, bodies=(*one.bodies, wall))
    settings = CyclesSettings(samples=16, max_bounces=1)
    image = cycles.render(one, CAMERA, settings, ("direct", "indirect"))
    assert sorted(image.passes) == ["direct", "indirect"]
    assert image.passes["direct"] + image.passes["indirect"] == pytest.approx(image.pixels, abs=1e-6)
    lit = image.passes["indirect"].mean(axis=(1, 2))
    assert lit[4:11].min() > 2 * np.delete(lit, slice(4, 11)).max()  # the flash bounces in its own rows


def test_a_backlight_that_flashes_has_bands(rasterizer, cycles) -> None:
    lamp = Light(
        "/World/back", LightKind.RECT, (1e-3,) * 3, np.diag([1.0, -1, -1, 1]), width=0.1, height=0.3,
        visible=True, strobe=FLASH,
    )  # fmt: skip
    one = Scene((), (lamp,), (CAMERA,))
    law = np.broadcast_to(lamp.radiance * shares(FLASH, CAMERA, 0)[:, None, None], (PX, PX, 3))
    for image in (
        rasterizer.render(one, CAMERA, samples=16),
        cycles.render(one, CAMERA, DIRECT),
    ):
        assert image.pixels[:, 8:16] == pytest.approx(law[:, 8:16], rel=1e-4)
        assert not image.pixels[:, :5].any()


def test_a_live_camera_flashes_by_its_own_clock() -> None:
    """Frames of 10 ms: every second one meets a flash of 20 ms; a triggered lamp lights all."""
    sensor = replace(ROLLING, line_time=0.0)
    camera = replace(CAMERA, sensor=sensor)
    flash = Strobe(1e-4, 2e-4, 0.02, 5.0)
    means = {}
    for triggered in (False, True):
        one = scene(replace(flash, triggered=triggered), camera)
        with VirtualCamera(one, samples=1, noise=False, frame_rate=100.0, format="RGB8") as live:
            means[triggered] = [float(live.read()[1].mean()) for _ in range(4)]
    bright, dark = means[False][0], means[False][1]
    assert bright > 2 * dark
    assert means[False] == pytest.approx([bright, dark, bright, dark])
    assert means[True] == pytest.approx([bright] * 4)


def test_the_command_line_renders_flashes(
    rasterizer, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "scene.usda"
    stage = author_scene(scene(FLASH))
    stage.GetRootLayer().Export(str(file))
    frame = ["render", str(file), "--noise-free", "--samples", "1"]
    assert main([*frame, "--out", str(tmp_path / "own.png")]) == 0
    rows = images.read(tmp_path / "own.png").astype(float).mean(axis=(1, 2))
    bands = expose(rasterizer.render(scene(FLASH), CAMERA, samples=1)).pixels.mean(axis=(1, 2))
    assert rows == pytest.approx(bands, abs=1)

    # another shutter than the scene's is known before anything is drawn
    assert main([*frame, "--exposure", "0.001", "--out", str(tmp_path / "long.png")]) == 0
    longer = replace(CAMERA, t_exp=1e-3)
    law = expose(rasterizer.render(scene(FLASH), longer, samples=1)).pixels.mean(axis=(1, 2))
    assert images.read(tmp_path / "long.png").astype(float).mean(axis=(1, 2)) == pytest.approx(law, abs=1)
    rolling = ["--effect", "rolling_shutter", "line_time=0"]
    assert main([*frame, *rolling, "--out", str(tmp_path / "global.png")]) == 0
    assert np.ptp(images.read(tmp_path / "global.png").astype(float).mean(axis=(1, 2))) < 30

    offline = [*frame[:-1], "4", "--offline", "--bounces", "0", "--exposure", "0.001"]
    assert main([*offline, "--out", str(tmp_path / "offline.png")]) == 0
    assert images.read(tmp_path / "offline.png").astype(float).mean(axis=(1, 2)) == pytest.approx(law, abs=1)

    # an image that is there cannot get another shutter
    assert main([*frame, "--out", str(tmp_path / "own.exr")]) == 0
    assert exr.read(tmp_path / "own.exr").made_by["strobed"]["t_exp_s"] == pytest.approx(5e-4)
    capsys.readouterr()
    assert (
        main(["expose", str(tmp_path / "own.exr"), "--exposure", "0.1", "--out", str(tmp_path / "a.png")])
        == 2
    )
    assert "an exposure of 0.0005 s; got 0.1 s. Render it with that" in capsys.readouterr().err
    assert main(["info", str(file)]) == 0
    assert "t_0 0.0008 s, T 0.0003 s, k 4" in capsys.readouterr().out
