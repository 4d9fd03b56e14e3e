"""What every result offers: as text, in a notebook, as a picture, a frame, and whole in a folder or not at all."""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from typing import Any

from sindyjoint.documents import kind_of_results, read_checked
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, MissingExtraError, OutputError
from sindyjoint.files.atomic import output_folder
from sindyjoint.record import Campaign
from sindyjoint.reporting.page import Blocks, provenance
from sindyjoint.reporting.registry import (
    DATA_FILE,
    draw,
    draw_all,
    drawable,
    list_saved,
    panels_of,
    saved_text,
    show,
    view_of,
    view_of_type,
)
from sindyjoint.reporting.style import Axes, figure_bytes
from sindyjoint.reporting.view import NEXT
from sindyjoint.soundness.check import check_data

# No result prints more lines than a screen shows, nor a notebook more rows.
LINES, ROWS = 40, 30
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")


def text_of(result: Any) -> str:
    """Return what the command line prints of a result, at most so many lines as a screen shows."""
    out = io.StringIO()
    with redirect_stdout(out):
        show(result)
    # A notebook asks for colours, which only a terminal can show.
    text = _COLOURS.sub("", out.getvalue()).rstrip("\n").split("\n")
    if len(text) > LINES:
        # What to do next stands at the end, and stays.
        last = text[text.index(NEXT) - 1 :] if NEXT in text else []
        last = last if len(last) < LINES // 2 else []
        text = [
            *text[: LINES - 1 - len(last)],
            f"... and {len(text) - LINES + 1} more lines; .report(folder) writes everything",
            *last,
        ]
    return "\n".join(line.rstrip() for line in text)


def line_of(result: Any) -> str:
    """Return a result in one line."""
    return f"<{type(result).__name__}: {text_of(result).split(chr(10), 1)[0]}>"


def html_of(result: Any) -> str:
    """Return a result for a notebook: what it says first, its equation, its main table."""
    head = f"<p><b>{escape(text_of(result).split(chr(10), 1)[0])}</b></p>"
    model = _model_of(result)
    if model is not None:
        from sindyjoint.reporting.mathml import mathml

        head += f"<p>{mathml(model)}</p>"
    tables = view_of(result).tables(result)
    if not tables:
        return f"{head}<pre>{escape(text_of(result))}</pre>"
    names, more = ", ".join(figures_of(result)), len(tables[0].rows) - ROWS
    head += str(Blocks({}, {}).table(replace(tables[0], rows=tables[0].rows[:ROWS])))
    return f"{head}{f'<p>and {more} more rows</p>' * (more > 0)}{f'<p>.plot(kind): {escape(names)}</p>' * bool(names)}"


def latex_of(result: Any) -> str | None:
    """Return the equation of the model that a result found; None where it holds none."""
    model = _model_of(result)
    return None if model is None else f"$\\displaystyle {model.latex()}$"


def _model_of(result: Any) -> Any:
    """Return the model of a result, where that has terms to be written."""
    model = getattr(result, "model", None)
    if not isinstance(model, JointModel):  # of a comparison, whose model is one of its choices
        model = getattr(getattr(result, "discovery", None), "model", None)
    return model if getattr(model, "terms", None) else None


def _drawn(result: Any) -> Any:
    """Return what is drawn and written of a result: of a campaign, its check."""
    return check_data(result) if isinstance(result, Campaign) else result


def figures_of(result: Any) -> list[str]:
    """Return the kinds of figure that a result can show."""
    return drawable(_drawn(result))


def plot(result: Any, kind: str | None, ax: Axes | None) -> Any:
    """Draw a figure of a result; see :meth:`sindyjoint.described.Shown.plot`."""
    kind_of_result, result = type(result).__name__, _drawn(result)
    names = drawable(result)
    if not names:
        raise InputError(f"a {kind_of_result} has no figures")
    name = names[0] if kind is None else kind
    if ax is None:
        _teach_notebook()
        return draw(name, result)
    view, data, _, panels = panels_of(name, result)
    if len(panels) != 1:
        single = [
            other
            for other, made in view.figures(data).items()
            if len(made.panels(data)) == 1 and not made.projection
        ]
        raise InputError(
            f"figure {name!r} has {len(panels)} panels and one pair of axes was given; expected one of "
            f"{', '.join(single)}, or no axes"
        )
    panels[0](data, ax)
    return ax


