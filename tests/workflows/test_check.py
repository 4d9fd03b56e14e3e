"""The check of the data, and what it does to every verb that fits."""

from dataclasses import replace

import numpy as np
import pytest

import sindyjoint
from sindyjoint import compare, diagnose, simulate, verify
from sindyjoint.errors import InputError, UnknownNameError, UnsoundError
from sindyjoint.inputs import LongRecord
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.soundness import Finding, check_data
from sindyjoint.workflows.batch import batch

STOP = Finding("reversed_sign", None, "moment", "stops", "in all runs", "k1 negative", "turn the sign")
BIAS = Finding("drift", "3Hz-0.9", "angle", "biases", "5 % over the run", "shifts k2", "remove it")
DELAY = Finding("channel_delay", None, "moment", "biases", "1 ms", "shifts c1", "align")
NOTE = Finding("coverage", None, None, "note", "one level", "hides k3", "add levels")


@pytest.fixture(scope="module")
def campaign():
    """Four runs of the virtual test."""
    return simulate(frequencies=[3, 4.5], levels=[0.9, 0.5], duration=4, noise=0.01, random_state=3)


@pytest.fixture
def faults(monkeypatch):
    """Let the detectors find what is given."""

    def find(*findings):
        monkeypatch.setattr("sindyjoint.soundness.check.find_faults", lambda campaign: findings)

    return find


def test_the_virtual_test_is_sound():
    result = sindyjoint.check()
    assert (result.soundness.verdict, result.stopping, result.reason) == ("sound", (), "")
    assert result.usable is result.campaign and result.warnings == ()
    assert result.to_dict() == {"schema": 1, "verdict": "sound", "findings": [], "notes": []}


def test_findings_become_sentences_with_all_their_parts(campaign, faults):
    faults(STOP, BIAS, replace(BIAS, run="4.5Hz-0.9"), NOTE)
    result = sindyjoint.check(campaign)
    assert result.soundness.verdict == "unsound"
    assert result.reason == (
        "the data are unsound: reversed sign of the moment: in all runs; k1 negative; turn the sign "
        "(--accept reversed_sign goes on all the same)"
    )
    assert result.warnings == (
        "drift of the angle in 3Hz-0.9, 4.5Hz-0.9: 5 % over the run; shifts k2; remove it",
    )
    accepted = sindyjoint.check(campaign, accept=["reversed_sign"])
    assert accepted.stopping == () and accepted.soundness.verdict == "unsound"
    assert accepted.warnings[0].startswith("accepted: reversed sign of the moment: in all runs")


def test_a_sliding_joint_is_told_of_its_force(campaign, faults):
    faults(STOP)
    sliding = replace(campaign, joint=replace(campaign.joint, motion="translation"))
    assert "reversed sign of the force" in sindyjoint.check(sliding).reason


@pytest.mark.parametrize("verb", [sindyjoint.check, sindyjoint.discover, compare, diagnose])
def test_an_unknown_id_is_refused_with_those_that_are_known(campaign, verb):
    with pytest.raises(UnknownNameError, match="accept is 'spike'; expected one of ac_coupling, .*spikes"):
        verb(campaign, accept=["spike"])


def test_of_a_long_run_the_first_segment_is_checked(campaign):
    first, *others = campaign.runs
    signal = first.moment.copy()
    signal[700] += 1e3
    long = replace(first, moment=signal, whole=LongRecord("campaign.toml", 0, (0, 4000, 8000)))
    result = check_data(campaign.with_runs((long, *others)))
    assert [f.id for f in result.soundness.findings] == ["spikes"]
    assert result.usable.runs[0] is long
    assert result.warnings[-1] == (
        "too long for memory: 3Hz-0.9; only the first segment was checked for faults, and no sample is left out"
    )


def test_discover_makes_no_model_of_unsound_data(campaign, faults):
    faults(STOP, BIAS)
    result = sindyjoint.discover(campaign)
    assert not result.found and result.model.terms == () and result.stopped is not None
    assert result.verdict.verdict == "undecided" and result.verdict.missing == PAPER_TERMS
    assert "reversed sign" in result.reason and result.reason == result.verdict.reason
    record = result.to_dict()
    assert record["soundness"] == {"verdict": "unsound", "ids": ["reversed_sign", "drift"], "accepted": []}
    assert record["fit"]["noise_floor"] is None and record["fit"]["samples"] == 0


