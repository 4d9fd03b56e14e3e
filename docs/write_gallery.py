"""Run every example and write the guide's gallery: text, picture and output of each.

python docs/write_gallery.py                  # some minutes
python docs/write_gallery.py 07_diagnose      # only examples whose name begins so; the others stay as they are
"""

from __future__ import annotations

import ast
import base64
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

DOCS = Path(__file__).resolve().parent
EXAMPLES = DOCS.parent / "examples"
PAGE = DOCS / "gallery.md"
KEPT = DOCS / "gallery"

HEAD = """\
# Gallery

Every program of `examples/`, with what it prints and draws. Each runs by itself in less than a minute; all data are
simulated.
"""


def programs() -> list[Path]:
    """Return the example programs, in order."""
    return sorted(EXAMPLES.glob("[0-9][0-9]_*.py"))


def notebooks() -> list[Path]:
    """Return the notebooks, the first steps first."""
    return sorted(EXAMPLES.glob("*.ipynb"), reverse=True)


def text_of(program: Path) -> tuple[str, str]:
    """Return title and description of a program: the first paragraph of its docstring, cut at a colon or question.

    The page shows the program, and with it the rest of the docstring.
    """
    parts = (ast.get_docstring(ast.parse(program.read_text(encoding="utf-8"))) or "").split("\n\n")
    title, rest = re.split(r"(?<=[:?]) ", " ".join(parts[0].split()), maxsplit=1)
    return title.rstrip(":"), rest[0].upper() + rest[1:]


def run(program: Path) -> None:
    """Run a program and keep what it printed and drew."""
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, str(program), folder],
            capture_output=True,
            encoding="utf-8",
            env=os.environ
            | {"PYTHONPATH": str(DOCS.parent), "MPLBACKEND": "agg", "PYTHONIOENCODING": "utf-8"},
        )
        if done.returncode:
            raise SystemExit(f"{program.name} failed:\n{done.stderr}")
        shutil.copy(Path(folder) / f"{program.stem}.png", KEPT / f"{program.stem}.png")
    lines = [line for line in done.stdout.splitlines() if not line.startswith("picture:")]
    (KEPT / f"{program.stem}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


def section(program: Path) -> str:
    """Return the section of a program."""
    title, body = text_of(program)
    return f"""\
({program.stem})=
## {title}

{body}

![](gallery/{program.stem}.png)

```{{literalinclude}} gallery/{program.stem}.txt
:language: text
:class: output
```

<details><summary><code>examples/{program.name}</code></summary>

```{{literalinclude}} ../examples/{program.name}
```

</details>

{{download}}`As a notebook <notebooks/{program.stem}.ipynb>`
"""


def keep_outputs(notebook: Path) -> None:
    """Keep what a notebook, as it is stored, printed, and its last picture."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    outputs = [output for cell in cells for output in cell.get("outputs", ())]
    printed = ["".join(output["text"]) for output in outputs if output["output_type"] == "stream"]
    (KEPT / f"{notebook.stem}.txt").write_text("\n".join(printed), encoding="utf-8")
    for output in outputs:
        if "image/png" in output.get("data", {}):
            picture = base64.b64decode("".join(output["data"]["image/png"]))
            (KEPT / f"{notebook.stem}.png").write_bytes(picture)


def notebook_section(path: Path) -> str:
    """Return the entry of a notebook: its title, its first words, its output, and the file."""
    first = "".join(json.loads(path.read_text(encoding="utf-8"))["cells"][0]["source"])
    title, _, body = first.partition("\n")
    title = title.lstrip("# ")
    picture = f"![](gallery/{path.stem}.png)\n\n" if (KEPT / f"{path.stem}.png").exists() else ""
    return f"""\
## Notebook: {title}

{body.strip()}

{picture}```{{literalinclude}} gallery/{path.stem}.txt
:language: text
:class: output
```

{{download}}`{path.name} <../examples/{path.name}>`
"""


def page() -> str:
    """Return the page: thumbnails that lead to the sections, then the sections."""
    titles = {program.stem: text_of(program)[0] for program in programs()}
    items = [f"- [![]({KEPT.name}/{name}.png) {title}](#{name})" for name, title in titles.items()]
    grid = "\n".join(["```{container} thumbnails", *items, "```", ""])
    parts = [HEAD, grid, *map(section, programs()), *map(notebook_section, notebooks())]
    return "\n".join(parts)


if __name__ == "__main__":
    KEPT.mkdir(exist_ok=True)
    for example in programs():
        if len(sys.argv) == 1 or example.stem.startswith(tuple(sys.argv[1:])):
            print(example.name, file=sys.stderr)
            run(example)
    for each in notebooks():
        keep_outputs(each)
    PAGE.write_text(page(), encoding="utf-8")
