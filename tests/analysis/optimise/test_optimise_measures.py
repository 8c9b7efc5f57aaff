"""Measures of set-ups against closed forms, and a noise model against frames that are drawn."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ndtr

from analysis.optimise.measures import MODELS
from analysis.optimise.measures.defect_visibility import DefectVisibility
from analysis.optimise.measures.depth_of_field import DepthOfField
from analysis.optimise.measures.edge_contrast import EdgeContrast
from analysis.optimise.measures.evenness import Evenness
from analysis.optimise.measures.scale import Scale
from analysis.optimise.measures.uncertainty import Uncertainty
from analysis.optimise.noise import Signal, signal
from analysis.optimise.session import drawn
from analysis.optimise.view import Unseen, View
from analysis.tune.truth import EdgeTruth
from analysis.tune.wireframe import Wires
from analysis.view.footprint import Footprint
from analysis.view.optics import depth_of_field
from interchange.brdf.lambert import Lambert
from interchange.camera import Camera, Lens, Sensor
from interchange.exposure import expose
from interchange.frames import look_at
from interchange.image import Image
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import from_corners
from interchange.scene import Body, Scene
from interchange.sensor import Mosaic
from realtime.renderers.rasterizer import Rasterizer

SHAPE = (60, 80)
SENSOR = Sensor(
    (80, 60), (5e-6, 5e-6), responsivity=2e5, full_well=9000, bit_depth=12, read_noise=12, prnu=0.01,
    mosaic=Mosaic.MONO,
)  # fmt: skip


def view(**known: object) -> View:
    """A view that has been worked out already."""
    made = object.__new__(View)
    made.__dict__.update({"camera": Camera(sensor=SENSOR), "runs": 1, **known})
    if "signals" in known:
        made.__dict__["signal"] = known["signals"][0]  # type: ignore[index]
    return made


def flat(value: float, sigma: float) -> Signal:
    return Signal(np.full(SHAPE, value), np.full(SHAPE, sigma), np.zeros(SHAPE, bool))


def vertical_edge(middle: float = 40.0) -> EdgeTruth:
    y = np.arange(5.0, 55.0)
    points = np.stack([np.full_like(y, middle), y], -1)
    return EdgeTruth(points, np.tile([1.0, 0.0], (len(y), 1)), np.zeros(len(y), int))


def prints(scale: float) -> Footprint:
    plane = np.full(SHAPE, scale)
    return Footprint(plane, plane, plane, plane**2, 0 * plane, 0 * plane)


def step(low: float, high: float, blur: float) -> np.ndarray:
    x = np.arange(80.0)[None].repeat(60, 0)
    return low + (high - low) * ndtr((x - 40.0) / blur)


def test_every_measure_says_what_it_is() -> None:
    assert len(MODELS) >= 7
    for name, model in MODELS.items():
        assert model.best in ("high", "low"), name
        assert model.unit, name
        assert model.meaning, name


def test_the_noise_is_that_of_frames_that_are_drawn() -> None:
    camera = Camera(sensor=SENSOR, t_exp=0.02)
    image = Image(np.full((60, 80, 3), 0.5, np.float32), camera=camera)
    told = signal(image, camera)
    rng = np.random.default_rng(0)
    frames = np.stack([expose(image, camera, rng=rng).pixels[..., 0] for _ in range(60)])
    dn = told.sigma * SENSOR.K
    temporal = np.sqrt(frames.var(axis=0, ddof=1).mean())
    spread = frames.mean(axis=0).std()  # PRNU, and what is left of the temporal noise
    # 4800 pixels, 60 frames: the rms is told within 0.2 %; PRNU's by 4800 pixels within 1 %
    whole = np.hypot(temporal, np.sqrt(max(spread**2 - temporal**2 / 60, 0)))
    assert whole == pytest.approx(dn.mean(), rel=0.02)
    assert not told.saturated.any()
    assert signal(replace(image, pixels=image.pixels * 10), camera).saturated.all()


@pytest.mark.parametrize(("blur", "noise"), [(1.0, 10.0), (0.8, 40.0)])
def test_the_uncertainty_of_a_blurred_step_is_its_bound(blur: float, noise: float) -> None:
    low, high, scale = 1000.0, 3000.0, 0.05e-3  # m a pixel
    known = Signal(step(low, high, blur), np.full(SHAPE, noise), np.zeros(SHAPE, bool))
    found = Uncertainty(along=1.0).of(view(signals=[known], edges=vertical_edge(), footprint=prints(scale)))
    # Σ (de/dx)² = A² / (2 √π s) for a Gaussian slope; 20 px of edge are averaged over 1 mm
    bound = noise * np.sqrt(2 * np.sqrt(np.pi) * blur) / (high - low) * scale / np.sqrt(20) * 1e6
    # slopes are differences over a pixel of linearly interpolated profiles, which a step of 0.8 px rms feels
    assert found == pytest.approx(bound, rel=0.12)


def test_the_bound_holds_for_an_edge_that_is_fitted() -> None:
    """Places of a known profile fitted to noisy ones scatter by the bound, not by less."""
    blur, noise, scale = 1.0, 60.0, 0.1e-3
    clean = step(1000, 3000, blur)
    known = Signal(clean, np.full(SHAPE, noise), np.zeros(SHAPE, bool))
    told = Uncertainty(along=0.1).of(view(signals=[known], edges=vertical_edge(), footprint=prints(scale)))
    rng = np.random.default_rng(1)
    rows = clean[:1] + noise * rng.standard_normal((4000, 80))
    slope = 2000 * np.exp(-0.5 * ((np.arange(80) - 40) / blur) ** 2) / (blur * np.sqrt(2 * np.pi))
    places = -((rows - clean[0]) @ slope) / (slope @ slope)  # one Gauss-Newton step from the truth
    assert told == pytest.approx(places.std() * scale * 1e6, rel=0.12)


def test_contrast_is_the_step_over_the_noise_of_both_sides() -> None:
    known = Signal(step(1000, 2500, 0.3), np.full(SHAPE, 25.0), np.zeros(SHAPE, bool))
    found = EdgeContrast().of(view(signals=[known], edges=vertical_edge()))
    assert found == pytest.approx(1500 / (25 * np.sqrt(2)), rel=0.01)


def test_the_separation_of_a_disc_is_its_closed_form() -> None:
    bad = flat(2000, 30)
    disc = np.hypot(*(np.indices(SHAPE) - np.array([30, 40])[:, None, None])) <= 5
    bad = replace(bad, electrons=bad.electrons + 12.0 * disc)
    found = DefectVisibility(clutter=0.0).of(view(signals=[flat(2000, 30)], defective_signals=[bad]))
    assert found == pytest.approx(12 * np.sqrt(disc.sum()) / 30)
    busy = DefectVisibility(clutter=0.02).of(view(signals=[flat(2000, 30)], defective_signals=[bad]))
    assert busy == pytest.approx(12 * np.sqrt(disc.sum()) / 50)  # 30² + 40²


def test_two_noisy_renderings_separate_without_bias_and_one_does_not() -> None:
    rng = np.random.default_rng(2)
    disc = np.hypot(*(np.indices(SHAPE) - np.array([30, 40])[:, None, None])) <= 5
    true = 12 * np.sqrt(disc.sum()) / 30

    def noisy(more: np.ndarray | float = 0.0) -> Signal:
        return Signal(
            2000 + more + 6 * rng.standard_normal(SHAPE), np.full(SHAPE, 30.0), np.zeros(SHAPE, bool)
        )

    one, two = [], []
    for _ in range(60):
        good, bad = [noisy(), noisy()], [noisy(12.0 * disc), noisy(12.0 * disc)]
        own = DefectVisibility(clutter=0.0)
        one.append(own.of(view(signals=good[:1], defective_signals=bad[:1])) ** 2)
        two.append(own.of(view(signals=good, defective_signals=bad, runs=2)) ** 2)
    # a square of noise adds 2 · 6² / 30² a pixel, 384 in all; a product of two runs adds nothing
    assert np.mean(two) == pytest.approx(true**2, abs=4 * np.std(two) / np.sqrt(60))
    assert np.mean(one) > true**2 + 300


def test_evenness_leaves_out_the_rim_and_steep_surfaces() -> None:
    on = np.zeros(SHAPE, bool)
    on[10:50, 10:70] = True
    electrons = np.where(on, 1000.0, 0.0)
    electrons[10:12] = 5000.0  # within 2 px of the rim
    steep = prints(1e-4)
    slant = np.zeros(SHAPE)
    slant[:, 40:] = 1.2
    electrons[:, 40:] *= 0.1
    known = Signal(electrons, electrons, np.zeros(SHAPE, bool))
    found = Evenness().of(view(signals=[known], on_part=on, footprint=replace(steep, slant=slant)))
    assert found == pytest.approx(1.0)
    with pytest.raises(Unseen):
        Evenness().of(view(signals=[known], on_part=np.zeros(SHAPE, bool), footprint=steep))


@pytest.fixture(scope="module")
def plate() -> tuple[Scene, Camera]:
    corners = 0.02 * np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    mesh = from_corners(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    lamp = Light("/World/Lamp", LightKind.SPHERE, (0.2,) * 3, look_at(np.array([0, 0, 0.4]), np.zeros(3)))
    camera = Camera(
        "/World/Camera", look_at(np.array([0, 0, 0.25]), np.zeros(3), (0, 1, 0)), Lens(16e-3, 4.0, 0.25),
        replace(SENSOR, resolution=(112, 112), pixel_pitch=(30e-6, 30e-6)), t_exp=0.01,
    )  # fmt: skip
    return Scene(
        (Body("/World/Plate", mesh, Material("m", Lambert((0.5,) * 3))),), (lamp,), (camera,)
    ), camera


def test_scale_and_depth_of_field_of_a_rendered_plate(plate: tuple[Scene, Camera]) -> None:
    scene, camera = plate
    with Rasterizer() as live:
        seen = View(scene, camera, ["Plate"], drawn(live, 4), live, Wires(0.5))
        assert Scale().of(seen) == pytest.approx(0.25 * 30e-6 / 16e-3 * 1e3, rel=1e-4)
        told = depth_of_field(camera, 1.0)
        assert DepthOfField().of(seen) == pytest.approx(1e3 * (told.far - told.near))
        assert len(seen.edges.points) == pytest.approx(4 * 0.04 / (0.25 * 30e-6 / 16e-3), rel=0.02)
        assert EdgeContrast().of(seen) > 10
        away = replace(camera, world_from_camera=look_at(np.array([0, 0, 0.25]), np.array([0, 0, 1.0])))
        with pytest.raises(Unseen):
            Scale().of(View(scene, away, ["Plate"], drawn(live, 4), live, Wires(0.5)))
