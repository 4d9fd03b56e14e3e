"""Arguments and options that several commands share: what to read, and how terms are found."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from sindyjoint.cli.defaults import default_of

METHODS = (
    "stlsq", "best_subset", "backward", "coefficient_stlsq", "sr3", "ssr", "frols", "ensemble", "lasso_lars",
)  # fmt: skip
"""Ways to make the path of models, as discovery has them."""


class Selection(StrEnum):
    """How one model of the path is chosen."""

    evidence = "evidence"
    one_standard_error = "one_standard_error"


class Nuisance(StrEnum):
    """What may be estimated together with the coefficients."""

    delay = "delay"
    gain = "gain"
    offset = "offset"


class States(StrEnum):
    """How rates are made of angles."""

    auto = "auto"
    periodic = "periodic"
    broadband = "broadband"


REGRESSOR, DISCOVER = "discovery.estimator:JointRegressor", "workflows.discover:discover"
METHOD: str = default_of(REGRESSOR, "method")
SELECTION = Selection(default_of(REGRESSOR, "selection"))
STATES = States(default_of(DISCOVER, "states"))
ALIGN: bool = default_of(DISCOVER, "align")
JOBS: int = default_of(DISCOVER, "jobs")
LIBRARY: str = default_of(DISCOVER, "library")

CampaignPath = Annotated[
    Path | None,
    typer.Argument(
        metavar="CAMPAIGN",
        help="campaign.toml or its folder. Without it: the built-in virtual test of the inter-panel joint.",
        show_default=False,
    ),
]
CandidatesOption = Annotated[
    list[str] | None,
    typer.Option(
        "--library",
        "-l",
        help=f"Candidate terms: name or path of a catalogue. Repeatable. [{LIBRARY}]",
    ),
]
AlignOption = Annotated[
    bool, typer.Option("--align", help="Remove the time delay found between the channels.")
]
AcceptOption = Annotated[
    list[str] | None,
    typer.Option(
        "--accept", metavar="ID", help="Finding of the check of the data that shall not stop. Repeatable."
    ),
]
ForceOption = Annotated[
    bool,
    typer.Option(
        "--force", help="Replace files in --out that were not written by this command, or were changed since."
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


@dataclass(frozen=True)
class Finding:
    """How terms are found: the options of every command that finds them."""

    method: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help=f"How the path of models is made: {', '.join(METHODS)}; or pysindy:NAME for an optimizer of pysindy.",
        ),
    ] = METHOD
    selection: Annotated[Selection, typer.Option(help="How one model of the path is chosen.")] = SELECTION
    threshold: Annotated[
        float | None,
        typer.Option(help="Least unique share of a term, instead of choosing by evidence."),
    ] = None
    require: Annotated[
        list[str] | None, typer.Option("--require", help="Id of a term to keep. Repeatable.")
    ] = None
    forbid: Annotated[
        list[str] | None, typer.Option("--forbid", help="Id of a term to leave out. Repeatable.")
    ] = None
    states: Annotated[States, typer.Option(help="How rates are made of angles.")] = STATES
    bandwidth: Annotated[float | None, typer.Option(help="Highest frequency kept in the angle, Hz.")] = None
    align: Annotated[
        bool, typer.Option("--align", help="Remove the time delay found between the channels.")
    ] = ALIGN

    def arguments(self) -> dict[str, Any]:
        """Return what :func:`sindyjoint.discover` takes."""
        return {
            "method": self.method,
            "selection": self.selection.value,
            "threshold": self.threshold,
            "forced": tuple(self.require or ()),
            "forbidden": tuple(self.forbid or ()),
            "states": self.states.value,
            "bandwidth": self.bandwidth,
            "align": self.align,
        }


def takes_finding(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the fields of :class:`Finding` as options, where its parameter ``finding`` stands."""
    options = inspect.signature(Finding, eval_str=True).parameters
    parameters = []
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        parameters += list(options.values()) if parameter.name == "finding" else [parameter]

    def with_options(**given: Any) -> None:
        finding = Finding(**{name: given.pop(name) for name in options})
        command(finding=finding, **given)

    with_options.__name__, with_options.__doc__ = command.__name__, command.__doc__
    with_options.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    # An option without a default may follow one that has one: typer passes all by name.
    by_name = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in parameters]
    with_options.__signature__ = inspect.Signature(by_name)  # type: ignore[attr-defined]
    return with_options
