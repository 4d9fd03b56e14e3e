"""A law with inputs beside measured runs: held at a run's values, followed along its motion, exported at values."""

import numpy as np
import pytest

from sindyjoint import Campaign, JointRegressor
from sindyjoint.diagnosis import input_effects
from sindyjoint.errors import InputError
from sindyjoint.export import export_model
from sindyjoint.inputs import Input
from sindyjoint.response import LawInRun, held_laws, law_in_run, simulate_run
from sindyjoint.states import force_states

T = np.arange(3000) / 500.0
ANGLE = 8e-4 * np.sin(2 * np.pi * 3 * T)
RATE = np.gradient(ANGLE, T)


def run_of(load):
    moment = 6000 * ANGLE + 40 * RATE + 0.02 * load * np.tanh(RATE / 1e-5)
    made = Campaign.from_arrays(
        moment=moment,
        angle=ANGLE,
        rate=500,
        frequency=3.0,
        inertia=0.0,
        inputs={"load": load},
        units={"load": "N"},
    )
    return made.runs[0], force_states(made.runs[0])


@pytest.fixture(scope="module")
def model():
    rng = np.random.default_rng(0)
    X = np.column_stack(
        [rng.uniform(-1, 1, (4000, 2)) * [8e-4, 0.016], np.repeat([60.0, 100.0, 150.0, 200.0], 1000)]
    )
    moment = 6000 * X[:, 0] + 40 * X[:, 1] + 0.02 * X[:, 2] * np.sign(X[:, 1]) + 0.01 * rng.normal(size=4000)
    return JointRegressor("paper", inputs=[Input("load", "N")]).fit(X, moment, runs=X[:, 2]).model_


def test_friction_in_proportion_to_a_load_is_one_term(model):
    assert "coulomb_friction_proportional_to_load" in model and "coulomb_friction" not in model
    assert model["mu_load"].coefficient == pytest.approx(0.02, rel=0.01) and model["mu_load"].unit == "m"


def test_a_law_is_held_at_the_load_of_its_run(model):
    run, states = run_of(np.full(T.size, 120.0))
    law = law_in_run(model, states)
    assert law.moment([0.0], [0.01], [1.0])[0] == pytest.approx(0.4 + 2.4, rel=0.01)
    simulated = simulate_run(law, run, states)
    assert simulated.drive == "motion" and simulated.moment_nrmse < 0.01


def test_a_load_that_moves_within_a_run_is_followed(model):
    run, states = run_of(130 + 60 * np.sin(2 * np.pi * 0.4 * T))
    law = law_in_run(model, states)
    assert isinstance(law, LawInRun) and law.moves == ("load",)
    assert simulate_run(law, run, states).moment_nrmse < 0.01
    assert simulate_run(law.law, run, states).moment_nrmse > 0.1
    with pytest.raises(InputError, match="load moves the law within run"):
        held_laws(model, [states])


def test_a_run_without_the_input_is_refused(model):
    made = Campaign.from_arrays(moment=40 * RATE, angle=ANGLE, rate=500, frequency=3.0, inertia=0.0)
    with pytest.raises(InputError, match="no value of 'load'"):
        law_in_run(model, force_states(made.runs[0]))


@pytest.mark.parametrize("target", ["ansys", "abaqus", "nastran", "python", "c", "mujoco", "json", "latex"])
def test_every_target_takes_a_law_with_inputs(model, target):
    made = export_model(model, target)
    text = "\n".join(str(content) for content in made.files.values())
    held = [row for row in made.fidelity if row.term == "load"]
    assert "load" in text and bool(held) == (target not in ("json", "latex"))
    # A parameter, or decks on a grid of values: friction in proportion to the load is straight between two of them.
    assert not held or (held[0].carried and held[0].error < 1e-12)


def test_diagnosis_is_offered_what_the_model_lacks(model):
    plain = model.at()
    offered = {e.id for e in input_effects([Input("signal", "V", levels=2, tested=(0.0, 2.0))], plain)}
    assert "linear_stiffness_by_signal" in offered and "cubic_stiffness_by_signal" not in offered
    assert not input_effects([Input("signal", "V", levels=1, tested=(1.0, 1.0))], plain)
