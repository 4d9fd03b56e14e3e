"""``sindyjoint discover`` and ``diagnose``: of a joint's own test, and of joints inside a structure."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sindyjoint.cli.answer import Output, Progress, answer, call, read, write
from sindyjoint.cli.options import (
    AcceptOption,
    AlignOption,
    CampaignPath,
    CandidatesOption,
    Finding,
    Work,
    given,
    refuse_other_options,
    with_blocks,
)
from sindyjoint.errors import InputError, refuse

if TYPE_CHECKING:
    from sindyjoint.equation.model import JointModel
    from sindyjoint.mechanics.transient import Response
    from sindyjoint.workflows.simulate import WrittenTest

# Where an option may be repeated typer takes an enumeration, and no Literal.
Nuisance = StrEnum("Nuisance", ["delay", "gain", "offset"])
# Of the options of a search those that belong to the channels of a joint's own test.
OF_CHANNELS = ("states", "bandwidth", "align")


def discover_structure(
    rig: Path,
    out: Path | None,
    output: Output,
    progress: Progress,
    seed: int | None,
    options: Mapping[str, Any],
) -> bool:
    """Find the laws of the joints inside a structure, and write those of each kind into a folder of its own."""
    from sindyjoint.judgement.joint_laws import place_of_kind

    chosen = {name: value for name, value in options.items() if name not in OF_CHANNELS}
    find = call("workflows.discover:discover_rig", rig, progress=progress.say, **chosen)
    result = answer(find, out, output, progress, seed, subject=rig)
    if out is not None:
        for law in result.laws:
            if law.discovery is not None:
                write(law.discovery, out / place_of_kind(law.kind), progress, seed, force=output.force)
    return result.found and result.trust.data.colour != "poor"


def models_of(rig: Path, given: Path) -> JointModel | dict[str, JointModel]:
    """Return the model of a file for every joint, or those by kind in a folder that ``discover RIG --out`` wrote."""
    from sindyjoint.equation.catalogue_file import read_model
    from sindyjoint.judgement.joint_laws import place_of_kind
    from sindyjoint.mechanics.rig_test_file import load_rig_test

    kinds = dict.fromkeys(load_rig_test(rig).kinds)
    folders = {kind: given / place_of_kind(kind) for kind in kinds}
    if all((folder / "model.json").is_file() for folder in folders.values()):
        return {kind: read_model(folder) for kind, folder in folders.items()}
    return read_model(given)


def simulate_structure(
    rig: Path, model: Path | None, out: Path, format: str, seed: int, force: bool, progress: Progress
) -> WrittenTest:
    """Make and write a virtual test of a rig; return what was written.

    A model stands in the joints whose law is "model"; where one moves beyond what that was tested to, stderr says so.
    """
    from sindyjoint.equation.catalogue_file import read_model
    from sindyjoint.mechanics.rig_test import write_rig_test
    from sindyjoint.mechanics.rig_test_file import load_rig_plan
    from sindyjoint.mechanics.virtual_rig import virtual_rig_test
    from sindyjoint.response.laws import model_law
    from sindyjoint.response.verify_rig import joint_range_warnings
    from sindyjoint.workflows.simulate import WrittenRun, WrittenTest

    known = None if model is None else read_model(model)
    warnings: list[str] = []
    laws = {} if known is None else {"model": model_law(known)}
    plan = load_rig_plan(rig, laws)
    modelled = [h.name for h in plan.test.structure.hinges if h.law is laws.get("model")]
    if known is not None and not modelled:
        raise InputError(
            f'{rig}: --model is given, and no joint is a place for it; write law = "model" for the joints that '
            "it stands for, or leave it out"
        )

    def seen(run: str, response: Response) -> None:
        if known is not None:
            warnings.extend(f"{run}: {line}" for line in joint_range_warnings(known, response, modelled))

    progress.say(f"simulating {len(plan.drives)} runs")
    test = virtual_rig_test(plan.test, plan.drives, plan.recorder, seed, seen)
    progress.say("writing the files")
    manifest = write_rig_test(rig, test, out, format, force)
    progress.end()
    for line in warnings:
        typer.echo(line, err=True)
    runs = tuple(WrittenRun(run.name, run.frequency, run.level, run.drive.size) for run in test.runs)
    return WrittenTest(manifest, test.name, runs)


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
    ] = True,
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
    ] = False,
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

    Example: sindyjoint discover --out results
    """
    if nuisance:
        _require_refine(refine, "--nuisance")
    search = {**given(library=library, accept=accept), **finding.arguments(), "rng": random_state}
    from sindyjoint.mechanics.rig_file import is_rig_test

    if campaign is not None and is_rig_test(campaign):
        refuse_other_options(context, OF_A_RIG, "is not for the joints of a rig; leave it out")
        found = discover_structure(
            campaign,
            out,
            output,
            progress,
            random_state,
            {**search, "refine": refine},
        )
        raise typer.Exit(0 if found else 1)

    kinds: Any = tuple(dict.fromkeys(kind.value for kind in nuisance or ()))
    if model is not None:
        _require_refine(refine, "--model")
        refuse_other_options(
            context, OF_A_REFINEMENT, "belongs to a search for terms; with --model none are sought"
        )
        options = {
            "nuisance": kinds, **given(accept=accept), "align": finding.align, "rng": random_state,
        }  # fmt: skip
        answer(
            call("workflows.verify:refine", model, campaign, progress=progress.say, **options),
            out, output, progress, random_state,
            (), campaign, model, lambda result: result.refined,
        )  # fmt: skip
        return

    options = {**search, **vars(work), "correct": correct, "paper": paper}
    find = partial(_find_terms, campaign, progress, options, kinds if refine else None)
    answer(find, out, output, progress, subject=campaign, good=lambda result: result.found)


