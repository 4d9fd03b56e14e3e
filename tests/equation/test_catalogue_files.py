"""Catalogue files of users: what works, and every fault in one line that names file, term and field."""

import json
import shutil

import pytest

from sindyjoint.equation import catalogue_file
from sindyjoint.errors import MissingInputError
from tests.conftest import LIBRARIES
from tests.doors.asked import ask

TERM = {
    "id": '"my_term"',
    "symbol": '"m"',
    "formula": '"theta*abs(omega)"',
    "unit": '"N*m*s/rad^2"',
    "name": '"mine"',
    "meaning": '"something of my own"',
    "family": '"mine"',
}


def toml(head="", **changes):
    """Return a catalogue of one term; a change to None leaves the key out."""
    fields = TERM | changes
    lines = [f"{key} = {value}" for key, value in fields.items() if value is not None]
    return "\n".join(['name = "mine"', 'description = "my own"', head, "[[term]]", *lines]) + "\n"


@pytest.fixture
def write(tmp_path):
    def write(text, name="mine.toml"):
        path = tmp_path / name
        path.write_bytes(text.encode() if isinstance(text, str) else text)
        return path

    return write


def shown(library, motion="rotation"):
    """Return the terms of a library as the command shows them, by id."""
    record = json.loads(ask("libraries", "show", library, "--motion", motion, "--json").stdout)
    return {term["id"]: term for term in record["terms"]}


def refused(path):
    """Return what a check of a library says that cannot be used."""
    answer = ask("libraries", "check", path)
    assert answer.status == 2 and not answer.stdout
    return answer.stderr.rstrip("\n")


def test_a_term_of_ones_own(write):
    path = write(toml())
    (term,), (sliding,) = shown(path).values(), shown(path, "translation").values()
    assert (term["id"], term["unit"], sliding["unit"]) == ("my_term", "N*m*s/rad^2", "N*s/m^2")
    assert term["source"] == "" and term["confused_with"] == [] and term["parameters"] == []


def test_a_translational_catalogue_means_the_same_term(write):
    text = toml(
        formula='"x*max(v/v_0, 0)"',
        unit='"N/m"',
        parameters='[{ name = "v_0", unit = "m/s", value = 0.25, lower = 0.1 }]',
    )
    path = write(text)
    (term,), (sliding,) = shown(path).values(), shown(path, "translation").values()
    assert (term["unit"], sliding["unit"]) == ("N*m/rad", "N/m")
    (parameter,), (same,) = term["parameters"], sliding["parameters"]
    assert (parameter["unit"], same["unit"]) == ("rad/s", "m/s")
    assert (parameter["value"], parameter["lower"], parameter["upper"]) == (0.25, 0.1, None)


def test_units_are_written_in_one_way(write):
    (term,) = shown(write(toml(unit='"m*s*N/rad/rad"'))).values()
    assert term["unit"] == "N*m*s/rad^2"


def test_includes_whole_and_in_part(write):
    write(toml(), "other.toml")
    head = 'include = ["paper", "other.toml", { catalogue = "damping", terms = ["cubic_damping"] }]'
    path = write(toml(head, id='"second"', symbol='"s"'), "main.toml")
    assert [*shown(path)] == [*shown("paper"), "my_term", "cubic_damping", "second"]


def test_the_same_term_along_two_ways_is_one_term(write):
    write('name = "a"\ndescription = "a"\ninclude = ["paper"]\n', "a.toml")
    path = write('name = "b"\ndescription = "b"\ninclude = ["a.toml", "paper", "./a.toml"]\n', "b.toml")
    assert shown(path) == shown("paper")


def test_a_copied_library_still_finds_what_it_includes(tmp_path):
    copied = shutil.copy(LIBRARIES / "extended.toml", tmp_path / "my_extended.toml")
    assert shown(copied) == shown("extended")


def test_paths_are_relative_to_the_file(write, tmp_path, monkeypatch):
    (tmp_path / "sub").mkdir()
    write(toml(), "sub/inner.toml")
    write('name = "m"\ndescription = "m"\ninclude = ["sub/inner.toml"]\n', "outer.toml")
    monkeypatch.chdir("/")
    assert [*shown(tmp_path / "outer.toml")] == ["my_term"]
    monkeypatch.chdir(tmp_path)
    assert [*shown("outer.toml")] == ["my_term"]
    assert [*shown("./outer.toml")] == ["my_term"]


def test_confused_with_may_name_what_is_not_there_in_a_file_of_ones_own(write):
    (term,) = shown(write(toml(confused_with='["nobody_knows"]'))).values()
    assert term["confused_with"] == ["nobody_knows"]


