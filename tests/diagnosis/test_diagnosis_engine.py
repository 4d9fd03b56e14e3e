"""The loop of a diagnosis on a problem made by hand: what is accepted, refused, taken back, and why it stops."""

from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import booleans, floats, just, one_of, tuples

from sindyjoint.diagnosis.loop import (
    Outcome,
    Progress,
    add_effects,
    led_by,
    other_members,
    try_effect,
    without_needless_delay,
)
from sindyjoint.diagnosis.policy import CAMPAIGN, STRUCTURE
from sindyjoint.diagnosis.ranking import EvidenceScale, rank
from sindyjoint.diagnosis.result import Gap
from sindyjoint.diagnosis.verdict import Gaps, Residual, discount, judge, share_beyond_noise
from sindyjoint.policy import described
from tests.diagnosis.handmade_problem import Effect, Made


def outcome(**changes):
    problem = Made(**changes)
    return try_effect(Progress(problem, problem.gap), frozenset(), 4, lambda words: None)


def added(**changes):
    problem = Made(**changes)
    return [s.effect for s in add_effects(Progress(problem, problem.gap), 4, lambda words: None).steps]


GOOD, NAN = Gap(0.5, 0.5, 0.5), float("nan")


@pytest.mark.parametrize(
    ("gain", "gap", "measured", "expected", "reason"),
    [
        (500.0, GOOD, False, Outcome.ACCEPT, "gap falls"),
        (1.0, GOOD, False, Outcome.STOP, "nothing is believed"),
        (500.0, Gap(3.0, 1.0, 1.0), False, Outcome.REFUSE, "left out"),
        (500.0, Gap(0.9, 2.0, 0.9), False, Outcome.REFUSE, "response worse"),
        # A response that is worse is the price of a moment that is much better.
        (500.0, Gap(0.5, 2.0, 0.5), False, Outcome.ACCEPT, "gap falls"),
        (500.0, Gap(0.99, 1.0, 0.99), False, Outcome.STOP, "wins nothing"),
        (500.0, Gap(0.99, 1.0, 0.99), True, Outcome.ACCEPT, "gap falls"),
        (500.0, Gap(NAN, NAN, NAN), False, Outcome.REFUSE, "fit fails"),
    ],
)
def test_a_round_says_what_it_came_to_and_why(gain, gap, measured, expected, reason):
    tried = outcome(candidates=(Effect("one", gain, gap),), noise_measured=measured)
    assert tried.outcome is expected and reason in tried.reason
    assert (tried.progress is not None) is (expected is Outcome.ACCEPT)


def test_an_impossible_candidate_leaves_its_place_to_one_that_is_as_good_or_ends_the_search():
    one, two = Effect("one", 600.0, GOOD), Effect("two", 599.0, GOOD)
    tried = outcome(candidates=(one, two), impossible=("one",))
    (step,) = tried.progress.steps
    assert step.effect == "two" and step.members == ("two",) and not step.rivals
    assert step.probability == pytest.approx(1.0, abs=1e-6)
    far = outcome(candidates=(one, replace(two, gain=400.0)), impossible=("one",))
    assert far.outcome is Outcome.STOP and "one pushes" in far.reason


def test_after_a_refusal_the_next_effect_has_its_turn():
    bad, good = Effect("bad", 600.0, Gap(3.0, 1.0, 1.0)), Effect("good", 500.0, GOOD)
    assert added(candidates=(bad, good)) == ["good"]
    worse = [Effect(f"bad{i}", 900.0 - i, Gap(3.0, 1.0, 1.0)) for i in range(3)]
    assert added(candidates=(*worse, good)) == []  # two are refused, the third ends it


def test_the_first_of_a_pair_goes_where_the_second_never_comes():
    first = Effect("first", 600.0, Gap(1.0, 1.0, 1.0))
    assert added(candidates=(first, Effect("second", 500.0, GOOD)), paired=("first",)) == ["first", "second"]
    vain = Effect("second", 500.0, Gap(0.99, 1.0, 1.0))
    assert added(candidates=(first, vain), paired=("first",)) == []


