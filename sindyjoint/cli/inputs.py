"""Values of a law's inputs on the command line: ``--at temperature=-40``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from sindyjoint.equation.model import JointModel

AtOption = Annotated[
    list[str] | None,
    typer.Option(
        "--at",
        metavar="INPUT=VALUE",
        help="Value of an input of the law, in its declared unit: temperature=-40. May be repeated; an input that is "
        "not given is at its reference.",
        show_default=False,
    ),
]


def given_inputs(model: JointModel, given: Sequence[str] | None) -> dict[str, float]:
    """Return the values that options give inputs of a model, SI.

    Raises
    ------
    InputError, UnknownNameError
        For text that is no such value, or a name that is no input.
    """
    from sindyjoint.equation.held import input_values

    known = {each.name: each for each in model.inputs}
    values: dict[str, float] = {}
    for name, value in split_inputs(given).items():
        input_values(model, {name: 0.0})
        values[name] = known[name].parse(value)
    return values


def split_inputs(given: Sequence[str] | None) -> dict[str, str]:
    """Return the text of each value that options give, by the input's name.

    Raises
    ------
    InputError
        For text that gives none.
    """
    from sindyjoint.errors import InputError

    values = {}
    for text in given or ():
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"--at {text!r}: expected INPUT=VALUE, such as temperature=-40")
        values[name.strip()] = value.strip()
    return values
