"""glTF 2.0 (.glb, .gltf): meshes, hierarchy, metallic-roughness materials with textures, cameras, punctual lights.

A glTF material is the UsdPreviewSurface of the same numbers: both are GGX of alpha = roughness² over a matte
base. Lengths are metres, y is up, and the stage says so. Lights are given in candela and lux; they become W/sr
and W/m² by 683 lm/W, the efficacy of light at 555 nm. Pictures inside a file are kept in the user's cache under
the SHA-256 of their bytes, so that USD can name them.
"""

import hashlib
import os
from pathlib import Path
from typing import Any

import numpy as np

from interchange.brdf.usd_preview_surface import UsdPreviewSurface
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.formats.base import Format, Options
from interchange.formats.document import Document
from interchange.formats.gltf_data import Gltf, Node, read_gltf, texture_uses
from interchange.formats.isolation import isolated
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.parameter import ParameterError
from interchange.problems import FileError, Problem, Severity, Where

LUMENS_PER_WATT = 683.0
COLUMNS = 640  # px of a camera, of which glTF gives the field of view alone
SECONDS, SECONDS_PER_MEGABYTE = 30.0, 2.0
PICTURES = {b"\x89PNG": ".png", b"\xff\xd8\xff": ".jpg", b"RIFF": ".webp"}
WRAP = {10497: "repeat", 33071: "clamp", 33648: "mirror"}


Feed = tuple[str, str, str, tuple[float, ...], tuple[float, ...]]


class GltfFormat(Format):
    name = "glTF"
    extensions = (".glb", ".gltf")

    def recognises(self, head: bytes) -> bool:
        return head.startswith(b"glTF")

    def read(self, path: Path, options: Options) -> Document:
        """A stage in metres, y up. Raises FileError with every problem."""
        megabytes = path.stat().st_size / 1e6
        gltf = isolated(read_gltf, path, seconds=SECONDS + SECONDS_PER_MEGABYTE * megabytes)
        drawn = any(
            n.light >= 0 or n.camera >= 0 or (n.mesh >= 0 and gltf.meshes[n.mesh][1]) for n in gltf.nodes
        )
        if not drawn:
            raise FileError(
                Problem("The file shows nothing: no triangles, lights or cameras.", Where(str(path)))
            )
        try:
            return _Author(gltf, path).document()
        except (ArithmeticError, AttributeError, LookupError, ParameterError, TypeError, ValueError) as error:
            wrong = (
                f"{type(error).__name__}: {error}" if not isinstance(error, ParameterError) else str(error)
            )
            raise FileError(Problem(f"This is not valid glTF: {wrong}", Where(str(path)))) from error


