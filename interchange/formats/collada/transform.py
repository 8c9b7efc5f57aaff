"""COLLADA's node transforms as the same stack of USD transform operations, in the same order."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pxr import Gf, Tf, Usd, UsdGeom

from interchange.formats.collada.animation import MOST_SAMPLES, SAMPLES_PER_FRAME, Animations, Track
from interchange.formats.collada.library import Library
from interchange.formats.collada.source import floats

LENGTHS = {"translate": 3, "rotate": 4, "scale": 3, "matrix": 16, "skew": 7, "lookat": 9}
Op = UsdGeom.XformOp


@dataclass(frozen=True)
class Step:
    """One operation: ``value`` turns the element's numbers into what the operation takes."""

    kind: Any  # UsdGeom.XformOp.Type
    value: Callable[[np.ndarray], Any]
    straight: bool = True  # linear in the element's numbers, so that USD's interpolation is the file's


def author_transforms(prim: Usd.Prim, node: Any, lib: Library, animations: Animations) -> None:
    """Append an operation a transform element of ``node``, with time samples where it is animated."""
    xform = UsdGeom.Xformable(prim)
    taken = {op.GetOpName() for op in xform.GetOrderedXformOps()}
    for element in node:
        if element.tag not in LENGTHS:
            continue
        numbers = floats(element, lib, LENGTHS[element.tag])
        if numbers is None:
            continue
        if not np.isfinite(numbers).all():
            lib.find.error(f"<{element.tag}> must hold finite numbers.", element)
            continue
        track = animations.track(element, numbers)
        step = _step(element.tag, numbers, track)
        if step is None:
            also = ", nor become so" if element.tag == "skew" else ""
            lib.find.error(
                f"<{element.tag}> must name directions that are not 0 and not parallel{also}.", element
            )
            continue
        suffix = Tf.MakeValidIdentifier(element.get("sid") or element.tag)
        base, count = suffix, 1
        while f"xformOp:{Op.GetOpTypeToken(step.kind)}:{suffix}" in taken:
            count += 1
            suffix = f"{base}_{count}"
        taken.add(f"xformOp:{Op.GetOpTypeToken(step.kind)}:{suffix}")
        op = xform.AddXformOp(step.kind, Op.PrecisionDouble, suffix)
        op.Set(step.value(numbers))
        if track is not None:
            times = track.samples() if step.straight else _dense(track.samples())
            if not step.straight and len(times) > MOST_SAMPLES:
                lib.find.error(f"The animation must not need more than {MOST_SAMPLES} samples.", element)
                continue
            for time, value in zip(times, track.at(times), strict=True):
                op.Set(step.value(value), Usd.TimeCode(time))


def _step(tag: str, numbers: np.ndarray, track: Track | None) -> Step | None:
    match tag:
        case "translate":
            return Step(Op.TypeTranslate, lambda v: Gf.Vec3d(*v))
        case "scale":
            return Step(Op.TypeScale, lambda v: Gf.Vec3d(*v))
        case "matrix":
            return Step(Op.TypeTransform, lambda v: _usd(v.reshape(4, 4)))
        case "rotate":
            turns = track is not None and any((index < 3).any() for index, _ in track.channels)
            axis = numbers[:3]
            if not axis.any() and not turns:
                return None if numbers[3] else Step(Op.TypeRotateX, lambda v: float(v[3]))
            main = np.flatnonzero(axis)
            if len(main) == 1 and not turns:
                kind = (Op.TypeRotateX, Op.TypeRotateY, Op.TypeRotateZ)[main[0]]
                sign = float(np.sign(axis[main[0]]))
                return Step(kind, lambda v: sign * float(v[3]))
            return Step(Op.TypeTransform, lambda v: _usd(rotation(v[:3], v[3])), straight=False)
        case "skew":
            if skew(numbers) is None:
                return None
            return Step(Op.TypeTransform, lambda v: _usd(_or_identity(skew(v))), straight=False)
        case _:
            if lookat(numbers) is None:
                return None
            return Step(Op.TypeTransform, lambda v: _usd(_or_identity(lookat(v))), straight=False)


def rotation(axis: np.ndarray, degrees: float) -> np.ndarray:
    """(4, 4) turn about an axis through the origin (Rodrigues)."""
    k = axis / (np.linalg.norm(axis) or 1.0)
    cross = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    m = np.eye(4)
    a = np.radians(degrees)
    m[:3, :3] += np.sin(a) * cross + (1 - np.cos(a)) * cross @ cross
    return m


def skew(v: np.ndarray) -> np.ndarray | None:
    """(4, 4) shear that turns direction ``v[1:4]`` by ``v[0]`` degrees towards ``v[4:7]``, which stays.

    RenderMan's Skew, which COLLADA names as its source. None for directions that are
    0 or parallel, or that the turn would make so.
    """
    a, b = v[1:4], v[4:7]
    if not (np.linalg.norm(a) > 0 and np.linalg.norm(b) > 0):
        return None
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    along = float(a @ b)
    n = a - along * b
    across = float(np.linalg.norm(n))
    if across < 1e-9:
        return None
    angle = np.arctan2(across, along) - np.radians(v[0])
    if not 1e-9 < angle < np.pi - 1e-9:
        return None
    m = np.eye(4)
    m[:3, :3] += (np.cos(angle) / np.sin(angle) - along / across) * np.outer(b, n / across)
    return m


def lookat(v: np.ndarray) -> np.ndarray | None:
    """(4, 4) pose at ``v[:3]`` whose -z axis meets ``v[3:6]`` with y near ``v[6:9]``. None where that is nowhere."""
    z = v[:3] - v[3:6]
    x = np.cross(v[6:9], z)
    if np.linalg.norm(z) == 0 or np.linalg.norm(x) < 1e-12 * np.linalg.norm(z):
        return None
    z, x = z / np.linalg.norm(z), x / np.linalg.norm(x)
    m = np.eye(4)
    m[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    m[:3, 3] = v[:3]
    return m


def _or_identity(m: np.ndarray | None) -> np.ndarray:
    return np.eye(4) if m is None else m  # a moment of an animation at which the directions meet


def _usd(m: np.ndarray) -> Gf.Matrix4d:
    return Gf.Matrix4d(m.T.tolist())


def _dense(times: np.ndarray) -> np.ndarray:
    first, last = times[0], times[-1]
    number = min((last - first) * SAMPLES_PER_FRAME, MOST_SAMPLES)
    grid = np.arange(np.ceil(first * SAMPLES_PER_FRAME), np.ceil(first * SAMPLES_PER_FRAME) + number)
    return np.unique(np.concatenate([times, np.clip(grid / SAMPLES_PER_FRAME, first, last)]))
