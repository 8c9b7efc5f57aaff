"""A UsdShade material as a ``Material``: its BRDF shader, or its UsdPreviewSurface, with textures.

``outputs:brdf:surface`` names a model of the catalogue; without it the UsdPreviewSurface on ``outputs:surface``
is the model. What emits, what is transparent and the normal map come from the UsdPreviewSurface in both cases.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pxr import Usd, UsdShade

from interchange.brdf import BY_NAME, Brdf
from interchange.brdf.lambert import Lambert
from interchange.brdf.sum import Sum
from interchange.brdf.usd_preview_surface import UsdPreviewSurface
from interchange.formats.usd_values import Finder, asset
from interchange.material import Material, Texture, Wrap
from interchange.parameter import (
    Kind,
    Parameter,
    ParameterError,
    Setting,
    TableOf,
    parameters,
    settings,
    tables,
)
from interchange.problems import FileError, did_you_mean

TextureLoader = Callable[[str, str, tuple[float, ...], tuple[float, ...], str], Texture]

# what UsdPreviewSurface has beside its reflectance
BESIDE = {
    "emissiveColor",
    "opacity",
    "opacityThreshold",
    "normal",
    "displacement",
    "occlusion",
    "opacityMode",
}


@dataclass(frozen=True)
class Bound:
    """A material and the name of the texture coordinates that it reads ("" for none)."""

    material: Material
    uv_name: str


def read_material(prim: Usd.Prim, time: Usd.TimeCode, find: Finder, load: TextureLoader) -> Bound:
    """Errors go to ``find``; what could not be read is then mid grey, and the scene is refused."""
    usd = UsdShade.Material(prim)
    reader = _Reader(time, find, load)
    preview, _, _ = usd.ComputeSurfaceSource()
    own, _, _ = usd.ComputeSurfaceSource("brdf")
    if usd.GetSurfaceOutput("brdf") and own and own.GetPrim() != (preview.GetPrim() if preview else None):
        if own.GetImplementationSource() == UsdShade.Tokens.sourceCode:
            material = Material(glsl=own.GetSourceCode("glsl") or "")
            if not material.glsl:
                find.error("A sourceCode shader must carry info:glsl:sourceCode.", own.GetPrim())
        else:
            material = reader.model(own)
    elif preview and preview.GetIdAttr().Get() == "UsdPreviewSurface":
        material = reader.model(preview)
    elif preview:
        name = preview.GetIdAttr().Get()
        hint = did_you_mean(str(name), BY_NAME)
        find.error(f'The surface shader "{name}" is not known.{hint}', preview.GetPrim(), "info:id")
        material = Material()
    else:
        others = sorted({o.GetBaseName() for o in usd.GetSurfaceOutputs()})
        find.note(
            f"The material has no surface that is known ({', '.join(others) or 'none'}); it is drawn grey.",
            prim,
        )
        material = Material(brdf=Lambert((0.18, 0.18, 0.18)))
    if preview and preview.GetIdAttr().Get() == "UsdPreviewSurface":
        material = reader.beside(material, preview)
    return Bound(replace(material, name=str(prim.GetPath()), where=find.where(prim)), reader.uv_name)


class _Reader:
    def __init__(self, time: Usd.TimeCode, find: Finder, load: TextureLoader) -> None:
        self.time, self.find, self.load = time, find, load
        self.uv_name = ""
        self.depth = 0

    def model(self, shader: UsdShade.Shader) -> Material:
        prim, name = shader.GetPrim(), str(shader.GetIdAttr().Get())
        if name not in BY_NAME:
            known = ", ".join(BY_NAME)
            self.find.error(
                f'No BRDF is called "{name}".{did_you_mean(name, BY_NAME)} Known: {known}.', prim, "info:id"
            )
            return Material()
        model = BY_NAME[name]
        if model is Sum:
            return self._sum(shader)
        values, maps = {}, {}
        declared: dict[str, Any] = {**parameters(model), **settings(model), **tables(model)}
        for given in shader.GetInputs():
            word = given.GetBaseName()
            if word in BESIDE and model is UsdPreviewSurface:
                continue
            if word not in declared:
                self.find.error(
                    f"{name} has no input of this name.{did_you_mean(word, declared)}", prim, f"inputs:{word}"
                )
                continue
            value, texture = self.input(given, declared[word])
            if texture is not None and not isinstance(declared[word], Parameter):
                self.find.error("This input must be a value; it takes no texture.", prim, f"inputs:{word}")
            elif texture is not None:
                maps[word] = texture
            elif value is not None:
                values[word] = value
        self._fill(model, values, maps)
        return Material(brdf=self._build(model, values, prim), maps=maps)

    @staticmethod
    def _fill(model: type[Brdf], values: dict[str, Any], maps: dict[str, Texture]) -> None:
        """Give a textured parameter of the lobes as many entries as the others have; the texture replaces them."""
        per_lobe = {name: about for name, about in parameters(model).items() if about.per_lobe}
        lobes = max((len(values[name]) for name in per_lobe if name in values), default=1)
        for name in per_lobe.keys() & maps.keys():
            about = per_lobe[name]
            middle = (about.low + about.high) / 2
            values[name] = [middle if about.kind is Kind.FLOAT else (middle,) * 3] * lobes

    def _sum(self, shader: UsdShade.Shader) -> Material:
        """weight0, part0, weight1, part1 ...: every part is a shader that is connected."""
        prim = shader.GetPrim()
        inputs = {given.GetBaseName(): given for given in shader.GetInputs()}
        count = sum(name.startswith("part") for name in inputs)
        expected = {f"{word}{k}" for word in ("part", "weight") for k in range(count)}
        for word in inputs.keys() - expected:
            self.find.error(
                f"Sum has inputs part0, weight0, part1, weight1 ...; got {word}.", prim, f"inputs:{word}"
            )
        self.depth += 1
        parts, weights, maps = [], [], {}
        for k in range(count):
            given = inputs.get(f"part{k}")
            sources, _ = given.GetConnectedSources() if given else ([], [])
            inner = UsdShade.Shader(sources[0].source.GetPrim()) if sources else UsdShade.Shader()
            if not inner or self.depth > 8:
                self.find.error(
                    "A part of a Sum must be connected to a BRDF shader, at most 8 deep.",
                    prim,
                    f"inputs:part{k}",
                )
                continue
            part = self.model(inner)
            weight, texture = (
                self.input(inputs[f"weight{k}"], None) if f"weight{k}" in inputs else (1.0, None)
            )
            if texture is not None:
                maps[f"weight{k}"] = texture
            maps |= {f"part{k}_{name}": found for name, found in part.maps.items()}
            parts.append(part.brdf)
            weights.append(np.broadcast_to(1.0 if weight is None else weight, 3))
        self.depth -= 1
        built = self._build(Sum, {"weight": tuple(map(tuple, weights)), "parts": tuple(parts)}, prim)
        return Material(brdf=built, maps=maps)

    def _build(self, model: type[Brdf], values: dict[str, Any], prim: Usd.Prim) -> Brdf:
        try:
            return model(**values)
        except ParameterError as error:
            self.find.error(str(error), prim)
            return model()

    def input(
        self, given: UsdShade.Input, about: Parameter | Setting | TableOf | None
    ) -> tuple[Any, Texture | None]:
        """(value, None) or (None, texture) of an input; (None, None) where it says nothing."""
        for attribute in UsdShade.Utils.GetValueProducingAttributes(given):
            kind = UsdShade.Utils.GetType(attribute.GetName())
            if kind == UsdShade.AttributeType.Output:
                return None, self.texture(
                    UsdShade.Shader(attribute.GetPrim()), attribute.GetBaseName(), given
                )
            value = attribute.Get(self.time)
            if value is None:
                return None, None
            if isinstance(about, Setting):
                return value, None
            if isinstance(about, TableOf):
                return np.array(value, np.float32), None
            if about is not None and about.per_lobe and about.kind is not Kind.FLOAT:
                return [tuple(map(float, v)) for v in value], None
            return (tuple(map(float, value)) if hasattr(value, "__len__") else float(value)), None
        return None, None

    def texture(self, shader: UsdShade.Shader, output: str, given: UsdShade.Input) -> Texture | None:
        prim = shader.GetPrim()
        name = shader.GetIdAttr().Get() if shader else None
        if name != "UsdUVTexture":
            self.find.error(
                f'An input can be connected to a UsdUVTexture; this is "{name}".',
                given.GetPrim(),
                given.GetFullName(),
            )
            return None
        attribute = self._source(shader, "file")
        written, file = asset(attribute, self.time) if attribute else ("", "")
        if not file:
            what = f'The texture "{written}" is not there.' if written else "The texture names no file."
            self.find.error(what, prim, "inputs:file")
            return None
        if "<UDIM>" in written:
            self.find.error("Textures in UDIM tiles cannot be read.", prim, "inputs:file")
            return None

        def numbers(word: str, default: tuple[float, ...]) -> tuple[float, ...]:
            source = self._source(shader, word)
            value = source.Get(self.time) if source else None
            return tuple(map(float, value)) if value is not None else default

        def token(word: str, default: str) -> str:
            source = self._source(shader, word)
            return str(source.Get(self.time) if source and source.HasValue() else default)

        wrap = []
        for word in ("wrapS", "wrapT"):
            mode = token(word, "useMetadata")
            wrap.append(Wrap(mode) if mode in list(Wrap) else Wrap.REPEAT if mode == "repeat" else Wrap.BLACK)
        try:
            plain = self.load(
                file,
                token("sourceColorSpace", "auto"),
                numbers("scale", (1, 1, 1, 1)),
                numbers("bias", (0, 0, 0, 0)),
                output,
            )
        except FileError as error:
            self.find.error(str(error), prim, "inputs:file")
            return None
        return replace(plain, wrap=(wrap[0], wrap[1]), uv_from_st=self._place(shader))

    def _source(self, shader: UsdShade.Shader, word: str) -> Usd.Attribute | None:
        given = shader.GetInput(word)
        found = UsdShade.Utils.GetValueProducingAttributes(given) if given else []
        return found[0] if found else None

    def _place(self, texture: UsdShade.Shader) -> np.ndarray:
        """The (3, 3) map from the mesh's coordinates to the texture's; notes the name of the coordinates."""
        place = np.eye(3)
        shader, word = texture, "st"
        for _ in range(16):  # a chain of transforms ends, or it is a cycle
            source = self._source(shader, word)
            if source is None or UsdShade.Utils.GetType(source.GetName()) != UsdShade.AttributeType.Output:
                return place
            shader = UsdShade.Shader(source.GetPrim())
            name = shader.GetIdAttr().Get()
            if name == "UsdTransform2d":
                place = place @ self._transform(shader)
                word = "in"
            elif name in ("UsdPrimvarReader_float2", "UsdPrimvarReader_float3"):
                varname = self._source(shader, "varname")
                self.uv_name = str(varname.Get(self.time) if varname else "") or "st"
                return place
            else:
                break
        self.find.error(
            "Texture coordinates must come from a UsdPrimvarReader_float2.", texture.GetPrim(), "inputs:st"
        )
        return place

    def _transform(self, shader: UsdShade.Shader) -> np.ndarray:
        def get(word: str, default: Any) -> Any:
            source = self._source(shader, word)
            return source.Get(self.time) if source and source.HasValue() else default

        angle = np.radians(get("rotation", 0.0))
        (sx, sy), (tx, ty) = get("scale", (1, 1)), get("translation", (0, 0))
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, tx], [s, c, ty], [0, 0, 1]])
        return turn @ np.diag([sx, sy, 1.0])  # the specification's order: scale, rotate, translate

    def beside(self, material: Material, preview: UsdShade.Shader) -> Material:
        """Emission, opacity and normals of the preview surface."""
        found: dict[str, Any] = {}
        for word, value_field, map_field in (
            ("emissiveColor", "emission", "emission_map"),
            ("opacity", "opacity", "opacity_map"),
            ("opacityThreshold", "opacity_threshold", ""),
            ("normal", "", "normal_map"),
        ):
            given = preview.GetInput(word)
            if not given:
                continue
            value, texture = self.input(given, None)
            if texture is not None and map_field:
                found[map_field] = texture
            elif value is not None and value_field:
                found[value_field] = value
        for word in ("displacement", "occlusion"):
            given = preview.GetInput(word)
            value = self.input(given, None) if given else (None, None)
            plain = {"displacement": 0.0, "occlusion": 1.0}[word]
            if value[1] is not None or (value[0] is not None and value[0] != plain):
                self.find.loss(f"{word} is not drawn.", preview.GetPrim(), f"inputs:{word}")
        opacity = found.get("opacity", 1.0)
        if not 0.0 <= opacity <= 1.0:
            self.find.error(
                f"opacity must lie in [0, 1]; got {opacity:g}.", preview.GetPrim(), "inputs:opacity"
            )
            found["opacity"] = 1.0
        return replace(material, **found)
