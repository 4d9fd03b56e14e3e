"""The greedy search and the verdict on a problem made by hand: what is added and taken back, and what it is called."""

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis.strategies import booleans, floats, just, one_of, tuples

from sindyjoint.clock import Portion
from sindyjoint.diagnosis import (
    CAMPAIGN,
    STRUCTURE,
    Gap,
    Gaps,
    Progress,
    Residual,
    add_effects,
    discount,
    engine,
    judge,
    rank,
    share_beyond_noise,
)
from sindyjoint.policy import described
from tests.diagnosis.handmade_problem import Effect, Made, scored


def added(most=4, **changes):
    problem = Made(**changes)
    search = Portion(np.inf, np.inf)
    return add_effects(Progress(problem, problem.gap), most, lambda words: None, search).steps


def names(**changes):
    return [step.effect for step in added(**changes)]


GOOD, NAN = Gap(0.5, 0.5), float("nan")


def test_after_a_fit_that_fails_the_next_effect_has_its_turn():
    bad, good = Effect("bad", 600.0, Gap(NAN, NAN)), Effect("good", 500.0, GOOD)
    assert names(candidates=(bad, good)) == ["good"]
    worse = [Effect(f"bad{i}", 900.0 - i, Gap(NAN, NAN)) for i in range(3)]
    assert names(candidates=(*worse, good)) == ["good"]


def test_a_step_tells_the_gap_that_it_leads_down_from_and_no_more_steps_are_taken_than_asked_for():
    one, two = Effect("one", 600.0, GOOD), Effect("two", 500.0, Gap(0.1, 0.1))
    first, second = added(candidates=(one, two))
    assert (first.gap_before, first.gap_after) == (Gap(1.0, 1.0), one.gap)
    assert (second.gap_before, second.gap_after) == (one.gap, two.gap)
    assert names(candidates=(one, two), most=1) == ["one"]


def test_an_effect_that_a_later_one_makes_needless_leaves_the_steps():
    early, late = Effect("early", 600.0, GOOD), Effect("late", 500.0, Gap(0.1, 0.1))
    assert names(candidates=(early, late)) == ["early", "late"]
    (step,) = added(candidates=(early, late), needless="early")
    assert step.effect == "late" and step.gap_before == Gap(1.0, 1.0)


def test_nothing_is_searched_once_the_residual_is_surely_noise():
    one = Effect("one", 600.0, GOOD)
    two = replace(one, name="two", gap=Gap(0.1, 0.1))
    assert names(candidates=(one, two), is_noise=True) == ["one"]


def test_nothing_is_added_that_chance_would_bring():
    one = Effect("one", 600.0, GOOD)
    assert names(candidates=(one,)) == ["one"]
    # exp(-6.9) of the odds are one in a thousand.
    assert names(candidates=(replace(one, gain=13.0),)) == []
    assert names(candidates=(replace(one, gain=15.0),)) == ["one"]
    # Of many candidates the best one wins more by chance.
    many = tuple(replace(one, name=f"one{i}", gain=0.0) for i in range(20))
    assert names(candidates=(replace(one, gain=15.0), *many)) == []


def test_a_search_whose_gap_ends_larger_than_it_began_is_taken_back():
    worse = Effect("worse", 500.0, Gap(1.1, 0.9))
    assert names(candidates=(worse,)) == []
    better, last = Effect("better", 600.0, GOOD), Effect("last", 400.0, Gap(0.3, 0.3))
    assert names(candidates=(better, worse)) == ["better"]
    # A step that makes it larger stays where a later one leads it further down.
    assert names(candidates=(better, worse, last)) == ["better", "worse", "last"]


def test_what_remains_is_a_share_of_the_mean_square():
    before, after = (5000.0, 1000.0), (2000.0, 1000.0)
    assert share_beyond_noise(before, after, CAMPAIGN) == pytest.approx(0.25)
    # A quarter of the RMS.
    assert STRUCTURE.unexplained == pytest.approx(0.25**2)
    assert share_beyond_noise(before, (1200.0, 1000.0), CAMPAIGN) == 0.0


def one_step():
    return added(candidates=(Effect("one", 600.0, GOOD),))


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
    (step,) = discount(steps, verdict, figures, CAMPAIGN)
    assert step.probability == pytest.approx(0.5 * steps[0].probability)
    # A fiftieth of the gap's mean square remains: the name loses a quarter, and never less.
    (step,) = discount(steps, verdict, gaps(0.8, 0.16, FLOOR), CAMPAIGN)
    assert step.probability == pytest.approx(0.75 * steps[0].probability)
    for word in ("unknown", "undecided"):
        (step,) = discount(steps, word, figures, CAMPAIGN)
        assert dict(step.rivals)["unknown"] == 0.5
    assert discount(steps, "named", figures, CAMPAIGN) == steps


