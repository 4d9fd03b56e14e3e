"""sindyjoint libraries: list, show, copy, check."""

import json

import pytest

from sindyjoint.cli import main
from tests.conftest import LIBRARIES
from tests.doors.asked import ask


def run(*arguments):
    answer = ask("libraries", *arguments)
    assert answer.status == 0, answer.stderr
    return answer.stdout


def refused(*arguments):
    """Return the line on stderr."""
    answer = ask("libraries", *arguments)
    assert answer.status == 2 and answer.stdout == "" and answer.stderr.count("\n") == 1
    return answer.stderr.rstrip("\n")


def test_list_names_every_catalogue():
    lines = run("list").splitlines()
    assert lines[0].split() == ["library", "terms", "description"]
    assert [line.split()[:2] for line in lines[1:]] == [
        [entry["name"], str(entry["terms"])] for entry in json.loads(run("list", "--json"))
    ]
    assert [line.split()[0] for line in lines[1:]] == sorted(path.stem for path in LIBRARIES.glob("*.toml"))
    assert lines[2].split()[0] == "extended" and "candidates from every family" in lines[2]


def test_list_as_json():
    record = json.loads(run("list", "--json"))
    assert {entry["name"]: entry["terms"] for entry in record}["paper"] == 5


@pytest.mark.parametrize("name", ["paper", "extended", "friction"])
def test_show_is_plain_text_when_piped(name):
    output = run("show", name)
    assert output.isascii()
    lines = output.splitlines()
    assert lines[0].split() == ["id", "symbol", "formula", "unit", "parameters", "meaning"]
    for line, term in zip(lines[1:], json.loads(run("show", name, "--json"))["terms"], strict=True):
        assert line.startswith(f"{term['id']} ") and line.endswith(term["meaning"])
        assert all(f" {term[key]} " in line for key in ("symbol", "formula", "unit"))


def test_show_says_what_inner_parameters_are():
    assert "v_s = 0.1 of the largest rate" in run("show", "friction")


def test_show_for_translation():
    line = run("show", "damping", "--motion", "translation").splitlines()[1]
    assert " v*abs(v) " in line and " N*s^2/m^2 " in line


def test_show_as_json():
    record = json.loads(run("show", "extended", "--json"))
    assert record["schema"] == 1 and record["name"] == "extended" and record["motion"] == "rotation"
    assert {"linear_stiffness", "coulomb_friction"} <= {term["id"] for term in record["terms"]} and len(
        record["terms"]
    ) == 24
    stribeck = record["terms"][-1]
    assert stribeck["symbol"] == "M_S" and stribeck["unit"] == "N*m" and stribeck["symmetry"] == "odd"
    assert stribeck["parameters"] == [
        {"name": "v_s", "unit": "rad/s", "value": 0.1, "relative_to": "rate", "lower": 0.01, "upper": 1.0}
    ]
    translated = json.loads(run("show", "extended", "--json", "--motion", "translation"))["terms"][-1]
    assert (
        translated["parameters"][0]["unit"] == "m/s" and translated["formula"] == "exp(-abs(v)/v_s)*sign(v)"
    )


def test_copy_is_byte_for_byte_and_never_overwrites(tmp_path):
    target = tmp_path / "mine.toml"
    run("copy", "extended", str(target))
    assert target.read_bytes() == (LIBRARIES / "extended.toml").read_bytes()
    target.write_text("precious")
    assert "mine.toml exists already; give another name" in refused("copy", "extended", str(target))
    assert target.read_text() == "precious"
    run("copy", "paper", str(tmp_path))
    assert (tmp_path / "paper.toml").read_bytes() == (LIBRARIES / "paper.toml").read_bytes()
    assert "paper.toml exists already" in refused("copy", "paper", str(tmp_path))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.toml", "paper.toml"]


def test_copy_into_a_folder_that_is_not_there(tmp_path):
    target = tmp_path / "nowhere" / "mine.toml"
    assert "cannot write" in refused("copy", "paper", str(target))
    assert not target.parent.exists()


def test_check_says_that_a_file_is_in_order(tmp_path):
    target = tmp_path / "mine.toml"
    run("copy", "measurement", str(target))
    assert run("check", str(target)) == f"{target}: in order, 1 term: constant_moment\n"


def test_check_says_in_one_line_what_is_wrong(tmp_path):
    target = tmp_path / "mine.toml"
    text = (LIBRARIES / "measurement.toml").read_text(encoding="utf-8")
    target.write_text(text.replace('formula = "1"', 'formula = "theta.real"'), encoding="utf-8")
    message = refused("check", str(target))
    assert message.startswith("sindyjoint: mine.toml: term 'constant_moment': formula 'theta.real': ")
    assert "\n" not in message
    assert "no such file" in refused("check", str(tmp_path / "nowhere.toml"))


def test_unknown_names_are_answered_with_the_nearest():
    for command in (["show", "papr"], ["copy", "papr", "x.toml"]):
        assert "library 'papr' is unknown; did you mean 'paper'?" in refused(*command)


def test_every_command_has_help():
    for command in ("list", "show", "copy", "check"):
        assert len(run(command, "--help").splitlines()) > 5


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'formula = "theta.real"',
            "term 'constant_moment': formula 'theta.real': 'theta.real' (attribute access)",
        ),
        (
            'formula = "theta**99"',
            "term 'constant_moment': formula 'theta**99': the exponent of 'theta ** 99'",
        ),
        ('formula = "theta +"', "term 'constant_moment': formula 'theta +': it is not an expression"),
        ('formula = "theta"', "term 'constant_moment': unit 'N*m' times theta is not N*m; expected N*m/rad"),
        ('formla = "1"', "[[term]] 1 (constant_moment): unknown key 'formla'; did you mean 'formula'?"),
        ('include = "mine.toml"', "[[term]] 1 (constant_moment): unknown key 'include'"),
    ],
)
def test_a_faulty_file_ends_the_program_with_status_2_and_one_line(tmp_path, capsys, text, message):
    target = tmp_path / "mine.toml"
    shipped = (LIBRARIES / "measurement.toml").read_text(encoding="utf-8")
    target.write_text(shipped.replace('formula = "1"', text), encoding="utf-8")
    for command in ("check", "show"):
        with pytest.raises(SystemExit) as left:
            main(["libraries", command, str(target)])
        assert left.value.code == 2
        output = capsys.readouterr()
        assert output.out == ""
        assert output.err.startswith(f"sindyjoint: mine.toml: {message}") and output.err.count("\n") == 1


def test_a_good_file_ends_the_program_with_status_0(capsys):
    with pytest.raises(SystemExit) as left:
        main(["libraries", "check", str(LIBRARIES / "extended.toml")])
    assert left.value.code == 0
    assert "in order, 24 terms: linear_stiffness" in capsys.readouterr().out
