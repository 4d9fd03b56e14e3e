"""Commands whose options are quantities with units: ``plan`` and ``curves``."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from sindyjoint.cli.answer import Output, Progress, answer, call
from sindyjoint.cli.options import given, with_blocks
from sindyjoint.errors import InputError, UnitError
from sindyjoint.files.units import conversion, parse_quantity, split_quantity
from sindyjoint.trust import PLACES

READ = ("moment", "angle")


@with_blocks
def plan(
    like: Annotated[
        Literal["inter-panel", "panel-root"] | None,
        typer.Option(help="The paper's joint that the joint resembles. [inter-panel, without a campaign]"),
    ] = None,
    model: Annotated[
        Path | None, typer.Option(help="model.json, or a folder with one: what the joint is like, instead.")
    ] = None,
    campaign: Annotated[
        Path | None, typer.Option(help="campaign.toml or its folder: what these runs tell is added.")
    ] = None,
    ranges: Annotated[
        list[str] | None,
        typer.Option("--range", help="Of a coefficient: 'linear_stiffness=5..8 kN*m/rad'. May be repeated."),
    ] = None,
    drive: Annotated[
        Literal["moment", "angle"] | None,
        typer.Option(help="What the actuator prescribes. [moment; angle where the inertia is unknown]"),
    ] = None,
    band: Annotated[
        str | None, typer.Option(help="Frequencies that it reaches. [those tested, or 2..8 Hz]")
    ] = None,
    limits: Annotated[
        list[str] | None,
        typer.Option(
            "--limit", help="Of moment, angle or rate: 'moment=6 N*m'. May be repeated. [what was tested]"
        ),
    ] = None,
    noise: Annotated[
        list[str] | None,
        typer.Option(
            help="As a share of each channel's RMS, or of one: 'angle=2 urad'. [the campaign's, or 1 %]"
        ),
    ] = None,
    resolution: Annotated[
        list[str] | None, typer.Option(help="Steps of a reading: 'angle=1 urad'. May be repeated.")
    ] = None,
    waveforms: Annotated[
        list[str] | None,
        typer.Option(
            "--waveform",
            help="Among which is chosen: sine, two-tone-3, two-tone-5, triangle, multisine, sweep. [sine]",
        ),
    ] = None,
    rate: Annotated[str | None, typer.Option(help="Sampling rate. [the campaign's, or 1000 Hz]")] = None,
    time: Annotated[str | None, typer.Option(help="Duration of all runs to be made. [90 s]")] = None,
    run_time: Annotated[
        str | None, typer.Option("--run-time", help="Duration of each run. [an eighteenth of the time]")
    ] = None,
    goal: Annotated[
        str | None,
        typer.Option(
            help="widths: a narrow widest interval; frequency: no change over the band overlooked; paper: which terms "
            "there are; tell-apart: effects. With weights: [widths=4,frequency=1]"
        ),
    ] = None,
    effects: Annotated[
        str | None, typer.Option(help="To be told apart: 'dahl_friction,lugre_friction'.")
    ] = None,
    diagnosis: Annotated[
        Path | None, typer.Option(help="diagnosis.json or its folder: the effects that it left together.")
    ] = None,
    share: Annotated[
        str | None,
        typer.Option(help="Of the moment that an effect adds, before any data. [0.06]"),
    ] = None,
    terms: Annotated[list[str] | None, typer.Option("--term", help="That matters. [all]")] = None,
    until: Annotated[str | None, typer.Option(help="Relative half-width that is enough: '5 %'.")] = None,
    random_state: Annotated[int, typer.Option(min=0, help="Seed of the joints drawn.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder for plan.toml, drive signals, report.html, plan.json and figures."
        ),
    ] = None,
    *,
    output: Output,
    progress: Progress,
) -> None:
    """Plan a test before it is made: which runs tell most of a joint that is known only roughly.

    Levels stay within the limits, and off the softening limit, for every joint of the range.

    Example: sindyjoint plan --range "linear_stiffness=5..8 kN*m/rad" --limit "moment=6 N*m" --time "2 min" --out plan
    """
    find = call(
        "workflows.plan:plan",
        like,
        model=model,
        campaign=campaign,
        ranges=_ranges(ranges or []),
        drive=drive,
        limits=_quantities(limits or [], (*READ, "rate"), "--limit"),
        goal=read_by(_goal, goal),
        resolution=_quantities(resolution or [], READ, "--resolution"),
        effects=tuple(name.strip() for name in effects.split(",")) if effects else (),
        diagnosis=diagnosis,
        terms=tuple(terms or ()),
        until=read_by(_share, until, "--until"),
        rng=random_state,
        progress=progress.say,
        **given(
            waveforms=tuple(waveforms) if waveforms else None,
            share=read_by(_share, share, "--share"),
            band=read_by(span, band, "Hz", "--band"),
            sample_rate=read_by(parse_quantity, rate, "Hz", "--rate"),
            time=read_by(parse_quantity, time, "s", "--time"),
            run_time=read_by(parse_quantity, run_time, "s", "--run-time"),
        ),
        **_noise(noise or []),
    )

    if (places := PLACES.get()) is not None:
        # No results of another kind go into the folder of a plan.
        PLACES.set(replace(places, results="plan"))
    answer(find, out, output, progress, random_state, [diagnosis or ""], campaign, model)


def read_by(parse: Callable[..., Any], text: str | None, *more: str) -> Any:
    """Return what a parser of options makes of a text, and nothing of what is not given."""
    return None if text is None else parse(text, *more)


def _share(text: str, where: str) -> float:
    """Return a share written as a number or in per cent."""
    number, percent, rest = text.strip().partition("%")
    try:
        if rest:
            raise ValueError
        return float(number) / (100.0 if percent else 1.0)
    except ValueError:
        raise InputError(f"{where} is {text!r}; expected a share such as 0.05 or '5 %'") from None


def _goal(text: str) -> str | dict[str, float]:
    """Return a goal, or several with their weights."""
    if "=" not in text:
        return text.strip()
    pairs = (part.partition("=") for part in text.split(","))
    try:
        return {name.strip(): float(weight) for name, _, weight in pairs}
    except ValueError:
        raise InputError(
            f"--goal is {text!r}; expected goals with weights, such as 'widths=2,frequency=1'"
        ) from None


def span(text: str, unit: str, where: str) -> tuple[float, float]:
    """Return the ends of ``2..8 Hz`` in SI; the unit behind the second end is that of both."""
    low, dots, rest = text.partition("..")
    if not dots:
        raise InputError(f"{where} is {text!r}; expected two numbers and their unit, such as '2..8 {unit}'")
    high, given = split_quantity(rest, where, unit)
    try:
        factor = conversion(given, unit, where)
        return float(low) * factor, high * factor
    except ValueError:
        raise InputError(f"{where} is {text!r}; expected a number before the two dots") from None


def _parted(text: str, known: Sequence[str] | None, where: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not sign or (known is not None and name.strip() not in known):
        names = "NAME" if known is None else " or ".join(known)
        raise InputError(f"{where} is {text!r}; expected {names}, an equals sign, and a value with its unit")
    return name.strip(), value.strip()


def _quantities(texts: list[str], known: Sequence[str], where: str) -> dict[str, float]:
    """Return the values of channels, SI, in a unit of a joint that turns or of one that slides."""
    from sindyjoint.planning.plan import parse_channel

    pairs = [_parted(text, known, where) for text in texts]
    return {name: parse_channel(value, name, f"{where} {name}")[0] for name, value in pairs}


def _noise(texts: list[str]) -> dict[str, Any]:
    """Return the noise as the options of a plan."""
    shares = [text for text in texts if "=" not in text]
    named = _quantities([text for text in texts if "=" in text], READ, "--noise")
    options = {f"{name}_noise": value for name, value in named.items()}
    return options | ({"noise": _share(shares[-1], "--noise")} if shares else {})


def _ranges(texts: list[str]) -> dict[str, tuple[float, float]]:
    """Return the ranges by term, SI, in the units of the terms' coefficients."""
    if not texts:
        return {}
    from sindyjoint.equation.catalogue import load_catalogue

    catalogue = load_catalogue("extended")
    pairs = [_parted(text, None, "--range") for text in texts]
    return {name: span(value, catalogue[name].unit, f"--range {name}") for name, value in pairs}


