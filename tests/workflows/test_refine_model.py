"""Doors of refinement: a given model on a campaign, the whole model of a diagnosis, and what each refuses."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import diagnose, verify
from sindyjoint.diagnosis import load_effects, select_effects
from sindyjoint.diagnosis.campaign import refined as refined_numbers
from sindyjoint.diagnosis.campaign.problem import CampaignProblem
from sindyjoint.diagnosis.campaign.refined import simulated_gap
from sindyjoint.equation import Nuisance, TestNuisances, read_model
from sindyjoint.errors import InputError
from sindyjoint.files import write_campaign
from sindyjoint.states import content_hash
from sindyjoint.workflows import refine
from tests.response.test_refine_elements import (
    LAW,
    SLIDER,
    STIFFNESS,
    TRUTH,
    YIELD,
    campaign,
    jenkins,
    model_with,
    value,
)


def made(**options):
    return campaign(SLIDER, levels=[1.0], **options)


def wrong_model():
    return model_with(jenkins(1.2 * STIFFNESS, 0.8 * YIELD), 1.01)


def test_a_given_model_is_refined_and_stands_beside_the_response():
    runs = made()
    kept = runs.with_runs((runs.runs[0], replace(runs.runs[1], use="validate")))
    result = refine(wrong_model(), kept)
    assert result.refined and result.passed and [run.name for run in result.runs] == [runs.runs[1].name]
    assert np.all(np.abs(result.model.numbers - TRUTH) < 4 * result.model.number_errors)
    assert result.before.numbers == pytest.approx(wrong_model().numbers)
    # What it was fitted to is what this campaign tested, and is known by its hash.
    fitted = result.model.fitted
    assert fitted.data == content_hash(kept) and fitted.runs == 1
    assert fitted.angle == pytest.approx(np.abs(runs.runs[0].angle).max(), rel=0.05)
    record = result.to_dict()["refinement"]
    assert [row["number"] for row in record["numbers"]][3:] == [
        "k_t of jenkins_element",
        "theta_y of jenkins_element",
    ]


def test_a_test_beside_the_model_as_earlier_versions_left_it_is_applied(tmp_path):
    shifted, delay = made(skew=1e-3), value("tau", 1e-3, "s")
    test = TestNuisances(content_hash(shifted), LAW.name, (Nuisance("channel_delay", "time shift", delay),))
    (tmp_path / "model.json").write_text(wrong_model().to_json())
    (tmp_path / "test.json").write_text(test.to_json())
    right = refine(tmp_path, shifted)
    assert np.all(np.abs(right.model.numbers - TRUTH) < 4 * right.model.number_errors)
    assert right.model.test == test and any(
        "put right, as found in this campaign" in w for w in right.warnings
    )
    # A millisecond that nobody takes out looks like damping.
    left = refine(wrong_model(), shifted)
    assert abs(left.model.numbers[1] - LAW.c1) > 10 * left.model.number_errors[1] and left.model.test is None


def test_an_estimated_delay_becomes_a_part_of_the_test(sindyjoint, tmp_path):
    write_campaign(made(skew=1e-3), tmp_path / "tests")
    (tmp_path / "model.json").write_text(wrong_model().to_json())
    answer = sindyjoint(
        "discover", tmp_path / "tests", "--refine", "--model", tmp_path / "model.json", "--nuisance", "delay",
        "--out", tmp_path / "out",
    )  # fmt: skip
    text = " ".join(answer.stdout.split())
    assert answer.status == 0, answer.stderr
    assert (
        "theta y of jenkins element" in text.lower()
        and "estimated together with the coefficients: delay" in text
    )
    (found,) = read_model(tmp_path / "out").test.nuisances
    assert found.enters == "time shift" and found.number.value == pytest.approx(1e-3, abs=5e-5)
    later = read_model(tmp_path / "out")
    assert np.all(np.abs(later.numbers - TRUTH) < 4 * later.number_errors)
    assert "Numbers of the model before and after" in (tmp_path / "out" / "report.html").read_text()
    # The door of verification applies it, too, and finds the same response error.
    saved = json.loads((tmp_path / "out" / "verification.json").read_text())
    again = verify(tmp_path / "out", tmp_path / "tests", draws=0)
    assert again.response_nrmse == pytest.approx(saved["response_nrmse"], rel=1e-6)


def test_a_diagnosis_is_refined_unless_its_response_gap_would_grow(monkeypatch):
    runs = campaign(SLIDER, "displacement", levels=[1.0, 0.5])
    effects = select_effects(load_effects(), ["jenkins_element"])
    asked = diagnose(runs, effects=effects, advise=False)
    # Runs that repeat have rounded off the slider's corners: a law with one is refined unasked.
    monkeypatch.setattr(CampaignProblem, "better_simulated", False)
    before = diagnose(runs, effects=effects, advise=False)
    after = diagnose(runs, effects=effects, advise=False, refine=True)
    assert asked.whole.numbers.tolist() == after.whole.numbers.tolist()
    assert [e.id for e in after.whole.elements] == ["jenkins_element"]
    assert after.whole.numbers.tolist() != before.whole.numbers.tolist()
    # Steps, terms and effects are those of the refined model.
    (element,) = after.whole.elements
    assert after.steps[-1].parameters == pytest.approx({n.name: n.value for n in element.numbers})
    assert after.model.coefficients.tolist() == after.whole.coefficients.tolist()
    assert after.steps[-1].gap_after == after.final
    # That of the whole model, as a verification has it; the diagnosis reads the same figure off its effects.
    gap = simulated_gap(before.whole, runs, before.test)
    assert gap == pytest.approx(before.final.response, rel=0.02)
    assert after.final.response == pytest.approx(simulated_gap(after.whole, runs, after.test), rel=1e-12)
    assert after.final.response <= 1.005 * gap
    verified = verify(after.whole, runs, draws=0)
    assert verified.response_nrmse == pytest.approx(after.final.response, rel=1e-9)

    honest = refined_numbers.refine

    def worse(model, *args, **options):
        found = honest(model, *args, **options)
        return replace(found, model=found.model.with_numbers(1.05 * found.model.numbers))

    monkeypatch.setattr(refined_numbers, "refine", worse)
    refused = diagnose(runs, effects=effects, advise=False, refine=True)
    assert refused.whole.numbers.tolist() == before.whole.numbers.tolist()
    assert refused.final == before.final
    assert any("the refinement on the simulated response is not used" in w for w in refused.warnings)


def test_what_no_refinement_can_do_is_refused(sindyjoint, tmp_path):
    write_campaign(made(), tmp_path / "tests")
    (tmp_path / "model.json").write_text(wrong_model().to_json())
    alone = sindyjoint("discover", tmp_path / "tests", "--model", tmp_path / "model.json")
    assert alone.status == 2 and "belongs to --refine; add --refine, or leave it out" in alone.stderr
    rig = sindyjoint("diagnose", "pulse-rig", "--refine")
    assert rig.status == 2 and "--refine is for campaigns; pulse-rig is a rig" in rig.stderr
    with pytest.raises(InputError, match="the model has no terms: there is nothing to refine"):
        refine(replace(wrong_model(), terms=(), elements=(), covariance=()), made())
