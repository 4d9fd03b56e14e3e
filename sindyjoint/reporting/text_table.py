"""A table of text, and every form it takes: Markdown, LaTeX, CSV, aligned lines, a table on a terminal."""

from __future__ import annotations

import csv
import io
import math
import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

DASH = "–"
# What begins with a digit, a sign or an estimate's "about": 5910 ± 40, −2 %, < 0.1.
FIGURE = re.compile(r"[-−+±<>≤≥~≈(\[]?\s*[-−+]?\s*[.\d∞]")
LEAST_WORDS = 12  # characters of a column of words that is broken into lines
WIDTH = 100  # characters, where no terminal says how wide it is
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
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    text: tuple[str, ...] = ()

    @property
    def is_text(self) -> tuple[bool, ...]:
        """Whether a column holds words and not figures: such a one begins at the left."""
        if not self.rows:
            return (True,) * len(self.columns)
        return tuple(
            name in self.text or any(cell not in ("", DASH) and not FIGURE.match(cell) for cell in column)
            for name, column in zip(self.columns, zip(*self.rows, strict=True), strict=True)
        )

    def markdown(self) -> str:
        """Return the table as Markdown."""
        lines = [self.columns, ("---",) * len(self.columns), *self.rows]
        return "\n".join(
            "| " + " | ".join(cell.replace("|", r"\|") for cell in line) + " |" for line in lines
        )

    def latex(self) -> str:
        """Return the table as LaTeX for the package booktabs."""
        lines = [" & ".join(_tex(cell) for cell in line) + r" \\" for line in (self.columns, *self.rows)]
        head, body = lines[0], "\n".join(lines[1:])
        align = "l" + "r" * (len(self.columns) - 1)
        return (
            f"\\begin{{table}}\n\\caption{{{_tex(self.title)}}}\n\\begin{{tabular}}{{{align}}}\n\\toprule\n{head}\n\\midrule\n"
            f"{body}\n\\bottomrule\n\\end{{tabular}}\n\\end{{table}}\n"
        )


def short_number(value: float | None) -> str:
    """Return a number to four digits; a dash where there is none."""
    return DASH if value is None or not math.isfinite(value) else f"{value:.4g}"


def milliseconds(value: float | None) -> str:
    """Return a time in ms; a dash where there is none."""
    return DASH if value is None or not math.isfinite(value) else f"{1e3 * value:.3g} ms"


def aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield rows, headings first, with columns under each other: the first to the left, others to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    for row in rows:
        cells = [cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)]
        yield "  ".join([row[0].ljust(widths[0]), *cells])


def csv_text(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a table as CSV text."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerows([_harmless(cell) for cell in row] for row in (columns, *rows))
    return buffer.getvalue()


def _harmless(cell: object) -> object:
    """Return a cell that no spreadsheet takes for a formula: text that begins like one gets an apostrophe in front."""
    if not isinstance(cell, str) or not cell.startswith(("=", "+", "-", "@", "\t", "\r")):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell


def terminal(width: int = WIDTH, markup: bool = True) -> Console:
    """Return the console that results are printed on: as wide as its window, or ``width`` where output is piped."""
    from rich.console import Console

    # In a notebook, too, text is text: what a result shows there is its own matter.
    return Console(
        width=None if sys.stdout.isatty() else width, highlight=False, markup=markup, force_jupyter=False
    )


def terminal_table(
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    align: str = "lr",
    ruled: bool = False,
    wraps: bool = False,
) -> Table:
    """Return a table for a terminal.

    Parameters
    ----------
    columns : sequence of str
    rows : sequence of sequence of str
    align : str
        A letter for each column, l or r; the last one holds for all that follow.
    ruled : bool
        Whether a line stands below the headings.
    wraps : bool
        Whether cells may be broken into lines.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = (
        Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
        if ruled
        else Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    )
    for column, side in zip(columns, align.ljust(len(columns), align[-1]), strict=False):
        table.add_column(column, justify="left" if side == "l" else "right", no_wrap=not wraps)
    for row in rows:
        # Names are chosen by a person: Text keeps square brackets from being markup.
        table.add_row(*(Text(cell) for cell in row))
    return table


def natural_width(table: Table, console: Console) -> int:
    """Return how many characters a table takes where nothing limits it."""
    from rich.measure import Measurement

    return Measurement.get(console, console.options.update(max_width=10_000), table).maximum


def print_whole(table: Table, console: Console) -> None:
    """Print a table as wide as it is: a number that is cut off is a wrong number."""
    from rich.console import Console

    Console(
        width=max(console.width, natural_width(table, console)), highlight=False, force_jupyter=False
    ).print(table)


def fitting_blocks(
    columns: Sequence[str], rows: Sequence[Sequence[str]], width: int
) -> Iterator[tuple[Sequence[str], list[Sequence[str]]]]:
    """Yield a table in blocks of columns that fit a width; the first column, of names, begins each of them."""
    widths = [max(len(cell) for cell in column) + 3 for column in zip(columns, *rows, strict=True)]
    start = 1
    while start < len(columns):
        end, used = start + 1, widths[0] + widths[start]
        while end < len(columns) and used + widths[end] <= width:
            used += widths[end]
            end += 1
        kept = [0, *range(start, end)]
        yield [columns[i] for i in kept], [[row[i] for i in kept] for row in rows]
        start = end


def print_wrapped(table: Table, console: Console) -> None:
    """Print a table whose last column, which holds words, is broken into lines where the screen is narrow."""
    table.columns[-1].no_wrap = False
    least = natural_width(table, console) - _widest(table)
    print_whole(table, console) if least + LEAST_WORDS > console.width else console.print(table)


def _widest(table: Table) -> int:
    return max((len(str(cell)) for cell in table.columns[-1].cells), default=0)


def _tex(text: str) -> str:
    text = re.sub(r"·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda found: f"\0{found[1].translate(SUPERSCRIPT)}\1", text)
    text = "".join(LATEX.get(char, char) for char in text)
    text = re.sub(r"([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda found: f"$^{{{found[1].translate(SUPERSCRIPT)}}}$", text)
    return text.replace("\0", r"$\cdot 10^{").replace("\1", "}$")
