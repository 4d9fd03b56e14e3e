"""``sindyjoint schema``: the JSON Schema of campaign.toml and of every result."""

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
    from sindyjoint.reporting.schemas import record_schema

    typer.echo(json.dumps(record_schema(of), indent=2))
