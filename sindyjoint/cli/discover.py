"""``sindyjoint discover``: which terms the joint's equation has."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sindyjoint.cli.answer import answer, call
from sindyjoint.cli.defaults import default_of, given
from sindyjoint.cli.options import (
    DISCOVER,
    AcceptOption,
    CampaignPath,
    CandidatesOption,
    Finding,
    Nuisance,
    Output,
    Work,
    refuse_other_options,
    with_blocks,
)
from sindyjoint.cli.progress import Progress
from sindyjoint.cli.structure import discover_structure

if TYPE_CHECKING:
    from sindyjoint.judgement.discovery import Discovery


# What a search for the laws of the joints of a rig takes.
OF_A_RIG = {
    "campaign", "library", "out", "accept", "force", "as_json", "method", "selection", "threshold", "require", "forbid",
    "refine", "random_state", "quiet", "verbose",
}  # fmt: skip
# What a refinement of a model takes; all other options are of a search for terms.
OF_A_REFINEMENT = {
    "campaign", "out", "accept", "as_json", "refine", "model", "nuisance", "align", "random_state", "quiet", "verbose",
}  # fmt: skip


@with_blocks
def discover(
    context: typer.Context,
    campaign: CampaignPath = None,
    library: CandidatesOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for model.json, report.html, terms.csv and figures.")
    ] = None,
    accept: AcceptOption = None,
    *,
    output: Output,
    finding: Finding,
    correct: Annotated[
        bool,
        typer.Option(
            "--correct/--no-correct",
            help="Complete the motion by a simulation of the model with what its processing cuts off.",
        ),
    ] = default_of(DISCOVER, "correct"),
    refine: Annotated[
        bool | None,
        typer.Option(
            "--refine/--no-refine",
            help="Refine the coefficients on the simulated response of the runs. Default: of a rig without a run that "
            "repeats.",
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            help="With --refine: model.json, or a folder with one; its terms and elements are refined on the campaign, "
            "and no others are sought."
        ),
    ] = None,
    nuisance: Annotated[
        list[Nuisance] | None,
        typer.Option(
            help="With --refine: estimate delay of the moment, gain or zero error of the angle, too. Repeatable."
        ),
    ] = None,
    paper: Annotated[
        bool, typer.Option("--paper", help="Put the question of the paper's five terms first.")
    ] = default_of(DISCOVER, "paper"),
    random_state: Annotated[int | None, typer.Option(min=0, help="Seed of everything random. [0]")] = None,
    work: Work,
    progress: Progress,
) -> None:
    """Find which terms the joint's equation has, with coefficients and evidence.

    With --refine --model no terms are sought: the numbers of that model, elements among them, are fitted to the
    simulated response, and the result stands beside the measured one. What it knows of the rig's channels is put right.

    Of a rig.toml with sensors and runs, the law of the joints inside the structure is found.

    Exit status 0: a model was found; 1: none was, or the data are unsound, and the
    reason is printed; 2: the input is at fault.

    Example: sindyjoint discover virtual --out results
    """
    if nuisance:
        _require_refine(refine, "--nuisance")
    search = {**given(library=library), **finding.arguments(), "random_state": random_state}
    from sindyjoint.mechanics.rig_file import is_rig_test

    if campaign is not None and is_rig_test(campaign):
        refuse_other_options(context, OF_A_RIG, "is not for the joints of a rig; leave it out")
        found = discover_structure(
            campaign,
            out,
            output,
            progress,
            random_state,
            {**search, "refine": refine, "accept": tuple(accept or ())},
        )
        raise typer.Exit(0 if found else 1)

    kinds: Any = tuple(dict.fromkeys(kind.value for kind in nuisance or ()))
    accepted = tuple(accept or ())
    if model is not None:
        _require_refine(refine, "--model")
        refuse_other_options(
            context, OF_A_REFINEMENT, "belongs to a search for terms; with --model none are sought"
        )
        options = {
            "nuisance": kinds, "accept": accepted, "align": finding.align, "random_state": random_state,
        }  # fmt: skip
        refined = answer(
            call("workflows.refine:refine", model, campaign, progress=progress.say, **options),
            out, output, progress, random_state,
            (), campaign, model,
        )  # fmt: skip
        raise typer.Exit(0 if refined.refined else 1)

    options = {**search, **work.arguments(), "accept": accepted, "correct": correct, "paper": paper}
    result = answer(
        partial(_find_terms, campaign, progress, options, kinds if refine else None),
        out,
        output,
        progress,
        subject=campaign,
    )
    raise typer.Exit(0 if result.found else 1)


def _require_refine(refine: bool | None, option: str) -> None:
    if not refine:
        raise typer.BadParameter("belongs to --refine; add --refine, or leave it out", param_hint=option)


def _find_terms(
    campaign: Path | None, progress: Progress, options: dict[str, Any], refined_with: Any
) -> Discovery:
    """Return the discovery of a campaign; refined on the simulated response with some nuisances, unless None."""
    from sindyjoint.workflows.discover import discover

    result = discover(campaign, progress=progress.say, **options)
    if refined_with is None:
        return result
    from sindyjoint.judgement.refined import refined

    progress.say("refining on the simulated response")
    return refined(result, refined_with)
