"""What holds for every effect of the catalogue, and for those that change the scene."""

from dataclasses import replace

import numpy as np
import pytest

from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.brdf.lobes import has_lobes
from interchange.brdf.ward import Ward
from interchange.camera import Camera, Lens, Sensor
from interchange.effects import MODELS, Effect, Stage, chain
from interchange.effects.albedo import Albedo
from interchange.effects.ambient_light import AmbientLight
from interchange.effects.camera_pose import CameraPose
from interchange.effects.geometry import Geometry
from interchange.effects.gloss import Gloss
from interchange.effects.interreflection import Interreflection
from interchange.effects.lens_distortion import LensDistortion
from interchange.effects.light_beam import LightBeam
from interchange.effects.light_intensity import LightIntensity
from interchange.effects.light_position import LightPosition
from interchange.effects.light_size import LightSize
from interchange.effects.light_spectrum import LightSpectrum
from interchange.effects.object_pose import ObjectPose
from interchange.effects.principal_point import PrincipalPoint
from interchange.effects.shadow import TWIN, Shadow
from interchange.effects.texture import Texture, box_uv, painted
from interchange.effects.translucency import Translucency
from interchange.image import Image
from interchange.light import Light, LightKind, Profile, latlong_uv
from interchange.material import Material, evaluate_texture
from interchange.mesh import Mesh
from interchange.parameter import parameters
from interchange.problems import BrightfieldError
from interchange.scene import Body, Scene

NAMES = """camera_pose object_pose geometry light_position light_intensity light_beam light_size light_spectrum
ambient_light albedo gloss anisotropy texture translucency interreflection shadow lens_distortion principal_point
vignetting defocus lateral_chromatic_aberration veiling_glare motion_blur sensor_noise black_level exposure
response_curve saturation white_balance color_crosstalk fixed_pattern rolling_shutter jpeg quantization"""
CONTRACT = NAMES.split()

EACH = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())


def _box(
    size: tuple[float, float, float], at: tuple[float, float, float], material: Material, name: str
) -> Body:
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) - (0.5, 0.5, 0)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    pose = np.eye(4)
    pose[:3, 3] = at
    vertices = corner * size
    normals = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
    return Body(name, Mesh(vertices, faces, normals), material, pose)


@pytest.fixture
def scene() -> Scene:
    steel = Material("/M/steel", Ward((0.2, 0.2, 0.2), (0.3, 0.3, 0.3), 0.1))
    paper = Material("/M/paper", Lambert((0.8, 0.7, 0.6)))
    bodies = (
        _box((0.4, 0.4, 0.01), (0, 0, -0.01), paper, "/W/table"),
        _box((0.06, 0.04, 0.02), (0.1, 0.05, 0), steel, "/W/part"),
    )
    lights = (
        Light("/W/A", LightKind.SPHERE, (2.0, 2.0, 2.0), _at(0, 0, 1), radius=3e-3),
        Light("/W/B", LightKind.RECT, (1.0, 2.0, 3.0), _at(0.5, 0, 0.5), width=0.02, height=0.04),
        Light("/W/C", LightKind.DISTANT, (1.0, 1.0, 1.0)),
    )
    return Scene(bodies, lights, (Camera("/W/Top", _at(0, 0, -0.5), Lens(0.025), Sensor((64, 48))),))


def _at(x: float, y: float, z: float) -> np.ndarray:
    there = np.eye(4)
    there[:3, 3] = (x, y, z)
    return there


def test_every_name_of_the_file_contract_has_its_file():
    assert set(CONTRACT) <= set(MODELS)


@EACH
def test_an_effect_acts_in_one_place(model):
    own = [f for f in ("apply", "on_scene", "on_radiance") if getattr(model, f) is not getattr(Effect, f)]
    assert len(own) == 1
    assert model.is_of_the_chain() == (own == ["apply"])
    assert (model.stage < Stage.OPTICS) <= (not model.is_of_the_chain())


@EACH
def test_an_effect_by_default_leaves_scene_and_rendering_as_they_are(model, scene):
    image = Image(np.ones((48, 64, 3), np.float32))
    assert model().on_scene(scene) is scene
    assert model().on_radiance(image) is image


@EACH
def test_an_effect_says_what_tells_it_from_others(model):
    assert model.identified_by.endswith(".")
    assert model.identified_by[0].isupper()
    assert not model.separated_by.endswith(".")
    assert set(model.confused_with) <= set(MODELS) - {model.name()}
    assert model.confused_with
    assert model.__module__.rsplit(".", 1)[-1] == model.name()


