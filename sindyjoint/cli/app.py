"""The commands in one application. The file of each is imported when it is asked for, what is heavy when it runs."""

from collections.abc import Iterable
from functools import cache
from importlib import import_module
from typing import Annotated, Any

import typer

# Where each command is found, in the order of the help. Its module is imported when it is asked for.
COMMANDS = {
    "init": "files", "check": "verbs", "discover": "find", "compare": "verbs", "batch": "verbs", "plan": "quantities",
    "simulate": "simulate", "verify": "verbs", "rig": "verbs", "curves": "quantities", "diagnose": "find",
    "changed": "verbs", "export": "files", "plot": "files", "schema": "files", "limits": "files",
    "reproduce": "verbs", "libraries": "libraries",
}  # fmt: skip
# Groups of commands, by the name of the application.
GROUPS = {"reproduce": "reproductions", "libraries": "app"}
# Those that can do nothing without an argument show their help.
NEED_ARGUMENTS = {"init", "batch", "simulate", "verify", "rig", "curves", "changed", "export", "plot"}


def _version(requested: bool) -> None:
    if requested:
        from sindyjoint import __version__

        typer.echo(f"sindyjoint {__version__}")
        raise typer.Exit()


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

    Example: sindyjoint discover --out results
    """
    if largest is not None:
        import os

        from sindyjoint.files.readers import VARIABLE, parse_size

        # Worker processes have it from here as well.
        os.environ[VARIABLE] = str(parse_size(largest))


def make_app(names: Iterable[str] = COMMANDS) -> typer.Typer:
    """Return the application with some of its commands, or all; the others are not even imported."""
    app = typer.Typer(
        name="sindyjoint",
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(options)
    for name in names:
        module = import_module(f"sindyjoint.cli.{COMMANDS[name]}")
        if name in GROUPS:
            app.add_typer(getattr(module, GROUPS[name]), name=name)
        else:
            app.command(name, no_args_is_help=name in NEED_ARGUMENTS)(getattr(module, name))
    return app


@cache
def command(name: str = "") -> Any:
    """Return the application as the parser of options makes use of it: with the command that is named, if one is."""
    return typer.main.get_command(make_app([name] if name in COMMANDS else COMMANDS))
