"""One page about one fit: can it be believed, where not, and which model would do better. HTML, all in one file."""

from collections.abc import Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np

from analysis.fit import pictures
from analysis.fit.fit import METRICS, Fit, metric_of
from analysis.fit.rank import Ranked
from analysis.fit.spheres import render_spheres, tabulated
from interchange.brdf.base import Brdf

MINIMISED = {
    "relative": "relative: differences over the fitted f",
    "log": "log: differences of ln f",
    "mse": "mse: differences of f",
    "cosine": "cosine: differences of f cos θ_i",
    "sigma": "sigma: differences over the file's own σ (chi squared)",
}
METRIC_NAMES = {"mse": "f, 1/sr", "cosine": "f cos θ_i, 1/sr", "log": "ln f"}


def report(
    fit: Fit, record: dict[str, Any], ranked: Sequence[Ranked] = (), measured: Brdf | None = None
) -> str:
    """The page. ``record``: of the same fit. ``measured``: the measurement as a model, where its file is a table."""
    page = Template(files("analysis.fit").joinpath("report.html").read_text(encoding="utf-8"))
    metric = metric_of(fit.options.weighting)
    name = record["model"]["name"]
    lobes = f", {fit.lobes} lobe{'s' if fit.lobes > 1 else ''}" if fit.lobes else ""
    chosen = record["model"]["parts"][0]["name"] + ", each channel alone" if fit.parts else name
    return page.substitute(
        title=escape(f"{chosen}{lobes} fitted to {record['measurement']['file']}"),
        verdict=_verdict(fit, record, ranked, metric),
        spheres=_spheres(fit, measured),
        plane=pictures.in_plane(fit),
        residuals=pictures.residual_map(fit),
        parameters=_parameters(fit),
        warnings=_list(fit.warnings) if fit.warnings else "<p>Nothing stands against the parameters.</p>",
        correlation=pictures.correlation(fit) if fit.unknowns < 40 else "",
        by_fold=_by_fold(fit),
        ranking=_ranking(ranked, metric, name) if ranked else "",
        provenance=_provenance(record),
    )


def _verdict(fit: Fit, record: dict[str, Any], ranked: Sequence[Ranked], metric: str) -> str:
    told = record["held_out_errors"]["foretold"]
    best = next((r for r in ranked if r.fit is not None), None)
    factor = fit.held_out.rms[metric] / max(fit.errors.rms[metric], 1e-12)
    text = (
        f"Half of the readings at incidence angles that the fit had not seen are foretold within "
        f"<b>{_percent(told['median'])}</b>, nine tenths within {_percent(told['p90'])}."
        if fit.options.folds == "incidence"
        else f"Half of the readings that the fit had not seen are foretold within <b>{_percent(told['median'])}</b>, "
        f"nine tenths within {_percent(told['p90'])}."
    )
    worst = max(fit.held_out.by_fold, key=lambda label: fit.held_out.by_fold[label][metric])
    share = fit.held_out.by_fold[worst][metric] / max(fit.held_out.rms[metric], 1e-12)
    if share > 1.5:
        text += f" With light at {worst} it is {share:.1f} times as far off as on the whole."
    if factor > 1.5:
        text += f" Unseen angles are {factor:.1f} times as far off as fitted ones: beware beyond what was measured."
    if best is not None and best.fit is not None:
        own = record["model"]["name"]
        if best.model == own:
            text += " No other model of the catalogue foretells them better."
        else:
            ratio = best.error(metric) / fit.held_out.rms[metric]
            text += f" Of the catalogue, {best.model} does best: {ratio:.2f} times this error."
    return text


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share < 3 else f"a factor of {share + 1:.0f}"


