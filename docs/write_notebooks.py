"""Write each example program as a notebook too, into docs/notebooks; the build of the guide does so.

python docs/write_notebooks.py [FOLDER]
"""

from __future__ import annotations

import ast
import json
import re
import sys
from itertools import pairwise
from pathlib import Path

DOCS = Path(__file__).resolve().parent
EXAMPLES = DOCS.parent / "examples"
# A program writes where its first argument says; a notebook has none.
ARGUMENT = re.compile(r"sys\.argv\[1\] if len\(sys\.argv\) > 1 else (\"[^\"]*\")")
KERNEL = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}


def notebook_of(text: str) -> dict:
    """Return the notebook of a program: its docstring as text, then its code, cut where blank lines part statements."""
    tree, lines = ast.parse(text), text.splitlines()
    inside = {line for node in tree.body for line in range(node.lineno, (node.end_lineno or node.lineno) + 1)}
    # Blank lines outside of any statement, counted from 0; two in a row make an empty cell, which is left out.
    blank = [at for at, line in enumerate(lines) if not line.strip() and at + 1 not in inside]
    places = [tree.body[0].end_lineno or 0, *blank, len(lines)]
    title, _, body = (ast.get_docstring(tree) or "").partition("\n")
    cells = [("markdown", f"# {title}\n\n{body.strip()}")]
    pieces = ["\n".join(lines[start:end]).strip() for start, end in pairwise(places)]
    cells += [("code", piece) for piece in pieces if piece]
    made = [
        {"cell_type": kind, "id": f"cell-{number}", "metadata": {}, "source": ARGUMENT.sub(r"\1", source)}
        | ({"outputs": [], "execution_count": None} if kind == "code" else {})
        for number, (kind, source) in enumerate(cells)
    ]
    return {"cells": made, "metadata": KERNEL, "nbformat": 4, "nbformat_minor": 5}


def write_notebooks(folder: Path = DOCS / "notebooks") -> list[Path]:
    """Write the notebooks of all examples, and return where they stand."""
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for program in sorted(EXAMPLES.glob("[0-9][0-9]_*.py")):
        made.append(folder / f"{program.stem}.ipynb")
        text = json.dumps(notebook_of(program.read_text(encoding="utf-8")), indent=1, ensure_ascii=False)
        made[-1].write_text(text + "\n", encoding="utf-8")
    return made


if __name__ == "__main__":
    write_notebooks(*map(Path, sys.argv[1:2]))
