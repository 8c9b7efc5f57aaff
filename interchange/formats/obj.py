"""Wavefront OBJ with its MTL materials: polygons, groups, texture coordinates, normals.

Alias|Wavefront: Object Files (.obj), Material Library Files (.mtl), in Advanced Visualizer Manual, 1995. Indices
count from 1, negative ones back from the last. Groups and objects become parts, their materials subsets. A
material of illumination 2 and more is Blinn-Phong with the lobe height Ks / pi (the manual's light of intensity I
is an irradiance pi I), else Lambert; one with the PBR extension's Pr or Pm a UsdPreviewSurface. Its colours are
taken as linear.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from interchange.brdf import Brdf
from interchange.brdf.blinn_phong import BlinnPhong
from interchange.brdf.lambert import Lambert
from interchange.brdf.usd_preview_surface import UsdPreviewSurface
from interchange.formats.base import Format, Options
from interchange.formats.document import Document
from interchange.formats.mesh_files import Part, read_mesh
from interchange.formats.polygons import triangulate
from interchange.formats.surface import Findings
from interchange.material import Material, Texture
from interchange.parameter import ParameterError
from interchange.problems import FileError, Problem, Severity, Where

MOST_ERRORS = 10  # of one file that are listed
IGNORED = {  # smoothing is by crease angle; display and free-form statements draw nothing by themselves
    *("s", "mg", "bevel", "c_interp", "d_interp", "lod", "maplib", "usemap", "shadow_obj", "trace_obj"),
    *("vp", "cstype", "deg", "bmat", "step", "parm", "trim", "hole", "scrv", "sp", "end", "con"),
    *("ctech", "stech", "csh", "call"),
}
LEFT_OUT = {"p": "points", "l": "lines", "curv": "curves", "curv2": "curves", "surf": "free-form surfaces"}


class ObjFormat(Format):
    name = "OBJ"
    extensions = (".obj",)

    def read(self, path: Path, options: Options) -> Document:
        """A stage in ``options.unit``. Raises FileError with every problem."""
        libraries = _Libraries(path)
        document = read_mesh(path, options, parse, libraries.author)
        document.problems += libraries.problems
        return document


@dataclass
class _Group:
    counts: list[int] = field(default_factory=list)  # corners of each polygon
    v: list[int] = field(default_factory=list)
    vt: list[int] = field(default_factory=list)  # -1: none
    vn: list[int] = field(default_factory=list)


def parse(path: str, find: Findings) -> list[Part]:
    reader = _Reader(find)
    with open(path, encoding="utf-8", errors="replace") as stream:
        pending = ""
        for number, line in enumerate(stream, 1):
            if line.endswith("\\\n"):
                pending += line[:-2] + " "
                continue
            reader.line(pending + line, number)
            pending = ""
    return reader.parts()


class _Reader:
    def __init__(self, find: Findings) -> None:
        self.find = find
        self.v: list[tuple[float, float, float]] = []
        self.vt: list[tuple[float, float]] = []
        self.vn: list[tuple[float, float, float]] = []
        self.name, self.material = "", ""
        self.groups: dict[tuple[str, str], _Group] = {}
        self.left: dict[str, int] = {}
        self.errors = 0

    def error(self, message: str, number: int) -> None:
        self.errors += 1
        if self.errors <= MOST_ERRORS:
            self.find.error(message, f"line {number}")

    def line(self, line: str, number: int) -> None:
        words = line.partition("#")[0].split()
        if not words:
            return
        word, rest = words[0], words[1:]
        try:
            if word == "v":
                self.v.append((float(rest[0]), float(rest[1]), float(rest[2])))
            elif word == "vt":
                self.vt.append((float(rest[0]), float(rest[1]) if len(rest) > 1 else 0.0))
            elif word == "vn":
                self.vn.append((float(rest[0]), float(rest[1]), float(rest[2])))
            elif word in ("f", "fo"):
                self.face(rest, number)
            elif word in ("o", "g"):
                self.name = " ".join(rest)
            elif word == "usemtl":
                self.material = " ".join(rest)
            elif word in LEFT_OUT:
                self.left[LEFT_OUT[word]] = self.left.get(LEFT_OUT[word], 0) + 1
            elif word != "mtllib" and word not in IGNORED:
                self.error(f'No statement is called "{word[:40]}".', number)
        except (ValueError, IndexError):
            self.error(f'"{word}" must be followed by numbers; got "{" ".join(rest)[:60]}".', number)

    def face(self, corners: list[str], number: int) -> None:
        if len(corners) < 3:
            self.error(f"A face must have three corners or more; got {len(corners)}.", number)
            return
        found = []
        for corner in corners:
            fields = [*corner.split("/"), "", ""][:3]
            indices = []
            have = len(self.v), len(self.vt), len(self.vn)
            for text, count, what in zip(fields, have, ("v", "vt", "vn"), strict=True):
                i = int(text) if text else 0
                i = i - 1 if i > 0 else i + count if i < 0 else -1
                if not 0 <= i < count and (text or what == "v"):
                    got = text or "none"
                    self.error(f"A face must name one of the {count} {what} so far; got {got}.", number)
                    return
                indices.append(i)
            found.append(indices)
        group = self.groups.setdefault((self.name, self.material), _Group())
        group.counts.append(len(found))
        for v, vt, vn in found:
            group.v.append(v)
            group.vt.append(vt)
            group.vn.append(vn)

    def parts(self) -> list[Part]:
        if self.errors > MOST_ERRORS:
            self.find.error(f"{self.errors - MOST_ERRORS} more lines are damaged.")
        for what, count in self.left.items():
            self.find.loss(f"{count} statements with {what} are left out.")
        points = np.array(self.v, np.float64).reshape(-1, 3)
        uvs, normals = np.array(self.vt).reshape(-1, 2), np.array(self.vn).reshape(-1, 3)
        parts = []
        if not np.isfinite(points).all():
            used = np.concatenate([g.v for g in self.groups.values()]) if self.groups else np.zeros(0, int)
            return [
                Part("", points, used[: len(used) // 3 * 3].reshape(-1, 3))
            ]  # checked, and refused, later
        for (name, material), group in self.groups.items():
            v, vt, vn = np.array(group.v), np.array(group.vt), np.array(group.vn)
            corners, _ = triangulate(np.array(group.counts), points, v)
            with_uv, with_normals = bool((vt >= 0).all()), bool((vn >= 0).all())
            parts.append(
                Part(
                    name,
                    points,
                    v[corners],
                    normals[vn[corners]] if with_normals else None,
                    uvs[vt[corners]] if with_uv else None,
                    material,
                )
            )
        return parts


class _Libraries:
    """The materials that an OBJ file's mtllib statements name."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems: list[Problem] = []

    def say(self, message: str, place: str, severity: Severity = Severity.LOSS) -> None:
        self.problems.append(Problem(message, Where(str(self.path), place), severity))

    def author(self, stage: Any, used: set[str]) -> Mapping[str, Any]:
        from pxr import Sdf, UsdGeom, UsdShade

        from interchange.formats.usd_author import author_material, free_path

        written = self.read() if used else {}
        made = {}
        if used & set(written):
            UsdGeom.Scope.Define(stage, "/World/Materials")
        for name in sorted(used):
            if name not in written:
                self.say(
                    "The material is in no library of the file; the part is left without.",
                    f'material "{name}"',
                )
                continue
            folder, words = written[name]
            material = self.material(name, folder, words)
            usd = author_material(stage, free_path(stage, "/World/Materials", name), material)
            for prim in stage.GetPrimAtPath(usd.GetPath()).GetChildren():
                if prim.GetName() in ("Texture_diffuse", "Texture_diffuseColor"):  # the map multiplies Kd
                    kd = _color(words, "Kd", 1.0)
                    UsdShade.Shader(prim).CreateInput("scale", Sdf.ValueTypeNames.Float4).Set((*kd, 1.0))
            made[name] = usd
        return made

    def read(self) -> dict[str, tuple[Path, dict[str, list[str]]]]:
        found: dict[str, tuple[Path, dict[str, list[str]]]] = {}
        for line in self.path.read_text(encoding="utf-8", errors="replace").splitlines():
            if not line.startswith("mtllib"):
                continue
            file = self.path.parent / line[len("mtllib") :].strip()
            try:
                text = file.read_text(encoding="utf-8", errors="replace")
            except (OSError, ValueError):
                self.say("The material library cannot be read; its materials are left out.", f'"{file.name}"')
                continue
            words: dict[str, list[str]] = {}
            for entry in text.splitlines():
                key, *rest = entry.partition("#")[0].split() or [""]
                if key == "newmtl":
                    words = {}
                    found[" ".join(rest)] = (file.parent, words)
                elif key:
                    words[key.lower() if key.startswith("map") else key] = rest
        return found

    def material(self, name: str, folder: Path, words: dict[str, list[str]]) -> Material:
        place = f'material "{name}"'
        try:
            brdf = self.brdf(words)
            opacity = float(words["d"][-1]) if words.get("d") else 1 - _number(words, "Tr", 0.0)
            emission = _color(words, "Ke", 0.0)
        except (ValueError, ParameterError) as error:
            raise FileError(Problem(f"The material is damaged: {error}", Where(str(folder), place))) from None
        maps = {}
        if texture := self.map(words, "map_kd", folder, place):
            maps["diffuseColor" if isinstance(brdf, UsdPreviewSurface) else "diffuse"] = texture
        for key in words:
            if (key.startswith("map_") and key not in ("map_kd", "map_d")) or key in (
                "bump",
                "disp",
                "decal",
                "refl",
            ):
                self.say(f"The texture {key} is left out.", place)
        normal = self.map(words, "norm", folder, place)
        mask = self.map(words, "map_d", folder, place, channels=1)
        return Material(name, brdf, maps, normal, emission, opacity=opacity, opacity_map=mask)

    def brdf(self, words: dict[str, list[str]]) -> Brdf:
        diffuse, specular = _color(words, "Kd", 0.8), _color(words, "Ks", 0.0)
        if "Pr" in words or "Pm" in words:
            return UsdPreviewSurface(
                diffuseColor=diffuse, metallic=_number(words, "Pm", 0.0), roughness=_number(words, "Pr", 0.5)
            )
        if _number(words, "illum", 2.0) >= 2 and any(specular):
            height = (specular[0] / np.pi, specular[1] / np.pi, specular[2] / np.pi)
            return BlinnPhong(diffuse=diffuse, specular=height, n=max(_number(words, "Ns", 10.0), 0.01))
        return Lambert(diffuse=diffuse)

    def map(
        self, words: dict[str, list[str]], key: str, folder: Path, place: str, channels: int = 3
    ) -> Texture | None:
        rest = words.get(key)
        if not rest:
            return None
        if rest[0].startswith("-"):
            self.say(f"The options of {key} are left out.", place)
            rest = rest[-1:]
        file = (folder / " ".join(rest).replace("\\", "/")).resolve()
        if not file.is_file():
            self.say(f'The texture "{" ".join(rest)}" of {key} is not there; it is left out.', place)
            return None
        return Texture(
            np.zeros((1, 1, channels), np.float32), file=str(file)
        )  # USD is given the file's name alone


def _number(words: dict[str, list[str]], key: str, default: float) -> float:
    return float(words[key][0]) if words.get(key) else default


def _color(words: dict[str, list[str]], key: str, default: float) -> tuple[float, float, float]:
    rest = words.get(key)
    if not rest:
        return default, default, default
    if rest[0] in ("spectral", "xyz"):
        raise ValueError(f"{key} must be given in RGB; got {rest[0]}.")
    r, g, b = (float(x) for x in (rest * 3 if len(rest) == 1 else rest)[:3])
    return r, g, b
