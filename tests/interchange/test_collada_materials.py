"""Materials, textures and GLSL of COLLADA files."""

from pathlib import Path

import numpy as np
import pytest

from interchange.brdf.blinn_phong import BlinnPhong
from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.formats.document import open_scene
from tests.interchange.test_collada import SQUARE, SUITE, collada, source


def worn(terms: str, bind: str = "", params: str = "") -> tuple[str, str]:
    library = (
        f'<library_effects><effect id="e"><profile_COMMON>{params}<technique sid="t">{terms}</technique>'
        '</profile_COMMON></effect></library_effects><library_materials><material id="mat">'
        '<instance_effect url="#e"/></material></library_materials>'
    )
    node = (
        '<node><instance_geometry url="#square"><bind_material><technique_common>'
        f'<instance_material symbol="m" target="#mat">{bind}</instance_material></technique_common></bind_material>'
        "</instance_geometry></node>"
    )
    return node, library


TERMS = (
    "<diffuse><color>0.5 0.25 0 1</color></diffuse><specular><color>1 0.5 0 1</color></specular>"
    "<shininess><float>7</float></shininess>"
)


@pytest.mark.parametrize(
    ("terms", "brdf"),
    [
        (f"<phong>{TERMS}</phong>", Phong((0.5, 0.25, 0), (1 / np.pi, 0.5 / np.pi, 0), 7)),
        (f"<blinn>{TERMS}</blinn>", BlinnPhong((0.5, 0.25, 0), (1 / np.pi, 0.5 / np.pi, 0), 7)),
        ("<lambert><diffuse><color>0.5 0.25 0 1</color></diffuse></lambert>", Lambert((0.5, 0.25, 0))),
        ("<lambert><diffuse><param ref='d'/></diffuse></lambert>", Lambert((0.125, 0.25, 0.5))),
        ("<constant><emission><color>1 2 3 1</color></emission></constant>", Lambert((0, 0, 0))),
    ],
)
def test_common_profiles_are_brdfs(tmp_path: Path, terms: str, brdf: object) -> None:
    """The radiance under a light of colour 1 is COLLADA's: pi f cos = k_d cos + k_s cos^n."""
    params = "<newparam sid='d'><float3>0.125 0.25 0.5</float3></newparam>"
    nodes, library = worn(terms, params=params)
    material = open_scene(collada(tmp_path, nodes, libraries=library)).scene().bodies[0].material
    assert type(material.brdf) is type(brdf)
    np.testing.assert_allclose(material.brdf.flat(), brdf.flat(), rtol=1e-6)  # type: ignore[attr-defined]
    if "constant" in terms:
        assert material.emission == (1, 2, 3)


@pytest.mark.parametrize(
    ("terms", "opacity"),
    [
        ("", 1.0),
        ("<transparency><float>0.3</float></transparency>", 0.3),
        (
            '<transparent opaque="A_ONE"><color>0 0 0 0.5</color></transparent>'
            "<transparency><float>0.5</float></transparency>",
            0.25,
        ),
        (
            '<transparent opaque="A_ZERO"><color>0 0 0 0.5</color></transparent>'
            "<transparency><float>0.5</float></transparency>",
            0.75,
        ),
        ('<transparent opaque="RGB_ZERO"><color>0.2 0.2 0.2 1</color></transparent>', 0.8),
        ('<transparent opaque="RGB_ONE"><color>0.2 0.2 0.2 1</color></transparent>', 0.2),
    ],
)
def test_opacity_is_the_specifications(tmp_path: Path, terms: str, opacity: float) -> None:
    nodes, library = worn(f"<lambert>{terms}</lambert>")
    material = open_scene(collada(tmp_path, nodes, libraries=library)).scene().bodies[0].material
    assert material.opacity == pytest.approx(opacity, abs=1e-5)


def test_textures_and_their_coordinates() -> None:
    scene = open_scene(SUITE / "twoSamplers.dae").scene()
    material = scene.bodies[0].material
    assert Path(material.maps["diffuse"].file).name == "collada.png"
    assert material.opacity_map is not None
    assert Path(material.opacity_map.file).name == "checkerboard.png"


def test_textures_of_1_5(tmp_path: Path) -> None:
    (tmp_path / "a b.png").write_bytes((SUITE / "checkerboard.png").read_bytes())
    params = "<newparam sid='s'><sampler2D><instance_image url='#i'/><wrap_s>MIRROR</wrap_s></sampler2D></newparam>"
    nodes, library = worn(
        "<lambert><diffuse><texture texture='s' texcoord='T'/></diffuse></lambert>", params=params
    )
    image = "<image id='i'><init_from><ref>./x/../a%20b.png</ref></init_from></image>"
    library += f"<library_images>{image}</library_images>"
    geometry = SQUARE.replace(
        '<vertices id="v">', source("t", "0 0 1 0 1 1 0 1", "S T") + '<vertices id="v">'
    ).replace("<vcount>", '<input semantic="TEXCOORD" source="#t" offset="0" set="3"/><vcount>')
    path = collada(tmp_path, nodes, geometry, library, version="1.5.0")
    body = open_scene(path).scene().bodies[0]
    texture = body.material.maps["diffuse"]
    assert (Path(texture.file).name, *texture.wrap) == ("a b.png", "mirror", "repeat")
    np.testing.assert_allclose(body.mesh.uv, body.mesh.vertices[:, :2])


def test_glsl_fragment_of_another_program(tmp_path: Path) -> None:
    code = "vec3 brdf(vec3 wi, vec3 wo, vec2 uv) { return vec3(0.1); }"
    library = (
        f'<library_effects><effect id="e"><profile_GLSL><code sid="c">{code}</code>'
        '<technique sid="t"><pass/></technique>'
        '</profile_GLSL></effect></library_effects><library_materials><material id="mat"><instance_effect url="#e"/>'
        "</material></library_materials>"
    )
    nodes, _ = worn("")
    material = open_scene(collada(tmp_path, nodes, libraries=library)).scene().bodies[0].material
    assert material.glsl.strip() == code
