"""Reflectance samples: pairs of directions and the BRDF that was measured between them.

    f_n = f(wi_n, wo_n) in 1/sr, without the cosine, one column a channel or a wavelength

What a fit gets, whatever the instrument was. Nothing is dropped or clipped here: a sample that is not to be
trusted stays with ``use`` False, a negative value stays negative, and both can be counted.
"""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from interchange.measurement import Kind, Measurement, directions
from interchange.problems import BrightfieldError, Problem, Severity

RGB_NM = ((600.0, 700.0), (500.0, 600.0), (400.0, 500.0))  # red first, as the three channels everywhere


@dataclass(frozen=True, eq=False)
class ReflectanceSamples:
    """``wi``, ``wo`` (N, 3) unit vectors to the light and the camera in the shading frame, both above the surface;
    ``f`` (N, K) 1/sr; ``sigma`` (N, K) one standard deviation of ``f``, 1/sr, or None where nobody knows;
    ``use`` (N,) bool: whether to believe the sample (all, unless given); ``channels``: K names;
    ``wavelength_nm`` (K,) for spectra. Raises BrightfieldError where the shapes disagree.
    """

    wi: np.ndarray
    wo: np.ndarray
    f: np.ndarray
    sigma: np.ndarray | None = None
    use: np.ndarray = field(default_factory=lambda: np.ones(0, bool))
    channels: tuple[str, ...] = ()
    wavelength_nm: np.ndarray | None = None
    notes: tuple[Problem, ...] = ()
    file: str = ""

    def __post_init__(self) -> None:
        wi, wo, f = (np.asarray(a, np.float64) for a in (self.wi, self.wo, self.f))
        f = f[:, None] if f.ndim == 1 else f
        n, k = f.shape if f.ndim == 2 else (-1, -1)
        sigma = None if self.sigma is None else np.asarray(self.sigma, np.float64)
        sigma = sigma[:, None] if sigma is not None and sigma.ndim == 1 else sigma
        use = np.asarray(self.use, bool)
        use = np.ones(max(n, 0), bool) if use.size == 0 else use
        nm = None if self.wavelength_nm is None else np.asarray(self.wavelength_nm, np.float64)
        channels = tuple(self.channels) or _names(k, nm)
        shapes = {"wi": (wi, (n, 3)), "wo": (wo, (n, 3)), "use": (use, (n,))}
        shapes |= {} if sigma is None else {"sigma": (sigma, (n, k))}
        shapes |= {} if nm is None else {"wavelength_nm": (nm, (k,))}
        wrong = [
            f"{name} {a.shape} instead of {want}" for name, (a, want) in shapes.items() if a.shape != want
        ]
        if n < 0 or wrong or len(channels) != k:
            got = "; ".join([f"f {f.shape}", f"{len(channels)} channel names", *wrong])
            raise BrightfieldError(f"Reflectance samples must agree in number; got {got}.")
        for name, value in zip(
            ("wi", "wo", "f", "sigma", "use", "channels", "wavelength_nm"),
            (wi, wo, f, sigma, use, channels, nm),
            strict=True,
        ):
            object.__setattr__(self, name, value)

    @classmethod
    def from_measurement(cls, measurement: Measurement) -> Self:
        """The readings of a BRDF file. Raises BrightfieldError for another kind of measurement."""
        if measurement.kind is not Kind.BRDF:
            raise BrightfieldError(
                f"A BRDF was expected; this is a {measurement.kind.value}. ({measurement.file})"
            )
        wi, wo = directions(measurement)
        return cls(
            wi,
            wo,
            np.stack([c.values for c in measurement.values], axis=-1),
            np.stack([c.values for c in measurement.sigma], axis=-1) if measurement.sigma else None,
            measurement.use if measurement.use is not None else np.ones(len(wi), bool),
            channels=tuple(c.name for c in measurement.values),
            wavelength_nm=measurement.wavelength_nm,
            notes=measurement.notes,
            file=measurement.file,
        )

    def __len__(self) -> int:
        return len(self.f)

    @property
    def usable(self) -> np.ndarray:
        """(N,) bool: believed, finite in every channel, and with both directions above the surface."""
        finite = np.isfinite(self.f).all(axis=1)
        return self.use & finite & (self.wi[:, 2] > 0) & (self.wo[:, 2] > 0)

    @property
    def negatives(self) -> np.ndarray:
        """(K,) numbers of usable values below zero: noise about a dark surface, or a wrong dark signal."""
        return (self.f[self.usable] < 0).sum(axis=0)

    @property
    def theta(self) -> tuple[np.ndarray, np.ndarray]:
        """Polar angles (N,) of ``wi`` and ``wo``, rad."""
        i, o = (np.arctan2(np.hypot(w[:, 0], w[:, 1]), w[:, 2]) for w in (self.wi, self.wo))
        return i, o

    def take(self, rows: np.ndarray) -> Self:
        """The samples at ``rows``: indices or a mask."""
        sigma = None if self.sigma is None else self.sigma[rows]
        return replace(
            self, wi=self.wi[rows], wo=self.wo[rows], f=self.f[rows], sigma=sigma, use=self.use[rows]
        )

    def masked(self) -> Self:
        """Only the usable samples."""
        return self.take(self.usable)

    def subsample(self, rng: np.random.Generator, n: int) -> Self:
        """``n`` of the usable samples, each at most once, in their order; all of them where there are fewer."""
        rows = np.flatnonzero(self.usable)
        return self.take(np.sort(rng.choice(rows, min(n, len(rows)), replace=False)))

    def trusted(self, theta_max: float = np.radians(80), retro_min: float = np.radians(5)) -> Self:
        """``use`` cleared where instruments fail: a direction more than ``theta_max`` off the normal (little light,
        footprint beyond the sample), or ``wi`` within ``retro_min`` of ``wo`` (the detector hides the lamp). rad."""
        low = np.maximum(*self.theta) > theta_max + 1e-9
        near = 2 * np.arcsin(np.clip(np.linalg.norm(self.wi - self.wo, axis=1) / 2, 0, 1)) < retro_min
        notes = [
            Problem(f"{int((bad & self.usable).sum())} samples {why} are left out.", severity=Severity.NOTE)
            for bad, why in (
                (low, f"beyond {np.degrees(theta_max):g}° from the normal"),
                (near & ~low, f"within {np.degrees(retro_min):g}° of retro-reflection"),
            )
            if (bad & self.usable).any()
        ]
        return replace(self, use=self.use & ~low & ~near, notes=(*self.notes, *notes))

    def mirrored(self) -> Self:
        """These samples and, behind them, each with light and camera exchanged: Helmholtz reciprocity as data."""
        sigma = None if self.sigma is None else np.tile(self.sigma, (2, 1))
        return replace(
            self,
            wi=np.concatenate([self.wi, self.wo]),
            wo=np.concatenate([self.wo, self.wi]),
            f=np.tile(self.f, (2, 1)),
            sigma=sigma,
            use=np.tile(self.use, 2),
        )

    def bands(
        self,
        edges: tuple[tuple[float, float], ...] = RGB_NM,
        names: tuple[str, ...] = ("R", "G", "B"),
    ) -> Self:
        """Spectra averaged over bands (nm), the spectrum running straight between its wavelengths.

        ``sigma`` is propagated as of independent wavelengths. Three channels without wavelengths are taken for red,
        green and blue as they are, one is repeated. Raises BrightfieldError for a band that holds no wavelength.
        """
        k = self.f.shape[1]
        if self.wavelength_nm is None:
            if k not in (1, 3) or len(edges) != 3:
                raise BrightfieldError(
                    f"Channels without wavelengths must be 1 or 3 to become three bands; got {k}. ({self.file})"
                )
            weights = np.eye(3) if k == 3 else np.ones((1, 3))
        else:
            weights = np.stack([self._band(low, high) for low, high in edges], axis=1)
        sigma = None if self.sigma is None else np.sqrt(_mixed(self.sigma**2, weights**2))
        return replace(self, f=_mixed(self.f, weights), sigma=sigma, channels=names, wavelength_nm=None)

    def _band(self, low: float, high: float) -> np.ndarray:
        """Weights (K,) of the wavelengths in the mean of a piecewise linear spectrum over [low, high]."""
        nm = self.wavelength_nm
        assert nm is not None
        a, b = max(low, nm[0]), min(high, nm[-1])
        if b < a or (b == a and len(nm) > 1):
            raise BrightfieldError(
                f"The band {low:g} to {high:g} nm must overlap the measured {nm[0]:g} to {nm[-1]:g} nm. ({self.file})"
            )
        if len(nm) == 1:
            return np.ones(1)
        knots = np.unique(np.concatenate([[a, b], nm[(nm > a) & (nm < b)]]))
        at = np.stack([np.interp(knots, nm, row) for row in np.eye(len(nm))], axis=1)  # (knots, K)
        return np.asarray(np.diff(knots) @ (at[1:] + at[:-1]) / 2 / (b - a))


def _mixed(f: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """``f @ weights``, where a NaN touches no band that it has no part in."""
    return np.stack([f[:, w != 0] @ w[w != 0] for w in weights.T], axis=1)


def _names(count: int, nm: np.ndarray | None) -> tuple[str, ...]:
    if nm is not None:
        return tuple(f"{w:g} nm" for w in nm)
    return {1: ("Y",), 3: ("R", "G", "B")}.get(count, tuple(str(i) for i in range(max(count, 0))))