def test_no_search_ends_with_a_worse_response_than_it_began_with_beside_a_remainder():
    better = Effect("better", 600.0, Gap(0.8, 0.8, 0.8))
    worse = Effect("worse", 500.0, Gap(0.3, 1.5, 0.3))
    assert added(candidates=(better, worse)) == ["better"]
    assert added(candidates=(better, replace(worse, gap=Gap(0.3, 0.9, 0.3)))) == ["better", "worse"]
    # What explains the moment is reported, and that the response grows beside it; so is what noise explains.
    assert added(candidates=(better, worse), noise=0.25) == ["better", "worse"]


def test_an_effect_that_a_later_one_makes_needless_leaves_the_steps():
    early, late = Effect("early", 600.0, GOOD), Effect("late", 500.0, Gap(0.1, 0.1, 0.1))
    assert added(candidates=(early, late)) == ["early", "late"]
    assert added(candidates=(early, late), needless="early") == ["late"]


def test_nothing_is_searched_once_the_residual_is_surely_noise():
    one = Effect("one", 600.0, GOOD)
    assert added(candidates=(one, replace(one, name="two", gap=Gap(0.1, 0.1, 0.1))), is_noise=True) == ["one"]


def test_the_limits_of_the_policy_decide():
    one = Effect("one", 600.0, GOOD)
    assert added(candidates=(one,), policy=replace(CAMPAIGN, belief=1.1)) == []
    weak = replace(one, gap=Gap(0.99, 1.0, 1.0))
    assert added(candidates=(weak,)) == []
    assert added(candidates=(weak,), policy=replace(CAMPAIGN, least_gain=0.005), noise=1.0) == ["one"]


def test_what_remains_is_a_share_of_the_mean_square_or_of_the_rms():
    before, after = (5000.0, 1000.0), (2000.0, 1000.0)
    assert share_beyond_noise(before, after, CAMPAIGN) == pytest.approx(0.25)
    assert share_beyond_noise(before, after, STRUCTURE) == pytest.approx(0.5)
    assert share_beyond_noise(before, (1200.0, 1000.0), CAMPAIGN) == 0.0


def one_step(gap=GOOD):
    problem = Made((Effect("one", 600.0, gap),))
    return add_effects(Progress(problem, problem.gap), 4, lambda words: None).steps


def gaps(initial, final, floor, response=(1.0, 0.2, 0.1), unsure=(0.0, 0.0)):
    pairs = zip((initial, final, floor), response, strict=True)
    return Gaps(*(Gap(moment, response) for moment, response in pairs), Gap(*unsure))


FLOOR = 0.1
SMALL, LARGE = Residual(0.0, 0.15), Residual(0.9, 0.15)


@pytest.mark.parametrize(
    ("steps", "residual", "figures", "verdict"),
    [
        (False, SMALL, gaps(0.11, 0.11, FLOOR), "nothing_missing"),
        # 92 % of the moment at a floor of 4 % is no noise, whatever an estimate of what could be won says.
        (False, SMALL, gaps(0.92, 0.92, 0.04), "unknown"),
        (False, LARGE, gaps(0.11, 0.11, FLOOR), "unknown"),
        (False, SMALL, gaps(0.92, 0.92, NAN), "undecided"),
        (True, SMALL, gaps(0.5, 0.11, FLOOR), "named"),
        (True, SMALL, gaps(0.5, 0.3, FLOOR), "partly_named"),
        (True, SMALL, gaps(0.5, 0.48, FLOOR), "unknown"),
        (True, LARGE, gaps(0.5, 0.12, FLOOR), "partly_named"),
        (True, replace(SMALL, outside=0.7), gaps(0.5, 0.11, FLOOR), "unknown"),
        (True, SMALL, gaps(0.5, 0.11, NAN), "undecided"),
        (True, SMALL, gaps(0.5, 0.11, FLOOR, (1.0, NAN, 0.1)), "partly_named"),
        (True, SMALL, gaps(0.5, 0.11, FLOOR, (1.0, 1.2, 0.1)), "partly_named"),
        # The response stands far above its floor: something is missing, unless the numbers are so uncertain.
        (True, SMALL, gaps(0.5, 0.11, FLOOR, (1.0, 0.5, 0.1)), "partly_named"),
        (True, SMALL, gaps(0.5, 0.11, FLOOR, (1.0, 0.48, 0.1), (0.0, 0.2)), "named"),
        # The uncertainty counts as noise does elsewhere: two and a half of it are no noise.
        (True, SMALL, gaps(0.5, 0.11, FLOOR, (1.0, 0.9, 0.01), (0.0, 0.35)), "partly_named"),
        # A gap that grows is a gap that grows, however uncertain the numbers.
        (True, SMALL, gaps(0.5, 0.11, FLOOR, (0.05, 0.063, 0.006), (0.0, 0.078)), "partly_named"),
        (False, SMALL, gaps(0.11, 0.11, FLOOR, (0.5, 0.5, 0.1)), "unknown"),
        # A gap on runs left out that the uncertainty of the numbers explains.
        (True, SMALL, gaps(0.5, 0.3, FLOOR, unsure=(0.2, 0.0)), "named"),
        # Where no moment is measured, the response is all there is.
        (True, SMALL, gaps(NAN, NAN, NAN, (1.0, 0.12, 0.1)), "named"),
        (False, SMALL, gaps(NAN, NAN, NAN, (1.0, 1.0, 0.1)), "unknown"),
    ],
)
def test_no_verdict_is_denied_by_its_figures(steps, residual, figures, verdict):
    said, reason = judge(one_step() if steps else (), residual, figures, CAMPAIGN)
    assert said == verdict and reason


