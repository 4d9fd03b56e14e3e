"""All commands in one application. The file of each command imports what is heavy only when it runs."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

import typer

from sindyjoint.cli.files import export, init, limits, plot, schema
from sindyjoint.cli.find import diagnose, discover
from sindyjoint.cli.libraries import app as libraries
from sindyjoint.cli.quantities import curves, plan
from sindyjoint.cli.simulate import simulate
from sindyjoint.cli.verbs import batch, changed, check, compare, reproductions, rig, verify

application = typer.Typer(
    name="sindyjoint",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(requested: bool) -> None:
    if requested:
        from sindyjoint import __version__

        typer.echo(f"sindyjoint {__version__}")
        raise typer.Exit()


@application.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and leave.")
    ] = False,
    largest: Annotated[
        str | None,
        typer.Option(
            "--largest",
            metavar="SIZE",
            help="Memory that the content of one run file may take where it cannot be read in pieces. [1 GiB]",
        ),
    ] = None,
) -> None:
    """Discover the equation of a nonlinear joint from vibration tests, with evidence.

    Example: sindyjoint discover virtual --out results
    """
    if largest is not None:
        import os

        from sindyjoint.files.readers import VARIABLE, parse_size

        # Worker processes have it from here as well.
        os.environ[VARIABLE] = str(parse_size(largest))


# In the order of the help; those that can do nothing without an argument show theirs.
COMMANDS = (
    init, check, discover, compare, batch, plan, simulate, verify, rig, curves, diagnose, changed, export, plot,
    schema, limits,
)  # fmt: skip
NEED_ARGUMENTS = {init, batch, simulate, verify, rig, curves, changed, export, plot}
for each in COMMANDS:
    application.command(each.__name__, no_args_is_help=each in NEED_ARGUMENTS)(each)
application.add_typer(reproductions, name="reproduce")
application.add_typer(libraries, name="libraries")


@cache
def command() -> Any:
    """Return the application as the parser of options makes use of it, made once in a process."""
    return typer.main.get_command(application)
