"""Radiance, irradiance, electrons and DN against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.effects import MODELS, chain
from interchange.effects.exposure import Exposure
from interchange.effects.sensor_noise import EXACT_BELOW
from interchange.effects.vignetting import Vignetting
from interchange.exposure import LIGHT, PLANCK, expose, responsivity
from interchange.image import Image, Quantity
from interchange.parameter import parameters
from interchange.problems import BrightfieldError


def flat(L, size=(64, 48), channels=3):
    return Image(np.full((size[1], size[0], channels), L, np.float32))


def station(lens=Lens(), **sensor):  # noqa: B008  # frozen
    return Camera(lens=lens, sensor=Sensor(**{"resolution": (64, 48), **sensor}))


@given(
    L=st.floats(0, 100),
    R=st.floats(1, 1e4),
    t=st.floats(1e-4, 1),
    full=st.floats(100, 1e5),
    bits=st.integers(8, 16),
    black=st.floats(0, 100),
    gain=st.floats(-12, 24),
)
@settings(max_examples=100, deadline=None)
def test_dn_are_the_contracts(L, R, t, full, bits, black, gain):
    """To one DN in 2^16: single precision rounds 24 bits, which may turn one rounding."""
    c = station(responsivity=R, full_well=full, bit_depth=bits, black_level=black)
    top = 2**bits - 1
    electrons = min(R * L * t, full)
    expected = np.clip(black + 10 ** (gain / 20) * electrons / full * (top - black), 0, top)
    got = expose(flat(L), c, t_exp=t, gain_dB=gain).pixels
    assert got.shape == (48, 64, 3)
    assert np.ptp(got) == 0
    assert got[0, 0, 0] == np.rint(got[0, 0, 0])
    assert abs(got[0, 0, 0] - expected) <= 0.5 + 2e-6 * top


def test_irradiance_is_that_of_a_lens():
    """E = τ π L / (4 N²): an f/2 lens that passes all light gives π/16 of the radiance."""
    c = station(Lens(f_stop=2.0, transmission=0.9))
    E = expose(flat(4.0), c, until=Quantity.IRRADIANCE)
    assert E.quantity is Quantity.IRRADIANCE
    assert E.pixels == pytest.approx(0.9 * np.pi * 4.0 / 16, rel=1e-6)


def test_dn_of_a_calibrated_sensor_do_not_depend_on_the_f_number():
    """The responsivity is calibrated with the lens as it is; f_stop alone says where it blurs."""
    dn = [expose(flat(0.7), station(Lens(f_stop=n), responsivity=5e3)).pixels for n in (0, 1.4, 8)]
    assert np.array_equal(dn[0], dn[1])
    assert np.array_equal(dn[0], dn[2])


def test_electrons_of_a_quantum_efficiency_are_photons():
    """Counted without the program: E A t / (h c / λ) photons on a pixel, η of them electrons."""
    c = Camera(
        lens=Lens(f_stop=4.0),
        sensor=Sensor((8, 8), (3e-6, 3e-6), responsivity=0, quantum_efficiency=0.6, wavelength_nm=530),
    )
    L, t = 0.8, 5e-3
    energy = np.pi / (4 * 16) * L * 9e-12 * t
    photons = energy / (PLANCK * LIGHT / 530e-9)
    e = expose(flat(L, (8, 8)), c, t_exp=t, until=Quantity.ELECTRONS)
    assert e.pixels == pytest.approx(0.6 * photons, rel=1e-6)
    assert photons == pytest.approx(4715, rel=1e-3)  # a millisecond scale that one can believe


@pytest.mark.parametrize(
    ("lens", "sensor", "message"),
    [
        (Lens(f_stop=4), Sensor(responsivity=0), "responsivity or a quantum efficiency"),
        (Lens(), Sensor(responsivity=0, quantum_efficiency=0.5), "f-number"),
        (
            Lens(f_stop=4, projection=Projection.ORTHOGRAPHIC),
            Sensor(responsivity=0, quantum_efficiency=0.5),
            "perspective",
        ),
    ],
)
def test_what_a_quantum_efficiency_needs_is_said(lens, sensor, message):
    with pytest.raises(BrightfieldError, match=message):
        responsivity(lens, sensor)


def test_a_channel_has_its_own_response():
    c = station(responsivity=1000.0, spectral_response=(0.5, 1.0, 0.25), mosaic="")
    e = expose(flat(2.0), c, until=Quantity.ELECTRONS).pixels[0, 0]
    assert e == pytest.approx([1000, 2000, 500])
    mono = expose(flat(2.0), replace(c, sensor=replace(c.sensor, mosaic="mono")), until=Quantity.ELECTRONS)
    assert mono.pixels.shape == (48, 64, 1)
    assert mono.pixels == pytest.approx(3500 / 3)


def test_a_monochrome_sensor_sees_grey_by_the_contract_whatever_acts_before_it():
    """Channels are averaged before the optics where that is the same: with and without it DN are equal."""
    L = np.random.default_rng(1).uniform(0, 2, (48, 64, 3)).astype(np.float32)
    c = station(Lens(vignetting=(-0.3,), blur=1.5), responsivity=3000, mosaic="mono")
    alike = expose(Image(L), c, until=Quantity.ELECTRONS).pixels
    E = expose(Image(L), c, until=Quantity.IRRADIANCE).pixels
    assert alike[..., 0] == pytest.approx(3000 * E.mean(axis=-1), rel=1e-5)


def test_photon_noise_is_poisson():
    """Mean equals variance; 3σ of 10⁶ draws are 0.3 % of the mean at λ = 1 and 0.42 % of the variance."""
    for electrons in (0.3, 5, EXACT_BELOW * 0.99, EXACT_BELOW * 1.01, 300, 9000):
        c = station(resolution=(1000, 1000), responsivity=electrons, full_well=1e6)
        e = expose(flat(1.0, (1000, 1000), 1), c, rng=np.random.default_rng(2), until=Quantity.ELECTRONS)
        x = e.pixels.astype(np.float64)
        assert x.mean() == pytest.approx(electrons, abs=4 * np.sqrt(electrons / 1e6))
        assert x.var() == pytest.approx(electrons, rel=4 * np.sqrt((2 + 1 / electrons) / 1e6))
        skew = ((x - x.mean()) ** 3).mean() / x.var() ** 1.5
        assert skew == pytest.approx(1 / np.sqrt(electrons), abs=0.03)


def test_the_normal_stand_in_of_photon_noise_is_as_near_as_it_says():
    """Distribution functions at whole electrons, with read noise of one electron, at the lowest mean of its use."""
    from scipy import stats

    from interchange.effects.sensor_noise import noisy

    lam, sigma = EXACT_BELOW, 1.0
    x = np.sort(noisy(np.full(4_000_000, lam, np.float32), sigma, np.random.default_rng(3)))
    k = np.arange(0, 100)
    at = np.arange(-5, 60, 0.25)
    exact = (stats.poisson.pmf(k, lam)[None, :] * stats.norm.cdf(at[:, None] - k[None, :], 0, sigma)).sum(
        axis=1
    )
    ours = np.searchsorted(x, at) / len(x)
    assert np.abs(ours - exact).max() < 0.0015 + 4 * 0.5 / np.sqrt(len(x))


def test_read_noise_and_dark_current_add_as_variances():
    c = station(resolution=(1000, 500), responsivity=0.001, read_noise=6.0, dark_current=100.0, full_well=1e5)
    e = expose(flat(0, (1000, 500), 1), c, t_exp=0.5, rng=np.random.default_rng(4), until=Quantity.ELECTRONS)
    assert e.pixels.mean() == pytest.approx(50, abs=0.05)
    assert e.pixels.var() == pytest.approx(36 + 50, rel=0.01)


def test_rounding_has_a_variance_of_a_twelfth():
    """A ramp of a thousandth of a DN a pixel: uniform errors. 3σ of 96 000 of them are 0.9 %."""
    L = np.linspace(0.1, 0.9, 96_000, dtype=np.float64).reshape(240, 400, 1).astype(np.float32)
    c = station(resolution=(400, 240), responsivity=1e4, full_well=1e4, bit_depth=8)
    dn = expose(Image(L), c).pixels
    error = dn - L.astype(np.float64) * 255
    assert error.var() == pytest.approx(1 / 12, rel=0.01)
    assert abs(error.mean()) < 0.005


def test_the_photon_transfer_curve_is_a_line_with_slope_k():
    """σ² - σ²_dark = K (µ - µ_dark), EMVA 1288 eq. 16; 20 levels of 40 000 px: K to 0.2 % (1σ), 0.7 % asked."""
    c = station(
        resolution=(200, 200), responsivity=1e4, full_well=12000, bit_depth=12, black_level=64, read_noise=8
    )
    rng = np.random.default_rng(5)
    mean, variance = [], []
    for L in [0.0, *np.linspace(0.02, 0.8, 20)]:
        a, b = (expose(flat(L, (200, 200), 1), c, rng=rng).pixels.astype(np.float64) for _ in range(2))
        mean.append((a.mean() + b.mean()) / 2)
        variance.append((a - b).var() / 2)
    x, y = np.array(mean[1:]) - mean[0], np.array(variance[1:]) - variance[0]
    assert (x * y).sum() / (x * x).sum() == pytest.approx(c.sensor.K, rel=0.007)
    assert np.sqrt(variance[0] - 1 / 12) / c.sensor.K == pytest.approx(8, rel=0.02)


def test_the_fixed_pattern_belongs_to_the_serial_number():
    c = station(
        resolution=(300, 200), responsivity=5000, prnu=0.01, dsnu=4.0, serial_number="21884", full_well=1e5
    )
    first = expose(flat(1.0, (300, 200), 1), c, until=Quantity.ELECTRONS).pixels
    again = expose(flat(1.0, (300, 200), 1), c, until=Quantity.ELECTRONS).pixels
    assert np.array_equal(first, again)
    other = replace(c, sensor=replace(c.sensor, serial_number="21885"))
    third = expose(flat(1.0, (300, 200), 1), other, until=Quantity.ELECTRONS).pixels
    assert abs(np.corrcoef(first.ravel(), third.ravel())[0, 1]) < 0.02
    dark = expose(flat(0.0, (300, 200), 1), c, until=Quantity.ELECTRONS).pixels
    assert dark.std() == pytest.approx(4.0, rel=0.01)
    assert ((first - dark) / 5000).std() == pytest.approx(0.01, rel=0.01)


def test_rows_and_columns_have_their_own_pattern():
    """Spread of the means of rows and columns, less what pixels leave in them; 240 rows tell it to 5 % (1 sigma)."""
    c = station(
        resolution=(400, 240), responsivity=5000, prnu_row=0.01, prnu_column=0.02, full_well=1e5, dsnu=2.0,
        dsnu_row=6.0, dsnu_column=3.0, serial_number="21884",
    )  # fmt: skip
    L = flat(1.0, (400, 240), 1)
    bright, dark = (
        expose(x, c, until=Quantity.ELECTRONS).pixels[..., 0] for x in (L, flat(0, (400, 240), 1))
    )
    assert dark.mean(axis=1).std() == pytest.approx(6.0, rel=0.15)
    assert dark.mean(axis=0).std() == pytest.approx(3.0, rel=0.12)
    alone = dark - dark.mean(axis=0) - dark.mean(axis=1)[:, None]
    assert alone.std() == pytest.approx(2.0, rel=0.01)
    gain = (bright - dark) / 5000
    assert gain.mean(axis=1).std() == pytest.approx(0.01, rel=0.15)
    assert gain.mean(axis=0).std() == pytest.approx(0.02, rel=0.12)
    again = expose(L, c, until=Quantity.ELECTRONS).pixels[..., 0]
    assert np.array_equal(bright, again)


def test_rows_and_columns_are_noisy_as_a_whole_and_anew_in_every_frame():
    """Spread of the means of 480 rows and 640 columns: to 3.2 and 2.8 % (1 sigma); pixels leave 1 / sqrt(640) e-."""
    size = (640, 480)
    c = station(
        resolution=size, responsivity=0.0001, row_noise=5.0, column_noise=3.0, full_well=1e5, mosaic="mono"
    )
    rng = np.random.default_rng(0)
    dark = flat(0.0, size, 1)
    for plain in (False, True):
        a, b = (
            expose(dark, c, rng=rng, until=Quantity.ELECTRONS, step_by_step=plain).pixels[..., 0]
            for _ in "ab"
        )
        assert a.mean(axis=1).std() == pytest.approx(5.0, rel=0.13)
        assert a.mean(axis=0).std() == pytest.approx(3.0, rel=0.12)
        assert (a - a.mean(axis=0) - a.mean(axis=1)[:, None] + a.mean()).std() < 1e-3
        assert abs(np.corrcoef(a.mean(axis=1), b.mean(axis=1))[0, 1]) < 4.5 / np.sqrt(480)
    assert not expose(dark, c, until=Quantity.ELECTRONS).pixels.any()


def test_hot_pixels_grow_with_the_exposure_time_and_have_its_noise():
    c = station(resolution=(400, 240), hot_pixels=(0.01, 500.0), serial_number="7", full_well=1e6)
    L = flat(0.0, (400, 240), 1)
    one, four = (expose(L, c, t_exp=t, until=Quantity.ELECTRONS).pixels for t in (1.0, 4.0))
    assert four == pytest.approx(4 * one, rel=1e-6)
    hot = one[one > 0]
    assert hot.size == pytest.approx(960, abs=4 * np.sqrt(960))  # binomial
    assert hot.mean() == pytest.approx(500, abs=4 * 500 / np.sqrt(960))
    assert np.median(hot) == pytest.approx(500 * np.log(2), rel=0.15)
    rng = np.random.default_rng(0)
    frames = np.stack([expose(L, c, rng=rng, until=Quantity.ELECTRONS).pixels for _ in range(30)])
    ratio = frames.var(axis=0, ddof=1)[one > 50] / one[one > 50]
    assert ratio.mean() == pytest.approx(1, abs=4 * np.sqrt(2 / 29 / ratio.size))
    assert not frames[:, one == 0].any()


def test_a_seed_gives_the_same_frame_however_many_threads_work(monkeypatch):
    from concurrent.futures import ThreadPoolExecutor

    import interchange.bands as module

    c = station(resolution=(640, 480), responsivity=1e4, read_noise=5, mosaic="RGGB")
    L = Image(np.random.default_rng(0).uniform(0, 0.8, (480, 640, 3)).astype(np.float32))
    frames = []
    for workers in (1, 5):
        with ThreadPoolExecutor(workers) as pool:
            monkeypatch.setattr(module, "_pool", lambda process, pool=pool: pool)
            frames.append(expose(L, c, rng=np.random.default_rng(6)).pixels)
    monkeypatch.undo()
    assert np.array_equal(*frames)
    assert not np.array_equal(frames[0], expose(L, c, rng=np.random.default_rng(7)).pixels)


def test_bands_of_rows_leave_no_trace():
    """What is drawn in bands is what is drawn at once: every effect that works by pixel, on odd sizes."""
    c = station(
        Lens(vignetting=(-0.3, 0.1)),
        resolution=(333, 517),
        responsivity=8e3,
        prnu=0.02,
        dsnu=3,
        prnu_column=0.01,
        dsnu_row=2,
        hot_pixels=(0.01, 800.0),
        mosaic="GBRG",
        demosaic="none",
        white_balance=(2, 1, 1.5),
        color_crosstalk=(0.1, 0.02),
        black_level=16,
        response="sRGB",
        output_bit_depth=8,
    )
    L = Image(np.random.default_rng(0).uniform(0, 0.8, (517, 333, 3)).astype(np.float32))
    whole = L
    through, camera = chain(c)
    assert all(e.pointwise for e in through)
    pixels = L.pixels * camera.sensor.responsivity
    for e in through:
        if e.stage.name == "READOUT" and e.name() == "black_level":
            pixels = pixels * np.float32(camera.sensor.K)
        whole = e.apply(replace(whole, pixels=pixels), camera, None)
        pixels = whole.pixels
    assert expose(L, c).pixels == pytest.approx(pixels, abs=1)  # a rounding may turn
    assert (expose(L, c).pixels != pixels).mean() < 1e-3


def test_given_effects_stand_for_the_cameras_own():
    c = station(Lens(vignetting=(-0.4,)), responsivity=1e4)
    bare = expose(flat(0.5), c, effects=(Vignetting(),)).pixels
    assert np.array_equal(bare, expose(flat(0.5), station(responsivity=1e4)).pixels)
    twice = expose(flat(0.2), c, effects=(Vignetting(), Exposure(2.0)), until=Quantity.ELECTRONS)
    assert twice.pixels == pytest.approx(4000, rel=1e-6)
    assert twice.camera.lens.vignetting == (0, 0)


@pytest.mark.parametrize(
    ("image", "camera", "message"),
    [
        (flat(1), None, "needs a camera"),
        (flat(1, (10, 10)), station(), "64 x 48 px and 1 or 3 channels; got 10 x 10"),
        (flat(1, channels=2), station(), "1 or 3 channels"),
        (replace(flat(1), quantity=Quantity.DN), station(), "starts from radiance"),
        (flat(np.nan), station(), "must be finite"),
        (flat(1, channels=1), station(mosaic="RGGB"), "three channels"),
        (flat(1), replace(station(), t_exp=-1), "must not be negative"),
        (flat(1), station(Lens(f_stop=4, focus_distance=1)), "needs its pass depth"),
        (flat(1), station(Lens(vignetting=(-7,))), r"Vignetting.a2 .* must lie in \[-1, 1\]"),
    ],
)
def test_what_cannot_be_exposed_is_said(image, camera, message):
    with pytest.raises(BrightfieldError, match=message):
        expose(image, camera)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
def test_an_effect_by_default_is_not_there_and_changes_nothing(model):
    """Or, of what every camera has, changes no whole DN below saturation."""
    effect = model()
    c = station(bit_depth=12)
    L = np.random.default_rng(0).integers(0, 4096, (48, 64, 3)).astype(np.float32)
    assert effect.is_there == effect.always
    out = effect.apply(Image(L), c, None)
    assert out.pixels == pytest.approx(L, abs=2e-3)  # of 4095: a resampling at whole places


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
def test_an_effect_says_where_it_comes_from(model):
    assert len(model.source) > 20
    assert model.stage.name in ("OPTICS", "SENSOR", "READOUT", "SCENE", "MATERIAL")


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
@given(data=st.data())
@settings(max_examples=20, deadline=None)
def test_a_camera_carries_an_effect_there_and_back(model, data):
    """What a diagnosis finds is written into the camera and read from it again, number by number."""
    words = {
        "serial_number": "A7",
        "pattern": "GRBG",
        "method": "edge_aware",
        "response": "sRGB",
        "bits_out": 8,
        "sigmas": (0.0, 0.5, 0.6, 1.0, 2.0, 1.0),
    }
    whole = {"bits": 8, "quality": 60, "black_level": 17}
    values = {}
    for name, about in parameters(model).items():
        number = st.floats(about.low, about.high)
        drawn = data.draw(st.lists(number, min_size=about.kind.width, max_size=about.kind.width))
        values[name] = whole.get(name, drawn if about.kind.width > 1 else drawn[0])
    values |= {k: v for k, v in words.items() if k in model.__dataclass_fields__}
    effect = model(**values)
    back = model.of(effect.on(station(bit_depth=8)))
    for name in model.carried_by or ("red", "green", "blue") * (model.__name__ == "ColorCorrection"):
        assert getattr(back, name) == getattr(effect, name), name


@pytest.mark.parametrize("model", [m for m in MODELS.values() if m.stage.name == "OPTICS"])
def test_optics_are_linear_in_light(model):
    """Superposition, which is what lets a diagnosis add up light from several lamps."""
    drawn = {n: 0.3 * p.high if p.high <= 1 else min(2.0, 0.3 * p.high) for n, p in parameters(model).items()}
    if "sigmas" in model.__dataclass_fields__:
        drawn["sigmas"] = (0.0, 0.5, 0.6, 1.0, 2.0, 1.0)
    effect = model(**{**drawn, **({"u": 3.0, "v": 1.0} if "u" in drawn else {})})
    c = station()
    rng = np.random.default_rng(0)
    a, b = (
        Image(rng.uniform(0, 1, (48, 64, 3)).astype(np.float32), passes=depth_and_motion()) for _ in range(2)
    )
    both = effect.apply(replace(a, pixels=2 * a.pixels + b.pixels), c, None).pixels
    apart = 2 * effect.apply(a, c, None).pixels + effect.apply(b, c, None).pixels
    assert both == pytest.approx(apart, abs=2e-5)


def depth_and_motion():
    slope = np.broadcast_to(np.linspace(0.5, 2.0, 64, dtype=np.float32), (48, 64))
    return {"depth": slope, "motion": np.full((48, 64, 2), 1.5, np.float32)}