@EACH
def test_defaults_lie_within_the_bounds_and_have_units(model):
    for name, about in parameters(model).items():
        assert np.all(np.asarray(getattr(model(), name)) >= about.low)
        assert np.all(np.asarray(getattr(model(), name)) <= about.high)
        assert about.unit
        assert about.meaning


def test_the_chain_holds_no_effect_of_the_scene(scene):
    camera = replace(scene.cameras[0], lens=Lens(0.025, distortion=(-0.1,)), principal_point=(10.0, 20.0))
    through, changed = chain(camera, [LensDistortion(k1=0.2), Gloss(width=2)])
    assert all(e.is_of_the_chain() for e in through)
    assert changed.lens.distortion[0] == 0.2


@pytest.mark.parametrize("effect", [LightIntensity(2), Gloss(2), ObjectPose(1), CameraPose(1)])
def test_a_target_must_be_there(effect, scene):
    with pytest.raises(BrightfieldError, match="must be a"):
        effect.on_scene(scene, "/W/nowhere")


def test_a_camera_pose_moves_what_the_camera_sees(scene):
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.1, 0.1, (20, 3))
    before, after = (
        s.cameras[0] for s in (scene, CameraPose(tx=2, ty=-1, tz=5, rz=np.pi / 2 * 1e3).on_scene(scene))
    )
    seen = points @ before.camera_from_world[:3, :3].T + before.camera_from_world[:3, 3]
    moved = points @ after.camera_from_world[:3, :3].T + after.camera_from_world[:3, 3]
    turned = np.stack([-seen[:, 1], seen[:, 0], seen[:, 2]], -1)
    assert moved - turned == pytest.approx(np.tile([2e-3, -1e-3, 5e-3], (20, 1)), abs=1e-12)


def test_an_object_turns_about_its_middle_and_grows_from_its_underside(scene):
    low, high = replace(scene, bodies=scene.bodies[1:]).bounds
    turned = ObjectPose(z=3, rz=1e3 * np.pi / 2).on_scene(scene, "part")
    a, b = replace(turned, bodies=turned.bodies[1:]).bounds
    assert (a + b) / 2 == pytest.approx((low + high) / 2 + [0, 0, 3e-3])
    assert (b - a) == pytest.approx((high - low)[[1, 0, 2]])
    grown = Geometry(1.1).on_scene(scene, "/W/part")
    a, b = replace(grown, bodies=grown.bodies[1:]).bounds
    assert a[2] == pytest.approx(low[2])
    assert b - a == pytest.approx(1.1 * (high - low))
    assert grown.bodies[0] is scene.bodies[0]


def test_an_object_tilts_about_its_middle_the_vertical_last(scene):
    """A quarter turn about x brings what points up to -y, and one about z after that to x."""
    part = scene.bodies[1].world_from_body
    for turns, up in (({"rx": 1}, [0, -1, 0]), ({"ry": 1}, [1, 0, 0]), ({"rx": 1, "rz": 1}, [1, 0, 0])):
        effect = ObjectPose(**{name: 1e3 * np.pi / 2 for name in turns})
        tilted = effect.on_scene(scene, "part")
        way = tilted.bodies[1].world_from_body @ np.linalg.inv(part)
        assert way[:3, :3] @ [0, 0, 1] == pytest.approx(up, abs=1e-12)
        middle = replace(scene, bodies=scene.bodies[1:]).bounds.mean(axis=0)
        assert replace(tilted, bodies=tilted.bodies[1:]).bounds.mean(axis=0) == pytest.approx(middle)


