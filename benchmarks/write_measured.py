"""Write the guide's page *Measured* from what ``benchmarks/measured.toml`` holds.

python benchmarks/write_measured.py
"""

from __future__ import annotations

import re
import tomllib
from itertools import groupby
from pathlib import Path
from typing import Any

from scipy.stats import binomtest

HERE = Path(__file__).resolve().parent
DATA = HERE / "measured.toml"
PAGE = HERE.parent / "docs" / "guide" / "measured.md"

HEAD = """\
# Measured

The figures of README and guide, with their commands; run them in a clone after `pip install -e ".[test]"`.
Most draw joints at random, so that the truth is known; `FOLDER` holds public data. A count has the 95 %
interval of its rate in per cent (Clopper and Pearson), its cases taken as independent. What a benchmark wrote
with `run --out FILE`, `show FILE` prints; `RIG` and `DRIVE` stand for those of the rows.
`benchmarks/write_measured.py` writes this page.
"""


def with_interval(cell: str) -> str:
    """Return a cell; a count ``N/M`` with the 95 % interval of its rate in per cent."""
    count = re.fullmatch(r"(\d+)/(\d+)", cell)
    if not count:
        return cell
    low, high = binomtest(int(count[1]), int(count[2])).proportion_ci(0.95)
    return f"{cell} ({100 * low:.3g}–{100 * high:.3g})"


def row(cells: list[str]) -> str:
    """Return a line of a table."""
    return f"|{'|'.join(cells)}|"


def section(table: dict[str, Any]) -> str:
    """Return what one table says: what was tried, the rows or what a benchmark printed, the commands."""
    parts = [f"### {table['title']}"] if "title" in table else []
    parts.append(table["tried"])
    if commands := table.get("commands"):
        parts.append("\n".join(["```sh", *commands, "```"]))
    if "output" in table:
        parts.append(f"```{{literalinclude}} ../comparisons/{table['output']}.txt\n:language: text\n```")
    elif table["rows"]:
        lines = [table["columns"], ["-"] * len(table["columns"])]
        lines += [[with_interval(cell) for cell in cells] for cells in table["rows"]]
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
