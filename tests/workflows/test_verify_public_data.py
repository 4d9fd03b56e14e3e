"""Verification of models of real joints, on data that is read from next to the checkout and never copied."""

from dataclasses import replace
from pathlib import Path

import pytest

from sindyjoint import diagnose, discover, load_campaign, verify
from sindyjoint.judgement.discovery import refined
from sindyjoint.response import refine

DATA = Path(__file__).parents[3] / "shared" / "data"

pytestmark = pytest.mark.shared


def folder(name):
    path = DATA / name
    if not path.is_dir():
        pytest.skip(f"the public data set {name!r} is not next to this checkout")
    return path


@pytest.fixture(scope="module")
def emps():
    return discover(
        folder("emps"),
        library=["paper", "measurement"],
        forced=("linear_damping", "coulomb_friction", "constant_moment"),
        forbidden=("linear_stiffness", "quadratic_stiffness", "cubic_stiffness"),
    )


def test_emps_by_windows_and_by_force(emps):
    found = emps
    result = verify(found.model, found.campaign, draws=0)
    assert result.runs[0].drive == "windows"
    # Others report 4.08 % relative force error for these four terms, and 3.1 % for direction-dependent ones.
    assert 0.03 < result.moment_nrmse < 0.045
    # Restarted every second from the measured state: measured 1.9 % of the position's RMS.
    assert result.response_nrmse < 0.03 and result.passed
    longer = verify(found.model, found.campaign, draws=0, window=5.0)
    assert longer.response_nrmse > 2 * result.response_nrmse


def test_emps_runs_freely_for_its_whole_record(emps):
    result = verify(emps.model, emps.campaign, draws=0, free_run=200)
    (run,) = result.runs
    assert run.drive == "free run" and run.rmse_unit == "m" and run.time[-1] > 24
    # In-sample: the owners' four parameters leave 7.5 mm, refitted 6.1 mm. Measured 3.96 mm.
    assert run.rmse < 4.5e-3


@pytest.mark.slow  # of made data: test_round_trip.py
def test_half_of_the_friction_damper_predicts_the_other_half(tmp_path):
    campaign = load_campaign(folder("friction-damper"))
    kept = [run.name for run in campaign.runs[1::2]]
    found = diagnose(campaign, hold_out=kept, advise=False)
    (tmp_path / "model.json").write_text(found.whole.to_json())
    result = verify(tmp_path / "model.json", campaign, draws=0)
    assert [run.name for run in result.runs] == kept and {run.rmse_unit for run in result.runs} == {"kip"}
    # Play before friction. Measured 21.1 %, by run 11.4 to 40 %.
    assert result.moment_nrmse < 0.25
    assert result.moment_nrmse == pytest.approx(found.final.moment, rel=0.02)


def test_emps_is_refined_by_windows_with_a_state_of_their_own(emps):
    found = refine(emps.model, emps.campaign, states=emps.states, window=1.0)
    assert found.refined
    # Measured: 1.85 % of the position's RMS before, 0.55 % after.
    assert found.after["DATA_EMPS"] < 0.008 < 0.012 < found.before["DATA_EMPS"]
    # Published by the inverse dynamic model, of which this is no part: 95.1 kg, 203.5 N·s/m, 20.4 N. The rig is under
    # feedback, so the force holds the position's noise, and the two methods differ by a few per cent.
    for id, value, share in (
        ("inertia", 95.1, 0.06),
        ("linear_damping", 203.5, 0.08),
        ("coulomb_friction", 20.4, 0.08),
    ):
        assert found.model[id].coefficient == pytest.approx(value, rel=share)


def test_friction_damper_by_force_on_the_measured_motion():
    campaign = load_campaign(folder("friction-damper"))
    one = campaign.with_runs(tuple(run for run in campaign.runs if run.name == "0.5Hz_1in"))
    terms = ("linear_stiffness", "linear_damping", "coulomb_friction")
    found = discover(one, library="paper", forced=terms, forbidden=("quadratic_stiffness", "cubic_stiffness"))
    result = verify(found.model, one, draws=0)
    (fitted_run,) = result.runs
    assert (fitted_run.drive, fitted_run.channel, fitted_run.seen) == ("motion", "force", True)
    # Others report 0.419 for these three terms on this run: after each reversal the damper has play.
    assert fitted_run.response_nrmse == pytest.approx(0.419, abs=0.05) and not result.passed


def test_pendulum_swings_past_its_softening_limit_without_snapping():
    found = discover(folder("pendulum"), library="paper")
    result = verify(found.model, found.campaign, draws=0)
    run = result.runs[0]
    assert run.drive == "moment" and not run.failure
    assert result.mean_period_difference < 0.01 and result.amplitude_rms_error < 0.1


def test_emps_refined_over_a_mean_cycle_runs_freely_over_what_was_not_fitted():
    campaign = load_campaign(folder("emps"))
    (run,) = campaign.runs
    cut = round(2 / 3 * run.n_samples)
    parts = [(slice(cut), "identify"), (slice(cut, None), "validate")]
    runs = tuple(
        replace(run, name=use, use=use, source=None, moment=run.moment[part], angle=run.angle[part])
        for part, use in parts
    )
    campaign = campaign.with_runs(runs)
    found = refined(discover(campaign, align=True))
    for samples in (20, 100):
        (last,) = verify(found.model, campaign, draws=0, free_run=samples).runs
        # Measured 3.8 mm, 4.5 before the refinement; over the official test the best published figure is 5.17.
        assert last.name == "validate" and last.rmse < 4e-3
