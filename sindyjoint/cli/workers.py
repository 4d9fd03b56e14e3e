"""The options that say where tasks run: this process, several, or a Dask cluster."""

from __future__ import annotations

import re
from typing import Annotated

import typer

# A scheme, a host, a port: what Dask takes for the address of a scheduler.
_ADDRESS = re.compile(r"((tcp|tls|ucx|ws|wss)://)?[^\s/:]+(:[^\s/:]+)*:\d{1,5}/?")


def _check_jobs(jobs: int) -> int:
    if jobs < 1 and jobs != -1:
        raise typer.BadParameter(f"{jobs} is neither a positive number nor -1")
    return jobs


def _check_address(address: str | None) -> str | None:
    if address is not None and not _ADDRESS.fullmatch(address):
        raise typer.BadParameter(f"{address!r} is no address of a scheduler, such as tcp://10.0.0.7:8786")
    return address


JobsOption = Annotated[
    int,
    typer.Option(
        "--jobs", "-j", callback=_check_jobs, help="Processes of this machine; -1: one for each core."
    ),
]
WorkersOption = Annotated[
    int | None, typer.Option(min=1, help="Start a Dask cluster of so many processes on this machine.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS", callback=_check_address, help="Address of a running Dask scheduler to work on."
    ),
]
