"""COLLADA's animation curves as USD time samples: the values between the keys are the file's."""

from pathlib import Path

import numpy as np
import pytest

from interchange.formats.collada.animation import Curve
from interchange.formats.document import open_scene

NAMESPACE = "http://www.collada.org/2005/11/COLLADASchema"
TRIANGLE = (
    '<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 1 0'
    '</float_array><technique_common><accessor source="#pa" count="3" stride="3"><param name="X" type="float"/>'
    '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>'
    '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1">'
    '<input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry></library_geometries>'
)
OPTICS = (
    '<library_cameras><camera id="c"><optics><technique_common><perspective><yfov sid="yfov">40</yfov>'
    "<aspect_ratio>1</aspect_ratio><znear>1</znear><zfar>9</zfar></perspective></technique_common></optics></camera>"
    '</library_cameras><library_lights><light id="l"><technique_common><directional><color sid="color">1 1 1</color>'
    "</directional></technique_common></light></library_lights>"
)


def numbers(name: str, values: str, stride: int) -> str:
    count = len(values.split())
    columns = "".join(f'<param name="P{i}" type="float"/>' for i in range(stride))
    return (
        f'<source id="{name}"><float_array id="{name}a" count="{count}">{values}</float_array><technique_common>'
        f'<accessor source="#{name}a" count="{count // stride}" stride="{stride}">{columns}</accessor>'
        "</technique_common></source>"
    )


def animated(
    tmp_path: Path,
    transform: str,
    target: str,
    keys: str,
    values: str,
    kind: str = "LINEAR",
    stride: int = 1,
    tangents: tuple[str, str] | None = None,
) -> Path:
    count = len(keys.split())
    sources = numbers("i", keys, 1) + numbers("o", values, stride)
    inputs = '<input semantic="INPUT" source="#i"/><input semantic="OUTPUT" source="#o"/>'
    inputs += '<input semantic="INTERPOLATION" source="#n"/>'
    sources += (
        f'<source id="n"><Name_array id="na" count="{count}">{" ".join([kind] * count)}</Name_array><technique_common>'
        f'<accessor source="#na" count="{count}"><param name="I" type="name"/></accessor></technique_common></source>'
    )
    for name, text in zip(("IN_TANGENT", "OUT_TANGENT"), tangents or (), strict=False):
        sources += numbers(name, text, 2 * stride)
        inputs += f'<input semantic="{name}" source="#{name}"/>'
    path = tmp_path / "a.dae"
    path.write_text(
        f'<COLLADA xmlns="{NAMESPACE}" version="1.4.1"><asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>'
        f'<library_animations><animation>{sources}<sampler id="s">{inputs}</sampler>'
        f'<channel source="#s" target="{target}"/></animation></library_animations>{TRIANGLE}{OPTICS}'
        f'<library_visual_scenes><visual_scene id="vs"><node id="n1">{transform}<instance_geometry url="#g"/>'
        '<instance_camera url="#c"/><instance_light url="#l"/></node></visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#vs"/></scene></COLLADA>'
    )
    return path


def poses(path: Path, seconds: list[float]) -> np.ndarray:
    document = open_scene(path)
    return np.array([document.scene(24 * t).bodies[0].world_from_body for t in seconds])


def test_one_second_is_24_frames(tmp_path: Path) -> None:
    path = animated(tmp_path, '<translate sid="t">0 0 5</translate>', "n1/t.X", "0 1", "0 2")
    assert open_scene(path).times == list(map(float, range(25)))


@pytest.mark.parametrize(
    ("transform", "target", "values", "stride", "entry", "wanted"),
    [
        ('<translate sid="t">0 0 5</translate>', "n1/t.X", "1 3", 1, (0, 3), 1.5),
        ('<translate sid="t">0 0 5</translate>', "n1/t(1)", "1 3", 1, (1, 3), 1.5),
        ('<translate sid="t">0 0 5</translate>', "n1/t", "0 0 0 4 0 8", 3, (2, 3), 2.0),
        ('<rotate sid="r">0 0 1 10</rotate>', "n1/r.ANGLE", "0 120", 1, (1, 0), 0.5),
        ('<rotate sid="r">0 0 -3 10</rotate>', "n1/r.ANGLE", "0 120", 1, (1, 0), -0.5),
        ('<rotate sid="r">1 0 1 0</rotate>', "n1/r.ANGLE", "0 360", 1, (1, 0), np.sqrt(0.5)),
        ('<scale sid="s">1 1 1</scale>', "n1/s.Y", "1 5", 1, (1, 1), 2.0),
        ('<matrix sid="m">1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</matrix>', "n1/m(3)(0)", "0 8", 1, (0, 3), 2.0),
    ],
)
def test_channels_reach_every_kind_of_target(
    tmp_path: Path,
    transform: str,
    target: str,
    values: str,
    stride: int,
    entry: tuple[int, int],
    wanted: float,
) -> None:
    path = animated(tmp_path, transform, target, "0 1", values, stride=stride)
    # 1e-6: USD keeps matrices and offsets in double precision, the scene's meshes do not enter
    assert poses(path, [0.25])[0][entry] == pytest.approx(wanted, abs=1e-6)


