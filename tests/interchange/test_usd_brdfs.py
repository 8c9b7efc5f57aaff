"""Every BRDF of the catalogue through a USD file: its numbers, settings, tables, parts and textures."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image as Pillow

from interchange.brdf import MODELS
from interchange.brdf.lafortune import Lafortune
from interchange.brdf.lambert import Lambert
from interchange.brdf.sum import Sum
from interchange.formats.document import open_scene
from interchange.formats.usd_author import author_scene
from interchange.material import Material, Texture
from interchange.mesh import Mesh
from interchange.problems import FileError
from interchange.scene import Body, Scene


def through_usd(material, path):
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    mesh = Mesh(
        np.column_stack([corner, np.zeros(4)]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        np.tile([0.0, 0, 1], (4, 1)),
        corner,
    )
    author_scene(Scene((Body("/plate", mesh, material),))).Export(str(path))
    return open_scene(path).scene().bodies[0].material


@pytest.mark.parametrize("ending", ["usda", "usdc"])
@pytest.mark.parametrize("name", MODELS)
def test_a_model_comes_back(name, ending, tmp_path):
    brdf = MODELS[name].drawn(np.random.default_rng(5), 2)
    if name == "usd_preview_surface":
        brdf = replace(brdf, useSpecularWorkflow=1.0)  # the specification's type is int
    found = through_usd(Material("/m", brdf), tmp_path / f"scene.{ending}").brdf
    assert found.structure == brdf.structure
    assert np.array(found.flat()) == pytest.approx(
        np.array(brdf.flat()), rel=1e-6, abs=1e-30
    )  # single precision
    assert found.tables == brdf.tables


def test_a_sum_comes_back_with_the_textures_of_its_weights_and_of_its_parts(tmp_path):
    inner = Sum(weight=[0.5], parts=(Lafortune(0.1, weight=[1.0], C=[(-1, -1, 1)], n=[8]),))
    brdf = Sum(weight=[0.25, 0.75], parts=(Lambert(0.5), inner))
    rng = np.random.default_rng(1)

    def texture(name, channels):
        pixels = rng.integers(0, 256, (4, 4, channels), np.uint8)
        file = tmp_path / f"{name}.png"
        Pillow.fromarray(pixels.squeeze()).save(file)
        stored = pixels / 255.0
        decoded = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
        return Texture(
            (decoded if channels == 3 else stored).astype(np.float32), file=str(file)
        )  # colours: sRGB

    maps = {"weight0": texture("a", 3), "part0_diffuse": texture("b", 3), "part1_part0_n": texture("c", 1)}
    found = through_usd(Material("/m", brdf, maps), tmp_path / "scene.usda")
    assert found.brdf.structure == brdf.structure
    assert found.brdf.parts[1].weight == inner.weight
    assert set(found.maps) == set(maps)
    for key, texture in maps.items():
        assert found.maps[key].pixels == pytest.approx(texture.pixels, abs=1e-6), key


PART = """#usda 1.0
def Mesh "plate" (prepend apiSchemas = ["MaterialBindingAPI"]) {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    rel material:binding = </m>
}
def Material "m" {
    token outputs:brdf:surface.connect = </m/Brdf.outputs:surface>
    def Shader "Brdf" {
        uniform token info:id = "Sum"
        SAYS
        token outputs:surface
    }
}
"""


@pytest.mark.parametrize(
    ("says", "expected"),
    [
        ("float inputs:weight0 = 1", "inputs"),
        ('token inputs:part0 = "Lambert"', "must be connected to a BRDF shader"),
        ("token inputs:part0.connect = </m/Brdf.outputs:surface>", "at most 8 deep"),
    ],
)
def test_a_sum_that_is_not_whole_is_refused(says, expected, tmp_path):
    path = tmp_path / "sum.usda"
    path.write_text(PART.replace("SAYS", says))
    with pytest.raises(FileError, match=expected):
        open_scene(path).scene()
