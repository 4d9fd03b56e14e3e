"""Hidden effects named, nothing named where nothing is hidden.

Every campaign is drawn by tests/diagnosis/hidden_effects.py.

Seeds are listed; noise is 1 % of both channels, an effect carries 6 % of the moment's RMS.
"""

import json

import numpy as np
import pytest

from sindyjoint import Campaign, diagnose
from sindyjoint.cli import main
from sindyjoint.diagnosis import load_effects, select_effects
from sindyjoint.files import write_campaign
from tests.diagnosis.contract import KEYS
from tests.diagnosis.hidden_effects import hide
from tests.doors.hidden import runs_of

NAMED = [
    ("dead_zone", 0, {"dead_zone"}),
    ("amplitude_dependent_damping", 1, {"amplitude_dependent_damping"}),
    ("dahl_friction", 0, {"dahl_friction", "bouc_wen_hysteresis", "lugre_friction", "jenkins_element"}),
    ("maxwell_branch", 1, {"maxwell_branch", "fractional_damping"}),
    ("channel_delay", 0, {"channel_delay"}),
    ("angle_drift", 1, {"angle_drift"}),
]


@pytest.mark.slow
@pytest.mark.parametrize("name, seed, family", NAMED)
def test_a_hidden_effect_is_named_and_the_gap_falls_to_the_noise(name, seed, family):
    hidden = hide(name, seed)
    result = diagnose(hidden.campaign, advise=False)
    first = result.steps[0]
    assert name in first.members and set(first.members) <= family and len(first.members) <= 4
    # 1.2 times the floor, as the moment gap of a mean period counts it.
    assert result.final.moment <= 1.2 * result.noise_floor.moment
    assert result.final.moment < 0.95 * result.initial.moment
    truth = dict(
        zip(("linear_stiffness", "cubic_stiffness"), (hidden.plan.law.k1, hidden.plan.law.k3), strict=True)
    )
    if name != "maxwell_branch":  # its spring and the joint's are one over an octave of frequency
        for term, value in truth.items():
            assert result.model[term].coefficient == pytest.approx(value, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_nothing_hidden_nothing_named(seed):
    result = diagnose(hide("nothing", seed).campaign, advise=False)
    assert result.verdict == "nothing_missing" and result.steps == ()


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_an_effect_outside_the_catalogue_is_unknown_and_no_name_is_near_certain(seed):
    result = diagnose(hide("ripple", seed).campaign, advise=False)
    assert result.verdict == "unknown"
    assert all(step.probability <= 0.8 for step in result.steps)


def test_the_command_prints_the_record_and_writes_its_folder(tmp_path, capsys, few_effects):
    few_effects("constant_moment", "angle_offset", "quadratic_damping")
    campaign = hide("constant_moment", 1, frequencies=(3.0, 5.0), duration=4.0).campaign
    write_campaign(campaign, tmp_path / "in")
    with pytest.raises(SystemExit) as leave:
        main(["diagnose", str(tmp_path / "in"), "--json", "--out", str(tmp_path / "out")])
    record = json.loads(capsys.readouterr().out)
    assert leave.value.code == 0
    assert list(record) == [*KEYS, "soundness"]
    assert set(record["budget"]) == {"state", "history", "run", "processing", "noise"}
    assert sum(record["budget"].values()) == pytest.approx(record["gap"]["initial"]["moment"] ** 2)
    step = record["steps"][0]
    assert {"constant_moment", "angle_offset"} <= set(step["class"])
    assert np.isclose(sum(r["probability"] for r in step["rivals"]) + step["probability"], 1.0, atol=0.01)
    assert {"diagnosis.json", "model.json", "figures"} <= {p.name for p in (tmp_path / "out").iterdir()}


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["nowhere.toml"], "nowhere.toml"),
        (["--model", "nowhere.json"], "nowhere.json"),
        (["--max-effects", "0"], "--max-effects"),
        (["--library", "nowhere.toml"], "nowhere.toml"),
    ],
)
def test_bad_input_is_one_line_and_status_2(arguments, message, capsys, tmp_path):
    with pytest.raises(SystemExit) as leave:
        main(["diagnose", *arguments])
    error = capsys.readouterr().err
    assert leave.value.code == 2 and error.count("\n") == 1 and message in error


def test_a_law_that_no_simulation_can_follow_has_a_moment_gap_all_the_same():
    """Of an unknown inertia the model alone makes a negative one, for which it has no response."""
    runs = runs_of("maxwell_branch")
    campaign = Campaign.from_arrays(
        moment=[r.moment for r in runs], angle=[r.angle for r in runs], rate="500 Hz",
        frequency=[r.frequency for r in runs], names=[r.name for r in runs],
    )  # fmt: skip
    maxwell = select_effects(load_effects(), ["maxwell_branch"])
    found = diagnose(campaign, hold_out=[runs[4].name], effects=maxwell, advise=False, max_effects=1)
    assert np.isnan(found.initial.response)
    assert found.final.moment < found.initial.moment < 0.1
