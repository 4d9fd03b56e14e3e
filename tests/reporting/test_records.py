"""What the commands write is what the printed schemas say."""

import json

import jsonschema
import pytest

from sindyjoint import verify
from sindyjoint.errors import UnknownNameError
from sindyjoint.files import manifest_schema, write_campaign
from sindyjoint.mechanics import virtual_campaign
from sindyjoint.reporting import record_names, record_schema
from tests.diagnosis.hidden_effects import hide
from tests.made_models import paper_model


def check(name, text):
    """Raise unless a text is JSON of a schema."""
    schema = record_schema(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    record = json.loads(text)
    jsonschema.validate(record, schema)
    return record


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A campaign with a delay, driven by its angle, and a model."""
    path = tmp_path_factory.mktemp("records")
    campaign = hide("channel_delay", 3, duration=4.0, frequencies=(3.0, 5.0), levels=(0.5, 0.85)).campaign
    write_campaign(campaign, path / "runs")
    (path / "model.json").write_text(paper_model().to_json())
    return path


def test_a_model_and_what_a_diagnosis_writes(folder, sindyjoint, tmp_path, few_effects):
    few_effects("channel_delay", "quadratic_damping", "dahl_friction")
    answer = sindyjoint(
        "diagnose",
        folder / "runs",
        "--no-advice",
        "--json",
        "--hold-out",
        "3Hz-0.85",
        "--out",
        tmp_path / "out",
    )
    assert "Traceback" not in answer.stderr
    check("diagnosis", answer.stdout)
    check("diagnosis", (tmp_path / "out" / "diagnosis.json").read_text())
    record = check("model", (tmp_path / "out" / "model.json").read_text())
    assert record["test"]["nuisances"][0]["id"] == "channel_delay"
    # Of four runs one was kept out.
    assert len(record["fitted"]["seen"]) == 3


def test_a_discovery_and_a_check(folder, sindyjoint, tmp_path):
    check("discovery", sindyjoint("discover", folder / "runs", "--json").stdout)
    check("check", sindyjoint("check", folder / "runs", "--json", "--out", tmp_path / "check").stdout)
    check("check", (tmp_path / "check" / "check.json").read_text())


def test_a_verification(folder, sindyjoint, tmp_path):
    out, where = tmp_path / "out", folder / "runs"
    answer = sindyjoint(
        "verify", folder / "model.json", where, "--draws", 0, "--json", "--out", out, "--free-run", 1500
    )
    assert check("verification", answer.stdout)["free_run"] == 1500
    full = check("verification", (out / "verification.json").read_text())
    assert full["subject"]["kind"] == "campaign" and full["runs"][0]["rmse_unit"] == "N*m"


def test_a_verification_of_a_pulse():
    result = verify(paper_model(), "pulse-rig", draws=0)
    record = check("verification", json.dumps(result.to_dict(full=True), allow_nan=False))
    assert record["free_run"] is None and record["runs"][0]["cycles"]["measured"]


def test_a_comparison(folder, sindyjoint):
    # Its file holds the same.
    few = "--method", "stlsq", "--method", "frols"
    check("comparison", sindyjoint("compare", folder / "runs", "--json", "--replicates", 20, *few).stdout)


def test_a_rig_an_export_a_simulation(folder, sindyjoint, tmp_path):
    check("rig", sindyjoint("rig", "pulse-rig", "--json").stdout)
    check(
        "export", sindyjoint("export", folder / "model.json", "--to", "c", "--json", "--out", tmp_path).stdout
    )
    answer = sindyjoint("simulate", "--out", tmp_path / "made", "--duration", 2, "--json")
    check("simulation", answer.stdout)
    check("tables", sindyjoint("reproduce", "tables", "--json").stdout)


def test_a_batch(folder, sindyjoint, tmp_path):
    for seed in (1, 2):
        made = virtual_campaign(frequencies=[3, 5], levels=[0.85, 0.5], duration=3.0, random_state=seed)
        write_campaign(made, tmp_path / "joints" / str(seed))
    answer = sindyjoint("batch", tmp_path / "joints", "--json", "--out", tmp_path / "out")
    check("batch", answer.stdout)
    check("batch", (tmp_path / "out" / "batch.json").read_text())
    records = list((tmp_path / "out").rglob("record.json"))
    assert len(records) == 2
    for path in records:
        check("joint", path.read_text())


def test_the_paper():
    from sindyjoint.workflows.reproduce import reproduce

    check("reproduction", json.dumps(reproduce().to_dict(), allow_nan=False))


@pytest.mark.parametrize("name", record_names())
def test_every_schema_is_printed(name, sindyjoint):
    answer = sindyjoint("schema", "--of", name)
    assert answer.status == 0 and json.loads(answer.stdout) == record_schema(name)


def test_that_of_the_campaign_is_the_default(sindyjoint):
    assert json.loads(sindyjoint("schema").stdout) == manifest_schema() == record_schema("campaign")


def test_a_schema_holds_what_is_wrong_out():
    good = json.loads(paper_model().to_json())
    jsonschema.validate(good, record_schema("model"))
    for wrong in (
        {**good, "more": 1},
        {**good, "terms": 3},
        {k: v for k, v in good.items() if k != "fitted"},
    ):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, record_schema("model"))


def test_an_unknown_name_is_refused(sindyjoint):
    with pytest.raises(UnknownNameError, match="schema of 'modl'; expected one of campaign, model"):
        record_schema("modl")
    answer = sindyjoint("schema", "--of", "modl")
    assert answer.status == 2 and "schema of 'modl'" in answer.stderr
