"""``[inputs]`` of a campaign: columns, constants, own values of runs, offset temperatures, delays; written and read."""

from dataclasses import replace

import numpy as np
import pytest

from sindyjoint.errors import InputError, UnitError
from sindyjoint.files import load_campaign, write_campaign

HEAD = """
[joint]
inertia = "0 kg*m^2"
[channels]
rate = "100 Hz"
moment = {{ column = "M", unit = "N*m" }}
angle = {{ column = "a", unit = "mrad" }}
[inputs]
{inputs}
[[run]]
file = "one.csv"
{one}
[[run]]
file = "two.csv"
{two}
"""


@pytest.fixture
def campaign_of(tmp_path):
    t = np.arange(400) / 100
    for name in ("one", "two"):
        rows = np.column_stack([np.cos(7 * t), np.sin(7 * t), np.where(t > 2, 2260.0, 0.0), 20 + t])
        np.savetxt(tmp_path / f"{name}.csv", rows, delimiter=",", header="M,a,s,T", comments="")

    def load(inputs, one="", two=""):
        (tmp_path / "campaign.toml").write_text(HEAD.format(inputs=inputs, one=one, two=two))
        return load_campaign(tmp_path)

    return load


def test_a_column_a_constant_and_a_value_of_a_run(campaign_of, tmp_path):
    campaign = campaign_of(
        'signal = { column = "s", unit = "mV", reference = "0 V", name = "control signal" }\n'
        'temperature = "-40 degC"\nload = { unit = "N" }',
        "inputs = { load = 120 }",
        'inputs = { load = "0.2 kN", temperature = 60 }',
    )
    one, two = (run.inputs for run in campaign.runs)
    assert one["signal"].max() == pytest.approx(2.26) and campaign.inputs[0].label == "control signal"
    assert one["temperature"][0] == pytest.approx(233.15) and two["temperature"][7] == pytest.approx(333.15)
    assert (one["load"][0], two["load"][0]) == (120.0, 200.0)
    assert [each.reference for each in campaign.inputs] == pytest.approx([0.0, 283.15, 160.0])
    assert campaign.inputs[1].shown(233.15) == "-40 degC"
    campaign = replace(campaign, gain_uncertainty={"moment": 0.01, "angle": 0.004})
    write_campaign(campaign, tmp_path / "again")
    again = load_campaign(tmp_path / "again")
    assert again.gain_uncertainty == campaign.gain_uncertainty
    for run, other in zip(campaign.runs, again.runs, strict=True):
        for name, values in run.inputs.items():
            assert other.inputs[name] == pytest.approx(values)
    assert [each.reference for each in again.inputs] == pytest.approx([0.0, 283.15, 160.0])


def test_a_declared_delay_moves_the_column_ahead(campaign_of):
    late = campaign_of('s = { column = "s", unit = "mV", delay = "50 ms" }')
    straight = campaign_of('s = { column = "s", unit = "mV" }')
    assert np.argmax(straight.runs[0].inputs["s"] > 1) - np.argmax(late.runs[0].inputs["s"] > 1) == 5


@pytest.mark.parametrize(
    ("inputs", "one", "fault", "words"),
    [
        ('T = { unit = "degC" }', "", InputError, "'T' has no value"),
        ('T = "20 degC"', "inputs = { P = 3 }", InputError, "'P' is not declared"),
        ('T = "20 degC"', 'inputs = { T = "3 N" }', UnitError, "expected a value in degC"),
        ('T = { column = "s" }', "", InputError, "key 'unit' is missing"),
        ('T = { column = "s", unit = "lux" }', "", UnitError, "of no kind that a law takes"),
        ('omega = "3 V"', "", InputError, "already means something"),
    ],
)
def test_faults_are_named(campaign_of, inputs, one, fault, words):
    with pytest.raises(fault, match=words):
        campaign_of(inputs, one, 'inputs = { T = "20 degC" }' if one == "" and "unit = " in inputs else "")
