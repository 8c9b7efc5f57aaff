"""The blind benchmark's seals and scores."""

import json
import math
from pathlib import Path

import pytest

from benchmarks.blind import results, score, sealing
from benchmarks.blind.page import table
from benchmarks.blind.results import Answer, Results, answer
from benchmarks.blind.rules import (
    calibration,
    calibration_by_chance,
    chi2_of_nulls,
    closed_beyond,
    confidently_wrong,
    covered,
    interval,
    right,
)


def test_labels_are_sealed_and_opened_once(tmp_path: Path):
    labels = {"seed": 1, "cases": [{"case": "a"}]}
    vault, seals = tmp_path / "vault/labels.json", tmp_path / "seals.json"
    sha = sealing.seal(labels, vault, seals, "first")
    assert json.loads(seals.read_text())["first"]["sha256"] == sha
    assert sealing.seal(labels, vault, seals, "first") == sha
    with pytest.raises(sealing.SealError):
        sealing.seal({"seed": 2, "cases": []}, vault, seals, "first")
    assert sealing.opened(vault, seals, "first") == (labels, 0)
    with pytest.raises(sealing.SealError):
        sealing.opened(vault, seals, "first")
    assert sealing.opened(vault, seals, "first", again=True) == (labels, 1)
    vault.write_bytes(vault.read_bytes() + b" ")
    with pytest.raises(sealing.SealError):
        sealing.opened(vault, seals, "first", again=True)


def _label(case: str, stratum: str, *names: str, wanted: float = 0.01) -> dict:
    effects = [
        {
            "name": n,
            "form": "f",
            "place": "",
            "wanted": wanted,
            "severity": wanted,
            "parameters": {"scale": 1.01},
        }
        for n in names
    ]
    return {"case": case, "stratum": stratum, "scene": "rich", "effects": effects, "severity": wanted}


def test_right_is_exact():
    one = _label("a", "single", "vignetting")
    assert right(one, Answer({"vignetting": 0.9}))
    assert not right(one, Answer({"vignetting": 0.9, "albedo": 0.8}))
    assert not right(one, Answer({"vignetting": 0.9, "albedo": 0.3}))  # what is listed is said
    assert right(one, Answer({"vignetting": 0.4}))  # the likeliest of several that look alike
    assert not right(one, Answer({"vignetting": 0.9}, unknown=True))
    assert not right(one, Answer({}, failed=True))
    bound = _label("b", "single", "white_balance")
    assert not right(bound, Answer({"light_spectrum": 0.9}))
    assert right(bound, Answer({"light_spectrum": 0.9}), tied=True)
    ghost = _label("c", "outside", "ghost")
    assert right(ghost, Answer({}, unknown=True))
    assert not right(ghost, Answer({"vignetting": 0.8}, unknown=True))
    assert not right(ghost, Answer({}))
    assert right(_label("d", "outside", "occluder"), Answer({"shadow": 0.9}))
    assert right(_label("e", "null"), Answer({}))
    assert confidently_wrong(one, Answer({"albedo": 0.95, "gloss": 0.85})) == ["albedo"]
    assert confidently_wrong(bound, Answer({"light_spectrum": 0.95})) == []


def test_intervals_are_those_of_clopper_and_pearson():
    assert interval(0, 40) == pytest.approx((0.0, 0.0881), abs=1e-4)  # 1 - 0.025^(1/40)
    assert interval(2, 120)[1] == pytest.approx(0.0589, abs=1e-4)
    low, high = interval(9, 10)
    assert (low, high) == pytest.approx((0.5550, 0.9975), abs=1e-4)


def test_calibration_error_of_what_is_right_as_often_as_it_says():
    sure = [(p, k % 10 < 10 * p) for p in (0.6, 0.9) for k in range(600)]
    # bins of 80 answers that are right with p: 0.8 sqrt(p (1 - p) / 80) at most, half of it as they are spread evenly
    assert calibration(sure[::-1]) < 0.05
    assert calibration([(0.95, False)] * 20) == pytest.approx(0.95)


def test_a_calibration_error_by_chance():
    """Of one bin of n calls at p: E |hits / n - p|, sqrt(2 p (1 - p) / (pi n)) for many."""
    fifteen, many = ([(0.7, True)] * (15 * n) for n in (4, 400))
    (few_mean, few_high), (mean, high) = map(calibration_by_chance, (fifteen, many))
    assert mean == pytest.approx(math.sqrt(2 * 0.7 * 0.3 / (math.pi * 400)), rel=0.05)
    assert high == pytest.approx(mean, rel=0.5)
    assert few_mean > 8 * mean
    assert few_high > few_mean


@pytest.mark.parametrize(
    ("found", "told"),
    [
        ({"x": (1.0, 0.5), "y": (3.0, 0.1)}, (1, 2)),  # of all lamps, once
        ({"LED0 x": (1.0, 0.5), "LED1 x": (1.5, 0.1)}, (1, 2)),  # of each by itself
        ({"scale": (1.0, 0.5)}, (0, 0)),
    ],
)
def test_what_lamps_have_alike_is_one_number(found: dict, told: tuple[int, int]) -> None:
    label = _label("a", "single", "light_position")
    label["effects"][0]["parameters"] = {"LED0 x": 1.2, "LED1 x": 1.2, "LED0 y": 2.0, "LED1 y": 2.0}
    hits, count, errors = covered([label], {"a": Answer({}, parameters={"light_position": found})})
    assert (hits, count) == told
    assert len(errors) == count


