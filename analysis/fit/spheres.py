"""The measurement and its fit as two spheres under one lamp, by the real-time rasteriser at one exposure.

The measurement becomes a table over half and difference angles: between its samples asinh(f / 2ε) runs by radial
functions |r| of the nearest ones, which keeps a highlight's
flank as it is and no value below the noise. Where nothing was measured (grazing angles) it is the nearest that was.
"""

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import RBFInterpolator

from analysis.fit.fit import three
from analysis.fit.weighting import smallest
from interchange.brdf.base import Brdf
from interchange.brdf.tabulated_isotropic import TabulatedIsotropic
from interchange.camera import Camera, Lens, Projection, Sensor
from interchange.frames import look_at
from interchange.light import Light, LightKind
from interchange.material import Material
from interchange.mesh import Mesh
from interchange.reflectance import ReflectanceSamples
from interchange.scene import Body, Scene
from interchange.table import Table

BINS = (60, 30, 12)  # half angle, difference angle, its azimuth
NEIGHBOURS = 24


def tabulated(samples: ReflectanceSamples) -> TabulatedIsotropic:
    """Scattered isotropic samples (usable, 1 or 3 channels) as a table of every direction."""
    epsilon = smallest(samples)
    values = np.arcsinh(three(samples.f) / (2 * epsilon))
    places = _places(*_half_difference(samples.wi, samples.wo))
    at, index = np.unique(np.round(places, 6), axis=0, return_inverse=True)
    counts = np.bincount(index.ravel(), minlength=len(at))
    means = np.stack([np.bincount(index.ravel(), values[:, c], len(at)) for c in range(3)], axis=1)
    h, d, p = BINS
    i, j, k = (x.ravel() for x in np.indices(BINS))
    theta_h = np.square((i + 0.5) / h) * np.pi / 2
    bins = _places(theta_h, (j + 0.5) / d * np.pi / 2, (k + 0.5) / p * np.pi)
    fitted = RBFInterpolator(
        at,
        means / counts[:, None],
        neighbors=min(NEIGHBOURS, len(at)),
        kernel="linear",
        smoothing=1e-2,
        degree=0,
    )(bins)
    held = np.clip(fitted, (means / counts[:, None]).min(axis=0), (means / counts[:, None]).max(axis=0))
    return TabulatedIsotropic(1.0, h, d, p, Table(np.maximum(2 * epsilon * np.sinh(held), 0.0)))  # type: ignore[arg-type]


def _half_difference(wi: np.ndarray, wo: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """theta_h, theta_d, phi_d of pairs of directions (N, 3), rad (Rusinkiewicz 1998)."""
    h = wi + wo
    h /= np.linalg.norm(h, axis=1, keepdims=True)
    theta_h = np.arctan2(np.hypot(h[:, 0], h[:, 1]), h[:, 2])
    phi_h = np.arctan2(h[:, 1], h[:, 0])
    c, s = np.cos(phi_h), np.sin(phi_h)
    turned = np.stack([c * wi[:, 0] + s * wi[:, 1], -s * wi[:, 0] + c * wi[:, 1], wi[:, 2]], -1)
    c, s = np.cos(theta_h), np.sin(theta_h)
    d = np.stack([c * turned[:, 0] - s * turned[:, 2], turned[:, 1], s * turned[:, 0] + c * turned[:, 2]], -1)
    return theta_h, np.arctan2(np.hypot(d[:, 0], d[:, 1]), d[:, 2]), np.arctan2(d[:, 1], d[:, 0])


def _places(theta_h: np.ndarray, theta_d: np.ndarray, phi_d: np.ndarray) -> np.ndarray:
    """Coordinates in which reflectance changes about evenly: fine near the highlight, slow in the azimuth, which
    reciprocity and the mirror plane of an isotropic surface fold to a quarter turn."""
    spread = 0.15 * np.sin(theta_d) * np.sin(theta_h)
    return np.stack(
        [np.sqrt(theta_h * 2 / np.pi), 0.6 * theta_d * 2 / np.pi, spread * np.cos(2 * phi_d)], axis=-1
    )


def sphere(rings: int = 64) -> Mesh:
    """Radius 1 m, smooth."""
    t, p = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings + 1), indexing="ij"
    )
    n = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1).reshape(-1, 3)
    i, j = (x.ravel() for x in np.meshgrid(np.arange(rings), np.arange(2 * rings), indexing="ij"))
    a = i * (2 * rings + 1) + j
    b = a + 2 * rings + 1
    faces = np.concatenate([np.stack([a, b, b + 1], -1), np.stack([a, b + 1, a + 1], -1)]).astype(np.int32)
    return Mesh(n, faces, n)


def render_spheres(brdfs: Sequence[Brdf], size: int = 240) -> list[np.ndarray]:
    """Radiance (size, size, 3) of a sphere of each material under one distant lamp of irradiance π, 36° off the
    camera: a white matte sphere would have radiance 1 where it faces the lamp."""
    from realtime.renderers.rasterizer import Rasterizer

    body, pitch = sphere(), 2.2 / size
    eye = np.array([0.0, -4.0, 0.0])
    lens, sensor = Lens(projection=Projection.ORTHOGRAPHIC), Sensor((size, size), (pitch, pitch))
    camera = Camera("/Camera", look_at(eye, np.zeros(3)), lens, sensor)
    lamp = Light(
        "/Lamp", LightKind.DISTANT, (np.pi,) * 3, _towards(np.array([-0.45, -1.0, 0.55])), casts_shadows=False
    )
    pictures = []
    with Rasterizer() as rasterizer:
        for brdf in brdfs:
            scene = Scene((Body("/Sphere", body, Material(brdf=brdf)),), (lamp,), (camera,))
            pictures.append(np.asarray(rasterizer.render(scene, camera, samples=8).pixels, np.float64))
    return pictures


def _towards(place: np.ndarray) -> np.ndarray:
    """``world_from_light`` of a distant lamp that shines from ``place`` to the origin: light travels along -z."""
    z = place / np.linalg.norm(place)
    x = np.cross((0.0, 0.0, 1.0), z)
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    return pose
