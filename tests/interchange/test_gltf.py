"""glTF in each of its containers: what was written comes back, in metres; what is damaged is told."""

import base64
import json
import struct

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from interchange.formats.document import open_file
from interchange.formats.gltf import LUMENS_PER_WATT, place_in_st
from interchange.light import LightKind
from interchange.material import Wrap
from interchange.problems import FileError
from tests.interchange.opened import only_body, write

BOX = trimesh.creation.box((2.0, 3.0, 5.0))


def glb(document, binary=b""):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = (
        struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    )
    return b"glTF" + struct.pack("<2I", 2, 12 + len(chunks)) + chunks


def triangle_gltf(**changes):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0]], "<f4").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "top", "mesh": 0}],
        "meshes": [{"name": "tri", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6},
        ],
        "buffers": [{"byteLength": 42}],
    }
    return document | changes, points + np.array([0, 1, 2], "<u2").tobytes()


def test_gltf_in_every_container_is_one_scene(tmp_path):
    document, binary = triangle_gltf()
    uri = "data:application/octet-stream;base64," + base64.b64encode(binary).decode()
    inline = document | {"buffers": [{"byteLength": 42, "uri": uri}]}
    beside = document | {"buffers": [{"byteLength": 42, "uri": "part%20one.bin"}]}
    write(tmp_path, "part one.bin", binary)
    files = [
        write(tmp_path, "a.glb", glb(document, binary)),
        write(tmp_path, "b.gltf", json.dumps(inline)),
        write(tmp_path, "c.gltf", json.dumps(beside)),
    ]
    for path in files:
        bounds = open_file(path).scene().bounds
        np.testing.assert_allclose(bounds, [[0, 0, 0], [1, 0, 2]], atol=1e-7)  # metres; its y is our z


def test_gltf_keeps_its_tree_transforms_and_shared_meshes(tmp_path):
    scene = trimesh.Scene()
    move = trimesh.transformations.translation_matrix
    scene.add_geometry(BOX, node_name="left", geom_name="box", transform=move([1, 0, 0]))
    scene.add_geometry(BOX, node_name="right", geom_name="box", transform=move([-1, 0, 0]))
    ball = trimesh.creation.icosphere(1)
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0], [0, 1, 0])
    scene.add_geometry(ball, node_name="ball", geom_name="ball", parent_node_name="left", transform=turn)
    path = tmp_path / "tree.glb"
    scene.export(path)
    bodies = {b.name: b for b in open_file(path).scene().bodies}
    assert set(bodies) == {"/World/left/box", "/World/left/ball", "/World/right"}
    z_up = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    expected = z_up @ scene.graph.get("ball")[0]
    np.testing.assert_allclose(bodies["/World/left/ball"].world_from_body, expected, atol=1e-7)
    np.testing.assert_array_equal(
        bodies["/World/left/box"].mesh.vertices, bodies["/World/right"].mesh.vertices
    )