def _spheres(fit: Fit, measured: Brdf | None) -> str:
    data, fitted = render_spheres([measured or tabulated(fit.samples), fit.brdf])
    bright = data.max(axis=-1)
    exposure = 1 / max(float(np.percentile(bright[bright > 0], 97)), 1e-12)
    off = data.mean(axis=-1) - fitted.mean(axis=-1)
    lit = bright > 0.02 / exposure
    share = float(
        np.sqrt(np.mean(np.square(off[lit]))) / np.sqrt(np.mean(np.square(data.mean(axis=-1)[lit])))
    )
    captions = ("the measurement, interpolated between its samples", "the fit")
    shown = "".join(
        f"<figure>{pictures.picture(p, exposure)}<figcaption>{c}</figcaption></figure>"
        for p, c in zip((data, fitted), captions, strict=True)
    )
    return (
        f'<div class="row">{shown}</div><p>Radiance differs by {100 * share:.0f} % rms over the lit side.</p>'
    )


def _parameters(fit: Fit) -> str:
    rows = []
    for e in fit.estimates:
        if e.bound:
            spread = f"at its {'lower' if e.bound == 'low' else 'upper'} bound"
        elif not np.isfinite(e.sigma):
            spread = "not told by the samples"
        else:
            spread = f"{e.low:.4g} … {e.high:.4g}"
        over = fit.jackknife.get(e.name, float("nan"))
        rows.append((escape(e.name), f"{e.value:.4g}", spread, f"{over:.2g}" if np.isfinite(over) else ""))
    return _table(("parameter", "value", "95 % interval", "σ over held-out angles"), rows)


def _by_fold(fit: Fit) -> str:
    rows = [(label, *(f"{errors[m]:.3g}" for m in METRICS)) for label, errors in fit.held_out.by_fold.items()]
    rows.append(("<b>all held out</b>", *(f"<b>{fit.held_out.rms[m]:.3g}</b>" for m in METRICS)))
    rows.append(("fitted", *(f"{fit.errors.rms[m]:.3g}" for m in METRICS)))
    return _table(("left out", *(METRIC_NAMES[m] for m in METRICS)), rows)


def _ranking(ranked: Sequence[Ranked], metric: str, chosen: str) -> str:
    rows: list[tuple[str, ...]] = []
    for r in ranked:
        if r.fit is None:
            rows.append((escape(r.model), "", "", "", "", escape(r.reason)))
            continue
        name = f"{r.model}, {r.fit.lobes} lobes" if r.fit.lobes > 1 else r.model
        note = "" if r.fit.finished else "stopped at the time limit"
        rows.append(
            (escape(name), str(r.fit.unknowns), *(f"{r.fit.held_out.rms[m]:.3g}" for m in METRICS), note)
        )
    head = ("model", "numbers", *(METRIC_NAMES[m] for m in METRICS), "")
    plot = pictures.ranking(ranked, metric, chosen)
    numbers = f"<details><summary>Numbers</summary>{_table(head, rows)}</details>"
    return f"<h2>All models, by what they foretell</h2>{plot}{numbers}"


def _provenance(record: dict[str, Any]) -> str:
    m = record["measurement"]
    rows = [
        ("file", f"{escape(m['file'])}, SHA-256 {m['sha256'][:16]}…"),
        ("samples", f"{m['used']} used of {m['samples']}: {m['masked']} masked, {m['not_finite']} not finite, "
                    f"{m['below_the_surface']} below the surface"),
        ("bands", f"{', '.join(m['bands'])} of {len(m['columns'])} columns"),
        ("negative readings", ", ".join(f"{k} {v}" for k, v in m["negative"].items()) + " (kept)"),
        ("readings of exactly 0", ", ".join(f"{k} {v}" for k, v in m["zero"].items())),
        ("noise", "the file's own σ" if m["sigma"] else "not given; from the residuals"),
        ("minimised", MINIMISED[record["options"]["weighting"]]),
        ("command", f"<code>{escape(record['command'])}</code>"),
        ("versions", escape(", ".join(f"{k} {v}" for k, v in record["versions"].items()))),
    ]  # fmt: skip
    rows += [("note", escape(n)) for n in m["notes"]]
    return _table(("", ""), rows)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    top = "".join(f"<th>{h}</th>" for h in head)
    body = "".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def _list(lines: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>"
