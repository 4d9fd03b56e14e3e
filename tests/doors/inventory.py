"""Everything that a user can reach, read through the doors alone, and the test that holds it.

``python -m tests.doors.inventory`` writes ``inventory.json`` again; ``test_inventory.py`` compares.
"""

from __future__ import annotations

import ast
import inspect
import json
import re
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

from tests.doors.asked import ask
from tests.doors.truth import Truth, write

TESTS = Path(__file__).resolve().parents[1]
GOLDEN = Path(__file__).with_name("inventory.json")
DOORS = "tests/doors/"

_RIGS = "tests/diagnosis/test_diagnosis_structure.py::"
_FAULTS = "tests/soundness/test_soundness_faults.py::"
#: What holds all items of a section: a test that goes through the section itself, so that no item is without.
HOLDERS = {
    "commands": "tests/cli/test_cli_help.py::test_help_with_an_example",
    "effects": DOORS + "test_doors_effects.py::test_an_effect_is_named",
    "effects of a structure": _RIGS + "test_what_is_hidden_is_named_and_the_gap_falls_to_the_noise",
    "terms": "tests/equation/test_catalogue.py::test_every_term_is_finite_on_a_grid",
    "faults": _FAULTS + "test_a_fault_is_found_under_its_name_and_says_what_it_does_and_what_helps",
    "formats read": "tests/files/test_files_readers.py::test_the_same_numbers_come_back",
    "formats written": "tests/files/test_files_writers.py::test_every_format_returns_every_bit",
    "targets": DOORS + "test_doors_exports.py::test_a_target_writes_what_it_promises",
    "methods": DOORS + "test_doors_verbs.py::test_every_method_finds_the_law",
    "records": DOORS + "test_doors_verbs.py::test_what_is_printed_is_what_the_schema_says",
    "names": DOORS + "test_inventory.py::test_public_names_are_documented_and_signed",
    "errors": DOORS + "test_inventory.py::test_errors_are_of_one_family",
}


def inventory(run: Callable) -> dict[str, dict[str, object]]:
    """Return section → item → what is known of it; `run` is the command line."""
    import sindyjoint
    from sindyjoint import errors
    from sindyjoint.export import TARGETS

    def listed(*arguments: object) -> list[str]:
        """The names that a refusal offers."""
        return [
            each
            for each in run(*arguments).stderr.split("expected one of ")[1].strip().split(", ")
            if " " not in each
        ]

    names = {name: parameters(getattr(sindyjoint, name)) for name in sindyjoint.__all__}
    effects = json.loads(run("libraries", "effects", "--json").stdout)
    libraries = [each["name"] for each in json.loads(run("libraries", "list", "--json").stdout)]
    shown = {each: json.loads(run("libraries", "show", each, "--json").stdout)["terms"] for each in libraries}
    records = listed("schema", "--of", "nothing")
    folder = Path(tempfile.mkdtemp())
    write(folder, Truth(frequencies=(4.0,), levels=(4e-4,), seconds=1.0).runs())
    text = (folder / "campaign.toml").read_text()
    (folder / "odd.toml").write_text(text.replace(".csv", ".odd"))
    (folder / "4Hz-0.odd").write_text("1")
    return {
        "commands": {" ".join(path): options for path, options in commands(run)},
        "effects": {each["id"]: each["family"] for each in effects},
        "effects of a structure": {each: "" for each in structure_effects()},
        "terms": {name: [term["id"] for term in terms] for name, terms in shown.items()},
        "faults": dict.fromkeys(listed("check", folder, "--accept", "nothing"), ""),
        "formats read": dict.fromkeys(listed("check", folder / "odd.toml"), ""),
        "formats written": dict.fromkeys(formats_written(run), ""),
        "targets": dict.fromkeys(TARGETS, ""),
        "methods": dict.fromkeys(listed("discover", folder, "--method", "nothing"), ""),
        "records": {each: fields(json.loads(run("schema", "--of", each).stdout)) for each in records},
        "names": names,
        "errors": {name: "" for name in sorted(vars(errors)) if name.endswith("Error")},
    }  # fmt: skip


def parameters(public: object) -> list[str]:
    """Return the names of the parameters of a public name; of data and of an exception there are none."""
    try:
        return list(inspect.signature(public).parameters)
    except (TypeError, ValueError):
        return []


def commands(run: Callable, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], list[str]]]:
    """Yield every command that does something, with its options, from the help."""
    text = run(*path, "--help").stdout
    options = re.findall(r"^ +(?:-\w, )?(--[a-z][a-z-]*)(?: / (--[a-z-]+))?", text, re.M)
    found = sorted({each for pair in options for each in pair if each} - {"--help"})
    head, _, children = text.partition("\nCommands:\n")
    yield path, found
    for name in re.findall(r"^  (\w[\w-]*)", children, re.M):
        yield from commands(run, (*path, name))


def fields(schema: dict) -> list[str]:
    """Return the names of all fields of a schema, those of parts behind the part's name."""
    parts = {"": schema, **schema.get("$defs", {})}
    return sorted(
        f"{name}.{each}".lstrip(".") for name, part in parts.items() for each in part.get("properties", {})
    )


def structure_effects() -> list[str]:
    """Return the effects that sit outside the joint, from the catalogue that a person reads."""
    text = (TESTS.parent / "libraries" / "structure" / "effects.toml").read_text(encoding="utf-8")
    return re.findall(r'^id = "(\w+)"', text, re.M)


def formats_written(run: Callable) -> list[str]:
    """Return the formats that a simulated campaign is written in."""
    return re.findall(
        r"'(\w+)'",
        run("simulate", "--out", "x", "--format", "?").stderr.partition("not one of")[2].partition("(see")[0],
    )


@cache
def given() -> tuple[tuple[str, frozenset[str]], ...]:
    """Return the words in the texts of each test file, and of each part of those here, where all commands stand."""
    found = []
    for path in sorted(TESTS.rglob("*.py")):
        module, here = ast.parse(path.read_text(encoding="utf-8")), path.parent.name == "doors"
        for part in module.body if here else [module]:
            texts = (node.value for node in ast.walk(part) if isinstance(node, ast.Constant))
            words = {
                word.partition("=")[0] for text in texts if isinstance(text, str) for word in text.split()
            }
            found.append((path.relative_to(TESTS.parent).as_posix(), frozenset(words)))
    return tuple(found)


def holder_of_option(command: str, option: str) -> str | None:
    """Return the first test file that names a command and one of its options."""
    last = command.split()[-1:]
    return next((file for file, words in given() if {*last, option} <= words), None)


def text_of(made: dict) -> str:
    """Return the table as JSON, an item a line."""
    lines = []
    for section, items in made.items():
        rows = [f"  {json.dumps(name)}: {json.dumps(items[name], ensure_ascii=False)}" for name in items]
        lines.append(f" {json.dumps(section)}: {{\n" + ",\n".join(rows) + "\n }")
    return "{\n" + ",\n".join(lines) + "\n}\n"


if __name__ == "__main__":
    GOLDEN.write_text(text_of(inventory(ask)), encoding="utf-8")
