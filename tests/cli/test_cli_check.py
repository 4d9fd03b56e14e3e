"""sindyjoint check, and --accept: what they print, what they write, with what status they leave."""

import json
from dataclasses import replace

import pytest

from sindyjoint import simulate
from sindyjoint.files import write_campaign
from sindyjoint.reporting import draw, load_results
from sindyjoint.soundness import check as soundness_check

FIELDS = ["id", "run", "channel", "severity", "extent", "effect", "remedy"]


@pytest.fixture(scope="module")
def campaign():
    """Four runs, one of them with spikes."""
    made = simulate(frequencies=[3, 4.5], levels=[0.9, 0.5], duration=4, noise=0.01, random_state=3)
    first, *others = made.runs
    moment = first.moment.copy()
    moment[[300, 900, 2100]] += 400.0
    return made.with_runs((replace(first, name="3Hz [bold]", moment=moment), *others))


@pytest.fixture(scope="module")
def written(campaign, tmp_path_factory):
    path = tmp_path_factory.mktemp("campaign")
    write_campaign(campaign, path)
    return path


@pytest.fixture
def stopping(monkeypatch):
    """Let spikes stop the work."""
    found = soundness_check.find_faults

    def find(campaign):
        return tuple(replace(f, severity="stops") for f in found(campaign) if f.id == "spikes")

    monkeypatch.setattr(soundness_check, "find_faults", find)


def test_json_has_exactly_the_promised_fields(written, sindyjoint):
    answer = sindyjoint("check", written, "--json")
    record = json.loads(answer.stdout)
    assert answer.status == 0 and list(record) == ["schema", "verdict", "findings", "notes"]
    assert record["schema"] == 1 and record["verdict"] in ("sound", "doubtful")
    assert [list(finding) for finding in record["findings"]] == [FIELDS]
    (finding,) = record["findings"]
    assert (finding["id"], finding["channel"]) == ("spikes", "moment") and "3Hz" in finding["run"]


def test_a_person_reads_the_verdict_first_in_eighty_columns(written, sindyjoint):
    lines = sindyjoint("check", written).stdout.splitlines()
    assert lines[0].startswith("inter-panel joint (simulated): the data are ")
    found = lines[lines.index("What was found?") :]
    said = " ".join(" ".join(found).split())
    assert (
        said.count("spike(s) of the moment") == 1
        and "times its amplitude" in said
        and "loose contacts" in said
    )
    assert all(len(line.rstrip()) <= 80 for line in found[: found.index("")])
    assert any("left out: spikes" in line for line in lines)


def test_verbose_adds_each_finding_in_full(written, sindyjoint):
    assert "spikes (moment of " in " ".join(sindyjoint("check", written, "-v").stderr.split())


def test_the_page_shows_every_channel_with_the_findings_marked(written, sindyjoint, tmp_path):
    answer = sindyjoint("check", written, "--out", tmp_path / "out")
    assert answer.status == 0 and "report.html" in answer.stdout
    folder = tmp_path / "out"
    assert {path.name for path in folder.iterdir()} == {
        "SHA256SUMS",
        "check.json",
        "findings.csv",
        "report.html",
        "figures",
    }
    assert json.loads((folder / "check.json").read_text(encoding="utf-8"))["schema"] == 1
    head, *rows = (folder / "findings.csv").read_text(encoding="utf-8").splitlines()
    assert head == "id,run,channel,severity,masked,extent,effect,remedy" and len(rows) == 1
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("<figure") == 2 and "What was found" in page
    data = load_results(folder)
    assert len(data.runs) == 4 and all(len(run.traces) == 2 for run in data.runs)
    (mark,) = data.runs[0].marks
    assert mark.id == "spikes" and len(mark.starts) == 3
    # No peak is lost where the samples are thinned.
    assert max(data.runs[0].traces[0].values) > 390
    assert draw("channels", data).axes and (folder / "figures" / "channels.svg").is_file()


@pytest.mark.parametrize("command", ["discover", "compare", "diagnose"])
def test_unsound_data_stop_a_command_with_its_page_and_status_1(
    written, stopping, sindyjoint, tmp_path, command
):
    answer = sindyjoint(command, written, "--out", tmp_path / "out")
    text = " ".join(answer.stdout.split())
    assert answer.status == 1 and answer.stderr == ""
    assert (
        "the data are unsound" in text
        and ": spikes 3Hz [bold], moment: " in text
        and "--accept spikes" in text
    )
    assert "No model is made of these data as they are." in (tmp_path / "out" / "report.html").read_text(
        encoding="utf-8"
    )
    record = json.loads((tmp_path / "out" / "check.json").read_text(encoding="utf-8"))
    assert record["verdict"] == "unsound"


def test_check_leaves_with_status_1_until_what_stops_is_accepted(written, stopping, sindyjoint):
    assert sindyjoint("check", written).status == 1
    accepted = sindyjoint("check", written, "--accept", "spikes")
    assert accepted.status == 0 and "accepted: spikes" in accepted.stdout
    found = sindyjoint("discover", written, "--accept", "spikes", "--json")
    record = json.loads(found.stdout)
    assert found.status == 0 and record["terms"] and record["paper_term_set"]["verdict"] == "undecided"
    assert record["soundness"] == {"verdict": "unsound", "ids": ["spikes"], "accepted": ["spikes"]}


def test_an_unknown_id_is_one_line_and_status_2(written, sindyjoint):
    answer = sindyjoint("check", written, "--accept", "spike")
    assert answer.status == 2 and len(answer.stderr.splitlines()) == 1
    assert "accept is 'spike'; expected one of ac_coupling" in answer.stderr and "spikes" in answer.stderr


def test_without_a_campaign_the_virtual_test_is_checked(sindyjoint):
    answer = sindyjoint("check", "--json")
    assert answer.status == 0 and json.loads(answer.stdout) == {
        "schema": 1,
        "verdict": "sound",
        "findings": [],
        "notes": [],
    }
