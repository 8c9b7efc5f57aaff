"""Which causes there are and how large: the evidence's best hypothesis, from more than one start.

Starts compare by their whole log Z, each where it stands (analysis.gap.search.search).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.gap.compared.conditions import Condition
from analysis.gap.evidence.belief import believed, gained, in_its_place, posterior
from analysis.gap.evidence.caution import Caution, cautions, left_over, without_each
from analysis.gap.evidence.likelihood import TAU, Evidence, Hypothesis
from analysis.gap.evidence.scales import shares, told_apart
from analysis.gap.evidence.stand import Stand
from analysis.gap.evidence.turned import alike
from analysis.gap.finding import PRESENT
from analysis.gap.light.knots import Knots
from analysis.gap.parallel import each, one_thread
from analysis.gap.search.anew import Anew, wanted
from analysis.gap.search.model import Model
from analysis.gap.search.numbers import numbers
from analysis.gap.search.rivals import beside_rivals
from analysis.gap.search.search import Passed, Search, Told
from analysis.gap.terms.aperture import without_apertures
from analysis.gap.terms.base import Cause, Field, Term
from analysis.gap.terms.camera import camera_terms
from analysis.gap.terms.color_shading import color_shading
from analysis.gap.terms.fall_off import without_rises
from analysis.gap.terms.generic import generic_terms
from analysis.gap.terms.geometry import geometry_terms, moved_objects
from analysis.gap.terms.knot import knot_terms
from analysis.gap.terms.light import light_terms, shaded
from analysis.gap.terms.lines import left_of_lines
from analysis.gap.terms.material import material_terms, patterns
from analysis.gap.terms.normal_equations import NormalEquations, total_of
from analysis.gap.terms.saturation import saturation_terms
from analysis.gap.terms.sensitivities import Sensitivities
from analysis.gap.terms.severity import severities
from interchange.captures import Tolerances

Redraw = Callable[[Sequence[Condition], Anew], list[Condition]]

STARTS = 4
CLEAR = 3.0  # times what is hoped for without a move: a move that gains more ends the search for others
NEARLY = 0.9  # of what is hoped for: a single cause that gains so much is followed first, and is all if it stays alone
KEPT = (
    0.5  # of what is hoped for, that it must gain where it stands: else another that moves may be behind it
)
HIDES = 2.0  # times as far off as declared that cameras look, from which on something may have moved instead
WORTH = 10.0  # gain of log Z over no cause at all, from which more than one start is tried


@dataclass(frozen=True, eq=False)
class Fit:
    """``before`` has calibration's errors taken out alone; ``after`` the causes as well. ``hypotheses``: best first."""

    before: Model
    after: Model
    hypotheses: tuple[Hypothesis, ...]
    probability: dict[Cause, float]
    terms: tuple[Term, ...]
    evidence: Evidence
    weighed: Evidence  # the same with the doubt of the causes' formulas
    parts: tuple[NormalEquations, ...]  # of each condition, at ``after``
    doubted: np.ndarray  # (q,): standard deviation of every term where the causes' formulas are in doubt
    declared: np.ndarray  # (q,): standard deviation of every term as tolerances declare it
    left_out: np.ndarray  # (n, q): theta without one condition after the other, no row where few tell
    cautions: dict[Cause, Caution]  # of the causes
    stood: Callable[[Hypothesis], Model]  # another hypothesis, where it stands
    left_over: tuple[float, float] = (
        0.0,
        0.0,
    )  # share beyond what was expected, probability that it has a cause
    anew: Anew = field(default_factory=Anew)  # what captures were rendered anew with
    refuted: tuple[Cause, ...] = ()  # by captures that were held out
    tolerated: float = 0.0  # χ of those where calibration is as they show it too; 0 where nobody asked
    factors: dict[str, float] = field(default_factory=dict)  # of tolerances that are not as declared
    severity: dict[Cause, np.ndarray] = field(
        default_factory=dict
    )  # metric of how strong each cause with a name is (analysis.gap.terms.severity)
    in_place: dict[Cause, float] = field(default_factory=dict)  # of the best's causes (``in_its_place``)
    alike: dict[Cause, tuple[Cause, float]] = field(
        default_factory=dict
    )  # what captures do not tell from the best's causes, and how many times as probable it is (evidence.turned)

    @property
    def best(self) -> Hypothesis:
        return self.hypotheses[0]

    @property
    def gain(self) -> float:
        """Of log Z, over calibration's errors alone."""
        return self.best.score - max((h.score for h in self.hypotheses if not h.causes), default=-np.inf)

    @property
    def theta(self) -> np.ndarray:
        return self.after.theta

    @property
    def probability_of_none(self) -> float:
        """That calibration's errors explain everything, some of them larger than declared."""
        return sum(self._none)

    @property
    def _none(self) -> tuple[float, float]:
        """The probability that calibration's errors as declared explain everything; that larger ones, in place of the
        best's causes, do."""
        score = np.array([h.score for h in self.hypotheses])
        p = np.exp(score - score.max())
        declared = float(p[[not h.causes for h in self.hypotheses]].sum() / p.sum())
        if not self.best.causes:
            return declared, 0.0
        larger = np.prod([self.cautions[c].tail if c in self.cautions else 0.0 for c in self.best.causes])
        return declared, (1 - declared) * float(larger)

    @property
    def larger_errors(self) -> tuple[Cause, ...]:
        """Of the best's causes those that are errors of the calibration, larger than declared, if nothing is called:
        where that there is no effect is more probable than not, all, or none, as that is likelier; each that is more
        probably that than an effect, where it is not."""
        declared, larger = self._none
        if declared + larger >= PRESENT:
            return self.best.causes if larger > declared else ()
        return tuple(c for c in self.best.causes if c in self.cautions and self.cautions[c].tail >= PRESENT)


