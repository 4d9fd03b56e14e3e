"""``sindyjoint simulate``: write a virtual test campaign to files."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from sindyjoint.cli.answer import ForceOption, Progress
from sindyjoint.cli.options import (
    AtOption,
    given,
    given_inputs,
    refuse_other_options,
    with_blocks,
)
from sindyjoint.errors import InputError

if TYPE_CHECKING:
    from sindyjoint.workflows.simulate import WrittenTest


def _numbers(text: str, option: str) -> tuple[float, ...]:
    """Numbers of a comma-separated list."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} is {text!r}; expected numbers with commas between them") from None


# What a virtual test of a rig takes; its runs and noise stand in the rig's file.
OF_A_RIG = {"rig", "model", "out", "format", "random_state", "force", "as_json", "quiet", "verbose"}


@with_blocks
def simulate(
    context: typer.Context,
    out: Annotated[Path, typer.Option("--out", help="Folder to write campaign.toml and the run files to.")],
    rig: Annotated[
        Path | None,
        typer.Argument(
            metavar="RIG",
            help="A rig with sensors and runs to simulate instead of a joint's own test: a TOML file, or pulse-rig or "
            "four-panel-wing.",
            show_default=False,
        ),
    ] = None,
    joint: Annotated[
        Literal["inter-panel", "panel-root"], typer.Option(help="The paper's joint to test.")
    ] = "inter-panel",
    model: Annotated[
        Path | None,
        typer.Option(
            help="model.json, or a folder with one: the joint to test instead. Levels are then fractions of the "
            "largest angle that it was fitted to. Of a RIG: the law of its joints that give it as 'model'."
        ),
    ] = None,
    at: AtOption = None,
    plan: Annotated[
        Path | None,
        typer.Option(
            help="plan.toml, or a folder with one: its runs, rate and noise instead of those of the options below."
        ),
    ] = None,
    frequencies: Annotated[str, typer.Option(help="Excitation frequencies in Hz, with commas.")] = "3,4,5,6",
    levels: Annotated[
        str, typer.Option(help="Peak angles as fractions of the softening limit, with commas.")
    ] = "0.92,0.63,0.35",
    drive: Annotated[
        Literal["moment", "rig", "displacement"],
        typer.Option(help="Sinusoidal moment at the sensor, moment through a beam, or angle."),
    ] = "moment",
    noise: Annotated[float, typer.Option(help="White noise as a fraction of each channel's RMS.")] = 0.01,
    bits: Annotated[int | None, typer.Option(help="Resolution of the converter.")] = None,
    sample_rate: Annotated[float, typer.Option(help="Sampling rate in Hz.")] = 1000.0,
    duration: Annotated[float, typer.Option(help="Length of each run in s.")] = 10.0,
    settling: Annotated[
        float, typer.Option(help="Time in s that passes before the record begins; 0 keeps the start-up.")
    ] = 0.0,
    skew: Annotated[
        float | None,
        typer.Option(
            help="Time in s by which the moment lags the angle. Default: what the model knows of its rig, or none.",
            show_default=False,
        ),
    ] = None,
    raw: Annotated[
        bool, typer.Option("--raw", help="Write strain gauges and laser spots, not moment and angle.")
    ] = False,
    accelerometer: Annotated[
        Literal["instead", "beside"] | None,
        typer.Option(help="Measure the acceleration instead of the angle, or beside it."),
    ] = None,
    drift: Annotated[
        float,
        typer.Option(help="Drift of the angle's sensor over a run, as a fraction of the angle's RMS."),
    ] = 0.0,
    format: Annotated[
        Literal["csv", "tsv", "npz", "parquet", "h5", "mat"], typer.Option(help="Format of the run files.")
    ] = "csv",
    random_state: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    force: ForceOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was written as JSON.")] = False,
    *,
    progress: Progress,
) -> None:
    """Make a virtual test: simulate runs of a joint, with sensors and noise, and write them to files.

    Example: sindyjoint simulate --frequencies 3,4.5,6 --noise 0.02 --out virtual
    """
    if rig is not None:
        refuse_other_options(context, OF_A_RIG, "stands in the file of a rig; leave it out")
        from sindyjoint.cli.find import simulate_structure

        record = simulate_structure(rig, model, out, format, random_state, force, progress)
        _print_record(record, "a structure", as_json)
        return

    from sindyjoint.equation.catalogue_file import read_model
    from sindyjoint.workflows.simulate import WrittenRun, WrittenTest, make_test

    known = None if model is None else read_model(model)
    if known is None and at:
        raise InputError(f"--at {at[0]} is given without --model; the paper's joints have no inputs")
    made = make_test(
        joint,
        known,
        None if known is None else given_inputs(known, at),
        plan=plan,
        rng=random_state,
        progress=progress.say,
        noise=noise,
        quantisation=bits,
        raw_channels=raw,
        frequencies=_numbers(frequencies, "--frequencies"),
        levels=_numbers(levels, "--levels"),
        drive=drive,
        sample_rate=sample_rate,
        duration=duration,
        settling=settling,
        accelerometer=accelerometer or "",
        angle_drift=drift,
        **given(skew=skew),
    )
    progress.say("writing the files")
    manifest, campaign = made.write(out, format, force), made.campaign
    progress.show_details(campaign)
    progress.end()
    for note in made.notes:
        typer.echo(note, err=True)
    runs = (WrittenRun(run.name, run.frequency, run.level, run.n_samples) for run in campaign.runs)
    _print_record(
        WrittenTest(manifest, campaign.joint.name, tuple(runs)), f"the {campaign.joint.name}", as_json
    )


def _print_record(record: WrittenTest, subject: str, as_json: bool) -> None:
    """Print what was written, of a joint or of a structure."""
    if as_json:
        typer.echo(json.dumps(record.to_dict()))
    else:
        typer.echo(f"{record.manifest}: {len(record.runs)} simulated runs of {subject}")
