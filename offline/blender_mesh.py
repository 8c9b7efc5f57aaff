"""A mesh of ours as one of Blender's: shading normals, tangents and texture coordinates as point attributes."""

import bpy
import numpy as np

from interchange.mesh import Mesh, face_normals


def build(mesh: Mesh, opacity: np.ndarray | None) -> "bpy.types.Mesh":
    """``opacity`` (F,) marks a see-through surface for shadow rays: see ``_tagged``. None is an opaque one."""
    vertices, faces = mesh.vertices, mesh.faces
    normals, tangents = mesh.normals, mesh.tangents
    uv = np.zeros((len(vertices), 2)) if mesh.uv is None else mesh.uv
    tag = None
    if opacity is not None:
        corner = faces.reshape(-1)
        tag = np.repeat(_tagged(face_normals(vertices, faces), opacity), 3, axis=0)
        vertices, normals, tangents, uv = vertices[corner], normals[corner], tangents[corner], uv[corner]
        faces = np.arange(len(corner)).reshape(-1, 3)
    data = bpy.data.meshes.new("mesh")
    data.vertices.add(len(vertices))
    data.vertices.foreach_set("co", np.ascontiguousarray(vertices, np.float32).ravel())
    data.loops.add(faces.size)
    data.loops.foreach_set("vertex_index", np.ascontiguousarray(faces, np.int32).ravel())
    data.polygons.add(len(faces))
    data.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
    data.update(calc_edges=False)
    for name, values in (
        ("bf_normal", normals),
        ("bf_tangent", tangents),
        ("bf_uv", np.pad(uv, ((0, 0), (0, 1)))),
    ):
        _attribute(data, name, values)
    if tag is not None:
        _attribute(data, "custom_normal", tag)
        data.shade_smooth()
    else:
        data.shade_flat()
    data.materials.append(None)
    return data


def _attribute(data: "bpy.types.Mesh", name: str, values: np.ndarray) -> None:
    attribute = data.attributes.new(name, "FLOAT_VECTOR", "POINT")
    attribute.data.foreach_set("vector", np.ascontiguousarray(values, np.float32).ravel())


def _tagged(normals: np.ndarray, opacity: np.ndarray) -> np.ndarray:
    """Normals at an angle to the faces' that no real shading normal has: cos = -(0.1 + 0.8 opacity).

    Shadow rays (``seen`` in osl/surface.osl) learn nothing of what they hit but its two normals. The surface's own
    shader reads its real normals from ``bf_normal``.
    """
    cosine = -(0.1 + 0.8 * opacity)[:, None]
    axis = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0, 0]], [[0, 1.0, 0]])
    across = np.cross(normals, axis)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return cosine * normals + np.sqrt(1 - cosine**2) * across
