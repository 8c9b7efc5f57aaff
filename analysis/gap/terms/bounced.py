"""How much light that reaches a surface by way of others grows with each material's albedo: what a paint gives to what
stands beside it, and gets back from there.

    s_m(x) = d ln I(x) / d ln ρ_m = Σ_q K(x, q) L(q) (1_(q on m) + i(q) s_m(q)) / Σ_q K(x, q) L(q)
    K(x, q) = cos θ_x cos θ_q A_q / r²

q: all that the cameras see, block by block of pixels, each of which gives its light L to all sides alike; i: what of
that came by way of other surfaces. How much light there is the renderer says; here only what it depends on is told, for
which nothing is between two points, and what no camera sees gives nothing. On the sample's bench a path tracer
that draws the base darker has s of 0.71 to 0.98, mean over other surfaces and by lamp and channel, and this has 0.72 to
0.97; of the white plate, which blocks stand before, 0.41 to 0.80 and 0.37 to 0.76, at worst a third less
(benchmarks/albedo_bounces.py).

Keller: Instant radiosity. SIGGRAPH 1997. Dachsbacher, Stamminger: Reflective shadow maps. I3D 2005.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from threading import Lock

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.compared.state import State
from analysis.gap.light.radiance import Rendered, means, surfaces
from analysis.gap.light.reflected import finely
from interchange.camera import Camera, Projection

BLOCKS, MOST = 2000, 6000  # of an image, about, and of all that are looked at from each other
SEEN = 0.02  # of the distance: nearer than that to what another camera sees it is the same
LEAST = 0.02  # of s: what is less in all of an image is nothing
BOUNCES = 3  # that light's dependence is followed over
STEP = 0.01  # to which s is kept
CHUNK = 500  # points that all sources are looked at from at once

Growth = dict[tuple[str, str], np.ndarray]  # {(lamp, material): (H, W, 3) uint8, s over STEP}


@dataclass(frozen=True, eq=False)
class Blocks:
    """The middle pixel of each block that shows a surface: ``place`` (n,) of all, ``position`` (n, 3) m, ``normal``
    (n, 3), ``area`` (n,) m² that it covers, ``material`` (n,), and {lamp: (n, 3)} radiance, and what part of it came by
    way of other surfaces."""

    place: np.ndarray
    position: np.ndarray
    normal: np.ndarray
    area: np.ndarray
    material: np.ndarray
    light: dict[str, np.ndarray]
    indirect: dict[str, np.ndarray]

    def of(self, kept: np.ndarray) -> "Blocks":
        return Blocks(
            self.place[kept],
            self.position[kept],
            self.normal[kept],
            self.area[kept],
            self.material[kept],
            {name: x[kept] for name, x in self.light.items()},
            {name: x[kept] for name, x in self.indirect.items()},
        )


@dataclass(eq=False)
class _View:
    """``seen``: the positions of what it shows, which are held so that no other has their place."""

    seen: np.ndarray
    growth: Growth | None = None
    telling: Lock = field(default_factory=Lock)


class Bounced:
    """Of what the ``conditions`` show; told when it is asked for, and kept."""

    def __init__(self, conditions: Sequence[Condition]) -> None:
        self._views = list({id(c.shown): c.shown for c in conditions}.values())
        self._kept: dict[int, _View] = {}
        self._lock = Lock()

    def light(self, s: State, material: str) -> np.ndarray | None:
        """(h, w, C) DN: all that came by way of ``material``; None where that is nothing."""
        key = ("by way of", material)
        if key not in s.kept:
            s.kept[key] = self._light(s, material)
        found: np.ndarray | None = s.kept[key]
        return found

    def _light(self, s: State, material: str) -> np.ndarray | None:
        grown = self._growth(s.condition.shown.origin or s.condition.shown)
        row, column, reflected = _reflected(s)
        total = None
        for lamp, L in reflected.items():
            s_m = grown.get((lamp, material))
            if s_m is not None:
                part = L * s.channels(s_m[row, column])
                total = part if total is None else total + part
        return None if total is None else total * np.float32(STEP)

    def _growth(self, shown: Rendered) -> Growth:
        seen = shown.passes["position"]
        with self._lock:
            view = self._kept.setdefault(id(seen), _View(seen))
        with view.telling:  # others of the same view wait, those of another do not
            if view.growth is None:
                others = [v for v in self._views if v.passes["position"] is not seen and _stand(v, shown)]
                view.growth = growth(shown, others)
            return view.growth


def _reflected(s: State) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Which row and column (h, w) of what was rendered every pixel shows, and (h, w, C) DN that it has of each lamp by
    way of surfaces."""
    key = ("reflected", "")
    if key not in s.kept:
        shown, n = s.condition.shown.origin or s.condition.shown, s.condition.shown.coarse
        column, row = (
            np.clip(np.rint(n * x + (n - 1) / 2), 0, most - 1).astype(np.int32)
            for x, most in zip(s.source, shown.rest.shape[1::-1], strict=True)
        )
        share = s.shown.indirect
        reflected = {
            lamp: L * s.channels(s.take(share[lamp])) for lamp, L in s.lamps.items() if lamp in share
        }
        s.kept[key] = row, column, reflected
    found: tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]] = s.kept[key]
    return found


