"""A parabolic reflector that lights its focus from a direction that can be stepped: illumination series.

A projector behind a Fresnel lens sends light parallel to the axis; a spot of radius s at polar coordinates (r, φ)
of its pattern meets the paraboloid z = f - r² / 4f (origin in the focus F, z to the vertex, where the camera looks
through a hole) and is thrown to F from the direction L(φ, θ):

    azimuth φ as projected,     θ = atan2(4 f r, 4 f² - r²)  = 2 atan(r / 2f)                (1)
    distance d = f + r² / 4f,   the spot is seen from F as a disk of radius s, whatever r: the map is conformal

A perfect mirror would light a point. Wax dulls it: each ray leaves as a lobe around the mirrored one, here a Gaussian
I(α) ∝ exp(-α² / 2σ²) in radiant intensity, and a field around F becomes even. Across the beam, at distance x from F,

    E(x) = E(0) exp(-α² / 2σ²) cos³ α,   tan α = x / d,     E(0) = ρ Φ / (d² ∫ exp(-α² / 2σ²) dω)

Gruna, Irgenfried: Reflectance modeling in machine vision. 2012, section 2.1.2, Eq. 1 and Figures 1 to 3 (600 mm
reflector, an even field of about 15 mm). The chapter gives neither f nor s nor σ: their defaults are ours.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from interchange.lamps.placing import WHITE, Color, aimed
from interchange.light import Light, LightKind, Profile
from interchange.parameter import freeze, parameter
from interchange.problems import BrightfieldError
from interchange.scene import Scene

LOBE_END = np.radians(80.0)
LOBE_WIDTHS = 5.0  # standard deviations after which a lobe is dark: 4e-6 of its peak


@dataclass(frozen=True, eq=False)
class ReflectorDevice:
    """``power``: W that the projector sends into a spot at the rim; ``compensated``: it sends less to nearer parts of
    the reflector, so that every direction gives the focus the same irradiance. ``world_from_device``: the focus is
    its origin, z points to the camera."""

    focal_length: float = parameter(0.150, "f", "m", 1e-3, 10, "of the paraboloid")
    diameter: float = parameter(0.600, "D", "m", 1e-2, 10, "of the reflector")
    hole: float = parameter(0.060, "D_h", "m", 0, 10, "diameter of the camera's hole")
    spot_radius: float = parameter(0.010, "s", "m", 1e-5, 1, "of the projected spot")
    dulling: float = parameter(0.23, "σ", "rad", 1e-3, 0.25, "standard deviation of the wax's lobe")
    reflectance: float = parameter(0.85, "ρ", "1", 0, 1, "of the waxed reflector, into the lobe")
    power: float = parameter(1.0, "Φ", "W", 0, 1e6, "in the projected spot")
    compensated: bool = True
    world_from_device: np.ndarray = field(default_factory=lambda: np.eye(4))

    def __post_init__(self) -> None:
        freeze(self)
        if not self.hole / 2 + 2 * self.spot_radius < self.diameter / 2:
            raise BrightfieldError(
                f"A spot must fit between the hole and the rim; its radius is {self.spot_radius:g} m, they are "
                f"{(self.diameter - self.hole) / 2:g} m apart."
            )

    @property
    def polar_range(self) -> tuple[float, float]:
        """Least and largest θ, rad, at which the whole spot lies between the hole and the rim."""
        low, high = self.hole / 2 + self.spot_radius, self.diameter / 2 - self.spot_radius
        return float(self.polar_angle(low)), float(self.polar_angle(high))

    def polar_angle(self, r: np.ndarray | float) -> np.ndarray:
        """θ, rad, of a spot at radius ``r``, m, of the pattern: Eq. 1."""
        f = self.focal_length
        return np.arctan2(4 * f * np.asarray(r), 4 * f * f - np.square(r))

    def radius(self, theta: np.ndarray | float) -> np.ndarray:
        """The inverse of Eq. 1: r = 2 f tan(θ / 2)."""
        return 2 * self.focal_length * np.tan(np.asarray(theta) / 2)

    def distance(self, theta: np.ndarray | float) -> np.ndarray:
        """d, m, from the reflector to the focus."""
        return self.focal_length + np.square(self.radius(theta)) / (4 * self.focal_length)

    def direction(self, phi: np.ndarray | float, theta: np.ndarray | float) -> np.ndarray:
        """L(φ, θ) (..., 3): unit vector from the focus to the light, world."""
        sine = np.sin(theta)
        local = np.stack(np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)), axis=-1)
        return local @ self.world_from_device[:3, :3].T

    def steps(self, azimuths: int = 24, polar: int = 6) -> np.ndarray:
        """(azimuths · polar, 2) φ and θ, rad, equidistant, all azimuths of the least θ first: 144 by default."""
        theta = np.linspace(*self.polar_range, polar)
        phi = 2 * np.pi * np.arange(azimuths) / azimuths
        return np.stack([np.tile(phi, polar), np.repeat(theta, azimuths)], axis=-1)

    @property
    def lobe_integral(self) -> float:
        """sr: the lobe over its peak."""
        a = np.linspace(0, min(LOBE_WIDTHS * self.dulling, LOBE_END), 4001)
        from scipy.integrate import trapezoid  # half a second to import, for a few lamps

        return float(2 * np.pi * trapezoid(np.exp(-((a / self.dulling) ** 2) / 2) * np.sin(a), a))

    def spot_power(self, theta: float) -> float:
        """W of the spot for this direction: less where ``compensated``, at the nearer parts of the reflector."""
        if not self.compensated:
            return self.power
        farthest = float(self.distance(self.polar_range[1]))
        return self.power * float(self.distance(theta) / farthest) ** 2

    def irradiance(self, theta: float, x: np.ndarray | float = 0.0) -> np.ndarray:
        """W/m² at distance ``x``, m, from the focus, on a plane across the beam: E(x)."""
        d = float(self.distance(theta))
        alpha = np.arctan2(np.abs(x), d)
        peak = self.reflectance * self.spot_power(theta) / (self.lobe_integral * d * d)
        return np.asarray(peak * np.exp(-((alpha / self.dulling) ** 2) / 2) * np.cos(alpha) ** 3)

    def even_field(self, theta: float, share: float = 0.9) -> float:
        """Radius, m, around the focus within which the irradiance across the beam is ``share`` of the middle's."""
        x = np.linspace(0, 2 * float(self.distance(theta)), 20001)
        even = self.irradiance(theta, x) >= share * self.irradiance(theta)
        return float(x[np.argmin(even)])

    def lobe(self) -> Profile:
        """The wax's lobe as a profile of a disk: its own cosine divided out."""
        end = min(LOBE_WIDTHS * self.dulling, LOBE_END)
        a = np.linspace(0, end, 257)
        return Profile(np.zeros(1), a, (np.exp(-((a / self.dulling) ** 2) / 2) / np.cos(a))[None])

    def lights(
        self, phi: float, theta: float, rings: int = 1, color: Color = WHITE, lobe: Profile | None = None
    ) -> tuple[Light, ...]:
        """The spot at this direction, as 1 + 3 rings (rings + 1) disks on the reflector, each aimed at the focus:
        every ray of the bundle is mirrored at its own place. They have the spot's area and share its power.

        ``lobe``: that of ``lobe()``, to be the same object in many steps. Raises BrightfieldError where the spot
        does not lie between the hole and the rim.
        """
        low, high = self.polar_range
        if not low - 1e-9 <= theta <= high + 1e-9:
            raise BrightfieldError(
                f"A direction's polar angle must lie in [{np.degrees(low):.4g}, {np.degrees(high):.4g}] degrees; got "
                f"{np.degrees(theta):.4g}."
            )
        f, lobe = self.focal_length, lobe or self.lobe()
        at = (
            float(self.radius(theta)) * np.array([np.cos(phi), np.sin(phi)])
            + hexagon(rings) * self.spot_radius
        )
        r2 = np.sum(at * at, axis=1)
        places = np.column_stack([at, f - r2 / (4 * f)])
        radius = self.spot_radius / np.sqrt(len(at))
        watts = self.reflectance * self.spot_power(theta) / len(at)
        r, g, b = watts / self.lobe_integral * np.asarray(color)
        return tuple(
            Light(
                f"/reflector/spot{k}",
                LightKind.DISK,
                (float(r), float(g), float(b)),
                self.world_from_device @ aimed(place, np.zeros(3)),
                radius=radius,
                cone_angle=float(lobe.vertical[-1]),
                profile=lobe,
            )
            for k, place in enumerate(places)
        )

    def series(
        self, scene: Scene, steps: np.ndarray | None = None, rings: int = 1, lobe: Profile | None = None
    ) -> tuple[Scene, ...]:
        """``scene`` lit from one direction after the other, one time code each; its own lights stay on.

        ``steps`` (L, 2): φ and θ, default ``steps()``. All steps have the same lamps in other places, so
        ``author_scene`` writes them as time samples; for that ``lobe`` must have been written to a file.
        """
        lobe = lobe or self.lobe()
        chosen = self.steps() if steps is None else np.asarray(steps, np.float64)
        return tuple(
            replace(scene, time=float(k), lights=(*scene.lights, *self.lights(phi, theta, rings, lobe=lobe)))
            for k, (phi, theta) in enumerate(chosen)
        )


def hexagon(rings: int) -> np.ndarray:
    """(1 + 3 rings (rings + 1), 2) points that share out the unit disk: rings of equal areas a point."""
    points = [np.zeros((1, 2))]
    total = 1 + 3 * rings * (rings + 1)
    inside = 1
    for k in range(1, rings + 1):
        count = 6 * k
        # a ring's radius: that of the circle that halves its area
        radius = np.sqrt((inside + count / 2) / total)
        angle = 2 * np.pi * (np.arange(count) + 0.5 * (k % 2)) / count
        points.append(radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
        inside += count
    return np.concatenate(points)
