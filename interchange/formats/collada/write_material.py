"""USD materials as COLLADA's: the nearest common profile, the GLSL of the BRDF, and the exact network in <extra>.

The common profile of a model that COLLADA does not have is the Phong whose radiance is nearest in the least
squares over directions of light and view.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Sdf, Usd, UsdShade

from interchange.brdf import Brdf
from interchange.brdf.blinn_phong import BlinnPhong
from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.formats.collada.effect import WRAPS
from interchange.formats.collada.extra import format_numbers, prim_element, relative_uri
from interchange.formats.collada.xml_writer import Output, add, add_extra, add_kept_extras, add_name
from interchange.formats.usd_material import read_material
from interchange.formats.usd_read import SceneReader
from interchange.formats.usd_values import Finder
from interchange.material import Material, Texture
from interchange.shader import GLSL, function

UV = "UV0"
MODEL = {Lambert: "lambert", Phong: "phong", BlinnPhong: "blinn"}
DIFFUSE, SPECULAR = ("diffuse", "diffuseColor"), ("specular", "specularColor")


@dataclass(frozen=True)
class Written:
    id: str
    uv_name: str  # texture coordinates that its textures ask for; "" for none


class Surfaces:
    def __init__(self, out: Output, reader: SceneReader) -> None:
        self.out, self.reader = out, reader
        self._known: dict[Sdf.Path, Written] = {}

    def material(self, usd: UsdShade.Material, time: Usd.TimeCode) -> Written:
        path = usd.GetPath()
        if path not in self._known:
            self._known[path] = self._write(usd, time)
        return self._known[path]

    def _write(self, usd: UsdShade.Material, time: Usd.TimeCode) -> Written:
        out, prim = self.out, usd.GetPrim()
        find = Finder(out.find.file)
        bound = read_material(prim, time, find, self.reader.texture)
        for problem in find.problems:
            out.find.loss(f"Other programs may see another material: {problem.message}", prim)
        name = out.new_id(prim.GetName())
        material = add(out.libraries["materials"], "material", id=name)
        effect_id = out.new_id(f"{name}-effect")
        add(material, "instance_effect", url=f"#{effect_id}")
        self._network(material, prim)
        add_name(material, prim)
        add_kept_extras(material, prim)
        effect = add(out.libraries["effects"], "effect", id=effect_id)
        self._common(effect, bound.material)
        _glsl(effect, bound.material, out.version)
        return Written(name, bound.uv_name)

    def _network(self, material: Any, prim: Usd.Prim) -> None:
        """Every shader below the material, and the material's own outputs."""
        technique = add_extra(material)
        root = prim.GetPath()
        for one in Usd.PrimRange(prim, Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate)):
            names = []
            for attribute in one.GetAuthoredAttributes():
                if any(not t.HasPrefix(root) for t in attribute.GetConnections()):
                    self.out.find.loss("A connection to a shader outside of the material is left out.", one)
                else:
                    names.append(attribute.GetName())
            element = prim_element(one, names, self.out.folder, self.out.find, root)
            if one != prim:
                element.set("path", str(one.GetPath().MakeRelativePath(root)))
            technique.append(element)

    def _common(self, effect: Any, material: Material) -> None:
        profile = add(effect, "profile_COMMON")
        technique = add(profile, "technique", sid="common")
        brdf = material.brdf
        kind = MODEL.get(type(brdf)) or "phong"
        diffuse, specular, n = _terms(brdf)
        model = add(technique, kind)
        maps = material.maps
        self._color(model, "emission", material.emission, material.emission_map, profile, technique)
        self._color(model, "diffuse", diffuse, _first(maps, DIFFUSE), profile, technique)
        if kind != "lambert":
            self._color(model, "specular", specular, _first(maps, SPECULAR), profile, technique)
            add(add(model, "shininess"), "float", format_numbers(np.array([n])), sid="shininess")
        if material.opacity_map is not None:
            transparent = add(model, "transparent", opaque="A_ONE")
            self._texture(transparent, material.opacity_map, profile, technique)
            add(add(model, "transparency"), "float", "1")
        elif material.opacity != 1.0:
            add(add(model, "transparent", opaque="A_ONE"), "color", "0 0 0 1")
            add(add(model, "transparency"), "float", format_numbers(np.array([material.opacity])))

    def _color(
        self,
        model: Any,
        tag: str,
        value: tuple[float, ...],
        texture: Texture | None,
        profile: Any,
        technique: Any,
    ) -> None:
        term = add(model, tag)
        if texture is not None and texture.file:
            self._texture(term, texture, profile, technique)
        else:
            add(term, "color", format_numbers(np.array([*value, 1.0])), sid=tag)

    def _texture(self, term: Any, texture: Texture, profile: Any, technique: Any) -> None:
        uri = relative_uri(Sdf.AssetPath(texture.file), self.out.folder)
        image = self.out.image(uri)
        surface, sampler = self.out.new_id(f"{image}-surface"), self.out.new_id(f"{image}-sampler")
        old = self.out.version == "1.4.1"
        params = []
        if old:
            params.append(add(profile, "newparam", sid=surface))
            add(add(params[0], "surface", type="2D"), "init_from", image)
        params.append(add(profile, "newparam", sid=sampler))
        inner = add(params[-1], "sampler2D")
        if old:
            add(inner, "source", surface)
        else:
            add(inner, "instance_image", url=f"#{image}")
        words = {wrap: word for word, wrap in reversed(WRAPS.items()) if word not in ("NONE", "MIRROR_ONCE")}
        for tag, wrap in zip(("wrap_s", "wrap_t"), texture.wrap, strict=True):
            add(inner, tag, words[wrap])
        for param in params:
            profile.insert(list(profile).index(technique), param)
        add(term, "texture", texture=sampler, texcoord=UV)


