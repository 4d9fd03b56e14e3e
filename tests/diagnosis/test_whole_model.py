"""What a diagnosis adds belongs to the model: saved, read again and simulated, it closes the gap that it closed."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from typer.testing import CliRunner

from sindyjoint import diagnose, diagnose_structure, verify
from sindyjoint.cli import make_app
from sindyjoint.diagnosis import load_effects, select_effects
from sindyjoint.equation import read_model, read_test
from sindyjoint.files import write_campaign
from sindyjoint.mechanics import Channel, MeasuredResponse, load_rig
from sindyjoint.reporting import write_results
from tests.diagnosis.hidden_effects import hide
from tests.seeds import slow

# What is hidden here, and two that are not: what becomes of a find is tested, and not the search.
FEW = ("jenkins_element", "maxwell_branch", "channel_delay", "frequency_dependent_stiffness", "quadratic_damping",
       "dead_zone")  # fmt: skip
HIDDEN = {
    "jenkins_element": 3,
    "maxwell_branch": 4,
    "channel_delay": 3,
    "frequency_dependent_stiffness": 4,
}


@pytest.fixture(autouse=True)
def few(few_effects):
    few_effects(*FEW)


@pytest.fixture(scope="module")
def found():
    """Return a function from what is hidden to its campaign, the runs kept out and the diagnosis, made once."""

    @cache
    def of(name):
        campaign = hide(name, HIDDEN[name], duration=4.0 if name == "channel_delay" else 2.0).campaign
        out = [run.name for run in campaign.runs][1::4]
        return campaign, out, diagnose(campaign, hold_out=out, advise=False)

    return of


@pytest.mark.parametrize("name", [*(n for n in HIDDEN if n != "maxwell_branch"), *slow("maxwell_branch")])
def test_the_saved_model_leaves_the_gap_that_the_diagnosis_reports(found, tmp_path, name):
    campaign, out, result = found(name)
    assert result.effects, result.reason
    write_results(result, tmp_path / "out")
    assert read_model(tmp_path / "out") == result.whole
    again = verify(tmp_path / "out", campaign, draws=0)
    assert {run.name for run in again.runs} == set(out)
    # The same simulation of the same runs; channels are put right before the processing, and not after it.
    assert again.response_nrmse == pytest.approx(result.final.response, rel=0.02)
    assert again.moment_nrmse == pytest.approx(result.final.moment, rel=0.05)
    assert again.response_nrmse < 0.8 * result.initial.response


def test_effects_of_the_joint_are_elements_and_those_of_the_test_are_nuisances(found):
    joint = found("jenkins_element")[-1]
    (element,) = joint.whole.elements
    assert element.id == "jenkins_element" and not joint.test.nuisances
    assert element.parameters[0].interval95[0] < element.parameters[0].value
    test = found("channel_delay")[-1]
    (delay,) = test.test.nuisances
    assert delay.id == "channel_delay" and delay.number.unit == "s" and not test.whole.elements
    assert test.test.campaign.startswith("sha256:") and test.whole.fitted.data == test.test.campaign


def test_a_diagnosis_goes_on_from_the_whole_model(found):
    campaign, out, first = found("jenkins_element")
    again = diagnose(campaign, first.whole, hold_out=out, advise=False)
    assert again.verdict == "nothing_missing" and not again.steps
    assert again.initial.moment == pytest.approx(first.final.moment, rel=0.02)
    (element,), (before,) = again.whole.elements, first.whole.elements
    for number, old in zip(element.numbers, before.numbers, strict=True):
        assert number.value == pytest.approx(old.value, abs=2 * old.standard_error)


def test_presliding_found_in_a_structure_predicts_another_pulse():
    from sindyjoint.diagnosis import hide as hide_in_rig

    rig, generator = replace(load_rig("pulse-rig"), duration=4.0), np.random.default_rng(5)
    truth = hide_in_rig(rig, "dahl_friction")

    def tested(scale):
        response = replace(truth, excitation=truth.excitation.scaled(scale)).respond()
        record = Channel(noise=0.01).read(response.displacement["tip"], generator)
        measured = MeasuredResponse("tip", record, rig.sample_rate)
        return replace(rig, excitation=rig.excitation.scaled(scale), measured=measured)

    effects = select_effects(load_effects(), ["dahl_friction", "maxwell_branch", "cubic_damping"])
    result = diagnose_structure(tested(1.0), effects=effects, advise=False, max_effects=1)
    (element,) = result.whole.elements
    assert element.effect == "dahl_friction" and "coulomb_friction" not in result.whole
    other = tested(0.8)
    assert verify(result.model, other, draws=0).amplitude_rms_error > 0.05
    assert verify(result.whole, other, draws=0).amplitude_rms_error < 0.01


def test_the_command_line_passes_the_whole_model_on(tmp_path):
    hidden = hide("jenkins_element", 4, duration=2.0)
    manifest = write_campaign(hidden.campaign, tmp_path / "campaign")
    runner, folder = CliRunner(), str(tmp_path / "out")
    options = ["--no-advice", "--max-effects", "1", "--out", folder, "--quiet"]
    assert runner.invoke(make_app(), ["diagnose", str(manifest), *options]).exit_code == 0
    assert read_test(folder) is None  # nothing of the test was at fault
    made = runner.invoke(
        make_app(),
        ["simulate", "--model", folder, "--frequencies", "4", "--levels", "0.8", "--noise", "0.001"]
        + ["--out", str(tmp_path / "made")],
    )
    assert made.exit_code == 0, made.output
    checked = runner.invoke(make_app(), ["verify", folder, str(tmp_path / "made"), "--json", "--quiet"])
    assert checked.exit_code == 0, checked.output
    assert json.loads(checked.stdout)["response_nrmse"] < 0.01
