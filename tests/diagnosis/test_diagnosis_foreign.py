"""A sample of benchmarks/bench_foreign.py: joints that SciPy integrated, diagnosed."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import diagnose
from tests.diagnosis.foreign_joints import foreign_campaign
from tests.diagnosis.foreign_judgement import SURE, ZEROS, judge, told
from tests.diagnosis.foreign_laws import SAME


def answer(kind, name, seed):
    made = foreign_campaign(name, seed)
    return dict(kind=kind, name=name, seed=seed, **told(diagnose(made.campaign, advise=False)))


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, seed",
    [
        ("second_oscillator", 1),
        ("chaotic_oscillator", 1),
        (
            "logarithmic_creep",
            8701,
        ),  # a run left out is predicted by no more than what the numbers are unsure by
    ],
)
def test_a_law_of_no_catalogue_is_no_name(name, seed):
    record = answer("foreign", name, seed)
    assert judge(record) == "right", record["reason"]
    assert all(step["probability"] <= SURE for step in record["steps"])


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, seed",
    [
        ("clearance", 1),
        ("quadratic_damping", 1),
        ("bouc_wen_hysteresis", 1),
        ("bouc_wen_hysteresis", 500),  # a term is needless by the rows of the new law, not of the one before
        ("amplitude_dependent_damping", 500),  # a zero of both channels
        ("backlash_play", 510),  # a slider that has moved before the first state
        ("jenkins_element", 511),  # little half-cycles between pulls
        ("quadratic_damping", 512),  # noise of the rate by a steep damping
        ("channel_delay", 740),  # a zero of the force explains it to within the noise
        ("bilinear_stiffness", 8702),  # a stop wherever its corner lies takes the place of a zero
    ],
)
def test_an_effect_of_the_catalogue_is_named_whoever_made_the_motion(name, seed):
    record = answer("catalogue", name, seed)
    assert judge(record) == "right", record["reason"]
    sure = {step["effect"] for step in record["steps"] if step["probability"] > SURE}
    assert sure <= SAME.get(name, {name}) | ZEROS


@pytest.mark.slow
def test_where_nothing_is_hidden_nothing_is_named():
    assert judge(answer("nothing", "nothing", 1)) == "right"


@pytest.mark.slow
def test_a_constant_added_to_the_displacement_changes_no_name():
    """Beside the zero itself, which is told: names, gap and the size of the effect stay."""
    campaign = foreign_campaign("clearance", 1).campaign
    shift = 0.1 * max(np.abs(run.angle).max() for run in campaign.runs)
    moved = campaign.with_runs(tuple(replace(run, angle=run.angle + shift) for run in campaign.runs))
    first, later = (diagnose(each, advise=False) for each in (campaign, moved))

    def laws(result):
        return {s.effect: s for s in result.steps if s.family != "measurement"}

    assert set(laws(first)) == set(laws(later)) == {"dead_zone"}
    assert {first.verdict, later.verdict} <= {"named", "ambiguous"}
    assert later.final.moment == pytest.approx(first.final.moment, rel=0.1)
    size, other = (laws(r)["dead_zone"].parameters["k_d"] for r in (first, later))
    assert other == pytest.approx(size, rel=0.1)
