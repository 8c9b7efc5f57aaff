"""What limits a diagnosis, one sentence each."""

from collections.abc import Sequence

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.evidence.scales import UNDECLARED
from analysis.gap.finding import PRESENT
from analysis.gap.judgement import attribution
from analysis.gap.judgement.attribution import CATALOGUED
from analysis.gap.judgement.findings import JPEG, cautious
from analysis.gap.measures.ledger import Ledger
from analysis.gap.noise.finding import NoiseFinding
from analysis.gap.processed.encoded import Encoding
from analysis.gap.processed.matrices import Matrix
from analysis.gap.processed.overlap import notes_on_files, shifts
from analysis.gap.search.fit import Fit
from analysis.gap.terms import aperture
from interchange.effects.parts import called

SLIGHTLY = 1.5  # times a tolerance that nobody need look after


def notes(
    conditions: Sequence[Condition],
    fitted: Fit,
    where: Ledger,
    judged: Sequence[NoiseFinding],
    forged: Sequence[NoiseFinding],
    left: dict[str, str],
    lines: Sequence[object],
    encodings: Sequence[Encoding],
    mixed: Sequence[Matrix],
) -> list[str]:
    """``judged``: the effects of noise that were tried; ``forged``: those of them that were taken back; ``left``: what
    the corrected scene does not carry, and why; ``lines``: rows and columns that were taken out of the captures before;
    ``encodings``: cameras whose captures are encoded; ``mixed``: those with a colour matrix.
    """
    tried = {t.cause for t in fitted.terms} | {n.name for n in (*judged, *forged)}
    eight = any(c.captures[0].bits == 8 and c.captures[0].has_codes for c in conditions)
    tried |= {JPEG} if eight or any(c.packed is not None for c in conditions) else set()
    found = [
        *_encoded(encodings),
        *_mixed(mixed),
        *_refuted(fitted),
        *_tolerated(fitted),
        *(taken_back(n.name) for n in forged),
        *(note for n in judged if n.probability >= PRESENT for note in n.notes),
        *cautious(fitted),
        *_wider(fitted),
        *_apertures(fitted),
        *(str(x) for x in lines),
        *_of_captures(conditions, where),
    ]
    found += [
        f"The corrected scene does not carry {name.replace('_', ' ')}: {reason}"
        for name, reason in left.items()
    ]
    missing = sorted(n.replace("_", " ") for n in CATALOGUED - tried)
    if missing:
        found.append(f"Not tried with these captures and this renderer: {', '.join(missing)}.")
    return found


def _encoded(encodings: Sequence[Encoding]) -> list[str]:
    if not encodings:
        return []
    names = " and ".join(called(e.camera) for e in encodings)
    curves = " and ".join(dict.fromkeys(e.words for e in encodings))
    black = ", with black taken off before" if all(e.black_off for e in encodings) else ""
    return [
        f"The captures of {names} follow {curves}{black}, and the scene says that they are linear: they are "
        f"taken as they are, the corrected scene says so, and where the gap lies is told of what that leaves. Dim "
        f"parts of such images have coarser steps and bright ones finer than what light does; linear images of all "
        f"bits of the sensor tell more."
    ]


def _mixed(by: Sequence[Matrix]) -> list[str]:
    if not by:
        return []
    names = " and ".join(called(m.camera) for m in by)
    return [
        f"The captures of {names} went through a colour matrix, and the scene says of none: it is told from them and "
        f"taken back before anything is fitted, pictures here are of what it left, and the corrected scene has it "
        f"(sensor:colorCorrection). Crosstalk of the sensor is not told apart from it."
    ]


def taken_back(noise: str) -> str:
    return (
        f"Variances speak for {noise.replace('_', ' ')}; weighed by it, captures leave something else than it says, so "
        f"it is taken back."
    )


def _refuted(fitted: Fit) -> list[str]:
    return [
        f"The captures that were fitted to speak for {name.replace('_', ' ')}{of}; those held out are simulated better "
        f"without it, so it is taken back."
        for name, of in ((n, f" of {called(target)}" if target else "") for n, target in fitted.refuted)
    ]


def _tolerated(fitted: Fit) -> list[str]:
    if not fitted.tolerated or not attribution.called(fitted):
        return []
    return [
        f"The held-out captures show errors of the calibration that the others hardly show, as of a lamp that lights "
        f"little of what those see. With such errors as well, within their tolerances, the effects leave a chi of "
        f"{fitted.tolerated:.3g} there; all other figures are without them."
    ]


def _apertures(fitted: Fit) -> list[str]:
    v = aperture.variance(fitted.terms, fitted.after.theta)
    if not aperture.may_be_one(fitted.best.causes, v):
        return []
    return [
        f"A blur of {v**0.5:.2g} px is as small as that of pixels whose aperture is no square, and captures do not "
        f"tell the two apart: {aperture.TELLING} does."
    ]


def _wider(fitted: Fit) -> list[str]:
    notes = []
    for name, factor in fitted.factors.items():
        if factor > SLIGHTLY:
            of, than = (name, "expected") if name in UNDECLARED else (f"errors of {name}", "declared")
            notes.append(
                f"{of[0].upper()}{of[1:]} look {factor:g} times as large as {than}, and are taken so: check the "
                f"calibration. Effects below that are not found."
            )
    return notes


def _cut_off(found: Sequence[Condition]) -> list[str]:
    notes = []
    for name in dict.fromkeys(c.camera.name for c in found):
        own = [c for c in found if c.camera.name == name]
        share = float(np.mean([c.cut_off.mean() for c in own]))
        if share > 0:
            notes.append(
                f"{100 * share:.2g} % of what {called(name)} captured is cut off at DN 0, where the scene has a black "
                f"level of {own[0].camera.sensor.black_level:g} DN: it lies lower than that by as much or more, and "
                f"nothing else is told from there."
            )
    return notes


def _of_captures(found: Sequence[Condition], where: Ledger) -> list[str]:
    notes = []
    if not where.measured:
        notes.append(
            "No captures are repeats that show light away from saturation: the noise floor is the sensor model's, not "
            "measured."
        )
    notes += notes_on_files(found)
    notes += _cut_off(found)
    notes += [
        f"The captures of {name} lie {px:.1f} px off their simulation as a whole, which is more than registration "
        f"follows well: calibrate the camera anew, or take the figures as those of a wrong pose."
        for name, px in shifts(found).items()
    ]
    if len(found) < 6:
        notes.append(
            f"{len(found)} conditions are few: six or more, under two lamps and two poses, tell effects apart."
        )
    if any(c.shown.undrawn for c in found):
        notes.append(
            "The renderer draws direct light alone; what surfaces give each other was traced by paths, and is "
            "interreflection where the captures show it."
        )
    elif not any(c.shown.indirect for c in found):
        notes.append(
            "The simulation has direct light alone: interreflection is not among the causes that were tried."
        )
    return notes
