"""A table of text, every form it takes, and the tables that several results have: terms, findings."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np

from sindyjoint.soundness import Finding
from sindyjoint.text import in_columns

if TYPE_CHECKING:
    import rich.console
    from rich.table import Table

T = TypeVar("T")
Console: TypeAlias = "rich.console.Console"
DASH = "–"
# What begins with a digit, a sign or an estimate's "about": 5910 ± 40, −2 %, < 0.1.
FIGURE = re.compile(r"[-−+±<>≤≥~≈(\[]?\s*[-−+]?\s*[.\d∞]")
LATEX = {
    "&": r"\&",
    "%": r"\%",
    "_": r"\_",
    "#": r"\#",
    "$": r"\$",
    "{": r"\{",
    "}": r"\}",
    "\\": r"\textbackslash{}",
    "–": "--",
    "−": r"$-$",
    "±": r"$\pm$",
    "·": r"$\cdot$",
    "τ": r"$\tau$",
    "…": r"\ldots{}",
}
SUPERSCRIPT = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


@dataclass(frozen=True)
class TextTable:
    """A table of text that every format is made of.

    Parameters
    ----------
    name, title : str
        The name stands in files and links, the title is what people read.
    columns : tuple of str
    rows : tuple of tuple of str
    text : tuple of str
        Columns that hold words even where these begin with a digit, as names of runs do.
    marked : int, optional
        The row that a page lays stress on.
    ruled, wraps : bool
        Whether, on a terminal, a line stands below the headings, and the last column, of words, is broken into lines
        where a narrow screen leaves it room for that.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text: tuple[str, ...] = ()
    marked: int | None = None
    ruled: bool = False
    wraps: bool = False

    @property
    def is_text(self) -> tuple[bool, ...]:
        """Whether a column holds words and not figures: such a one begins at the left."""
        if not self.rows:
            return (True,) * len(self.columns)
        return tuple(
            name in self.text
            or any(cell not in ("", DASH, "unknown") and not FIGURE.match(cell) for cell in column)
            for name, column in zip(self.columns, zip(*self.rows, strict=True), strict=True)
        )

    def take(self, *columns: str) -> TextTable:
        """Return the table with some of its columns, in their order there."""
        places = [self.columns.index(column) for column in columns]
        return replace(self, columns=columns, rows=tuple(tuple(row[i] for i in places) for row in self.rows))

    def headed(self, *columns: str, **look: Any) -> TextTable:
        """Return the table under other headings; none: its own in small letters, as on a terminal."""
        heads = columns or tuple(c if c.isupper() else c.lower() for c in self.columns)
        text = tuple(heads[self.columns.index(name)] for name in self.text if name in self.columns)
        return replace(self, columns=heads, text=text, **look)

    def markdown(self) -> str:
        """Return the table as Markdown."""
        lines = [self.columns, ("---",) * len(self.columns), *self.rows]
        return "\n".join(
            "| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines
        )

    def latex(self) -> str:
        """Return the table as LaTeX for the package booktabs."""
        head, *body = (" & ".join(map(_tex, line)) + r" \\" for line in (self.columns, *self.rows))
        align = "l" + "r" * (len(self.columns) - 1)
        lines = [
            r"\begin{table}", rf"\caption{{{_tex(self.title)}}}", rf"\begin{{tabular}}{{{align}}}", r"\toprule", head,
            r"\midrule", *body, r"\bottomrule", r"\end{tabular}", r"\end{table}",
        ]  # fmt: skip
        return "\n".join(lines) + "\n"


def tabulate(
    name: str,
    title: str,
    items: Iterable[T],
    columns: Mapping[str, Callable[[T], str]],
    further: Iterable[tuple[str, ...]] = (),
    **more: Any,
) -> TextTable:
    """Return a table with a row for each item, described by what each column shows of it, and ``further`` rows."""
    rows = (tuple(cell(item) for cell in columns.values()) for item in items)
    return TextTable(name, title, tuple(columns), (*rows, *further), **more)


def csv_records(rows: Sequence[Mapping[str, object]]) -> str:
    """Return records of the same entries as CSV text."""
    return csv_text(list(rows[0]), [[*row.values()] for row in rows])


def shown(template: str, *values: float | None) -> str:
    """Return numbers in a text; a dash where one of them is none."""
    known = all(value is not None and math.isfinite(value) for value in values)
    return template.format(*values) if known else DASH


#: A number to four digits.
short_number = partial(shown, "{:.4g}")


def milliseconds(value: float | None) -> str:
    """Return a time in ms; a dash where there is none."""
    return shown("{:.3g} ms", None if value is None else 1e3 * value)


