"""Can I trust it, and what next, of results other than a discovery: a colour and a step for each case."""

from dataclasses import replace

import numpy as np
import pytest
from handmade_results import comparison, diagnosis, verification

from sindyjoint.diagnosis import Gap
from sindyjoint.judgement.headlines import (
    judge_check,
    judge_comparison,
    judge_diagnosis,
    judge_verification,
)
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.soundness import Check, Finding, Soundness


def lights(headline):
    return {light.name: light.colour for light in headline.lights}


def asked(headline):
    return {light.name: light.colour for light in headline.question}


def fault(severity, **more):
    return Finding("drift", "3Hz", "angle", severity, "2 %", "shifts k1", "subtract the drift", **more)


def check(*findings, accepted=()):
    time = np.arange(100) / 100
    runs = tuple(
        Run(f"{f:g}Hz-{level}", np.sin(f * time), np.sin(f * time), 100.0, frequency=f, level=level)
        for f in (3.0, 4.0, 6.0)
        for level in ("low", "mid", "high")
    )
    campaign = Campaign(Joint("bench"), runs)
    return Check(campaign, Soundness(findings, accepted), campaign)


def test_of_data():
    good = judge_check(check())
    assert good.answer == "Yes" and good.next_steps[0][0].startswith("sindyjoint discover CAMPAIGN")
    stopped = judge_check(check(fault("stops")))
    assert lights(stopped)["faults"] == "poor"
    assert [do for do, _ in stopped.next_steps] == [
        "subtract the drift", "sindyjoint discover CAMPAIGN --accept drift"]  # fmt: skip
    accepted = judge_check(check(fault("stops"), accepted=("drift",)))
    assert lights(accepted)["faults"] == "fair" and "--accept" not in accepted.next_steps[0][0]
    masked = judge_check(check(fault("biases", masked=True)))
    assert lights(masked)["bias"] == "fair" and "left out" in masked.lights[1].sentence


def test_of_a_verification():
    made = verification()
    assert judge_verification(made, True, None).answer == "Yes"
    runs = replace(made, kind="campaign", beyond_range=("3Hz",))
    headline = judge_verification(runs, False, Soundness((fault("biases"),)))
    assert lights(headline) == {"data": "fair", "explained": "good", "predicts": "fair", "determined": "fair"}
    missed = judge_verification(replace(made, verdict="failed", response_nrmse=0.4), False, None)
    assert missed.answer == "Not yet" and missed.next_steps[0][0].startswith("sindyjoint diagnose RIG")
    failed = judge_verification(verification(failed=True), False, None)
    assert lights(failed)["explained"] == "poor"
    unknown = judge_verification(replace(made, noise_floor=None), False, None)
    assert lights(unknown)["explained"] == "fair"


@pytest.mark.parametrize(
    ("verdict", "changes", "colour", "first"),
    [
        ("ambiguous", {}, "fair", "record a sinusoidal angle"),
        ("ambiguous", {"advice": ()}, "fair", "record runs"),
        ("named", {"advice": ()}, "good", "sindyjoint verify RESULTS CAMPAIGN"),
        ("nothing_missing", {}, "good", "sindyjoint verify RESULTS CAMPAIGN"),
        ("unknown", {}, "poor", "sindyjoint libraries copy effects"),
        ("undecided", {"noise_floor": Gap(float("nan"), float("nan"))}, "fair", "write noise ="),
    ],
)
def test_of_a_diagnosis(verdict, changes, colour, first):
    headline = judge_diagnosis(replace(diagnosis(verdict=verdict), **changes), False)
    assert asked(headline)["effects"] == colour and headline.next_steps[0][0].startswith(first)
    failed = judge_diagnosis(replace(diagnosis(), final=Gap(0.01, float("nan"))), False)
    assert asked(failed)["response"] == "poor" and lights(failed)["explained"] == "poor"


def test_what_only_the_uncertainty_of_numbers_explains_is_minded():
    figures = dict(noise_floor=Gap(0.01, 0.006), uncertainty=Gap(0.0, 0.078))
    for response, colour in ((0.02, "fair"), (0.008, "good")):
        headline = judge_diagnosis(replace(diagnosis(), final=Gap(0.01, response), **figures), False)
        (light,) = (each for each in headline.question if each.name == "response")
        assert light.colour == colour
        assert ("uncertainty of numbers and drive leaves 7.8 %" in light.sentence) == (colour != "good")


def test_of_a_comparison():
    made = comparison()
    assert lights(judge_comparison(made)) == {"data": "good"}
    assert asked(judge_comparison(made)) == {
        "methods": "fair", "single": "good", "resampled": "good", "frequency": "good"}  # fmt: skip
    rare = replace(made, inclusion=(1.0, 0.3, 1.0, 1.0, 1.0, 0.03, 0.0), methods=made.methods[:1])
    assert asked(judge_comparison(rare))["resampled"] == "poor"
    alike = replace(rare, inclusion=made.inclusion, tests=())
    assert judge_comparison(alike).next_steps[0][0].startswith("sindyjoint discover CAMPAIGN")
    nothing = judge_comparison(replace(made, model=replace(made.model, terms=())))
    assert asked(nothing) == {"model": "poor"}
