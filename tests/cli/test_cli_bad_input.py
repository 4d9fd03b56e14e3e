"""Bad input on the command line: exit status 2, one line on stderr that names file and field, nothing left behind."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.io

TERM = """
[[term]]
id = "mine"
symbol = "q"
formula = "theta**5"
unit = "N*m/rad^5"
name = "mine"
meaning = "a term of one's own"
family = "stiffness"
source = "test"
"""


def catalogue(folder, text=TERM, head='name = "own"\ndescription = "of one\'s own"\n'):
    path = folder.path / "own.toml"
    path.write_text(head + text, encoding="utf-8")
    return ["--library", path]


def no_file(f):
    return f.path / "nowhere.toml"


def empty_manifest(f):
    f.manifest("")


def empty_run(f):
    (f.path / "run.csv").write_bytes(b"")


def folder_without_manifest(f):
    (f.path / "campaign.toml").unlink()


def folder_as_run(f):
    (f.path / "run.csv").unlink()
    (f.path / "run.csv").mkdir()


def truncated_mat(f):
    scipy.io.savemat(
        f.path / "run.mat", {name: values for name, values in f.columns.items()}, do_compression=True
    )
    data = (f.path / "run.mat").read_bytes()
    (f.path / "run.mat").write_bytes(data[: len(data) // 2])
    f.replace("run.csv", "run.mat")


def rubbish(f):
    (f.path / "run.csv").write_bytes(np.random.default_rng(0).bytes(4000))


def missing_column(f):
    f.replace('column = "m"', 'column = "torque"')


def duplicate_column(f):
    f.line(1, "t,m,m")
    f.replace('column = "a"', 'column = "m"')


def unknown_unit(f):
    f.replace('unit = "mrad"', 'unit = "mradd"')


def wrong_unit(f):
    f.replace('unit = "N*m"', 'unit = "N"')


def not_a_number(f):
    f.table(f.columns | {"m": np.where(f.columns["t"] < 1.2, np.nan, f.columns["m"])})


def infinite(f):
    f.table(f.columns | {"a": np.where(f.columns["t"] < 1.2, np.inf, f.columns["a"])})


def text(f):
    f.line(9, "0.0175,abc,0.1")


def backwards(f):
    f.line(9, "0.001,0.1,0.1")


def duplicate_stamp(f):
    f.line(9, "0.015,0.1,0.1")


def irregular(f):
    f.line(9, "0.0179,0.1,0.1")


def too_few(f):
    f.table({name: values[:20] for name, values in f.columns.items()})


def too_slow(f):
    f.replace("frequency = 4.0", "frequency = 100.0")


def constant(f):
    f.table(f.columns | {"a": np.full(800, 0.3)})


def absent_frequency(f):
    f.replace("frequency = 4.0", "frequency = 7.0")


def lengths(f):
    np.savez(f.path / "run.npz", t=f.columns["t"], m=f.columns["m"][:-1], a=f.columns["a"])
    f.replace("run.csv", "run.npz")


def idle(f):
    noise = np.random.default_rng(1).normal(size=(2, 4000))
    f.table({"t": np.arange(4000) / 400.0, "m": noise[0], "a": noise[1]})
    f.replace("frequency = 4.0\n", "")


def dependent_terms(f):
    return catalogue(
        f, TERM + TERM.replace('"mine"', '"double"').replace('"q"', '"p"').replace("theta**5", "2*theta**5")
    )


def unknown_term(f):
    return ["--require", "coulom_friction"]


def unknown_library(f):
    return ["--library", "extendet"]


def syntax(f):
    return catalogue(f, TERM.replace("theta**5", "theta**"))


def import_call(f):
    return catalogue(f, TERM.replace("theta**5", "__import__('os').system('touch pwned')"))


def attribute(f):
    return catalogue(f, TERM.replace("theta**5", "theta.real"))


def huge_power(f):
    return catalogue(f, TERM.replace("theta**5", "theta**9**9**9"))


def unit_mismatch(f):
    return catalogue(f, TERM.replace("N*m/rad^5", "N*m/rad^3"))


def includes_itself(f):
    return catalogue(f, TERM, 'name = "own"\ndescription = "round and round"\ninclude = ["own.toml"]\n')


def unknown_key(f):
    f.replace("frequency = 4.0", "freqency = 4.0")


def negative_inertia(f):
    f.replace('"0.02 kg*m^2"', '"-0.02 kg*m^2"')


def beta_zero(f):
    f.table({name: f.columns["m"] for name in ("t", "e1", "e2", "e3", "e4")} | f.columns)
    f.replace('moment = { column = "m", unit = "N*m" }\n', "")
    f.replace(
        "[[run]]",
        '[rig]\nstrain = ["e1", "e2", "e3", "e4"]\nbending_stiffness = "2333 N*m^2"\nsection_height = "20 mm"\n'
        "strain_position_factor = 0.0\n[[run]]",
    )


def bandwidth(f):
    return ["--bandwidth", "-3"]


def threshold(f):
    return ["--threshold", "7"]


def method(f):
    return ["--method", "magic"]


def option(f):
    return ["--libary", "paper"]


# what is bent -> what the one line must hold
CASES = {
    no_file: ("nowhere.toml", "does not exist"),
    empty_manifest: ("campaign.toml", "is empty"),
    empty_run: ("run.csv", "is empty"),
    folder_without_manifest: ("campaign", "holds no campaign.toml"),
    folder_as_run: ("run.csv", "is a folder; expected a data file"),
    truncated_mat: ("run.mat", "MATLAB"),
    rubbish: ("run.csv", "is not a text table"),
    missing_column: ("run.csv", "column 'torque' is missing; columns there: 't', 'm', 'a'"),
    duplicate_column: ("run.csv", "column 'm' is there 2 times"),
    unknown_unit: ("campaign.toml", "[channels] angle", "unit 'mradd' is unknown"),
    wrong_unit: ("campaign.toml", "[channels] moment", "unit 'N' is not a moment"),
    not_a_number: ("run.csv", "column 'm' holds nan in line 2 and 479 more"),
    infinite: ("run.csv", "column 'a' holds inf in line 2 and 479 more"),
    text: ("run.csv", "line 9", "column 'm' holds 'abc'; expected a number"),
    backwards: ("run.csv", "column 't': time runs backwards in line 9"),
    duplicate_stamp: ("run.csv", "column 't': duplicate time stamp in line 9"),
    irregular: ("run.csv", "irregular beyond 1 %", "line 9", "[channels] resample = true"),
    too_few: ("run.csv", "20 samples; expected at least 32"),
    too_slow: ("run.csv", "sampling at 400 Hz is too slow for 100 Hz"),
    constant: ("run.csv", "angle is constant"),
    absent_frequency: ("run.csv", "frequency 7 Hz is absent from the data"),
    lengths: ("run.npz", "moment has 799 samples", "expected equal lengths"),
    dependent_terms: ("double", "more terms than independent columns"),
    unknown_term: ("coulom_friction", "coulomb_friction"),
    unknown_library: ("library 'extendet' is unknown; did you mean 'extended'?",),
    syntax: ("own.toml", "term 'mine'", "formula 'theta**'"),
    import_call: ("own.toml", "term 'mine'", "__import__"),
    attribute: ("own.toml", "term 'mine'", "theta.real"),
    huge_power: ("own.toml", "term 'mine'", "9**9"),
    unit_mismatch: ("own.toml", "term 'mine'", "N*m/rad^3"),
    includes_itself: ("own.toml", "includes itself"),
    unknown_key: ("campaign.toml", "[[run]] 1", "unknown key 'freqency'; did you mean 'frequency'?"),
    negative_inertia: ("campaign.toml", "[joint] inertia", "is negative"),
    beta_zero: ("campaign.toml", "[rig] strain_position_factor is 0.0"),
    bandwidth: ("bandwidth is -3.0 Hz", "a positive number"),
    threshold: ("threshold is 7.0", "from 0 to below 1"),
    method: ("method is 'magic'", "expected one of stlsq"),
    option: ("No such option", "--libary", "--library"),
}


def everything_under(path):
    return sorted(str(found.relative_to(path)) for found in path.rglob("*"))


@pytest.mark.parametrize("bend", CASES, ids=lambda bend: bend.__name__)
def test_refused_in_one_line(bend, folder, tmp_path, sindyjoint, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = bend(folder)
    campaign = given if given is not None and not isinstance(given, list) else folder.path
    options = given if isinstance(given, list) else []
    before = everything_under(tmp_path)
    answer = sindyjoint("discover", campaign, "--out", tmp_path / "results", *options)
    assert answer.status == 2, answer
    assert answer.stdout == ""
    assert answer.stderr.count("\n") == 1 and answer.stderr.startswith("sindyjoint: "), answer.stderr
    for words in CASES[bend]:
        assert words in answer.stderr
    assert "Traceback" not in answer.stderr
    assert everything_under(tmp_path) == before


def test_the_unbent_campaign_is_accepted(folder, sindyjoint):
    # The control: what every case bends is in order.
    answer = sindyjoint("discover", folder.path, "--library", "paper", "--json")
    assert answer.status == 0, answer
    assert answer.stderr == ""


def test_output_that_is_a_file(folder, tmp_path, sindyjoint):
    target = tmp_path / "results"
    target.write_text("precious")
    for out in (target, target / "deeper"):
        answer = sindyjoint("discover", folder.path, "--out", out)
        assert answer.status == 2
        assert "results" in answer.stderr and "is a file; expected the name of a folder" in answer.stderr
        assert answer.stderr.count("\n") == 1
    assert target.read_text() == "precious"


def unwritable(tmp_path):
    """Return a folder in which nobody can make files; permission bits do not bind the superuser."""
    if os.name == "posix" and os.geteuid() == 0:
        return "/proc/results" if os.path.isdir("/proc/self") else None
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    return str(closed / "results")


def test_output_that_cannot_be_written(folder, tmp_path, sindyjoint):
    target = unwritable(tmp_path)
    if target is None:
        pytest.skip("no place that refuses the superuser")
    answer = sindyjoint("discover", folder.path, "--out", target)
    assert answer.status == 2
    assert f"cannot write {target!r}" in answer.stderr and answer.stderr.count("\n") == 1


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_an_unreadable_run(folder, bound_by_permissions, sindyjoint):
    path, bound = bound_by_permissions
    path = Path(shutil.copytree(folder.path, path / "campaign"))
    # What the command loads lies perhaps where not everyone may read.
    assert sindyjoint("check", path).status == 0
    (path / "run.csv").chmod(0)
    with bound():
        answer = sindyjoint("check", path)
    assert answer.status == 2
    assert "run.csv" in answer.stderr and answer.stderr.count("\n") == 1


def test_several_lines_in_a_name_stay_one_line(folder, sindyjoint):
    answer = sindyjoint("discover", folder.path / "a\nb\n\nc.toml")
    assert answer.status == 2
    assert answer.stderr.count("\n") == 1


def test_a_real_process_gives_status_two(folder, tmp_path, sindyjoint):
    folder.line(9, "0.0175,abc,0.1")
    run = subprocess.run(
        [sys.executable, "-m", "sindyjoint", "discover", str(folder.path), "--out", "results", "--quiet"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    # Here, without a folder to write into, the same.
    here = sindyjoint("discover", folder.path)
    for answer in ((run.returncode, run.stdout, run.stderr), here):
        assert (answer[0], answer[1], answer[2].count("\n")) == (2, "", 1)
        assert "run.csv: line 9: column 'm' holds 'abc'; expected a number" in answer[2]
    assert not (tmp_path / "results").exists()


def test_noise_alone_is_unsound_to_discover_as_to_check(folder, tmp_path, sindyjoint):
    idle(folder)
    for verb in ("check", "discover"):
        answer = sindyjoint(verb, folder.path, "--out", tmp_path / verb)
        assert answer.status == 1 and "no signal" in answer.stdout
