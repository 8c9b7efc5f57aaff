"""`render --moments`: a plate that moves under a flash, exactly, against the pass motion and between the renderers."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from composer.cli import main
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.formats import exr, gprims, images
from interchange.formats.usd_author import author_scene
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from interchange.strobe import Strobe

PX, PITCH = 48, 2e-3
STEP = 24e-3  # m that the plate moves from frame to frame, of 0.1 s: 12 px
LAMP = Light("/World/lamp", LightKind.DISTANT, (4.0, 4.0, 4.0))


def written(file: Path, light: Light, line_time: float = 0.0, frame_rate: float = 0.0) -> str:
    sensor = Sensor(
        (PX, PX), (PITCH, PITCH), responsivity=1e4, full_well=1e4, line_time=line_time, frame_rate=frame_rate
    )
    camera = Camera(
        "/World/camera", look_at(np.array([0, 0, 1.0]), np.zeros(3), up=(0, 1, 0)),
        Lens(projection=Projection.ORTHOGRAPHIC), sensor, t_exp=0.05,
    )  # fmt: skip
    matte = Material("matte", Lambert(0.5))
    frames = []
    for k in range(4):
        pose = np.eye(4)
        pose[0, 3] = (k - 1.5) * STEP
        plate = Body("/World/plate", gprims.plane(0.03, 0.3), matte, pose)
        frames.append(Scene((plate,), (light,), (camera,), seconds=0.1 * k))
    stage = author_scene(frames[0], frames=frames[1:])
    stage.GetRootLayer().Export(str(file))
    return str(file)


def columns(image: Path) -> np.ndarray:
    return images.read(image).astype(float).mean(axis=2)


def middle(row: np.ndarray) -> float:
    return float((row * np.arange(PX)).sum() / row.sum())


def test_moments_are_the_pass_motion_made_exact(tmp_path: Path) -> None:
    by_pass = written(tmp_path / "pass.usda", LAMP, frame_rate=10.0)
    how = ["--time", "1", "--samples", "4", "--noise-free"]
    assert main(["render", by_pass, *how, "--out", str(tmp_path / "pass.png")]) == 0
    assert main(["render", by_pass, *how, "--moments", "24", "--out", str(tmp_path / "moments.png")]) == 0
    offline = ["--offline", "--bounces", "0", "--moments", "24"]
    assert main(["render", by_pass, *how, *offline, "--out", str(tmp_path / "true.png")]) == 0
    a, b, c = (columns(tmp_path / f"{n}.png")[PX // 2] for n in ("pass", "moments", "true"))
    where = (PX - 1) / 2 - 0.5 * STEP / PITCH  # the frame's own time is the middle of its exposure
    assert [middle(x) for x in (a, b, c)] == pytest.approx([where] * 3, abs=0.05)
    assert np.abs(b - c).max() < 0.03 * b.max()  # edges of four samples a pixel
    assert np.count_nonzero((b > 0.05 * b.max()) & (b < 0.95 * b.max())) >= 10  # 6 px of path on either side
    assert np.abs(a - b).sum() < 0.15 * b.sum()  # the pass moves what stands behind the plate too little


def test_a_flash_freezes_and_rows_show_it_where_it_is(tmp_path: Path) -> None:
    """1 ms of light 100 ms + 30 ms after the first frame; rows are 1 ms late each, and only some are exposed then."""
    flash = replace(LAMP, strobe=Strobe(0.13, 1e-3, overdrive=50.0))
    file = written(tmp_path / "flash.usda", flash, line_time=1e-3)
    out = ["--time", "1", "--samples", "16", "--moments", "97", "--out", str(tmp_path / "flash.exr")]
    assert main(["render", file, *out]) == 0
    image = exr.read(tmp_path / "flash.exr")
    assert image.made_by["moments"] == 97
    rows = image.pixels[..., 0]
    lit = rows.max(axis=1) > 1e-3 * rows.max()
    # row r is exposed from 100 + r ms for 50 ms: the flash is over before rows from 31 on begin
    assert np.flatnonzero(lit).tolist() == list(range(31))
    places = [middle(row) for row in rows[:30]]
    assert np.ptp(places) < 1e-3
    where = (PX - 1) / 2 + (-0.5 + (0.0305 - 0.025) / 0.1) * STEP / PITCH
    assert places[0] == pytest.approx(where, abs=0.13)  # half a sample, of four along a pixel


def test_moments_refuse_what_they_have_not(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path / "scene.usda", LAMP)
    out = ["--time", "1", "--out", str(tmp_path / "a.exr")]
    for words, message in (
        (["--moments", "0"], "--moments must lie in [1, 10000]; got 0"),
        (["--moments", "2", "--per-light"], "Give --per-light or --moments, not both"),
        (["--moments", "2", "--passes", "direct"], "An image of several moments has no pass direct"),
    ):
        assert main(["render", file, *words, *out]) == 2
        assert message in capsys.readouterr().err