def test_lamps_that_differ_are_no_one_number() -> None:
    label = _label("a", "single", "light_position")
    label["effects"][0]["parameters"] = {"LED0 x": 1.2, "LED1 x": -1.2}
    said = Answer({}, parameters={"light_position": {"x": (1.2, 0.1)}})
    assert covered([label], {"a": said})[1] == 0


def test_a_page_lists_every_miss(tmp_path: Path):
    labels = [
        _label("n1", "null"), _label("n2", "null"), _label("s1", "single", "exposure"),
        _label("s2", "single", "defocus", wanted=0.02), _label("o1", "outside", "ghost"),
        _label("gone", "single", "exposure"),
    ]  # fmt: skip
    record = {
        "verdict": "effects",
        "effects": [
            {"name": "exposure", "probability": 0.97, "parameters": {"scale": {"value": 1.012, "sigma": 0.002}}}
        ],
        "gap": {"explained": 0.98, "before": 2.0, "after": 1.05}, "seconds": 30.0,
        "smallest": {
            "exposure": {"easiest": 0.002, "hardest": 0.005}, "defocus": {"easiest": 0.01, "hardest": None}
        },
    }  # fmt: skip
    none = {**record, "verdict": "none", "effects": []}
    unknown = {**none, "verdict": "unknown"}
    for case, what in (("n1", none), ("n2", record), ("s1", record), ("s2", record), ("o1", unknown)):
        (tmp_path / case).mkdir()
        (tmp_path / case / "diagnosis.json").write_text(json.dumps(what))
    answers = {x["case"]: answer(tmp_path / x["case"] / "diagnosis.json") for x in labels}
    page = table(labels, answers)
    assert "| nulls: false alarm, any effect or unknown | 1/2 | 50.0 % | 1.3–98.7 % |" in page
    assert "| one effect, exact, 1 % | 1/2 | 50.0 %" in page
    assert "| one effect, of those that it says it finds whatever they are about, exact | 1/1 |" in page
    assert "| one effect, of those that it says it finds where they are easy, exact | 0/1 |" in page
    assert "that it says it does not find, exact" not in page
    assert "| confident (p > 0.9) and wrong, all cases | 2/6 |" in page
    assert "| parameters inside their 95 % interval | 1/1, 100.0 %" in page
    missed = page.split("Every case")[1]
    assert all(f"| {case} |" in missed for case in ("n2", "s2", "gone"))
    assert not any(f"| {case} |" in missed for case in ("n1", "s1", "o1"))


def test_what_is_closed_is_told_of_what_nulls_do_not_have_too():
    """χ² of 1.2 is left of the scene's nulls: 1.8 to 1.26 is 0.9 of what can be closed; 1.22 can hardly be."""
    answers = {
        "n": Answer({}, chi=(1.21**0.5, 1.2**0.5)),
        "m": Answer({}, chi=(1.21**0.5, 1.2**0.5)),
        "s": Answer({}, chi=(1.8**0.5, 1.26**0.5)),
        "t": Answer({}, chi=(1.22**0.5, 1.0)),
    }
    nulls = [{**_label(c, "null"), "scene": "rich"} for c in ("n", "m")]
    floor = chi2_of_nulls(nulls, answers)
    assert floor == {"rich": pytest.approx(1.2)}
    assert closed_beyond([("rich", answers["s"]), ("rich", answers["t"])], floor) == [pytest.approx(0.9)]
    assert closed_beyond([("board", answers["s"])], floor) == []


def _kept(name: str, program: str, *cases: str) -> Results:
    said = Answer(
        {"vignetting": 0.912345678},
        explained=0.97,
        parameters={"vignetting": {"scale": (1.0123456789, 0.01)}},
        chi=(2.5, 1.05),
        seconds=31.0,
        smallest={
            "vignetting": {"easiest": 0.001, "hardest": None},
            "gloss": {"easiest": 0.1, "hardest": 0.2},
        },
    )
    none = Answer({}, failed=True)
    labels = [_label(c, "single", "vignetting") for c in cases]
    return Results(
        name, "ab" * 32, program, 1, tuple(zip(labels, [said, *[none] * len(cases)], strict=False))
    )


def test_what_a_set_said_is_kept_without_its_seed(tmp_path: Path):
    kept = _kept("first", "1234567", "a", "b")
    for label, _ in kept.cases:
        label["seed"] = 5
    file = results.write(kept, tmp_path)
    assert '"seed"' not in file.read_text()
    again = results.read(file)
    assert (again.name, again.sha256, again.program, again.left_out) == ("first", "ab" * 32, "1234567", 1)
    (label, said), (_, none) = again.cases
    assert label["case"] == "a"
    assert none == Answer({}, failed=True, parameters={}, smallest={})
    assert said.said == {"vignetting": 0.91235}
    assert said.chi == (2.5, 1.05)
    assert said.parameters == {"vignetting": {"scale": (1.0123, 0.01)}}
    assert said.smallest == {"vignetting": {"easiest": 0.001, "hardest": None}}  # of its own effects alone


