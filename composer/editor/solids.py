"""Meshes of simple bodies: fixtures, tables and targets that stand in until a CAD file does."""

from collections.abc import Sequence

import numpy as np

from interchange.mesh import Mesh
from interchange.problems import BrightfieldError, did_you_mean

KINDS = ("box", "sphere", "cylinder", "plane")


def solid(kind: str, size: Sequence[float]) -> Mesh:
    """``size``: m along x, y and z (a plane has none along z). BrightfieldError for an unknown kind or size."""
    from interchange.formats import gprims

    extent = np.asarray(size, np.float64)
    if extent.shape != (3,) or not (np.isfinite(extent).all() and (extent[:2] > 0).all() and extent[2] >= 0):
        raise BrightfieldError(f"A solid's size must be three numbers above 0, m; got {tuple(size)}.")
    match kind:
        case "box":
            mesh = gprims.box(1.0)
        case "plane":
            mesh, extent = gprims.plane(1.0, 1.0), np.array([extent[0], extent[1], 1.0])
        case "sphere":
            mesh = gprims.sphere(0.5)
        case "cylinder":
            side = [gprims.line((0, -0.5), (0.5, -0.5)), gprims.line((0.5, -0.5), (0.5, 0.5))]
            mesh = gprims.revolve([*side, gprims.line((0.5, 0.5), (0, 0.5))])
        case _:
            raise BrightfieldError(
                f'A solid must be one of {", ".join(KINDS)}; got "{kind}".{did_you_mean(kind, KINDS)}'
            )
    if not extent[2] > 0:
        raise BrightfieldError(f"A {kind} must have a height above 0; got {extent[2]:g} m.")
    normals = mesh.normals / extent
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Mesh(mesh.vertices * extent, mesh.faces, normals, mesh.uv)
