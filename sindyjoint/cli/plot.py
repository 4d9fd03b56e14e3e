"""``sindyjoint plot``: one figure, from saved results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from sindyjoint.cli.defaults import default_of
from sindyjoint.cli.options import with_blocks
from sindyjoint.cli.progress import Progress

WIDTH: float = default_of("reporting.registry:draw", "width")
DPI: int = default_of("reporting.style:figure_bytes", "dpi")
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
    ] = WIDTH,
    dpi: Annotated[int, typer.Option(min=50, max=1200, help="Dots per inch of a .png.")] = DPI,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is no figure of ours.")] = False,
    *,
    progress: Progress,
) -> None:
    """Draw one figure of a saved result, for a paper.

    Example: sindyjoint plot results loops --out loops.pdf --width 3.5
    """
    from sindyjoint.documents import refuse_foreign_file
    from sindyjoint.errors import InputError
    from sindyjoint.files.atomic import write_bytes
    from sindyjoint.reporting.registry import drawing, list_saved

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

    from sindyjoint.reporting.registry import draw
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