def test_nothing_closed_is_kept_as_nothing(tmp_path: Path):
    """And no answer as none: it counts in the median of what is closed."""
    none = Answer({}, explained=0.0, chi=(1.2, 1.2), seconds=0.0, parameters={}, smallest={})
    failed = Answer({}, failed=True)
    labels = [_label("a", "single", "vignetting"), _label("b", "single", "vignetting")]
    file = results.write(
        Results("first", "ab", "1234567", 0, tuple(zip(labels, (none, failed), strict=True))), tmp_path
    )
    (_, a), (_, b) = results.read(file).cases
    assert a == none
    assert b.failed
    assert b.explained is None


def test_sets_add_up_that_one_program_answered():
    one, two = _kept("first", "1234567", "a", "b"), _kept("second", "1234567", "c")
    labels, answers = results.together([one, two])
    assert [x["case"] for x in labels] == ["a", "b", "c"]
    assert set(answers) == {"a", "b", "c"}
    assert "one effect, exact, 1 % | 2/3" in table(labels, answers)
    other = _kept("third", "89abcde", "d")
    with pytest.raises(sealing.SealError, match="89abcde"):
        results.together([one, other])
    assert len(results.together([one, other], may_differ=True)[0]) == 3
    with pytest.raises(sealing.SealError, match="two of the sets"):
        results.together([one, _kept("fourth", "1234567", "b")])


def test_a_table_says_what_was_claimed_of_each_severity():
    told = {"vignetting": {"easiest": 0.004, "hardest": 0.015}, "gloss": {"easiest": 0.02, "hardest": None}}
    labels = [
        _label("a", "single", "vignetting", wanted=0.02),
        _label("b", "single", "vignetting", wanted=0.01),
        _label("c", "single", "gloss", wanted=0.01),
        _label("d", "single", "defocus", wanted=0.01),
        _label("e", "pair", "vignetting", "gloss", wanted=0.02),
        _label("f", "pair", "vignetting", "gloss", wanted=0.015),
        _label("g", "triple", "vignetting", "gloss", "defocus", wanted=0.02),
    ]
    right = {"a": {"vignetting": 0.9}, "b": {"vignetting": 0.9}, "c": {}, "d": {"defocus": 0.9}}
    right |= {c: {"vignetting": 0.9, "gloss": 0.9} for c in "efg"}
    page = table(labels, {c: Answer(said, smallest=told) for c, said in right.items()})
    assert "| 1 % | – | 1/1 | 0/1 | 1/1 |" in page
    assert "| 2 % | 1/1 | – | – | – |" in page
    assert "| 1.5 % | – | – | 1/1 | – |" in page  # of two the least
    assert "| 2 % | – | 1/1 | – | 0/1 |" in page
    assert "several effects, of those that it says it does not find, exact | 1/1" in page


def test_of_a_set_that_was_not_run_to_its_end_the_first_by_name_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    labels = {"seed": 7, "cases": [_label(c, "single", "vignetting") for c in ("c", "a", "d", "b")]}
    monkeypatch.setattr(score, "HERE", tmp_path)
    monkeypatch.setattr(results.write, "__defaults__", (tmp_path,))
    sealing.seal(labels, tmp_path / "vault.json", tmp_path / "seals.json", "set")
    runs = tmp_path / "runs"
    for case in ("a", "b", "d"):  # c was still running
        (runs / case).mkdir(parents=True)
        (runs / case / "failed.txt").write_text("")
    (runs / "program.txt").write_text("1234567\n")
    given = ["--sealed", "set", "--vault", str(tmp_path / "vault.json"), "--runs", str(runs), "--run-only"]
    monkeypatch.setattr("sys.argv", ["score.py", *given])
    score.main()
    said = capsys.readouterr().out
    assert "answered by commit 1234567: 2 cases, the first by their names" in said
    assert "the other 2 were not run" in said
    kept = results.read(tmp_path / "set.json")
    assert [label["case"] for label, _ in kept.cases] == ["a", "b"]
    assert kept.not_run == 2


def test_a_set_that_is_not_kept_is_one_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.setattr("sys.argv", ["score.py", "--kept", "1999-01-01a"])
    with pytest.raises(SystemExit, match="2"):
        score.main()
    said = capsys.readouterr().err
    assert "Nothing is kept of a set 1999-01-01a; kept are: 2026-11-24q" in said
    assert "Traceback" not in said


def test_structure_of_what_is_left_is_kept(tmp_path: Path):
    left = {"white": 0.01, "structure": {"2 px": 0.03}, "expected": 0.01}
    gap = {"explained": 0.0, "before": 1.1, "after": 1.1}
    record = {"verdict": "none", "effects": [], "gap": gap, "seconds": 1.0, "left": left}
    (tmp_path / "diagnosis.json").write_text(json.dumps(record))
    assert answer(tmp_path / "diagnosis.json").structure == pytest.approx(3.0)
