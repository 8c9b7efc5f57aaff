"""Causes that change what is rendered: each takes the scene as it stands to the scene as it is with the cause."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.blind.apart.scene import RENDERED as APART
from benchmarks.blind.bench import Bench, Matter, Part
from benchmarks.blind.cause import Cause
from benchmarks.blind.errors import turned_eye
from benchmarks.blind.scene_changes import of_lamps, of_matter, of_part
from benchmarks.blind.solids import box


def light_position(bench: Bench, c: Cause) -> Bench:
    d = c.amplitude * np.array(c.shape["direction"])
    return of_lamps(bench, c.place, position=lambda x: tuple(np.array(x.position) + d))


def light_size(bench: Bench, c: Cause) -> Bench:
    return of_lamps(bench, "", radius=lambda x: x.radius + c.amplitude)


def light_beam(bench: Bench, c: Cause) -> Bench:
    """Darker off the axis, by a linear and a quadratic term of cos θ."""
    b = (0.9 * c.amplitude, c.shape["second"] * c.amplitude)
    return of_lamps(
        bench, "", beam=lambda x: b, axis=lambda x: tuple(-np.array(x.position) / np.linalg.norm(x.position))
    )


def albedo(bench: Bench, c: Cause) -> Bench:
    gain = 1 + c.amplitude * np.array(c.shape["color"])

    def change(m: Matter) -> Matter:
        texture = None if m.texture is None else np.clip(m.texture * gain, 0, 0.98).astype(np.float32)
        return replace(m, diffuse=tuple(np.clip(np.array(m.diffuse) * gain, 0, 0.98)), texture=texture)

    return of_matter(bench, c.place, change)


def gloss(bench: Bench, c: Cause) -> Bench:
    """A wider or narrower highlight of the same energy head-on."""
    k = float(np.exp(c.shape["sign"] * c.amplitude))

    def change(m: Matter) -> Matter:
        lobes = tuple((tuple(np.array(w) * (k * n + 1) / (n + 1)), C, float(k * n)) for w, C, n in m.lobes)
        return replace(m, lobes=lobes, roughness=float(np.clip(m.roughness * k**-0.25, 0.05, 1)))

    return of_matter(bench, c.place, change)


def anisotropy(bench: Bench, c: Cause) -> Bench:
    """Brushed: the lobe is narrower along one tangent than along the other."""

    def change(m: Matter) -> Matter:
        lobes = tuple(
            (w, (C[0] - 0.5 * c.amplitude, C[1] + 0.5 * c.amplitude, C[2]), n) for w, C, n in m.lobes
        )
        return replace(m, lobes=lobes)

    return of_matter(bench, c.place, change)


def texture(bench: Bench, c: Cause) -> Bench:
    """Stains: smooth noise on the surface, of rms a."""
    rng = np.random.default_rng(c.shape["seed"])
    size = 96
    k = np.fft.fftfreq(size) * size
    spectrum = np.exp(-(np.hypot(*np.meshgrid(k, k)) ** 2) / 2 / c.shape["waves"] ** 2)
    noise = np.fft.ifft2(np.fft.fft2(rng.standard_normal((size, size))) * spectrum).real
    noise = (noise - noise.mean()) / noise.std()

    def change(m: Matter) -> Matter:
        base = np.array(m.diffuse) if m.texture is None else m.texture
        if m.texture is not None:
            n = m.texture.shape[0]
            stain = noise[:n, :n, None]
        else:
            stain = noise[..., None]
        return replace(m, texture=np.clip(base * (1 + c.amplitude * stain), 0.001, 0.98).astype(np.float32))

    return of_matter(bench, c.place, change)


def object_pose(bench: Bench, c: Cause) -> Bench:
    d = c.amplitude * np.array([np.cos(c.shape["angle"]), np.sin(c.shape["angle"]), 0])
    body = next(p for p in bench.parts if p.name == c.place)
    middle = body.solid.vertices.mean(axis=0)
    t = c.shape["turn"] * c.amplitude / 40

    def change(M: np.ndarray) -> np.ndarray:
        R = np.array([[np.cos(t), -np.sin(t), 0], [np.sin(t), np.cos(t), 0], [0, 0, 1]])
        out = M.copy()
        out[:3, :3] = M[:3, :3] @ R
        out[:3, 3] = M[:3, 3] + M[:3, :3] @ (middle - R @ middle) + d
        return out

    return of_part(bench, c.place, change)


def geometry(bench: Bench, c: Cause) -> Bench:
    """A part is higher than drawn, by the share a."""

    def one(p: Part) -> Part:
        if p.name != c.place:
            return p
        v = p.solid.vertices.copy()
        low = v[:, 2].min()
        v[:, 2] = low + (v[:, 2] - low) * (1 + c.shape["sign"] * c.amplitude)
        return replace(p, solid=replace(p.solid, vertices=v))

    return replace(bench, parts=tuple(one(p) for p in bench.parts))


def camera_pose(bench: Bench, c: Cause) -> Bench:
    """The first camera was knocked: a mrad about its axes, and a share of it in mm."""
    turn, shift = (c.amplitude * np.array(c.shape[k]) for k in ("turn", "shift"))
    first = turned_eye(bench.eyes[0], 1e-3 * turn, 0.4 * shift)
    return replace(bench, eyes=(first, *bench.eyes[1:]))


def occluder(bench: Bench, c: Cause) -> Bench:
    """Something dark that no camera sees stands between a lamp and the scene; a mm is its half edge."""
    slab = box(2 * c.amplitude, 2 * c.amplitude, 1.0)
    d = np.array(c.shape["at"])
    part = Part("occluder", slab.moved(*d), "occluder")
    return replace(
        bench,
        parts=(*bench.parts, part),
        matters=(*bench.matters, Matter("occluder", "Lambert", (0.03,) * 3)),
    )


RENDERED: dict[str, Callable[[Bench, Cause], Bench]] = {
    f.__name__: f
    for f in (light_position, light_size, light_beam, albedo, gloss, anisotropy, texture, object_pose, geometry,
              camera_pose, occluder)
}  # fmt: skip
ALL = {**RENDERED, **APART}


def changed(bench: Bench, causes: tuple[Cause, ...] | list[Cause]) -> Bench:
    for c in causes:
        if c.form in ALL and c.amplitude:
            bench = ALL[c.form](bench, c)
    return bench
