"""What :class:`sindyjoint.shown.Shown` offers: any result as text, in a notebook, as a picture, a frame, a folder."""

from __future__ import annotations

import io
import os
import re
import sys
from contextlib import redirect_stdout
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, MissingExtraError
from sindyjoint.record import Campaign
from sindyjoint.reporting.equation import mathml
from sindyjoint.reporting.registry import draw, drawable, kinds_of, show, view_of
from sindyjoint.reporting.style import figure_bytes
from sindyjoint.reporting.text_table import TextTable
from sindyjoint.reporting.trust import NEXT
from sindyjoint.soundness.check import check_campaign

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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
        more = len(text) - LINES + 1
        text = [
            *text[: LINES - 1 - len(last)],
            f"... and {more} more lines; .report(folder) writes everything",
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
        head += f"<p>{mathml(model)}</p>"
    tables = view_of(result).tables(result)
    if not tables:
        return f"{head}<pre>{escape(text_of(result))}</pre>"
    names = ", ".join(figures_of(result))
    return f"{head}{_html_table(tables[0])}" + (f"<p>.plot(kind): {escape(names)}</p>" if names else "")


def _html_table(table: TextTable) -> str:
    rows = ["".join(f"<th>{escape(cell)}</th>" for cell in table.columns)]
    rows += ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in table.rows[:ROWS]]
    more = len(table.rows) - ROWS
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return f"<table>{body}</table>" + (f"<p>and {more} more rows</p>" if more > 0 else "")


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
    return check_campaign(result) if isinstance(result, Campaign) else result


def figures_of(result: Any) -> list[str]:
    """Return the kinds of figure that a result can show."""
    return drawable(_drawn(result))


def plot(result: Any, kind: str | None, ax: Axes | None) -> Any:
    """Draw a figure of a result; see :meth:`sindyjoint.shown.Shown.plot`."""
    kind_of_result, result = type(result).__name__, _drawn(result)
    names = drawable(result)
    if not names:
        raise InputError(f"a {kind_of_result} has no figures")
    name = names[0] if kind is None else kind
    if ax is None:
        _teach_notebook()
        return draw(name, result)
    known = kinds_of(result)
    view = view_of(result)
    data = view.gather(result)
    if name not in known:
        draw(name, result)  # says which there are
    panels = known[name].panels(data)
    if len(panels) != 1:
        single = [
            other for other, made in known.items() if len(made.panels(data)) == 1 and not made.projection
        ]
        raise InputError(
            f"figure {name!r} has {len(panels)} panels and one pair of axes was given; expected one of "
            f"{', '.join(single)}, or no axes"
        )
    return panels[0](data, ax)


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
    from sindyjoint.reporting.output import write_results

    return write_results(_drawn(result), folder, force=force)