@with_blocks
def curves(
    subject: Annotated[
        str,
        typer.Argument(
            metavar="MODEL|RIG",
            help="model.json, or a folder with one; or a rig's TOML file, or pulse-rig, four-panel-wing.",
        ),
    ],
    model: Annotated[
        list[Path] | None,
        typer.Option(help="Of a rig: model.json for the joints that it stands for. May be repeated."),
    ] = None,
    frequencies: Annotated[
        list[str] | None,
        typer.Option("--frequency", help="Of a joint: '4 Hz'. May be repeated. [lowest and highest tested]"),
    ] = None,
    amplitudes: Annotated[
        str | None, typer.Option(help="Of a joint: '10..800 urad'. [0.02..1.5 of the largest tested]")
    ] = None,
    levels: Annotated[
        list[str] | None,
        typer.Option("--level", help="Of a rig: amplitude of the force, '2 N'. May be repeated. [three]"),
    ] = None,
    band: Annotated[str | None, typer.Option(help="Of a rig: '3..6 Hz'. [around its first mode]")] = None,
    modes: Annotated[int, typer.Option(min=1, help="Of a rig: how many are followed over amplitude.")] = 2,
    at: Annotated[str | None, typer.Option(help="Of a rig: where the force acts. [as the rig says]")] = None,
    point: Annotated[
        str | None, typer.Option(help="Of a rig: whose deflection the response is. [the rig's first]")
    ] = None,
    harmonics: Annotated[
        int | None,
        typer.Option(min=1, help="Of a rig: that are balanced. [at each point as many as it needs]"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for report.html, curves.json, tables and figures.")
    ] = None,
    *,
    output: Output,
    progress: Progress,
) -> None:
    """Draw a joint's stiffness, loss and energy over amplitude; or a structure's frequency response and modes.

    Of a structure: frequency response at several levels of a harmonic force, frequency and damping of its modes over
    their amplitude, by harmonic balance with exact sticking. 95 % bands follow from the covariance of the models.

    First: sindyjoint discover --out results

    Example: sindyjoint curves results --out curves

    Example: sindyjoint curves pulse-rig --model results --level "0.4 N" --level "1.2 N" --out curves
    """
    find = call(
        "workflows.curves:curves",
        subject,
        model=model or (),
        frequencies=[parse_quantity(text, "Hz", "--frequency") for text in frequencies or []],
        levels=[parse_quantity(text, "N", "--level") for text in levels or []],
        modes=modes,
        at=at,
        point=point,
        progress=progress.say,
        **given(
            harmonics=harmonics,
            amplitudes=read_by(_sizes, amplitudes),
            band=read_by(span, band, "Hz", "--band"),
        ),
    )
    # What next steps are written with: a model by itself, or a rig and perhaps a model for its joints.
    alone = subject.endswith(".json") or (Path(subject) / "model.json").is_file()
    known = Path(subject) if alone else next(iter(model or ()), None)
    answer(find, out, output, progress, None, model or (), None if alone else subject, known)


def _sizes(text: str) -> tuple[float, float]:
    """Return the ends of amplitudes in rad, or m where the unit is a length."""
    try:
        return span(text, "rad", "--amplitudes")
    except UnitError:
        return span(text, "m", "--amplitudes")
