"""Refinement of a law that depends on an input: each run is simulated at its own value."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import JointRegressor
from sindyjoint.inputs import Input
from sindyjoint.mechanics import INTER_PANEL, virtual_campaign
from sindyjoint.response import refine
from sindyjoint.states import campaign_states, regression_rows

TEMPERATURES = (250.0, 290.0, 330.0)
SLOPE = -8.0


@pytest.fixture(scope="module")
def campaign():
    runs, generator = [], np.random.default_rng(4)
    for value in TEMPERATURES:
        law = replace(INTER_PANEL, k1=INTER_PANEL.k1 + SLOPE * (value - 290.0))
        made = virtual_campaign(
            law,
            noise=0.01,
            frequencies=[4],
            levels=[0.8, 0.4],
            duration=2.0,
            angle_limit=7e-4,
            random_state=generator,
        )
        runs += [replace(r, name=f"{r.name} {value}", inputs={"temperature": value}) for r in made.runs]
    return replace(made, runs=tuple(runs), inputs=(Input("temperature", "K"),))


@pytest.fixture(scope="module")
def model(campaign):
    rows = regression_rows(campaign_states(campaign), campaign.joint.inertia)
    fitted = JointRegressor("paper", inputs=campaign.inputs, threshold=0.0).fit(**rows.fit_arguments())
    return replace(fitted.model_, joint=campaign.joint)


def test_a_dependence_is_refined_on_the_response_of_runs_at_their_own_inputs(campaign, model):
    off = model.numbers.copy()
    place = model.ids.index("linear_stiffness_by_temperature")
    off[model.ids.index("linear_stiffness")] *= 1.03
    off[place] *= 0.6
    result = refine(model.with_numbers(off), campaign)
    assert result.refined, result.reason
    assert max(result.after.values()) < 0.03 < max(result.before.values())
    found = result.model["linear_stiffness_by_temperature"]
    assert found.coefficient == pytest.approx(SLOPE, abs=4 * found.standard_error + 0.1)
    assert result.model["k1"].coefficient == pytest.approx(INTER_PANEL.k1, rel=0.01)
