"""The comparison of methods, frequencies and libraries, and its report."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import Campaign, compare, discover, simulate
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.reporting import write_results
from tests.doors.asked import ask
from tests.doors.inventory import GOLDEN

METHODS = [name for name in json.loads(GOLDEN.read_text(encoding="utf-8"))["methods"] if ":" not in name]


@pytest.fixture(scope="module")
def campaign():
    return simulate(
        frequencies=[3, 4, 6],
        levels=[0.9, 0.6, 0.35],
        sample_rate=500,
        duration=4.0,
        noise=0.01,
        random_state=0,
    )


@pytest.fixture(scope="module")
def result(campaign):
    return compare(campaign, replicates=100, random_state=0)


def test_every_method_frequency_and_library_is_asked(result):
    assert [choice.name for choice in result.methods] == METHODS
    assert [choice.name for choice in result.frequencies] == ["3 Hz", "4 Hz", "6 Hz"]
    assert [c.name for c in result.libraries][::5] == ["paper", "extended"]
    assert result.methods[0].agrees and result.methods[0].ids == PAPER_TERMS


def test_the_weak_form_is_compared_where_it_is_asked_for(campaign):
    result = compare(campaign, methods=["stlsq", "weak"], libraries=["paper"], replicates=20)
    weak = result.methods[1]
    assert weak.name == "weak" and weak.ids == PAPER_TERMS and weak.not_given == ("groups", "signs")
    # Of samples, as of the other method: integrals alone would have a third of it.
    assert weak.held_out == pytest.approx(result.methods[0].held_out, rel=0.02)
    assert weak["coulomb_friction"].coefficient == pytest.approx(1.867, rel=0.01)
    with pytest.raises(InputError, match="'weak' cannot lead the comparison: name another method before it"):
        compare(campaign, methods=["weak"])


def test_where_the_weak_form_cannot_be_the_others_stand():
    coarse = simulate(frequencies=[6], levels=[0.9, 0.5], sample_rate=150, duration=4.0, random_state=0)
    result = compare(coarse, methods=["stlsq", "weak"], libraries=["paper"], replicates=20)
    assert result.methods[0].terms and not result.methods[1].terms
    assert "no segment of 16 samples in which the joint moves one way" in result.warnings[-1]


def test_the_agreement_counts_what_the_choices_say(result):
    agreeing = sum(set(choice.ids) == set(PAPER_TERMS) for choice in result.methods)
    assert f"{agreeing} of {len(METHODS)} methods" in result.agreement
    assert "5 of 5 libraries that offer them" in result.agreement
    polynomial = result.libraries[1]
    assert not polynomial.offers_paper_terms and "coulomb_friction" in polynomial.missing


def test_left_out_errors_are_near_the_noise(result):
    main = result.methods[0]
    # 1 % noise of each channel, that of the angle felt through the stiffness
    assert 0.009 < main.held_out < 0.02
    assert 0.009 < main.response < 0.02
    assert set(result.left_out) == {"frequency", "level"}
    assert main.seconds > 0 and {step.size for step in main.path} == set(range(1, 25))


def test_the_model_is_that_of_the_main_method(result):
    for term in result.model.terms:
        plain = result.methods[0][term.id]
        assert term.coefficient == pytest.approx(plain.coefficient, rel=1e-9)
        assert term.interval95[0] < term.coefficient < term.interval95[1]
        assert term.standard_error >= plain.standard_error


def test_record_is_plain_json(result):
    data = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert data["schema"] == 1 and len(data["methods"]) == len(METHODS)
    assert data["tests"][0]["answer"] in ("independent within margin", "depends on frequency", "cannot tell")
    assert "discovery" not in data


def test_folder_is_complete_and_offline(result, tmp_path):
    folder = write_results(result, tmp_path / "out", "sindyjoint compare", 0)
    names = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    texts = {"comparison.json", "comparison.csv", "comparison.md", "comparison.tex", "report.html"}
    assert texts | {"figures/inclusion.svg"} <= names
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "http://" not in page.replace("http://www.w3.org", "") and "https://" not in page
    assert "simulated, not measured" in page and result.agreement[1:] in page.replace("&#39;", "'")
    assert (folder / "comparison.tex").read_text(encoding="utf-8").count(r"\begin{table}") == 8


def test_choices_stand_by_group_and_best_first(result, tmp_path):
    folder = write_results(result, tmp_path / "out", "sindyjoint compare", 0)
    lines = (folder / "comparison.md").read_text(encoding="utf-8").split("## ")[1].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    groups = [row[1] for row in rows[2:] if row[1]]
    assert list(dict.fromkeys(groups)) == ["method", "frequency", "level", "library"] and groups == sorted(
        groups, key=["method", "frequency", "level", "library"].index
    )
    record = result.to_dict()
    for by, key in (
        ("method", "methods"),
        ("frequency", "frequencies"),
        ("level", "levels"),
        ("library", "libraries"),
    ):
        scores = {choice["name"]: choice for choice in record[key]}
        shown = [scores[row[0]]["held_out"] for row in rows[2:] if row[1] == by]
        assert len(shown) == len(scores) and shown == sorted(shown, key=lambda score: round(score, 4))
        assert all(0 < choice["held_out_error"] < choice["held_out"] for choice in scores.values())


def test_wrong_options_are_refused(campaign):
    with pytest.raises(UnknownNameError, match="method is 'magic'; expected one of stlsq"):
        compare(campaign, methods=["magic"])
    with pytest.raises(InputError, match="expected 10 or more, and a positive number"):
        compare(campaign, margin=-1)


def test_a_single_run_is_compared_by_its_parts(tmp_path, sindyjoint):
    whole = simulate(frequencies=[4], levels=[0.9, 0.5], duration=4.0, random_state=0)
    one = replace(whole, runs=(whole.runs[0], replace(whole.runs[1], use="validate")))
    from sindyjoint.files import write_campaign

    manifest = write_campaign(one, tmp_path / "one", "npz")
    options = ("--method", "stlsq", "--method", "best_subset", "--replicates", "20", "--library", "paper")
    answer = sindyjoint("compare", manifest, *options, "--out", tmp_path / "out")
    assert answer.status == 0 and answer.stderr == ""
    assert "single frequencies" not in answer.stdout
    data = json.loads((tmp_path / "out" / "comparison.json").read_text(encoding="utf-8"))
    assert data["frequencies"] == [] and set(data["left_out"]) == {"time"}
    parts = [fold["left_out"] for fold in data["left_out"]["time"]["folds"]]
    assert parts == [["part 1"], ["part 2"], ["part 3"], ["part 4"]]
    for choice in data["methods"]:
        # 1 % noise of the moment, 1 % of the angle felt through the stiffness.
        assert choice["held_out"] < 0.02 and choice["response"] is None
        assert choice["not_simulated"] == "one run only: no other one can be held out"
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Without one part of the run" in page and "time: part 1" in page


def test_command_line(campaign, tmp_path):
    from sindyjoint.files import write_campaign

    manifest = write_campaign(campaign, tmp_path / "campaign", "npz")
    outcome = ask("compare", manifest, "--json", "--method", "stlsq", "--replicates", 20)
    assert outcome.status == 0, outcome.stderr
    assert json.loads(outcome.stdout)["methods"][0]["name"] == "stlsq"


FRICTION = ("coulomb_friction", "coulomb_friction_proportional_to_load")
SETTINGS = [(3, 20), (3, 80), (4, 50), (4, 120), (5, 20), (5, 120), (6, 80), (6, 50)]


def loaded(noise, seed, settings=SETTINGS, directional=0.0):
    """Return sines of M = 600·θ + 1.5·θ̇ + (0.5 + 0.02·|N|)·sign θ̇ + d·N under the load N, made in closed form."""
    rng, time = np.random.default_rng(seed), np.arange(0, 2, 1e-3)
    angles, moments = [], []
    for number, (frequency, load) in enumerate(settings):
        phase, amplitude = 2 * np.pi * frequency * time, 0.006 + 0.001 * number
        angle, rate = amplitude * np.sin(phase), amplitude * 2 * np.pi * frequency * np.cos(phase)
        moment = 600 * angle + 1.5 * rate + (0.5 + 0.02 * abs(load)) * np.sign(rate) + directional * load
        angles.append(angle + 0.4 * noise * amplitude * rng.normal(size=time.size))
        moments.append(moment + noise * np.std(moment) * rng.normal(size=time.size))
    return Campaign.from_arrays(
        angle=angles, moment=moments, rate=1000.0, frequency=[f for f, _ in settings], inertia=0.0,
        inputs={"load": [f"{load} N" for _, load in settings]}, name="gear",
    )  # fmt: skip


def test_laws_of_friction_under_a_load_are_tabulated_with_their_errors(tmp_path):
    result = compare(loaded(0.005, 0), methods=["stlsq"], libraries=["paper"], replicates=10)
    by_name = {choice.name: choice for choice in result.friction}
    assert list(by_name) == [
        "Coulomb", "M1 viscous", "M2 Stribeck", "M3 load", "M4 load, Stribeck",
        "M5 load, direction", "M6 load, squared",
    ]  # fmt: skip
    right = by_name["M3 load"]
    truth = {
        "linear_stiffness": 600, "coulomb_friction": 0.5, "linear_damping": 1.5,
        "coulomb_friction_proportional_to_load": 0.02,
    }  # fmt: skip
    # Twice the 95 % interval: one of the four in 5 000 campaigns would be outside.
    for term in right.terms:
        low, high = term.interval95
        assert abs(term.coefficient - truth[term.id]) < high - low
    # What is made without the load misses the friction's change of up to a quarter of the moment; noise is 0.5 %.
    assert by_name["M2 Stribeck"].held_out > 20 * right.held_out
    assert right.held_out < 0.006
    assert right.held_out_error < 0.001
    assert "Laws of friction under the load" in (result.report(tmp_path / "out") / "report.html").read_text()


def test_friction_that_is_larger_against_a_load_than_with_it_needs_the_directional_law():
    """0.02·|N| ± 0.006·|N|, as of a gear that is driven by its load in one direction; the load has both signs."""
    settings = [(f, load * (-1) ** i) for i, (f, load) in enumerate(SETTINGS)]
    campaign = loaded(0.005, 2, settings, directional=0.006)
    # The check does not take the direction for runs that differ, and discovery needs no stiffness in its place.
    found = discover(campaign)
    assert {"coulomb_friction_proportional_to_load", "moment_by_load"} < {*found.model.ids}
    assert not [name for name in found.model.ids if name.endswith("stiffness_by_load")]
    assert {light.name: light.colour for light in found.trust.lights}["data"] == "good"
    result = compare(campaign, methods=["stlsq"], libraries=["paper"], replicates=10)
    by_name = {choice.name: choice for choice in result.friction}
    right = by_name["M5 load, direction"]
    found = {term.id: term for term in right.terms}
    for name, truth in {
        "coulomb_friction_proportional_to_load": 0.02, "moment_by_load": 0.006, "linear_damping": 1.5,
    }.items():  # fmt: skip
        low, high = found[name].interval95
        assert abs(found[name].coefficient - truth) < high - low
    assert result.units["moment_by_load"] == "m"
    # 0.006·100 N of a moment of 5 N·m RMS is 10 %; noise is 0.5 %.
    assert right.held_out < 0.006
    assert by_name["M4 load, Stribeck"].held_out > 5 * right.held_out


def test_a_law_that_other_frequencies_do_not_determine_has_no_error():
    # Each frequency has a load of its own: without one of two the load's part is Coulomb's.
    campaign = loaded(0.005, 1, settings=[(3, 20), (3, 20), (5, 80), (5, 80)])
    result = compare(campaign, methods=["stlsq"], libraries=["paper"], replicates=10, forced=list(FRICTION))
    by_name = {choice.name: choice for choice in result.friction}
    assert np.isnan(by_name["M3 load"].held_out)
    assert by_name["M1 viscous"].held_out > 0
    assert "do not tell its terms apart" in result.methods[0].not_simulated


def test_without_a_load_no_laws_of_friction_are_compared(result):
    assert result.friction == ()
