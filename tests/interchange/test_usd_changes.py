"""What is written of a changed scene is what is read again, to single precision; all else stays as it was."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, UsdGeom, Vt

from interchange.effects import MODELS
from interchange.effects.texture import painted
from interchange.formats.document import open_scene
from interchange.formats.usd_changes import Frame, author_changes
from interchange.scene import Scene

BENCH = Path(__file__).parents[2] / "assets/bench_sample/scene.usda"
LAMP, OBJECT = "/World/LED4", "/World/ball"
CASES = [
    ("camera_pose", "/World/Camera1", {"tx": 1.5, "tz": -2.0, "rx": 3.0, "rz": -4.0}),
    ("object_pose", OBJECT, {"x": 0.7, "y": -1.1, "z": 0.2, "rx": -5.0, "ry": 3.0, "rz": 8.0}),
    ("light_position", LAMP, {"x": 3.0, "y": -2.0, "z": 5.0}),
    ("light_intensity", LAMP, {"scale": 1.07}),
    ("light_size", LAMP, {"spread": 3.0}),
    ("light_beam", "", {"m": 0.6}),
    ("ambient_light", "", {"L": 0.3, "red": -0.1, "blue": 0.1}),
    ("albedo", "/World/Materials/white", {"R": 1.05, "G": 0.97, "B": 0.9}),
    ("gloss", "/World/Materials/metal", {"width": 1.2, "level": 0.9}),
    ("lens_distortion", "", {"k1": -0.03, "k2": 0.01, "p1": 1e-3}),
    ("principal_point", "/World/Camera0", {"cx": 1.5, "cy": -0.75}),
]
TIMES = (0.0, 4.0, 6.0, 12.0)
Y_UP = [('upAxis = "Z"', 'upAxis = "Y"'), ("metersPerUnit = 0.001", "metersPerUnit = 0.01")]


@pytest.mark.parametrize("turned", [False, True])
def test_what_is_written_is_read_again(turned: bool, tmp_path: Path) -> None:
    """Every effect at once; also where the stage has other units and axes."""
    text = BENCH.read_text()
    for old, new in Y_UP if turned else []:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "scene.usda").write_text(text)
    document = open_scene(tmp_path / "scene.usda")
    before = document.scene(0)
    frames = []
    for time in document.times:
        scene = document.scene(time)
        for name, target, values in CASES:
            changed = MODELS[name](**values).on_scene(scene, target)
            assert changed is not scene
            scene = changed
        frames.append(Frame(time, document.scene(time), scene))
    assert author_changes(document.stage, frames) == []
    document.save(tmp_path / "new.usda")
    document.stage.Reload()
    found = open_scene(tmp_path / "new.usda")
    for frame in frames:
        if frame.time in TIMES:
            _same(found.scene(frame.time), frame.new)
    _same(document.scene(0), before)


def test_what_a_lamp_gets_is_in_a_file_beside(tmp_path: Path) -> None:
    """A beam that is no power of a cosine, and a room that is brighter to one side: a profile of half degrees and a map
    of half floats, to their own precision. Without a place for files, both are told as lost."""
    document = open_scene(BENCH)
    old = document.scene(0)
    new = MODELS["light_beam"](m=0.3, q=-0.8).on_scene(old)
    new = MODELS["ambient_light"](L=0.4, red=0.1, x=0.1, z=0.2).on_scene(new)
    frames = [Frame(0.0, old, new)]
    lost = author_changes(document.stage, frames)
    assert {p.where.prim for p in lost} == {"/AmbientLight", *(x.name for x in old.lights)}
    document = open_scene(BENCH)
    assert author_changes(document.stage, frames, tmp_path / "new") == []
    document.save(tmp_path / "new.usda")
    document.stage.Reload()
    found = open_scene(tmp_path / "new.usda").scene(0)
    away = np.random.default_rng(1).normal(size=(200, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    for a, b in zip(found.lights, new.lights, strict=True):
        assert a.is_on == b.is_on
        in_the_world = [away @ x.world_from_light[:3, :3] for x in (a, b)]
        shaped = [x.shaping(w) for x, w in zip((a, b), in_the_world, strict=True)]
        assert shaped[0] == pytest.approx(shaped[1], rel=2e-4, abs=1e-5)
    room, wanted = found.lights[-1], new.lights[-1]
    assert room.texture is not None
    assert wanted.texture is not None
    assert room.world_from_light == pytest.approx(wanted.world_from_light)
    said = [x.texture.pixels * x.intensity for x in (room, wanted) if x.texture is not None]
    assert said[0] == pytest.approx(said[1], rel=1e-3)


def _same(found: Scene, wanted: Scene) -> None:
    for a, b in zip(found.cameras, wanted.cameras, strict=True):
        assert a.world_from_camera == pytest.approx(b.world_from_camera, abs=1e-7)
        assert pytest.approx(b.K, abs=1e-3) == a.K  # px; apertures are single precision
        assert a.lens.distortion == pytest.approx(b.lens.distortion, rel=1e-6)
        assert a.sensor == b.sensor
    for a, b in zip(found.lights, wanted.lights, strict=True):
        assert a.intensity == pytest.approx(b.intensity, rel=1e-6)
        # a round lamp without a beam may turn about itself
        assert a.world_from_light[:3, 3] == pytest.approx(b.world_from_light[:3, 3], abs=1e-7)
        if b.focus:
            assert a.world_from_light == pytest.approx(b.world_from_light, abs=1e-6)
        assert (a.radius, a.focus, a.cone_angle) == pytest.approx((b.radius, b.focus, b.cone_angle), rel=1e-6)
    for a, b in zip(found.bodies, wanted.bodies, strict=True):
        assert a.world_from_body == pytest.approx(b.world_from_body, abs=1e-7)
        wi, wo = (np.array(v) / np.linalg.norm(v) for v in ([0.3, 0.2, 0.9], [-0.4, 0.1, 0.8]))
        assert a.material.brdf.evaluate(wi, wo) == pytest.approx(b.material.brdf.evaluate(wi, wo), rel=1e-5)


BASE, PLATE = "/World/Materials/base", "/World/base"


@pytest.mark.parametrize("turned", [False, True])
def test_a_pattern_is_a_texture_beside_the_scene(turned: bool, tmp_path: Path) -> None:
    text = BENCH.read_text()
    for old, new in Y_UP if turned else []:
        text = text.replace(old, new)
    (tmp_path / "scene.usda").write_text(text)
    document = open_scene(tmp_path / "scene.usda")
    pattern = np.random.default_rng(1).uniform(0.5, 1.5, (30, 40))
    frames = [Frame(t, document.scene(t), painted(document.scene(t), BASE, {PLATE: pattern})) for t in TIMES]
    assert author_changes(document.stage, frames, tmp_path / "new") == []
    document.save(tmp_path / "new.usda")
    document.stage.Reload()
    found, wanted = open_scene(tmp_path / "new.usda").scene(0), frames[0].new
    assert [b.name for b in found.bodies] == [b.name for b in wanted.bodies]
    for a, b in zip(found.bodies, wanted.bodies, strict=True):
        if b.material.name != BASE:
            assert a.material.maps == b.material.maps == {}
            continue
        (name,) = b.material.maps
        assert np.array_equal(a.material.maps[name].pixels, b.material.maps[name].pixels)
        assert a.material.maps[name].wrap == b.material.maps[name].wrap
        assert a.mesh.uv[a.mesh.faces] == pytest.approx(b.mesh.uv[b.mesh.faces], abs=1e-5)


def test_a_pattern_without_a_place_for_its_file_is_told() -> None:
    document = open_scene(BENCH)
    old = document.scene(0)
    lost = author_changes(document.stage, [Frame(0, old, painted(old, BASE, {PLATE: np.full((2, 2), 0.9)}))])
    document.stage.Reload()
    assert any("other files" in problem.message for problem in lost)


def test_a_body_that_has_no_place_for_a_texture_leaves_its_material_as_it_was(tmp_path: Path) -> None:
    """Else the body would be drawn in the colour of one texel."""
    text = BENCH.read_text()
    (tmp_path / "scene.usda").write_text(text)
    document = open_scene(tmp_path / "scene.usda")
    prim = document.stage.GetPrimAtPath(PLATE)
    count = len(UsdGeom.Mesh(prim).GetPointsAttr().Get())
    st = UsdGeom.PrimvarsAPI(prim).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    )
    st.Set(Vt.Vec2fArray([Gf.Vec2f(0.5, 0.5)] * count))
    old = document.scene(0)
    new = painted(old, BASE, {PLATE: np.full((2, 2), 0.9)})
    lost = author_changes(document.stage, [Frame(0, old, new)], tmp_path / "new")
    assert {p.where.prim for p in lost} == {PLATE, BASE}
    assert "texture coordinates already" in lost[0].message
    assert not list(tmp_path.glob("*.exr"))
    document.save(tmp_path / "new.usda")
    found = next(b for b in open_scene(tmp_path / "new.usda").scene(0).bodies if b.name == PLATE)
    assert not found.material.maps
    document.stage.Reload()


def test_a_lamp_that_is_not_normalised_keeps_its_intensity(tmp_path: Path) -> None:
    folder, factor, radius = tmp_path, 1.7, 2e-3
    (folder / "scene.usda").write_text(
        '#usda 1.0\n(defaultPrim = "World"\nmetersPerUnit = 0.001\nupAxis = "Z")\ndef Xform "World" {\n'
        f'def DiskLight "Lamp" {{\nfloat inputs:intensity = 3\nfloat inputs:radius = {1e3 * radius}\n}}\n}}\n'
    )
    document = open_scene(folder / "scene.usda")
    old = document.scene(0)
    lamp = replace(old.lights[0], radius=factor * old.lights[0].radius)
    author_changes(document.stage, [Frame(0, old, replace(old, lights=(lamp,)))])
    document.save(folder / "new.usda")
    document.stage.Reload()
    (found,) = open_scene(folder / "new.usda").scene(0).lights
    assert found.radius == pytest.approx(lamp.radius, rel=1e-5)
    assert found.intensity == pytest.approx(old.lights[0].intensity, rel=1e-5)


def test_what_has_no_place_is_told(tmp_path: Path) -> None:
    (tmp_path / "scene.usda").write_text(BENCH.read_text())
    document = open_scene(tmp_path / "scene.usda")
    old = document.scene(0)
    ball = next(b for b in old.bodies if b.name == OBJECT)
    thicker = replace(ball, mesh=replace(ball.mesh, vertices=1.01 * ball.mesh.vertices))
    new = replace(old, bodies=tuple(thicker if b is ball else b for b in old.bodies))
    (problem,) = author_changes(document.stage, [Frame(0, old, new)])
    assert problem.where.prim == OBJECT
    assert "another mesh" in problem.message
    document.stage.Reload()
