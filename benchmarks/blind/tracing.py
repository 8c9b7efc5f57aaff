"""Linear radiance by Mitsuba 3, one lamp at a time, on a grid ``FINE`` times finer than the sensor's.

Kept on disk under a hash of all that decides it. Light that met one surface and light that met more are two images;
the second is smoothed within surfaces, which takes out the path tracer's noise and leaves edges.

The engine is told mm: its rays begin (1 + |p|) 9e-5 units off a surface at p, which would be 0.1 mm in a scene told
in metres, and shadows would end that much short.
"""

import glob
import hashlib
import json
import os
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.blind.bench import Bench, Eye, Lamp, Matter, Part
from benchmarks.blind.solids import Solid

FINE = 3
MARGIN = 4  # px around the sensor
DEPTH = 12
GRAIN = np.array([np.cos(0.5), np.sin(0.5), 0.0])  # of brushed parts, in their own frame

_ready = False


@dataclass(frozen=True)
class Quality:
    samples: int = 25  # a fine pixel; a square number
    fine: int = FINE
    margin: int = MARGIN


def llvm() -> str:
    """The library that Mitsuba compiles with, of version 16 or later; "" where there is none."""
    given = os.environ.get("DRJIT_LIBLLVM_PATH", "")
    found = sorted(glob.glob("/usr/lib/*/libLLVM*.so*") + glob.glob("/usr/lib/llvm-*/lib/libLLVM*.so*"))
    new = [f for f in found if any(f"{v}" in os.path.basename(f) for v in range(16, 22))]
    return given or (new[-1] if new else "")


def start() -> Any:
    """Mitsuba; SystemExit where its LLVM is missing."""
    global _ready
    import mitsuba as mi

    if not _ready:
        os.environ["DRJIT_LIBLLVM_PATH"] = llvm()
        if not llvm():
            raise SystemExit("Mitsuba needs an LLVM of version 16 or later: sudo apt-get install libllvm19")
        mi.set_variant("llvm_ad_rgb")
        mi.set_log_level(mi.LogLevel.Error)
        from benchmarks.blind.reflection import register

        register()
        _ready = True
    return mi


def _rgb(v: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(x) for x in v]}


def _bsdf(mi: Any, m: Matter) -> Any:
    from benchmarks.blind.reflection import rgb

    if m.model == "Lafortune":
        ((weight, C, n),) = m.lobes
        given = {**rgb("rho", m.diffuse), **rgb("w", weight), **rgb("C", C), "n": float(n)}
        return {"type": "blind_lafortune", **given}
    if m.model == "UsdPreviewSurface":
        return {"type": "blind_preview", **rgb("rho", m.diffuse), "roughness": float(m.roughness)}
    if m.texture is not None:
        picture = mi.Bitmap(np.ascontiguousarray(m.texture[::-1], np.float32))  # row 0 at v = 0
        return {
            "type": "diffuse",
            "reflectance": {
                "type": "bitmap", "bitmap": picture, "raw": True, "filter_type": "bilinear", "wrap_mode": "clamp"
            },
        }  # fmt: skip
    return {"type": "diffuse", "reflectance": _rgb(m.diffuse)}


def _grained(s: Solid) -> Solid:
    """Every corner with coordinates of its own, u along the grain: frames of reflection turn with the part."""
    corners = s.vertices[s.faces]
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    way = np.where(np.abs(n @ GRAIN)[:, None] < 0.9, GRAIN, [0.0, 0.0, 1.0])
    along = way - n * np.sum(way * n, axis=1, keepdims=True)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    uv = np.stack([np.einsum("fij,fj->fi", corners, t) for t in (along, np.cross(n, along))], axis=-1)
    return replace(
        s,
        vertices=corners.reshape(-1, 3),
        faces=np.arange(3 * len(corners)).reshape(-1, 3),
        normals=None if s.normals is None else s.normals[s.faces].reshape(-1, 3),
        uv=uv.reshape(-1, 2),
    )


