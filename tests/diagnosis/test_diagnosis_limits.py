"""Campaigns that leave things open get an answer that says so."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import diagnose
from sindyjoint.cli import main
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.files import write_campaign
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.soundness import identifiability_notes
from sindyjoint.states import campaign_states
from tests.diagnosis.hidden_effects import hide

RATE = 500.0


def run_of(name, frequency=4.0, level=1e-3, duration=6.0, change_at=None, use="identify"):
    """A linear joint under a prescribed sinusoid with 1 % of noise; its swing may change at one instant."""
    time = np.arange(0, duration, 1 / RATE)
    w = 2 * np.pi * frequency
    swing = np.full(time.size, level) if change_at is None else np.where(time < change_at, 0.9, 1.0) * level
    rng = np.random.default_rng(len(name))
    angle, rate = swing * np.sin(w * time + 0.3), swing * w * np.cos(w * time + 0.3)
    moment = 6000 * angle + 40 * rate
    noisy = [x + 0.01 * np.std(x) * rng.standard_normal(x.size) for x in (moment, angle)]
    return Run(name, *noisy, RATE, frequency=frequency, use=use)


def said(*runs, simulated=False):
    campaign = Campaign(Joint(inertia=0.0), runs, simulated=simulated)
    return identifiability_notes(campaign, campaign_states(campaign))


FULL = [run_of(f"{f:g}-{x:g}", f, x) for f in (3.0, 5.0) for x in (1e-3, 4e-4)]


def test_a_full_campaign_has_no_limits_to_say():
    assert said(*FULL) == [] and said(*FULL, simulated=True) == [
        "the campaign is simulated (a virtual test), not measured"
    ]


@pytest.mark.parametrize(
    "runs, words",
    [
        (FULL[:1], "one run only: the gaps are those of its parts"),
        ([FULL[0], replace(FULL[1], use="validate")], "one run only: the runs kept for validation"),
        (FULL[:2], "one frequency only"),
        ([FULL[0], FULL[2]], "one level only"),
        ([*FULL, run_of("short", duration=1.5)], "fewer than 8 periods in short"),
        ([*FULL, run_of("late", change_at=2.8)], "left out as start-up in late"),
    ],
)
def test_what_is_open_is_said(runs, words):
    lines = said(*runs)
    assert any(words in line for line in lines), lines


@pytest.mark.parametrize(
    "kept, words",
    [
        (lambda runs: runs[:1], "one run only"),
        (lambda runs: [r for r in runs if r.frequency == runs[0].frequency], "one frequency only"),
        (lambda runs: [r for r in runs if r.level == runs[0].level], "one level only"),
    ],
)
def test_a_small_campaign_is_diagnosed_with_its_limits_said(kept, words):
    campaign = hide("constant_moment", 1, duration=4.0).campaign
    result = diagnose(campaign.with_runs(tuple(kept(list(campaign.runs)))), advise=False)
    assert any(words in line for line in result.warnings)
    assert {"constant_moment", "angle_offset"} <= {m for s in result.steps for m in s.members}
    assert np.isfinite(result.final.moment) and result.final.moment < result.initial.moment


def test_limits_reach_the_record(tmp_path, capsys):
    campaign = hide("constant_moment", 1, frequencies=(4.0,), duration=3.0).campaign
    write_campaign(campaign.with_runs(campaign.runs[:1]), tmp_path / "in")
    with pytest.raises(SystemExit) as leave:
        main(["diagnose", str(tmp_path / "in"), "--json"])
    assert leave.value.code == 0
    assert any("one run only" in w for w in json.loads(capsys.readouterr().out)["warnings"])


def test_bad_input_is_refused():
    campaign = Campaign(Joint(inertia=0.0), tuple(FULL))
    with pytest.raises(UnknownNameError, match="hold_out names run 'nobody'"):
        diagnose(campaign, hold_out=["nobody"])
    with pytest.raises(InputError, match="every run is kept out"):
        diagnose(campaign, hold_out=[r.name for r in FULL])
    with pytest.raises(InputError, match="max_effects is 0"):
        diagnose(campaign, max_effects=0)
