"""Write the guide's page *Measured* from the results of the benchmarks.

python benchmarks/write_measured.py

``benchmarks/measured.toml`` says of each table what was tried, against which truth, and by which command. Its figures
are the JSON that the benchmark wrote, in ``benchmarks/results``: a row for each record, a cell a format of its fields.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

HERE = Path(__file__).resolve().parent
DATA = HERE / "measured.toml"
RESULTS = HERE / "results"
PAGE = HERE.parent / "docs" / "guide" / "measured.md"

HEAD = """\
# Measured

The figures of this project, with their commands; run them in a clone after `pip install -e ".[test]"`.
`FOLDER` holds public data. A count has the 95 % interval of its rate in per cent (Clopper and Pearson), its cases taken
as independent. What a benchmark wrote with `run --out FILE`, `show FILE` prints; `RIG` and `DRIVE` stand for those of
the rows. `benchmarks/write_measured.py` writes this page.
"""


def with_interval(cell: str) -> str:
    """Return a cell; a count ``N/M`` with the 95 % interval of its rate in per cent."""
    count = re.fullmatch(r"(\d+)/(\d+)", cell)
    if not count or count[2] == "0":
        return cell
    low, high = binomtest(int(count[1]), int(count[2])).proportion_ci(0.95)
    return f"{cell} ({100 * low:.3g}–{100 * high:.3g})"


def formatted(template: str, record: Mapping[str, Any]) -> str:
    """Return a cell of a record; a dash where a field of it is unknown."""
    try:
        cell = template.format_map({key: _listed(value) for key, value in record.items()})
    except TypeError:
        return "–"
    return re.sub(r"(?<=\d)%", " %", cell)


def _listed(value: Any) -> Any:
    """Return what a cell shows of a field: the items of a list, the number of entries of a table."""
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return len(value) if isinstance(value, dict) else value


def rows_of(table: Mapping[str, Any]) -> list[list[str]]:
    """Return the cells of a table, of the benchmark's JSON."""
    names = table["results"]
    records = [each for name in names for each in json.loads((RESULTS / name).read_text("utf-8"))]
    shown = [each for each in records if each.get("kind") in table.get("kinds", [each.get("kind")])]
    # What a head says in brackets is left out below it.
    units = [" %" if "(%)" in title else None for title in table["columns"]]
    return [
        [
            formatted(cell, each).replace(unit or "\n", "")
            for cell, unit in zip(table["cells"], units, strict=True)
        ]
        for each in shown
    ]


def row(cells: list[str]) -> str:
    """Return a line of a table."""
    return f"|{'|'.join(cells)}|"


def section(table: dict[str, Any]) -> str:
    """Return what one table says: what was tried, the truth, the commands, the rows."""
    parts = [f"### {table['title']}"] if "title" in table else []
    parts.append(f"{table['tried']} Truth: {table['truth']}.")
    if commands := table.get("commands"):
        parts.append("\n".join(["```sh", *commands, "```"]))
    if rows := rows_of(table):
        lines = [table["columns"], ["-"] * len(table["columns"])]
        lines += [[with_interval(cell) for cell in cells] for cells in rows]
        parts.append("\n".join(map(row, lines)))
    return "\n\n".join(parts) + "\n"


def page() -> str:
    """Return the page, by topic."""
    tables = tomllib.loads(DATA.read_text(encoding="utf-8"))["table"]
    parts = [HEAD]
    for topic, group in groupby(tables, key=lambda table: table["topic"]):
        parts += [f"## {topic}\n", *map(section, group)]
    return "\n".join(parts)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
