"""The diagnosis on one page, for people: a self-contained HTML file, plain words first, then pictures and tables."""

import html
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from string import Template

import numpy as np

from analysis.compare.slider import SCRIPT, STYLE, data_uri, slider
from analysis.gap.diagnose import Diagnosed
from analysis.gap.diagnosis import Diagnosis, write_text
from analysis.gap.evidence.sureness import TEMPERATURE
from analysis.gap.finding import Estimate, Finding, stage_of
from analysis.gap.judgement.rehearsal import Rehearsal
from analysis.gap.measures.ledger import NOISE, Share
from analysis.gap.processed.encoded import has_a_number
from analysis.gap.report.pictures import gap_map, shown, waterfall
from analysis.gap.report.words import (
    beneath,
    grounds,
    interval,
    kinds,
    lacking,
    meaning,
    next_captures,
    number,
    plain,
    sentence,
    what_is_left,
    why,
)
from interchange.captures import Captures
from interchange.effects.parts import called
from interchange.parameter import parameters

SHOWN = 4  # captures
BARS = 8  # of one kind of region; the rest is put together
TITLES = {
    "material": "material", "object": "object", "light": "lit, shadow, edge, highlight", "zone": "part of the image",
    "frequency": "spatial frequency", "channel": "channel", "lamp": "lamp", "capture": "capture",
    "fixed to": "what it is fixed to",
}  # fmt: skip
STRIP = ("capture", "after", "gap before", "gap after")
EXPLAINED = {
    "as written": "the scene file, rendered as it is",
    "before": "the scene file where it fits best within its tolerances",
    "after": "that, with the effects that were found",
    "noise": "the sensor's noise: no simulation can be nearer",
}


def write_report(path: Path, found: Diagnosed, captures: Captures) -> None:
    """Write the page beside its place, and rename it there."""
    d = found.diagnosis
    template = Template((Path(__file__).parent / "report.html").read_text(encoding="utf-8"))
    kind = {"none": "good", "effects": "bad"}.get(d.verdict, "odd")
    count = len(captures.captures)
    page = template.substitute(
        scene=html.escape(captures.scene.name),
        source=html.escape(
            f"{captures.file.name} · {captures.scene.name} · {count} captures, {len(found.conditions)} conditions, "
            f"{len(found.held_out)} held out"
        ),
        verdict=html.escape(sentence(d)),
        kind=kind,
        tiles=_tiles(d),
        slider=_slider(found),
        effects="".join(_effect(f, found) for f in d.effects) or "<p>None of the catalogue.</p>",
        unknown=_unknown(d),
        waterfall=waterfall(d.waterfall, d.gap.as_written**2),
        gap=_gap(d),
        verification=_verification(d),
        next=_list(next_captures(d, found.conditions, found.fit))
        or "<p>Nothing more is needed to tell these effects.</p>",
        ledger="".join(_kind(kind, d.where.of(kind)) for kind in TITLES if d.where.of(kind)),
        total=f"{d.where.total:.3f}",
        floor=f"{d.where.noise:.3f}",
        left=html.escape(what_is_left(d)),
        measured="measured from repeats"
        if d.where.measured
        else "from the sensor's model; there are no repeats",
        rivals=_ranking(found),
        rehearsal=_rehearsal(d.rehearsal) if d.rehearsal else "",
        smallest=_smallest(d),
        tolerances=_tolerances(captures, d.over_declared),
        notes="".join(f"<li>{html.escape(n)}</li>" for n in d.notes),
        seconds=f"{d.seconds:.0f}",
        corrected=html.escape(d.corrected_scene),
        style=STYLE,
        script=SCRIPT,
    )
    write_text(path, page)