@one_thread()
def fit(
    conditions: Sequence[Condition],
    tolerances: Tolerances,
    told: Told = lambda what, share: None,
    knots: Knots | None = None,
    redraw: Redraw | None = None,
) -> Fit:
    """``conditions``: those that may be fitted to, rendered. ``knots`` renders what effects of the scene change;
    without it those that need that are not tried. ``redraw`` renders conditions anew where something stands far from
    where the scene has it, with the light that goes by way of other surfaces, and with what lies beyond the frame."""
    both = (tolerances, told_apart(tolerances))
    shared = patterns(conditions)
    terms, apart = each(lambda t: tuple(_terms(conditions, t, knots, shared)), both)
    parts = shares(terms, apart)
    search = Search(conditions, terms, knots, told, parts)
    told("registration", 0.0)
    first = search.scaled(search.stand(search.registered(), {}, "evidence", {}))
    if search.widths.factors.get("registration_px", 1.0) > 1:
        first = search.scaled(search.stand(search.registered(), {}, "evidence", first.kept))
    first = search.averaged(first)
    chosen = behind_registration(search, first)
    if chosen is None:
        stands = _followed(search, first, redraw is not None) if first.best.causes else []
        chosen = max(stands or [first], key=lambda s: s.best.score)
    if _gain(chosen) > max(CLEAR * _gain(first), WORTH) and _gain(first) > 0:
        chosen = beside_rivals(search, chosen)  # chosen where edges were too far off to tell
    anew, kept = wanted(conditions, terms, chosen.at, search.far(chosen)), first.kept
    if redraw is not None and anew.is_there:
        # before tolerances look larger by what light does between surfaces
        search = search.elsewhere(redraw(conditions, anew))
        chosen, kept = search.gone_on(search.stand(chosen.at, {}, "evidence", {}), "fit anew"), {}
    if chosen is not first:
        chosen = no_surer_than_at_home(first, _rescaled(search, kept, chosen))
    return replace(_fit(search, chosen), anew=anew, factors=search.widths.factors)


def _gain(stand: Stand) -> float:
    """Of log Z, over calibration's errors alone."""
    return stand.best.score - next(h for h in stand.hypotheses if not h.causes).score


