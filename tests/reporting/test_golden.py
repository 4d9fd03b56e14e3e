"""What people read, held against files: terminal, pages and equations of every result.

Each text was checked before it was kept. To renew one after an intended change: delete the file, run twice, check.
"""

from pathlib import Path

import pytest
from handmade import ORIGIN, model, page_html
from handmade_results import comparison, diagnosis, verification
from test_reporting_page import read
from test_reporting_results import written

from sindyjoint.equation import list_catalogues, load_catalogue
from sindyjoint.reporting import draw_all, show

GOLDEN = Path(__file__).resolve().parents[1] / "golden"

TERMINALS = {
    "verification": (show, lambda: verification(runs=("pulse at tip", "3Hz [bold] high"))),
    "verification-failed": (show, lambda: verification(failed=True)),
    "diagnosis": (show, diagnosis),
    "comparison": (show, comparison),
}


def held(name, text):
    """Hold a text against its file; write the file where there is none."""
    text = "".join(line.rstrip() + "\n" for line in text.splitlines())
    path = GOLDEN / f"{name}.txt"
    if not path.exists():
        path.write_text(text, encoding="utf-8")
        pytest.fail(f"{path.name} was missing and has been written; look at it and run again")
    assert text == path.read_text(encoding="utf-8"), (
        f"if the new text reads well, delete {path.name} and run twice"
    )


@pytest.mark.parametrize("name", TERMINALS)
def test_terminal(name, capsys):
    show, make = TERMINALS[name]
    show(make())
    held(f"terminal-{name}", capsys.readouterr().out)


def words_of(html):
    """Return what a reader sees, down to the versions and dates."""
    lines = read(html).lines
    return "\n".join(lines[: lines.index("Where this comes from")])


def test_page_of_a_verification():
    made = verification()
    held("page-verification", words_of(page_html(made, ORIGIN, draw_all(made))))


def test_page_of_a_diagnosis():
    made = diagnosis()
    held("page-diagnosis", words_of(page_html(made, ORIGIN, draw_all(made))))


def test_page_of_a_comparison(tmp_path):
    folder = written(comparison(), tmp_path / "out")
    held("page-comparison", words_of((folder / "report.html").read_text(encoding="utf-8")))


def equations():
    """Yield every shipped term without nonlinear parameters as text and as LaTeX, and a whole model."""
    seen = set()
    for summary in list_catalogues():
        for term in load_catalogue(summary.name):
            if term.id in seen or term.parameters or term.inputs or "alpha" in term.formula:
                continue
            seen.add(term.id)
            unit = term.unit_for("rotation")
            made = model(
                terms=[(term.id, term.symbol, term.name, term.family, term.formula, unit, "", 1.5, 0.1, 1.0)]
            )
            yield f"{term.id}: {made.equation()}    {made.latex()}"
    yield model().equation()
    yield model(motion="translation").latex()


def test_equations():
    held("equations", "\n".join(equations()))
