"""What the report says of rivals and of numbers."""

import math
from types import SimpleNamespace
from typing import Any

import pytest

from analysis.gap.finding import Estimate, Finding, names
from analysis.gap.judgement.advice import separating
from analysis.gap.judgement.findings import _targets
from analysis.gap.judgement.verify import Verification
from analysis.gap.measures.structure import Structure
from analysis.gap.processed.encoded import Encoding
from analysis.gap.processed.encoded import grounds as grounds_of_curves
from analysis.gap.report.page import _verification
from analysis.gap.report.words import (
    ALONE,
    beneath,
    evidence,
    grounds,
    interval,
    kinds,
    sentence,
    what_is_left,
    why,
    why_not,
)
from interchange.effects import MODELS


def _fit(instead: float) -> Any:
    of = SimpleNamespace
    best = of(score=10.0, causes=(("defocus", ""),))
    return of(best=best, hypotheses=[best, of(score=instead, causes=(("motion_blur", ""),))])


def test_a_parameter_is_not_told_again_what_it_is_of() -> None:
    """Beneath the heading of one camera its numbers alone; beneath that of two lamps each says whose it is."""
    one: Any = SimpleNamespace(cameras=("Camera1 at (330, -260, 440) mm",), targets=())
    two: Any = SimpleNamespace(cameras=(), targets=("LED0", "LED1"))
    every: Any = SimpleNamespace(cameras=(), targets=())
    assert beneath(one, "Camera1 at (330, -260, 440) mm tx") == "tx"
    assert beneath(two, "LED0 x") == "LED0 x"
    assert beneath(every, "a2") == "a2"


@pytest.mark.parametrize(
    ("instead", "said"),
    [
        (10 - math.log(400), "captures 400 times less likely"),
        (-math.inf, "no numbers that could stand in its place"),
    ],
)
def test_a_rival_is_told_by_how_much_less_likely_it_makes_the_captures(instead: float, said: str) -> None:
    finding: Any = SimpleNamespace(name="defocus", rivals=(), parameters={}, grounds="")
    words = why_not(_fit(instead), finding)
    assert said in next(w for w in words if w.startswith("motion blur"))
    assert "not tried" in next(w for w in words if w.startswith("light size"))


def test_what_was_not_fitted_is_told_by_what_it_was_judged_by() -> None:
    """A noise by repeats, beside which no fit tells how likely another is; captures that follow sRGB by all pixels."""
    number = Estimate(1.0, 0.1, "1")
    noise: Any = SimpleNamespace(
        name="sensor_noise", rivals=(), parameters={"K": number}, tied=(), grounds=""
    )
    said, others = grounds(_fit(0.0), noise)
    assert "on repeats" in said
    assert not any("less likely" in w for w in others)
    curve: Any = SimpleNamespace(
        name="response_curve",
        rivals=(),
        parameters={},
        tied=(),
        grounds=grounds_of_curves([Encoding("/eye", True)]),
    )
    said, others = grounds(_fit(0.0), curve)
    assert "follow sRGB's curve" in said
    assert others == [ALONE]
    own: Any = SimpleNamespace(name="defocus", rivals=(), parameters={"blur": number}, tied=(), grounds="")
    said, others = grounds(_fit(0.0), own)
    assert "evidence" in said
    assert any("less likely" in w for w in others)


def test_hot_pixels_are_told_as_what_they_are() -> None:
    """With a fixed pattern, or as one; "DN" begins no sentence of its own and stays what it is."""
    number = Estimate(1.0, 0.1, "1")
    hot = {"hot_share": number, "hot_current": number}
    pattern: Any = SimpleNamespace(
        name="fixed_pattern", rivals=(("exposure", 0.2),), parameters=hot, grounds=""
    )
    assert kinds(pattern) == ["hot_pixels"]
    words = why_not(_fit(0.0), pattern)
    assert not any(w.startswith(("hot pixels", "fixed pattern")) for w in words)
    assert ": all DN above black" in next(w for w in words if w.startswith("exposure"))
    pattern.parameters = {"prnu": number, **hot}
    assert kinds(pattern) == ["fixed_pattern", "hot_pixels"]
    assert why(kinds(pattern)).endswith(MODELS["hot_pixels"].identified_by)
    assert any(
        "DN differ by" in w
        for w in why_not(
            _fit(0.0),
            SimpleNamespace(name="exposure", rivals=(("response_curve", 0.2),), parameters={}, grounds=""),
        )
    )  # type: ignore[arg-type]


@pytest.mark.parametrize(("share", "said"), [(0.95, "closes 95 % of"), (-0.01, "closes nothing of")])
def test_a_gap_does_not_close_by_less_than_nothing(share: float, said: str) -> None:
    of = SimpleNamespace
    effect = Finding("saturation", 0.99, {}, (), None, 3.6, 3.6, share)
    d: Any = of(verdict="effects", gap=of(explained=share), effects=[effect])
    assert said in sentence(d)


@pytest.mark.parametrize(
    ("name", "said"), [("sensor_noise", "moves no mean"), ("shadow", "shows in no capture that nothing")]
)
def test_what_closes_nothing_is_told_by_why(name: str, said: str) -> None:
    """Noise closes nothing anywhere, a shadow where captures that were held out have another lamp."""
    of = SimpleNamespace
    effect = Finding(name, 0.9, {}, (), None, 1.03, 1.03, 0.0)
    d: Any = of(
        verdict="effects", gap=of(explained=0.0, after=1.03, noise_floor=1.0), effects=[effect], unknown=[]
    )
    assert said in sentence(d)


