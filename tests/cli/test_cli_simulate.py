"""``sindyjoint simulate`` writes a campaign that reads back."""

import json

import numpy as np
import pytest

import sindyjoint
from sindyjoint.errors import InputError
from sindyjoint.files import load_campaign
from tests.doors.asked import ask

SMALL = ["--frequencies", "4", "--levels", "0.6,0.4", "--duration", "2"]


@pytest.mark.parametrize("extra", [[], ["--raw", "--bits", "14"], ["--format", "npz", "--drive", "rig"]])
def test_campaign_reads_back(tmp_path, extra):
    result = ask("simulate", *SMALL, *extra, "--out", str(tmp_path / "made"), "--json")
    assert result.status == 0, result.stderr
    record = json.loads(result.stdout)
    campaign = load_campaign(record["manifest"])
    assert campaign.simulated
    assert (
        [run.name for run in campaign.runs]
        == [run["name"] for run in record["runs"]]
        == ["4Hz-0.6", "4Hz-0.4"]
    )
    assert 4e-4 < np.abs(campaign.runs[0].angle).max() < 6e-4
    if "--raw" in extra:
        assert "e4" in (tmp_path / "made" / "4Hz-0.6.csv").read_text().splitlines()[1]


def test_lists_that_are_no_numbers_are_refused(tmp_path):
    result = ask("simulate", "--frequencies", "3;4", "--out", str(tmp_path / "made"))
    assert "--frequencies is '3;4'; expected numbers with commas between them" in result.stderr
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("format", ["csv", "tsv", "npz", "parquet", "h5", "mat"])
def test_every_run_file_says_that_it_is_simulated(tmp_path, format):
    made = tmp_path / "made"
    ask("simulate", *SMALL, "--format", format, "--out", str(made))
    manifest = made / "campaign.toml"
    text = manifest.read_text()
    assert "simulated = true" in text
    # The mark in the files holds where that of the manifest is lost.
    manifest.write_text(text.replace("simulated = true", ""))
    assert load_campaign(made).simulated
    assert load_campaign(made, longest=1000).simulated


@pytest.mark.parametrize("raw", [False, True])
def test_python_makes_the_files_that_the_command_makes(tmp_path, model_file, raw):
    plan = {"frequencies": [4], "levels": [0.6], "duration": 2.0, "raw_channels": raw, "rng": 3}
    options = [
        "--frequencies",
        "4",
        "--levels",
        "0.6",
        "--duration",
        "2",
        "--random-state",
        "3",
        *["--raw"] * raw,
    ]
    assert ask("simulate", *options, "--model", str(model_file), "--out", str(tmp_path / "a")).status == 0
    made = sindyjoint.simulate(model=model_file, out=tmp_path / "b", **plan)
    files = [sorted(p.name for p in (tmp_path / folder).glob("*.csv")) for folder in "ab"]
    assert files[0] == files[1] and len(files[0]) == 1 and made.simulated
    assert (tmp_path / "a" / files[0][0]).read_bytes() == (tmp_path / "b" / files[0][0]).read_bytes()
    with pytest.raises(InputError, match="without a model"):
        sindyjoint.simulate(at={"temperature": 20.0}, **plan)
