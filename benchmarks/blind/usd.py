"""A scene of the benchmark as a USD file, in the words of the file contract: what the diagnosis is told."""

from pathlib import Path

import numpy as np

from benchmarks.blind.bench import Bench, Eye, Lamp, Matter, Part, Shot
from benchmarks.blind.picture import write_png

APERTURE = 72.0  # tenths of a scene unit


def times(bench: Bench) -> list[tuple[int, tuple[int, ...]]]:
    """One time code for each arrangement of parts and lamps, in the order of the plan."""
    return list(dict.fromkeys((s.pose, s.lamps) for s in bench.shots))


def time_of(bench: Bench, shot: Shot) -> int:
    return times(bench).index((shot.pose, shot.lamps))


def write_scene(bench: Bench, path: Path) -> None:
    last = len(times(bench)) - 1
    lines = [
        "#usda 1.0",
        f'(\n    defaultPrim = "World"\n    metersPerUnit = 0.001\n    upAxis = "Z"\n    startTimeCode = 0\n'
        f"    endTimeCode = {last}\n    timeCodesPerSecond = 1\n)\n",
        'def Xform "World"\n{',
        '    def Scope "Materials"\n    {',
        *(_material(m) for m in bench.matters),
        "    }",
        *(_part(bench, p) for p in bench.parts),
        *(_lamp(bench, k, x) for k, x in enumerate(bench.lamps)),
        *(_camera(bench, e) for e in bench.eyes),
        "}",
    ]
    for m in bench.matters:
        if m.texture is not None:
            (path.parent / "textures").mkdir(exist_ok=True)
            write_png(path.parent / f"textures/{m.name}.png", np.rint(m.texture * 65535).astype(np.uint16))
    path.write_text("\n".join(lines) + "\n")


def _triple(v: object) -> str:
    return "(" + ", ".join(f"{float(x):.8g}" for x in np.ravel(v)) + ")"  # type: ignore[arg-type]


def _list(values: object) -> str:
    return "[" + ", ".join(_triple(v) for v in values) + "]"  # type: ignore[attr-defined]


def _material(m: Matter) -> str:
    at = f"/World/Materials/{m.name}"
    preview = m.model == "UsdPreviewSurface"
    out = [f'        def Material "{m.name}"', "        {"]
    out.append(f"            token outputs:surface.connect = <{at}/Preview.outputs:surface>")
    if not preview:
        out.append(f"            token outputs:brdf:surface.connect = <{at}/Brdf.outputs:surface>")
    out += ['            def Shader "Preview"', "            {"]
    out.append('                uniform token info:id = "UsdPreviewSurface"')
    out.append(f"                color3f inputs:diffuseColor = {_triple(m.diffuse)}")
    out.append(f"                float inputs:roughness = {m.roughness if preview else 1:g}")
    out += ["                token outputs:surface", "            }"]
    if not preview:
        out += ['            def Shader "Brdf"', "            {"]
        out.append(f'                uniform token info:id = "{m.model}"')
        if m.texture is not None:
            out.append(f"                color3f inputs:diffuse.connect = <{at}/Picture.outputs:rgb>")
        else:
            out.append(f"                color3f inputs:diffuse = {_triple(m.diffuse)}")
        if m.model == "Lafortune":
            out.append(f"                color3f[] inputs:weight = {_list(w for w, _, _ in m.lobes)}")
            out.append(f"                float3[] inputs:C = {_list(c for _, c, _ in m.lobes)}")
            out.append(f"                float[] inputs:n = [{', '.join(f'{n:g}' for *_, n in m.lobes)}]")
        out += ["                token outputs:surface", "            }"]
    if m.texture is not None:
        out += [
            '            def Shader "Picture"\n            {',
            '                uniform token info:id = "UsdUVTexture"',
            f"                asset inputs:file = @textures/{m.name}.png@",
            '                token inputs:sourceColorSpace = "raw"',
            '                token inputs:wrapS = "clamp"\n                token inputs:wrapT = "clamp"',
            f"                float2 inputs:st.connect = <{at}/Reader.outputs:result>",
            "                float3 outputs:rgb\n            }",
            '            def Shader "Reader"\n            {',
            '                uniform token info:id = "UsdPrimvarReader_float2"',
            '                string inputs:varname = "st"',
            "                float2 outputs:result\n            }",
        ]
    return "\n".join([*out, "        }"])


def _matrix(M: np.ndarray) -> str:
    return "( " + ", ".join(_triple(row) for row in M.T) + " )"


def _part(bench: Bench, part: Part) -> str:
    s = part.solid
    out = [
        f'    def Mesh "{part.name}" (\n        prepend apiSchemas = ["MaterialBindingAPI"]\n    )\n    {{'
    ]
    out.append('        uniform token subdivisionScheme = "none"')
    out.append(f"        int[] faceVertexCounts = [{', '.join(['3'] * len(s.faces))}]")
    out.append(f"        int[] faceVertexIndices = [{', '.join(map(str, s.faces.ravel()))}]")
    out.append(f"        point3f[] points = {_list(s.vertices)}")
    if s.normals is not None:
        out.append(
            f'        normal3f[] normals = {_list(s.normals)} (\n            interpolation = "vertex"\n        )'
        )
    if s.uv is not None:
        out.append(
            f'        texCoord2f[] primvars:st = {_list(s.uv)} (\n            interpolation = "vertex"\n        )'
        )
    out.append(f"        rel material:binding = </World/Materials/{part.matter}>")
    if len(part.poses) > 1:
        samples = ", ".join(f"{t}: {_matrix(part.pose(pose))}" for t, (pose, _) in enumerate(times(bench)))
        out.append(f"        matrix4d xformOp:transform.timeSamples = {{ {samples} }}")
        out.append('        uniform token[] xformOpOrder = ["xformOp:transform"]')
    return "\n".join([*out, "    }"])


def _lamp(bench: Bench, k: int, lamp: Lamp) -> str:
    samples = ", ".join(
        f"{t}: {lamp.intensity if k in on else 0:g}" for t, (_, on) in enumerate(times(bench))
    )
    return f"""    def SphereLight "{lamp.name}"
    {{
        float inputs:intensity.timeSamples = {{ {samples} }}
        bool inputs:normalize = 1
        float inputs:radius = {lamp.radius:g}
        double3 xformOp:translate = {_triple(lamp.position)}
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}"""


def _camera(bench: Bench, eye: Eye) -> str:
    s, (w, h) = bench.sensor, bench.size
    M = np.eye(4)
    M[:3, :3], M[:3, 3] = np.array(eye.rotation).T, eye.position
    return f"""    def Camera "{eye.name}"
    {{
        float focalLength = {APERTURE * eye.focal:.9g}
        float horizontalAperture = {APERTURE:g}
        float verticalAperture = {APERTURE * h / w:.9g}
        float2 clippingRange = (10, 5000)
        token projection = "perspective"
        custom int2 sensor:resolution = ({w}, {h})
        custom int sensor:bitDepth = {s.bits}
        custom float sensor:blackLevel = {s.black:g}
        custom float sensor:fullWell = {s.full_well:g}
        custom float sensor:responsivity = {s.responsivity:g}
        custom float sensor:readNoise = {s.read_noise:g}
        custom float sensor:prnu = {s.prnu:g}
        matrix4d xformOp:transform = {_matrix(M)}
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }}"""
