"""Time delay between the channels: found within its error, undone by shifting."""

import numpy as np
import pytest

from sindyjoint.discovery.delay import estimate_delay, reference_of, shifted
from sindyjoint.equation.catalogue import load_catalogue
from sindyjoint.mechanics.virtual import virtual_campaign
from sindyjoint.states import campaign_states

PLAN = dict(frequencies=[3, 5], levels=[0.9, 0.5], duration=4.0, noise=0.01, random_state=0)


@pytest.mark.parametrize("drive", ["moment", "displacement"])
@pytest.mark.parametrize("skew", [0.0, 1e-3, -4e-4])
def test_skew_is_found(drive, skew):
    states = campaign_states(virtual_campaign(drive=drive, skew=skew, **PLAN))
    law = load_catalogue("paper").resolve(reference_of(states))
    found = estimate_delay(states, law, 0.02)
    # stated: 0.02 ms is the error of the method at 1 % noise, added to the standard error
    assert abs(found.time - skew) < 2e-5 + 4 * found.standard_error
    assert found.significant == (abs(skew) > 2e-5)


def test_shifting_by_zero_is_nothing_and_by_a_sample_is_a_sample():
    states = campaign_states(virtual_campaign(**PLAN))[0]
    assert shifted(states, 0.0) is states
    moved = shifted(states, 1 / states.sample_rate)
    np.testing.assert_allclose(moved.angle[10:-10], states.angle[9:-11], atol=1e-12)
    assert moved.moment is states.moment
    assert moved.moving.sum() <= states.moving.sum()
