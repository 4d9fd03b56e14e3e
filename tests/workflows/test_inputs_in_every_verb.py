"""Every verb on joints whose dry friction depends on an input: in V, degC and 1, with a reference and without one."""

import json
from typing import NamedTuple

import numpy as np
import pytest

from sindyjoint import Campaign, discover
from sindyjoint.files import load_campaign

K1, C1, M_F, INERTIA = 6066.0, 48.0, 1.9, 0.02
RATE, NOISE = 500.0, 0.01
T = np.arange(2000) / RATE
HEAD = """
[joint]
name = "bench joint"
inertia = "0.02 kg*m^2"
[channels]
rate = "500 Hz"
moment = { column = "moment", unit = "N*m" }
angle = { column = "angle", unit = "mrad" }
[inputs]
"""


class Case(NamedTuple):
    """An input as a campaign declares it; the friction is M_F + slope (value − middle), in its unit."""

    name: str
    declared: str
    slope: float
    middle: float
    reference: float


CASES = {
    # Switches within runs, constant in the one that is kept out; the middle of 0.5 to 1.7 V is the reference.
    "V": Case("signal", '{ column = "s", unit = "V" }', 0.8, 1.1, 1.1),
    # One value in each run.
    "degC": Case("temperature", '{ column = "s", unit = "degC" }', -0.01, 30.0, 30.0),
    # Swings slowly within runs; a reference at the edge of what is tested.
    "1": Case("fill", '{ column = "s", unit = "1", reference = 0.3 }', 1.5, 0.5, 0.3),
}


def values_of(case, number, generator):
    if case.name == "signal":
        switched = 0.5 + 1.2 * (generator.random(40) > 0.5).repeat(50)
        return np.full(T.size, 1.7) if number == 5 else switched
    if case.name == "temperature":
        return np.full(T.size, (10.0, 30.0, 50.0)[number % 3])
    return 0.5 + 0.3 * np.sin(2 * np.pi * 0.3 * T + number)


