"""Many campaigns: the joint that differs is named, the trend is found, results have harmless names."""

import csv
import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from small_joints import write_joint

from sindyjoint import simulate
from sindyjoint.discovery import evidence_bytes, fit_columns, read_evidence
from sindyjoint.errors import InputError, MissingInputError, OptionError, OutputError, UnknownNameError
from sindyjoint.files import write_campaign
from sindyjoint.response import model_law
from sindyjoint.workflows import find_tasks
from sindyjoint.workflows.batch import batch
from tests.export.made import ELEMENTS, PAPER, model_of


def test_the_joint_that_differs_and_the_trend_are_found(done):
    _, result = done
    assert result.complete and result.kept == 0
    assert result.common == ("linear_stiffness", "linear_damping", "coulomb_friction")
    assert [(d.id, d.kind) for d in result.differences] == [("joint-4", "outlier")]
    assert "viscous damping of 7" in result.differences[0].text
    assert "standard deviations above" in result.differences[0].text
    (trend,) = [t for t in result.population.trends if t.significant]
    assert (trend.coefficient, trend.covariate) == ("linear_stiffness", "temperature")
    # 0.2 % per K over 110 K; single joints scatter by 0.2 %.
    assert trend.slope == pytest.approx(-12.0, rel=0.05)


def test_a_campaign_alone_gives_the_same_digits(done, joints):
    from sindyjoint import discover

    out, _ = done
    single = discover(joints / "joint-2", "paper")
    record = json.loads((out / "campaigns" / "joint-2" / "record.json").read_text())
    assert record["result"] == json.loads(json.dumps(single.to_dict()))
    assert (out / "campaigns" / "joint-2" / "model.json").read_text() == single.model.to_json() + "\n"


def test_coefficients_are_compared_on_one_set_of_terms(joints, tmp_path):
    # One joint softens: its model has a cubic term, and a linear stiffness that means something else.
    shutil.copytree(joints, tmp_path / "in")
    shutil.rmtree(tmp_path / "in" / "joint-1")
    write_joint(tmp_path / "in" / "joint-1", 1, temperature=-40, k3=-2e9)
    out = tmp_path / "out"
    result = batch(tmp_path / "in", out, "paper")
    assert result.common == ("linear_stiffness", "linear_damping", "coulomb_friction")
    terms = result.records[1].terms
    assert set(terms) == {*result.common, "cubic_stiffness"}
    assert ("joint-1", "terms with cubic stiffness") in [(d.id, d.text) for d in result.differences]
    # k1 + ¾ k3 A², over both runs; k1 of the model is the 6000 that the joint was given.
    evidence = read_evidence(out / "campaigns" / "joint-1" / "factors.npz")
    fit = fit_columns(evidence, [evidence.ids.index(term) for term in result.common])
    assert terms["linear_stiffness"]["coefficient"] == pytest.approx(6000, rel=0.01)
    assert result.values["linear_stiffness"][1] == pytest.approx(fit.coefficients[0], rel=2e-3)
    assert result.values["linear_stiffness"][1] < 5700


