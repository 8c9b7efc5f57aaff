"""The format of BOP, the benchmark for 6D object pose estimation: images, depth, masks and poses.

| file                                  | holds                                                                     |
|---------------------------------------|---------------------------------------------------------------------------|
| ``camera.json``                       | the first camera: cx, cy, fx, fy, depth_scale, width, height              |
| ``models/obj_000001.ply``             | a model's surface, mm; ``models_info.json``: its box and diameter         |
| ``test/000000/rgb``, ``gray``         | 8 bits                                                                    |
| ``test/000000/depth``                 | 16 bits, times ``depth_scale`` mm; 0 where nothing is                     |
| ``test/000000/mask``, ``mask_visib``  | 255 where the object would be seen alone, where it is seen                |
| ``test/000000/scene_camera.json``     | an image: cam_K, cam_R_w2c, cam_t_w2c (mm), depth_scale                   |
| ``test/000000/scene_gt.json``         | an image: obj_id, cam_R_m2c, cam_t_m2c (mm) of each instance              |
| ``test/000000/scene_gt_info.json``    | an image: boxes and numbers of pixels of each instance                    |

A model is rigid: what a body's own transform scales or shears is in its model's vertices. Lenses do not distort here,
and pixel (0, 0) is the centre of the top left one, as everywhere in the program.

Hodan et al.: BOP: Benchmark for 6D object pose estimation. ECCV 2018; bop_toolkit/docs/bop_datasets_format.md.
"""

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from interchange.camera import Camera, Projection
from interchange.formats import images
from interchange.formats.atomic import written_beside
from interchange.frames import apply
from interchange.scene import Body, Scene

SCALES = (0.01, 0.1, 1.0, 10.0)  # mm a step of depth: the finest that reaches the farthest surface
NOTHING = [-1, -1, -1, -1]  # a box of no pixel


class Seen(Protocol):
    """What is known of an object in an image; (H, W) bool masks. ``number``: of its model, from 1; 0 has no model."""

    @property
    def name(self) -> str: ...
    @property
    def number(self) -> int: ...
    @property
    def seen(self) -> np.ndarray: ...
    @property
    def whole(self) -> np.ndarray: ...


def can_hold(camera: Camera) -> str:
    """Why the format cannot hold this camera's images; "" where it can."""
    if camera.lens.projection is not Projection.PERSPECTIVE:
        return f"{camera.name} is telecentric, and the format knows perspective cameras only"
    if camera.lens.distorts:
        return f"the lens of {camera.name} distorts, and the format knows pinhole cameras only"
    return ""


