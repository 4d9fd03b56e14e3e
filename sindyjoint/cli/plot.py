"""``sindyjoint plot``: one figure, from saved results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sindyjoint.cli.defaults import default_of

WIDTH: float = default_of("reporting.registry:draw", "width")
DPI: int = default_of("reporting.style:figure_bytes", "dpi")
FORMATS = ("svg", "pdf", "png")


def plot(
    results: Annotated[
        Path,
        typer.Argument(
            metavar="MODEL|DIR", help="Folder that a command wrote with --out, or the model.json in it."
        ),
    ],
    kind: Annotated[
        str | None,
        typer.Argument(metavar="KIND", help="Which figure. Without it: the list of those it can show."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write: .svg, .pdf or .png. [KIND.svg]")
    ] = None,
    width: Annotated[
        float,
        typer.Option(min=2.5, max=20, help="Width in inches: 3.5 for one column of a paper, 7 for two."),
    ] = WIDTH,
    dpi: Annotated[int, typer.Option(min=50, max=1200, help="Dots per inch of a .png.")] = DPI,
) -> None:
    """Draw one figure of a saved result, for a paper.

    Example: sindyjoint plot results loops --out loops.pdf --width 3.5
    """
    from sindyjoint.errors import InputError
    from sindyjoint.files.atomic import write_bytes
    from sindyjoint.reporting.saved import drawing, load_results

    target = out if out is not None else Path(f"{kind}.svg")
    suffix = target.suffix.lower().removeprefix(".")
    if suffix not in FORMATS:
        raise InputError(f"--out is {str(target)!r}; expected a name that ends in .svg, .pdf or .png")
    data = load_results(results)

    from sindyjoint.reporting.registry import draw, drawable, kinds_of
    from sindyjoint.reporting.style import figure_bytes

    with drawing(results):
        names = drawable(data, parts=True)
        figure = None if kind is None else figure_bytes(draw(kind, data, width), suffix, dpi)
    if figure is None:
        longest = max(map(len, names))
        for name in names:
            typer.echo(f"{name:<{longest}}  {kinds_of(data)[name].caption}")
        return
    typer.echo(f"wrote {write_bytes(target, figure)}", err=True)