def _mesh(mi: Any, bsdf: Any, part: Part, pose: int) -> Any:
    s, M = part.solid, part.pose(pose)
    if s.uv is None:
        s = _grained(s)
    props = mi.Properties()
    props["bsdf"] = bsdf
    props["face_normals"] = s.normals is None
    mesh = mi.Mesh(part.name, len(s.vertices), len(s.faces), props, s.normals is not None, s.uv is not None)
    p = mi.traverse(mesh)
    p["vertex_positions"] = (s.vertices @ M[:3, :3].T + M[:3, 3]).astype(np.float32).ravel()
    p["faces"] = s.faces.astype(np.uint32).ravel()
    if s.normals is not None:
        n = s.normals @ np.linalg.inv(M[:3, :3])
        p["vertex_normals"] = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32).ravel()
    if s.uv is not None:
        p["vertex_texcoords"] = s.uv.astype(np.float32).ravel()
    p.update()
    return mesh


def _sensor(mi: Any, eye: Eye, size: tuple[int, int], q: Quality) -> dict[str, Any]:
    w, h = size[0] + 2 * q.margin, size[1] + 2 * q.margin
    origin = np.array(eye.position)
    up, back = np.array(eye.rotation[1]), np.array(eye.rotation[2])
    fov = 2 * np.degrees(np.arctan(w / size[0] / 2 / eye.focal))
    look = mi.ScalarTransform4f().look_at(origin.tolist(), (origin - back).tolist(), up.tolist())
    film = {
        "type": "hdrfilm", "width": w * q.fine, "height": h * q.fine, "rfilter": {"type": "box"},
        "component_format": "float32", "pixel_format": "rgb",
    }  # fmt: skip
    return {"type": "perspective", "fov": fov, "fov_axis": "x", "to_world": look, "film": film, "near_clip": 10.0,
            "sampler": {"type": "multijitter", "sample_count": q.samples}}  # fmt: skip


def beam(lamp: Lamp, cos: np.ndarray) -> np.ndarray:
    """Emission over that along the axis."""
    b1, b2 = lamp.beam
    return 1 + b1 * (cos - 1) + b2 * (1.5 * cos**2 - 1.5)


def _lamp(lamp: Lamp) -> dict[str, Any]:
    if lamp.beam != (0.0, 0.0):
        raise ValueError(
            "The engine draws lamps that shine everywhere alike; beam() is applied to their light."
        )
    L = lamp.intensity / 4 / (np.pi * (lamp.radius / 1e3) ** 2)
    centre = np.array(lamp.position).tolist()
    emitter = {"type": "area", "radiance": _rgb([L] * 3)}
    return {"type": "sphere", "center": centre, "radius": lamp.radius, "emitter": emitter}


def _sky(mi: Any) -> dict[str, Any]:
    """Mean 1 over the upper half, brighter to one side and above: a room, not a uniform dome."""
    v = (np.arange(64) + 0.5) / 64
    u = (np.arange(128) + 0.5) / 128
    theta, phi = np.meshgrid(np.pi * v, 2 * np.pi * u, indexing="ij")
    value = 0.8 + 0.3 * np.cos(theta) + 0.25 * np.sin(theta) * np.cos(phi - 0.9)
    picture = np.repeat(np.maximum(value, 0)[..., None], 3, axis=2).astype(np.float32)
    return {"type": "envmap", "bitmap": mi.Bitmap(picture),
            "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 90)}  # fmt: skip


def world(mi: Any, bench: Bench, eye: Eye, pose: int, lamp: Lamp | None, q: Quality, depth: int) -> Any:
    matters = {m.name: mi.load_dict(_bsdf(mi, m)) for m in bench.matters}
    out: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": depth, "rr_depth": 99, "hide_emitters": True},
        "sensor": _sensor(mi, eye, bench.size, q),
    }
    for part in bench.parts:
        out[part.name] = _mesh(mi, matters[part.matter], part, pose)
    out["emission"] = _sky(mi) if lamp is None else _lamp(lamp)
    return mi.load_dict(out)


def _told(thing: Any) -> Any:
    if isinstance(thing, np.ndarray):
        return hashlib.sha256(np.ascontiguousarray(thing, np.float64).tobytes()).hexdigest()
    if isinstance(thing, dict):
        return {k: _told(v) for k, v in thing.items()}
    if isinstance(thing, list | tuple):
        return [_told(v) for v in thing]
    return thing


def content(*things: Any) -> str:
    return hashlib.sha256(json.dumps(_told(list(things)), sort_keys=True).encode()).hexdigest()[:32]


