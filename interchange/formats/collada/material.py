"""COLLADA's materials as USD materials: a BRDF shader, and a UsdPreviewSurface for other software.

With lights as in ``light`` (irradiance pi I) the terms of COLLADA's lighting equation are those of the BRDFs:

    lambert   k_d (n . l) I                      Lambert     diffuse = k_d
    phong     ... + k_s (r . v)^shininess I      Phong       diffuse = k_d, specular = k_s / pi, n = shininess
    blinn     ... + k_s (n . h)^shininess I      BlinnPhong  likewise
    constant  no light                           Lambert     diffuse = 0
    emission                                     radiance sent out

Colours in the XML are linear; 8-bit colour textures are sRGB. The ambient colour is left out where it is not the
diffuse one, mirrors (reflective) always, and refraction. Opacity is that of the specification: transparent and
transparency under the mode in ``opaque``.
"""

from typing import Any

import numpy as np
from pxr import Gf, Sdf, Usd, UsdShade

from interchange.brdf import Brdf
from interchange.brdf.blinn_phong import BlinnPhong
from interchange.brdf.lambert import Lambert
from interchange.brdf.phong import Phong
from interchange.formats.collada.animation import Animations
from interchange.formats.collada.effect import Appearance, Term, TextureUse, read_effect
from interchange.formats.collada.extra import author_network, keep_extras, keep_name, own_extra
from interchange.formats.collada.library import Library
from interchange.formats.usd_author import author_material, free_path
from interchange.material import Material
from interchange.parameter import ParameterError

LUMINANCE = np.array([0.212671, 0.71516, 0.072169])  # the specification's weights for RGB_ZERO and RGB_ONE
SMOOTHEST = 0.010001  # the least exponent that the BRDFs take, after rounding to single precision


