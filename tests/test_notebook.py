"""The notebooks run, and show what they hold; every example is one as well, with the same code."""

import ast
import re
import sys
from pathlib import Path

import pytest

NOTEBOOK = Path(__file__).resolve().parents[1] / "examples" / "from_sindy_to_joint.ipynb"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]\d+)?")


OWN_DATA = NOTEBOOK.with_name("own_data_to_diagnosis.ipynb")


def printed(notebook):
    return "".join(out.get("text", "") for cell in notebook.cells for out in cell.get("outputs", []))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the machinery between the kernel and this process
def test_the_notebook_prints_what_it_shows():
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed: the notebook is not run")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed: the notebook is not run")
    import nbformat

    shown = nbformat.read(NOTEBOOK, as_version=4)
    run = nbclient.NotebookClient(nbformat.read(NOTEBOOK, as_version=4), timeout=240).execute()
    assert not [out for cell in run.cells for out in cell.get("outputs", []) if out.output_type != "stream"]
    before, now = printed(shown), printed(run)
    assert NUMBER.sub("#", now) == NUMBER.sub("#", before)
    # The plain script's columns are so badly scaled that its answer depends on the linear algebra in use.
    assert [*map(float, NUMBER.findall(now))] == pytest.approx(
        [*map(float, NUMBER.findall(before))], rel=0.05
    )
    # Term, truth, pysindy's default, the joint model.
    table = {row[0]: [float(value) for value in row[1:]] for row in map(str.split, now.splitlines()) if len(row) == 4
             and row[0] in ("linear_stiffness", "cubic_stiffness", "coulomb_friction")}  # fmt: skip
    assert (
        all(joint == pytest.approx(truth, rel=0.01) for truth, _, joint in table.values()) and len(table) == 3
    )
    assert table["linear_stiffness"][1] == pytest.approx(5281, rel=0.05) and table["cubic_stiffness"][1] == 0


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the machinery between the kernel and this process
def test_own_data_to_a_diagnosis_with_pictures():
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed: the notebook is not run")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed: the notebook is not run")
    import nbformat

    run = nbclient.NotebookClient(nbformat.read(OWN_DATA, as_version=4), timeout=240).execute()
    outputs = [out for cell in run.cells for out in cell.get("outputs", [])]
    shown = [kind for out in outputs for kind in out.get("data", {})]
    assert shown.count("image/png") == 2 and shown.count("text/html") == 3 and shown.count("text/latex") >= 1
    text = printed(run)
    assert "Can I trust it? Yes" in text and "simulated" in text
    found = dict(re.findall(r"(k1|M_F) = ([\d.]+)", text))
    assert float(found["k1"]) == pytest.approx(6066, rel=0.01) and float(found["M_F"]) == pytest.approx(
        1.867, rel=0.01
    )
    (named,) = [
        out.data["text/html"] for out in outputs if "Diagnosis" in out.get("data", {}).get("text/plain", "")
    ]
    assert "Coulomb" in named
    # What is kept in the file is what a reader sees without running it.
    kept = nbformat.read(OWN_DATA, as_version=4)
    held = [kind for cell in kept.cells for out in cell.get("outputs", []) for kind in out.get("data", {})]
    assert sorted(held) == sorted(shown)


sys.path.insert(0, str(NOTEBOOK.parents[1] / "docs"))
EXAMPLES = sorted(NOTEBOOK.parent.glob("[0-9][0-9]_*.py"))


@pytest.mark.parametrize("program", EXAMPLES, ids=lambda program: program.stem)
def test_an_example_is_a_notebook_with_the_same_code(program):
    import nbformat
    from write_notebooks import ARGUMENT, notebook_of

    text = program.read_text(encoding="utf-8")
    made = nbformat.from_dict(notebook_of(text))
    nbformat.validate(made)
    first, *others = made.cells
    assert (
        first.cell_type == "markdown" and {cell.cell_type for cell in others} == {"code"} and len(others) > 3
    )
    code = ast.parse("\n".join(cell.source for cell in others))
    _, *statements = ast.parse(ARGUMENT.sub(r"\1", text)).body  # without the docstring
    assert [*map(ast.dump, code.body)] == [*map(ast.dump, statements)]
    assert "argv" not in "".join(cell.source for cell in others)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of the machinery between the kernel and this process
def test_a_notebook_of_an_example_runs(tmp_path):
    nbclient = pytest.importorskip("nbclient", reason="nbclient is not installed: the notebook is not run")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed: the notebook is not run")
    import nbformat
    from write_notebooks import notebook_of

    made = nbformat.from_dict(notebook_of(EXAMPLES[1].read_text(encoding="utf-8")))
    resources = {"metadata": {"path": str(tmp_path)}}
    run = nbclient.NotebookClient(made, timeout=240, resources=resources).execute()
    assert "k1" in printed(run) and (tmp_path / "results" / "02_own_data.png").is_file()
