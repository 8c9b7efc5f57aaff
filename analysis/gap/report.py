"""The diagnosis on one page, for people: a self-contained HTML file, plain words first, then pictures and tables."""

import base64
import html
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from string import Template

import cv2
import numpy as np

from analysis.gap.diagnose import Diagnosed
from analysis.gap.diagnosis import Diagnosis, Finding, names, write_text
from analysis.gap.ledger import NOISE, Share
from interchange.captures import Captures
from interchange.formats.images import encode_srgb
from interchange.parameter import parameters

SHOWN = 4  # captures
RED = 4.0  # σ at which the map is fully coloured
TITLES = {
    "material": "material", "object": "object", "light": "lit, shadow, edge, highlight", "zone": "part of the image",
    "frequency": "spatial frequency", "channel": "channel", "lamp": "lamp", "capture": "capture",
    "fixed to": "what it is fixed to",
}  # fmt: skip


def sentence(d: Diagnosis) -> str:
    """The verdict in one sentence or two."""
    g = d.gap
    closing = f"{100 * d.gap.explained:.0f} % of what can be closed on captures that nothing was fitted to"
    match d.verdict:
        case "none":
            return (
                f"No unmodelled effect was found: the captures are what the scene file says, within its tolerances "
                f"(chi {g.before:.2f}, noise {g.noise_floor:.2f})."
            )
        case "effects":
            return f"The gap comes from {names(d.effects)}; adding that closes {closing}."
        case "unknown":
            return f"There is a gap that no effect of the catalogue explains: {d.unknown[0][0]}."
        case _:
            return (
                f"The gap comes from {names(d.effects)} and from something that the catalogue does not have "
                f"({d.unknown[0][0]}); together that closes {closing}."
            )


def write_report(path: Path, found: Diagnosed, captures: Captures) -> None:
    """Write the page beside its place, and rename it there."""
    d = found.diagnosis
    template = Template((Path(__file__).parent / "report.html").read_text(encoding="utf-8"))
    page = template.substitute(
        verdict=html.escape(sentence(d)),
        kind="good" if d.verdict == "none" else "bad",
        gap=_gap(d),
        effects=_effects(d.effects) if d.effects else "<p>None.</p>",
        unknown="".join(f"<li>{html.escape(w)} (p = {p:.3f})</li>" for w, p in d.unknown)
        or "<li>Nothing.</li>",
        pictures=_pictures(found),
        ledger="".join(_kind(kind, d.where.of(kind)) for kind in TITLES if d.where.of(kind)),
        total=f"{d.where.total:.3f}",
        floor=f"{d.where.noise:.3f}",
        measured="measured from repeats"
        if d.where.measured
        else "from the sensor's model; there are no repeats",
        rivals=_ranking(found),
        tolerances=_tolerances(captures),
        notes="".join(f"<li>{html.escape(n)}</li>" for n in d.notes),
        seconds=f"{d.seconds:.0f}",
    )
    write_text(path, page)


def _gap(d: Diagnosis) -> str:
    g = d.gap
    rows = [
        (
            "before",
            f"{g.before:.3f}",
            f"{g.ci95_before[0]:.3f} to {g.ci95_before[1]:.3f}",
            f"{g.rmse_dn_before:.2f}",
        ),
        (
            "after",
            f"{g.after:.3f}",
            f"{g.ci95_after[0]:.3f} to {g.ci95_after[1]:.3f}",
            f"{g.rmse_dn_after:.2f}",
        ),
        ("noise", f"{g.noise_floor:.3f}", "", ""),
    ]
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    held = html.escape(", ".join(g.held_out))
    return (
        f"<table><tr><th></th><th>chi</th><th>95 %</th><th>rms, DN</th></tr>{body}</table>"
        f"<p>Measured on {held}. Intervals hold for these conditions.</p>"
    )


