"""What a run is expected to tell is what repeated tests show."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.equation import INERTIA, load_catalogue, model_terms
from sindyjoint.errors import InputError
from sindyjoint.mechanics import INTER_PANEL
from sindyjoint.planning import (
    Information,
    PlannedRun,
    Sensors,
    changes_over_band,
    half_widths,
    like_law,
    play,
    run_information,
    stacked,
)
from sindyjoint.states import force_states

MODEL = like_law(INTER_PANEL).model


@pytest.mark.parametrize("drive, level, unit", [("moment", 4.5, "N*m"), ("angle", 6e-4, "rad")])
@pytest.mark.parametrize("kind", ["plain", "read in steps", "inertia identified"])
def test_the_scatter_of_repeated_tests_is_the_expected_one(drive, level, unit, kind):
    # Truth: 40 tests of the joint, each with its own noise, through the real processing.
    steps = {"moment": 0.08, "angle": 1.2e-5} if kind == "read in steps" else {}
    sensors = Sensors(500.0, 0.01, **{f"{name}_resolution": step for name, step in steps.items()})
    # An inertia needs two frequencies.
    model, frequencies = (with_inertia(MODEL), (4.0, 7.0)) if "inertia" in kind else (MODEL, (4.0,))
    runs = [PlannedRun(drive, "sine", f, level * 0.97 ** (f - 4.0), unit, 3.0) for f in frequencies]
    rng = np.random.default_rng(1)
    clean = play(INTER_PANEL, runs, Sensors(500.0, 1e-9), rng).runs
    found = [fit([noisy(run, steps, rng) for run in clean], model) for _ in range(40)]
    told = stacked([run_information(run, model, sensors) for run in runs])
    inverse = np.linalg.inv(told.bread.sum(axis=0))
    expected = np.sqrt(np.diag(inverse @ told.meat.sum(axis=0) @ inverse))
    # The scatter of 40 has an error of 11 %; which harmonics are kept differs from test to test.
    assert np.std(found, axis=0, ddof=1) / expected == pytest.approx(np.ones(len(model.terms)), abs=0.4)


def noisy(run, steps, rng):
    """The run with 1 % of noise, read in steps where there are any."""
    read = {}
    for name, signal in (("moment", run.moment), ("angle", run.angle)):
        values = np.array(signal) + 0.01 * np.std(signal) * rng.standard_normal(signal.size)
        read[name] = np.round(values / steps[name]) * steps[name] if steps else values
    return type(run)("r", sample_rate=500.0, frequency=run.frequency, **read)


def fit(runs, model):
    """The coefficients by least squares."""
    rows, targets = [], []
    for run in runs:
        states = force_states(run, "periodic")
        t, w, a, m = (getattr(states, n)[states.moving] for n in ("angle", "rate", "acceleration", "moment"))
        columns = [t, t**2, t**3, w, np.sign(w)]
        rows.append(np.column_stack(columns if model is MODEL else [*columns, a]))
        targets.append(m - INTER_PANEL.inertia * a if model is MODEL else m)
    columns = np.vstack(rows)
    scale = np.linalg.norm(columns, axis=0)
    return np.linalg.lstsq(columns / scale, np.concatenate(targets))[0] / scale


def with_inertia(model):
    """The model with the inertia of the joint as a term."""
    inertia = load_catalogue("inertia").select([INERTIA]).resolve()
    terms = model_terms(
        inertia, np.array([model.inertia]), np.zeros((1, 1)), np.full(1, np.nan), 1, "rotation"
    )
    whole = replace(model, joint=replace(model.joint, inertia=None))
    return whole.with_terms([*model.terms, *terms], np.zeros((6, 6)))


def test_a_run_without_motion_tells_nothing():
    stuck = PlannedRun("moment", "sine", 4.0, 1.0, "N*m", 5.0)  # below the friction of 1.87 N·m
    told = stacked([stacked([run_information(stuck, MODEL, Sensors())])])
    assert not told.bread.any() and np.isinf(half_widths(told)).all()


def test_a_run_of_too_few_periods_is_refused():
    with pytest.raises(InputError, match=r"a run of 0\.5 s has 1 steady periods of 4 Hz"):
        run_information(PlannedRun("moment", "sine", 4.0, 4.0, "N*m", 0.5), MODEL, Sensors())


def alike(runs):
    """Information of equal runs on one joint with two coefficients."""
    eye = np.tile(np.eye(2), (runs, 1, 1, 1))
    return Information(100 * eye, 100 * eye, np.full((runs, 1), 8.0))


def test_four_times_the_runs_halve_the_interval():
    # Of white noise of variance one: var = 1/(100 n); t and n/(n − p) tend to 1.96 and 1.
    many, few = half_widths(alike(64)), half_widths(alike(16))
    assert many == pytest.approx(few / 2, rel=0.03)
    assert many == pytest.approx(1.96 / np.sqrt(6400), rel=0.01)


def test_the_scatter_of_reported_intervals_is_that_of_their_blocks():
    drawn = half_widths(alike(4), np.random.default_rng(0), 4000)
    # Standard error from 28 degrees of freedom: relative scatter 1/√56.
    assert np.std(drawn) / np.mean(drawn) == pytest.approx(56**-0.5, rel=0.15)


def test_a_change_over_the_band_needs_three_frequencies():
    assert np.isinf(changes_over_band(alike(4), [2.0, 2.0, 5.0, 5.0])).all()
    wide = changes_over_band(alike(6), [2.0, 2.0, 5.0, 5.0, 8.0, 8.0])
    # A line through three estimates of equal variance v: the change over the band has the variance 2 v.
    one = half_widths(alike(2))
    assert wide == pytest.approx(np.sqrt(2) * one)
