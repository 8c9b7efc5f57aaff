"""Materials, textures and GLSL of USD files."""

import numpy as np
import pytest
import trimesh
from PIL import Image as Pillow

from interchange.formats.document import open_scene
from interchange.problems import FileError
from tests.interchange.test_usd import HEAD, written


def test_a_picture_inside_a_part_is_put_beside_the_scene(tmp_path):
    box = trimesh.creation.box((1, 1, 1))
    image = Pillow.fromarray(np.arange(192, dtype=np.uint8).reshape(8, 8, 3))
    skin = trimesh.visual.TextureVisuals(uv=np.zeros((8, 2)), image=image)
    trimesh.Trimesh(box.vertices, box.faces, visual=skin).export(tmp_path / "part.glb")
    open_scene(tmp_path / "part.glb").save(tmp_path / "part.usda")
    assert "@part_pictures/" in (tmp_path / "part.usda").read_text()
    (body,) = open_scene(tmp_path / "part.usda").scene().bodies
    assert body.material.maps["diffuseColor"].file.startswith(str(tmp_path))


TEXTURED = """
def Material "M" {
    token outputs:surface.connect = </M/P.outputs:surface>
    def Shader "P" { uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>
        float inputs:roughness.connect = </M/T.outputs:g>
        token outputs:surface }
    def Shader "T" { uniform token info:id = "UsdUVTexture"
        asset inputs:file = @./paint.png@
        token inputs:sourceColorSpace = "raw"
        token inputs:wrapS = "repeat"
        token inputs:wrapT = "clamp"
        float4 inputs:scale = (0.5, 0.5, 0.5, 1)
        float4 inputs:bias = (0.25, 0.25, 0.25, 0)
        float2 inputs:st.connect = </M/X.outputs:result>
        float3 outputs:rgb
        float outputs:g }
    def Shader "X" { uniform token info:id = "UsdTransform2d"
        float2 inputs:in.connect = </M/R.outputs:result>
        float inputs:rotation = 90
        float2 inputs:scale = (2, 1)
        float2 inputs:translation = (0.5, 0)
        float2 outputs:result }
    def Shader "R" { uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "map1"
        float2 outputs:result } }
def Plane "Q" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </M> }
"""


def test_a_texture_is_scaled_biased_and_placed_as_the_specification_says(tmp_path):
    pixels = np.array([[[0, 51, 102], [255, 255, 255]]], np.uint8)
    Pillow.fromarray(pixels).save(tmp_path / "paint.png")
    material = open_scene(written(tmp_path, TEXTURED)).scene().bodies[0].material
    color, rough = material.maps["diffuseColor"], material.maps["roughness"]
    assert color.pixels[0, 0] == pytest.approx(pixels[0, 0] / 255 * 0.5 + 0.25, abs=1e-6)
    assert rough.pixels.shape[2] == 1
    assert rough.pixels[0, 0, 0] == pytest.approx(51 / 255 * 0.5 + 0.25, abs=1e-6)
    assert [w.value for w in color.wrap] == ["repeat", "clamp"]
    # scale, then rotate by 90 degrees counter-clockwise, then translate: (u, v) -> (-v + 0.5, 2 u)
    assert color.uv_from_st @ [0.25, 0.75, 1] == pytest.approx([-0.25, 0.5, 1])


def test_a_missing_texture_is_an_error_that_names_it(tmp_path):
    with pytest.raises(FileError, match=r'/M/T.inputs:file: The texture "./paint.png" is not there'):
        open_scene(written(tmp_path, TEXTURED)).scene()


def test_a_glsl_fragment_is_read(tmp_path):
    text = """def Material "M" { token outputs:brdf:surface.connect = </M/B.outputs:surface>
    def Shader "B" { uniform token info:implementationSource = "sourceCode"
        uniform string info:glsl:sourceCode = "vec3 brdf(vec3 wi, vec3 wo, vec2 uv) { return vec3(0.1); }"
        token outputs:surface } }
    def Cube "C" (prepend apiSchemas = ["MaterialBindingAPI"]) { rel material:binding = </M> }"""
    file = tmp_path / "scene.usda"
    file.write_text(
        HEAD.format(unit=1, up="Z", more="")
        + text.replace("outputs:surface }", "outputs:surface\n}")
        .replace("} }", "}\n}")
        .replace("</M> }", "</M>\n}")
    )
    assert "vec3(0.1)" in open_scene(file).scene().bodies[0].material.glsl
