"""Verification: what passes, what fails, which warnings, on runs and on the pulse rig."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import simulate, verify
from sindyjoint.errors import InputError, MissingInputError, UnitError
from sindyjoint.files import write_campaign
from sindyjoint.mechanics import INTER_PANEL, load_rig, presliding_law, virtual_pulse_test
from tests.conftest import RIGS
from tests.made_models import model_of, paper_model, term

KEYS = [
    "schema",
    "verdict",
    "trust",
    "response_nrmse",
    "moment_nrmse",
    "noise_floor",
    "amplitude_rms_error",
    "mean_period_difference",
    "free_run",
    "runs",
    "warnings",
]


@pytest.fixture(scope="module")
def campaign():
    return simulate(frequencies=[3, 5], levels=[0.85, 0.5], duration=5.0, random_state=2)


# ---- the pulse rig


@pytest.mark.parametrize("seed", [0, 1])
def test_the_pulse_passes_where_the_truth_holds_nothing_else(seed):
    # Coefficients off by about their standard errors, as an identification at 1 % noise leaves them.
    off = 1 + np.array([3e-4, 4e-3, -2e-3, 9e-4, -7e-4])
    model = paper_model(values=tuple(off * paper_model().coefficients))
    result = verify(model, "pulse-rig", draws=0, random_state=seed)
    assert result.verdict == "passed" and result.response_nrmse < 0.015
    assert result.mean_period_difference < 0.002
    assert result.amplitude_rms_error < 0.02
    assert result.noise_floor == pytest.approx(0.01, rel=0.05)


@pytest.mark.parametrize(
    ("truth", "amplitude", "period"),
    [
        ({"presliding": 5e-5}, 0.08, 0.003),
        ({"presliding": 2e-5}, 0.06, 0.0015),
        ({"loss_factor": 0.008}, 0.06, 0.0),
    ],
)
def test_the_pulse_fails_where_the_truth_holds_more(truth, amplitude, period):
    result = verify(paper_model(), "pulse-rig", draws=0, **truth)
    assert result.verdict == "failed"
    assert result.amplitude_rms_error > amplitude and result.mean_period_difference > period
    assert any("which the simulation does not know" in warning for warning in result.warnings)


def test_the_band_holds_the_truth_and_grows_with_the_errors():
    narrow = verify(paper_model(2e-3), "pulse-rig", draws=8).runs[0]
    wide = verify(paper_model(2e-2), "pulse-rig", draws=8).runs[0]
    truth = load_rig("pulse-rig").respond().displacement["tip"]
    early = slice(100, 2000)
    width = [np.mean((run.band.high - run.band.low)[early]) for run in (narrow, wide)]
    assert 5 < width[1] / width[0] < 20
    inside = (truth >= wide.band.low) & (truth <= wide.band.high)
    # Eight draws tell a standard deviation within 27 %; 95 % is nominal.
    assert inside[early].mean() > 0.85
    assert narrow.band.draws == 8 and narrow.band.failed == 0


def test_energy_per_cycle_adds_up_to_what_the_pulse_brought():
    result = verify(paper_model(), "pulse-rig", draws=0)
    measured, simulated = result.runs[0].energy
    response = load_rig("pulse-rig").respond()
    first = result.runs[0].oscillations[1].amplitude_time[0]
    at_first = np.interp(first, response.time, response.energy)
    # The energy lost from the first half-cycle on is the initial one less the residual one after 20 s.
    assert simulated.sum() == pytest.approx(at_first - response.energy[-1], rel=0.01)
    assert measured.sum() == pytest.approx(simulated.sum(), rel=0.02)


def test_the_model_takes_the_places_that_bear_its_name():
    # Three inter-panel joints of the wing take the model; the root keeps its law.
    result = verify(paper_model(), "four-panel-wing", draws=0)
    assert result.verdict == "passed" and result.kind == "rig"


def test_a_joint_by_another_name_has_no_place_among_several():
    with pytest.raises(
        InputError, match=r"4 joints, none of them a 'hinge'; write law = \"model\" for those"
    ):
        verify(paper_model(name="hinge"), "four-panel-wing", draws=0)


def test_a_softer_model_that_snaps_through_fails_in_words():
    values = list(paper_model().coefficients)
    values[2] *= 8
    result = verify(paper_model(values=tuple(values)), "pulse-rig", draws=4)
    assert result.verdict == "failed" and result.response_nrmse is None
    assert any("joint 'joint' left its angle range" in warning for warning in result.warnings)
    assert "did not reach its end" in result.reason


def measured_rig(folder, law="model", unit="mm", factor=1e3, **options):
    """Write the pulse rig with a measured response next to it."""
    test = virtual_pulse_test(load_rig("pulse-rig"), **options)
    np.savetxt(
        folder / "tip.csv",
        np.column_stack([test.time, factor * test.displacement]),
        delimiter=",",
        header="t,w",
        comments="",
    )
    text = (RIGS / "pulse-rig.toml").read_text().replace('law = "inter-panel"', f'law = "{law}"')
    text += '\n[measured]\nfile = "tip.csv"\npoint = "tip"\ntime = { column = "t", unit = "s" }\n'
    text += f'displacement = {{ column = "w", unit = "{unit}" }}\n'
    path = folder / "rig.toml"
    path.write_text(text)
    return path


def test_a_measured_response_is_read_and_compared(tmp_path):
    result = verify(paper_model(name="hinge"), measured_rig(tmp_path), draws=0)
    assert result.verdict == "passed" and result.response_nrmse == pytest.approx(0.01, rel=0.1)
    assert result.warnings == ()
    other = verify(paper_model(), measured_rig(tmp_path, presliding=5e-5), draws=0)
    assert other.verdict == "failed"


def test_a_measured_response_leaves_no_room_for_a_virtual_one(tmp_path):
    with pytest.raises(
        InputError, match=r"noise: belong\(s\) to a virtual pulse test; the rig 'pulse rig' names a measured"
    ):
        verify(paper_model(), measured_rig(tmp_path), noise=0.01)


def test_a_measured_response_in_another_unit_is_refused(tmp_path):
    with pytest.raises(UnitError, match=r"tip.csv: displacement.*'N'"):
        verify(paper_model(), measured_rig(tmp_path, unit="N"))


def test_a_rig_for_a_model_needs_a_truth(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text((RIGS / "pulse-rig.toml").read_text().replace('"inter-panel"', '"model"'))
    with pytest.raises(InputError, match="a virtual test needs the true law; add a \\[measured\\] table"):
        verify(paper_model(), path)


def test_presliding_is_a_spring_that_yields_to_the_friction_moment():
    law = presliding_law(INTER_PANEL, 5e-5)
    assert law.n_states == 1
    # The state tends to the direction of slip, at a rate of one over the presliding angle.
    zero, one = np.zeros(1), np.ones(1)
    assert law.state_rate(zero, 0.01 * one, one, np.zeros((1, 1)))[0, 0] == pytest.approx(0.01 / 5e-5)
    assert law.state_rate(zero, 0.01 * one, one, np.ones((1, 1)))[0, 0] == 0.0
    assert law.moment(zero, 0 * one, one, np.ones((1, 1)))[0] == pytest.approx(INTER_PANEL.M_F)
    with pytest.raises(InputError, match="presliding angle is 0.0 rad; expected a finite number above zero"):
        presliding_law(INTER_PANEL, 0.0)


# ---- campaigns


def test_the_true_model_passes_on_runs(campaign):
    result = verify(paper_model(), campaign, draws=6)
    record = result.to_dict()
    assert list(record) == [*KEYS, "soundness"] and json.loads(json.dumps(record, allow_nan=False)) == record
    keys = ["name", "response_nrmse", "moment_nrmse", "rmse", "rmse_unit", "seen"]
    assert [list(run) for run in record["runs"]] == [keys] * 4 and record["free_run"] is None
    assert result.verdict == "passed" and result.kind == "campaign"
    assert result.response_nrmse == pytest.approx(0.01, rel=0.1)
    assert result.moment_nrmse == pytest.approx(0.01, rel=0.1)
    run = result.runs[0]
    assert run.band.low.shape == run.measured.shape and run.energy.shape[0] == 2
    np.testing.assert_allclose(run.energy[1], run.energy[1].mean(), rtol=0.01)


def test_a_joint_six_per_cent_stiffer_fails(campaign):
    values = paper_model().coefficients * [1.06, 1, 1, 1, 1]
    result = verify(paper_model(values=tuple(values)), campaign, draws=0)
    assert result.verdict == "failed" and result.response_nrmse > 0.05
    assert any("lies beyond the noise, the most of all runs" in warning for warning in result.warnings)


def test_only_runs_kept_for_validation_are_compared(campaign):
    marked = campaign.with_runs(
        tuple(replace(run, use="validate" if run.name == "5Hz-0.5" else "identify") for run in campaign.runs)
    )
    result = verify(paper_model(), marked, draws=0)
    assert [run.name for run in result.runs] == ["5Hz-0.5"]
    assert len(verify(paper_model(), campaign, draws=0).runs) == len(campaign.runs)


def test_a_stricter_tolerance_changes_the_verdict(campaign):
    values = tuple(paper_model().coefficients * [1.01, 1, 1, 1, 1])
    assert verify(paper_model(values=values), campaign, draws=0).passed
    assert not verify(paper_model(values=values), campaign, draws=0, tolerance=0.002).passed


def test_a_free_run_has_no_restart_and_an_error_in_the_unit_of_the_file(campaign, tmp_path, sindyjoint):
    mixed = campaign.with_runs(campaign.runs[:2])
    write_campaign(mixed, tmp_path)
    manifest = tmp_path / "campaign.toml"
    # The same numbers, said to be volts of 2 rad each.
    declared = 'angle = { column = "angle", unit = "rad" }'
    assert declared in manifest.read_text()
    volts = 'angle = { column = "angle", unit = "V", gain = "2 rad/V" }'
    manifest.write_text(manifest.read_text().replace(declared, volts))
    folder = tmp_path / "model"
    folder.mkdir()
    # A joint that moves by twice as much under the same moment.
    k1, k2, k3, c1, friction = paper_model().coefficients
    values = k1 / 2, k2 / 4, k3 / 8, c1 / 2, friction
    (folder / "model.json").write_text(paper_model(values=values, inertia=0.01).to_json())
    answer = sindyjoint("verify", folder, manifest, "--draws", 0, "--free-run", 1000, "--json")
    record = json.loads(answer.stdout)
    assert record["free_run"] == 1000 and "first 1000 samples" in " ".join(record["warnings"])
    for run, source in zip(record["runs"], mixed.runs, strict=True):
        assert run["rmse_unit"] == "V"
        assert run["rmse"] == pytest.approx(run["response_nrmse"] * np.std(source.angle[1000:]), rel=0.05)
        assert run["response_nrmse"] < 0.02
    shown = sindyjoint("verify", folder, manifest, "--draws", 0, "--free-run", 1000).stdout
    assert "free run" in shown and "µV" in shown


def test_a_free_run_belongs_to_a_campaign(sindyjoint, model_file):
    answer = sindyjoint("verify", model_file, "pulse-rig", "--free-run", 100)
    assert answer.status == 2 and "free_run is 100: belongs to a campaign" in answer.stderr


def test_the_same_seed_gives_the_same_band(campaign):
    first, second = (verify(paper_model(), campaign, draws=5, random_state=9).runs[0].band for _ in range(2))
    np.testing.assert_array_equal(first.low, second.low)


def test_differences_between_model_and_campaign_are_said(campaign):
    model = paper_model(inertia=0.05, name="other joint")
    warnings = verify(model, campaign, draws=0).warnings
    assert "the model is of the joint 'other joint', the campaign of 'inter-panel joint'" in warnings
    assert "the campaign declares the inertia 0.02, the model has 0.05" in warnings
    with pytest.raises(
        InputError, match="the model is of a joint in translation, the campaign of one in rotation"
    ):
        verify(paper_model(motion="translation"), campaign)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 0}, "tolerance is 0; expected a number above zero"),
        ({"draws": -1}, "draws is -1; expected a number that is not negative"),
        (
            {"presliding": 1e-5},
            r"presliding: belong\(s\) to a virtual pulse test of a rig; a campaign is given",
        ),
    ],
)
def test_options_that_cannot_be_used(campaign, options, message):
    with pytest.raises(InputError, match=message):
        verify(paper_model(), campaign, **options)


def test_an_impossible_inertia_is_refused_with_its_causes(campaign):
    terms = [*paper_model().terms, term("inertia", "alpha", -0.05, 0.01)]
    with pytest.raises(
        InputError, match="inertia is negative, -0.05 kg.*, which is impossible: runs in diff"
    ):
        verify(model_of(terms, inertia=None), campaign, draws=0)


def test_a_model_without_terms_is_refused(campaign):
    with pytest.raises(
        InputError, match="the model has no terms: there is nothing to simulate; run discover first"
    ):
        verify(model_of([]), campaign)


# ---- the command line


def test_command_against_a_rig(sindyjoint, model_file, tmp_path):
    answer = sindyjoint(
        "verify", model_file.parent, "pulse-rig", "--draws", 0, "--json", "--out", tmp_path / "out"
    )
    assert answer.status == 0 and answer.stderr == ""
    assert list(json.loads(answer.stdout)) == KEYS
    files = sorted(path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*.*"))
    assert files == [
        "figures/cycles.svg",
        "figures/data.json",
        "figures/energy.svg",
        "figures/envelope.svg",
        "figures/error.svg",
        "figures/period.svg",
        "figures/response.svg",
        "model.json",
        "report.html",
        "verification.json",
    ]
    details = json.loads((tmp_path / "out" / "verification.json").read_text())
    assert len(details["runs"][0]["cycles"]["measured"]["period"]) > 150


def test_command_fails_with_status_one(sindyjoint, model_file):
    answer = sindyjoint("verify", model_file, "pulse-rig", "--draws", 0, "--loss-factor", 0.01)
    assert answer.status == 1
    assert ": failed\n" in answer.stdout and "beam loss factor 0.01" in " ".join(answer.stdout.split())


def test_command_against_a_campaign_on_disk(sindyjoint, model_file, campaign, tmp_path):
    write_campaign(campaign, tmp_path / "runs")
    answer = sindyjoint("verify", model_file, tmp_path / "runs", "--draws", 0)
    assert answer.status == 0 and ": passed\n" in answer.stdout and "5Hz-0.85" in answer.stdout


def test_missing_model_is_a_missing_file(tmp_path):
    with pytest.raises(MissingInputError):
        verify(tmp_path / "model.json", "pulse-rig")


def test_a_model_with_a_new_formula_goes_into_the_rig():
    model = model_of([*paper_model().terms, term("quadratic_damping", "omega*abs(omega)", 0.0)])
    assert verify(model, "pulse-rig", draws=0).passed
