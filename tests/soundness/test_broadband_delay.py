"""A delay between channels that do not repeat, and a law with memory, which lags as well."""

from dataclasses import replace

import pytest

from sindyjoint.numeric import delayed
from sindyjoint.soundness.faults import find_faults
from tests.diagnosis.hidden_effects import hide_in_noise


@pytest.fixture(scope="module")
def multisines():
    return hide_in_noise("nothing", "multisine", 4, 0.1, 0.01).campaign


def delays(campaign):
    return [f for f in find_faults(campaign) if f.id == "channel_delay"]


def test_a_late_moment_is_found(multisines):
    late = [replace(r, moment=delayed(r.moment, 1.5e-3 * r.sample_rate)) for r in multisines.runs]
    (finding,) = delays(replace(multisines, runs=tuple(late)))
    # 0.1 ms: five of its standard errors.
    assert float(finding.extent.split(" ± ")[0].split()[-1]) == pytest.approx(1.5, abs=0.1)


def test_channels_in_time_have_no_delay(multisines):
    assert delays(multisines) == []


def test_memory_is_no_delay():
    # Without the memory beside it a delay of 3 ms halves what the five terms leave of this relaxation.
    assert delays(hide_in_noise("maxwell_branch", "multisine", 991, 0.1, 0.01).campaign) == []
