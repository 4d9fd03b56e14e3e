"""sindyjoint discover: what it prints, what it writes, with what status it leaves."""

import json
from dataclasses import replace

import numpy as np
import pytest

from sindyjoint import JointModel, simulate
from sindyjoint.files import write_campaign
from sindyjoint.paper import TERMS as PAPER_TERMS
from tests.doors.asked import ask

NUMBER = (int, float)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A virtual campaign of three frequencies and levels, as files."""
    path = tmp_path_factory.mktemp("campaign")
    made = simulate(frequencies=[3, 4, 5], levels=[0.9, 0.6, 0.35], duration=3.0, noise=0.01, random_state=7)
    write_campaign(made, path)
    return path


@pytest.fixture(scope="module")
def plain(written):
    """What ``discover --json`` prints of it."""
    answer = ask("discover", written, "--json")
    assert (answer.status, answer.stderr) == (0, "")
    return answer.stdout


def test_json_has_exactly_the_promised_fields(plain):
    record = json.loads(plain)
    assert list(record) == [
        "schema",
        "joint",
        "terms",
        "trust",
        "paper_term_set",
        "fit",
        "warnings",
        "soundness",
    ]
    assert record["schema"] == 1
    assert record["joint"] == {"name": "inter-panel joint", "motion": "rotation", "inertia": 0.02}
    assert [term["id"] for term in record["terms"]] == list(PAPER_TERMS)
    assert [term["symbol"] for term in record["terms"]] == ["k1", "k2", "k3", "c1", "M_F"]
    for term in record["terms"]:
        names = ["id", "symbol", "coefficient", "unit", "standard_error", "interval95"]
        assert list(term) == names
        assert isinstance(term["coefficient"], float) and isinstance(term["standard_error"], float)
        low, high = term["interval95"]
        assert low < term["coefficient"] < high
    units = [term["unit"] for term in record["terms"]]
    assert units == ["N*m/rad", "N*m/rad^2", "N*m/rad^3", "N*m*s/rad", "N*m"]
    verdict = record["paper_term_set"]
    assert list(verdict) == ["verdict", "missing", "extra", "reason", "dependences"]
    assert verdict["verdict"] == "confirmed" and verdict["missing"] == [] and verdict["extra"] == []
    fit = record["fit"]
    assert list(fit) == ["moment_rms", "residual_rms", "noise_floor", "moving_fraction", "samples", "runs"]
    assert all(isinstance(value, NUMBER) for value in fit.values())
    assert 0 < fit["noise_floor"] <= fit["residual_rms"] < 0.02 * fit["moment_rms"]
    assert 0.4 < fit["moving_fraction"] < 0.8 and fit["runs"] == 9
    assert "the campaign is simulated (a virtual test), not measured" in record["warnings"]
    assert all(isinstance(warning, str) and "\n" not in warning for warning in record["warnings"])


def test_translation_has_its_own_units(tmp_path, sindyjoint):
    t = np.arange(8000) / 1000
    rng = np.random.default_rng(0)
    motion = sum(
        a * np.sin(2 * np.pi * f * t + p) for a, f, p in ((3e-3, 1.3, 0), (2e-3, 2.9, 1), (1e-3, 5.3, 2))
    )
    rate = np.gradient(motion, 1e-3)
    force = 4000 * motion + 30 * rate + 6 * np.sign(rate) + 0.05 * rng.normal(size=t.size)
    table = np.column_stack([t, force, 1e3 * motion + 1e-3 * rng.normal(size=t.size)])
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t,F,x", comments="")
    (tmp_path / "campaign.toml").write_text(
        '[joint]\nname = "slide"\nmotion = "translation"\nmass = "0 kg"\n[channels]\n'
        'time = { column = "t", unit = "s" }\nforce = { column = "F", unit = "N" }\n'
        'displacement = { column = "x", unit = "mm" }\n[[run]]\nfile = "run.csv"\n'
    )
    record = json.loads(sindyjoint("discover", tmp_path, "--json").stdout)
    assert record["joint"] == {"name": "slide", "motion": "translation", "inertia": 0.0}
    found = {term["id"]: term for term in record["terms"]}
    assert set(found) == {"linear_stiffness", "linear_damping", "coulomb_friction"}
    assert [term["unit"] for term in found.values()] == ["N/m", "N*s/m", "N"]
    assert found["linear_stiffness"]["coefficient"] == pytest.approx(4000, rel=0.01)
    assert found["coulomb_friction"]["coefficient"] == pytest.approx(6, rel=0.02)
    assert not any("moment" in warning or "angle" in warning for warning in record["warnings"])
    plain = sindyjoint("discover", tmp_path).stdout
    assert "F = k1·x" in plain and "N·s/m" in plain and "noise floor" in plain


def test_table_is_plain_text_when_piped(written, sindyjoint):
    answer = sindyjoint("discover", written)
    assert (answer.status, answer.stderr) == (0, "")
    assert "\x1b" not in answer.stdout  # no colours, no cursor
    lines = answer.stdout.splitlines()
    assert lines[0].startswith("inter-panel joint (simulated): 9 run(s) at 3, 4, 5 Hz, ")
    assert any(line.strip() == "M = I·θ̈ + k1·θ + k2·θ² + k3·θ³ + c1·θ̇ + M_F·sgn(θ̇)" for line in lines)
    labels = (
        "linear stiffness",
        "quadratic stiffness",
        "cubic stiffness",
        "viscous damping",
        "Coulomb friction",
    )
    for label in labels:
        row = next(line for line in lines if line.strip().startswith(label))
        assert " ± " in row and "…" in row and row.rstrip().endswith("%")
    text = " ".join(answer.stdout.split())
    assert "paper's term set confirmed: exactly the paper's five terms out of 24 candidates" in text
    assert "inertia 0.02 kg·m², declared" in text


def test_out_holds_the_report(written, plain, tmp_path, sindyjoint):
    out = tmp_path / "deep" / "results"
    answer = sindyjoint("discover", written, "--out", out)
    assert (answer.status, answer.stderr) == (0, "")
    assert f"report: {out / 'report.html'}" in answer.stdout
    names = {str(path.relative_to(out)) for path in out.rglob("*") if path.is_file()}
    assert {"model.json", "report.html", "terms.csv"} <= names
    assert any(name.startswith("figures/") and name.endswith(".svg") for name in names)
    assert not any(path.name.startswith(".") for path in out.parent.rglob("*"))
    model = JointModel.from_json((out / "model.json").read_text(encoding="utf-8"))
    record = json.loads(plain)
    assert [t.coefficient for t in model.terms] == [t["coefficient"] for t in record["terms"]]
    rows = (out / "terms.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 6 and all(term in "\n".join(rows) for term in PAPER_TERMS)


def test_out_and_json_together(written, tmp_path, sindyjoint):
    quick = ("--library", "paper", "--quiet")
    answer = sindyjoint("discover", written, "--out", tmp_path / "r", "--json", *quick)
    assert answer.stderr == "" and json.loads(answer.stdout)["schema"] == 1
    assert (tmp_path / "r" / "model.json").is_file()


def test_no_model_leaves_with_one_and_a_reason(written, tmp_path, sindyjoint):
    made = simulate(frequencies=[3, 4, 5], levels=[0.9, 0.5], duration=5.0, random_state=0)
    rng = np.random.default_rng(0)
    shuffled = made.with_runs(tuple(replace(run, moment=rng.permutation(run.moment)) for run in made.runs))
    write_campaign(shuffled, tmp_path / "shuffled")
    answer = sindyjoint("discover", tmp_path / "shuffled")
    assert (answer.status, answer.stderr) == (1, "")
    assert "no model: no set of terms in which each stands 5 standard errors out" in " ".join(
        answer.stdout.split()
    )
    answer = sindyjoint("discover", tmp_path / "shuffled", "--json", "--out", tmp_path / "r")
    assert answer.status == 1
    record = json.loads(answer.stdout)
    assert record["terms"] == [] and record["paper_term_set"]["verdict"] == "undecided"
    assert (tmp_path / "r" / "report.html").is_file()


@pytest.mark.parametrize(
    ("options", "check"),
    [
        (["--library", "paper"], lambda r: len(r["terms"]) == 5),
        (["-l", "paper", "-l", "damping"], lambda r: len(r["terms"]) == 5),
        (["--threshold", "0.05"], lambda r: 2 <= len(r["terms"]) < 5),
        (["--forbid", "coulomb_friction"], lambda r: "coulomb_friction" in r["paper_term_set"]["missing"]),
        (["--require", "quintic_stiffness"], lambda r: "quintic_stiffness" in r["paper_term_set"]["extra"]),
        (["--states", "broadband"], lambda r: r["fit"]["samples"] > 10_000),
        (["--bandwidth", "60"], lambda r: r["fit"]["residual_rms"] > 0),
        (["--align"], lambda r: r["fit"]["runs"] == 9),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_every_option_does_something(written, plain, sindyjoint, options, check):
    answer = sindyjoint("discover", written, "--json", *options)
    assert answer.status == 0, answer
    record = json.loads(answer.stdout)
    assert check(record), record["terms"]
    # An aligned campaign without a skew is as it was; everything else leaves a mark, beside the command to type next.
    without = json.loads(plain)
    assert record["trust"].pop("next") and without["trust"].pop("next")
    assert (record == without) == (options == ["--align"])


def test_method_reaches_the_engine(written, sindyjoint, monkeypatch):
    from sindyjoint.workflows import discover as workflow

    seen = []
    original = workflow.discover
    monkeypatch.setattr(workflow, "discover", lambda *a, **k: seen.append(original(*a, **k)) or seen[-1])
    assert sindyjoint("discover", written, "--method", "ssr", "--library", "paper").status == 0
    assert seen[0].regressor.method == "ssr"


def test_random_state_moves_the_virtual_test_only(written, sindyjoint):
    quick = ("--json", "--library", "paper", "--random-state")
    virtual, measured = (
        [json.loads(sindyjoint("discover", *given, *quick, seed).stdout) for seed in (1, 2)]
        for given in ((), (written,))
    )
    assert virtual[0]["terms"][0]["coefficient"] != virtual[1]["terms"][0]["coefficient"]
    one, two = measured
    assert one["trust"].pop("next") and two["trust"].pop("next") and one == two


def test_hostile_names_are_shown_as_text(written, tmp_path, sindyjoint):
    text = (written / "campaign.toml").read_text(encoding="utf-8")
    for path in written.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    name = "[red]<script>alert(1)</script>[/red] \\\\ ${x}"
    (tmp_path / "campaign.toml").write_text(text.replace("inter-panel joint", name), encoding="utf-8")
    answer = sindyjoint("discover", tmp_path, "--library", "paper")
    assert answer.status == 0
    assert name.replace("\\\\", "\\") in answer.stdout
