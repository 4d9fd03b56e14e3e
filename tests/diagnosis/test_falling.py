"""Steps as they are reported, each of which makes the gap smaller; and a law whose sign physics denies."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import diagnose
from sindyjoint.diagnosis import (
    Gap,
    Step,
    grows,
    load_effects,
    reported_together,
    select_effects,
    with_falling_gaps,
)
from sindyjoint.mechanics import virtual_campaign


@pytest.fixture(scope="module")
def campaign():
    return virtual_campaign("inter-panel", frequencies=[3.0, 5.0], levels=[0.8], noise=0.001, random_state=3)


def with_moment(campaign, moment):
    """Return a campaign to whose moment a function of angle and rate is added."""

    def added(run):
        rate = np.gradient(run.angle, 1 / run.sample_rate)
        return replace(run, moment=run.moment + moment(run.angle, rate), source=None)

    return campaign.with_runs(tuple(added(run) for run in campaign.runs))


def test_a_law_is_named_with_the_sign_that_physics_admits_alone(campaign):
    peak = max(np.abs(np.gradient(run.angle, 1 / run.sample_rate)).max() for run in campaign.runs)
    size = 0.3 * np.mean([np.sqrt(np.mean(run.moment**2)) for run in campaign.runs])
    effects = select_effects(load_effects(), ["stribeck_friction", "quadratic_damping"])

    def diagnosed(sign):
        law = lambda a, w: sign * size * np.exp(-np.abs(w) / (0.05 * peak)) * np.sign(w)  # noqa: E731
        return diagnose(with_moment(campaign, law), effects=effects, advise=False)

    opposing, pushing = diagnosed(1.0), diagnosed(-1.0)
    assert [step.effect for step in opposing.steps] == ["stribeck_friction"]
    assert pushing.verdict in ("unknown", "partly_named") and all(
        s.probability <= 0.75 for s in pushing.steps
    )
    assert all(s.parameters["M_S"] > 0 for s in pushing.steps if s.effect == "stribeck_friction")


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