def runs_of(case):
    """Yield frequency, angle, moment and input of six runs in each of which the angle is prescribed."""
    generator = np.random.default_rng(5)
    for number in range(6):
        frequency, size = (2.0, 3.0)[number // 3], (4e-4, 6e-4, 8e-4)[(number + number // 3) % 3]
        turn = 2 * np.pi * frequency
        angle, rate = size * np.sin(turn * T + 0.1), size * turn * np.cos(turn * T + 0.1)
        own = values_of(case, number, generator)
        moment = (
            (K1 - INERTIA * turn**2) * angle
            + C1 * rate
            + (M_F + case.slope * (own - case.middle)) * np.sign(rate)
        )
        yield frequency, angle, moment + NOISE * generator.normal(size=T.size), own


@pytest.fixture(params=CASES)
def case(request):
    return CASES[request.param]


@pytest.fixture
def folder(case, tmp_path):
    text = HEAD + f"{case.name} = {case.declared}\n"
    for number, (frequency, angle, moment, own) in enumerate(runs_of(case)):
        name, use = f"run{number}.csv", "validate" if number == 5 else "identify"
        columns = np.column_stack([moment, 1e3 * angle, own])
        (tmp_path / "bench").mkdir(exist_ok=True)
        np.savetxt(tmp_path / "bench" / name, columns, delimiter=",", header="moment,angle,s", comments="")
        text += f'[[run]]\nfile = "{name}"\nfrequency = {frequency}\nuse = "{use}"\n'
    (tmp_path / "bench" / "campaign.toml").write_text(text)
    return tmp_path / "bench"


def test_what_reads_a_campaign_finds_how_friction_depends_on_the_input(case, folder, sindyjoint, few_effects):
    assert sindyjoint("check", folder, "--json").status == 0
    found = folder.parent / "found"
    assert sindyjoint("discover", folder, "-l", "paper", "--out", found).status == 0
    model = json.loads((found / "model.json").read_text())
    own, terms = model["inputs"][0], {term["id"]: term for term in model["terms"]}
    assert set(terms) == {
        "linear_stiffness", "linear_damping", "coulomb_friction", f"coulomb_friction_by_{case.name}"
    }  # fmt: skip
    shown = (own["reference"] - own["zero"]) / own["factor"]
    assert shown == pytest.approx(case.reference)
    slope, friction = terms[f"coulomb_friction_by_{case.name}"], terms["coulomb_friction"]
    # Four standard errors of the fit, and what the time that a sample lasts does to a friction that changes sign in it.
    assert slope["coefficient"] == pytest.approx(case.slope, rel=2e-3, abs=4 * slope["standard_error"])
    at_reference = M_F + case.slope * (case.reference - case.middle)
    assert friction["coefficient"] == pytest.approx(at_reference, rel=2e-3)

    assert sindyjoint("verify", found, folder, "--draws", 0).status in (0, 1)
    few_effects("stribeck_friction", "quadratic_damping")
    told = json.loads(sindyjoint("diagnose", folder, "--json").stdout)
    steps = [step["effect"] for step in told["steps"]]
    assert steps == [f"coulomb_friction_by_{case.name}"]
    # What is left is the noise.
    assert told["gap"]["final"]["moment"] < 1.1 * told["gap"]["noise_floor"]["moment"]
    again = json.loads(sindyjoint("diagnose", folder, "--model", found, "--json").stdout)
    assert (
        not again["steps"] and again["gap"]["initial"]["moment"] < 1.1 * again["gap"]["noise_floor"]["moment"]
    )


def test_python_finds_what_the_command_line_finds(case):
    frequencies, angles, moments, own = zip(*runs_of(case), strict=True)
    unit = {"signal": "V", "temperature": "degC", "fill": "1"}[case.name]
    campaign = Campaign.from_arrays(
        angle=angles, moment=moments, rate=RATE, frequency=frequencies, inertia=INERTIA, units={case.name: unit},
        inputs={case.name: own},
    )  # fmt: skip
    (declared,) = campaign.inputs
    low, high = (declared.shown(value) for value in declared.tested)
    assert (float(low.split()[0]), float(high.split()[0])) == pytest.approx(
        (np.min(own), np.max(own)), abs=1e-4
    )
    model = discover(campaign, library="paper", correct=False).model
    assert f"coulomb_friction_by_{case.name}" in model.ids


@pytest.mark.parametrize("case", ["V"], indirect=True)
def test_what_takes_a_model_or_a_folder_takes_one_with_an_input(case, folder, sindyjoint):
    found = folder.parent / "found"
    assert sindyjoint("discover", folder, "-l", "paper", "--out", found).status == 0
    given = ["simulate", "--model", found, "--at", "signal=500 mV", "--frequencies", "3", "--levels", "0.5"]
    assert sindyjoint(*given, "--duration", 2, "--out", folder.parent / "made").status == 0
    # At 0.5 V: the value that the runs were made at, in the unit of the model.
    assert 'signal = { unit = "V"' in (folder.parent / "made" / "campaign.toml").read_text()
    (run,) = load_campaign(folder.parent / "made").runs
    assert run.inputs["signal"][0] == pytest.approx(0.5)
    for target in ("python", "nastran", "latex", "json"):
        assert sindyjoint("export", found, "--to", target, "--out", folder.parent / target).status == 0
        held = sindyjoint("export", found, "--to", target, "--at", "signal=0.5 V")
        assert held.status == 0 and held.stdout
    assert sindyjoint("curves", found).status == 0
    test = ["--drive", "angle", "--time", "40 s", "--rate", "250 Hz", "--limit", "moment=8 N*m"]
    assert sindyjoint("plan", "--model", found, *test).status == 0
    refused = sindyjoint("plan", "--campaign", folder, *test)
    assert refused.status == 2 and "plan with --model of that folder" in refused.stderr
    assert sindyjoint("changed", folder, folder).status == 0
    assert sindyjoint("batch", folder, "-l", "paper", "--out", folder.parent / "all").status == 0
    # A campaign without the input, or with one of another kind, is told what to do.
    manifest = folder / "campaign.toml"
    text = manifest.read_text()
    manifest.write_text(text.replace(f"signal = {case.declared}", ""))
    for verb in (["verify", found, folder], ["diagnose", folder, "--model", found]):
        refused = sindyjoint(*verb)
        assert refused.status == 2 and "declare it in [inputs]" in refused.stderr
    manifest.write_text(text.replace('unit = "V"', 'unit = "A"'))
    for verb in (["verify", found, folder], ["diagnose", folder, "--model", found]):
        refused = sindyjoint(*verb)
        assert refused.status == 2 and "is in A in the campaign and in V in the model" in refused.stderr
    # A file without time: the one thing to ask, whatever other columns there are.
    manifest.unlink()
    asked = sindyjoint("init", folder, "--yes")
    assert asked.status == 2 and "answer with --set" in asked.stderr