def _tiles(d: Diagnosis) -> str:
    g = d.gap
    tiles = [
        (f"{g.before:.2f} → {g.after:.2f}", f"gap χ before → after; noise {g.noise_floor:.2f}"),
        (f"{g.rmse_dn_before:.1f} → {g.rmse_dn_after:.1f} DN", "rms difference of a pixel, noise included"),
    ]
    if d.effects or d.unknown:
        tiles.insert(1, (f"{100 * min(g.explained, 1):.0f} %", "of what can be closed is closed"))
    if d.edges:
        e = d.edges
        tiles.append(
            (
                f"{e.before.rms:.3f} → {e.after.rms:.3f} px",
                f"edges, rms; noise alone gives {e.after.floor:.3f}",
            )
        )
    if d.metric:
        m = d.metric
        tiles.append(
            (f"{m.error('before'):.4g} → {m.error('after'):.4g}", f"error of {html.escape(m.name)}, rms")
        )
    if d.verification:
        v = d.verification
        mark = "✓ holds" if v.holds else "✗ does not hold"
        lacks = f", which has no {lacking(v)}" if v.lacks else ""
        tiles.append((mark, f"rendered anew from the corrected scene{lacks}: χ {v.rendered:.2f}"))
    return "".join(f'<div class="tile"><b>{value}</b><span>{words}</span></div>' for value, words in tiles)


def _slider(found: Diagnosed) -> str:
    cases = {}
    for k, c in enumerate(found.held_out[:SHOWN]):
        lamps = ", ".join(n.rsplit("/", 1)[-1] for n in c.lamps) or "no lamp"
        words = f"{c.name}: {c.camera.name.rsplit('/', 1)[-1]}, {lamps}, {c.camera.t_exp:g} s"
        cases[words] = _pictures(found, k)
    first, pictures = next(iter(cases.items()))
    thumbs = "".join(
        f'<figure><img src="{data_uri(pictures[n])}" alt=""><figcaption>{n}</figcaption></figure>'
        for n in STRIP
    )
    return f'{slider(cases, "capture", "before")}<h3>{html.escape(first)}</h3><div class="row">{thumbs}</div>'


def _pictures(found: Diagnosed, k: int) -> dict[str, np.ndarray]:
    c, s = found.held_out[k], found.simulations
    model = c.simulated()
    sigma = np.sqrt(model.temporal / len(c.captures) + model.fixed)
    top = max(float(np.percentile(c.mean, 99.5)) - model.black, 1.0)
    ok = c.usable(model)
    images = {"capture": c.mean, "as written": s.as_written[k], "before": s.before[k], "after": s.after[k]}
    out = {name: shown((image - model.black) / top) for name, image in images.items()}
    for name in ("as written", "before", "after"):
        out[f"gap {name}"] = gap_map((c.mean - images[name]) / sigma, ok)
    return out


def _effect(f: Finding, found: Diagnosed) -> str:
    rows = "".join(_parameter(f.name, n, p, beneath(f, n)) for n, p in f.parameters.items())
    head = "<tr><th>parameter</th><th class=n>value</th><th class=n>σ</th><th>95 %</th><th></th></tr>"
    table = f"<table>{head}{rows}</table>"
    mark = why(kinds(f))
    seen = f"<dt>What gives it away</dt><dd>{html.escape(mark)}</dd>" if mark else ""
    said, others = grounds(found.fit, f)
    rivals = "".join(f"<dd>{html.escape(w)}</dd>" for w in others[:4]) or "<dd>Nothing looks alike.</dd>"
    against = (
        "<dd>What it takes off is below 0: it works against another effect, and shows beside it alone.</dd>"
    )
    said_so = against if f.share < 0 else ""
    advice = f"<dt>To tell them apart</dt><dd>{html.escape(f.separate_by)}</dd>" if f.separate_by else ""
    return (
        f'<div class="effect"><h3>{html.escape(f.called)}<span>{stage_of(f.name)} · probability {f.probability:.3f} · '
        f"takes off {100 * f.share:.0f} % of χ² · "
        f"χ without it {f.gap_without:.2f}, with it {f.gap_with:.2f}</span></h3>"
        f'<div class="meter"><div style="width:{100 * f.probability:.1f}%"></div></div>'
        f"<p>{html.escape(meaning(kinds(f)))}</p>"
        f'<div class="two"><div>{table}</div><dl><dt>Why</dt><dd>{html.escape(said)}</dd>{said_so}{seen}'
        f"<dt>Why not something else</dt>{rivals}{advice}</dl></div></div>"
    )