def _first(maps: dict[str, Texture], names: tuple[str, ...]) -> Texture | None:
    return next((maps[n] for n in names if n in maps), None)


def _terms(brdf: Brdf) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """k_d, k_s and shininess of COLLADA's lighting equation."""
    if isinstance(brdf, Lambert):
        return brdf.diffuse, (0.0, 0.0, 0.0), 1.0
    if isinstance(brdf, (Phong, BlinnPhong)):
        return brdf.diffuse, tuple(float(np.pi * s) for s in brdf.specular), brdf.n
    return nearest_phong(brdf)


def nearest_phong(brdf: Brdf) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """k_d, k_s, shininess of the Phong terms nearest to pi f cos(theta_i), for light at 0 to 60 degrees."""
    incidence = np.radians([0.0, 20.0, 40.0, 60.0])
    polar, azimuth = np.meshgrid(np.radians(np.arange(1, 80, 3)), np.radians(np.arange(0, 181, 15)))
    wo = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], -1)
    wo = wo.reshape(-1, 3)
    wi = np.stack([np.sin(incidence), 0 * incidence, np.cos(incidence)], -1)
    mirror = np.clip((wo @ (wi * [-1, -1, 1]).T).T, 0, 1)  # (I, O)
    radiance = np.pi * brdf.evaluate(wi[:, None], wo[None]) * wi[:, 2, None, None]
    radiance = np.nan_to_num(radiance.reshape(-1, 3))
    best = (np.inf, np.zeros((2, 3)), 1.0)
    for n in np.geomspace(1, 1e4, 41):
        terms = np.stack([np.repeat(wi[:, 2], len(wo)), (mirror**n).ravel()], axis=1)
        fit = np.maximum(np.linalg.lstsq(terms, radiance, rcond=None)[0], 0.0)
        error = float(np.sum((terms @ fit - radiance) ** 2))
        if error < best[0]:
            best = (error, fit, float(n))
    diffuse, specular = (tuple(float(x) for x in np.round(row, 6)) for row in best[1])
    return diffuse, specular, float(f"{best[2]:.4g}")


def _glsl(effect: Any, material: Material, version: str) -> None:
    """The BRDF as GLSL, for programs that take fragments from profile_GLSL."""
    code = material.glsl
    if not code:
        name = type(material.brdf).__name__
        numbers = ", ".join(f"{x:.9g}" for x in material.brdf.flat())
        count = len(material.brdf.flat())
        code = (
            f"// {name} in 1/sr; wi to the light, wo to the camera, in the shading frame\n{GLSL.prelude}\n"
            f"{function(material.brdf, GLSL, 'model')}"
            f"vec3 evaluate(vec3 wi, vec3 wo) {{ return model(wi, wo, float[{count}]({_decimals(numbers)})); }}\n"
        )
    profile = add(effect, "profile_GLSL")
    add(profile, "code", code, sid="brdf")
    technique = add(profile, "technique", sid="brdf-technique")
    draw = add(technique, "pass")
    if version != "1.4.1":
        draw = add(draw, "states")
    add(draw, "lighting_enable", value="true")


def _decimals(numbers: str) -> str:
    return ", ".join(n if any(c in n for c in ".e") else f"{n}.0" for n in numbers.split(", "))
