"""``sindyjoint compare``: the term-selection comparison report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.answer import answer, call
from sindyjoint.cli.defaults import default_of, given
from sindyjoint.cli.options import AcceptOption, AlignOption, CampaignPath, Output, Work, with_blocks
from sindyjoint.cli.progress import Progress

COMPARE = "workflows.compare:compare"


@with_blocks
def compare(
    campaign: CampaignPath = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder for report.html, comparison.csv, .md, .tex, .json and the inclusion map."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(help="model.json, or a folder with one: a model to hold against the same runs."),
    ] = None,
    library: Annotated[
        list[str] | None,
        typer.Option(
            "--library", "-l", help="Candidates for methods and frequencies. Repeatable. [extended]"
        ),
    ] = None,
    method: Annotated[
        list[str] | None,
        typer.Option(
            "--method",
            help="Compare these methods only, and 'weak' for the weak form; the first one leads. Repeatable. [all]",
        ),
    ] = None,
    replicates: Annotated[
        int, typer.Option(help="Resampled campaigns behind the inclusion probabilities.")
    ] = default_of(COMPARE, "replicates"),
    margin: Annotated[
        float,
        typer.Option(help="Relative change of a coefficient over the tested band that would not matter."),
    ] = default_of(COMPARE, "margin"),
    accept: AcceptOption = None,
    align: AlignOption = False,
    *,
    output: Output,
    random_state: Annotated[int, typer.Option(min=0, help="Seed of everything random.")] = default_of(
        COMPARE, "random_state"
    ),
    work: Work,
    progress: Progress,
) -> None:
    """Put the question of the terms to every method, every frequency and every library.

    Exit status 0: a model was found; 1: none was, or the data are unsound; 2: the input is at fault.

    Example: sindyjoint compare virtual --out comparison
    """
    find = call(
        COMPARE, campaign, **given(library=library, methods=method), model=model, accept=tuple(accept or ()),
        align=align, replicates=replicates, margin=margin, random_state=random_state, progress=progress.say,
        **work.arguments(),
    )  # fmt: skip
    result = answer(find, out, output, progress, random_state, (), campaign, model)
    raise typer.Exit(0 if result.model.terms else 1)
