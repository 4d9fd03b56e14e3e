"""``sindyjoint export``: a joint model for the tools in which structures and controllers are modelled."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sindyjoint.cli.defaults import constant_of, given
from sindyjoint.cli.options import AtOption, ForceOption, given_inputs, split_pairs

if TYPE_CHECKING:
    from sindyjoint.export import Export

TARGETS = tuple(constant_of("export:TARGETS"))


def export(
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL",
            help="model.json, or the folder of results that holds it; for samples also the folder of a batch.",
            show_default=False,
        ),
    ],
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="TARGET",
            help=f"{', '.join(TARGETS[:-1])} or {TARGETS[-1]}.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="File, with the target's suffix if it has none; folder where a target has several. [text to stdout]",
        ),
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option("--rig", help="With ansys: rig written around the joint, by name or file. [pulse-rig]"),
    ] = None,
    at: AtOption = None,
    count: Annotated[
        int | None, typer.Option("--count", help="With samples: sets of coefficients. [1000]")
    ] = None,
    random_state: Annotated[
        int | None, typer.Option("--random-state", min=0, help="With samples: seed of the draws. [0]")
    ] = None,
    force: ForceOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the record of the export as JSON; wants --out.")
    ] = False,
) -> None:
    """Write a joint model for another program, and say what that program cannot express.

    The fidelity table (term, representation, error over the tested range) is inside the files and on stderr.

    Example: sindyjoint export results/model.json --to abaqus --out joint.inp
    """
    from sindyjoint.errors import refuse
    from sindyjoint.export import export_model, read_model, write_export
    from sindyjoint.export.samples import BATCH_FILE, batch_samples

    options: dict[str, Any] = {} if rig is None else {"rig": rig}
    drawing = given(count=count, random_state=random_state)
    drawn = next(iter(drawing), "").replace("_", "-")
    refuse(
        [
            (options and to != "ansys", f"--rig is given with --to {to}; only ansys writes a rig"),
            (as_json and out is None, "--json is given without --out; say with --out where the files go"),
            (drawing and to != "samples", f"--{drawn} is given with --to {to}; only samples draws"),
        ]
    )
    if to == "samples" and (model / BATCH_FILE).is_file():
        result = batch_samples(model, **drawing, at=split_pairs(at))
    else:
        known = read_model(model)
        result = export_model(known, to, at=given_inputs(known, at), **options, **drawing)
    if out is None:
        typer.echo(_only_text(result), nl=False)
    else:
        paths = write_export(result, out, force)
        if as_json:
            record = {**result.to_dict(), "files": [str(path) for path in paths]}
            typer.echo(json.dumps(record, indent=2, allow_nan=False))
            return
        for path in paths:
            typer.echo(f"wrote {path}", err=True)
    _print_fidelity(result)


def _only_text(result: Export) -> str:
    """Return the text of an export that is one text; InputError where it needs a folder."""
    from sindyjoint.errors import InputError
    from sindyjoint.export import TABLE

    content, *others = result.files.values()
    if isinstance(content, str) and not others:
        return content
    what = f"{len(result.files)} files" if others else "a binary file"
    names = ", ".join(result.files) if len(others) < 5 else f"{next(iter(result.files))}, ..."
    hold = ", or hold the law's inputs with --at" if TABLE in result.files else ""
    raise InputError(f"{result.target} is {what} ({names}); say with --out where it goes{hold}")


def _print_fidelity(result: Export) -> None:
    """Print on stderr how each term is represented, and what is not."""
    from sindyjoint.export.text import fidelity_lines

    missing = [f"not carried: {text}" for text in result.not_carried]
    for line in [*fidelity_lines(result.fidelity), *missing]:
        typer.echo(line, err=True)
