"""What each option changes, where no other test says so: on a joint whose law is known, by its effect alone."""

import json

import numpy as np
import pytest

import sindyjoint
from tests.doors.asked import ask
from tests.doors.truth import LAW, Truth, write

QUICK = ["--quiet", "--json"]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    return tmp_path_factory.mktemp("options")


@pytest.fixture(scope="module")
def bench(place):
    return write(place / "joints" / "bench", Truth(seconds=2.0, frequencies=(3.0, 5.5)).runs())


@pytest.fixture(scope="module")
def found(place, bench):
    assert ask("discover", bench, "--no-correct", "--out", place / "found", "--quiet").status == 0
    return place / "found"


def told(*arguments):
    """Run a command; return its record."""
    answer = ask(*arguments)
    assert answer.status in (0, 1), answer.stderr
    return json.loads(answer.stdout)


def coefficients(record):
    return {term["id"]: term["coefficient"] for term in record["terms"]}


def test_discover_answers_the_papers_question_or_not(bench):
    one = ["--selection", "one_standard_error", "--no-correct"]
    plain = told("discover", bench, *one, "--no-refine", *QUICK)
    asked = told("discover", bench, *one, "--paper", *QUICK)
    assert asked["paper_term_set"]["missing"] and set(coefficients(plain)) == set(LAW)


def test_simulate_makes_the_channels_that_were_asked_for(place, found):
    def made(*options, rig=()):
        folder = place / "_".join(map(str, ["simulate", *options]))
        plan = ["--frequencies", "4", "--levels", "0.6", "--duration", 2, "--noise", 0]
        answer = ask("simulate", *plan, *options, "--out", folder, "--quiet")
        assert answer.status == 0, answer.stderr
        return folder, sindyjoint.load_campaign(folder).runs[0]

    _, plain = made("--joint", "inter-panel", "--settling", 1)
    _, other = made("--joint", "panel-root", "--settling", 1)
    # Table 2 of the paper: twice as stiff, and tested up to the same moments.
    assert not np.allclose(plain.angle, other.angle)
    _, fine = made("--settling", 1, "--sample-rate", 2000)
    assert fine.n_samples == 2 * plain.n_samples and fine.sample_rate == 2000
    _, coarse = made("--settling", 1, "--bits", 6)
    assert np.unique(coarse.angle).size <= 64 < np.unique(plain.angle).size
    _, late = made("--settling", 1, "--skew", 0.005)
    # Five samples of 1 kHz.
    np.testing.assert_allclose(
        late.moment[500:600], plain.moment[495:595], atol=1e-3 * abs(plain.moment).max()
    )
    _, drifted = made("--settling", 1, "--drift", 0.5)
    assert np.std(drifted.angle - plain.angle) > 0.1 * np.std(plain.angle)
    folder, raw = made("--settling", 1, "--raw")
    assert "strain" in (folder / "campaign.toml").read_text()
    np.testing.assert_allclose(raw.angle, plain.angle, atol=1e-6 * abs(plain.angle).max())
    folder, _ = made("--settling", 1, "--accelerometer", "beside")
    assert "acceleration" in (folder / "campaign.toml").read_text()
    _, one = made("--settling", 1, "--random-state", 3)
    np.testing.assert_array_equal(one.angle, plain.angle)


def test_a_law_without_inputs_takes_none(place, found):
    answer = ask("simulate", "--model", found, "--at", "temperature=20", "--out", place / "at")
    assert answer.status == 2 and "temperature" in answer.stderr


def test_verify_is_as_strict_as_its_tolerance(found, bench):
    few = ["--draws", 0, "--align", "--window", 0.5, *QUICK]
    kept = told("verify", found, bench, *few, "--tolerance", 0.05)
    strict = ask("verify", found, bench, *few, "--tolerance", 1e-9)
    assert kept["verdict"] == "passed" and kept["response_nrmse"] < 0.02
    # No tolerance beyond the noise floor at all.
    assert json.loads(strict.stdout)["response_nrmse"] == kept["response_nrmse"]
    answer = ask("verify", found, bench, "--presliding", 1e-5)
    assert answer.status == 2 and "presliding" in answer.stderr