class Materials:
    """Authors each <material> once for each way in which its textures are bound to coordinates."""

    def __init__(self, stage: Usd.Stage, lib: Library, animations: Animations) -> None:
        self.stage, self.lib, self.animations = stage, lib, animations
        self.scope = "/World/Materials"
        self._made: dict[Any, UsdShade.Material | None] = {}
        self._read: dict[Any, Appearance | None] = {}

    def material(self, material: Any, primvars: dict[str, str]) -> UsdShade.Material | None:
        """``primvars``: texture coordinate semantic of the effect -> primvar of the mesh, "" for the rest."""
        effect = material.find("instance_effect")
        if effect is None:
            self.lib.find.error("A material must have an instance_effect.", material)
            return None
        if material not in self._read:
            found = self.lib.resolve(effect.get("url"), effect, "effect")
            self._read[material] = None if found is None else read_effect(found, effect, self.lib)
        appearance = self._read[material]
        if appearance is None:
            return None
        uses = [t.texture for t in appearance.terms.values() if t.texture is not None]
        bound = tuple(sorted({(u.texcoord, primvars.get(u.texcoord, primvars.get("", "st"))) for u in uses}))
        key = (material, bound)
        if key not in self._made:
            self._made[key] = self._author(material, appearance, dict(bound))
        return self._made[key]

    def unused(self) -> None:
        """Author the materials that nothing wears where this program wrote them; note the others."""
        used = {material for material, _ in self._made}
        for material in self.lib.main.iterfind("library_materials/material"):
            if material in used:
                continue
            extra = own_extra(material)
            if extra is not None and extra.find("prim") is not None:
                self._author(material, Appearance("lambert"), {})
            else:
                self.lib.find.note("Nothing wears this material; it is left out.", material)

    def _author(
        self, material: Any, appearance: Appearance, bound: dict[str, str]
    ) -> UsdShade.Material | None:
        if not self.stage.GetPrimAtPath(self.scope):
            self.stage.DefinePrim(self.scope, "Scope")
        path = free_path(self.stage, self.scope, material.get("id") or material.get("name") or "material")
        extra = own_extra(material)
        if extra is not None and extra.find("prim") is not None:
            usd = UsdShade.Material.Define(self.stage, path)
            author_network(usd.GetPrim(), extra, self.lib)
        else:
            made = self._common(path, material, appearance, bound)
            if made is None:
                return None
            usd = made
        keep_name(usd.GetPrim(), material)
        keep_extras(usd.GetPrim(), material)
        return usd

    def _common(
        self, path: str, material: Any, appearance: Appearance, bound: dict[str, str]
    ) -> UsdShade.Material | None:
        opacity = self._opacity(appearance, material)
        emission = appearance.color("emission")
        try:
            brdf = brdf_of(appearance)
        except ParameterError as error:
            self.lib.find.error(str(error), material)
            return None
        plain = Material(
            brdf=brdf,
            emission=(0.0, 0.0, 0.0) if emission.texture else _triple(emission.value),
            opacity=opacity,
            glsl=appearance.glsl,
        )
        usd = author_material(self.stage, path, plain)
        preview = UsdShade.Shader(self.stage.GetPrimAtPath(f"{path}/Preview"))
        shader = UsdShade.Shader(self.stage.GetPrimAtPath(f"{path}/Brdf"))
        inputs: list[tuple[str, float, list[tuple[UsdShade.Shader, str]]]] = [
            ("emission", 1.0, [(preview, "emissiveColor")])
        ]
        if not appearance.glsl:
            inputs.append(("diffuse", 1.0, [(shader, "diffuse"), (preview, "diffuseColor")]))
            if appearance.model in ("phong", "blinn"):
                inputs.append(("specular", 1 / np.pi, [(shader, "specular")]))
                inputs.append(("shininess", 1.0, [(shader, "n")]))
        for name, factor, targets in inputs:
            term = appearance.terms.get(name)
            if term is None or (appearance.model == "constant" and name == "diffuse"):
                continue
            if term.texture is not None:
                image = self._texture(path, name, term.texture, bound, (factor, 0.0), "auto")
                output = image.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
                for target, word in targets:
                    target.CreateInput(word, Sdf.ValueTypeNames.Color3f).ConnectToSource(output)
            else:
                self._animate(term, factor, targets)
        self._opacity_texture(path, appearance, preview, bound)
        self._left_out(appearance, material)
        return usd

    def _animate(self, term: Term, factor: float, targets: list[tuple[UsdShade.Shader, str]]) -> None:
        track = None if term.element is None else self.animations.track(term.element, term.value)
        if track is None:
            return
        times = track.samples()
        for target, word in targets:
            color = len(term.value) > 1
            kind = Sdf.ValueTypeNames.Color3f if color else Sdf.ValueTypeNames.Float
            given = target.CreateInput(word, kind)
            for time, value in zip(times, track.at(times) * factor, strict=True):
                given.Set(
                    Gf.Vec3f(*value[:3]) if color else max(float(value[0]), SMOOTHEST), Usd.TimeCode(time)
                )

    def _texture(
        self,
        path: str,
        name: str,
        use: TextureUse,
        bound: dict[str, str],
        scale_bias: tuple[float, float],
        space: str,
    ) -> UsdShade.Shader:
        varname = bound[use.texcoord]
        reader = UsdShade.Shader.Define(self.stage, f"{path}/Reader_{varname}")
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set(varname)
        image = UsdShade.Shader.Define(self.stage, f"{path}/Texture_{name}")
        image.CreateIdAttr("UsdUVTexture")
        image.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(str(use.file)))
        image.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(
            reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
        )
        for axis, wrap in zip("ST", use.wrap, strict=True):
            image.CreateInput(f"wrap{axis}", Sdf.ValueTypeNames.Token).Set(wrap.value)
        image.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set(space)
        scale, bias = scale_bias
        if (scale, bias) != (1.0, 0.0):
            image.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(scale, scale, scale, scale))
            image.CreateInput("bias", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(bias, bias, bias, bias))
        return image

    def _opacity(self, appearance: Appearance, material: Any) -> float:
        if "transparent" not in appearance.terms and "transparency" not in appearance.terms:
            return 1.0
        transparent = appearance.color("transparent")
        amount = float(appearance.color("transparency", (1.0,)).value[0])
        if transparent.texture is not None:
            return 1.0
        if appearance.opaque.startswith("A"):
            share = float(transparent.value[3]) * amount
        else:
            if np.ptp(transparent.value[:3]) > 1e-6:
                self.lib.find.loss("A coloured transparency is drawn by its luminance.", material)
            share = float(transparent.value[:3] @ LUMINANCE) * amount
        opacity = 1.0 - share if appearance.opaque.endswith("ZERO") else share
        if not -1e-6 <= opacity <= 1 + 1e-6:
            self.lib.find.loss(f"An opacity of {opacity:g} is drawn as the nearest of [0, 1].", material)
        opacity = min(max(opacity, 0.0), 1.0)
        if opacity == 0.0:
            mode = f"transparent and transparency under {appearance.opaque}"
            self.lib.find.note(f"By its {mode} the material cannot be seen.", material)
        return opacity

    def _opacity_texture(
        self, path: str, appearance: Appearance, preview: UsdShade.Shader, bound: dict[str, str]
    ) -> None:
        use = appearance.color("transparent").texture
        if use is None:
            return
        amount = float(appearance.color("transparency", (1.0,)).value[0])
        scale_bias = (-amount, 1.0) if appearance.opaque.endswith("ZERO") else (amount, 0.0)
        image = self._texture(path, "transparent", use, bound, scale_bias, "raw")
        channel = "a"
        if appearance.opaque.startswith("RGB"):
            channel = "r"
            self.lib.find.loss("Of a coloured transparency texture the red channel is drawn.", use.element)
        output = image.CreateOutput(channel, Sdf.ValueTypeNames.Float)
        preview.CreateInput("opacity", Sdf.ValueTypeNames.Float).ConnectToSource(output)

    def _left_out(self, appearance: Appearance, material: Any) -> None:
        find = self.lib.find
        ambient, diffuse = appearance.color("ambient"), appearance.color("diffuse")
        same = (
            ambient.texture is None and diffuse.texture is None and np.allclose(ambient.value, diffuse.value)
        )
        if not same and (ambient.texture is not None or ambient.value[:3].any()):
            find.loss("An ambient colour that is not the diffuse one is left out.", material)
        mirror = appearance.color("reflectivity", (1.0,)).value[0]
        reflective = appearance.color("reflective")
        if mirror and (reflective.texture is not None or reflective.value[:3].any()):
            find.loss("The mirror reflection (reflective) is left out.", material)


def brdf_of(appearance: Appearance) -> Brdf:
    """The catalogue's model of a COLLADA appearance. Raises ParameterError outside its bounds."""
    if appearance.glsl or appearance.model == "constant":
        return Lambert((0.0, 0.0, 0.0))
    diffuse = _triple(appearance.color("diffuse").value)
    if appearance.model == "lambert":
        return Lambert(diffuse)
    specular = _triple(appearance.color("specular").value / np.pi)
    n = max(float(appearance.color("shininess", (SMOOTHEST,)).value[0]), SMOOTHEST)
    return (Phong if appearance.model == "phong" else BlinnPhong)(diffuse, specular, n)


def _triple(value: np.ndarray) -> tuple[float, float, float]:
    return float(value[0]), float(value[1]), float(value[2])
