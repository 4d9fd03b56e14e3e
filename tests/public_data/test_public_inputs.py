"""A large magnetorheological damper whose control signal switches: the law, and what it lacks without the signal."""

import pytest

from sindyjoint import diagnose, discover
from sindyjoint.files import load_campaign

pytestmark = [pytest.mark.shared, pytest.mark.slow]

MANIFEST = """
[joint]
name = "large MR damper"
motion = "translation"
inertia = "0 kg"
[channels]
rate = "3004.8 Hz"
force = {{ column = "force_N", unit = "N" }}
displacement = {{ column = "displacement_cm", unit = "cm" }}
[inputs]
signal = {{ column = "signal_V", unit = "V" }}
[[run]]
file = "{file}"
"""


@pytest.fixture
def damper(public_data, tmp_path):
    (tmp_path / "campaign.toml").write_text(
        MANIFEST.format(file=public_data("mr-damper-nees") / "random.csv")
    )
    return load_campaign(tmp_path)


def test_with_its_signal_the_law_leaves_less_than_six_tenths(damper, public_data):
    with_signal = discover(damper)
    without = discover(public_data("mr-damper-nees"))
    left = [found.selection.step.held_out_rms for found in (with_signal, without)]
    assert left[0] < 0.6 * left[1]
    friction = [with_signal.model.at(signal=volts)["M_F"] for volts in (0.0, 2.26)]
    assert friction[1].interval95[0] > 3 * abs(friction[0].interval95[1])
    assert 0.004 < with_signal.model.inputs[0].lag < 0.015


def test_diagnosis_names_the_signal_without_being_told(damper):
    found = diagnose(damper, advise=False)
    assert "coulomb_friction_by_signal" in [step.effect for step in found.steps]
    assert found.final.moment < 0.6 * found.initial.moment