def test_an_answer_is_never_surer_than_the_data(campaign, faults):
    plain = sindyjoint.discover(campaign)
    assert plain.verdict.verdict == "confirmed" and plain.soundness.verdict == "sound"
    faults(STOP)
    accepted = sindyjoint.discover(campaign, accept=["reversed_sign"])
    assert accepted.found and accepted.model == plain.model
    assert accepted.verdict.verdict == "undecided" and accepted.verdict.missing == ()
    assert accepted.verdict.reason.startswith("the data are not sound (reversed sign: k1 negative)")
    assert "confirmed" in accepted.verdict.reason and accepted.warnings[0].startswith("accepted: ")
    faults(DELAY)
    assert sindyjoint.discover(campaign).verdict.verdict == "undecided"
    faults(BIAS, NOTE)
    doubtful = sindyjoint.discover(campaign)
    assert doubtful.verdict == plain.verdict
    assert doubtful.warnings == (
        "drift of the angle in 3Hz-0.9: 5 % over the run; shifts k2; remove it",
        *plain.warnings,
    )


def test_compare_and_verify_stop_with_the_check(campaign, faults):
    model = sindyjoint.discover(campaign).model
    faults(STOP)
    with pytest.raises(UnsoundError, match="the data are unsound: reversed sign") as stop:
        compare(campaign)
    assert stop.value.check.stopping == (STOP,)
    with pytest.raises(UnsoundError, match="reversed sign"):
        verify(model, campaign)
    passed = verify(model, campaign, accept=["reversed_sign"], draws=0)
    assert (
        passed.warnings[0].startswith("accepted: ") and passed.to_dict()["soundness"]["verdict"] == "unsound"
    )
    with pytest.raises(InputError, match="accept is spikes: belongs to data that are checked"):
        verify(model, "pulse-rig", accept=["spikes"])


def test_a_diagnosis_of_unsound_data_is_undecided(campaign, faults):
    faults(STOP)
    result = diagnose(campaign)
    assert result.verdict == "undecided" and "reversed sign" in result.reason and result.steps == ()
    record = result.to_dict()
    assert (
        record["gap"]["initial"] == {"moment": None, "response": None} and record["budget"]["noise"] is None
    )
    assert record["warnings"][0] == result.reason
    accepted = diagnose(campaign, accept=["reversed_sign"], effects=())
    assert accepted.verdict == "undecided" and "without that: " in accepted.reason
    assert np.isfinite(accepted.initial.moment)


def test_a_batch_records_why_there_is_no_model(campaign, faults, tmp_path):
    from sindyjoint.files import write_campaign

    write_campaign(campaign, tmp_path / "tests" / "one")
    faults(STOP)
    (record,) = batch(tmp_path / "tests", tmp_path / "out").records
    assert record.status == "none" and "reversed sign" in record.reason
    assert record.result["soundness"]["ids"] == ["reversed_sign"]
    again = batch(tmp_path / "tests", tmp_path / "out")
    assert again.kept == 1
    (accepted,) = batch(tmp_path / "tests", tmp_path / "out", accept=("reversed_sign",)).records
    assert accepted.status == "found" and accepted.result["paper_term_set"]["verdict"] == "undecided"
    with pytest.raises(UnknownNameError, match="accept is 'nothing'"):
        batch(tmp_path / "tests", tmp_path / "out", accept=("nothing",))


def test_decays_that_are_too_coarse_are_told_at_what_rate_they_would_do():
    """A linear joint with a fifth of the critical damping, released from rest, in closed form; 0.2 % noise."""
    angular, damping = 2 * np.pi * 9, 0.2
    damped = angular * np.sqrt(1 - damping**2)

    def decays(samples):
        rng, rate = np.random.default_rng(0), 9.0 * samples
        time = np.arange(int(rate)) / rate
        angle = np.exp(-damping * angular * time) * (
            np.cos(damped * time) + damping * angular / damped * np.sin(damped * time)
        )
        noise = 0.002 * rng.standard_normal((2, time.size))
        runs = [
            Run(f"{a}", 0 * time, a * (angle + n), rate) for a, n in zip((0.05, 0.03), noise, strict=True)
        ]
        return Campaign(Joint("swing", "rotation", 1.0), tuple(runs))

    told = sindyjoint.check(decays(16)).stopping
    assert {f.id for f in told} == {"no_signal"} and "from rest" in told[0].remedy
    assert "40 samples in a period" in told[0].remedy
    assert sindyjoint.check(decays(40)).soundness.verdict == "sound"