def _parameter(effect: str, name: str, p: Estimate, shown: str) -> str:
    if not has_a_number(name):
        return f"<tr><td>{html.escape(shown)}</td><td class=n>yes</td><td></td><td></td><td></td></tr>"
    return (
        f"<tr><td>{html.escape(shown)}</td><td class=n>{number(p.value, p.sigma)}</td><td class=n>± {p.sigma:.2g}</td>"
        f"<td>{interval(effect, name, p)}</td>"
        f"<td>{html.escape('' if p.unit == '1' else p.unit)}</td></tr>"
    )


def _unknown(d: Diagnosis) -> str:
    if not d.unknown:
        return ""
    rows = _list([f"{words[:1].upper()}{words[1:]} (probability {p:.3f})." for words, p in d.unknown])
    return f"<h3>Outside the catalogue</h3>{rows}"


def _gap(d: Diagnosis) -> str:
    g, e, m = d.gap, d.edges, d.metric
    head = "<tr><th></th><th class=n>χ</th><th>95 %</th><th class=n>rms, DN</th>"
    head += "<th class=n>edges, rms px</th><th class=n>mean px</th>" if e else ""
    head += f"<th class=n>error of {html.escape(m.name)}</th>" if m else ""
    rows = []
    for name, chi, ci95, dn in (
        ("as written", g.as_written, None, g.rmse_dn_as_written),
        ("before", g.before, g.ci95_before, g.rmse_dn_before),
        ("after", g.after, g.ci95_after, g.rmse_dn_after),
    ):
        key = name.replace(" ", "_")
        cells = [f"<b>{name}</b>: {EXPLAINED[name]}", f"{chi:.3f}"]
        cells += [f"{ci95[0]:.3f} to {ci95[1]:.3f}" if ci95 else "", f"{dn:.2f}"]
        if e:
            cells += [f"{getattr(e, key).rms:.3f}", f"{getattr(e, key).mean:+.3f}"]
        if m:
            cells.append(f"{m.error(key):.4g}")
        rows.append(cells)
    last = [f"<b>noise</b>: {EXPLAINED['noise']}", f"{g.noise_floor:.3f}", "", ""]
    rows.append([*last, *([f"{e.after.floor:.3f}", ""] if e else []), *([""] if m else [])])
    body = "".join(
        f"<tr><td>{row[0]}</td><td class=n>{row[1]}</td><td>{row[2]}</td>"
        + "".join(f"<td class=n>{cell}</td>" for cell in row[3:])
        + "</tr>"
        for row in rows
    )
    held = html.escape(", ".join(g.held_out))
    places = f" Edges: {e.after.count} places where objects or materials meet." if e else ""
    return (
        f"<table>{head}</tr>{body}</table><p class=soft>Measured on {held}. Bars: mean χ² that each step takes off; "
        f"with several effects these are Shapley's shares. Intervals hold for these conditions.{places}</p>"
    )


def _verification(d: Diagnosis) -> str:
    v = d.verification
    if v is None:
        reason = (
            "Nothing was corrected."
            if not d.effects
            else "The corrected scene was not rendered anew (--no-verify)."
        )
        return f"<p>{reason}</p>"
    mark = '<span class="mark yes">Yes.</span>' if v.holds else '<span class="mark no">No.</span>'
    words = "agrees within 10 %" if v.holds else "differs by more than 10 %"
    lacks = (
        f" That file has no {lacking(v)} (see the notes), so this is predicted without; with everything that was found "
        f"χ is {d.gap.after:.3f}, which no rendering has tested."
        if v.lacks
        else ""
    )
    return (
        f"<p>{mark} The simulator rendered the held-out captures anew from "
        f"<code>{html.escape(d.corrected_scene)}</code>: χ {v.rendered:.3f} where {v.claimed:.3f} was predicted, "
        f"which {words}. Calibration's errors within the "
        f"tolerances are taken out of both alike; with the file as it is, χ is {v.as_written:.3f} "
        f"(the original file: {d.gap.as_written:.3f}).{lacks}</p>"
    )


