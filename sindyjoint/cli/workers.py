"""The options that say where tasks run: this process, several, or a Dask cluster."""

from __future__ import annotations

from typing import Annotated

import typer

JobsOption = Annotated[
    int, typer.Option("--jobs", "-j", help="Processes of this machine; -1: one for each core.")
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="Start a Dask cluster of so many processes on this machine.")
]
ClusterOption = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="Address of a running Dask scheduler to work on.")
]
