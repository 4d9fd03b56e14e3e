"""A diagnosis speaks of the joint's own motion, with units, in its record, on the terminal and on its page."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import diagnose
from sindyjoint.cli import main
from sindyjoint.diagnosis import load_effects
from sindyjoint.diagnosis.campaign.gap import locate_gap
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.files import write_campaign
from sindyjoint.record import Campaign, Joint, Run
from sindyjoint.text import percent
from tests.diagnosis.hidden_effects import hide
from tests.diagnosis.test_diagnosis_budget import work_on


def slide(quadratic, motion="translation"):
    """A joint under a prescribed sinusoid at two levels and frequencies, with a quadratic damping and 1 % of noise."""
    rng, runs = np.random.default_rng(3), []
    time = np.arange(0, 4, 1 / 500)
    for frequency in (3.0, 5.0):
        for level in (4e-4, 1e-3):
            w = 2 * np.pi * frequency
            x, v = level * np.sin(w * time + 0.3), level * w * np.cos(w * time + 0.3)
            force = 6000 * x + 40 * v + quadratic * v * np.abs(v) + 0.5 * np.sign(v)
            noisy = [s + 0.01 * np.std(s) * rng.standard_normal(s.size) for s in (force, x)]
            runs.append(
                Run(f"{frequency:g}-{level:g}", *noisy, 500.0, frequency=frequency, level=f"{level:g}")
            )
    return Campaign(Joint(name="slide", motion=motion, inertia=0.0), tuple(runs))


def test_units_are_those_of_the_catalogue_and_of_the_motion():
    effects = {effect.id: effect.variants[0] for effect in load_effects()}
    assert effects["jenkins_element"].units("rotation") == {"k_t": "N*m/rad", "theta_y": "rad"}
    assert effects["jenkins_element"].units("translation") == {"k_t": "N/m", "theta_y": "m"}
    for effect in load_effects():
        for variant in effect.variants:
            units = variant.units("translation")
            assert set(units) == {c.symbol for c in variant.columns} | set(variant.names)
            assert not any("rad" in unit or "N*m" in unit for unit in units.values())


def test_a_translation_has_force_displacement_and_velocity(tmp_path, capsys, few_effects):
    few_effects("quadratic_damping", "cubic_damping", "stribeck_friction", "dead_zone")
    write_campaign(slide(900.0), tmp_path / "in")
    printed = {}
    for arguments in (["--no-advice"], ["--json", "--out", str(tmp_path / "out")]):
        with pytest.raises(SystemExit) as leave:
            main(["diagnose", str(tmp_path / "in"), *arguments])
        assert leave.value.code == 0
        printed["--json" in arguments] = capsys.readouterr().out
    record = json.loads(printed[True])
    step = record["steps"][0]
    assert set(step["units"]) == set(step["parameters"]) and step["units"]["c2"] == "N*s^2/m^2"
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    words = " ".join(place["words"] for place in record["where"])
    assert "velocity" in words
    for text in (printed[False], page, words):
        assert not any(
            word in text for word in ("rad/s", "|angle|", "|rate|", "positive angles", "moment gap")
        )
    assert "force gap" in printed[False] and "N·s²/m²" in printed[False] and "N·s²/m²" in page
    drawn = {path.stem for path in (tmp_path / "out" / "figures").iterdir()}
    assert {"gap", "maps", "overlay", "where", "budget", "rivals"} <= drawn


@pytest.fixture(scope="module")
def turned():
    """The diagnosis of a joint in rotation."""
    return diagnose(slide(900.0, "rotation"), advise=False)


def test_before_and_after_are_the_same_runs_and_effects_make_them_smaller(turned):
    result = turned
    assert [run.run for run in result.before] == [run.run for run in result.after]

    def left(runs):
        return np.sqrt(np.mean(np.concatenate([run.residual for run in runs]) ** 2))

    # What is left of the mean periods is their noise; without the effect it is far above.
    noise = np.sqrt(np.mean([run.noise**2 for run in result.after]))
    assert left(result.after) < 1.2 * noise and left(result.before) > 2 * noise
    nothing = diagnose(slide(0.0), advise=False)
    assert nothing.verdict == "nothing_missing" and nothing.after == () and len(nothing.before) == 4


@pytest.mark.parametrize(
    "value, text",
    [(0.0216, "2.16 %"), (2.09e-7, "< 0.01 %"), (9.9e-5, "< 0.01 %"), (1e-4, "0.01 %"), (0.0, "0 %"),
     (1.0, "100 %"), (9.99, "999 %"), (12.34, "1234 %"), (float("nan"), "–"), (None, "–")],
)  # fmt: skip
def test_shares_are_written_one_way(value, text):
    assert percent(value) == text


def test_a_floor_of_rounding_is_not_told_to_three_digits(turned, capsys):
    from sindyjoint.reporting import show

    show(replace(turned, noise_floor=replace(turned.noise_floor, response=2.09e-7)))
    assert "< 0.01 %" in capsys.readouterr().out


@pytest.mark.parametrize("name", ["stribeck_friction", "dahl_friction", "quintic_stiffness"])
def test_no_band_is_named_within_another(name):
    places = locate_gap(problem_of_gap(name))
    assert places
    bands = [(place.axis, *place.range) for place in places if not isinstance(place.range, str)]
    for index, (axis, low, high) in enumerate(bands):
        for other, start, end in bands[:index]:
            assert axis != other or max(low, start) >= min(high, end)


def problem_of_gap(name):
    work = work_on(hide(name, 1).campaign)
    return GapRegression.build(work.rows, work.model)