def test_lamps_change_as_their_effects_say(scene):
    moved = LightPosition(x=1, z=-2).on_scene(scene)
    assert moved.lights[0].world_from_light[:3, 3] == pytest.approx([1e-3, 0, 1 - 2e-3])
    assert moved.lights[2] is scene.lights[2]
    assert LightIntensity(3).on_scene(scene, "B").lights[1].intensity == (3, 6, 9)
    grown = LightSize(4).on_scene(scene)
    assert grown.lights[0].radius == pytest.approx(5e-3)  # 3, 4, 5
    assert LightSize(-4).on_scene(grown).lights[0].radius == pytest.approx(3e-3)
    assert (grown.lights[1].width / 2) ** 2 == pytest.approx(0.01**2 + 4e-3**2)
    coloured = LightSpectrum(red=0.2, blue=-0.1).on_scene(scene, "B").lights[1].intensity
    assert coloured == pytest.approx((1.4, 1.8, 2.8))
    assert sum(coloured) == pytest.approx(6)
    with pytest.raises(BrightfieldError, match="negative"):
        LightSpectrum(red=-3).on_scene(scene)
    dome = AmbientLight(L=2, red=-1, blue=1).on_scene(scene).lights[-1]
    assert dome.radiance == pytest.approx([1, 2, 3])
    near = AmbientLight(**AmbientLight.within({"L": 1.0, "red": 2.1, "blue": -1.05}))  # red alone, and noise
    assert near.channels == pytest.approx([3.1, 0, 0])
    assert near.on_scene(scene).lights[-1].radiance == pytest.approx([3.1, 0, 0])
    assert AmbientLight.within({"L": -1.0}) == {"L": 0.0}
    with pytest.raises(BrightfieldError, match="negative"):
        AmbientLight(L=1, red=0.5, blue=0.6).on_scene(scene)
    room = AmbientLight(L=2, red=-1, blue=1, x=0.3, y=-0.4, z=0.5)
    lit = room.on_scene(scene).lights[-1]
    assert lit.texture is not None
    way = np.array([[1.0, 0, 0], [0, -1, 0], [0.6, 0, 0.8], [0, 0, -1]])
    seen = evaluate_texture(lit.texture, latlong_uv(way)) * lit.radiance
    said = np.array([1, 2, 3]) + (way @ room.toward)[:, None]
    assert seen == pytest.approx(
        said, abs=0.02
    )  # |g| = 0.7; at a pole the map's half row, 0.025, is what there is
    assert AmbientLight.within({"L": 1.0, "x": 3.0, "z": -4.0}) == pytest.approx(
        {"L": 1, "x": 0.6, "y": 0, "z": -0.8}
    )
    with pytest.raises(BrightfieldError, match="darkest side"):
        AmbientLight(L=1, x=0.9, y=0.9).on_scene(scene)


def test_a_beam_falls_off_by_its_cosine_about_the_lamps_axis(scene):
    middle = scene.bounds.mean(axis=0)
    for light in LightBeam(m=2.5).on_scene(scene).lights[:2]:
        axis = -light.world_from_light[:3, 2]
        to = middle - light.world_from_light[:3, 3]
        if light.name == "/W/A":  # shines everywhere alike: its axis is turned
            assert axis @ to == pytest.approx(np.linalg.norm(to))
        theta = np.linspace(0, 1.4, 8)
        direction = np.stack([np.sin(theta), 0 * theta, -np.cos(theta)], -1)
        assert light.shaping(direction)[:, 0] == pytest.approx(np.cos(theta) ** 2.5)
        own = Profile(np.zeros(1), np.array([0.0, np.pi]), np.array([[1.0, 3.0]]))  # 1 + 2 θ / π
        for beside, factor in ((None, 1.0), (own, 1 + 2 * theta / np.pi)):
            bare = replace(scene, lights=(replace(light, profile=beside),))
            more = LightBeam(q=-1.5).on_scene(bare).lights[0].shaping(direction)[:, 0]
            said = factor * np.cos(theta) ** 2.5 * np.exp(-1.5 * (1 - np.cos(theta)) ** 2)
            assert more == pytest.approx(said, rel=2e-4)  # a straight line over half a degree
        stretched = replace(light, profile=own, profile_angle_scale=0.5)
        with pytest.raises(BrightfieldError, match="stretched"):
            LightBeam(q=-1.5).on_scene(replace(scene, lights=(stretched,)))


def test_light_in_shadows_is_a_second_lamp(scene):
    lights = {x.name: x for x in Shadow(0.3).on_scene(scene, "A").lights}
    twin = lights["/W/A" + TWIN]
    assert not twin.casts_shadows
    assert np.add(lights["/W/A"].intensity, twin.intensity) == pytest.approx(scene.lights[0].intensity)
    assert twin.intensity[0] == pytest.approx(0.6)


def test_lens_effects_add_to_what_the_camera_has(scene):
    once = LensDistortion(k1=-0.1, p2=0.01).on_scene(scene)
    twice = LensDistortion(k1=-0.1).on_scene(once)
    assert twice.cameras[0].lens.distortion[:4] == pytest.approx((-0.2, 0, 0, 0.01))
    shifted = PrincipalPoint(2, 3).on_scene(PrincipalPoint(1, 1).on_scene(scene))
    assert shifted.cameras[0].K[:2, 2] == pytest.approx(scene.cameras[0].K[:2, 2] + [3, 4])


def test_materials_without_lobes_have_no_gloss(scene):
    assert not has_lobes(Lambert())
    assert not has_lobes(Lafortune())
    with pytest.raises(BrightfieldError, match="needs a BRDF with lobes"):
        Gloss(2).on_scene(scene, "paper")
    assert Gloss(2).on_scene(scene).bodies[0].material.brdf == scene.bodies[0].material.brdf


