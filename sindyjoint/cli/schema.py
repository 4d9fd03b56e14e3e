"""``sindyjoint schema`` and ``limits``: what files and results are made of, and what decides an answer."""

from __future__ import annotations

import json
from typing import Annotated

import typer


def schema(
    of: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="campaign, model, test, plan, check, discovery, comparison, verification, diagnosis, rig, export, "
            "joint-curves, structure-curves, simulation, batch, joint (record.json in a batch), reproduction, "
            "tables.",
        ),
    ] = "campaign",
) -> None:
    """Print the JSON Schema of campaign.toml, for editors that check and complete it, or of a result.

    That of a result describes its file and what --json prints.

    Example: sindyjoint schema > campaign.schema.json

    Example: sindyjoint schema --of diagnosis
    """
    from sindyjoint.reporting.packing import record_schema

    typer.echo(json.dumps(record_schema(of), indent=2))


def limits(
    of: Annotated[
        str | None,
        typer.Argument(
            metavar="[PART]", help="A part of the package, such as states or diagnosis; all by default."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one record.")] = False,
) -> None:
    """Print the limits that decide an answer: when a run repeats, a term is found, a gap is noise.

    Grids, numbers of iterations and tolerances of solvers decide no answer and are not listed.

    Example: sindyjoint limits states
    """
    from sindyjoint.errors import UnknownNameError
    from sindyjoint.policy import described, policies

    known = {
        name: described(policy) for name, policy in policies().items() if of is None or name.split()[0] == of
    }
    if not known:
        parts = ", ".join(dict.fromkeys(name.split()[0] for name in policies()))
        raise UnknownNameError(f"no part {of!r} has limits; expected one of {parts}")
    if as_json:
        record = {name: {each.name: vars(each) for each in items} for name, items in known.items()}
        typer.echo(json.dumps(record, indent=1, ensure_ascii=False))
        return
    for name, items in known.items():
        typer.echo(f"{name}")
        for each in items:
            unit = "" if each.unit == "1" else f" {each.unit}"
            typer.echo(f"  {each.name} = {each.value}{unit}\n      {each.meaning}\n      from: {each.source}")
