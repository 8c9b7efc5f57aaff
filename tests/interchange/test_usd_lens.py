"""Every lens model through a USD file and back."""

import pytest

from interchange.camera import CLIP, Camera, Lens, Sensor
from interchange.distortion import LensModel
from interchange.formats.document import open_scene
from interchange.formats.usd_author import author_scene
from interchange.problems import FileError
from interchange.scene import Scene

FOURTEEN = (-0.28, 0.11, 0.0012, -0.0009, 0.02, 0.03, -0.01, 0.004, 0.01, -0.003, -0.008, 0.002, 0.06, -0.04)


@pytest.mark.parametrize(
    "lens",
    [
        Lens(distortion=FOURTEEN),
        Lens(distortion=FOURTEEN[:12]),
        Lens(distortion=(-0.1, 0.02)),
        Lens(distortion=(-0.03, 0.01, 0, 0.001), model=LensModel.FISHEYE),
        Lens(model=LensModel.FISHEYE),
    ],
)
def test_lenses_through_usd(tmp_path, lens):
    path = tmp_path / "scene.usda"
    camera = Camera("camera", lens=lens, sensor=Sensor((640, 480)), principal_point=(300.25, 250.5))
    author_scene(Scene(cameras=(camera,))).Export(str(path))
    back = open_scene(path).scene().camera()
    assert back.lens.model is lens.model
    assert back.lens.distortion == pytest.approx(lens.distortion, rel=1e-6)
    assert pytest.approx(camera.K, rel=1e-6) == back.K


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (f"float[] lens:distortion = {[0.1] * 15}", "up to 14 finite numbers"),
        (
            'token lens:model = "fisheye"\n float[] lens:distortion = [1, 2, 3, 4, 5]',
            "up to 4 finite numbers",
        ),
        ('token lens:model = "omni"', 'lens:model must be one of opencv, fisheye; got "omni"'),
    ],
)
def test_a_lens_that_cannot_be_is_told_with_its_prim(tmp_path, lines, message):
    path = tmp_path / "scene.usda"
    path.write_text(f'#usda 1.0\ndef Camera "c"\n{{\n {lines}\n}}\n')
    with pytest.raises(FileError, match=message) as caught:
        open_scene(path).scene()
    assert "/c" in str(caught.value)


@pytest.mark.parametrize("unit", [1.0, 0.01])
def test_a_camera_that_names_no_clipping_range_sees_what_is_near(tmp_path, unit):
    """The schema's default starts one unit away: 1 m in a scene in metres, behind most workpieces."""
    path = tmp_path / "scene.usda"
    path.write_text(f'#usda 1.0\n(metersPerUnit = {unit})\ndef Camera "c"\n{{\n}}\n')
    assert open_scene(path).scene().camera().clip == CLIP
    head = f"#usda 1.0\n(metersPerUnit = {unit})\n"
    path.write_text(head + 'def Camera "c"\n{\n    float2 clippingRange = (2, 50)\n}\n')
    assert open_scene(path).scene().camera().clip == pytest.approx((2 * unit, 50 * unit))