class _Author:
    def __init__(self, gltf: Gltf, path: Path) -> None:
        from interchange.formats.usd_author import new_stage

        self.gltf, self.path = gltf, path
        self.stage = new_stage(1.0, up_axis="Y")
        self.problems = list(gltf.problems)

    def say(self, message: str, place: str, severity: Severity = Severity.LOSS) -> None:
        self.problems.append(Problem(message, Where(str(self.path), place), severity))

    def document(self) -> Document:
        from pxr import UsdGeom

        from interchange.formats.gltf_author import author_tree

        written = self.gltf.json.get("materials", [])
        if written:
            UsdGeom.Scope.Define(self.stage, "/World/Materials")
        materials = {i: self.material(i, m) for i, m in enumerate(written)}
        names = [
            n.name or (self.gltf.meshes[n.mesh][0] if n.mesh >= 0 else "") or f"node_{i}"
            for i, n in enumerate(self.gltf.nodes)
        ]
        wrong = {p.material for _, ps in self.gltf.meshes for p in ps} - set(materials) - {-1}
        if wrong:
            raise FileError(
                Problem(f"There are {len(written)} materials; got index {min(wrong)}.", Where(str(self.path)))
            )
        author_tree(self.stage, self.gltf, materials, names, self.extra)
        return Document(self.stage, self.path, self.problems)

    def material(self, index: int, written: dict[str, Any]) -> Any:
        from interchange.formats.usd_author import author_material, free_path

        name = str(written.get("name", "")) or f"material_{index}"
        pbr, more = written.get("pbrMetallicRoughness", {}), written.get("extensions", {})
        coat = more.get("KHR_materials_clearcoat", {})
        strength = float(more.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0))
        base = [float(x) for x in pbr.get("baseColorFactor", (1, 1, 1, 1))]
        mode = written.get("alphaMode", "OPAQUE")
        if any(float(v) != 1 for v in np.ravel(list(more.get("KHR_materials_specular", {}).values() or [1]))):
            self.say("The strength and colour of the specular reflection are left out.", f'material "{name}"')
        for extension in sorted(set(more) - _DONE):
            self.say(f"The extension {extension} is left out.", f'material "{name}"')
        uses = texture_uses(written)
        if "occlusion" in uses:
            self.say(
                "Baked occlusion is left out: the renderers work it out.", f'material "{name}"', Severity.NOTE
            )
        factors: dict[str, Any] = {
            "diffuseColor": tuple(base[:3]),
            "metallic": float(pbr.get("metallicFactor", 1)),
            "roughness": float(pbr.get("roughnessFactor", 1)),
            "clearcoat": float(coat.get("clearcoatFactor", 0)),
            "clearcoatRoughness": float(coat.get("clearcoatRoughnessFactor", 0)),
            "ior": float(more.get("KHR_materials_ior", {}).get("ior", 1.5)),
        }
        emission = tuple(strength * float(x) for x in written.get("emissiveFactor", (0, 0, 0)))
        material = Material(
            name,
            UsdPreviewSurface(**factors),
            emission=(emission[0], emission[1], emission[2]),
            opacity=1.0 if mode == "OPAQUE" else base[3],
            opacity_threshold=float(written.get("alphaCutoff", 0.5)) if mode == "MASK" else 0.0,
        )
        usd = author_material(self.stage, free_path(self.stage, "/World/Materials", name), material)
        for use, inputs in self.textures(factors, emission, base[3], mode, written).items():
            if use in uses:
                for word, output, space, scale, bias in inputs:
                    self.texture(usd, word, output, space, scale, bias, uses[use], f'material "{name}"')
        return usd

    def textures(
        self, factors: dict[str, Any], emission: Any, alpha: float, mode: str, written: dict[str, Any]
    ) -> dict[str, list[Feed]]:
        """For each glTF texture the preview inputs that it feeds: name, channels, colour space, scale, bias."""
        none = (0.0, 0.0, 0.0, 0.0)
        base: list[Feed] = [("diffuseColor", "rgb", "sRGB", (*factors["diffuseColor"], 1.0), none)]
        if mode != "OPAQUE":
            base.append(("opacity", "a", "sRGB", (1.0, 1.0, 1.0, alpha), none))
        n = float(written.get("normalTexture", {}).get("scale", 1.0))

        def plain(word: str, output: str) -> Feed:
            return word, output, "raw", (factors[word],) * 4, none

        return {
            "baseColor": base,
            "metallicRoughness": [plain("roughness", "g"), plain("metallic", "b")],
            "normal": [("normal", "rgb", "raw", (2 * n, 2 * n, 2.0, 1.0), (-n, -n, -1.0, 0.0))],
            "emissive": [("emissiveColor", "rgb", "sRGB", (*emission, 1.0), none)],
            "clearcoat": [plain("clearcoat", "r")],
            "clearcoatRoughness": [plain("clearcoatRoughness", "g")],
        }

    def texture(
        self,
        material: Any,
        word: str,
        output: str,
        space: str,
        scale: tuple[float, ...],
        bias: tuple[float, ...],
        reference: dict[str, Any],
        place: str,
    ) -> None:
        from pxr import Gf, Sdf, UsdShade

        path = material.GetPath()
        textures, types = self.gltf.json.get("textures", []), Sdf.ValueTypeNames
        image = textures[reference["index"]].get("source") if reference["index"] < len(textures) else None
        if image is None or not 0 <= image < len(self.gltf.images):
            self.say(f"The texture of {word} has no picture that can be read.", place)
            return
        reader = UsdShade.Shader.Define(self.stage, path.AppendChild("StReader"))
        reader.CreateIdAttr("UsdPrimvarReader_float2")
        reader.CreateInput("varname", types.String).Set("st")
        st = reader.CreateOutput("result", types.Float2)
        if transform := reference.get("extensions", {}).get("KHR_texture_transform"):
            mover = UsdShade.Shader.Define(self.stage, path.AppendChild(f"Place_{word}"))
            mover.CreateIdAttr("UsdTransform2d")
            mover.CreateInput("in", types.Float2).ConnectToSource(st)
            rotation, scale_st, shift = place_in_st(transform)
            mover.CreateInput("rotation", types.Float).Set(rotation)
            mover.CreateInput("scale", types.Float2).Set(Gf.Vec2f(*scale_st))
            mover.CreateInput("translation", types.Float2).Set(Gf.Vec2f(*shift))
            st = mover.CreateOutput("result", types.Float2)
        shader = UsdShade.Shader.Define(self.stage, path.AppendChild(f"Texture_{word}"))
        shader.CreateIdAttr("UsdUVTexture")
        shader.CreateInput("file", types.Asset).Set(Sdf.AssetPath(self.picture(image)))
        shader.CreateInput("st", types.Float2).ConnectToSource(st)
        sampler = self.gltf.json.get("samplers", [])
        about = (
            sampler[textures[reference["index"]]["sampler"]]
            if "sampler" in textures[reference["index"]]
            else {}
        )
        for axis in "ST":
            shader.CreateInput(f"wrap{axis}", types.Token).Set(
                WRAP.get(about.get(f"wrap{axis}", 10497), "repeat")
            )
        shader.CreateInput("sourceColorSpace", types.Token).Set(space)
        shader.CreateInput("scale", types.Float4).Set(Gf.Vec4f(*scale))
        shader.CreateInput("bias", types.Float4).Set(Gf.Vec4f(*bias))
        kind = types.Float3 if output == "rgb" else types.Float
        source = shader.CreateOutput(output, kind)
        preview = UsdShade.Shader(self.stage.GetPrimAtPath(path.AppendChild("Preview")))
        taken = types.Normal3f if word == "normal" else types.Color3f if output == "rgb" else types.Float
        given = preview.CreateInput(word, taken)
        given.GetAttr().Clear()
        given.ConnectToSource(source)

    def picture(self, index: int) -> str:
        """The path of a picture; one inside the file is written to the cache first."""
        image = self.gltf.images[index]
        if isinstance(image, str):
            return str(Path(image).resolve())
        home = Path(os.environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache")
        suffix = next((s for magic, s in PICTURES.items() if image.startswith(magic)), ".bin")
        path = home / "brightfield" / "pictures" / (hashlib.sha256(image).hexdigest() + suffix)
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            beside = path.with_name(f".{os.getpid()}{path.name}")
            beside.write_bytes(image)
            os.replace(beside, path)
        return str(path)

    def extra(self, stage: Any, path: str, node: Node) -> None:
        """A node's camera and light; both look along -z with y up, as USD's do."""
        from interchange.formats.usd_author import author_camera, author_light, free_path, set_matrix

        if node.camera >= 0:
            camera = read_camera(self.gltf.json["cameras"][node.camera])
            set_matrix(author_camera(stage, free_path(stage, path, "camera"), camera), np.eye(4))
        if node.light >= 0:
            lights = self.gltf.json.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
            if node.light >= len(lights):
                where = Where(str(self.path), f'node "{node.name}"')
                raise FileError(Problem(f"There are {len(lights)} lights; got index {node.light}.", where))
            written = lights[node.light]
            set_matrix(author_light(stage, free_path(stage, path, "light"), read_light(written)), np.eye(4))
            self.say("Its photometric unit became watts by 683 lm/W.", f'node "{node.name}"', Severity.NOTE)


_DONE = {
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
}


def place_in_st(transform: dict[str, Any]) -> tuple[float, tuple[float, float], tuple[float, float]]:
    """KHR_texture_transform, where v goes down, as USD's (rotation in degrees, scale, translation), where v goes up.

    With F: (u, v) -> (u, 1 - v) the map M of glTF becomes F M F.
    """
    angle = float(transform.get("rotation", 0.0))
    sx, sy = (float(v) for v in transform.get("scale", (1, 1)))
    tx, ty = (float(v) for v in transform.get("offset", (0, 0)))
    shift = (tx + sy * np.sin(angle), 1 - ty - sy * np.cos(angle))
    return float(np.degrees(angle)), (sx, sy), (float(shift[0]), float(shift[1]))


def read_camera(written: dict[str, Any]) -> Camera:
    """A camera of the same field of view, on ``COLUMNS`` columns of the default pitch."""
    about = written.get(written["type"], {})
    if written["type"] == "orthographic":
        aspect, wide = about["xmag"] / about["ymag"], 2 * about["xmag"]
        rows = max(1, round(COLUMNS / aspect))
        sensor = Sensor(resolution=(COLUMNS, rows), pixel_pitch=(wide / COLUMNS, 2 * about["ymag"] / rows))
        lens = Lens(projection=Projection.ORTHOGRAPHIC)
    else:
        rows = max(1, round(COLUMNS / about.get("aspectRatio", 4 / 3)))
        sensor = Sensor(resolution=(COLUMNS, rows))
        lens = Lens(focal_length=rows * sensor.pixel_pitch[1] / 2 / float(np.tan(about["yfov"] / 2)))
    clip = (float(about.get("znear", 1e-3)), float(about.get("zfar", 1e4)))
    return Camera(str(written.get("name", "camera")), lens=lens, sensor=sensor, clip=clip)


def read_light(written: dict[str, Any]) -> Light:
    """KHR_lights_punctual: a point without size; candela / 683, or lux / 683 for a directional light."""
    color = [
        float(c) * float(written.get("intensity", 1)) / LUMENS_PER_WATT
        for c in written.get("color", (1, 1, 1))
    ]
    kind = LightKind.DISTANT if written["type"] == "directional" else LightKind.SPHERE
    cone, softness = np.pi, 0.0
    if written["type"] == "spot":
        spot = written.get("spot", {})
        cone = float(spot.get("outerConeAngle", np.pi / 4))
        softness = 1 - float(spot.get("innerConeAngle", 0.0)) / cone
    name = str(written.get("name", "light"))
    return Light(name, kind, (color[0], color[1], color[2]), cone_angle=cone, cone_softness=softness)
