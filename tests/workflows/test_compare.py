"""The comparison of methods, frequencies and libraries, and its report."""

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest
import sympy
from typer.testing import CliRunner

from sindyjoint.bias.correction import measure_bias
from sindyjoint.diagnosis.effects.catalogue import load_effects
from sindyjoint.diagnosis.effects.parts import element_of
from sindyjoint.discovery.frequency import frequency_test
from sindyjoint.discovery.methods import METHODS
from sindyjoint.equation.terms import ResolvedTerm
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.judgement.held_out_response import response_error
from sindyjoint.mechanics.laws import INTER_PANEL as PAPER_LAW
from sindyjoint.mechanics.laws import FormulaLaw
from sindyjoint.mechanics.virtual import virtual_campaign
from sindyjoint.paper import SYMBOLS
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.reporting.output import write_results
from sindyjoint.reporting.registry import view_of
from sindyjoint.reporting.results.comparison import long_csv
from sindyjoint.reporting.text_table import TextTable
from sindyjoint.workflows.compare import compare
from tests.made_models import paper_model


@pytest.fixture(scope="module")
def campaign():
    return virtual_campaign(
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
    assert [choice.name for choice in result.methods] == list(METHODS)
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
    coarse = virtual_campaign(
        frequencies=[6], levels=[0.9, 0.5], sample_rate=150, duration=4.0, random_state=0
    )
    result = compare(coarse, methods=["stlsq", "weak"], libraries=["paper"], replicates=20)
    assert result.methods[0].terms and not result.methods[1].terms
    assert "no segment of 16 samples in which the joint moves one way" in result.warnings[-1]


def test_a_table_says_what_a_method_cannot_be_given(result):
    rows = {row[0]: row[1:] for row in view_of(result).tables(result)[0].rows}
    given = dict(zip(METHODS, rows["its search is not given"], strict=True))
    assert given["sr3"] == "groups, signs" and given["best_subset"] == "groups"


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


def test_the_model_is_free_of_the_bias_that_is_told(result):
    for term in result.model.terms:
        plain = result.methods[0][term.id]
        assert term.coefficient == pytest.approx(plain.coefficient - result.bias[term.id], rel=1e-9)
        assert term.interval95[0] < term.coefficient < term.interval95[1]
        assert term.standard_error >= plain.standard_error


def test_record_is_plain_json(result):
    data = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert data["schema"] == 1 and len(data["methods"]) == len(METHODS)
    assert data["tests"][0]["answer"] in ("independent within margin", "depends on frequency", "cannot tell")
    assert "discovery" not in data


def test_csv_holds_every_choice_in_full(result):
    rows = list(csv.DictReader(io.StringIO(long_csv(result))))
    row = next(r for r in rows if r["name"] == "stlsq" and r["term"] == "linear_stiffness")
    assert float(row["coefficient"]) == result.methods[0]["linear_stiffness"].coefficient
    assert (row["chosen"], row["unit"]) == ("1", "N*m/rad")
    kinds = 1 + len(result.methods) + len(result.frequencies) + len(result.libraries)
    assert len(rows) == kinds * len(result.shown_ids)


def test_tables_agree_with_the_record(result):
    tables = {table.name: table for table in view_of(result).tables(result)}
    assert set(tables) == {
        "methods", "frequencies", "libraries", "coefficients", "frequency-dependence", "left-out",
    }  # fmt: skip
    row = next(r for r in tables["methods"].rows if r[0] == "the paper's set")
    assert [cell == "yes" for cell in row[1:]] == [choice.agrees for choice in result.methods]


def test_formats_escape_what_is_special():
    table = TextTable(
        "t", "50 % & more_or_less", ("a|b", "c"), (("x", "(−2.684 ± 0.012)·10⁹"), ("N·m/rad²", "–"))
    )
    assert r"a\|b" in table.markdown()
    text = table.latex()
    assert r"50 \% \& more\_or\_less" in text and r"\toprule" in text and r"\bottomrule" in text
    assert r"($-$2.684 $\pm$ 0.012)$\cdot 10^{9}$" in text and r"N$\cdot$m/rad$^{2}$" in text


def test_folder_is_complete_and_offline(result, tmp_path):
    folder = write_results(result, tmp_path / "out", "sindyjoint compare", 0)
    names = {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}
    texts = {"comparison.json", "comparison.csv", "comparison.md", "comparison.tex", "report.html"}
    assert texts | {"figures/inclusion.svg"} <= names
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "http://" not in page.replace("http://www.w3.org", "") and "https://" not in page
    assert "simulated, not measured" in page and result.agreement[1:] in page.replace("&#39;", "'")
    assert (folder / "comparison.tex").read_text(encoding="utf-8").count(r"\begin{table}") == 6


def test_a_small_but_significant_change_is_told_in_the_table(result):
    test = frequency_test("linear_stiffness", [3, 4, 5, 6], [100.0, 101.0, 102.0, 103.0], [0.1] * 4)
    tables = {table.name: table for table in view_of(result).tables(replace(result, tests=(test,)))}
    said = tables["frequency-dependence"].rows[0][-1]
    assert said == "independent within margin; a change of +3.0 % is significant"


def test_wrong_options_are_refused(campaign):
    with pytest.raises(UnknownNameError, match="method is 'magic'; expected one of stlsq"):
        compare(campaign, methods=["magic"])
    with pytest.raises(InputError, match="expected at least 10 and a positive one"):
        compare(campaign, margin=-1)


def test_left_out_response_of_any_terms():
    """Sets beyond the paper's five are simulated, too; what no simulation of angle and rate can hold says why."""
    theta, omega = sympy.symbols("theta omega", real=True)
    damping = FormulaLaw(sympy.Symbol("a") * omega * sympy.Abs(omega), {"a": 400.0})
    campaign = virtual_campaign(
        frequencies=[3, 4, 6], levels=[0.9, 0.6, 0.35], duration=3.0, random_state=0, hidden=damping
    )
    result = compare(campaign, methods=["stlsq", "coefficient_stlsq"], libraries=["paper"], replicates=20)
    main = result.methods[0]
    assert main.extra == ("quadratic_damping",) and main.not_simulated == ""
    # 1 % noise of the measured angle, which the simulation does not have
    assert 0.009 < main.response < 0.02
    for choice in result.methods:
        assert np.isfinite(choice.response) == (not choice.not_simulated)
    found = result.discovery
    wrong = found.regressor.terms_[0].term
    made_up = replace(wrong, id="made_up", formula="alpha*abs(theta)")
    terms = (
        ResolvedTerm(made_up, (), sympy.Symbol("alpha", real=True) * sympy.Abs(theta)),
        *found.regressor.terms_[1:],
    )
    found.regressor.terms_ = terms
    evidence = replace(found.regressor.evidence_, ids=("made_up", *found.regressor.evidence_.ids[1:]))
    error, reason = response_error(found, evidence, ("made_up", "coulomb_friction"))
    assert np.isnan(error) and "depends on alpha" in reason


def test_one_frequency_has_no_test_of_dependence():
    campaign = virtual_campaign(frequencies=[4], levels=[0.9, 0.6, 0.35], duration=3.0, random_state=0)
    result = compare(campaign, methods=["stlsq", "best_subset"], libraries=["paper"], replicates=20)
    assert result.tests == () and len(result.methods) == 2
    assert any("one frequency" in text for text in result.warnings)
    assert len(view_of(result).tables(result)) >= 3


def test_a_single_run_is_compared_by_its_parts(tmp_path, sindyjoint):
    whole = virtual_campaign(frequencies=[4], levels=[0.9, 0.5], duration=4.0, random_state=0)
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


def test_bias_needs_two_pairs(result):
    found = result.discovery
    terms = [t for t in found.regressor.terms_ if t.id in found.model]
    with pytest.raises(InputError, match="1 pair"):
        measure_bias(found.model, terms, found.campaign, found.states, pairs=1)
    one = measure_bias(found.model, terms, found.campaign, found.states, pairs=2, random_state=1)
    same = measure_bias(found.model, terms, found.campaign, found.states, pairs=2, random_state=1)
    np.testing.assert_array_equal(one.pooled, same.pooled)
    assert one.by_group.shape == (3, 5) and set(one.driven) == {"moment"}


def test_command_line(campaign, tmp_path):
    import typer

    from sindyjoint.cli.compare import compare as command
    from sindyjoint.files import write_campaign

    app = typer.Typer()
    app.command()(command)
    manifest = write_campaign(campaign, tmp_path / "campaign", "npz")
    arguments = [str(manifest), "--json", "--method", "stlsq", "--replicates", "20"]
    outcome = CliRunner().invoke(app, arguments)
    assert outcome.exit_code == 0, outcome.output
    assert json.loads(outcome.stdout)["methods"][0]["name"] == "stlsq"


def test_a_given_model_is_held_against_the_same_runs_with_its_elements(campaign):
    """The paper's law with a Maxwell branch that the joint does not have: its moment shows, and no term hides it."""
    branch = next(effect for effect in load_effects() if effect.id == "maxwell_branch")
    own = paper_model(values=[getattr(PAPER_LAW, name) for name in SYMBOLS])
    made = element_of(branch.id, branch.name, branch.variants[0], [600.0], [0.03])
    options = dict(methods=["stlsq"], libraries=["paper"], replicates=10, correct=False)
    plain = compare(campaign, "paper", model=own, **options)
    whole = compare(campaign, "paper", model=replace(own, elements=(made,), covariance=()), **options)
    # 1 % noise in angle and moment, as the model found has it, too.
    assert plain.given.residual < 1.2 * plain.methods[0].residual and plain.given.response < 0.02
    assert whole.given.elements == ("maxwell_branch",) and whole.given.residual > 2 * plain.given.residual
    assert not whole.given.seen and whole.to_dict()["given"]["terms"] == list(PAPER_TERMS)
    assert "maxwell branch" in str(whole).lower()
