"""Each verb once, on a joint whose law is known: what it prints, writes and draws, and what Python gives."""

import csv
import io
import json
import xml.etree.ElementTree as ElementTree

import jsonschema
import numpy as np
import pytest

import sindyjoint
from sindyjoint.export import read_model
from sindyjoint.reporting import drawable, load_results
from tests.doors.asked import ask
from tests.doors.inventory import GOLDEN
from tests.doors.truth import INERTIA, LAW, Truth, write

TRUE = {**LAW, "cubic_stiffness": -1.5e9}
NOISE = 0.003  # of each channel's RMS: with k1 ≈ 0.9 of the moment, the angle's adds nearly as much
METHODS = json.loads(GOLDEN.read_text(encoding="utf-8"))["methods"]
# verb: record, and the file that holds it in --out.
RECORDS = {
    "check": ("check", "check.json"),
    "discover": ("discovery", None),
    "verify": ("verification", "verification.json"),
    "diagnose": ("diagnosis", "diagnosis.json"),
    "curves": ("joint-curves", "curves.json"),
    "changed": ("changed", "changed.json"),
    "batch": ("batch", "batch.json"),
    "plan": ("plan", "plan.json"),
    "export": ("export", None),
    "simulate": ("simulation", None),
}


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("doors")


@pytest.fixture(scope="module")
def bench(place):
    """A joint that softens, with one run kept for validation."""
    folder = place / "joints" / "bench"
    runs = Truth(law=TRUE, seconds=2.5).runs()
    runs[4].extra = 'use = "validate"\n'
    return write(folder, runs)


@pytest.fixture(scope="module")
def worn(place):
    """The same joint later: its stiffness has fallen by a sixth."""
    runs = Truth(law={**TRUE, "linear_stiffness": 5000.0}, seconds=2.5).runs(seed=3)
    return write(place / "joints" / "worn", runs)


@pytest.fixture(scope="module")
def asked(place, bench, worn):
    """What each verb prints with --json, by verb."""
    out = place / "out"
    found = out / "discover"
    plan = ["--time", "10 s", "--rate", "400 Hz", "--limit", "moment=5 N*m"]
    lines = {
        "check": ["check", bench],
        "discover": ["discover", bench],
        "verify": ["verify", found, bench, "--draws", 3],
        "diagnose": ["diagnose", bench, "--no-advice"],
        "curves": ["curves", found],
        "changed": ["changed", bench, worn],
        "batch": ["batch", bench, worn],
        "plan": ["plan", "--model", found, *plan],
        "simulate": ["simulate", "--model", found, "--frequencies", "3,5", "--levels", "0.8,0.4", "--duration", 2],
        "export": ["export", found, "--to", "python"],
    }  # fmt: skip
    return {verb: ask(*line, "--json", "--out", out / verb) for verb, line in lines.items()}


@pytest.fixture(scope="module")
def record(asked):
    return {verb: json.loads(answer.stdout) for verb, answer in asked.items()}


# What the records say is true.


def test_nothing_is_said_beside_json(asked):
    for verb, answer in asked.items():
        assert answer.status == (1 if verb == "changed" else 0), (verb, answer.stderr)
        assert "Traceback" not in answer.stderr, verb


@pytest.mark.parametrize("verb", RECORDS)
def test_what_is_printed_is_what_the_schema_says(verb, record, place):
    name, file = RECORDS[verb]
    schema = json.loads(ask("schema", "--of", name).stdout)
    jsonschema.validate(record[verb], schema)
    if file:
        assert (
            json.loads((place / "out" / verb / file).read_text(encoding="utf-8"))["schema"]
            == record[verb]["schema"]
        )
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**record[verb], "schema": "none"}, schema)


def test_the_terms_are_those_of_the_law(record):
    terms = {term["id"]: term for term in record["discover"]["terms"]}
    assert set(terms) == set(TRUE)
    for name, true in TRUE.items():
        low, high = terms[name]["interval95"]
        half = 0.5 * (high - low)
        # Twice the interval: four intervals of 95 % each are to hold at once, on any machine's noise.
        assert low - half < true < high + half, name
        # An interval of this noise and 11 000 samples is far below a percent, and is not nothing.
        assert 1e-6 < half / abs(true) < 0.01, name
        assert terms[name]["unit"].startswith("N*m")
    fit = record["discover"]["fit"]
    assert fit["runs"] == 8 and fit["samples"] > 5000
    assert 0.5 * NOISE < fit["noise_floor"] / fit["moment_rms"] < 3 * NOISE
    assert fit["residual_rms"] < 1.3 * fit["noise_floor"]