def aligned(table: TextTable) -> Iterator[str]:
    """Return headings and rows as lines with columns under each other: the first to the left, others to the right."""
    return in_columns((table.columns, *table.rows), str.rjust)


def json_text(record: Any) -> str:
    """Return a record as the text of a file."""
    return json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def csv_text(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a table as CSV text; numbers in full, nothing where none is known."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerows([_cell(cell) for cell in row] for row in (columns, *rows))
    return buffer.getvalue()


def csv_columns(columns: Mapping[str, Any], digits: int = 7) -> str:
    """Return columns of numbers as CSV text, by their headings; whole numbers as such."""
    rows = zip(*(np.asarray(column).tolist() for column in columns.values()), strict=True)
    return csv_text(
        list(columns), [[x if isinstance(x, int) else f"{x:.{digits}g}" for x in row] for row in rows]
    )


def _cell(cell: object) -> object:
    """Return a cell of a CSV text; text that a spreadsheet would take for a formula gets an apostrophe in front."""
    if isinstance(cell, float):
        return repr(float(cell)) if math.isfinite(cell) else ""
    if not isinstance(cell, str) or not cell.startswith(("=", "+", "-", "@", "\t", "\r")):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell


def escape(text: str) -> str:
    """Return text for a terminal in which nothing is markup."""
    from rich import markup

    return markup.escape(text)


def terminal() -> Console:
    """Return the console that results are printed on: as wide as its window, or 100 where output is piped."""
    from rich.console import Console

    # In a notebook, too, text is text: what a result shows there is its own matter.
    return Console(width=None if sys.stdout.isatty() else 100, highlight=False, force_jupyter=False)


def terminal_table(table: TextTable) -> Table:
    """Return a table for a terminal: names and words begin at the left."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    ruled: Any = {"box": box.SIMPLE_HEAD, "show_edge": False}
    made = Table(pad_edge=False, **ruled if table.ruled else {"box": None, "padding": (0, 2, 0, 0)})
    for place, (column, words) in enumerate(zip(table.columns, table.is_text, strict=True)):
        made.add_column(column, justify="right" if place and not words else "left", no_wrap=True)
    for row in table.rows:
        # Names are chosen by a person: Text keeps square brackets from being markup.
        made.add_row(*map(Text, row))
    return made


def natural_width(table: Table, console: Console) -> int:
    """Return how many characters a table takes where nothing limits it."""
    from rich.measure import Measurement

    return Measurement.get(console, console.options.update(max_width=10_000), table).maximum


def print_table(table: TextTable, console: Console) -> None:
    """Print a table as wide as it is: a number that is cut off is a wrong number."""
    from rich.console import Console

    made = terminal_table(table)
    natural = natural_width(made, console)
    if table.wraps:
        widest = max((len(row[-1]) for row in table.rows), default=0)
        # A column of words that is broken into lines keeps a word of twelve letters.
        made.columns[-1].no_wrap = natural - widest + 12 > console.width
    width = max(console.width, natural) if made.columns[-1].no_wrap else console.width
    Console(width=width, highlight=False, force_jupyter=False).print(made)


def fitting_blocks(table: TextTable, width: int) -> Iterator[TextTable]:
    """Yield a table in blocks of columns that fit a width; the first column, of names, begins each of them."""
    cells = zip(table.columns, *table.rows, strict=True)
    (first, reserved), *others = [(column[0], max(map(len, column)) + 3) for column in cells]
    block, used = [first], reserved
    for name, taken in others:
        if used + taken > width and len(block) > 1:
            yield table.take(*block)
            block, used = [first], reserved
        block.append(name)
        used += taken
    yield table.take(*block)


def _tex(text: str) -> str:
    text = re.sub(r"·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda found: f"\0{found[1].translate(SUPERSCRIPT)}\1", text)
    text = "".join(LATEX.get(char, char) for char in text)
    text = re.sub(r"([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda found: f"$^{{{found[1].translate(SUPERSCRIPT)}}}$", text)
    return text.replace("\0", r"$\cdot 10^{").replace("\1", "}$")


def findings_table(findings: Sequence[Finding]) -> TextTable:
    """Return what a check of the data found, one row for each finding."""
    columns: dict[str, Callable[[Finding], str]] = {
        "Finding": lambda f: f.id,
        "Where": lambda f: ", ".join(part for part in (f.run, f.channel) if part) or "all runs",
        "Severity": lambda f: f"{f.severity}, left out" if f.masked else f.severity,
        "Extent": lambda f: f.extent,
        "What it does; what to do": lambda f: f"{f.effect}; {f.remedy}",
    }
    title = "What the check of the data found, by the ids that --accept takes."
    return tabulate("findings", title, findings, columns, text=tuple(columns))