def test_changed_takes_the_margin_that_matters(bench, found, place):
    later = Truth(law={**LAW, "linear_stiffness": 5700.0}, seconds=2.0, frequencies=(3.0, 5.5)).runs(seed=1)
    worn = write(place / "joints" / "worn", later)
    same = ["--same-sensors", "--random-state", 1, "--accept", "coverage", *QUICK]
    # It fell by 5 %: that matters, or it does not.
    wide = told("changed", bench, worn, "--margin", 0.2, *same)
    narrow = told("changed", bench, worn, "--margin", 0.01, *same)
    answers = [
        {each["id"]: each["answer"] for each in record["coefficients"]}["linear_stiffness"]
        for record in (wide, narrow)
    ]
    assert answers[1] == "changed" and wide["margin"] == 0.2


def test_diagnose_aligns_and_advises(bench, place):
    out = ["--out", place / "diagnosis", "--force"]
    record = told("diagnose", bench, "--advice", "--align", *out, *QUICK)
    assert record["verdict"] == "nothing_missing" and record["advice_search"]["status"] == "not_needed"


def test_batch_passes_options_on(bench, place):
    select = ["--selection", "evidence", "--states", "periodic", "--accept", "coverage"]
    terms = [
        "--require",
        "constant_moment",
        "--forbid",
        "linear_damping",
        "--threshold",
        0.005,
        "--bandwidth",
        60,
    ]
    record = told("batch", bench, *select[2:], *terms, "--out", place / "batch", "--force", *QUICK)
    (one,) = record["campaigns"]
    assert "constant_moment" in one["terms"] and "linear_damping" not in one["terms"]
    again = told("batch", bench, *select, "--out", place / "batch2", *QUICK)
    assert set(again["campaigns"][0]["terms"]) == set(LAW)


def test_plan_keeps_what_it_was_told(found, bench, place):
    said = [
        "--rate",
        "400 Hz",
        "--time",
        "10 s",
        "--run-time",
        "5 s",
        "--resolution",
        "angle=1 urad",
        "--force",
    ]
    asked = [
        "--goal",
        "widths",
        "--term",
        "linear_stiffness",
        "--waveform",
        "sine",
        "--limit",
        "moment=5 N*m",
    ]
    record = told("plan", "--model", found, *said, *asked, "--out", place / "plan", "--quiet", "--json")
    assert {run["waveform"] for run in record["runs"]} == {"sine"}
    assert {run["duration"] for run in record["runs"]} == {5.0} and len(record["runs"]) <= 2
    assert all(run["level"] <= 5 for run in record["runs"])
    answer = ask(
        "plan", "--like", "inter-panel", "--diagnosis", place / "nowhere", "--effects", "x", "--share", 0.1
    )
    assert answer.status == 2
    more = told("plan", "--campaign", bench, *said[:-1], *asked, "--random-state", 1, "--verbose", "--json")
    # What runs tell already is added: the interval of k1 cannot be wider than theirs.
    assert more["now"] and more["predicted"]["linear_stiffness"]["half_width95"] < 60


def test_curves_of_a_structure_stand_where_they_were_asked_for(place):
    rig = ["pulse-rig", "--level", "0.5 N", "--band", "4..4.6 Hz", "--modes", 1, "--harmonics", 5]
    record = told("curves", *rig, "--at", "tip", "--point", "tip", "--force", "--quiet", "--json")
    assert ask("curves", *rig, "--quiet", "--verbose").status == 2
    text = json.dumps(record)
    assert "0.5" in text and len(record.get("modes", [0])) == 1


def test_the_papers_tables_are_printed_without_a_word(place):
    answer = ask("reproduce", "tables", "--json")
    assert answer.status == 0 and answer.stderr == "" and json.loads(answer.stdout)["schema"] == 1


def test_a_rig_holds_its_tongue(place):
    answer = ask("rig", "pulse-rig", "--quiet", "--json")
    assert (answer.status, answer.stderr) == (0, "") and json.loads(answer.stdout)["rig"] == "pulse rig"


def test_a_reproduction_takes_no_place_of_others(place):
    (place / "paper").mkdir()
    (place / "paper" / "report.html").write_text("mine")
    answer = ask("reproduce", "--out", place / "paper", "--quiet")
    assert answer.status == 2 and "--force" in answer.stderr
    assert (place / "paper" / "report.html").read_text() == "mine"


def test_a_comparison_asks_each_method_that_is_given(bench, place):
    few = [
        "--method",
        "stlsq",
        "--method",
        "backward",
        "--library",
        "paper",
        "--replicates",
        10,
        "--margin",
        0.1,
    ]
    record = told("compare", bench, *few, "--align", "--out", place / "compare", "--force", *QUICK)
    assert {one["name"] for one in record["methods"]} == {"stlsq", "backward"}
    assert all(set(LAW) == set(coefficients(one)) for one in record["methods"])