def _require_refine(refine: bool | None, option: str) -> None:
    if not refine:
        raise typer.BadParameter("belongs to --refine; add --refine, or leave it out", param_hint=option)


def _find_terms(campaign: Path | None, progress: Progress, options: dict[str, Any], refined_with: Any) -> Any:
    """Return the discovery of a campaign; refined on the simulated response with some nuisances, unless None."""
    measured = read(campaign, in_segments=True)
    result = call("workflows.discover:discover", measured, progress=progress.say, **options)()
    if refined_with is not None:
        progress.say("refining on the simulated response")
        result = call("judgement.discovery:refined", result, refined_with)()
    return result


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
        int | None, typer.Option(min=1, help="Most effects to add. [4; of a rig 3]")
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

    Example: sindyjoint diagnose --out diagnosis
    """

    def find() -> Any:
        return _diagnosis_of(
            campaign,
            model,
            base,
            align=align,
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
            rng=random_state,
            progress=progress.say,
            **vars(work),
            **given(max_effects=max_effects, accept=accept, library=library, hold_out=hold_out),
        )()

    answer(find, out, output, progress, random_state, (), campaign, model, lambda result: result.settled)


def _diagnosis_of(
    campaign: Path | None, model: Path | None, base: list[str] | None, **options: Any
) -> Callable[[], Any]:
    """Return what makes the diagnosis of a campaign, or of a structure."""
    from sindyjoint.equation.catalogue_file import read_model
    from sindyjoint.mechanics.rig_file import has_measured_runs, is_rig_test

    recorded = campaign is not None and has_measured_runs(campaign)
    start = None if model is None or recorded else read_model(model)
    verbs = "workflows.diagnose:"
    if campaign is None or not (recorded or is_rig_test(campaign)):
        return call(f"{verbs}diagnose", read(campaign), start, **given(base=base), **options)
    elsewhere = [name for name, usual in vars(Work()).items() if options.pop(name) != usual]
    if elsewhere:
        raise InputError(
            f"--{elsewhere[0]} is for campaigns; {campaign} is a rig, whose candidates are tried on threads"
        )
    accept = given(accept=options.pop("accept", None))
    held_out, of_rig = recorded and options.pop("hold_out", ()), f"is for campaigns; {campaign} is a rig"
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
        models = None if model is None else models_of(campaign, model)
        return call(f"{verbs}diagnose_rig", campaign, models, **accept, **options)
    return call(f"{verbs}diagnose_structure", campaign, start, **options)
