"""``sindyjoint libraries``: list, show, copy and check the catalogues of candidate terms."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sindyjoint.errors import InputError, OutputError
from sindyjoint.text import in_columns, in_words_of

if TYPE_CHECKING:
    from sindyjoint.equation.catalogue import Parameter, Term

app = typer.Typer(
    help="The catalogues of candidate terms.\n\nExample: sindyjoint libraries show extended",
    no_args_is_help=True,
)


Library = Annotated[
    str, typer.Argument(metavar="NAME", help="A shipped library, or the path of a .toml file.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print a JSON record instead of a table.")]
# The titles of a table, and its rows.
Rows = tuple[Sequence[str], Sequence[Sequence[str]]]


@app.command("list")
def list_(as_json: AsJson = False) -> None:
    """List the shipped libraries.

    Example: sindyjoint libraries list
    """
    from sindyjoint.equation.catalogue import list_catalogues

    record = [
        {"name": one.name, "terms": len(one.terms), "description": one.description}
        for one in list_catalogues()
    ]
    rows = [tuple(map(str, one.values())) for one in record]
    pretty = [(f"{name}\n{description}", terms) for name, terms, description in rows]
    _print(as_json, record, (("library", "terms"), pretty), (("library", "terms", "description"), rows))


@app.command()
def show(
    name: Library,
    motion: Annotated[
        Literal["rotation", "translation"],
        typer.Option(help="Kind of joint to show words and units for."),
    ] = "rotation",
    as_json: AsJson = False,
) -> None:
    """Show the terms of a library: id, symbol, formula, unit of the coefficient, meaning.

    Example: sindyjoint libraries show friction
    """
    from sindyjoint.equation.catalogue import load_catalogue

    catalogue = load_catalogue(name)
    # A terminal shows θ̇; what is piped into a file or another program stays in the ASCII of the catalogues.
    pretty, plain = [], []
    for term in catalogue:
        parameters = [_parameter(parameter, motion) for parameter in term.parameters]
        meaning, unit = in_words_of(motion, term.meaning), term.unit_for(motion)
        formula = "\n".join((term.pretty(motion), *parameters))
        pretty.append((f"{term.id}\n{meaning}", term.symbol, formula, unit))
        plain.append((term.id, term.symbol, term.text(motion), unit, ", ".join(parameters) or "-", meaning))
    _print(
        as_json,
        {
            "schema": 1,
            "name": catalogue.name,
            "description": catalogue.description,
            "motion": motion,
            "terms": [_term_record(term, motion) for term in catalogue],
        },
        (("term", "symbol", "formula", "unit"), pretty),
        (("id", "symbol", "formula", "unit", "parameters", "meaning"), plain),
    )


@app.command()
def copy(
    name: Library,
    destination: Annotated[
        Path, typer.Argument(metavar="DEST", help="File to write, or a folder to put it in.")
    ],
) -> None:
    """Copy a library's file, byte for byte, as a start for another one; never over an existing file.

    Effects are copied by family: effects/friction, effects/stiffness, effects/damping, effects/memory and others.

    Example: sindyjoint libraries copy extended mine.toml
    """
    from sindyjoint.equation.catalogue_file import find_catalogue, library_folder
    from sindyjoint.files.atomic import write_bytes

    effects = library_folder() / f"{name}.toml"
    source = effects if name.startswith("effects/") and effects.is_file() else find_catalogue(name)
    target = destination / source.name if destination.is_dir() else destination
    if target.exists():
        raise OutputError(f"{target} exists already; give another name or remove it first")
    write_bytes(target, source.read_bytes())
    typer.echo(f"wrote {target}", err=True)


@app.command()
def check(path: Annotated[Path, typer.Argument(metavar="PATH", help="A .toml file.")]) -> None:
    """Check a library: syntax, formulas, units, names. Exit status 2 if it cannot be used.

    First: sindyjoint libraries copy extended mine.toml

    Example: sindyjoint libraries check mine.toml
    """
    if _holds_effects(path):
        from sindyjoint.diagnosis.effects import read_effects

        effects = read_effects(path)
        typer.echo(f"{path}: in order, {len(effects)} effect(s): {', '.join(e.id for e in effects)}")
        return
    from sindyjoint.equation.catalogue import load_catalogue

    catalogue = load_catalogue(path)
    count = len(catalogue)
    typer.echo(f"{path}: in order, {count} term{'s' if count != 1 else ''}: {', '.join(catalogue.ids)}")


def _holds_effects(path: Path) -> bool:
    """Return whether a file lists effects, not terms; the reader reports what cannot be read."""
    from sindyjoint.documents import read_toml

    try:
        return "effect" in read_toml(path)
    except InputError:
        return False


@app.command()
def effects(as_json: AsJson = False) -> None:
    """List the effects that diagnosis can name: id, family, what each is, and its look-alikes.

    Example: sindyjoint libraries effects
    """
    from sindyjoint.diagnosis.effects import load_effects

    known = load_effects()
    record = [
        {"id": e.id, "family": e.family, "meaning": e.meaning, "confused_with": list(e.confused_with)}
        for e in known
    ]
    pretty = [(f"{e.id}\n{e.meaning}", e.family) for e in known]
    plain = [(e.id, e.family, e.meaning) for e in known]
    _print(as_json, record, (("effect", "family"), pretty), (("effect", "family", "meaning"), plain))


def _parameter(parameter: Parameter, motion: Any) -> str:
    if parameter.relative_to is None:
        return f"{parameter.name} = {parameter.value:g} {parameter.unit_for(motion)}"
    return (
        f"{parameter.name} = {parameter.value:g} of the largest {in_words_of(motion, parameter.relative_to)}"
    )


def _term_record(term: Term, motion: Any) -> dict[str, Any]:
    return {
        "id": term.id,
        "symbol": term.symbol,
        "formula": term.text(motion),
        "latex": term.latex(motion),
        "unit": term.unit_for(motion),
        "name": in_words_of(motion, term.name),
        "meaning": in_words_of(motion, term.meaning),
        "family": term.family,
        "source": term.source,
        "symmetry": term.symmetry,
        "confused_with": list(term.confused_with),
        "parameters": [
            {
                "name": parameter.name,
                "unit": parameter.unit_for(motion),
                "value": parameter.value,
                "relative_to": parameter.relative_to,
                "lower": parameter.lower,
                "upper": parameter.upper,
            }
            for parameter in term.parameters
        ],
    }


def _print(as_json: bool, record: Any, pretty: Rows, plain: Rows) -> None:
    """Print a record, or a table as a terminal or another program takes it."""
    if as_json:
        typer.echo(json.dumps(record, indent=2))
    elif sys.stdout.isatty():
        _print_pretty(*pretty)
    else:
        typer.echo("\n".join(in_columns([plain[0], *plain[1]])))


def _print_pretty(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table on a terminal: words of the first column stay whole, its sentences take the remaining width."""
    from rich import box
    from rich.cells import cell_len
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, highlight=False)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    others = [
        max(cell_len(line) for row in rows for line in row[i].split("\n")) for i in range(1, len(columns))
    ]
    longest_word = max(len(word) for row in rows for word in row[0].split())
    room = console.width - sum(
        max(width, len(name)) + 2 for width, name in zip(others, columns[1:], strict=True)
    )
    table.add_column(columns[0], width=max(longest_word, min(room, 70)))
    for column in columns[1:]:
        table.add_column(column, overflow="fold", no_wrap=column != "formula")
    for row in rows:
        table.add_row(*row)
    console.print(table)