def rigid_and_stretch(world_from_body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """world_from_body = world_from_model (4, 4) rigid @ stretch (4, 4): the polar decomposition."""
    u, _, vt = np.linalg.svd(world_from_body[:3, :3])
    if np.linalg.det(u @ vt) < 0:
        u = u @ np.diag([1.0, 1.0, -1.0])
    rigid, stretch = np.eye(4), np.eye(4)
    rigid[:3, :3], rigid[:3, 3] = u @ vt, world_from_body[:3, 3]
    stretch[:3, :3] = rigid[:3, :3].T @ world_from_body[:3, :3]
    return rigid, stretch


def write_frame(
    root: Path,
    scene_number: int,
    frame: int,
    pixels: np.ndarray,
    depth: np.ndarray,
    camera: Camera,
    scene: Scene,
    found: Sequence[Seen],
) -> tuple[dict[str, str], dict[str, Any]]:
    """Write an image's files; returns their names below ``root``, and its entries of the three JSON files.

    ``pixels`` (H, W, 1 or 3) uint8; ``depth`` (H, W) m along the axis, inf where nothing is.
    """
    folder = f"test/{scene_number:06d}"
    kind = "rgb" if pixels.shape[2] == 3 else "gray"
    depth_mm = np.where(np.isfinite(depth), np.asarray(depth, np.float64) * 1e3, 0.0)
    scale = next((s for s in SCALES if depth_mm.max(initial=0.0) / s <= 65535), SCALES[-1])
    files = {kind: f"{folder}/{kind}/{frame:06d}.png", "depth": f"{folder}/depth/{frame:06d}.png"}
    _image(root / files[kind], pixels)
    _image(root / files["depth"], np.rint(np.clip(depth_mm / scale, 0, 65535)).astype(np.uint16))
    camera_from_world = camera.camera_from_world
    poses, infos = [], []
    modelled = [thing for thing in found if thing.number]
    for k, thing in enumerate(modelled):
        for word, mask in (("mask", thing.whole), ("mask_visib", thing.seen)):
            name = f"{folder}/{word}/{frame:06d}_{k:06d}.png"
            files[f"{word}_{k}"] = name
            _image(root / name, np.where(mask, 255, 0).astype(np.uint8))
        body = next(b for b in scene.bodies if b.name == thing.name)
        camera_from_model = camera_from_world @ rigid_and_stretch(body.world_from_body)[0]
        poses.append({"obj_id": thing.number, **_pose("cam", "m2c", camera_from_model)})
        whole, seen = int(thing.whole.sum()), int(thing.seen.sum())
        infos.append(
            {
                "bbox_obj": _box(thing.whole),
                "bbox_visib": _box(thing.seen),
                "px_count_all": whole,
                "px_count_valid": int((thing.whole & (depth_mm > 0)).sum()),
                "px_count_visib": seen,
                "visib_fract": seen / whole if whole else 0.0,
            }
        )
    seen_by = {"cam_K": camera.K.ravel().tolist(), "depth_scale": scale}
    return files, {"camera": seen_by | _pose("cam", "w2c", camera_from_world), "gt": poses, "info": infos}


def _pose(prefix: str, word: str, a_from_b: np.ndarray) -> dict[str, list[float]]:
    return {
        f"{prefix}_R_{word}": a_from_b[:3, :3].ravel().tolist(),
        f"{prefix}_t_{word}": (a_from_b[:3, 3] * 1e3).tolist(),
    }


def _box(mask: np.ndarray) -> list[int]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return NOTHING
    return [int(columns[0]), int(rows[0]), int(np.ptp(columns)) + 1, int(np.ptp(rows)) + 1]


def write_scenes(root: Path, entries: Mapping[int, Mapping[int, Mapping[str, Any]]]) -> None:
    """``entries[scene][frame]``: what ``write_frame`` returned."""
    for number, frames in entries.items():
        for word, file in (("camera", "scene_camera"), ("gt", "scene_gt"), ("info", "scene_gt_info")):
            _json(root / f"test/{number:06d}/{file}.json", {str(f): frames[f][word] for f in sorted(frames)})


def write_models(root: Path, scene: Scene, camera: Camera, names: Sequence[str]) -> None:
    """Models of the objects ``names``, numbered from 1, ``models_info.json`` and ``camera.json``."""
    info = {}
    for k, name in enumerate(names):
        vertices, faces, normals = _model([b for b in scene.bodies if b.name == name])
        _ply(root / f"models/obj_{k + 1:06d}.ply", vertices, faces, normals)
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        info[str(k + 1)] = {
            "diameter": diameter(vertices),
            **dict(zip(("min_x", "min_y", "min_z"), low.tolist(), strict=True)),
            **dict(zip(("size_x", "size_y", "size_z"), (high - low).tolist(), strict=True)),
            "name": name,
        }
    _json(root / "models/models_info.json", info)
    (width, height), K = camera.sensor.resolution, camera.K
    _json(
        root / "camera.json",
        {
            "cx": K[0, 2], "cy": K[1, 2], "fx": K[0, 0], "fy": K[1, 1], "depth_scale": SCALES[1],
            "width": width, "height": height,
        },
    )  # fmt: skip


def diameter(vertices: np.ndarray) -> float:
    """Largest distance between two vertices, by those of the convex hull."""
    from scipy.spatial import ConvexHull, QhullError
    from scipy.spatial.distance import pdist

    try:
        vertices = vertices[ConvexHull(vertices).vertices]
    except QhullError:  # a flat thing: all its vertices
        vertices = np.unique(vertices, axis=0)
    return float(pdist(vertices).max(initial=0.0))


def _model(bodies: Sequence[Body]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices (V, 3) mm, faces (F, 3), normals (V, 3) of an object, in its rigid frame."""
    vertices, faces, normals, base = [], [], [], 0
    for body in bodies:
        stretch = rigid_and_stretch(body.world_from_body)[1]
        n = body.mesh.normals @ np.linalg.inv(stretch[:3, :3])
        vertices.append(apply(stretch, body.mesh.vertices) * 1e3)
        faces.append(body.mesh.faces + base)
        normals.append(n / np.linalg.norm(n, axis=-1, keepdims=True))
        base += len(body.mesh.vertices)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(normals)


def _ply(path: Path, vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray) -> None:
    head = "\n".join(
        ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
        + [f"property float {n}" for n in ("x", "y", "z", "nx", "ny", "nz")]
        + [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header", ""]
    )
    rows = np.empty(len(faces), [("n", "u1"), ("v", "<i4", 3)])
    rows["n"], rows["v"] = 3, faces
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = written_beside(path)
    points = np.concatenate([vertices, normals], axis=1).astype("<f4")
    beside.write_bytes(head.encode() + points.tobytes() + rows.tobytes())
    os.replace(beside, path)


def _image(path: Path, array: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    images.write(path, array if array.ndim == 3 else array[..., None])


def _json(path: Path, data: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = written_beside(path)
    beside.write_text(json.dumps(data, indent=1), encoding="utf-8")
    os.replace(beside, path)