def _teach_notebook() -> None:
    """Let a notebook show figures that belong to no global state, which it does not know by itself."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if shell is None:
        return
    from matplotlib.figure import Figure

    formatter = shell.display_formatter.formatters["image/png"]
    try:
        formatter.lookup_by_type(Figure)
    except KeyError:
        formatter.for_type(Figure, lambda figure: figure_bytes(figure, "png", dpi=110))


def frame_of(result: Any) -> Any:
    """Return the records of a result as a data frame."""
    try:
        import pandas
    except ImportError as error:
        raise MissingExtraError(
            'a data frame needs pandas; run: pip install "sindyjoint[notebook]"'
        ) from error
    view = view_of(result)
    records = view.records(result)
    if not records:  # the columns all the same
        return pandas.DataFrame(columns=[name for table in view.tables(result)[:1] for name in table.columns])
    return pandas.DataFrame.from_records(records)


def report(result: Any, folder: str | os.PathLike[str], force: bool) -> Path:
    """Write a result into a folder."""
    return write_results(_drawn(result), folder, force=force)


def write_results(
    result: Any,
    folder: str | os.PathLike[str],
    command_line: str | Sequence[str] | None = None,
    seed: object = None,
    files: Sequence[str | os.PathLike[str]] = (),
    force: bool = False,
) -> Path:
    """Write the page, the record, the figures and the further files of a result, all of them or none.

    Earlier results of the same kind are replaced, all of their files; of another kind, they stay where they are, and
    these go into a folder of their own within: ``results/diagnosis``.

    Parameters
    ----------
    result : Discovery, Verification, Diagnosis, Comparison, Batch, Reproduction or RigMotion
    folder : path
        Made if it does not exist. After an error everything is as before.
    command_line, seed, files
        For the page's last section; see :func:`sindyjoint.reporting.page.provenance`.
    force : bool
        Replace files of the same names that are no such results, or were changed since.

    Returns
    -------
    Path
        The folder that they stand in.

    Raises
    ------
    OutputError
        If the folder cannot be written, or holds other files of these names.
    """
    view, name = view_of(result), view_of_type(result).folder
    target = place_of(name, folder)
    data = view.gather(result)
    pictures = draw_all(data)
    origin = provenance(
        view.campaign(result), view.seed(result, seed), command_line, [*files, *view.inputs(result)]
    )
    texts = {
        DATA_FILE: saved_text(data),
        PAGE: view.html(result, data, origin, pictures, target),
        **view.texts(result, data),
    }
    with output_folder(target, name, force=force) as stage:
        (stage / "figures").mkdir()
        for kind, svg in pictures.items():
            (stage / "figures" / f"{kind}.svg").write_bytes(svg)
        for file, text in texts.items():
            # Of a path that is no UTF-8 the page shows the bytes, as JSON writes them.
            (stage / file).write_bytes(text.encode("utf-8", errors="backslashreplace"))
    link_pages(Path(folder))
    return target


@dataclass(frozen=True)
class CampaignFiles:
    """Writes more about each campaign of a batch into its folder; for ``batch(write=...)``.

    Parameters
    ----------
    extras : tuple of str
        What is written: ``"reports"``, as ``sindyjoint discover --out`` does; ``"diagnosis"``, what ``sindyjoint
        diagnose --out`` writes, in a folder of that name.
    """

    extras: tuple[str, ...]

    def __call__(self, result: Any, folder: Path) -> None:
        """Write what was asked for about a discovery."""
        if "reports" in self.extras:
            # Over the model that the batch itself has put into the folder.
            write_results(result, folder, force=True)
        if "diagnosis" in self.extras and result.found:
            from sindyjoint.workflows.diagnose import diagnose

            try:
                # As it was read: what is left out of it is found, left out and said once more.
                campaign = result.measured or result.campaign
                write_results(
                    diagnose(campaign, result.model, accept=result.soundness.accepted), folder / "diagnosis"
                )
            except InputError as error:
                # The joint is discovered all the same.
                (folder / "diagnosis").mkdir(exist_ok=True)
                (folder / "diagnosis" / "impossible.txt").write_text(f"{error}\n", encoding="utf-8")


PAGE = "report.html"
_LINKS = re.compile(r'<p class="beside">.*?</p>')


def place_of(name: str, folder: str | os.PathLike[str]) -> Path:
    """Return where results of a kind go: into the folder, or within where results of another kind came first.

    Raises
    ------
    OutputError
        For a batch, whose campaigns stand in the folder itself.
    """
    there = kind_of_results(Path(folder))
    if there in ("", name):
        return Path(folder)
    if name == "batch":
        raise OutputError(
            f"{str(folder)!r} holds the results of a {there}; choose another folder for a batch"
        )
    return Path(folder) / name


def link_pages(folder: Path) -> None:
    """Name in every page of a folder the pages of other kinds that stand there too."""
    places = list_saved(folder)
    for name, place in places.items():
        others = [
            f'<a href="{os.path.relpath(there / PAGE, place).replace(os.sep, "/")}">{other}</a>'
            for other, there in places.items()
            if other != name
        ]
        links = f'<p class="beside">{"Also here: " if others else ""}{", ".join(others)}</p>'
        # A page that was changed since is not ours.
        with suppress(InputError, OutputError, OSError):
            page = read_checked(place / PAGE).decode("utf-8")
            linked = _LINKS.sub(links, page, count=1)
            if linked != page:
                with output_folder(place, name, whole=False) as stage:
                    (stage / PAGE).write_bytes(linked.encode("utf-8"))
