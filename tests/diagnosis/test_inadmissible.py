"""A candidate that explains most and that physics does not admit: what is named beside it, and what is not."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from sindyjoint.diagnosis.inadmissible import Inadmissible

from sindyjoint.diagnosis.campaign.problem import CampaignProblem
from sindyjoint.diagnosis.effects.catalogue import load_effects
from sindyjoint.diagnosis.engine import explain_gap
from sindyjoint.diagnosis.falling import grows, reported_together, with_falling_gaps
from sindyjoint.diagnosis.loop import Progress, add_effects
from sindyjoint.diagnosis.policy import CAMPAIGN
from sindyjoint.diagnosis.result import Gap, Step
from sindyjoint.mechanics.virtual import virtual_campaign
from tests.diagnosis.handmade_problem import Effect, Made

EFFECTS = {effect.id: effect for effect in load_effects()}
QUIET = lambda words: None  # noqa: E731


@pytest.fixture(scope="module")
def campaign():
    return virtual_campaign("inter-panel", frequencies=[3.0, 5.0], levels=[0.8], noise=0.001, random_state=3)


def with_moment(campaign, moment):
    """Return a campaign to whose moment a function of angle and rate is added."""

    def added(run):
        rate = np.gradient(run.angle, 1 / run.sample_rate)
        return replace(run, moment=run.moment + moment(run.angle, rate), source=None)

    return campaign.with_runs(tuple(added(run) for run in campaign.runs))


def problem_of(campaign, *names):
    effects = tuple(EFFECTS[name] for name in names)
    return CampaignProblem.build(campaign, None, "paper", effects, CAMPAIGN)


def test_where_the_best_candidate_has_a_sign_that_physics_denies_nothing_is_named(campaign):
    peak = max(np.abs(np.gradient(run.angle, 1 / run.sample_rate)).max() for run in campaign.runs)
    size = 0.3 * np.mean([np.sqrt(np.mean(run.moment**2)) for run in campaign.runs])

    def problem(sign):
        law = lambda a, w: sign * size * np.exp(-np.abs(w) / (0.05 * peak)) * np.sign(w)  # noqa: E731
        return problem_of(with_moment(campaign, law), "stribeck_friction", "quadratic_damping")

    pushing = explain_gap(problem(-1.0), 2, QUIET, advised=False)
    assert pushing.verdict == "unknown" and not pushing.steps
    assert "Stribeck friction would explain most" in pushing.reason
    assert "not admissible: its M_S would be negative; look for" in pushing.reason
    # The same law with the sign of the catalogue leads without a doubt.
    opposing = problem(1.0).propose(frozenset(), False, QUIET)
    assert opposing.ranking.members[0].name == "stribeck_friction" and len(opposing.ranking.members) == 1
    assert not opposing.doubts


@dataclass(frozen=True)
class Doubted(Made):
    """A problem at whose first round an inadmissible candidate leads, which would bring the gap to a figure."""

    leads: float = 0.3

    def propose(self, refused, pairs, say):
        proposal = super().propose(refused, pairs, say)
        led = Inadmissible("slider", "its k_t would be negative", self.gap, Gap(self.leads, 1.0))
        return replace(proposal, doubts=(led,)) if proposal and not self.found else proposal


def ended(problem):
    return add_effects(Progress(problem, problem.gap), 4, QUIET)


FIRST, SECOND = Effect("first", 500.0, Gap(0.5, 0.5, 0.5)), Effect("second", 400.0, Gap(0.1, 0.1, 0.1))
ZERO = Effect("constant_moment", 600.0, Gap(0.8, 0.8, 0.8))


@pytest.mark.parametrize(
    ("candidates", "noise", "leads", "named"),
    [
        ((FIRST,), 0.001, 0.3, []),
        # The admissible law explains as much, at once or in the end, or leaves no more than noise.
        ((FIRST,), 0.001, 0.49, ["first"]),
        ((FIRST, SECOND), 0.001, 0.3, ["first", "second"]),
        ((FIRST,), 0.5, 0.3, ["first"]),
        # That a sensor's zero is off can be seen whatever the law is.
        ((ZERO, FIRST), 0.001, 0.3, ["constant_moment"]),
    ],
)
def test_an_admissible_law_stays_that_explains_as_much(candidates, noise, leads, named):
    here = ended(Doubted(candidates=candidates, noise=noise, leads=leads))
    assert [s.effect for s in here.steps] == named
    assert (here.doubt is None) is (named not in ([], ["constant_moment"]))


def test_a_slider_that_never_yields_ends_the_search_with_its_reason():
    here = ended(Made(candidates=(FIRST,), impossible=("first",)))
    assert not here.steps and here.doubt.effect == "first"
    assert here.doubt.words.startswith("first would explain most but is not admissible: first pushes; look")


def test_what_is_refused_for_its_energy_leaves_no_name_to_a_lesser_effect():
    @dataclass(frozen=True)
    class Driven(Made):
        def complaint(self, candidate=None):
            driven = candidate is None and any(f.name == "second" for f in self.found)
            return "the joint would give off energy over all runs" if driven else ""

    strong = replace(SECOND, gain=700.0)
    here = ended(Driven(candidates=(strong, FIRST)))
    assert not here.steps and "give off energy" in here.doubt.words


def step(name, after, response=0.5):
    return Step(name, "made", (name,), 0.99, (), {}, (), Gap(0.0, 0.0), Gap(after, response))


@pytest.mark.parametrize(
    ("gaps", "groups"),
    [
        ([0.12, 0.1], [["0"], ["1"]]),
        ([0.311, 0.168, 0.044], [["0", "1", "2"]]),
        ([0.1, 0.12, 0.05], [["0"], ["1", "2"]]),
        # A last step that makes the gap larger stands with the one before.
        ([0.1, 0.05, 0.06], [["0"], ["1", "2"]]),
        ([0.1, 0.05, 0.12], [["0", "1", "2"]]),
        ([], []),
    ],
)
def test_steps_that_shrink_the_gap_only_together_share_one(gaps, groups):
    initial = Gap(0.165, 0.5)
    steps = with_falling_gaps([step(str(i), gap) for i, gap in enumerate(gaps)], initial)
    assert [[s.effect for s in group] for group in reported_together(steps)] == groups
    before = initial
    for group in reported_together(steps):
        assert {s.gap_before for s in group} == {before} and not grows(before, group[0].gap_after)
        assert all(s.together == (tuple(groups[0]) if len(groups) == 1 else s.together) for s in group[1:])
        before = group[-1].gap_after
    assert not gaps or before.moment == gaps[-1]


def test_the_moment_of_a_free_motion_may_grow_where_its_response_falls():
    before = Gap(0.0010, 0.028)
    assert not grows(before, Gap(0.0016, 0.0026)) and grows(before, Gap(0.0016, 0.025))
    assert grows(before, Gap(0.0016, float("nan"))) and not grows(
        Gap(float("nan"), 0.3), Gap(float("nan"), 0.2)
    )


def test_a_search_whose_gap_ends_larger_than_it_began_is_taken_back():
    worse = Effect("worse", 500.0, Gap(1.1, 0.9, 0.9))
    assert not ended(Made(candidates=(worse,))).steps