def test_the_verdict_on_the_papers_terms_names_the_missing_one(record):
    verdict = record["discover"]["paper_term_set"]
    assert (
        verdict["verdict"] == "refuted"
        and verdict["missing"] == ["quadratic_stiffness"]
        and not verdict["extra"]
    )


def test_trust_is_good_where_all_is_well(record):
    trust = record["discover"]["trust"]
    assert trust["answer"] == "good"
    assert {trust[light]["colour"] for light in ("data", "explained", "predicts", "determined")} == {"good"}
    assert record["check"] == {"schema": 1, "verdict": "sound", "findings": [], "notes": []}
    assert all(record[verb]["soundness"]["verdict"] == "sound" for verb in ("discover", "verify", "diagnose"))


def test_the_true_model_passes_on_the_run_kept_out(record):
    verified = record["verify"]
    assert verified["verdict"] == "passed" and [run["name"] for run in verified["runs"]] == ["4Hz-1"]
    # What remains of a true model is noise of the angle, which the response is held against, and of the moment.
    assert verified["response_nrmse"] < 4 * NOISE and verified["moment_nrmse"] < 2 * NOISE
    assert verified["mean_period_difference"] < 1e-3


def test_nothing_is_missing_from_a_complete_model(record):
    diagnosis = record["diagnose"]
    assert diagnosis["verdict"] == "nothing_missing" and diagnosis["steps"] == []
    assert diagnosis["gap"]["final"]["moment"] < 1.3 * diagnosis["gap"]["noise_floor"]["moment"]


def test_curves_are_those_of_the_law(record):
    """Secant k1 + k3·a² and energy π·c·w·a² + 4·M_F·a, by hand."""
    for curve in record["curves"]["curves"]:
        a, w = np.array(curve["amplitude"]), 2 * np.pi * curve["frequency"]
        tested = np.array(curve["tested"])
        energy = np.pi * TRUE["linear_damping"] * w * a**2 + 4 * TRUE["coulomb_friction"] * a
        given = np.array(curve["energy"]["value"])
        np.testing.assert_allclose(given[tested], energy[tested], rtol=5e-3)
        secant = (TRUE["linear_stiffness"] + TRUE["cubic_stiffness"] * a**2)[tested]
        # The peak moment of a loop holds friction; the secant is of the elastic part or of the extreme.
        given = np.array(curve["secant"]["value"])[tested]
        plain, whole = (
            abs(given / secant - 1),
            abs(given / (secant + TRUE["coulomb_friction"] / a[tested]) - 1),
        )
        assert np.minimum(plain, whole).max() < 5e-3


def test_a_change_is_found_where_it_is_and_nowhere_else(record):
    changed = record["changed"]
    answers = {each["id"]: each["answer"] for each in changed["coefficients"]}
    assert changed["changed"] and answers["linear_stiffness"] == "changed"
    assert "changed" not in [answer for name, answer in answers.items() if name != "linear_stiffness"]
    (stiffness,) = [each for each in changed["coefficients"] if each["id"] == "linear_stiffness"]
    assert stiffness["change"] == pytest.approx(-1 / 6, abs=0.003)


def test_a_batch_holds_both_joints(record, place):
    batch = record["batch"]
    assert batch["found"] == 2 and batch["broken"] == 0
    assert {each["id"] for each in batch["common_terms"]} == set(TRUE)
    rows = list(csv.reader(io.StringIO((place / "out" / "batch" / "batch.csv").read_text(encoding="utf-8"))))
    assert len(rows) == 3 and all(len(row) == len(rows[0]) for row in rows)
    (mean,) = [each["mean"] for each in batch["scatter"] if each["term"] == "linear_stiffness"]
    assert mean == pytest.approx(5500, rel=2e-3)


def test_a_plan_stays_within_its_limits_and_time(record, place):
    plan = record["plan"]
    assert plan["runs"] and all(run["level"] <= 5.0 for run in plan["runs"])
    assert sum(run["duration"] for run in plan["runs"]) <= 10.0
    assert set(plan["predicted"]) == set(TRUE)
    drives = sorted((place / "out" / "plan").glob("drive-*.csv"))
    assert len(drives) == len(plan["runs"])


