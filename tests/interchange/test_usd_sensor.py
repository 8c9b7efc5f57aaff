"""Sensor and lens as attributes of a camera prim and in the head of an EXR: nothing is lost, nothing is guessed."""

from dataclasses import fields, replace

import numpy as np
import pytest

from interchange.camera import Camera, Lens, Sensor
from interchange.formats import exr
from interchange.formats.document import open_scene
from interchange.formats.usd_author import author_scene
from interchange.image import Image
from interchange.problems import FileError, Severity
from interchange.scene import Scene

# numbers that single precision holds, where the file contract asks for it; any where it does not
LENS = Lens(
    focal_length=0.015625,
    f_stop=2.8125,
    focus_distance=0.5,
    distortion=(-0.25, 0.125),
    transmission=0.93,
    vignetting=(-0.31, 0.017),
    lateral_chromatic_aberration=(1.1e-4, -2.3e-4, 3e-5, -7e-5, 1.3e-3, 0.0, -2.1e-3, 4e-4),
    axial_chromatic_aberration=(1.3, 0.1, 2.2),
    blur=0.61,
    field_blur=(0.5, -3.1, 1.7, 0.4),
    measured_blur=(0.0, 0.6, 0.61, 1.0, 1.7, 1.1),
    diffraction=True,
    veiling_glare=(0.013, 0.004, 0.21, 0.003),
)
SENSOR = Sensor(
    resolution=(128, 96),
    pixel_pitch=(2.0**-18, 2.0**-18),
    responsivity=1234.5,
    full_well=10500.0,
    bit_depth=10,
    black_level=17.5,
    read_noise=6.25,
    prnu=0.0078125,
    dsnu=1.5,
    dark_current=12.5,
    prnu_row=0.0011,
    prnu_column=0.0023,
    dsnu_row=0.7,
    dsnu_column=1.3,
    row_noise=0.37,
    column_noise=0.51,
    hot_pixels=(1.7e-4, 310.0),
    quantum_efficiency=(0.41, 0.62, 0.53),
    wavelength_nm=(623.1, 532.2, 466.3),
    spectral_response=(0.7, 1.0, 0.61),
    gain_dB=6.1,
    serial_number="DA 02/17 µ",
    mosaic="GRBG",
    color_crosstalk=(0.01, 0.02, 0.03, 0.04, 0.05, 0.06),
    line_time=1.37e-5,
    exposure_delay=1.4e-5,
    image_path=(0.7, -0.31),
    image_speed=(431.0, -57.1),
    image_acceleration=0.23,
    frame_rate=41.7,
    demosaic="edge_aware",
    white_balance=(1.91, 1.0, 1.47),
    color_correction=(1.6, -0.4, -0.2, -0.3, 1.5, -0.2, 0.1, -0.7, 1.6),
    response="lut",
    response_lut=(0.0, 0.37, 0.81, 1.0),
    gamma=1.03,
    bow=-0.013,
    skew=0.009,
    output_bit_depth=8,
    jpeg_quality=87,
    jpeg_subsampling=False,
)
CAMERA = Camera("/World/Top", lens=LENS, sensor=SENSOR, t_exp=0.00731)


def test_the_examples_leave_no_field_at_its_default():
    """Or the tests below would not see that one is lost."""
    same = [f.name for f in fields(Lens) if getattr(LENS, f.name) == getattr(Lens(), f.name)]
    same += [f.name for f in fields(Sensor) if getattr(SENSOR, f.name) == getattr(Sensor(), f.name)]
    assert same == ["projection", "model"]  # of the camera's other tests


@pytest.mark.parametrize("camera", [CAMERA, Camera("/World/Top")], ids=["everything", "defaults"])
def test_usd_keeps_every_number(camera, tmp_path):
    author_scene(Scene(cameras=(camera,))).Export(str(tmp_path / "a.usda"))
    document = open_scene(tmp_path / "a.usda")
    back = document.scene().camera()
    assert back.sensor == replace(camera.sensor, pixel_pitch=back.sensor.pixel_pitch)
    assert back.sensor.pixel_pitch == pytest.approx(camera.sensor.pixel_pitch, rel=1e-6)  # USD's apertures
    assert back.lens == replace(camera.lens, focal_length=back.lens.focal_length)
    assert back.t_exp == pytest.approx(
        camera.t_exp, rel=1e-7
    )  # exposure:time is USD's own, in single precision
    assert not document.scene_problems()


def test_exr_keeps_every_number(tmp_path):
    exr.write(tmp_path / "a.exr", Image(np.zeros((96, 128, 3), np.float32), camera=CAMERA))
    back = exr.read(tmp_path / "a.exr").camera
    assert back.sensor == SENSOR
    assert back.lens == LENS
    assert back.t_exp == CAMERA.t_exp


def usda(tmp_path, *attributes):
    lines = "\n        ".join(attributes)
    file = tmp_path / "scene.usda"
    file.write_text(f"""#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 0.001
    upAxis = "Z"
)
def Xform "World" {{
    def Camera "Top" {{
        int2 sensor:resolution = (64, 48)
        {lines}
    }}
}}
""")
    return file


def test_a_quantum_efficiency_stands_for_a_responsivity_that_is_not_given(tmp_path):
    eta = "double3 sensor:quantumEfficiency = (0.5, 0.6, 0.5)"
    scene = open_scene(usda(tmp_path, eta, "float fStop = 4")).scene()
    assert scene.camera().sensor.responsivity == 0
    assert scene.camera().lens.f_stop == 4
    both = open_scene(usda(tmp_path, eta, "float sensor:responsivity = 500")).scene()
    assert both.camera().sensor.responsivity == 500


@pytest.mark.parametrize(
    ("attribute", "message"),
    [
        ('token sensor:mosaic = "RGBG"', r'mosaic must be one of .*; got "RGBG"\. Did you mean "RGGB"'),
        ("double[] lens:vignetting = [-3]", r"Vignetting.a2 .* must lie in \[-1, 1\]; got -3"),
        ("double[] lens:vignetting = [1, 2, 3]", "up to 2 finite numbers"),
        ("int sensor:bitDepth = 20", r"bit_depth must be a whole number in \[1, 16\]; got 20"),
        ("float sensor:blackLevel = 4095", "black_level must lie below the highest DN, 4095"),
        ("int sensor:jpegQuality = 90", "JPEG must have 8 bits"),
        ('string sensor:bitDepth = "ten"', "Sensor"),
        ("double sensor:gain = 900", r"gain_dB .* \[-60, 120\] dB; got 900"),
    ],
)
def test_a_wrong_attribute_is_one_error_with_its_place(tmp_path, attribute, message):
    with pytest.raises(FileError, match=message) as caught:
        open_scene(usda(tmp_path, attribute)).scene()
    assert "/World/Top" in str(caught.value)


def test_an_unknown_attribute_is_told_as_a_loss(tmp_path):
    document = open_scene(usda(tmp_path, "float sensor:readnoise = 3"))
    losses = [p for p in document.scene_problems() if p.severity is Severity.LOSS]
    assert 'Did you mean "sensor:readNoise"?' in str(losses[0])