def test_the_evidence_of_a_tie_is_that_for_one_of_them() -> None:
    of = SimpleNamespace
    scores = {"exposure": 10.0, "albedo": 9.8, "black_level": 10 - math.log(400)}
    h = [of(score=x, causes=((name, ""),)) for name, x in scores.items()]
    fit: Any = of(best=h[0], hypotheses=h)
    for p in (0.45, 0.55):
        words = evidence(fit, Finding("exposure", p, {}, (("albedo", 0.4),), None, 2.0, 1.0, 0.5))
        assert "for it or for albedo" in words
        assert "400 times less likely" in words
    surer = Finding("exposure", 0.55, {}, (("albedo", 0.1),), None, 2.0, 1.0, 0.5)
    assert "1 times less likely" in evidence(fit, surer)  # which is no tie


def test_what_tells_two_apart_is_said_by_the_one_that_knows_of_the_other() -> None:
    assert (
        separating("exposure", "albedo") == separating("albedo", "exposure") == MODELS["albedo"].separated_by
    )
    assert separating("vignetting", "a family") == MODELS["vignetting"].separated_by
    assert separating("a family", "another") == "the same scene from a second pose and under a second lamp"


@pytest.mark.parametrize(
    ("probability", "rival", "said"),
    [
        (0.45, 0.4, "white balance (or albedo) and defocus"),
        (0.55, 0.4, "white balance (or albedo) and defocus"),
        (0.8, 0.1, "white balance and defocus"),
    ],
)
def test_what_is_the_likeliest_of_several_is_told_with_them(
    probability: float, rival: float, said: str
) -> None:
    rivals = (("albedo", rival), ("color_crosstalk", 0.05))
    both = [
        Finding(name, p, {}, others, None, 2.0, 1.0, 0.5)
        for name, p, others in (("white_balance", probability, rivals), ("defocus", 0.9, ()))
    ]
    assert names(both) == said


@pytest.mark.parametrize(
    ("effect", "name", "value", "said"),
    [
        ("veiling_glare", "g", 0.0, "0.00 to 0.20"),  # no light is scattered less than not at all
        ("veiling_glare", "g", 0.5, "0.30 to 0.70"),
        ("veiling_glare", "g", 0.9, "0.70 to 1.00"),
        ("vignetting", "a2", 0.0, "-0.20 to 0.20"),
        ("light_position", "lamp dx", 0.0, "-0.20 to 0.20"),
        ("fixed_pattern", "rms of the pattern", 0.5, "0.30 to 0.70"),
    ],
)
def test_an_interval_ends_where_a_parameter_does(effect: str, name: str, value: float, said: str) -> None:
    assert interval(effect, name, Estimate(value, 0.1, "1")) == said


@pytest.mark.parametrize(
    ("left", "said", "noise"),
    [
        (
            Structure(0.064, (0.004, 0.003, 0.002, 0.001), 0.005),
            ("6.4 % of", "0.3 % is shared"),
            True,
        ),
        (
            Structure(0.064, (0.2, 0.15, 0.1, 0.05), 0.005),
            ("6.4 % of", "15.0 % is shared"),
            False,
        ),
        (
            Structure(-0.001, (0.0, -0.001, 0.0, 0.0), 0.005),
            ("0.0 % of", "0.0 % is shared"),
            False,
        ),
    ],
)
def test_what_is_left_is_noise_or_is_not(left: Structure, said: tuple[str, str], noise: bool) -> None:
    found: Any = SimpleNamespace(left=left)
    words = what_is_left(found)
    assert all(w in words for w in said)
    assert ("no effect of light" in words) == noise


def test_what_an_effect_is_of_is_told_whole() -> None:
    """A camera where it stands has commas in its name; a pattern "in places" is its material's."""

    def of(cause: str, target: str) -> tuple[str, ...]:
        term = SimpleNamespace(cause=cause, target=target, kind="flow", camera="")
        return _targets(SimpleNamespace(terms=[term]), [(cause, target)])  # type: ignore[arg-type]

    assert of("camera_pose", "/World/Camera0 at (30, -390, 480) mm") == ("Camera0 at (30, -390, 480) mm",)
    assert of("texture", "/World/Materials/cloth, in places") == ("cloth",)
    assert of("texture", "/World/Materials/cloth, as other views show it") == ("cloth",)


def test_a_check_of_a_file_that_lacks_an_effect_says_so() -> None:
    """What was rendered anew is compared with what was predicted without it, so "holds" says nothing of that effect."""
    gap = SimpleNamespace(after=1.08, as_written=1.2)
    said: Any = SimpleNamespace(gap=gap, corrected_scene="s.usda", effects=(1,))
    said.verification = Verification(claimed=1.16, rendered=1.16, as_written=1.17, lacks=("camera_pose",))
    words = _verification(said)
    assert "has no camera pose" in words
    assert "1.080, which no rendering has tested" in words
    said.verification = Verification(claimed=1.08, rendered=1.08, as_written=1.1)
    assert "has no" not in _verification(said)
