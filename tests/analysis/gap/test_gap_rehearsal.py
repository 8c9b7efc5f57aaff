"""Probabilities are made to agree with how often they were right, on cases drawn as the model says."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.gap.compared.conditions import Condition
from analysis.gap.evidence.likelihood import Evidence
from analysis.gap.evidence.sureness import cooled
from analysis.gap.judgement.rehearsal import Rehearsal, Rehearsed
from analysis.gap.judgement.rehearsing import _captured, _drawn, rehearse
from analysis.gap.search.fit import Fit, _terms
from analysis.gap.search.model import Model
from analysis.gap.search.search import Search
from analysis.gap.terms.normal_equations import total_of
from interchange.captures import Tolerances

VIGNETTING = ("vignetting", "")


def said(p: float, right: int, wrong: int) -> Rehearsal:
    there = Rehearsed("gloss", 0.01, {"gloss": p}, True)
    return Rehearsal((there,) * right + (replace(there, truth="", exact=False),) * wrong)


@pytest.mark.parametrize(("p", "share"), [(0.99, 0.8), (0.9, 0.75), (0.999, 0.97)])
def test_many_cases_make_a_probability_the_share_that_was_right(p: float, share: float) -> None:
    """The prior is nothing beside 10,000 cases; T is told to a hundredth of its logarithm."""
    rehearsal = said(p, round(10000 * share), round(10000 * (1 - share)))
    assert cooled(p, rehearsal.temperature) == pytest.approx(share, abs=0.005)
    assert cooled(0.5, rehearsal.temperature) == pytest.approx(0.5)


def test_nothing_becomes_surer_than_it_was_said() -> None:
    for rehearsal in (said(0.7, 1000, 0), Rehearsal(())):
        assert rehearsal.temperature == 1
        assert cooled(0.7, rehearsal.temperature) == pytest.approx(0.7)
    assert cooled(1.0, said(0.9, 1, 0).temperature) == pytest.approx(0.999)


def test_few_cases_change_little() -> None:
    """One wrong of two that were called with 0.9: half of the truth would be 0.5."""
    assert 0.6 < cooled(0.9, said(0.9, 1, 1).temperature) < 0.85


def test_cases_with_and_without_an_effect_are_counted_apart() -> None:
    r = said(0.9, 3, 2)
    assert (r.counts(True), r.counts(False)) == ((3, 3), (0, 2))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("rehearsal")


@pytest.fixture(scope="module")
def found(folder: Path, small_bench) -> list[Condition]:
    return small_bench(folder, {0: "Camera0", 2: "Camera0", 6: "Camera0"}, 16)


@pytest.fixture(scope="module")
def fitted(found: list[Condition]) -> Fit:
    """The captures are the scene as it is written."""
    as_written = [replace(c, mean=c.simulated().dn) for c in found]
    search = Search(as_written, tuple(_terms(as_written, Tolerances(), None)), None, lambda what, share: None)
    stand = search.stand(np.zeros(search.q), {}, "evidence", {})
    model = Model(search.terms, np.zeros(search.q), np.zeros(search.q))
    evidence = Evidence(total_of(stand.parts), search.terms)
    zero = np.zeros(search.q)
    return Fit(
        model,
        model,
        stand.hypotheses,
        {},
        search.terms,
        evidence,
        stand.evidence,
        stand.parts,
        zero,
        zero,
        zero[None][:0],
        {},
        lambda h: model,
    )


def test_an_effect_has_the_severity_that_was_wanted(found, fitted) -> None:
    """rms of what it changes over the signal's, in the metric that evidence has; errors lie within their spikes."""
    index = fitted.evidence.members[VIGNETTING]
    rng = np.random.default_rng(1)
    models = [_drawn(found, fitted, None, VIGNETTING, s, rng) for s in (0.0, 0.02)]
    rng = np.random.default_rng(1)
    still = _drawn(found, fitted, None, VIGNETTING, 0.0, rng)
    assert models[0].theta == pytest.approx(still.theta)
    strong = _drawn(found, fitted, None, VIGNETTING, 0.5, rng).theta[index]
    G = fitted.evidence.e.G[np.ix_(index, index)] / fitted.evidence.e.signal
    assert np.sqrt(strong @ G @ strong) == pytest.approx(0.5, rel=0.1)  # and the tolerance's part
    seen = fitted.evidence.seen & ~np.isfinite(fitted.evidence.low)
    z = models[1].theta[seen] / fitted.evidence.spike[seen]
    assert np.std(z[np.abs(z) < 10]) == pytest.approx(1, abs=0.1)
    assert models[1].at[index] == pytest.approx(models[1].theta[index])  # where it is bent, it is drawn bent


def test_captures_differ_from_the_model_by_the_sensors_noise(found, fitted) -> None:
    model = _drawn(found, fitted, None, None, 0.0, np.random.default_rng(2))
    captured = _captured(found, model, np.random.default_rng(3))
    left = []
    for c, old in zip(captured, found, strict=True):
        e = model.state(old).simulation
        ok = old.usable(e)
        variance = (e.temporal / len(c.captures) + e.fixed)[ok]
        left.append(((c.mean - model.simulated(old))[ok]) ** 2 / variance)
    assert np.mean(np.concatenate(left)) == pytest.approx(1, abs=0.02)  # of some 70,000 values


@pytest.mark.slow
def test_strong_cases_of_ones_own_are_answered(found, fitted, monkeypatch) -> None:
    """Of an effect and of nothing, through the whole fit."""
    import analysis.gap.judgement.rehearsing as rehearsing

    monkeypatch.setattr(rehearsing, "_cause", lambda fitted, rng: VIGNETTING)
    monkeypatch.setattr(rehearsing, "WITHOUT", 2)
    monkeypatch.setattr(rehearsing, "WEAKEST", 0.039)
    told: list[float] = []
    r = rehearse(
        found, Tolerances(), fitted, None, 2, np.random.default_rng(4), lambda what, x: told.append(x)
    )
    assert [c.truth for c in r.cases] == ["vignetting", ""]
    assert all(c.exact for c in r.cases)
    assert r.cases[0].said["vignetting"] > 0.9
    assert told[-1] == 1