def test_step_holds_until_the_next_key(tmp_path: Path) -> None:
    path = animated(tmp_path, '<translate sid="t">0 0 0</translate>', "n1/t.X", "0 1 2", "1 5 7", "STEP")
    got = poses(path, [0.0, 0.5, 23 / 24, 1.0, 1.5, 2.0])[:, 0, 3]
    np.testing.assert_allclose(got, [1, 1, 1, 5, 5, 7], atol=1e-9)


def test_bezier_follows_its_control_points(tmp_path: Path) -> None:
    """Control points (1/3, 0), (2/3, 1) give value 3 s² - 2 s³ at second s."""
    tangents = ("0 0 0.6666666667 1", "0.3333333333 0 1 1")
    path = animated(
        tmp_path, '<translate sid="t">0 0 0</translate>', "n1/t.X", "0 1", "0 1", "BEZIER", 1, tangents
    )
    s = np.arange(0, 1.01, 1 / 24)
    np.testing.assert_allclose(poses(path, s.tolist())[:, 0, 3], 3 * s**2 - 2 * s**3, atol=1e-6)


def test_hermite_follows_its_tangents(tmp_path: Path) -> None:
    """Tangents (1, 3) at both ends: value 3 s - 6 s² + 4 s³ from 0 to 1, time s."""
    tangents = ("1 3 1 3", "1 3 1 3")
    path = animated(
        tmp_path, '<translate sid="t">0 0 0</translate>', "n1/t.X", "0 1", "0 1", "HERMITE", 1, tangents
    )
    s = np.arange(0, 1.01, 1 / 24)
    np.testing.assert_allclose(poses(path, s.tolist())[:, 0, 3], 3 * s - 6 * s**2 + 4 * s**3, atol=1e-6)


def test_curve_samples_bound_the_error_of_straight_lines() -> None:
    """With four samples a frame, lines between them follow a cubic within (1/4)² / 8 of its second derivative."""
    keys, values = np.array([0.0, 24.0]), np.array([[0.0], [1.0]])
    control = np.array([[[8.0, 0.0]], [[16.0, 1.0]]])
    curve = Curve(keys, values, np.array(["BEZIER", "BEZIER"]), control[[1, 1]], control[[0, 0]])
    t = np.linspace(0, 24, 1001)
    samples = curve.samples()
    lines = np.interp(t, samples, curve.at(samples)[:, 0])
    assert np.abs(lines - curve.at(t)[:, 0]).max() <= (6 / 24**2) * 0.25**2 / 8 + 1e-9


def test_cameras_and_lights_move_too(tmp_path: Path) -> None:
    zoom = open_scene(animated(tmp_path, "", "c/yfov", "0 1", "90 60"))
    K = [zoom.scene(t).cameras[0] for t in (0.0, 24.0)]
    tangent = [c.sensor.resolution[1] / (2 * c.K[1, 1]) for c in K]
    np.testing.assert_allclose(tangent, [1.0, np.tan(np.radians(30))], rtol=1e-5)
    dimmer = open_scene(animated(tmp_path, "", "l/color.G", "0 1", "1 0"))
    np.testing.assert_allclose(
        dimmer.scene(12.0).lights[0].intensity, np.pi * np.array([1, 0.5, 1]), rtol=1e-6
    )


def test_targets_that_are_not_there_are_named(tmp_path: Path) -> None:
    document = open_scene(animated(tmp_path, "", "nobody/t.X", "0 1", "0 1"))
    assert any('"nobody/t.X" is not there' in p.message and p.severity == "loss" for p in document.problems)


def test_nested_animation_of_an_importer_sample() -> None:
    document = open_scene(Path("assets/collada/importers/box_nested_animation.dae"))
    assert document.times == list(map(float, range(1, 41)))
    assert any("skin is drawn in its bind shape" in p.message for p in document.problems)
