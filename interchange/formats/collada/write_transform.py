"""USD transform operations as COLLADA's, in the same order, and their time samples as animations."""

from typing import Any

import numpy as np
from pxr import Usd, UsdGeom

from interchange.formats.collada.extra import format_numbers
from interchange.formats.collada.xml_writer import Output, add
from interchange.formats.usd_values import matrix

Op = UsdGeom.XformOp
AXES = {Op.TypeRotateX: "X", Op.TypeRotateY: "Y", Op.TypeRotateZ: "Z"}
ORDERS = {
    Op.TypeRotateXYZ: "XYZ", Op.TypeRotateXZY: "XZY", Op.TypeRotateYXZ: "YXZ",
    Op.TypeRotateYZX: "YZX", Op.TypeRotateZXY: "ZXY", Op.TypeRotateZYX: "ZYX",
}  # fmt: skip
UNIT = {"X": "1 0 0", "Y": "0 1 0", "Z": "0 0 1"}


def write_transforms(node: Any, prim: Usd.Prim, time: Usd.TimeCode, out: Output, animate: bool) -> None:
    """Append the operations of ``prim`` to a <node>; with ``animate``, their samples to the animations."""
    xform = UsdGeom.Xformable(prim)
    sids: set[str] = set()

    def sid(op: UsdGeom.XformOp, more: str = "") -> str:
        parts = op.GetOpName().split(":")
        base = (parts[2] if len(parts) > 2 else parts[1]) + more
        name, count = base, 1
        while name in sids:
            count += 1
            name = f"{base}_{count}"
        sids.add(name)
        return name

    if xform.GetResetXformStack():
        out.find.loss(
            "The pose that takes no part in those above (resetXformStack) is written for one frame.", prim
        )
        cache = UsdGeom.XformCache(time)
        m = np.linalg.inv(matrix(cache.GetParentToWorldTransform(prim))) @ matrix(
            cache.GetLocalToWorldTransform(prim)
        )
        add(node, "matrix", format_numbers(m.ravel()), sid="transform")
        return
    for op in xform.GetOrderedXformOps():
        kind, times = op.GetOpType(), op.GetTimeSamples() if animate else []
        plain = not op.IsInverseOp()
        if plain and kind in (Op.TypeTranslate, Op.TypeScale):
            tag = "translate" if kind == Op.TypeTranslate else "scale"
            name = sid(op)
            add(node, tag, format_numbers(_numbers(op, time)), sid=name)
            values = np.stack([_numbers(op, t) for t in times]) if times else None
            _animate(node, name, times, values, "X Y Z", prim, out)
        elif plain and (kind in AXES or kind in ORDERS):
            letters = AXES.get(kind) or ORDERS[kind]
            for letter in reversed(letters):  # the first letter turns first: it stands last
                column = "XYZ".index(letter) if kind in ORDERS else 0
                name = sid(op, "" if kind in AXES else letter)
                angle = format_numbers(_numbers(op, time)[column : column + 1])
                add(node, "rotate", f"{UNIT[letter]} {angle}", sid=name)
                values = np.array([_numbers(op, t)[column] for t in times]) if times else None
                _animate(node, f"{name}.ANGLE", times, values, "ANGLE", prim, out)
        else:
            name = sid(op)
            add(node, "matrix", format_numbers(_matrix(op, time).ravel()), sid=name)
            if times and kind != Op.TypeTransform:
                times = sorted({*times, *np.arange(np.ceil(times[0]), times[-1] + 1e-9).tolist()})
                out.find.loss(
                    "Between frames the turn is interpolated as a matrix.", prim, op.GetAttr().GetName()
                )
            values = np.stack([_matrix(op, t).ravel() for t in times]) if times else None
            _animate(node, name, times, values, "TRANSFORM", prim, out)


def _numbers(op: UsdGeom.XformOp, time: Any) -> np.ndarray:
    value = op.GetAttr().Get(time)
    if value is None:
        value = (1.0,) * 3 if op.GetOpType() == Op.TypeScale else (0.0,) * 3
    return np.atleast_1d(np.asarray(value, np.float64))


def _matrix(op: UsdGeom.XformOp, time: Any) -> np.ndarray:
    return matrix(op.GetOpTransform(Usd.TimeCode(time)))


def _animate(
    node: Any,
    target: str,
    times: list[float],
    values: np.ndarray | None,
    params: str,
    prim: Usd.Prim,
    out: Output,
) -> None:
    if values is None:
        return
    stage = prim.GetStage()
    name = out.new_id(f"{node.get('id')}_{target.replace('.', '_')}")
    animation = add(out.libraries["animations"], "animation", id=name)
    seconds = np.array(times, np.float64) / stage.GetTimeCodesPerSecond()
    held = stage.GetInterpolationType() == Usd.InterpolationTypeHeld
    given = {
        "INPUT": out.source(animation, f"{name}-input", seconds, "TIME"),
        "OUTPUT": out.source(
            animation, f"{name}-output", values, params, "float4x4" if params == "TRANSFORM" else "float"
        ),
        "INTERPOLATION": out.source(
            animation,
            f"{name}-interpolation",
            np.array(["STEP" if held else "LINEAR"] * len(times)),
            "INTERPOLATION",
            "name",
        ),
    }
    sampler_id = out.new_id(f"{name}-sampler")
    sampler = add(animation, "sampler", id=sampler_id)
    for semantic, source in given.items():
        add(sampler, "input", semantic=semantic, source=f"#{source}")
    add(animation, "channel", source=f"#{sampler_id}", target=f"{node.get('id')}/{target}")
