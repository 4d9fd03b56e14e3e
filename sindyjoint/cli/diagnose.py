"""``sindyjoint diagnose``: where simulation and measurement disagree, and what is missing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sindyjoint.cli.answer import answer, write
from sindyjoint.cli.defaults import default_of, given
from sindyjoint.cli.options import AcceptOption, AlignOption, Output, Work, with_blocks
from sindyjoint.cli.progress import Progress
from sindyjoint.errors import InputError, refuse

MOST = default_of("workflows.diagnose:diagnose", "max_effects")
MOST_OF_RIG = default_of("workflows.diagnose:diagnose_structure", "max_effects")

if TYPE_CHECKING:
    from sindyjoint.diagnosis.result import Diagnosis


@with_blocks
def diagnose(
    campaign: Annotated[
        Path | None,
        typer.Argument(
            metavar="CAMPAIGN|RIG",
            help="campaign.toml or its folder; or a rig's TOML file or a shipped rig (pulse-rig, four-panel-wing). "
            "Without it, or for a rig without a measured response: a virtual test with an effect hidden by the seed.",
            show_default=False,
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            help="model.json, or a folder with one, to start from. [the paper's five terms; the joint of the rig]"
        ),
    ] = None,
    base: Annotated[
        list[str] | None,
        typer.Option(
            "--base", help="Catalogue of the terms to start from, without a model. Repeatable. [paper]"
        ),
    ] = None,
    library: Annotated[
        list[Path] | None, typer.Option("--library", "-l", help="A TOML file of further effects. Repeatable.")
    ] = None,
    max_effects: Annotated[
        int | None, typer.Option(min=1, help=f"Most effects to add. [{MOST}; of a rig {MOST_OF_RIG}]")
    ] = None,
    hold_out: Annotated[
        list[str] | None,
        typer.Option(
            "--hold-out",
            help="Name of a run to keep out of the fit; of a rig: TOML file of another pulse. Repeatable.",
        ),
    ] = None,
    advise: Annotated[
        bool,
        typer.Option(
            "--advice/--no-advice",
            help="Whether to seek runs that would tell rivals apart: at most some 20 s of processor time. With --out "
            "the diagnosis is written before.",
        ),
    ] = True,
    refine: Annotated[
        bool,
        typer.Option(
            "--refine",
            help="Fit terms and elements of the repaired model to the simulated response in the end.",
        ),
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for diagnosis.json, model.json and figures.")
    ] = None,
    accept: AcceptOption = None,
    align: AlignOption = False,
    *,
    output: Output,
    random_state: Annotated[int | None, typer.Option(min=0, help="Seed of the virtual test. [0]")] = None,
    work: Work,
    progress: Progress,
) -> None:
    """Find where model and measurement disagree, name what is missing, add it, show the gap shrink.

    Of a rig, the effect may sit outside the joint: in beams, masses, clamp, pulse or sensor.

    Exit status 0: effects were named, if only for a part of the gap, or nothing is missing; 1: something is missing
    that no effect explains, or nothing could be decided, as where the data are unsound; 2: the input is at fault.

    Example: sindyjoint diagnose virtual --model results/model.json --out diagnosis
    """

    def find() -> Diagnosis:
        return _diagnosed(
            campaign,
            model,
            base,
            accept=tuple(accept or ()),
            align=align,
            library=tuple(library or ()),
            hold_out=tuple(hold_out or ()),
            advise=advise,
            before_advice=lambda result: write(
                result,
                out,
                progress,
                random_state,
                [p for p in (model, campaign) if p and p.exists()],
                output.force,
            ),
            refine=refine,
            random_state=random_state,
            progress=progress.say,
            **work.arguments(),
            **given(max_effects=max_effects),
        )

    result = answer(find, out, output, progress, random_state, (), campaign, model)
    raise typer.Exit(0 if result.settled else 1)


def _diagnosed(
    campaign: Path | None, model: Path | None, base: list[str] | None, **options: Any
) -> Diagnosis:
    """Return the diagnosis of a campaign, or of a structure."""
    from sindyjoint.equation.model_file import read_model
    from sindyjoint.mechanics.rig_file import has_measured_runs, is_rig_test

    recorded = campaign is not None and has_measured_runs(campaign)
    start = None if model is None or recorded else read_model(model)
    if campaign is None or not (recorded or is_rig_test(campaign)):
        from sindyjoint.workflows.diagnose import diagnose as of_campaign

        return of_campaign(campaign, start, **given(base=base), **options)
    elsewhere = [name for name, usual in Work().arguments().items() if options.pop(name) != usual]
    if elsewhere:
        raise InputError(
            f"--{elsewhere[0]} is for campaigns; {campaign} is a rig, whose candidates are tried on threads"
        )
    accept = options.pop("accept")
    held_out, of_rig = recorded and options.pop("hold_out"), f"is for campaigns; {campaign} is a rig"
    refuse(
        [
            (
                accept and not recorded,
                f"--accept is for data that are checked; {campaign} is a rig without [[run]]s",
            ),
            (options.pop("align"), f"--align {of_rig}, which has no two channels"),
            (options.pop("refine"), f"--refine {of_rig}, whose numbers are fitted to its response already"),
            (base, f"--base {of_rig}, whose joint has a law already, or --model"),
            (held_out, f"--hold-out: mark runs of {campaign} use = 'validate' to keep them out of the fit"),
        ]
    )
    if recorded:
        from sindyjoint.cli.structure import models_of
        from sindyjoint.workflows.diagnose import diagnose_rig

        return diagnose_rig(
            campaign, None if model is None else models_of(campaign, model), accept=accept, **options
        )
    from sindyjoint.workflows.diagnose import diagnose_structure as of_structure

    return of_structure(campaign, start, **options)