def _ranking(found: Diagnosed) -> str:
    best = found.fit.best
    rows = []
    ranked = found.fit.hypotheses
    named = {c for h in ranked[:1] for c in h.causes}
    instead = [h for h in ranked if not named & set(h.causes)]
    nothing = [h for h in ranked if not h.causes]
    for h in dict.fromkeys([*ranked[:6], *instead[:4], *nothing]):
        words = (
            " + ".join(f"{plain(a)} {b.rsplit('/', 1)[-1]}".strip() for a, b in h.causes)
            or "nothing but tolerances"
        )
        rows.append(f"<tr><td>{html.escape(words)}</td><td class=n>{h.score - best.score:+.1f}</td></tr>")
    return (
        f"<table><tr><th>explanation</th><th class=n>log odds to the best</th></tr>{''.join(rows)}</table>"
        f"<p>These are the evidence's. A probability is told with its log odds over {TEMPERATURE:g} or more, so "
        f"that it agrees with how often such calls were right in cases of another engine whose causes were sealed.</p>"
    )


def _rehearsal(r: Rehearsal) -> str:
    exact, without = (f"{k} of {n}" for k, n in (r.counts(True), r.counts(False)))
    told = (
        f"Probabilities above are told with their log odds over {r.temperature:.2g}, which makes them agree with "
        f"how often they were right there."
        if r.temperature > TEMPERATURE
        else "There the evidence was no surer than probabilities above are told."
    )
    rows = "".join(
        f"<tr><td>{html.escape(plain(c.truth) or 'nothing')}</td><td class=n>{100 * c.severity:.2g} %</td>"
        f"<td>{html.escape(', '.join(f'{plain(n)} ({p:.2f})' for n, p in c.said.items()) or 'none')}</td>"
        f"<td>{'yes' if c.exact else 'no'}</td></tr>"
        for c in r.cases
    )
    return (
        f"<h3>Cases simulated from this scene</h3><p>Of those with an effect {exact} were answered exactly, of those "
        f"without {without}. {told}</p><table><tr><th>was there</th>"
        f"<th class=n>of the signal</th><th>said, before that</th><th>exact</th></tr>{rows}</table>"
    )


def _smallest(d: Diagnosis) -> str:
    rows = []
    for x in d.smallest:
        ends = (f"{100 * s:.2g} %" if np.isfinite(s) else "never" for s in (x.easiest, x.hardest))
        cells = "</td><td class=n>".join(ends)
        rows.append(
            f"<tr><td>{html.escape(plain(x.cause[0]))}</td><td class=n>{cells}</td>"
            f"<td>{html.escape(called(x.cause[1]))}</td></tr>"
        )
    head = (
        "<tr><th>effect</th><th class=n>at its easiest</th><th class=n>of anything</th><th>easiest</th></tr>"
    )
    return f"<table>{head}{''.join(rows)}</table>"


def _tolerances(captures: Captures, over: dict[str, float]) -> str:
    about = parameters(captures.tolerances)
    rows = "".join(
        f"<tr><td><code>{f.name}</code></td><td class=n>{getattr(captures.tolerances, f.name):g}</td>"
        f"<td>{about[f.name].meaning}{'' if about[f.name].unit == '1' else ', ' + about[f.name].unit}</td>"
        f"<td class=n>{f'{over[f.name]:g}' if f.name in over else ''}</td></tr>"
        for f in fields(captures.tolerances)
    )
    head = "<tr><th>tolerance</th><th class=n>declared</th><th>one σ of</th><th class=n>looks times that</th></tr>"
    return f"<table>{head if over else ''}{rows}</table>"


def _kind(kind: str, shares: Sequence[Share]) -> str:
    regions, noise = [s for s in shares if s.name != NOISE], [s for s in shares if s.name == NOISE]
    kept = regions
    if len(regions) > BARS:
        kept = regions[: BARS - 1]
        rest = regions[BARS - 1 :]
        kept.append(Share(kind, f"{len(rest)} others", sum(s.share for s in rest)))
    most = max(abs(s.share) for s in [*kept, *noise]) or 1.0
    rows = []
    for s in [*kept, *noise]:
        colour = "#b9c2c9" if s.name == NOISE else "#b5382a" if s.share >= 0 else "#2f7d4f"
        rows.append(
            f"<tr><td>{html.escape(s.name)}</td><td class=n>{100 * s.share:.1f} %</td>"
            f'<td class="bar"><div style="width:{100 * abs(s.share) / most:.1f}%;background:{colour}"></div></td></tr>'
        )
    return f"<div><h3>{TITLES[kind]}</h3><table>{''.join(rows)}</table></div>"


def _list(lines: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{html.escape(x)}</li>' for x in lines)}</ul>" if lines else ""