def test_a_virtual_test_of_the_model_follows_the_law(place):
    campaign = sindyjoint.load_campaign(place / "out" / "simulate")
    assert campaign.simulated and len(campaign.runs) == 4
    for run in campaign.runs:
        angle, w = run.angle, 2 * np.pi * run.frequency
        rate = np.gradient(angle, 1 / run.sample_rate)
        moving = abs(rate) > 0.3 * abs(rate).max()
        law = Truth(law=TRUE).moment(angle, rate) - INERTIA * w**2 * angle
        late = slice(run.n_samples // 2, None)
        # Finite differences of a noisy angle are good for a tenth of the moment.
        assert np.std((run.moment - law)[late][moving[late]]) < 0.2 * np.std(run.moment[late])


# What is written.


@pytest.mark.parametrize("verb", [verb for verb in RECORDS if verb not in ("export", "simulate")])
def test_a_page_and_its_figures_are_written(verb, asked, place):
    folder = place / "out" / verb
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.startswith("<!doctype html>") or page.startswith("<!DOCTYPE html>")
    # Opens offline: nothing is fetched.
    assert "<script src" not in page and 'rel="stylesheet"' not in page and len(page) > 10_000
    figures = sorted(folder.glob("figures/*.svg"))
    assert figures or verb == "check"
    for figure in figures:
        assert ElementTree.parse(figure).getroot().tag.endswith("svg")
    assert len((folder / "SHA256SUMS").read_text().splitlines()) >= 3


@pytest.mark.parametrize("verb", ["discover", "verify", "diagnose", "curves", "changed", "batch", "plan"])
def test_every_figure_that_is_offered_is_drawn(verb, asked, place):
    folder = place / "out" / verb
    kinds = drawable(load_results(folder))
    listed = ask("plot", folder)
    assert kinds and all(kind in listed.stdout + listed.stderr for kind in kinds)
    # One to a file, each kind by its name; all of them were drawn above.
    picture = place / f"{verb}.png"
    answer = ask("plot", folder, kinds[0], "--out", picture, "--width", 3.5, "--dpi", 60)
    assert answer.status == 0, answer.stderr
    data = picture.read_bytes()
    assert data.startswith(b"\x89PNG")
    # 3.5 inches of 60 dots.
    assert abs(int.from_bytes(data[16:20], "big") - 210) <= 2


# Python gives what the command gives.


def test_discover_gives_in_python_what_the_command_gives(bench, record):
    model = sindyjoint.discover(bench).model
    printed = {term["id"]: term["coefficient"] for term in record["discover"]["terms"]}
    assert {term.id: term.coefficient for term in model.terms} == printed


def test_the_other_verbs_do_too(bench, worn, record, place):
    model = read_model(place / "out" / "discover")
    verified = sindyjoint.verify(model, bench, draws=3, random_state=0)
    assert verified.to_dict()["response_nrmse"] == record["verify"]["response_nrmse"]
    assert [finding.id for finding in sindyjoint.check(bench).soundness.findings] == []
    curves = sindyjoint.curves(model).to_dict()
    assert curves["curves"][0]["energy"]["value"] == record["curves"]["curves"][0]["energy"]["value"]
    changed = sindyjoint.changed(bench, worn, random_state=0)
    assert changed.to_dict()["sentence"] == record["changed"]["sentence"]


def test_the_model_evaluates_as_the_law(place):
    model = read_model(place / "out" / "discover")
    rng = np.random.default_rng(2)
    angle, rate = rng.uniform(-6e-4, 6e-4, 200), rng.uniform(0.002, 0.02, 200) * rng.choice([-1, 1], 200)
    np.testing.assert_allclose(
        model.moment(angle, rate), Truth(law=TRUE).moment(angle, rate), rtol=5e-3, atol=5e-3
    )


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_the_law(method, bench):
    answer = ask("discover", bench, "--method", method, "--library", "paper", "--no-correct", "--json")
    assert answer.status == 0, answer.stderr
    terms = {term["id"]: term["coefficient"] for term in json.loads(answer.stdout)["terms"]}
    assert set(TRUE) <= set(terms)
    for name, true in TRUE.items():
        assert terms[name] == pytest.approx(true, rel=0.02), name
