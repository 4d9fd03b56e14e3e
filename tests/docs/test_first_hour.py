"""The first hour, on made and on public data: three commands, no edited line, a report at the end."""

import pytest
from first_hour import PUBLIC, TOLD, commands, walk_in_one, without_manifest
from odd_folders import campaign, labview, workbook  # on the path by first_hour

from sindyjoint import simulate
from sindyjoint.files import write_campaign
from tests.doors.asked import without_stages


@pytest.fixture(scope="module")
def truth():
    return campaign()


def virtual(folder, truth):
    write_campaign(truth, folder).unlink()


def ends_in_a_report(answers, results, simulated):
    for answer in answers[:2]:
        assert answer.status == 0, answer.stderr
        assert answer.stderr == "" and 1 <= len(answer.stdout.splitlines()) <= 40
    found = answers[2]
    assert "Traceback" not in found.stderr
    assert (
        found.stdout.index("Can I trust it?")
        < found.stdout.index("What is it?")
        < found.stdout.index("What next?")
    )
    assert (results / "report.html").is_file() and f"report: {results}" in found.stdout
    assert all(("simulated" in answer.stdout) == simulated for answer in answers)
    return found


@pytest.mark.parametrize("write", [virtual, workbook, labview], ids=lambda write: write.__name__)
def test_made_data(write, truth, tmp_path, sindyjoint):
    if write is workbook:
        pytest.importorskip("openpyxl")
    folder = tmp_path / "tests"
    folder.mkdir()
    write(folder, truth)
    # In this process, which has loaded its libraries; in a new one below.
    answers = [sindyjoint(*words) for words in commands(folder, tmp_path / "results")]
    found = ends_in_a_report(answers, tmp_path / "results", simulated=write is virtual)
    assert found.status == 0 and "no   " not in found.stdout
    assert "Coulomb friction" in found.stdout


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.parametrize("name", ["friction-damper", "emps", "arm-joint"])
def test_public_data(name, tmp_path, sindyjoint):
    if not (PUBLIC / name).is_dir():
        pytest.skip(f"public data {name} is not beside the checkout")
    folder = without_manifest(PUBLIC / name, tmp_path / name)
    answers = [sindyjoint(*words) for words in commands(folder, tmp_path / "results", TOLD.get(name, ()))]
    assert answers[0].status == 0 and "guessed" not in answers[0].stdout, answers[0].stderr
    assert answers[2].status == 0, answers[2].stderr
    ends_in_a_report([answers[0], answers[0], answers[2]], tmp_path / "results", simulated=False)


# Several peculiarities at once: how letters are coded (the C locale knows ASCII only, the console more), and
# how lines are laid out. Consoles of the C locale: tests/cli/test_cli_encoding.py.
ODD = {
    "LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "TERM": "dumb",
    "PYTHONIOENCODING": "cp1252", "NO_COLOR": "1", "COLUMNS": "80",
}  # fmt: skip


def test_any_terminal(tmp_path):
    made = simulate(frequencies=[3, 5], levels=[0.5, 0.9], duration=2.5, sample_rate=500.0, random_state=0)
    write_campaign(made, tmp_path / "tests").unlink()
    quick = ("--library", "paper", "--no-correct")
    answers = walk_in_one(tmp_path / "tests", tmp_path / "results", ODD, quick)
    assert [answer.status for answer in answers] == [0, 0, 0]
    assert all(without_stages(answer.stderr, ()) == "" and "\x1b" not in answer.stdout for answer in answers)
    files = {path.name for path in (tmp_path / "results").iterdir()}
    assert files == {"model.json", "report.html", "terms.csv", "figures", "SHA256SUMS"}
    assert [line for line in answers[2].stdout.splitlines() if len(line) > 110] == []