def no_surer_than_at_home(first: Stand, stand: Stand) -> Stand:
    """Where the best hypothesis gains little over none, it stands so near that both linearisations hold: the one at
    home, ``first``, and the one where it was followed to, which was chosen for it. It is as sure as the less sure of
    both makes it, so that what is followed because it gains a little is not surer for having been followed."""
    gain = _gain(stand)
    if not 0 < gain < WORTH or not set(stand.best.causes) <= set(first.evidence.members):
        return stand
    there = {h.causes: h.score for h in first.hypotheses}
    own = first.evidence.best(stand.best.causes, {})
    more = gain - max(there.get(own.causes, own.score) - there[()], 0.0)  # that none is better by at home
    if more <= 0:
        return stand
    raised = [h if h.causes else replace(h, log_Z=h.log_Z + more * TAU) for h in stand.hypotheses]
    return replace(stand, hypotheses=tuple(sorted(raised, key=lambda h: -h.score)))


def _rescaled(search: Search, kept: dict[str, Sensitivities], chosen: Stand) -> Stand:
    """The stand with tolerances as large as they look from there, followed where that makes other causes of it.
    ``kept``: sensitivities where nothing stands elsewhere, as far as they are known."""
    stand = search.scaled(chosen).with_no_more_than(chosen.best.causes)
    if stand.best.causes and stand.best.causes != chosen.best.causes:
        stand = search.gone_on(stand, "fit again")
    stand = search.averaged(stand).with_no_more_than(stand.best.causes)
    if stand.best.causes or not stand.evidence.in_force:
        return stand
    return search.averaged(search.stand(search.registered(), {}, "evidence", kept))


def behind_registration(search: Search, first: Stand) -> Stand | None:
    """Something that moved where the cameras look further off than declared instead, if it explains clearly more."""
    if search.widths.factors.get("registration_px", 1.0) < HIDES:
        return None
    for move in search.moves(first):
        stand = search.followed(first, move, "what moved", [], 1)
        stand = search.gone_on(stand, "what moved")
        if (
            stand.is_its_own
            and set(move.hypothesis.causes) <= set(stand.best.causes)
            and _clear(first, stand)
        ):
            return stand
    return None


def _clear(first: Stand, stand: Stand) -> bool:
    """Whether a stand gains clearly more over none than was hoped for at the first."""
    none = next(h for h in first.hypotheses if not h.causes)
    return stand.best.score - none.score > max(CLEAR * _gain(first), WORTH)


