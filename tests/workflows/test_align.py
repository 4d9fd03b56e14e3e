"""A delay between the channels is removed where that is asked for: in every command that takes a campaign."""

import re

import pytest

from sindyjoint import discover
from sindyjoint.discovery.delay import align_channels, find_delay
from sindyjoint.errors import InputError
from sindyjoint.mechanics.virtual import virtual_campaign
from sindyjoint.states import campaign_states
from sindyjoint.workflows.compare import compare
from sindyjoint.workflows.diagnose import diagnose
from sindyjoint.workflows.verify import verify

PLAN = {
    "frequencies": [3.0, 4.0, 5.0],
    "levels": [0.9, 0.6],
    "noise": 0.005,
    "duration": 4.0,
    "random_state": 4,
}
LATE = 1e-3  # s; a sample of the virtual test


@pytest.fixture(scope="module")
def late():
    return virtual_campaign("inter-panel", skew=LATE, **PLAN)


def test_the_delay_goes_and_is_noted(late):
    assert find_delay(campaign_states(late), late.joint.inertia).time == pytest.approx(LATE, rel=0.05)
    aligned = align_channels(late)
    rest = find_delay(campaign_states(aligned), late.joint.inertia)
    assert abs(rest.time) < 0.05 * LATE
    assert re.fullmatch(
        r"the moment lags the angle by (0.9[5-9]|1.0[0-5]).* ms; the channels were aligned", aligned.notes[-1]
    )
    assert all(a.n_samples == b.n_samples - 4 for a, b in zip(aligned.runs, late.runs, strict=True))
    assert align_channels(virtual_campaign("inter-panel", **PLAN)).notes == ()


def test_verification_of_a_late_channel(late):
    model = discover(virtual_campaign("inter-panel", **PLAN)).model
    plain, aligned = verify(model, late, draws=0), verify(model, late, draws=0, align=True)
    assert aligned.runs[0].response_nrmse < 0.5 * plain.runs[0].response_nrmse
    assert any("the channels were aligned" in warning for warning in aligned.warnings)
    with pytest.raises(InputError, match="align belongs to a campaign"):
        verify(model, "pulse-rig", align=True)


def test_diagnosis_and_comparison_of_a_late_channel(late):
    # Of these six runs a delay of a millisecond stops nothing, and undecides the paper's set: unless it is removed.
    result = diagnose(late, align=True, advise=False)
    assert result.verdict == "nothing_missing"
    assert any("the channels were aligned" in warning for warning in result.warnings)
    assert not any("run with --align" in warning for warning in result.warnings)
    table = compare(late, methods=("stlsq",), libraries=(), replicates=10, align=True)
    assert table.discovery.verdict.verdict == "confirmed"
    # Runs left out are simulated under the moment at its own time: 0.5 % of noise, 4 % with the delay.
    assert table.methods[0].response < 0.01
