"""A lamp: where it stands, how large it is, how much it emits and in which directions.

``intensity`` is a physical quantity that stays finite when the lamp shrinks to a point:

| kind     | frame                     | ``intensity``, three channels                      |
|----------|---------------------------|----------------------------------------------------|
| sphere   | centre at the origin      | radiant intensity in every direction, W/sr         |
| disk     | z = 0, emits along -z     | radiant intensity along -z, W/sr                   |
| rect     | z = 0, emits along -z     | radiant intensity along -z, W/sr                   |
| cylinder | along x, without caps     | radiant intensity at right angles to x, W/sr       |
| distant  | light travels along -z    | irradiance on a plane that faces it, W/m²          |
| dome     | around everything         | radiance, W m⁻² sr⁻¹                               |

The surface's own radiance follows by the projected area (``radiance``). UsdLux numbers become these at the
border: L = intensity · 2^exposure · color, divided by the area where ``normalize`` is set.

A dome's texture is latitude-longitude as OpenEXR lays it out: the pole (top row) is +y of the light's frame, the
image's centre is +z, and longitude grows towards +x on the left: with v = (row + 0.5) / h and u = (column + 0.5) / w,
direction = (sin(π v) sin λ, cos(π v), sin(π v) cos λ), λ = π (1 - 2 u). A rect's texture stands
upright for whoever looks into the lamp with +y up: its top-left pixel lies at (+x, +y), its bottom-right one at
(-x, -y) of the light's frame. Both textures multiply the emission, pixel by pixel (RGB, linear).

Shaping (UsdLux 24.11): a cone around -z, ``focus``, and a measured profile or a projected image multiply the
emission by a factor that depends on its direction in the light's frame, ``shaping``.

``intensity`` is that of the lamp while it is on all the time; a ``strobe`` says when it is.
"""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from interchange.material import Texture
from interchange.problems import Where
from interchange.projector import Projector
from interchange.strobe import Strobe

Color = tuple[float, float, float]


class LightKind(StrEnum):
    SPHERE = "sphere"
    DISK = "disk"
    RECT = "rect"
    CYLINDER = "cylinder"
    DISTANT = "distant"
    DOME = "dome"


@dataclass(frozen=True, eq=False)
class Profile:
    """A measured luminous intensity distribution (IES LM-63 type C, EULUMDAT), compared by identity.

    ``candela`` (H, V) over ``horizontal`` (H,) in [0, 2π] and ``vertical`` (V,) in [0, π], rad. Vertical 0 is
    the light's -z axis; horizontal 0 is its +x axis, counted towards +y. Bilinear between the angles and 0 outside
    the vertical range.
    """

    horizontal: np.ndarray
    vertical: np.ndarray
    candela: np.ndarray
    file: str = ""

    def evaluate(self, theta: np.ndarray, phi: np.ndarray) -> np.ndarray:
        """Candela at polar angle ``theta`` from -z and azimuth ``phi``, rad."""
        theta, phi = np.broadcast_arrays(theta, np.mod(phi, 2 * np.pi))
        if len(self.horizontal) == 1:
            return np.interp(theta, self.vertical, self.candela[0], left=0, right=0)
        j = np.clip(np.searchsorted(self.horizontal, phi, side="right") - 1, 0, len(self.horizontal) - 2)
        w = (phi - self.horizontal[j]) / (self.horizontal[j + 1] - self.horizontal[j])
        i = np.clip(np.searchsorted(self.vertical, theta, side="right") - 1, 0, len(self.vertical) - 2)
        t = (theta - self.vertical[i]) / (self.vertical[i + 1] - self.vertical[i])
        near = self.candela[j, i] * (1 - t) + self.candela[j, i + 1] * t
        far = self.candela[j + 1, i] * (1 - t) + self.candela[j + 1, i + 1] * t
        inside = (theta >= self.vertical[0] - 1e-9) & (theta <= self.vertical[-1] + 1e-9)
        return np.where(inside, near * (1 - w) + far * w, 0.0)

    def power(self) -> float:
        """The integral of the candela over the sphere (lm), by the trapezium rule on a fine grid."""
        theta = np.linspace(0, np.pi, 721)
        phi = np.linspace(0, 2 * np.pi, 721)
        from scipy.integrate import trapezoid  # half a second to import, and few ask for the power

        rings = trapezoid(self.evaluate(theta[:, None], phi[None, :]), phi, axis=1)
        return float(trapezoid(rings * np.sin(theta), theta))


