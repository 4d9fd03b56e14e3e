"""Arguments and options that several commands share: what to read, and how terms are found."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.defaults import default_of


class Method(StrEnum):
    """How the path of models is made."""

    stlsq = "stlsq"
    best_subset = "best_subset"
    backward = "backward"
    coefficient_stlsq = "coefficient_stlsq"
    sr3 = "sr3"
    ssr = "ssr"
    frols = "frols"
    ensemble = "ensemble"
    lasso_lars = "lasso_lars"


class Selection(StrEnum):
    """How one model of the path is chosen."""

    evidence = "evidence"
    one_standard_error = "one_standard_error"


class Nuisance(StrEnum):
    """What may be estimated beside the coefficients."""

    delay = "delay"
    gain = "gain"
    offset = "offset"


class States(StrEnum):
    """How rates are made of angles."""

    auto = "auto"
    periodic = "periodic"
    broadband = "broadband"


REGRESSOR, DISCOVER = "discovery.estimator:JointRegressor", "workflows.discover:discover"
METHOD = Method(default_of(REGRESSOR, "method"))
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
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
MethodOption = Annotated[Method, typer.Option(help="How the path of models is made.")]
SelectionOption = Annotated[Selection, typer.Option(help="How one model of the path is chosen.")]
ThresholdOption = Annotated[
    float | None,
    typer.Option(
        help="Least share of the moment that a term carries alone, instead of choosing by evidence."
    ),
]
ForceOption = Annotated[list[str] | None, typer.Option("--force", help="Id of a term to keep. Repeatable.")]
ForbidOption = Annotated[
    list[str] | None, typer.Option("--forbid", help="Id of a term to leave out. Repeatable.")
]
StatesOption = Annotated[States, typer.Option(help="How rates are made of angles.")]
BandwidthOption = Annotated[float | None, typer.Option(help="Highest frequency kept in the angle, Hz.")]
AlignOption = Annotated[
    bool, typer.Option("--align", help="Remove the time skew found between the channels.")
]