def test_gltf_materials_and_textures(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    pbr = trimesh.visual.material.PBRMaterial
    picture = Image.new("RGB", (2, 2), (255, 128, 0))
    packed = Image.new("RGB", (2, 2), (0, 51, 102))  # roughness 0.2 in green, metal 0.4 in blue
    paint = pbr(
        name="paint",
        baseColorFactor=[1.0, 0.5, 1.0, 1.0],
        metallicFactor=0.5,
        roughnessFactor=0.5,
        baseColorTexture=picture,
        metallicRoughnessTexture=packed,
        emissiveFactor=[0.1, 0.2, 0.3],
    )
    quad = trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], process=False
    )
    quad.visual = trimesh.visual.TextureVisuals(uv=quad.vertices[:, :2], material=paint)
    path = tmp_path / "paint.glb"
    quad.export(path)
    material = only_body(open_file(path)).material
    half = 128 / 255  # trimesh keeps factors in 8 bits
    decoded = ((half + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(material.maps["diffuseColor"].pixels[0, 0], [1, decoded * half, 0], atol=1e-3)
    np.testing.assert_allclose(material.maps["roughness"].pixels[0, 0], [0.1], atol=1e-6)
    np.testing.assert_allclose(material.maps["metallic"].pixels[0, 0], [0.2], atol=1e-6)
    np.testing.assert_allclose(material.emission, [0.1, 0.2, 0.3], atol=1e-6)
    assert material.maps["diffuseColor"].wrap == (Wrap.REPEAT, Wrap.REPEAT)
    mesh = only_body(open_file(path)).mesh
    np.testing.assert_allclose(mesh.uv, mesh.vertices[:, :2], atol=1e-6)  # v up again


@given(st.floats(-4, 4), st.floats(0.1, 3), st.floats(0.1, 3), st.floats(-2, 2), st.floats(-2, 2))
@settings(deadline=None)
def test_a_texture_transform_means_the_same_with_v_up(angle, sx, sy, tx, ty):
    """KHR_texture_transform: uv' = T R S uv with v down and R(r) = [[cos, sin], [-sin, cos]]."""
    degrees, scale, shift = place_in_st({"rotation": angle, "scale": [sx, sy], "offset": [tx, ty]})
    c, s = np.cos(angle), np.sin(angle)
    for u, v in ((0.0, 0.0), (0.3, 0.7), (1.0, 0.2)):
        down = np.array([[c, s], [-s, c]]) @ [sx * u, sy * v] + [tx, ty]
        r = np.radians(degrees)
        turn = np.array([[np.cos(r), -np.sin(r)], [np.sin(r), np.cos(r)]])
        up = turn @ (np.array(scale) * [u, 1 - v]) + shift
        np.testing.assert_allclose(up, [down[0], 1 - down[1]], atol=1e-9)


def test_gltf_cameras_and_lights(tmp_path):
    lights = [
        {
            "type": "spot",
            "intensity": 1366,
            "color": [1, 0.5, 0],
            "spot": {"outerConeAngle": 0.5, "innerConeAngle": 0.4},
        },
        {"type": "directional", "intensity": 683},
    ]
    nodes = [
        {"name": "eye", "camera": 0, "translation": [0, 1, 0]},
        {"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [0, 3, 0]},
        {"name": "sun", "extensions": {"KHR_lights_punctual": {"light": 1}}},
        {"name": "top", "mesh": 0},
    ]
    document, binary = triangle_gltf(
        nodes=nodes,
        scenes=[{"nodes": [0, 1, 2, 3]}],
        cameras=[{"type": "perspective", "perspective": {"yfov": 0.6, "aspectRatio": 1.6, "znear": 0.1}}],
        extensions={"KHR_lights_punctual": {"lights": lights}},
        extensionsUsed=["KHR_lights_punctual"],
    )
    scene = open_file(write(tmp_path, "lit.glb", glb(document, binary))).scene()
    spot, sun = scene.lights
    assert (spot.kind, sun.kind) == (LightKind.SPHERE, LightKind.DISTANT)
    np.testing.assert_allclose(spot.intensity, np.array([1, 0.5, 0]) * 1366 / LUMENS_PER_WATT, rtol=1e-5)
    np.testing.assert_allclose(sun.intensity, [1, 1, 1], rtol=1e-5)
    assert spot.cone_angle == pytest.approx(0.5, rel=1e-5)
    np.testing.assert_allclose(spot.world_from_light[:3, 3], [0, 0, 3], atol=1e-7)
    np.testing.assert_allclose(
        spot.world_from_light[:3, 2], [0, -1, 0], atol=1e-7
    )  # its z: glTF's z is our -y
    (camera,) = scene.cameras
    np.testing.assert_allclose(camera.world_from_camera[:3, 3], [0, 0, 1], atol=1e-7)
    np.testing.assert_allclose(camera.world_from_camera[:3, 2], [0, 1, 0], atol=1e-7)  # looks along glTF's -z
    _, rows = camera.sensor.resolution
    assert 2 * np.arctan(rows / 2 / camera.K[1, 1]) == pytest.approx(0.6, rel=1e-5)


def with_accessor(document, index, **changes):
    accessors = [dict(a) for a in document["accessors"]]
    accessors[index] |= changes
    return document | {"accessors": accessors}


BASE, BINARY = triangle_gltf()


@pytest.mark.parametrize(
    ("document", "binary", "says"),
    [
        (BASE, BINARY[:20], "must hold 42 bytes"),
        (BASE, BINARY[:36] + np.array([0, 1, 9], "<u2").tobytes(), "below 3"),
        (BASE, np.array([np.nan] * 9, "<f4").tobytes() + BINARY[36:], "finite"),
        (with_accessor(BASE, 0, count=10**12), BINARY, "needs more than the 36 bytes"),
        (with_accessor(BASE, 0, count=-1), BINARY, "count of 0 or more"),
        (with_accessor(BASE, 0, componentType=7), BINARY, "KeyError"),
        (with_accessor(BASE, 0, bufferView=5), BINARY, "bufferViews has 2 entries"),
        (BASE | {"nodes": [{"children": [0], "mesh": 0}]}, BINARY, "one parent"),
        (BASE | {"nodes": [{"children": [7], "mesh": 0}]}, BINARY, "one of the 1 nodes"),
        (BASE | {"nodes": [{"mesh": 4}]}, BINARY, "There are 1 mesh"),
        (BASE | {"meshes": []}, BINARY, "There are 0 mesh"),
        (BASE | {"extensionsRequired": ["KHR_draco_mesh_compression"]}, BINARY, "KHR_draco_mesh_compression"),
        (BASE | {"asset": {"version": "1.0"}}, BINARY, "version 2"),
        (BASE | {"nodes": [{}]}, BINARY, "shows nothing"),
        (BASE | {"buffers": [{"byteLength": 42, "uri": "https://example.org/a.bin"}]}, BINARY, "relative"),
        (BASE | {"buffers": [{"byteLength": 42, "uri": "gone.bin"}]}, BINARY, "gone.bin"),
        (BASE | {"materials": [{"pbrMetallicRoughness": {"roughnessFactor": 7}}]}, BINARY, "roughness"),
        (BASE | {"materials": ["red"]}, BINARY, "not valid glTF"),
    ],
)
def test_damaged_gltf_is_one_line(document, binary, says, tmp_path):
    path = write(tmp_path, "damaged.glb", glb(document, binary))
    with pytest.raises(FileError) as error:
        open_file(path)
    assert says in str(error.value)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def test_what_gltf_cannot_bring_is_listed(tmp_path):
    document, binary = triangle_gltf(animations=[{}], extensionsUsed=["KHR_materials_unlit"])
    losses = [str(p) for p in open_file(write(tmp_path, "a.glb", glb(document, binary))).problems]
    assert any("1 animation is left out" in text for text in losses)
    assert any("KHR_materials_unlit" in text for text in losses)