@dataclass(frozen=True, eq=False)
class Light:
    name: str
    kind: LightKind
    intensity: Color
    world_from_light: np.ndarray = field(default_factory=lambda: np.eye(4))  # rigid: scale is in the sizes
    radius: float = 0.0  # m: sphere, disk, cylinder
    width: float = 0.0  # m: rect, along x
    height: float = 0.0  # m: rect, along y
    length: float = 0.0  # m: cylinder, along x
    angle: float = 0.0  # rad: distant, the full angle that the source fills
    cone_angle: float = np.pi  # rad from -z; π leaves everything
    cone_softness: float = 0.0
    focus: float = 0.0
    focus_tint: Color = (0.0, 0.0, 0.0)
    profile: Profile | None = None  # scaled, where the file asks for it, to a mean of 1 over all directions
    profile_angle_scale: float = 0.0
    projector: Projector | None = None  # instead of a profile; of a sphere without extent
    texture: Texture | None = None  # rect: over the face; dome: latitude-longitude
    strobe: Strobe = Strobe()  # noqa: RUF009  frozen
    casts_shadows: bool = True
    visible: bool = False  # seen by the camera itself
    where: Where = field(default=Where(), compare=False)

    @property
    def projected_area(self) -> float:
        """m² seen along the direction for which ``intensity`` is given; for distant light sr; 1 for a dome."""
        match self.kind:
            case LightKind.SPHERE | LightKind.DISK:
                return float(np.pi * self.radius**2)
            case LightKind.RECT:
                return self.width * self.height
            case LightKind.CYLINDER:
                return 2 * self.radius * self.length
            case LightKind.DISTANT:
                return float(np.pi * np.sin(min(self.angle, np.pi) / 2) ** 2)
            case LightKind.DOME:
                return 1.0

    @property
    def is_delta(self) -> bool:
        """No extent: one direction from any point, and sharp shadows."""
        return self.projected_area == 0.0

    @property
    def radiance(self) -> np.ndarray:
        """(3,) W m⁻² sr⁻¹ of the emitting surface; infinite for a lamp without extent."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.nan_to_num(np.asarray(self.intensity) / self.projected_area, nan=0.0, posinf=np.inf)

    @property
    def beam(self) -> Profile | Projector | None:
        """What tells the emission apart by direction."""
        return self.projector or self.profile

    @property
    def is_on(self) -> bool:
        return any(x > 0 for x in self.intensity)

    def shaping(self, direction: np.ndarray) -> np.ndarray:
        """Factor (..., 3) on the emission into ``direction`` (..., 3), unit, in the light's frame."""
        cos = np.clip(-direction[..., 2], -1.0, 1.0)
        theta = np.arccos(cos)
        start = (1.0 - self.cone_softness) * self.cone_angle
        if self.cone_softness > 0:
            t = np.clip((theta - start) / (self.cone_angle - start), 0.0, 1.0)
            cone = 1.0 - t * t * (3.0 - 2.0 * t)
        else:
            cone = (theta <= self.cone_angle).astype(np.float64)
        share = np.abs(cos)[..., None] ** self.focus
        factor = cone[..., None] * (share + (1.0 - share) * np.asarray(self.focus_tint))
        if self.profile is not None:
            scale = self.profile_angle_scale
            angle = theta / scale if scale > 0 else (theta - np.pi) / -scale + np.pi if scale < 0 else theta
            phi = np.arctan2(direction[..., 1], direction[..., 0])
            factor = factor * self.profile.evaluate(angle, phi)[..., None]
        if self.projector is not None:
            factor = factor * self.projector.evaluate(direction)
        return factor


def rect_uv(x: np.ndarray, y: np.ndarray, width: float, height: float) -> np.ndarray:
    """Texture coordinates (..., 2) of the points (x, y), m, of a rect light's face.

    The top-left pixel lies at (+x, +y), the bottom-right one at (-x, -y).
    """
    return np.stack([0.5 - np.asarray(x) / width, 0.5 + np.asarray(y) / height], axis=-1)


def latlong_uv(direction: np.ndarray) -> np.ndarray:
    """Texture coordinates (..., 2) of the part of a dome's map that lies in ``direction`` (..., 3), unit, light's
    frame: v = 1 is +y, the map's centre +z, and +x a quarter of the width to the left of that.
    """
    x, y, z = np.moveaxis(np.asarray(direction, np.float64), -1, 0)
    u = (np.arctan2(z, x) / (2 * np.pi) + 0.25) % 1.0
    return np.stack([u, 1.0 - np.arccos(np.clip(y, -1.0, 1.0)) / np.pi], axis=-1)


def latlong_direction(uv: np.ndarray) -> np.ndarray:
    """The inverse of ``latlong_uv``: unit directions (..., 3) in the light's frame."""
    longitude, colatitude = 2 * np.pi * (uv[..., 0] - 0.25), np.pi * (1.0 - uv[..., 1])
    ring = np.sin(colatitude)
    return np.stack([ring * np.cos(longitude), np.cos(colatitude), ring * np.sin(longitude)], axis=-1)
