"""Arguments and options that several commands share: what to read, and how terms are found."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

METHODS = (
    "stlsq", "best_subset", "backward", "coefficient_stlsq", "sr3", "ssr", "frols", "ensemble", "lasso_lars",
)  # fmt: skip
"""Ways to make the path of models, as discovery has them."""


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
        "--library", "-l", help="Candidate terms: name or path of a catalogue. Repeatable. [extended]"
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
MethodOption = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help=f"How the path of models is made: {', '.join(METHODS)}; or pysindy:NAME for an optimizer of pysindy.",
    ),
]
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
