"""A pair of images compared: as data, as JSON, and on a page for people."""

import html
import json
import math
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from string import Template
from typing import Any

import cv2
import numpy as np

from analysis.compare.algorithms import Matched, Results, results
from analysis.compare.numbers import Difference, difference
from analysis.compare.slider import SCRIPT, STYLE, slider
from interchange.formats.images import encode_srgb
from interchange.image import Image

FULL = 98.0  # percentile of |b - a| at which the map is fully coloured


@dataclass(frozen=True, eq=False)
class Comparison:
    """``b`` against the reference ``a``; ``names`` of both, for people."""

    names: tuple[str, str]
    a: Image
    b: Image
    difference: Difference
    results: Results


def compare(a: Image, b: Image, names: tuple[str, str] = ("A", "B")) -> Comparison:
    """Numbers and results of algorithms of two images of equal quantity, ``a`` being the reference.

    Raises BrightfieldError where quantity or size differ.
    """
    return Comparison(names, a, b, difference(a, b), results(a, b))


def record(c: Comparison) -> dict[str, Any]:
    """What ``compare.json`` holds; a number that there is not (no edge paired, equal images' PSNR) is null."""

    def finite(value: Any) -> Any:
        if isinstance(value, dict):
            return {k: finite(v) for k, v in value.items()}
        if isinstance(value, list | tuple):
            return [finite(v) for v in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    h, w, channels = c.a.pixels.shape
    return finite(
        {
            "a": c.names[0],
            "b": c.names[1],
            "quantity": c.a.quantity.value,
            "size": [w, h, channels],
            "difference": asdict(c.difference),
            "edges": {**asdict(c.results.edges), "f1": c.results.edges.f1},
            "corners": {**asdict(c.results.corners), "f1": c.results.corners.f1},
            "segmentation": asdict(c.results.segmentation),
        }
    )


def rows(c: Comparison) -> list[tuple[str, str, str]]:
    """What is told, how much it is, and what that means: for the terminal and the page alike."""
    d, r = c.difference, c.results
    unit = d.unit
    psnr = "equal images" if math.isinf(d.psnr_dB) else f"{d.psnr_dB:.2f} dB"

    def offset(m: Matched, signed: bool) -> str:
        if math.isnan(m.rms_px):
            return "none paired"
        mean = f"{m.mean_px:+.3f} px mean, " if signed else ""
        return f"{mean}{m.rms_px:.3f} px rms"

    def counts(m: Matched) -> str:
        right = f"{100 * m.recall:.1f} % of A's found, {100 * m.precision:.1f} % of B's right"
        return f"{m.found[0]} in A, {m.found[1]} in B; {right}"

    s = r.segmentation
    bright = f"{100 * s.area[0]:.2f} % of A, {100 * s.area[1]:.2f} % of B"
    return [
        ("rms difference", f"{d.rms:.4g} {unit}", f"{d.rms_percent:.2f} % of A's mean"),
        ("bias, mean of B − A", f"{d.bias:+.4g} {unit}", f"B = {d.gain:.4f} A {d.offset:+.4g} fits best"),
        ("largest difference", f"{d.worst:+.4g} {unit}", ""),
        ("PSNR", psnr, f"over {d.peak:.5g} {unit}"),
        ("SSIM", f"{d.ssim:.5f}", "1 for equal images; blind to small smooth differences"),
        ("edges", f"F1 {r.edges.f1:.3f}", counts(r.edges)),
        ("edge offset", offset(r.edges, True), "across the edge, towards its brighter side"),
        ("corners", f"F1 {r.corners.f1:.3f}", counts(r.corners)),
        ("corner offset", offset(r.corners, False), ""),
        (
            "segments",
            f"overlap {s.overlap:.4f}",
            f"{100 * s.agreement:.2f} % of pixels agree; bright: {bright}",
        ),
    ]


def pictures(c: Comparison) -> dict[str, np.ndarray]:
    """(H, W, 3) uint8: both images by one scale, the map of B − A, edges and segments of both."""
    low = 0.0
    top = max(float(np.percentile(c.a.pixels, 99.5)), 1e-30)
    a, b = (_shown((i.pixels - low) / (top - low)) for i in (c.a, c.b))
    e = (c.b.pixels - c.a.pixels).mean(axis=2)
    limit = full_scale(c)
    t = np.clip(e / limit, -1, 1)[..., None]
    red, blue, white = np.array([181, 56, 42]), np.array([38, 84, 150]), np.array([255, 255, 255])
    colours = np.where(t > 0, white + t * (red - white), white - t * (blue - white))
    edges = (0.35 * a + 0.35 * 255).astype(np.uint8)
    for points, colour in zip(c.results.edge_points, ((38, 84, 150), (215, 60, 30)), strict=True):
        for x, y in np.rint(4 * points).astype(int):
            cv2.circle(edges, (int(x), int(y)), 1, colour, -1, cv2.LINE_8, 2)
    first, second = c.results.segments
    segments = np.zeros((*first.shape, 3), np.uint8)
    segments[first & second], segments[first & ~second], segments[~first & second] = (
        (225, 225, 225),
        (38, 84, 150),
        (215, 60, 30),
    )
    return {
        "A": a,
        "B": b,
        "B − A": np.rint(colours).astype(np.uint8),
        "edges (A blue, B red)": edges,
        "segments (A only blue, B only red)": segments,
    }


def full_scale(c: Comparison) -> float:
    """|b - a| at which the map is fully coloured."""
    return max(float(np.percentile(np.abs((c.b.pixels - c.a.pixels).mean(axis=2)), FULL)), 1e-30)


def _shown(values: np.ndarray) -> np.ndarray:
    picture = np.rint(255 * encode_srgb(np.clip(values, 0, 1)))
    return np.array(np.broadcast_to(picture, (*picture.shape[:2], 3)), np.uint8)


def write(folder: Path, c: Comparison) -> None:
    """``compare.json``, ``compare.html`` and ``difference.png`` in ``folder``, each beside its place and renamed."""
    folder.mkdir(parents=True, exist_ok=True)
    made = pictures(c)
    template = Template((Path(__file__).parent / "comparison.html").read_text(encoding="utf-8"))
    body = "".join(
        f"<tr><td>{html.escape(what)}</td><td><b>{html.escape(value)}</b></td><td>{html.escape(more)}</td></tr>"
        for what, value, more in rows(c)
    )
    h, w, channels = c.a.pixels.shape
    page = template.substitute(
        a=html.escape(c.names[0]),
        b=html.escape(c.names[1]),
        about=f"{w} × {h} px, {channels} channel{'s' if channels > 1 else ''}, {c.a.quantity.value}",
        rows=body,
        slider=slider({f"{c.names[0]} and {c.names[1]}": made}, "A", "B"),
        scale=f"{full_scale(c):.4g} {c.difference.unit}",
        style=STYLE,
        script=SCRIPT,
    )
    text = json.dumps(record(c), indent=1, allow_nan=False) + "\n"
    png = cv2.imencode(".png", np.ascontiguousarray(made["B − A"][..., ::-1]))[1].tobytes()
    for name, data in (
        ("compare.html", page.encode()),
        ("compare.json", text.encode()),
        ("difference.png", png),
    ):
        beside = folder / f".{name}.{os.getpid()}"
        beside.write_bytes(data)
        os.replace(beside, folder / name)