def test_a_name_says_where_only_the_uncertainty_of_its_numbers_explains_the_response():
    """A response ten floors off that the numbers' uncertainty explains, beside one within its noise."""
    steps, figures = one_step(), gaps(0.5, 0.11, FLOOR, (0.3, 0.063, 0.006), (0.0, 0.078))
    verdict, reason = judge(steps, SMALL, figures, CAMPAIGN)
    assert verdict == "named" and "misses by 6.3 %" in reason and "(7.8 %, noise floor 0.6 %)" in reason
    quiet = gaps(0.5, 0.11, FLOOR, (0.3, 0.007, 0.006), (0.0, 0.078))
    assert judge(steps, SMALL, quiet, CAMPAIGN)[1] == "found: one"


def test_where_a_displacement_is_counted_from_does_not_hide_a_response_that_grows():
    """4.86 % grows to 5.42 % as it is, and so it does where 30 % of an offset were put right before."""
    figures = gaps(0.5, 0.11, FLOOR, (0.3, 0.0542, 0.005), (0.0, 0.06))
    (step,) = one_step()
    zero = replace(step, effect="angle_offset", gap_after=Gap(0.4, 0.0486))
    assert judge((step,), SMALL, figures, CAMPAIGN)[0] == "named"
    verdict, reason = judge((zero, step), SMALL, figures, CAMPAIGN)
    assert verdict == "partly_named" and "grows from 4.86 % to 5.42 %" in reason
    # An offset alone is what the whole gap was.
    assert judge((zero,), SMALL, figures, CAMPAIGN)[0] == "named"


def test_names_beside_a_remainder_state_it_and_are_less_sure():
    steps, figures = one_step(), gaps(0.5, 0.3, FLOOR)
    verdict, reason = judge(steps, SMALL, figures, CAMPAIGN)
    assert "a gap of 30 % where the noise floor is 10 %" in reason and reason.startswith(
        "one explains a part"
    )
    (step,) = discount(steps, verdict, SMALL, figures, CAMPAIGN)
    assert step.probability == pytest.approx(0.5 * steps[0].probability)
    # A fiftieth of the gap's mean square remains: the name loses a quarter, and never less.
    (step,) = discount(steps, verdict, SMALL, gaps(0.8, 0.16, FLOOR), CAMPAIGN)
    assert step.probability == pytest.approx(0.75 * steps[0].probability)
    for word in ("unknown", "undecided"):
        (step,) = discount(steps, word, SMALL, figures, CAMPAIGN)
        assert dict(step.rivals)["unknown"] == 0.5
    assert discount(steps, "named", SMALL, figures, CAMPAIGN) == steps


FIGURE = floats(0.001, 2.0)
GAP = tuples(FIGURE, one_of(FIGURE, just(NAN)))


