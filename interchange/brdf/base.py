"""What every BRDF is: a formula f(wi, wo) in 1/sr, and its declared parameters.

Directions are unit vectors in the shading frame (x tangent, y bitangent, z normal), both pointing away
from the surface: ``wi`` to the light, ``wo`` to the camera. ``f`` carries no cosine factor and is asked
only for directions above the surface.

The formula is written for one channel (one wavelength): inside ``f`` a colour parameter is one number,
and a per-lobe parameter a list. ``evaluate`` calls it for the three channels; ``interchange.shader`` calls
it on values that write GLSL or OSL. So that all three agree, ``f`` holds no ``if`` on values: ``np.where``,
``np.maximum`` and products; ``np.power`` of values that are not negative. Values of a table are read with
``self.table.take(index)``, ``index`` a whole number (``np.floor``).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar, Self

import numpy as np

from interchange.brdf.sampling import Lobe, Shape, mirror
from interchange.parameter import Kind, freeze, parameters, settings, tables
from interchange.table import Table


class Brdf:
    source: ClassVar[str]
    isotropic: ClassVar[bool] = True
    reciprocal: ClassVar[bool] = True
    conserves_energy: ClassVar[bool] = True  # for every parameter value within the bounds
    example: ClassVar[Mapping[str, Any]] = {}  # what to show it with, where its defaults show nothing
    matte: ClassVar[str] = (
        ""  # the parameter that its body colour is proportional to; at zero only lobes are left
    )
    strength: ClassVar[str] = ""  # the parameter that its lobes are proportional to
    height: ClassVar[bool] = False  # ``strength`` is the lobe's peak: its albedo falls with its width
    width: ClassVar[Mapping[str, tuple[float, float]]] = {}  # of its lobes: see ``widths``

    def __post_init__(self) -> None:
        freeze(self)

    def f(self, wi: Any, wo: Any) -> Any:
        """Reflectance in 1/sr of one channel. ``wi``, ``wo``: (x, y, z) triples of arrays that broadcast."""
        raise NotImplementedError

    def sampling(self, wo: Any) -> list[Lobe]:
        """Where light that leaves along ``wo`` comes from: lobes to draw ``wi`` from, for the path tracer.

        They decide how noisy an image is, never its mean. Colours are means over the channels here.
        """
        axis = mirror(wo)
        return [Lobe(0.4), *(Lobe(0.2, Shape.POWER, axis, n) for n in (8.0, 64.0, 512.0))]

    def evaluate(self, wi: np.ndarray, wo: np.ndarray) -> np.ndarray:
        """Reflectance in 1/sr of the three channels, (..., 3); 0 where either direction is not above the surface.

        ``wi``, ``wo``: (..., 3) unit vectors in the shading frame, shapes that broadcast.
        """
        wi, wo = np.broadcast_arrays(np.asarray(wi, np.float64), np.asarray(wo, np.float64))
        i, o = (tuple(np.moveaxis(w, -1, 0)) for w in (wi, wo))
        with np.errstate(all="ignore"):
            value = np.stack(
                [np.broadcast_to(self.bind(self.flat(), c).f(i, o), i[2].shape) for c in range(3)], -1
            )
        above = (wi[..., 2] > 0) & (wo[..., 2] > 0)
        return np.where(above[..., None], value, 0.0)

    @classmethod
    def drawn(cls, rng: np.random.Generator, lobes: int = 1) -> Self:
        """A model with parameters from their declared bounds, wide ranges evenly over their magnitudes."""
        values: dict[str, Any] = {}
        for name, about in parameters(cls).items():
            shape = ((lobes,) if about.per_lobe else ()) + ((3,) if about.kind.width == 3 else ())
            if about.low >= 0 and about.high > 50:
                values[name] = np.exp(rng.uniform(np.log(max(about.low, 1e-2)), np.log(about.high), shape))
            else:
                values[name] = rng.uniform(about.low, about.high, shape)
        return cls(**values)

    @property
    def lobes(self) -> int:
        """Entries in each per-lobe parameter; 0 for a model that has none."""
        return next((len(getattr(self, n)) for n, p in parameters(self).items() if p.per_lobe), 0)

    @property
    def structure(self) -> str:
        """What decides the formula's text: BRDFs with an equal structure share one shader function."""
        return " ".join(
            map(str, (type(self).__name__, self.lobes, *(getattr(self, n) for n in settings(self))))
        )

    @property
    def tables(self) -> list[Table]:
        """The tables that the formula looks up, in the order of declaration."""
        return [getattr(self, name) for name in tables(self)]

    def flat(self) -> list[float]:
        """All numbers of the parameters in the order of declaration: what a shader gets as ``p[]``."""
        return [float(x) for name in parameters(self) for x in np.ravel(getattr(self, name))]

    def slots(self) -> dict[str, range]:
        """Where each parameter lies in ``flat()``."""
        place: dict[str, range] = {}
        start = 0
        for name, about in parameters(self).items():
            width = about.kind.width * (self.lobes if about.per_lobe else 1)
            place[name] = range(start, start + width)
            start += width
        return place

    def bind(
        self, values: Sequence[Any], channel: int | None, looked_up: Sequence[Any] | None = None
    ) -> Self:
        """The same model on other numbers (or a shader's names) in the order of ``flat()``, for one channel.

        ``channel`` None takes the mean of every colour. ``looked_up`` stands for the tables' channels in a shader.
        """
        bound = object.__new__(type(self))
        slots = self.slots()
        for name, about in parameters(self).items():
            width = about.kind.width
            numbers = [values[i] for i in slots[name]]
            groups = [numbers[i : i + width] for i in range(0, len(numbers), width)]
            entries = [_one(g, about.kind, channel) for g in groups]
            object.__setattr__(bound, name, entries if about.per_lobe else entries[0])
        for name in settings(self):
            object.__setattr__(bound, name, getattr(self, name))
        columns = looked_up or [t.channel(channel) for t in self.tables]
        for name, column in zip(tables(self), columns, strict=True):
            object.__setattr__(bound, name, column)
        return bound

    def with_flat(self, values: Sequence[float]) -> Self:
        """This model with other numbers in the order of ``flat()``."""
        changed: dict[str, Any] = {}
        for name, about in parameters(self).items():
            numbers = np.array([values[i] for i in self.slots()[name]])
            shape = ((self.lobes,) if about.per_lobe else ()) + ((3,) if about.kind.width == 3 else ())
            changed[name] = numbers.reshape(shape)
        return replace(self, **changed)  # type: ignore[type-var]


def widths(**powers: tuple[float, float]) -> Mapping[str, tuple[float, float]]:
    """Parameters that a lobe's width is made of: each goes with (width along the tangent)^a (across)^b, for (a, b)."""
    return powers


def _one(numbers: list[Any], kind: Kind, channel: int | None) -> Any:
    if kind is Kind.FLOAT:
        return numbers[0]
    if kind is Kind.VECTOR:
        return tuple(numbers)
    return (numbers[0] + numbers[1] + numbers[2]) / 3.0 if channel is None else numbers[channel]
