"""``sindyjoint schema``: the JSON Schema of campaign.toml."""

from __future__ import annotations

import json

import typer


def schema() -> None:
    """Print the JSON Schema of campaign.toml, for editors that check and complete it.

    Example: sindyjoint schema > campaign.schema.json
    """
    from sindyjoint.files import manifest_schema

    typer.echo(json.dumps(manifest_schema(), indent=2))
