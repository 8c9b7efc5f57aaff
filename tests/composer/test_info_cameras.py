"""What `info` tells of a camera's lens and sensor."""

from composer.camera_effects import camera_effects
from composer.describe import describe
from interchange.camera import Camera, Lens, Sensor
from interchange.effects import MODELS, chain
from interchange.formats.usd_author import author_scene
from interchange.scene import Scene


def test_a_plain_camera_has_its_sensors_numbers_alone():
    assert set(camera_effects(Camera())) == {"full_well", "K", "responsivity"}


def test_every_effect_that_is_there_is_told_with_its_unit(tmp_path):
    lens = Lens(f_stop=4.0, vignetting=(-0.3,), diffraction=True, field_blur=(0, 4, 2), veiling_glare=(0.02,))
    sensor = Sensor(
        (64, 48), responsivity=0, quantum_efficiency=0.6, gain_dB=6, read_noise=2.5, prnu=0.01, dsnu_row=0.5,
        hot_pixels=(1e-4, 300), mosaic="RGGB", black_level=64, white_balance=(1.6, 1, 1.9),
    )  # fmt: skip
    camera = Camera("/World/Top", lens=lens, sensor=sensor, t_exp=0.01)
    author_scene(Scene(cameras=(camera,))).Export(str(tmp_path / "a.usda"))
    (found,) = describe(tmp_path / "a.usda")["cameras"]
    assert found["vignetting"] == "a_2 -0.3"
    assert found["field_blur"] == "d_T 4 px, d_S 2 px"
    assert found["hot_pixels"] == "p_hot 0.0001, µ_hot 300 e-/s"
    assert found["sensor_noise"] == "σ_d 2.5 e-"
    assert found["fixed_pattern"] == "PRNU 0.01, DSNU.row 0.5 e-"
    assert found["mosaic"] == "RGGB"
    assert found["quantum_efficiency"] == "0.6, 0.6, 0.6"
    assert found["gain"] == "6 dB"
    there = {e.name() for e in chain(camera)[0]} - {"quantization", "saturation"}
    assert there <= set(found)
    assert not (set(MODELS) - there) & set(found) - {"exposure"}
