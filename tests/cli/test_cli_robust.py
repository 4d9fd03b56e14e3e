"""Silly options, tampered files, closed outputs, interruptions: one line and an exit status, never a traceback."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest
from made_models import paper_model


def refused(answer, *words, status=2):
    assert answer.status == status, answer
    assert answer.stderr.count("\n") == 1 and answer.stderr.startswith("sindyjoint: "), answer.stderr
    for word in words:
        assert word in answer.stderr, answer.stderr
    assert "\x1b" not in answer.stderr and "Traceback" not in answer.stderr


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--jobs", "0"], ["0 is neither a positive number nor -1"]),
        (["--jobs", "-2"], ["-2 is neither"]),
        (["--cluster", "nonsense"], ["'nonsense' is no address of a scheduler"]),
        (["--out", ""], ["nothing is given where something is expected (--out)"]),
        (["--out="], ["nothing is given where something is expected (--out=)"]),
        (["--library", ""], ["(--library)"]),
        (["--random-state", "-1"], ["--random-state"]),
        (["--out", "x" * 300], ["File name too long"]),
        (["--out", "x/" * 3000], ["File name too long"]),
    ],
)
@pytest.mark.parametrize("command", ["discover", "diagnose", "compare"])
def test_options_that_mean_nothing(folder, tmp_path, sindyjoint, monkeypatch, command, options, words):
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    refused(sindyjoint(command, folder.path, *options), *words)
    assert sorted(tmp_path.rglob("*")) == before


def test_options_that_would_do_nothing(folder, sindyjoint):
    address = ("--cluster", "tcp://127.0.0.1:9")
    refine = ("discover", folder.path, "--refine", "--model", folder.path)
    refused(sindyjoint(*refine, *address), "--cluster", "belongs to a search for terms")
    refused(sindyjoint(*refine, "--no-correct"), "--correct", "belongs to a search for terms")
    batch = ("batch", folder.path, "--out", folder.path / "out", "--verify-only")
    refused(sindyjoint(*batch, *address), "--verify-only", "leave out --workers and --cluster")
    answer = sindyjoint("discover", folder.path, "-l", "paper", "--no-correct", "--workers", "2")
    assert "not used, for no run is too long" in answer.stdout


def test_a_temperature_in_degrees_however_they_are_spelled(folder):
    from sindyjoint.files import load_campaign

    for text in ("23 degreeC", "23 degC", "23 celsius", "73.4 degF"):
        folder.manifest(
            (folder.path / "campaign.toml").read_text().split("\n[channels]")[0].split("\ntemperature")[0]
            + f'\ntemperature = "{text}"\n\n[channels]'
            + (folder.path / "campaign.toml").read_text().split("\n[channels]")[1]
        )
        assert abs(load_campaign(folder.path).joint.temperature - 296.15) < 1e-9


@pytest.mark.parametrize("unit", ["dB*N*m", "Np*N*m", "dB", "N*m*degC", "N*m*mi**99.999"])
def test_units_without_a_factor(folder, sindyjoint, unit):
    folder.replace('unit = "N*m"', f'unit = "{unit}"')
    refused(sindyjoint("check", folder.path), "[channels] moment", "unit '")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("a = " + "[" * 5000, "nested too deeply"),
        ("a = " + "9" * 5000, "is not valid TOML"),
        ("a = " + "9" * 400, "holds an integer"),
        ("a." * 50_000 + "a = 1", "a key has more than 32 parts"),
        ("a." * 30 + "a = 1\n[[run]]", "unknown key"),
        ("d = 2026-13-45", "is not valid TOML"),
        ('[joint]\nname = "\\u001b[31mred"', "holds the control character U+001B"),
    ],
)
def test_documents_beyond_all_bounds(tmp_path, sindyjoint, text, word):
    begun = time.process_time()
    for name, command in (
        ("campaign.toml", ("check", "campaign.toml")),
        ("rig.toml", ("rig", "rig.toml")),
        ("own.toml", ("libraries", "check", "own.toml")),
    ):
        path = tmp_path / name
        path.write_text(text)
        answer = sindyjoint(*command[:-1], path)
        refused(answer, name)
        if name == "campaign.toml":
            refused(answer, word)
    assert time.process_time() - begun < 10


def tampered(change):
    data = json.loads(paper_model().to_json())
    change(data)
    return json.dumps(data)


MODELS = {
    "text": tampered(lambda d: d["terms"][0].update(coefficient="6066")),
    "null": tampered(lambda d: d["terms"][0].update(coefficient=None)),
    "1e30": tampered(lambda d: d["terms"][0].update(coefficient=1e30)),
    "400 digits": tampered(lambda d: d["terms"][0].update(coefficient=10**399)),
    "nan": tampered(lambda d: d["covariance"][0].__setitem__(0, float("nan"))),
    "misshapen": tampered(lambda d: d["covariance"].pop()),
    "asymmetric": tampered(lambda d: d["covariance"][0].__setitem__(1, d["covariance"][0][0])),
    "negative variance": tampered(lambda d: d["covariance"][1].__setitem__(1, -1.0)),
    "twice": tampered(lambda d: d["terms"].__setitem__(1, d["terms"][0])),
    "null formula": tampered(lambda d: d["terms"][2].update(formula=None)),
    "terms are a table": tampered(lambda d: d.update(terms={})),
    "a term is text": tampered(lambda d: d["terms"].__setitem__(0, "k1")),
    "joint is null": tampered(lambda d: d.update(joint=None)),
    "labels": tampered(lambda d: d["joint"].update(labels=[1])),
    "escape": tampered(lambda d: d["joint"].update(name="\x1b[31mred")),
    "surrogate": tampered(lambda d: d["joint"].update(name="\ud800")),
    "rms": tampered(lambda d: d["fitted"].update(moment_rms="3")),
    "deep": "[" * 100_000,
}


@pytest.mark.parametrize("kind", MODELS)
def test_a_tampered_model_is_refused_by_every_command(tmp_path, sindyjoint, kind):
    (tmp_path / "model.json").write_text(MODELS[kind])
    for command in (
        ("export", tmp_path, "--to", "c"),
        ("verify", tmp_path, "pulse-rig"),
        ("rig", "pulse-rig", "--model", tmp_path / "model.json"),
        ("diagnose", "pulse-rig", "--model", tmp_path),
    ):
        refused(sindyjoint(*command), "model.json")


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("elements = 8", "elements = 20000", "elements"),
        ('step = "0.5 ms"', 'step = "1e-9 s"', "steps of time"),
        ('length = "', 'length = "1e30 m" #', "no part of a structure has that"),
        ('duration = "', 'duration = "-5 s" #', "expected"),
    ],
)
def test_rigs_beyond_all_measure(tmp_path, sindyjoint, old, new, word):
    from tests.conftest import RIGS

    text = (RIGS / "pulse-rig.toml").read_text(encoding="utf-8")
    if old not in text:
        assert "[output]" in text
        text = text.replace("[output]", f"[output]\n{new}")
        new = old = ""
    (tmp_path / "rig.toml").write_text(text.replace(old, new, 1) if old else text)
    begun = time.process_time()
    refused(sindyjoint("rig", tmp_path / "rig.toml"), "rig.toml", word)
    assert time.process_time() - begun < 5


def test_functions_of_functions_are_refused_before_they_are_printed():
    from sindyjoint.equation import formula_latex, parse_formula
    from sindyjoint.errors import FormulaError

    def nested(levels):
        text = "omega"
        for _ in range(levels):
            text = f"2*exp(-{text})"
        return text

    begun = time.process_time()
    formula_latex(parse_formula(nested(5)))
    with pytest.raises(FormulaError, match="nested deeper than 5 levels"):
        parse_formula(nested(6))
    # Without the limit minutes, and beyond a further level hours.
    assert time.process_time() - begun < 30


def test_no_cell_is_a_formula_of_a_spreadsheet():
    from sindyjoint.reporting import csv_text

    text = csv_text(
        ("=a", "b"), [('=HYPERLINK("http://x")', "-0.5"), ("@x", "+1e5"), ("-x", -2.0), ("a=b", "\tx")]
    )
    assert text.splitlines() == [
        "'=a,b",
        '"\'=HYPERLINK(""http://x"")",-0.5',
        "'@x,+1e5",
        "'-x,-2.0",
        "a=b,'\tx",
    ]


def run(*command, **options):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run(
        [sys.executable, "-m", "sindyjoint", *command],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_or_closed_output():
    with open("/dev/full", "w") as full:
        done = run("schema", stdout=full)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "No space left" in done.stderr
    shell = f"'{sys.executable}' -m sindyjoint libraries list"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    closed = subprocess.run(["sh", "-c", f"{shell} >&-"], env=environment, stderr=subprocess.PIPE, text=True)
    assert (
        closed.returncode == 2 and closed.stderr.count("\n") == 1 and "Bad file descriptor" in closed.stderr
    )
    both = subprocess.run(["sh", "-c", f"{shell} >/dev/null 2>&-"], env=environment)
    assert both.returncode == 0


def test_a_path_that_is_no_utf_8(tmp_path):
    done = run("check", os.fsencode(tmp_path) + b"/\xff\xfe.toml", "--quiet", stdout=subprocess.PIPE)
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and "does not exist" in done.stderr


COMMANDS = ["discover", "compare", "diagnose", "reproduce"]  # others in test_cli_interrupted.py


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("command", COMMANDS)
def test_an_interruption_is_one_line(heard, tmp_path, command):
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, "-m", "sindyjoint", command, "--verbose"],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
    )  # fmt: skip
    first = process.stderr.readline()  # the first stage has begun
    process.send_signal(signal.SIGINT)
    _, rest = process.communicate(timeout=120)
    lines = [line for line in (first + rest).splitlines() if not line.lstrip()[:1].isdigit()]
    assert process.returncode == 130 and lines == ["sindyjoint: interrupted"], rest