def _followed(search: Search, first: Stand, may_redraw: bool) -> list[Stand]:
    """Where the starts of the first stand lead to, until one of them is clear, or two come to the same."""
    none = next(h for h in first.hypotheses if not h.causes)
    hoped = _gain(first)

    passed: Passed = {}
    stands: list[Stand] = []
    astray: list[Stand] = []

    def kept(stand: Stand) -> None:
        (stands if stand.is_its_own else astray).append(stand)

    alone, by_itself = search.alone(first), None
    if alone is not None and alone.hypothesis.score - none.score > NEARLY * hoped > 0:
        by_itself = search.followed(first, alone, "fit 1", passed=passed)
        if by_itself.best.causes == alone.hypothesis.causes and _gain(by_itself) > KEPT * hoped:
            return [by_itself]
    moves = search.moves(first) if hoped > WORTH and search.may_move(first.best) else []
    starts = [*moves, *search.starts(first)]
    for k, start in enumerate(starts[: STARTS - len(moves) // 2 if hoped > WORTH else 1]):
        causes, what = start.hypothesis.causes, f"fit {k + 1}"
        if (
            start not in moves and by_itself is not None
        ):  # where a move ends, which begins elsewhere, it says nothing
            kept(by_itself)
            by_itself = None
        if any(set(causes) == set(s.best.causes) for s in stands):
            continue  # another start came here
        if start not in moves:
            if frozenset(causes) in passed:
                continue  # and this one came by, and went on
            before = set(passed)
            stand = search.followed(first, start, what, stands, passed=passed)
            if not stand.is_its_own and stands and frozenset(stand.best.causes) in before:
                return stands  # from elsewhere it comes to where another was
        else:  # where it is all, or nearly, other starts are of a registration that hides it
            stand = search.followed(first, start, what, stands, 1)
            both = search.beside(first, start, stand)
            if both is not None:
                two = search.followed(first, both, f"{what}, two things", stands, 1)
                may = two.is_its_own or not stand.is_its_own  # else it is a way on, as that is
                stand = two if may and two.best.score > stand.best.score else stand
            if _clear(first, stand) and may_redraw and search.far(stand):
                return [*stands, stand]  # the renderer goes on from there
            stand = search.gone_on(stand, what, stands)
            single = len(stand.best.causes) == 1 and _clear(first, stand)
            if stand.is_its_own and (stand.best.causes == causes or single):
                return [*stands, stand]
        if stand.is_its_own and any(s.best.causes == stand.best.causes for s in stands):
            return [*stands, stand]
        kept(stand)
    return stands or astray


def _fit(search: Search, stand: Stand) -> Fit:
    """Causes as the evidence weighs them, forms in doubt; numbers as the formulas alone give them."""
    terms, q = search.terms, search.q
    parts = tuple(p.of(np.arange(q)) for p in stand.parts)
    evidence = Evidence(total_of(parts), terms, spikes=stand.evidence.spike[:q])
    best = stand.best
    after = before = numbers(search, stand, best)
    theta = after.theta
    cause = np.zeros(q, bool)
    for c in best.causes:
        cause[evidence.members[c]] = True
    if best.causes:
        still = np.where([t.kind == "flow" for t in terms] & ~cause, after.at, 0.0)
        before = replace(after, theta=np.where(cause, 0.0, theta), at=still, beside=after)
    gains = gained(stand.evidence, best)
    probability = believed(posterior(stand.hypotheses), best.causes, evidence, theta, gains)
    probability = without_apertures(probability, terms, np.where(cause, theta, 0.0))
    probability = without_rises(
        probability, terms, np.where(cause, theta, 0.0), lambda index: evidence.covariance(best, index)[index]
    )
    left_out = without_each(evidence, best, parts)
    declared = search.widths.declared_at(stand.evidence.spike)
    careful = cautions(stand.evidence, declared, best, evidence, parts, left_out)
    probability |= {c: caution.of(probability.get(c, 0.0)) for c, caution in careful.items()}
    same = alike(stand.evidence, best, stand.evidence.theta(best))
    probability |= {c: probability[c] / (1 + times) for c, (_, times) in same.items()}
    doubted = stand.evidence.sigma(best)[:q]
    named = {c: index for c, index in evidence.members.items() if not terms[index[0]].generic}
    return Fit(
        before,
        after,
        stand.hypotheses,
        probability,
        tuple(terms),
        evidence,
        stand.evidence,
        parts,
        doubted,
        declared[:q],
        left_out.theta,
        careful,
        _where_it_stands(search, stand),
        left_over(stand.evidence, best),
        severity=severities(named, stand.kept.values()),
        in_place={
            c: in_its_place(stand.hypotheses, best.causes, c, set(named))
            * (1 + same[c][1] if c in same else 1)
            for c in best.causes
        },
        alike=same,
    )


def _where_it_stands(search: Search, stand: Stand) -> Callable[[Hypothesis], Model]:
    """``numbers`` of a hypothesis, one model however often it is asked for: a model keeps what it has simulated."""
    kept: dict[tuple[tuple[Cause, ...], tuple[float, ...]], Model] = {}

    def model(h: Hypothesis) -> Model:
        key = h.causes, h.slabs
        if key not in kept:
            kept[key] = numbers(search, stand, h)
        return kept[key]

    return model


def _terms(
    conditions: Sequence[Condition],
    tolerances: Tolerances,
    knots: Knots | None,
    shared: dict[str, list[Field]] | None = None,
) -> list[Term]:
    return [
        *geometry_terms(conditions, tolerances),
        *light_terms(conditions, tolerances),
        *material_terms(conditions, tolerances, shared),
        *(
            knot_terms(conditions, tolerances, knots)
            if knots is not None
            else [*moved_objects(conditions, tolerances), *shaded(conditions, tolerances)]
        ),
        *camera_terms(conditions, tolerances),
        *saturation_terms(conditions, tolerances),
        *color_shading(conditions, tolerances),
        *generic_terms(conditions, tolerances),
        *left_of_lines(conditions),
    ]