FAULTS = {
    "text after the value": (
        toml(head="include = [] nonsense"),
        "mine.toml: is not valid TOML: ",
    ),
    "empty file": ("", "mine.toml: key 'name' is missing"),
    "binary": (
        b"\xff\xfe\x00\x01",
        "mine.toml: is not UTF-8 text (byte 0); save it as UTF-8",
    ),
    "no terms": (
        'name = "m"\ndescription = "m"\n',
        "mine.toml: holds no term; add a [[term]] or include a catalogue",
    ),
    "unknown key": (
        toml(formla='"theta"'),
        "mine.toml: [[term]] 1 (my_term): unknown key 'formla'; did you mean 'formula'?",
    ),
    "unknown key far from all": (
        toml(zzz="1"),
        "mine.toml: [[term]] 1 (my_term): unknown key 'zzz'; known keys: confused_with, family, formula, id,",
    ),
    "unknown key at the top": (
        toml(head="includes = []"),
        "mine.toml: unknown key 'includes'; did you mean 'include'?",
    ),
    "missing key": (toml(unit=None), "mine.toml: [[term]] 1 (my_term): key 'unit' is missing"),
    "missing id": (toml(id=None), "mine.toml: [[term]] 1 (mine): key 'id' is missing"),
    "number for a text": (
        toml(formula="1"),
        "[[term]] 1 (my_term) formula: expected text in quotes, not 1",
    ),
    "id with a blank": (
        toml(id='"my term"'),
        "[[term]] 1 (my term) id: expected small letters, digits and _",
    ),
    "two lines": (toml(meaning='"a\\nb"'), "[[term]] 1 (my_term) meaning: expected one line of text"),
    "terms is a table": (
        'name = "m"\ndescription = "m"\n[term]\nid = "x"\n',
        "mine.toml: [term]: expected a list, not {'id': 'x'}",
    ),
    "term is a text": (
        'name = "m"\ndescription = "m"\nterm = ["linear_damping"]\n',
        "mine.toml: [[term]] 1: expected a table, not 'linear_damping'",
    ),
    "parameter with an unknown key": (
        toml(parameters='[{ name = "g", unit = "rad", valu = 1.0 }]'),
        "[[term]] 1 (my_term) parameters.1: unknown key 'valu'; did you mean 'value'?",
    ),
    "parameter with a misspelt extra key": (
        toml(parameters='[{ name = "g", unit = "rad", value = 1.0, relativ_to = "rate" }]'),
        "[[term]] 1 (my_term) parameters.1: unknown key 'relativ_to'; did you mean 'relative_to'?",
    ),
    "parameter relative to nothing known": (
        toml(parameters='[{ name = "g", unit = "rad", value = 1.0, relative_to = "time" }]'),
        "parameters.1.relative_to: expected 'angle', 'rate' or 'moment', not 'time'",
    ),
    "parameter outside its bounds": (
        toml(parameters='[{ name = "g", unit = "rad", value = 1.0, upper = 0.5 }]'),
        "parameters.1: expected 0 < lower <= value <= upper; given are 1, 1, 0.5",
    ),
    "negative parameter": (
        toml(parameters='[{ name = "g", unit = "rad", value = -1.0 }]'),
        "parameters.1: expected 0 < lower <= value <= upper; given are -1, -1, -1",
    ),
    "infinite parameter": (
        toml(parameters='[{ name = "g", unit = "rad", value = inf }]'),
        "parameters.1.value: expected a finite number, not inf",
    ),
    "include of a number": (
        toml(head="include = [3]"),
        "mine.toml: [[include]] 1: expected a table, not 3",
    ),
    "formula error": (
        toml(formula='"theta.real"'),
        "mine.toml: term 'my_term': formula 'theta.real': 'theta.real' (attribute access) is not allowed",
    ),
    "import in a formula": (
        toml(formula="\"__import__('os')\""),
        "mine.toml: term 'my_term': formula \"__import__('os')\": the character \"'\" (a text) is not allowed",
    ),
    "huge power": (toml(formula='"theta**99"'), "the exponent of 'theta ** 99' is beyond 12"),
    "zero": (toml(formula='"theta - theta"'), "the formula is zero whatever the motion"),
    "wrong unit": (
        toml(unit='"N*m/rad"'),
        "mine.toml: term 'my_term': unit 'N*m/rad' times theta*abs(omega) is not N*m; expected N*m*s/rad^2",
    ),
    "wrong unit of translation": (
        toml(unit='"N/m"', formula='"x**2"'),
        "unit 'N/m' times x**2 is not N; expected N/m^2",
    ),
    "rotation and translation mixed": (
        toml(unit='"N*m*s/m^2"'),
        "unit 'N*m*s/m^2' times theta*abs(omega) is not N*m; expected N*m*s/rad^2",
    ),
    "unit that nobody knows": (
        toml(unit='"furlong"'),
        "term 'my_term': unit 'furlong' cannot be read",
    ),
    "unit with a factor": (
        toml(unit='"N*mm*s/rad^2"'),
        "unit 'N*mm*s/rad^2' is not made of m, kg, s, rad, N, K, Pa, V, A only; catalogues are in SI: scale the value",
    ),
    "formula that does not fit in itself": (
        toml(formula='"theta + omega"'),
        "term 'my_term': omega + theta combines omega in rad/s with theta in rad; expected equal units",
    ),
    "parameter that is not used": (
        toml(parameters='[{ name = "g", unit = "rad", value = 1.0 }]'),
        "term 'my_term': parameter 'g' does not occur in the formula; use it or take it out",
    ),
    "parameter twice": (
        toml(
            formula='"theta*g"',
            parameters='[{ name = "g", unit = "1", value = 1.0 }, { name = "g", unit = "1", value = 1.0 }]',
        ),
        "a parameter name is used twice among g, g",
    ),
    "parameter with a reserved name": (
        toml(formula='"theta*pi"', parameters='[{ name = "pi", unit = "1", value = 1.0 }]'),
        "parameter name 'pi' already means something in a formula",
    ),
    "parameter of another dimension than its scale": (
        toml(
            formula='"max(theta, g)"',
            unit='"N*m/rad"',
            parameters='[{ name = "g", unit = "rad", value = 1.0, relative_to = "rate" }]',
        ),
        "parameter 'g' is relative to the rate and has the unit 'rad'; expected rad/s",
    ),
    "id twice": (
        toml() + toml(symbol='"n"').partition("\n\n")[2],
        "mine.toml: the id 'my_term' is used twice; give each term another id",
    ),
    "symbol twice": (
        toml() + toml(id='"other"').partition("\n\n")[2],
        "mine.toml: terms 'my_term' and 'other' both have the symbol 'm'; a symbol belongs to one term",
    ),
    "id of an included library": (
        toml(head='include = ["paper"]', id='"linear_damping"'),
        "mine.toml: term 'linear_damping' is defined in paper.toml and in mine.toml; include one of them, or rename",
    ),
    "include of an unknown library": (
        toml(head='include = ["papr"]'),
        "mine.toml: include: library 'papr' is unknown; did you mean 'paper'?",
    ),
    "include of a file that is not there": (
        toml(head='include = ["papr.toml"]'),
        "mine.toml: include: catalogue papr.toml: no such file",
    ),
    "pick of an unknown term": (
        toml(head='include = [{ catalogue = "paper", terms = ["linear_damper"] }]'),
        "mine.toml: include: 'paper' has no term 'linear_damper'; did you mean 'linear_damping'?",
    ),
    "include of itself": (
        toml(head='include = ["mine.toml"]'),
        "catalogue mine.toml includes itself: mine.toml → mine.toml; take one include out",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_in_one_line(write, fault):
    text, message = FAULTS[fault]
    said = refused(write(text))
    assert message in said and "mine.toml" in said and "\n" not in said


def test_a_circle_of_includes_is_named_link_by_link(write):
    write(toml(head='include = ["b.toml"]'), "a.toml")
    write(toml(head='include = ["c.toml"]', id='"b"', symbol='"b"'), "b.toml")
    write(toml(head='include = ["a.toml"]', id='"c"', symbol='"c"'), "c.toml")
    path = write(toml(head='include = ["a.toml"]', id='"d"', symbol='"d"'), "d.toml")
    assert "a.toml includes itself: a.toml → b.toml → c.toml → a.toml; take one" in refused(path)


def test_files_that_are_not_there(tmp_path):
    assert "nowhere.toml: no such file" in refused(tmp_path / "nowhere.toml")
    assert "paper.toml: no such file; the shipped library is called 'paper'" in refused(
        tmp_path / "paper.toml"
    )
    assert "is a folder; expected a .toml file" in refused(tmp_path)


@pytest.mark.parametrize("name", sorted(path.stem for path in LIBRARIES.glob("*.toml")))
def test_what_ships_passes_the_checks_of_a_file_of_ones_own(name, tmp_path):
    # A process takes the shipped file as it is; a copy of it is checked, and brought into the form of a term.
    shutil.copy(LIBRARIES / f"{name}.toml", tmp_path / "mine.toml")
    assert shown(tmp_path / "mine.toml") == shown(name)


def test_the_folder_is_found_in_a_wheel_and_beside_the_package(tmp_path, monkeypatch):
    package = tmp_path / "site" / "sindyjoint"
    (package / "discovery").mkdir(parents=True)
    monkeypatch.setattr(catalogue_file, "__file__", str(package / "discovery" / "catalogue_file.py"))
    with pytest.raises(
        MissingInputError, match="the shipped catalogues are neither in .* install sindyjoint again"
    ):
        catalogue_file.library_folder()
    for place in (package.parent / "libraries", package / "libraries"):  # editable first, then the wheel's
        place.mkdir()
        (place / "paper.toml").write_text("")
        assert catalogue_file.library_folder() == place