def _effects(findings: Sequence[Finding]) -> str:
    rows = []
    for f in findings:
        values = "<br>".join(
            html.escape(f"{n} = {p.value:.4g} ± {p.sigma:.2g}{'' if p.unit == '1' else ' ' + p.unit}")
            for n, p in f.parameters.items()
        )
        rivals = html.escape(", ".join(f"{n} ({p:.2f})" for n, p in f.rivals) or "none near")
        advice = f"<br>To tell them apart: {html.escape(f.separate_by)}." if f.separate_by else ""
        rows.append(
            f"<tr><td><b>{f.name.replace('_', ' ')}</b></td><td>{f.probability:.3f}</td><td>{values}</td>"
            f"<td>{f.gap_without:.3f} → {f.gap_with:.3f}</td><td>{rivals}{advice}</td></tr>"
        )
    head = "<tr><th>effect</th><th>probability</th><th>parameters</th><th>chi without → with</th><th>rivals</th></tr>"
    return f"<table>{head}{''.join(rows)}</table>"


def _ranking(found: Diagnosed) -> str:
    best = found.fit.best
    rows = []
    for h in found.fit.hypotheses[:10]:
        words = (
            " + ".join(f"{a.replace('_', ' ')} {b.rsplit('/', 1)[-1]}".strip() for a, b in h.causes) or "none"
        )
        rows.append(f"<tr><td>{html.escape(words)}</td><td>{h.score - best.score:+.1f}</td></tr>")
    return f"<table><tr><th>hypothesis</th><th>log odds to the best</th></tr>{''.join(rows)}</table>"


def _tolerances(captures: Captures) -> str:
    about = parameters(captures.tolerances)
    rows = [
        f"<tr><td>{f.name}</td><td>{getattr(captures.tolerances, f.name):g}</td><td>{about[f.name].meaning}</td></tr>"
        for f in fields(captures.tolerances)
    ]
    return f"<table>{''.join(rows)}</table>"


def _kind(kind: str, shares: Sequence[Share]) -> str:
    most = max(abs(s.share) for s in shares) or 1.0
    rows = []
    for s in shares:
        width = 100 * abs(s.share) / most
        colour = "#b9c2c9" if s.name == NOISE else "#b5382a" if s.share >= 0 else "#2f7d4f"
        rows.append(
            f"<tr><td>{html.escape(s.name)}</td><td>{100 * s.share:.1f} %</td>"
            f'<td class="bar"><div style="width:{width:.1f}%;background:{colour}"></div></td></tr>'
        )
    return f"<div><h3>{TITLES[kind]}</h3><table>{''.join(rows)}</table></div>"


def _pictures(found: Diagnosed) -> str:
    held = [c for c in found.conditions if c.held_out][:SHOWN]
    out = []
    for c in held:
        model = c.simulated()
        sigma = np.sqrt(model.temporal / len(c.captures) + model.fixed)
        top = max(float(np.percentile(c.mean, 99.5)) - model.black, 1.0)
        before, after = found.fit.before.simulated(c), found.fit.after.simulated(c)
        ok = c.usable(model)
        tiles = [
            ("capture", _shown((c.mean - model.black) / top)),
            ("simulation before", _shown((before - model.black) / top)),
            ("gap before, σ", _map((c.mean - before) / sigma, ok)),
            ("gap after, σ", _map((c.mean - after) / sigma, ok)),
        ]
        cells = "".join(f"<figure>{_image(p)}<figcaption>{t}</figcaption></figure>" for t, p in tiles)
        out.append(f"<h3>{html.escape(c.name)}</h3><div class='row'>{cells}</div>")
    return "".join(out)


def _shown(values: np.ndarray) -> np.ndarray:
    picture = np.rint(255 * encode_srgb(np.clip(values, 0, 1)))
    return np.broadcast_to(picture, (*picture.shape[:2], 3)).astype(np.uint8)


def _map(z: np.ndarray, ok: np.ndarray) -> np.ndarray:
    """Red where the capture is brighter than the simulation, blue where it is darker, grey where nothing counts."""
    mean = cv2.blur(np.ascontiguousarray(z.mean(axis=2), np.float32), (3, 3))
    t = np.clip(mean / RED, -1, 1)[..., None]
    red, blue, white = np.array([181, 56, 42]), np.array([38, 84, 150]), np.array([255, 255, 255])
    picture = np.where(t > 0, white + t * (red - white), white - t * (blue - white))
    picture[~ok] = (200, 200, 200)
    return np.asarray(np.rint(picture), np.uint8)


def _image(picture: np.ndarray) -> str:
    data = cv2.imencode(".png", picture[..., ::-1])[1].tobytes()
    return f'<img src="data:image/png;base64,{base64.b64encode(data).decode()}" alt="">'