@given(
    GAP, GAP, GAP, tuples(floats(0.0, 0.5), floats(0.0, 0.5)), floats(0.0, 1.0), floats(0.0, 1.0), booleans()
)
def test_no_verdict_says_more_than_its_figures(initial, final, floor, unsure, share, outside, found):
    """Whatever the figures: *nothing missing*, *named* and *ambiguous* within the factors of what is no model's."""
    figures = Gaps(*(Gap(*each) for each in (initial, final, floor, unsure)))
    steps = one_step() if found else ()
    verdict, _ = judge(steps, residual := Residual(share, 0.15, outside), figures, CAMPAIGN)
    (moment, response), policy = final, CAMPAIGN
    least = [
        np.sqrt(floor[i] ** 2 + unsure[i] ** 2 + policy.processing_error**2) * (1 + 1e-12) for i in (0, 1)
    ]
    if verdict in ("nothing_missing", "named", "ambiguous"):
        assert moment <= policy.within_floors * least[0]
        noise = np.hypot(floor[1], policy.processing_error)
        widest = np.hypot(policy.response_floors * noise, policy.within_floors * unsure[1])
        assert not response > widest * (1 + 1e-12)
        assert not (response > initial[1] and response > policy.within_floors * noise * (1 + 1e-12))
        assert np.isfinite(response) or not found
    assert (verdict == "nothing_missing") <= (not found)
    named = discount(steps, verdict, residual, figures, policy)
    if verdict not in ("named", "ambiguous"):
        assert all(step.probability <= 0.75 for step in named)


def test_a_structure_differs_from_a_campaign_in_what_is_said_and_every_limit_is_explained():
    differing = {f.name for f in fields(CAMPAIGN) if getattr(CAMPAIGN, f.name) != getattr(STRUCTURE, f.name)}
    assert differing == {"column_error", "found_error", "price_inflated", "most_effects", "unexplained",
                         "unexplained_rms", "most_regions", "search_work", "search_seconds"}  # fmt: skip
    for each in described(STRUCTURE):
        assert len(each.meaning.split()) > 2 and each.source and each.unit


@dataclass(frozen=True)
class Nested(Effect):
    contains: tuple = ("special",)


@pytest.mark.parametrize(
    ("earned", "leads", "alone"),
    # χ² that the two further numbers of the larger law win; each costs 2.3 nats, and 3 more set the law apart.
    [(0.0, "special", False), (10.0, "special", False), (24.0, "larger", False), (60.0, "larger", True)],
)
def test_a_law_leads_its_special_case_only_by_what_its_further_numbers_earn(earned, leads, alone):
    special, larger = Effect("special", 3000.0, GOOD), Nested("larger", 3000.0 + earned, GOOD)
    scale = EvidenceScale(4000.0, 1000.0, 10_000.0, 0.01)
    ranking = rank([larger, special], [3, 1], scale, CAMPAIGN)
    assert ranking.fitted[0].name == leads
    assert (len(ranking.members) == 1) is alone
    if leads == "special":  # what it explains the larger law explains, too: neither is surer
        assert ranking.probabilities[0] == pytest.approx(ranking.probabilities[1])
        assert ranking.probabilities[0] <= 0.5


def test_a_larger_law_whose_range_leaves_its_special_case_out_can_be_denied():
    special, larger = Effect("special", 3000.0, GOOD), Nested("larger", 2900.0, GOOD)
    ranking = rank([special, larger], [1, 3], EvidenceScale(4000.0, 1000.0, 10_000.0, 0.01), CAMPAIGN)
    assert [each.name for each in ranking.members] == ["special"]


def test_the_shipped_laws_name_special_cases_that_are_there():
    from sindyjoint.diagnosis.effects.catalogue import load_effects

    effects = {effect.id: effect for effect in load_effects()}
    nested = {e.id: e.contains for e in effects.values() if e.contains}
    assert nested == {
        "bouc_wen_hysteresis": ("dahl_friction", "jenkins_element"),
        "lugre_friction": ("dahl_friction",),
        "backlash_play": ("jenkins_element",),
    }
    for name, specials in nested.items():
        fewest = min(v.degrees for v in effects[name].variants)
        assert all(fewest > v.degrees for special in specials for v in effects[special].variants)


def test_beside_a_remainder_an_effect_at_the_end_that_hardly_helps_is_no_name():
    great = Effect("great", 900.0, Gap(0.5, 0.5, 0.5))
    idle = Effect("idle", 500.0, Gap(0.48, 0.47, 0.4))
    useful = Effect("useful", 400.0, Gap(0.48, 0.3, 0.4))
    assert added(candidates=(great, idle)) == ["great"]
    assert added(candidates=(great, useful)) == ["great", "useful"]
    # Where no remainder is left it has explained the last of the gap.
    assert added(candidates=(great, idle), noise=0.4) == ["great", "idle"]