def _bodies(bench: Bench, pose: int) -> list[Any]:
    return [
        [asdict(m) for m in bench.matters],
        [[p.name, p.solid.vertices, p.solid.faces, p.matter, p.pose(pose)] for p in bench.parts],
    ]


def _kept(file: Path, make: Any) -> dict[str, np.ndarray]:
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        beside = file.with_name(f".{file.stem}.{os.getpid()}.npz")
        np.savez(beside, **make())
        os.replace(beside, file)
    with np.load(file) as stored:
        return {k: stored[k] for k in stored.files}


def layer(
    bench: Bench, eye: Eye, pose: int, lamp: Lamp | None, q: Quality, seed: int, cache: Path
) -> dict[str, np.ndarray]:
    """``direct``, ``indirect`` (h, w, 3): radiance of one lamp, or of the surroundings where ``lamp`` is None."""
    key = content(
        _bodies(bench, pose), asdict(eye), asdict(lamp) if lamp else "sky", asdict(q), bench.size, seed, 5
    )

    def make() -> dict[str, np.ndarray]:
        mi = start()
        once, more = (world(mi, bench, eye, pose, lamp, q, d) for d in (2, DEPTH))
        # alike for a scene and its variants, so that their difference is free of the paths' noise
        seed_ = int(content(eye.name, pose, lamp.name if lamp else "sky", seed)[:7], 16)
        direct = np.array(mi.render(once, spp=q.samples, seed=seed_), np.float32)
        full = np.array(mi.render(more, spp=q.samples, seed=seed_), np.float32)
        bounced = smooth(full - direct, guide(bench, eye, pose, q, cache))
        if lamp is None:
            direct = smooth(direct, guide(bench, eye, pose, q, cache))
        return {"direct": direct, "indirect": bounced}

    return _kept(cache / f"{key}.npz", make)


def guide(bench: Bench, eye: Eye, pose: int, q: Quality, cache: Path) -> dict[str, np.ndarray]:
    """At fine pixels' centres: ``part`` (h, w) index or -1, ``normal`` and ``position`` m (h, w, 3)."""
    key = content("guide 2", _bodies(bench, pose), asdict(eye), asdict(q), bench.size)

    def make() -> dict[str, np.ndarray]:
        mi = start()
        import drjit as dr

        scene = world(mi, bench, eye, pose, None, q, 2)
        w, h = ((n + 2 * q.margin) * q.fine for n in bench.size)
        i = dr.arange(mi.UInt32, w * h)
        at = mi.Point2f((mi.Float(i % w) + 0.5) / w, (mi.Float(i // w) + 0.5) / h)
        ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, at, mi.Point2f(0.5), True)
        hit = scene.ray_intersect(ray)
        part = np.full(w * h, -1, np.int16)
        names = [p.name for p in bench.parts]
        for shape in scene.shapes():
            if shape.id() in names:
                part[np.array(hit.shape == mi.ShapePtr(shape))] = names.index(shape.id())
        return {
            "part": part.reshape(h, w),
            "normal": np.array(hit.sh_frame.n).T.reshape(h, w, 3).astype(np.float32),
            "position": (np.array(hit.p) / 1e3).T.reshape(h, w, 3).astype(np.float32),
        }

    return _kept(cache / f"{key}.npz", make)


def smooth(image: np.ndarray, where: dict[str, np.ndarray], sigma: float = 4.0) -> np.ndarray:
    """Means over neighbours on the same part that face the same way, Gaussian, ``sigma`` fine pixels."""
    out = image.copy()
    facing = np.rint(3 * where["normal"]).astype(np.int64) + 3
    group = ((where["part"].astype(np.int64) * 7 + facing[..., 0]) * 7 + facing[..., 1]) * 7 + facing[..., 2]
    around = int(4 * sigma)
    for k in np.unique(group):
        inside = group == k
        rows, columns = (np.flatnonzero(inside.any(axis=i)) for i in (1, 0))
        box = tuple(slice(max(n[0] - around, 0), n[-1] + around + 1) for n in (rows, columns))
        mask = inside[box].astype(np.float32)
        weight = cv2.GaussianBlur(mask, (0, 0), sigma)[..., None]
        spread = cv2.GaussianBlur(image[box] * mask[..., None], (0, 0), sigma) / np.maximum(weight, 1e-6)
        out[box] = np.where(mask[..., None] > 0, spread, out[box])
    return out
