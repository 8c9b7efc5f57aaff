"""Pictures of the report: captures and simulations as they look, maps of the gap, and the waterfall as SVG."""

import html
from collections.abc import Sequence

import cv2
import numpy as np

from analysis.gap.measures.shapley import Step
from interchange.formats.images import encode_srgb

RED = 4.0  # σ at which the map is fully coloured
COLOURS = {
    "calibration": "#8fa3b3",
    "effect": "#265496",
    "unknown": "#b7791f",
    "rest": "#b5382a",
    "noise": "#b9c2c9",
}


def shown(values: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8 of linear values (H, W, C) that are 1 where white is."""
    picture = np.rint(255 * encode_srgb(np.clip(values, 0, 1)))
    return np.broadcast_to(picture, (*picture.shape[:2], 3)).astype(np.uint8)


def gap_map(z: np.ndarray, ok: np.ndarray) -> np.ndarray:
    """Red where the capture is brighter than the simulation, blue where it is darker, grey where nothing counts.

    ``z`` (H, W, C): the difference in σ; ``ok`` (H, W) bool.
    """
    mean = cv2.blur(np.ascontiguousarray(z.mean(axis=2), np.float32), (3, 3))
    t = np.clip(mean / RED, -1, 1)[..., None]
    red, blue, white = np.array([181, 56, 42]), np.array([38, 84, 150]), np.array([255, 255, 255])
    picture = np.where(t > 0, white + t * (red - white), white - t * (blue - white))
    picture[~ok] = (200, 200, 200)
    return np.asarray(np.rint(picture), np.uint8)


def waterfall(steps: Sequence[Step], total: float) -> str:
    """An inline SVG: what each step takes off the mean χ² of the scene file as written, down to the noise."""
    width, left, right, row = 860, 230, 120, 30
    rows = [("scene file as written", "total", total, 0.0, total)]
    level = total
    for s in steps:
        if s.kind == "noise":
            rows.append((s.name, s.kind, s.chi2, 0.0, s.chi2))
        else:
            rows.append((s.name.replace("_", " "), s.kind, s.chi2, level - s.chi2, level))
            level -= s.chi2
    low = min(0.0, *(min(a, b) for *_, a, b in rows))
    most = max(max(a, b) for *_, a, b in rows)
    scale = (width - left - right) / max(most - low, 1e-12)

    def x(value: float) -> float:
        return left + (value - low) * scale

    out = []
    for k, (name, kind, value, a, b) in enumerate(rows):
        y = 8 + k * row
        colour = COLOURS.get(kind, "#1d2a35") if value >= 0 or kind == "noise" else "#2f7d4f"
        begin, end = sorted((x(a), x(b)))
        stays = kind in ("total", "rest", "noise")
        label = f"{value:.3g}" if stays else f"{-value:+.3g}".replace("-", "−")
        percent = f" ({100 * value / total:.0f} %)" if kind != "total" and total > 0 else ""
        out.append(
            f'<text x="{left - 12}" y="{y + 15}" text-anchor="end">{html.escape(name)}</text>'
            f'<rect x="{begin:.1f}" y="{y + 2}" width="{max(end - begin, 1.5):.1f}" height="17" fill="{colour}"/>'
            f'<text x="{end + 8:.1f}" y="{y + 15}">{label}{percent}</text>'
        )
        if k + 1 < len(rows) and kind != "rest":
            edge = x(a) if kind != "total" else x(b)
            out.append(
                f'<line x1="{edge:.1f}" x2="{edge:.1f}" y1="{y + 19}" y2="{y + row + 2}" stroke="#9aa7b2" '
                f'stroke-dasharray="2 2"/>'
            )
    height = 12 + row * len(rows)
    zero = f'<line x1="{x(0):.1f}" x2="{x(0):.1f}" y1="4" y2="{height - 4}" stroke="#1d2a35"/>'
    return (
        f'<svg viewBox="0 0 {width} {height}" width="100%" style="max-width:{width}px" role="img" '
        f'aria-label="waterfall of the mean squared gap">{zero}{"".join(out)}</svg>'
    )
