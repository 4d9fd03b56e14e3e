"""``sindyjoint curves``: a joint over amplitude, a structure over frequency and amplitude."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.answer import answer, call
from sindyjoint.cli.defaults import default_of, given
from sindyjoint.cli.options import Output, with_blocks
from sindyjoint.cli.plan import span
from sindyjoint.cli.progress import Progress
from sindyjoint.errors import UnitError

CURVES = "workflows.curves:curves"


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
    modes: Annotated[
        int, typer.Option(min=1, help="Of a rig: how many are followed over amplitude.")
    ] = default_of(CURVES, "modes"),
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

    Example: sindyjoint curves results --out curves

    Example: sindyjoint curves pulse-rig --model results --level "0.4 N" --level "1.2 N" --out curves
    """
    from sindyjoint.files.units import parse_quantity

    find = call(
        CURVES,
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
            amplitudes=None if amplitudes is None else _sizes(amplitudes),
            band=None if band is None else span(band, "Hz", "--band"),
        ),
    )
    answer(find, out, output, progress, files=model or (), subject=subject)


def _sizes(text: str) -> tuple[float, float]:
    """Return the ends of amplitudes in rad, or m where the unit is a length."""
    try:
        return span(text, "rad", "--amplitudes")
    except UnitError:
        return span(text, "m", "--amplitudes")
