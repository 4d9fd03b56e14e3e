"""Python: a module that imports nothing but ``math``, with the law and exact stick-slip steps."""

from __future__ import annotations

from sindyjoint.equation.model import JointModel
from sindyjoint.export.base import Export, Fidelity
from sindyjoint.export.code import PythonPrinter, code_notes, exact_rows, filled
from sindyjoint.export.text import ascii_line, comment, number, one_line, preamble


def export(model: JointModel) -> Export:
    """Write ``joint.py``."""
    rows = exact_rows(model, "Python expression")
    return Export("python", {"joint.py": source(model, rows, "Python")}, rows, code_notes(model))


def source(model: JointModel, rows: tuple[Fidelity, ...], target: str) -> str:
    """Return the text of the module."""
    return filled(
        "joint.py.txt",
        model,
        PythonPrinter({"fully_qualified_modules": True}),
        "math.inf",
        lambda name, term: (
            f"{name} = {number(term.coefficient)}  # {ascii_line(term.unit)}, {ascii_line(term.name)}"
        ),
        comment=comment(preamble(model, target, rows, code_notes(model)), "#"),
        name=ascii(one_line(model.joint.name)),
        motion=ascii(model.joint.motion),
    )
