"""``sindyjoint limits``: what decides an answer, with its value, its meaning and where it comes from."""

from __future__ import annotations

import json
from typing import Annotated

import typer


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