def test_the_command_reports_a_broken_campaign_and_goes_on(joints, tmp_path, sindyjoint):
    shutil.copytree(joints, tmp_path / "in")
    (tmp_path / "in" / "joint-5" / "campaign.toml").write_text("joint = [")
    out = tmp_path / "out"
    answer = sindyjoint("batch", tmp_path / "in", "--out", out, "--library", "paper")
    assert answer.status == 1
    (line,) = answer.stderr.splitlines()
    assert line.startswith("sindyjoint: joint-5: ") and "is not valid TOML" in line
    assert "7 campaigns: 6 with a model, 1 broken" in answer.stdout
    rows = list(csv.DictReader((out / "batch.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["status"] for row in rows].count("broken") == 1
    assert "is not valid TOML" in rows[5]["stands_out"]
    assert (
        float(rows[4]["linear_damping"]) == pytest.approx(75, rel=0.05) and "above" in rows[4]["stands_out"]
    )
    record = json.loads(
        sindyjoint("batch", tmp_path / "in", "--out", out, "-l", "paper", "--json", "-q").stdout
    )
    assert (record["found"], record["broken"]) == (6, 1)
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "joint-4" in page and "Which joints differ" in page and page.count("<svg") >= 1
    listed = sindyjoint("plot", out)
    assert listed.stdout.startswith("joints")


def test_diagnoses_are_made_where_the_campaigns_are(tmp_path, sindyjoint, few_effects):
    few_effects("jenkins_element")
    joint = model_of(PAPER, elements=[ELEMENTS["jenkins_element"]])
    virtual = simulate(
        model_law(joint), drive="displacement", frequencies=[4.0, 6.0], levels=[0.4, 0.8], duration=2.0,
        sample_rate=500.0, noise=0.002, angle_limit=8e-4,
    )  # fmt: skip
    runs, out = tmp_path / "runs", tmp_path / "out"
    write_campaign(replace(virtual, joint=joint.joint), runs)
    options = ("--out", out, "-l", "paper", "--diagnose")
    assert sindyjoint("batch", runs, *options).status == 0
    (found,) = out.glob("campaigns/*/diagnosis")
    # The model there is the whole one: `verify` has the gap that the diagnosis left.
    gap = json.loads((found / "diagnosis.json").read_text())["gap"]
    again = json.loads(sindyjoint("verify", found, runs, "--draws", "0", "--json").stdout)
    assert again["response_nrmse"] == pytest.approx(gap["final"]["response"], rel=0.02)
    assert gap["final"]["response"] < 0.3 * gap["initial"]["response"]
    # Without it nothing requested is missing; with it, after a batch without, it has to be made.
    assert "1 of them done before" in sindyjoint("batch", runs, *options).stdout


def test_names_of_folders_are_harmless_and_unique(tmp_path):
    for name in ("a/b", "a-b", "A-B", "ü b", "..x"):
        (tmp_path / "in" / name).mkdir(parents=True)
        (tmp_path / "in" / name / "campaign.toml").write_text("")
    tasks = find_tasks(tmp_path / "in", tmp_path / "in" / "out", "paper", {})
    ids = [task.id for task in tasks]
    assert len({id.lower() for id in ids}) == 5
    assert all("/" not in id and not id.startswith(".") for id in ids)
    (tmp_path / "in" / "other").mkdir()
    (tmp_path / "in" / "other" / "campaign.toml").write_text("")
    # A campaign that joins changes no name.
    assert set(ids) < {task.id for task in find_tasks(tmp_path / "in", tmp_path / "in" / "out", "paper", {})}


def test_names_that_are_cut_are_told_apart_and_stay(tmp_path):
    long = "x" * 100
    for name in ("j", "j.1", f"{long}-1", f"{long}-2", "ü" * 60):
        (tmp_path / "in" / name).mkdir(parents=True)
        (tmp_path / "in" / name / "campaign.toml").write_text("")
    ids = [task.id for task in find_tasks(tmp_path / "in", tmp_path / "out", "paper", {})]
    assert {"j", "j.1"} < set(ids) and len(set(ids)) == 5
    assert all(len(id.encode()) <= 80 for id in ids)
    # Without the other, whose name was cut to the same, it is called the same.
    (tmp_path / "in" / f"{long}-2" / "campaign.toml").unlink()
    assert set(ids) > {task.id for task in find_tasks(tmp_path / "in", tmp_path / "out", "paper", {})}


def test_reports_of_campaigns_of_which_one_is_called_as_another_begins(joints, tmp_path, sindyjoint):
    for number, name in enumerate(("j", "j.1", "joint <3>")):
        shutil.copytree(joints / f"joint-{number}", tmp_path / "in" / name)
    out = tmp_path / "out"
    answer = sindyjoint(
        "batch", tmp_path / "in" / "*", "--out", out, "-l", "paper", "--reports", "--jobs", "2", "-q"
    )
    assert answer.status == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    (odd,) = (path for path in out.glob("campaigns/*") if path.name not in ("j", "j.1"))
    files = {"factors.npz", "model.json", "record.json", "report.html", "terms.csv"}
    for name in ("j", "j.1", odd.name):
        folder = out / "campaigns" / name
        assert files <= {path.name for path in folder.iterdir()}
        assert (folder / "report.html").stat().st_size > 100_000
        assert f'href="campaigns/{name}/report.html"' in page


def test_bad_input_is_refused_before_anything_is_done(joints, tmp_path):
    with pytest.raises(MissingInputError, match=r"no campaign\.toml in .*nothing"):
        batch(tmp_path / "nothing", tmp_path / "out")
    with pytest.raises(UnknownNameError, match="library 'papr' is unknown"):
        batch(joints, tmp_path / "out", "papr")
    with pytest.raises(UnknownNameError, match="has no term 'k9'"):
        batch(joints, tmp_path / "out", "paper", forced=("k9",))
    with pytest.raises(OptionError, match="has no option 'treshold'; did you mean 'threshold'"):
        batch(joints, tmp_path / "out", "paper", treshold=0.1)
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="is a file"):
        batch(joints, tmp_path / "file", "paper")
    assert not (tmp_path / "out").exists()


def test_factors_survive_the_file(tmp_path, done):
    evidence = read_evidence(done[0] / "campaigns" / "joint-0" / "factors.npz")
    (tmp_path / "again.npz").write_bytes(evidence_bytes(evidence))
    again = read_evidence(tmp_path / "again.npz")
    assert again.ids == evidence.ids and again.groups == evidence.groups
    np.testing.assert_array_equal(again.pooled.triangle, evidence.pooled.triangle)
    (tmp_path / "bad.npz").write_text("no archive")
    with pytest.raises(InputError, match="holds no factors"):
        read_evidence(tmp_path / "bad.npz")