def test_paint_changes_one_material(scene):
    painted = Albedo(1.1, 1.0, 0.5).on_scene(scene, "paper")
    assert painted.bodies[0].material.brdf.diffuse == pytest.approx((0.88, 0.7, 0.3))
    assert painted.bodies[1] is scene.bodies[1]
    with pytest.raises(BrightfieldError, match=r"\[0, 1\]"):
        Albedo(2, 2, 2).on_scene(scene, "paper")


def test_a_texture_follows_the_objects_box(scene):
    effect = Texture(c10=0.1, c02=-0.05, c11=0.02)
    body = effect.on_scene(scene, "paper").bodies[0]
    rng = np.random.default_rng(1)
    points = rng.uniform(*body.mesh.bounds, (50, 3))
    uv = box_uv(body.mesh, points)
    drawn = evaluate_texture(body.material.maps["diffuse"], uv)
    expected = effect.factor(uv[:, 0], uv[:, 1])[:, None] * [0.8, 0.7, 0.6]
    assert drawn == pytest.approx(expected, abs=2e-3)  # a map of 128 px
    assert body.mesh.uv == pytest.approx(box_uv(body.mesh, body.mesh.vertices))


def test_bodies_of_one_material_have_patterns_of_their_own(scene):
    """Each its own part of one texture, exact in the middle of every texel, and as the scene says where it has none."""
    two = replace(scene, bodies=(*scene.bodies, replace(scene.bodies[0], name="/W/second")))
    first = scene.bodies[0].name
    rng = np.random.default_rng(2)
    patterns = {first: rng.uniform(0.5, 1.2, (5, 7)), "/W/second": rng.uniform(0.5, 1.2, (4, 3))}
    for given in (patterns, {first: patterns[first]}):
        bodies = {b.name: b for b in painted(two, scene.bodies[0].material.name, given).bodies}
        for name in patterns:
            plane = given.get(name, np.ones((3, 3)))
            h, w = plane.shape
            v, u = np.meshgrid((np.arange(h) + 0.5) / h, (np.arange(w) + 0.5) / w, indexing="ij")
            mesh = bodies[name].mesh
            affine = np.linalg.lstsq(
                np.c_[box_uv(mesh, mesh.vertices), np.ones(len(mesh.vertices))], mesh.uv, rcond=None
            )[0]
            uv = np.stack([u, v, np.ones_like(u)], axis=-1) @ affine
            drawn = evaluate_texture(bodies[name].material.maps["diffuse"], uv)
            assert drawn == pytest.approx(plane[..., None] * [0.8, 0.7, 0.6], abs=1e-5)


def test_translucency_bleeds_inside_one_body():
    """A step edge becomes the error function; what lies beyond the body's edge stays."""
    h, w, sigma = 32, 96, 4.0
    pixels = np.ones((h, w, 3), np.float32)
    pixels[:, 48:] = 0
    ids = np.zeros((h, w), np.int32)
    ids[:, 80:] = 1
    camera = Camera(lens=Lens(0.02), sensor=Sensor((w, h), (1e-5, 1e-5)))
    passes = {"depth": np.full((h, w), 0.5, np.float32), "material_id": 0 * ids, "object_id": ids}
    image = Image(pixels, camera=camera, passes=passes, material_names=("/M/wax",))
    mm = 1e3 * sigma * 0.5 * 1e-5 / 0.02
    out = Translucency(mm).on_radiance(image, "wax").pixels[16, :, 0]
    from scipy.special import erfc

    x = np.arange(w) - 47.5
    assert out[20:75] == pytest.approx(0.5 * erfc(x / sigma / np.sqrt(2))[20:75], abs=5e-3)
    assert (out[80:] == 0).all()
    with pytest.raises(BrightfieldError, match="passes"):
        Translucency(1).on_radiance(replace(image, passes={}))


def test_interreflection_scales_indirect_light():
    direct, indirect = np.full((4, 5, 3), 2.0, np.float32), np.full((4, 5, 3), 0.5, np.float32)
    image = Image(direct + indirect, passes={"indirect": indirect})
    assert Interreflection(0).on_radiance(image).pixels == pytest.approx(direct)
    with pytest.raises(BrightfieldError, match="pass indirect"):
        Interreflection(0).on_radiance(Image(direct))
    undrawn = Image(direct, passes={"undrawn": indirect})
    assert Interreflection(added=1).on_radiance(undrawn).pixels == pytest.approx(direct + indirect)
    with pytest.raises(BrightfieldError, match="pass undrawn"):
        Interreflection(added=1).on_radiance(Image(direct))
