"""The camera's image from the command line, and the same DN from both renderers."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from composer.cli import main
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.effects.line_scan import LineScan
from interchange.effects.vignetting import Vignetting
from interchange.exposure import expose
from interchange.formats import exr, gprims, images
from interchange.formats.document import Document, open_scene
from interchange.formats.usd_author import author_scene
from interchange.frames import look_at
from interchange.image import Image, Quantity
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.scene import Body, Scene
from offline.renderers.cycles import Cycles
from offline.settings import CyclesSettings
from realtime.renderers.rasterizer import Rasterizer

SENSOR = Sensor(
    (48, 36),
    (1e-4, 1e-4),
    responsivity=4e4,
    full_well=20000,
    bit_depth=12,
    black_level=64,
    read_noise=5,
    prnu=0.005,
    dsnu=1,
    serial_number="7",
)
LENS = Lens(16e-3, vignetting=(-0.2,), veiling_glare=(0.01,))
CAMERA = Camera("Top", look_at(np.array([0, 0, 0.4]), np.zeros(3)), LENS, SENSOR, t_exp=0.1)
LAMP = np.eye(4)
LAMP[:3, 3] = 0.1, 0.05, 0.3


def scene(camera=CAMERA):
    plate = Body("plate", gprims.plane(0.2, 0.2), Material("matte", Lambert((0.5, 0.3, 0.2))))
    ball = Body("ball", gprims.box(0.02), Material("red", Lambert((0.6, 0.1, 0.1))))
    return Scene((plate, ball), (Light("Lamp", LightKind.SPHERE, (1, 1, 1), LAMP),), (camera,))


@pytest.fixture
def usd(tmp_path):
    Document(author_scene(scene(), 0.001, [scene()]), Path("memory")).save(tmp_path / "s.usda")
    return tmp_path / "s.usda"


def test_a_frame_is_written_in_dn(usd, tmp_path):
    """PNG and TIFF hold the same 12 bits, which are what ``expose`` makes of the rendering."""
    frames = []
    for name in ("a.png", "b.tiff"):
        assert (
            main(["render", str(usd), "--time", "0", "--out", str(tmp_path / "out" / name), "--noise-free"])
            == 0
        )
        frames.append(images.read(tmp_path / "out" / name))
    assert frames[0].dtype == np.uint16
    assert frames[0].shape == (36, 48, 3)
    assert np.array_equal(*frames)
    assert np.array_equal(
        cv2.imread(str(tmp_path / "out/b.tiff"), cv2.IMREAD_UNCHANGED)[..., ::-1], frames[1]
    )
    loaded = open_scene(usd).scene(0)
    want = expose(Rasterizer().render(loaded, loaded.camera(), samples=16)).pixels
    assert np.abs(frames[0] - want).max() <= 1  # EXR's floats, and one rounding
    assert 200 < frames[0].mean() < 3000


def test_frames_differ_by_their_noise_and_a_seed_repeats_them(usd, tmp_path):
    assert main(["render", str(usd), "--frames", "all", "--out", str(tmp_path / "f"), "--dn", "png"]) == 0
    a, b = (images.read(f).astype(float) for f in sorted((tmp_path / "f").glob("*.png")))
    noise = (a - b).std() / np.sqrt(2)
    assert noise == pytest.approx(np.sqrt(SENSOR.K * (a.mean() - 64) + (SENSOR.K * 5) ** 2), rel=0.1)
    again = tmp_path / "again.png"
    first = min((tmp_path / "f").glob("*.exr"))
    assert main(["expose", str(first), "--out", str(again)]) == 0
    assert np.array_equal(images.read(again), a)


def test_exposure_gain_and_another_sensor_are_options(usd, tmp_path, capsys):
    out = tmp_path / "x.exr"
    assert main(["render", str(usd), "--time", "0", "--out", str(out)]) == 0
    sheet = tmp_path / "sheet.json"
    sheet.write_text(json.dumps({"bits": 8, "mosaic": "mono", "results": {"mu_e.sat": 2e4, "mu_y.dark": 4}}))

    def dn(name, *options):
        assert main(["expose", str(out), "--out", str(tmp_path / name), "--noise-free", *options]) == 0
        return images.read(tmp_path / name).astype(float)

    once = dn("a.png", "--exposure", "0.02")
    assert dn("b.png", "--exposure", "0.04") - 64 == pytest.approx(2 * (once - 64), abs=2)
    assert dn("c.tif", "--exposure", "0.02", "--gain", "6.0206") - 64 == pytest.approx(2 * (once - 64), abs=2)
    other = dn("d.png", "--sensor", str(sheet), "--exposure", "0.02")
    assert other.shape == (36, 48, 1)
    assert other.max() < 256
    assert main(["expose", str(out), "--out", str(tmp_path / "x.jpg")]) == 2
    assert "ends in .png, .tif, .tiff" in capsys.readouterr().err


def test_both_renderers_give_the_same_dn():
    """Direct light of a point lamp: without noise within 2 DN of 4095 away from edges; with it, differences that are
    noise and nothing else: χ² a pixel of 1."""
    place = scene()
    camera = place.camera()
    live = Rasterizer().render(place, camera, samples=16, passes=("object_id",))
    with Cycles(timeout=120) as cycles:
        true = cycles.render(place, camera, CyclesSettings(samples=64, max_bounces=0))
    ids = live.passes["object_id"].astype(np.uint8)
    inside = cv2.dilate(ids, np.ones((7, 7))) == cv2.erode(ids, np.ones((7, 7)))
    inside &= live.pixels[..., 0] > 0.9 * np.median(live.pixels[..., 0])  # out of the shadow and its edge
    assert inside.sum() > 500
    means = [expose(Image(i.pixels, camera=camera)).pixels[inside] for i in (live, true)]
    assert np.abs(means[0] - means[1]).max() <= 2
    assert abs((means[0] - means[1]).mean()) < 0.2
    rngs = np.random.default_rng(1), np.random.default_rng(2)
    frames = [expose(i, camera, rng=r).pixels[inside] for i, r in zip((live, true), rngs, strict=True)]
    mean = (means[0] + means[1]) / 2
    variance = SENSOR.K * (mean - 64) + (SENSOR.K * 5) ** 2 + 1 / 12
    chi2 = ((frames[0] - frames[1]) ** 2 / (2 * variance)).mean()
    assert chi2 == pytest.approx(1, abs=4 * np.sqrt(2 / frames[0].size) + 0.01)


def test_a_preview_and_dn_do_not_share_a_name(usd, tmp_path, capsys):
    words = ["render", str(usd), "--frames", "all", "--out", str(tmp_path / "f"), "--dn", "png", "--preview"]
    assert main(words) == 2
    assert "--dn tiff" in capsys.readouterr().err
    assert main(["render", str(usd), "--time", "0", "--out", str(tmp_path / "a.png"), "--dn", "png"]) == 2


def test_defocus_by_depth_is_what_the_renderer_draws():
    """A slanted plate of stripes, sharp in its middle: the pinhole's image defocused by its depth, against the
    rasteriser's own thin lens. The pinhole's edges are sharper than pixels can show, so that where they lie within a
    pixel is lost to what blurs them later: 3 % of the mean, of 23 % that the blur is."""
    stripes = []
    for k in range(30):
        pose = np.eye(4)
        pose[:3, :3] = cv2.Rodrigues(np.array([0.9, 0, 0]))[0]
        pose[:3, 3] = (k - 14.5) * 0.01, 0, 0
        albedo = (0.8, 0.8, 0.8) if k % 2 else (0.1, 0.1, 0.1)
        stripes.append(Body(f"s{k}", gprims.plane(0.01, 0.6), Material(f"m{k}", Lambert(albedo)), pose))
    lens = Lens(16e-3, f_stop=0.25, focus_distance=0.4)
    thin = replace(CAMERA, lens=lens, sensor=Sensor((96, 72), (7e-5, 7e-5)))
    pin = replace(thin, lens=Lens(16e-3))
    light = Light("Lamp", LightKind.SPHERE, (1, 1, 1), LAMP)
    rasterizer = Rasterizer()
    drawn = rasterizer.render(Scene(tuple(stripes), (light,), (thin,)), thin, samples=256)
    sharp = rasterizer.render(Scene(tuple(stripes), (light,), (pin,)), pin, samples=64, passes=("depth",))
    ours = expose(sharp, thin, until=Quantity.IRRADIANCE).pixels[..., 1]
    want = expose(drawn, thin, until=Quantity.IRRADIANCE).pixels[..., 1]
    unblurred = expose(sharp, pin, until=Quantity.IRRADIANCE).pixels[..., 1] * thin.lens.projected_solid_angle
    inner = (slice(6, -6), slice(10, -10))
    error = np.sqrt(np.mean((ours - want)[inner] ** 2)) / want[inner].mean()
    without = np.sqrt(np.mean((unblurred - want)[inner] ** 2)) / want[inner].mean()
    assert without > 0.15
    assert error < 0.04


def test_an_effect_of_the_chain_is_an_option(usd, tmp_path, capsys):
    """A line camera is no attribute of a camera: it is given by name, with its declared parameters."""
    out, png = tmp_path / "x.exr", tmp_path / "x.png"
    assert main(["render", str(usd), "--time", "0", "--out", str(out)]) == 0
    words = ["expose", str(out), "--out", str(png), "--noise-free", "--effect"]
    assert main([*words, "line_scan", "stretch=2", "open_share=0.5", "--effect", "vignetting", "a2=0"]) == 0
    want = expose(exr.read(out), effects=(LineScan(2, 0.5), Vignetting())).pixels
    assert np.array_equal(images.read(png), want)
    for wrong, said in (
        (["line_scn"], 'Did you mean "line_scan"?'),
        (["line_scan", "strech=2"], 'Did you mean "stretch"?'),
        (["line_scan", "stretch=two"], "must give stretch a number"),
        (["line_scan", "stretch=0"], "must lie in"),
    ):
        assert main([*words, *wrong]) == 2
        assert said in capsys.readouterr().err


def test_one_frame_is_blurred_by_what_moves_to_the_scenes_next(tmp_path):
    """Also where it alone or every other frame is rendered; the shutter is open for half of the time."""
    camera = replace(CAMERA, sensor=replace(SENSOR, frame_rate=5.0), lens=Lens(16e-3))
    steps = []
    for k in range(3):
        still = scene(camera)
        pose = np.eye(4)
        pose[0, 3] = 0.03 * k
        steps.append(
            replace(
                still, time=float(k), bodies=(still.bodies[0], replace(still.bodies[1], world_from_body=pose))
            )
        )
    Document(author_scene(steps[0], 0.001, steps[1:]), Path("memory")).save(tmp_path / "s.usda")
    loaded = open_scene(tmp_path / "s.usda")
    assert loaded.times == [0, 1, 2]
    assert [loaded.following(t) for t in (0, 0.5, 1, 2)] == [1, 1, 2, 3]
    now, then = loaded.scene(0), loaded.scene(1)
    rendered = Rasterizer().render(now, now.camera(), ["motion"], samples=16, next_scene=then)
    want = expose(rendered).pixels
    assert np.abs(want - expose(replace(rendered, passes={})).pixels).max() > 100
    path = str(tmp_path / "s.usda")
    assert main(["render", path, "--time", "0", "--out", str(tmp_path / "a.png"), "--noise-free"]) == 0
    assert (
        main(
            ["render", path, "--frames", "0:2:2", "--dn", "png", "--out", str(tmp_path / "f"), "--noise-free"]
        )
        == 0
    )
    for file in (tmp_path / "a.png", min((tmp_path / "f").glob("*.png"))):
        assert np.abs(images.read(file) - want).max() <= 1  # EXR's floats, and one rounding