def test_a_law_found_first_may_give_its_place_to_another_of_its_class_and_later_gaps_are_told_anew():
    first, alike = (
        Effect("first", 500.0, Gap(0.5, 0.5, 0.5)),
        Effect("alike", 499.0, Gap(0.3, 0.4, 0.4)),
    )
    last = Effect("last", 300.0, Gap(0.4, 0.3, 0.3))
    problem = Made(candidates=(first, alike, last))
    say = lambda words: None  # noqa: E731
    one = try_effect(Progress(problem, problem.gap), frozenset(), 2, say).progress
    two = try_effect(one, frozenset({"alike"}), 2, say).progress
    assert [s.effect for s in two.steps] == ["first", "last"]
    (other,) = (led_by(two, *each) for each in other_members(two))
    assert [s.effect for s in other.steps] == ["alike", "last"]
    assert other.steps[1].gap_before == other.steps[0].gap_after and other.steps[0].gap_before == problem.gap


def test_a_delay_goes_that_the_law_found_does_not_need():
    delay, law = Effect("delay", 500.0, GOOD), Effect("law", 400.0, Gap(0.1, 0.1, 0.1))

    @dataclass(frozen=True)
    class Late(Made):
        other: Gap = Gap(0.1, 0.1, 0.1)
        numbers: int = 0

        def without_delay(self):
            return replace(self, found=(law,), gap=self.other), "delay"

    problem = Late(candidates=(delay, law))
    here = add_effects(Progress(problem, problem.gap), 4, lambda words: None)
    assert [s.effect for s in here.steps] == ["delay", "law"]
    (step,) = without_needless_delay(here).steps
    assert step.effect == "law" and step.gap_before == problem.gap
    needed = replace(here, problem=replace(here.problem, other=Gap(0.2, 0.1, 0.1)))
    assert without_needless_delay(needed) is needed


def test_a_zero_error_is_told_beside_a_law_that_is_refused():
    zero, spring = Effect("zero", 300.0, GOOD), Effect("spring", 600.0, GOOD)

    @dataclass(frozen=True)
    class Shifted(Made):
        def zero_errors(self, refused):
            return rank([zero], [1], EvidenceScale(2000.0, 1000.0, 1000.0, 0.0), self.policy)

    problem = Shifted(candidates=(spring, zero), impossible=("spring",))
    tried = try_effect(Progress(problem, problem.gap), frozenset(), 4, lambda words: None)
    assert tried.outcome is Outcome.ACCEPT and tried.effect == "zero"


def test_many_laws_that_leave_nothing_may_be_parts_of_one():
    steps, figures = one_step(), gaps(0.5, 0.1, FLOOR)
    (step,) = discount(steps, "named", replace(SMALL, series=0.4), figures, CAMPAIGN)
    assert step.probability == pytest.approx(0.6 * steps[0].probability)
    assert dict(step.rivals)["unknown"] == 0.4


def test_the_members_of_the_last_class_are_tried_in_its_place():
    first = Effect("first", 500.0, Gap(0.5, 0.5, 0.5))
    alike = Effect("alike", 499.0, Gap(0.3, 0.4, 0.4))
    problem = Made(candidates=(first, alike), impossible=("none",))
    here = try_effect(Progress(problem, problem.gap), frozenset(), 1, lambda words: None).progress
    assert set(here.steps[-1].members) == {"first", "alike"}
    (other,) = (led_by(here, *each) for each in other_members(here))
    assert other.steps[-1].effect == "alike" and other.steps[-1].members == ("alike", "first")
    assert other.gap.moment == other.steps[-1].gap_after.moment == 0.3
    assert other.steps[-1].probability < 0.5 and set(other.rankings) == {"alike"}
    refused = replace(here, problem=replace(here.problem, impossible=("alike",)))
    assert not list(other_members(refused))
    # One beside which another step is needless is not of that class.
    greedy = replace(here, problem=replace(here.problem, swallowed=("first",)))
    assert not list(other_members(greedy))
