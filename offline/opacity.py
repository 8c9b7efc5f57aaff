"""How much of a see-through surface each triangle stops, for shadow rays, which cannot look into textures."""

from typing import Any

import numpy as np

from interchange.material import Material, evaluate_texture
from interchange.mesh import Mesh

MOST_FACES = 200_000


def is_see_through(material: Material) -> bool:
    return material.opacity < 1 or material.opacity_map is not None


def key(material: Material) -> Any:
    """Equal for materials that stop light alike."""
    if not is_see_through(material):
        return None
    return material.opacity, material.opacity_threshold, id(material.opacity_map)


def faces(mesh: Mesh, material: Material) -> tuple[Mesh, np.ndarray | None]:
    """The mesh and its faces' opacity (F,), None where it is opaque.

    Under an opacity map the triangles are divided to about a texel, up to ``MOST_FACES``, and each takes the mean
    over its own area.
    """
    if not is_see_through(material):
        return mesh, None
    if material.opacity_map is None or mesh.uv is None:
        value = np.full(len(mesh.faces), material.opacity)
        if material.opacity_map is not None:
            value[:] = evaluate_texture(material.opacity_map, np.zeros(2)).mean()
        return mesh, _cut(value, material)
    h, w = material.opacity_map.pixels.shape[:2]
    scale = material.opacity_map.uv_from_st[:2, :2].T * [w, h]
    while len(mesh.faces) * 4 <= MOST_FACES:
        assert mesh.uv is not None
        texel = (mesh.uv @ scale)[mesh.faces]
        if np.abs(texel - np.roll(texel, 1, axis=1)).max() <= 1.5:
            break
        mesh = _quartered(mesh)
    assert mesh.uv is not None
    corners = mesh.uv[mesh.faces]
    inside = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])
    values = evaluate_texture(material.opacity_map, np.einsum("kc,fcd->fkd", inside, corners)).mean(axis=-1)
    return mesh, _cut(values, material).mean(axis=1)


def _cut(opacity: np.ndarray, material: Material) -> np.ndarray:
    if material.opacity_threshold > 0:
        return (opacity >= material.opacity_threshold).astype(np.float64)
    return np.clip(opacity, 0.0, 1.0)


def _quartered(mesh: Mesh) -> Mesh:
    """Each triangle as four, by the middles of its edges."""
    corner = mesh.faces.reshape(-1, 3)

    def with_middles(values: np.ndarray) -> np.ndarray:
        a, b, c = (values[corner[:, k]] for k in range(3))
        return np.stack([a, b, c, (a + b) / 2, (b + c) / 2, (c + a) / 2], axis=1).reshape(-1, values.shape[1])

    first = 6 * np.arange(len(corner))[:, None, None]
    pattern = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]])
    assert mesh.uv is not None
    normals = with_middles(mesh.normals)
    return Mesh(
        vertices=with_middles(mesh.vertices),
        faces=(first + pattern).reshape(-1, 3).astype(np.int32),
        normals=normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30),
        uv=with_middles(mesh.uv),
    )
