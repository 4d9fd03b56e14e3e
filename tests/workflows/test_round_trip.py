"""What a diagnosis saves has, when it is read and verified, the gap that the diagnosis told of runs kept out."""

from dataclasses import replace

import pytest

from sindyjoint import diagnose, verify
from tests.diagnosis.hidden_effects import hide
from tests.seeds import slow


def campaign(name, **fixed):
    """Return a campaign of four runs with something hidden, one of them of each frequency kept out."""
    hidden = hide(name, 3, duration=4.0, frequencies=(3.0, 5.0), levels=(0.5, 0.85), **fixed).campaign
    out = [run.name for i, run in enumerate(hidden.runs) if i in (1, 2)]
    return hidden, out


@pytest.fixture(autouse=True)
def few(few_effects):
    """What is hidden here: what is saved of a find is tested, and not the search."""
    few_effects("channel_delay", "angle_offset", "constant_moment", "jenkins_element", "bouc_wen_hysteresis",
                "moment_drift", "frequency_dependent_stiffness", "stiffness_drift")  # fmt: skip


@pytest.mark.parametrize(
    ("name", "drive"),
    [("angle_offset", "moment"), ("bouc_wen_hysteresis", "displacement"), ("moment_drift", "displacement")]
    # Those of diagnosis/test_whole_model.py, without the folder that a diagnosis writes.
    + slow(
        ("channel_delay", "displacement"),
        ("jenkins_element", "moment"),
        ("frequency_dependent_stiffness", "moment"),
    ),
)
def test_the_saved_model_has_the_gap_of_the_diagnosis(name, drive, tmp_path):
    runs, out = campaign(name, drive=drive)
    found = diagnose(runs, hold_out=out, advise=False)
    (tmp_path / "model.json").write_text(found.whole.to_json())
    again = verify(tmp_path / "model.json", runs, draws=0)
    assert [run.name for run in again.runs] == out
    assert again.moment_nrmse == pytest.approx(found.final.moment, rel=0.02)
    assert again.response_nrmse == pytest.approx(found.final.response, rel=0.02)
    # What was found is applied: without it the gap is another one, unless nothing was found.
    assert found.steps
    without = verify(replace(found.model, test=None), runs, draws=0)
    assert without.moment_nrmse > 1.1 * again.moment_nrmse


def test_a_stiffness_that_drifts_is_simulated_in_time(tmp_path):
    runs, out = campaign("stiffness_drift", drive="displacement")
    found = diagnose(runs, hold_out=out, advise=False)
    assert found.test.timed
    (tmp_path / "model.json").write_text(found.whole.to_json())
    again = verify(tmp_path / "model.json", runs, draws=0)
    assert again.moment_nrmse == pytest.approx(found.final.moment, rel=0.02)
    assert again.response_nrmse == pytest.approx(found.final.response, rel=0.02)
