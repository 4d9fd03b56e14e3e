"""Commands that write a file or say what files hold: ``init``, ``export``, ``plot``, ``schema``, ``limits``."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sindyjoint.cli.answer import AsJson, ForceOption, Progress
from sindyjoint.cli.options import (
    AtOption,
    given,
    given_inputs,
    split_pairs,
    with_blocks,
)
from sindyjoint.documents import refuse_foreign_file
from sindyjoint.errors import InputError, UnknownNameError, refuse
from sindyjoint.files.atomic import write_bytes

if TYPE_CHECKING:
    from sindyjoint.export import Export
    from sindyjoint.files.drafting.assignment import Question
    from sindyjoint.soundness.check import Check

SHOWN = 8  # findings


@with_blocks
def init(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder with the data files of the runs.")],
    answers: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="What the files do not tell: angle.unit=mrad, rate='1 kHz', force=ch2, inertia='0.02 kg*m^2'; "
            "validate=RUN for runs that no fit shall use. Repeatable.",
        ),
    ] = None,
    yes: Annotated[
        bool,
        typer.Option("--yes", "-y", help="Ask nothing: take the guesses, marked '# guessed' in the file."),
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Replace the campaign.toml that is there.")] = False,
    as_json: AsJson = False,
    *,
    progress: Progress,
) -> None:
    """Write a campaign.toml for a folder of data files: channels, units, rates, frequencies, levels.

    On a terminal it asks what the files do not tell. At the end the data are checked, and runs.svg shows all runs.

    First: sindyjoint simulate --out own

    Example: sindyjoint init own --force
    """
    from sindyjoint.described import to_plain
    from sindyjoint.files.drafting.init import init as run

    given = split_pairs(answers, "--set", "KEY=VALUE, such as angle.unit=mrad")
    asks = not yes and sys.stdin.isatty() and sys.stderr.isatty()
    progress.say("reading the files")
    if asks:
        # No spinner runs through what a person is typing.
        progress.end()
    made = run(folder, given, ask=_ask if asks else None, guess=yes, force=force)
    progress.end()
    if not as_json:
        typer.echo(str(made))
    progress.begin()
    checked, picture = _check(made.manifest, force, progress)
    progress.end()
    if as_json:
        record = made.to_dict() | {"check": to_plain(checked.soundness), "picture": str(picture)}
        typer.echo(json.dumps(record, indent=2, ensure_ascii=False))
        return
    soundness = checked.soundness
    typer.echo(f"\nthe data are {soundness.verdict}; all runs in one picture: {picture}")
    telling = [finding for finding in soundness.findings if finding.severity != "note"]
    for finding in telling[:SHOWN]:
        typer.echo(f"  {finding.severity}: {finding.run or 'all runs'}: {finding.extent}")
    if len(telling) > SHOWN:
        typer.echo(f"  and {len(telling) - SHOWN} more")
    verb = ("check", "soundness") if soundness.stopping else ("discover", "results")
    typer.echo(f"\nnext: {shlex.join(['sindyjoint', verb[0], str(folder), '--out', verb[1]])}")


def _check(manifest: Path, force: bool, progress: Progress) -> tuple[Check[Any], Path]:
    """Check what was written, and draw all runs beside it."""
    from sindyjoint.reporting.registry import draw
    from sindyjoint.reporting.results.check import TOGETHER
    from sindyjoint.reporting.style import figure_bytes
    from sindyjoint.workflows.check import check

    target = manifest.with_name("runs.svg")
    refuse_foreign_file(target, force)
    checked = check(manifest, progress=progress.say)
    progress.say("drawing all runs")
    return checked, write_bytes(target, figure_bytes(draw(TOGETHER, checked), "svg"))


def _ask(question: Question) -> str:
    if question.complaint:
        typer.echo(f"{question.complaint}; once more:", err=True)
    return typer.prompt(question.text, default=question.guess, err=True)


def export(
    model: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL",
            help="model.json, or the folder of results that holds it; for samples also the folder of a batch.",
            show_default=False,
        ),
    ],
    to: Annotated[
        str,
        typer.Option(
            "--to",
            metavar="TARGET",
            help="ansys, abaqus, nastran, simscape, opensees, mujoco, fmu, python, c, latex, json or samples.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="File, with the target's suffix if it has none; folder where a target has several. [text to stdout]",
        ),
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option("--rig", help="With ansys: rig written around the joint, by name or file. [pulse-rig]"),
    ] = None,
    at: AtOption = None,
    count: Annotated[
        int | None, typer.Option("--count", help="With samples: sets of coefficients. [1000]")
    ] = None,
    random_state: Annotated[
        int | None, typer.Option("--random-state", min=0, help="With samples: seed of the draws. [0]")
    ] = None,
    force: ForceOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the record of the export as JSON; wants --out.")
    ] = False,
) -> None:
    """Write a joint model for another program, and say what that program cannot express.

    The fidelity table (term, representation, error over the tested range) is inside the files and on stderr.

    First: sindyjoint discover --out results

    Example: sindyjoint export results/model.json --to abaqus --out joint.inp
    """
    from sindyjoint.export import export_model, read_model, write_export
    from sindyjoint.export.documents import BATCH_FILE, batch_samples
    from sindyjoint.export.fidelity import fidelity_lines

    options: dict[str, Any] = {} if rig is None else {"rig": rig}
    drawing = given(count=count, random_state=random_state)
    drawn = next(iter(drawing), "").replace("_", "-")
    refuse(
        [
            (options and to != "ansys", f"--rig is given with --to {to}; only ansys writes a rig"),
            (as_json and out is None, "--json is given without --out; say with --out where the files go"),
            (drawing and to != "samples", f"--{drawn} is given with --to {to}; only samples draws"),
        ]
    )
    if to == "samples" and (model / BATCH_FILE).is_file():
        result = batch_samples(model, **drawing, at=split_pairs(at))
    else:
        known = read_model(model)
        result = export_model(known, to, at=given_inputs(known, at), **options, **drawing)
    if out is None:
        typer.echo(_only_text(result), nl=False)
    else:
        paths = write_export(result, out, force)
        if as_json:
            record = {**result.to_dict(), "files": [str(path) for path in paths]}
            typer.echo(json.dumps(record, indent=2, allow_nan=False))
            return
        for path in paths:
            typer.echo(f"wrote {path}", err=True)
    for line in (*fidelity_lines(result.fidelity), *(f"not carried: {text}" for text in result.not_carried)):
        typer.echo(line, err=True)


def _only_text(result: Export) -> str:
    """Return the text of an export that is one text; InputError where it needs a folder."""
    from sindyjoint.export import TABLE

    content, *others = result.files.values()
    if isinstance(content, str) and not others:
        return content
    what = f"{len(result.files)} files" if others else "a binary file"
    names = ", ".join(result.files) if len(others) < 5 else f"{next(iter(result.files))}, ..."
    hold = ", or hold the law's inputs with --at" if TABLE in result.files else ""
    raise InputError(f"{result.target} is {what} ({names}); say with --out where it goes{hold}")


FORMATS = ("svg", "pdf", "png")


@with_blocks
def plot(
    results: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL|DIR", help="Folder that a command wrote with --out, or the model.json in it."
        ),
    ],
    kind: Annotated[
        str | None,
        typer.Argument(
            metavar="KIND",
            help="Which figure; of one of several results in a folder: diagnosis/gap. Without it: the list.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write: .svg, .pdf or .png. [KIND.svg]")
    ] = None,
    width: Annotated[
        float,
        typer.Option(min=2.5, max=20, help="Width in inches: 3.5 for one column of a paper, 7 for two."),
    ] = 7.0,
    dpi: Annotated[int, typer.Option(min=50, max=1200, help="Dots per inch of a .png.")] = 300,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is no figure of ours.")] = False,
    *,
    progress: Progress,
) -> None:
    """Draw one figure of a saved result, for a paper.

    First: sindyjoint discover --out results

    Example: sindyjoint plot results loops --out loops.pdf --width 3.5
    """
    from sindyjoint.reporting.registry import draw, drawing, list_saved

    where, _, name = (kind or "").rpartition("/")
    target = out if out is not None else Path(f"{name or 'figure'}.svg")
    suffix = target.suffix.lower().removeprefix(".")
    if suffix not in FORMATS:
        raise InputError(f"--out is {str(target)!r}; expected a name that ends in .svg, .pdf or .png")
    places = list_saved(results) or {"": results}
    if where and where not in places:
        known = ", ".join(filter(None, places)) or "none"
        raise InputError(f"{str(results)!r} holds no results of a {where!r}; expected one of: {known}")
    if kind is None:
        progress.end()
        for label, place in places.items():
            _list_figures(place, f"{label}/" if len(places) > 1 else "")
        return
    from sindyjoint.reporting.style import figure_bytes

    refuse_foreign_file(target, force)
    place, data = _find_figure(name, {where: places[where]} if where else places)
    with drawing(place):
        progress.say("drawing")
        figure = figure_bytes(draw(name, data, width), suffix, dpi)
    progress.end()
    typer.echo(f"wrote {write_bytes(target, figure)}", err=True)


def _find_figure(name: str, places: Mapping[str, Path]) -> tuple[Path, Any]:
    """Return the first result that can show a figure; where none can, the first."""
    from sindyjoint.reporting.registry import drawable, drawing, load_results

    loaded = []
    for place in places.values():
        loaded.append((place, load_results(place)))
        with drawing(place):
            if name in drawable(loaded[-1][1], parts=True):
                return loaded[-1]
    return loaded[0]


def _list_figures(place: Path, prefix: str) -> None:
    """Print the figures that a result can show."""
    from sindyjoint.reporting.registry import drawable, drawing, kinds_of, load_results

    data = load_results(place)
    with drawing(place):
        names, kinds = drawable(data, parts=True), kinds_of(data)
    longest = max(map(len, names))
    for name in names:
        typer.echo(f"{prefix}{name:<{longest}}  {kinds[name].caption}")


def schema(
    of: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="campaign, model, test, plan, check, discovery, comparison, verification, diagnosis, rig, export, "
            "joint-curves, structure-curves, simulation, batch, joint (record.json in a batch), reproduction, "
            "tables.",
        ),
    ] = "campaign",
) -> None:
    """Print the JSON Schema of campaign.toml, for editors that check and complete it, or of a result.

    That of a result describes its file and what --json prints.

    Example: sindyjoint schema > campaign.schema.json

    Example: sindyjoint schema --of diagnosis
    """
    from sindyjoint.reporting.registry import record_schema

    typer.echo(json.dumps(record_schema(of), indent=2))


def limits(
    of: Annotated[
        str | None,
        typer.Argument(
            metavar="[PART]", help="A part of the package, such as states or diagnosis; all by default."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one record.")] = False,
) -> None:
    """Print the limits that decide an answer: when a run repeats, a term is found, a gap is noise.

    Grids, numbers of iterations and tolerances of solvers decide no answer and are not listed.

    Example: sindyjoint limits states
    """
    from sindyjoint.policy import described, policies

    known = {
        name: described(policy) for name, policy in policies().items() if of is None or name.split()[0] == of
    }
    if not known:
        parts = ", ".join(dict.fromkeys(name.split()[0] for name in policies()))
        raise UnknownNameError(f"no part {of!r} has limits; expected one of {parts}")
    if as_json:
        record = {name: {each.name: vars(each) for each in items} for name, items in known.items()}
        typer.echo(json.dumps(record, indent=1, ensure_ascii=False))
        return
    for name, items in known.items():
        typer.echo(f"{name}")
        for each in items:
            typer.echo(f"  {each.name} = {each.quantity}\n      {each.meaning}\n      from: {each.source}")