def _stand(one: Rendered, other: Rendered) -> bool:
    """Whether all bodies are where they are in the other."""
    there = {b.name: b.world_from_body for b in other.scene.bodies}
    return {b.name for b in one.scene.bodies} == set(there) and all(
        np.allclose(b.world_from_body, there[b.name]) for b in one.scene.bodies
    )


def growth(shown: Rendered, others: Sequence[Rendered]) -> Growth:
    """Of a rendering, with what ``others`` see besides; none where it has no light by way of surfaces."""
    if not shown.indirect:
        return {}
    own, n = blocks(shown)
    seen = _seen(own, shown, others)
    names = shown.scene.material_names
    h, w = -(-shown.rest.shape[0] // n), -(-shown.rest.shape[1] // n)
    surface, normal = (_padded(x, n) for x in (surfaces(shown.passes), shown.passes["normal"]))
    K = _kernel(seen)
    told: dict[tuple[str, str], np.ndarray] = {}
    for lamp in shown.indirect:
        s = _depends(K, seen, lamp, len(names))[: len(own.place)]
        chosen = np.flatnonzero(s.max(axis=(0, 2), initial=0.0) >= LEAST)
        told |= {(lamp, names[m]): s[:, m] for m in chosen}
    if not told:
        return {}
    coarse = np.zeros((h * w, len(told) * 3), np.float32)
    coarse[own.place] = np.concatenate(list(told.values()), axis=1)
    fine = finely(coarse.reshape(h, w, -1), surface, normal)[: shown.rest.shape[0], : shown.rest.shape[1]]
    fine = np.rint(np.clip(fine / STEP, 0, 255)).astype(np.uint8)
    return {key: fine[..., 3 * k : 3 * k + 3].copy() for k, key in enumerate(told)}


def _seen(own: Blocks, shown: Rendered, others: Sequence[Rendered]) -> Blocks:
    """What a rendering shows, ``own``, and what ``others`` show besides, each surface once, up to ``MOST``."""
    parts, views, count = [own], [shown], len(own.place)
    for other in others:
        more, _ = blocks(other)
        for view in views:
            more = _unseen(more, view)
        if count + len(more.place) > MOST:
            break
        parts.append(more)
        views.append(other)
        count += len(more.place)
    return _together(parts)


def blocks(shown: Rendered) -> tuple[Blocks, int]:
    """Of a rendering, and how many pixels along a side they are: an odd number."""
    height, width = shown.rest.shape[:2]
    n = 2 * int(np.sqrt(height * width / BLOCKS) / 2) + 1
    row, column = (np.minimum(np.arange(n // 2, x + n // 2, n), x - 1) for x in (height, width))
    row, column = (x.reshape(-1) for x in np.meshgrid(row, column, indexing="ij"))
    passes = {k: shown.passes[k][row, column] for k in ("position", "normal", "material_id")}
    there = np.isfinite(passes["position"]).all(axis=1) & (passes["material_id"] >= 0)
    there &= np.isfinite(passes["normal"]).all(axis=1)
    light, indirect = {}, {}
    for name, share in shown.indirect.items():
        whole, part = (
            means(_padded(x, n), n).reshape(-1, 3)[there]
            for x in (shown.lamps[name], shown.lamps[name] * share)
        )
        light[name], indirect[name] = whole, np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)
    position, normal = (passes[k][there].astype(np.float32) for k in ("position", "normal"))
    area = n**2 * _footprint(shown.camera, position, normal)
    return Blocks(
        np.flatnonzero(there), position, normal, area, passes["material_id"][there], light, indirect
    ), n


def _footprint(camera: Camera, position: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(n,) m² of a surface that a pixel shows there."""
    K, eye, axis = camera.K, camera.world_from_camera[:3, 3], camera.world_from_camera[:3, 2]
    if camera.lens.projection is Projection.ORTHOGRAPHIC:
        across, way = np.ones(len(position)), np.broadcast_to(axis, position.shape)
    else:
        z = (position - eye) @ axis
        way = (position - eye) / np.linalg.norm(position - eye, axis=1, keepdims=True)
        across = z**2 * (way @ axis)
    facing = np.maximum(np.abs((normal * way).sum(axis=1)), 0.05)
    return np.asarray(across / (K[0, 0] * K[1, 1]) / facing, np.float32)


def _unseen(other: Blocks, shown: Rendered) -> Blocks:
    """Those of another camera's blocks that ``shown`` does not show."""
    height, width = shown.rest.shape[:2]
    pixel = shown.camera.project(other.position.astype(np.float64))
    with np.errstate(invalid="ignore"):
        near = np.rint(pixel)
        inside = (near >= 0).all(axis=1) & (near[:, 0] < width) & (near[:, 1] < height)
    column, row = np.where(inside[:, None], near, 0).astype(int).T
    there = shown.passes["position"][row, column]
    far = np.linalg.norm(other.position - shown.camera.world_from_camera[:3, 3], axis=1)
    with np.errstate(invalid="ignore"):
        same = np.linalg.norm(there - other.position, axis=1) < SEEN * far
    return other.of(~(inside & same))


def _together(parts: Sequence[Blocks]) -> Blocks:
    lamps = [name for name in parts[0].light if all(name in p.light for p in parts)]
    return Blocks(
        np.concatenate([p.place for p in parts]),
        np.concatenate([p.position for p in parts]),
        np.concatenate([p.normal for p in parts]),
        np.concatenate([p.area for p in parts]),
        np.concatenate([p.material for p in parts]),
        {name: np.concatenate([p.light[name] for p in parts]) for name in lamps},
        {name: np.concatenate([p.indirect[name] for p in parts]) for name in lamps},
    )


def _depends(K: np.ndarray, seen: Blocks, lamp: str, materials: int) -> np.ndarray:
    """(n, materials, 3): s of all blocks."""
    on = (seen.material[:, None] == np.arange(materials)).astype(np.float32)
    s = np.zeros((len(on), materials, 3), np.float32)
    if lamp not in seen.light:
        return s
    for k in range(3):
        L, i = seen.light[lamp][:, k], seen.indirect[lamp][:, k]
        whole = K @ L
        for _ in range(BOUNCES):
            given = K @ (L[:, None] * (on + i[:, None] * s[..., k]))
            s[..., k] = np.divide(given, whole[:, None], out=np.zeros_like(given), where=whole[:, None] > 0)
    return s


def _kernel(seen: Blocks) -> np.ndarray:
    """(n, n): cos θ cos θ' A' / r², r² no less than A', as what is nearer sees no point."""
    K = np.empty((len(seen.place),) * 2, np.float32)
    for k in range(0, len(K), CHUNK):
        way = seen.position[None] - seen.position[k : k + CHUNK, None]
        r2 = np.maximum((way**2).sum(axis=2), 1e-12)
        here = np.maximum(np.einsum("nmk,nk->nm", way, seen.normal[k : k + CHUNK]), 0)
        there = np.maximum(-np.einsum("nmk,mk->nm", way, seen.normal), 0)
        K[k : k + CHUNK] = here * there * seen.area / np.maximum(r2, seen.area) / r2
    return K


def _padded(plane: np.ndarray, n: int) -> np.ndarray:
    """With its last rows and columns again, until both are multiples of n."""
    more = [(0, -plane.shape[k] % n) for k in range(2)] + [(0, 0)] * (plane.ndim - 2)
    return np.pad(plane, more, mode="edge")