FIGURE = floats(0.001, 2.0)
GAP = tuples(FIGURE, one_of(FIGURE, just(NAN)))


@given(GAP, GAP, GAP, tuples(floats(0.0, 0.5), floats(0.0, 0.5)), floats(0.0, 1.0), booleans())
def test_no_verdict_says_more_than_its_figures(initial, final, floor, unsure, share, found):
    """Whatever the figures: *nothing missing*, *named* and *ambiguous* within the factors of what is no model's."""
    figures = Gaps(*(Gap(*each) for each in (initial, final, floor, unsure)))
    steps = one_step() if found else ()
    verdict, _ = judge(steps, Residual(share, 0.15), figures, CAMPAIGN)
    (moment, response), policy = final, CAMPAIGN
    if verdict in ("nothing_missing", "named", "ambiguous"):
        assert moment <= policy.clearly * np.hypot(floor[0], policy.processing_error) * (1 + 1e-12)
        noise = np.hypot(floor[1], policy.processing_error)
        widest = np.hypot(policy.outstanding * noise, policy.clearly * unsure[1])
        assert not response > widest * (1 + 1e-12)
        assert not (response > initial[1] and response > policy.clearly * noise * (1 + 1e-12))
        assert np.isfinite(response) or not found
    assert (verdict == "nothing_missing") <= (not found)
    named = discount(steps, verdict, figures, policy)
    if verdict not in ("named", "ambiguous"):
        assert all(step.probability <= 0.75 for step in named)


def test_a_structure_differs_from_a_campaign_in_what_is_said_and_every_limit_is_explained():
    differing = {f.name for f in fields(CAMPAIGN) if getattr(CAMPAIGN, f.name) != getattr(STRUCTURE, f.name)}
    assert differing == {"most_effects", "unexplained", "most_regions", "search_work"}
    for each in described(STRUCTURE):
        assert len(each.meaning.split()) > 2 and each.source and each.unit


def test_of_two_that_predict_alike_the_first_leads_and_both_are_of_the_class():
    simple, larger = Effect("simple", 400.0, GOOD), Effect("larger", 400.0, GOOD)
    other = Effect("other", 380.0, GOOD)
    ranking = rank([(each, scored(each.gain)) for each in (simple, larger, other)], scored(0.0), 3.0)
    assert [each.name for each in ranking.fitted] == ["simple", "larger", "other"]
    assert [each.name for each in ranking.members] == ["simple", "larger"] and ranking.nothing < 1e-6
    assert sum(ranking.probabilities) + ranking.nothing == pytest.approx(1)


def test_rivals_are_told_apart_beside_a_base_that_no_simulation_follows():
    one, other = Effect("one", 400.0, GOOD), Effect("other", 380.0, GOOD)
    ranking = rank([(each, scored(each.gain)) for each in (one, other)], scored(-1e154), 3.0)
    assert ranking.members == (one,) and ranking.probabilities[0] > 0.9999


def test_beside_a_misfit_of_a_hundred_times_the_noise_the_same_gain_says_nothing():
    one = Effect("one", 400.0, GOOD)
    assert rank([(one, scored(400.0))], scored(0.0), 3.0).nothing < 1e-6
    assert rank([(one, scored(400.0, excess=100.0))], scored(0.0), 3.0).nothing > 0.1


def test_the_shipped_laws_name_special_cases_that_are_there():
    from sindyjoint.diagnosis import load_effects

    effects = {effect.id: effect for effect in load_effects()}
    nested = {e.id: e.contains for e in effects.values() if e.contains}
    assert nested == {
        "dead_zone": ("bilinear_stiffness",),
        "bouc_wen_hysteresis": ("dahl_friction", "jenkins_element"),
        "lugre_friction": ("dahl_friction",),
        "backlash_play": ("jenkins_element",),
    }
    for name, specials in nested.items():
        fewest = min(v.degrees for v in effects[name].variants)
        assert all(fewest > v.degrees for special in specials for v in effects[special].variants)


def test_of_two_searches_the_one_that_can_be_simulated_is_used_though_it_costs_more():
    def end(cost, response):
        return SimpleNamespace(cost=cost, gaps=Gaps(Gap(1.0, 1.0), Gap(0.5, response), Gap(0.1, 0.1)))

    cheap, dear, dearest = end(1.0, NAN), end(2.0, 0.5), end(3.0, 0.4)
    first = SimpleNamespace(policy=CAMPAIGN, initial_gap=Gap(1.0, 1.0))
    assert engine._best_of(first, [dearest, cheap, dear]) is dear
    assert engine._best_of(first, [cheap]) is cheap
