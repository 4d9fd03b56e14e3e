"""Python: a module that imports nothing but ``math``, with the law and exact stick-slip steps."""

from __future__ import annotations

from sindyjoint.equation.model import JointModel
from sindyjoint.export.base import Export, Fidelity
from sindyjoint.export.code import PythonPrinter, code_notes, exact_rows, filled, input_line, law_of, written
from sindyjoint.export.text import comment, number, one_line, preamble


def export(model: JointModel) -> Export:
    """Write ``joint.py``."""
    rows = exact_rows(model, "Python expression")
    return Export("python", {"joint.py": source(model, rows, "Python")}, rows, code_notes(model))


# What the template says of internal states; nothing, for a law that has none.
_DOCUMENT = "\n\n    state lists the internal states in the order of STATES; without it they are zero."
STATEFUL = {
    "argument": ", state",
    "start": ", state=None",
    "document": _DOCUMENT,
    "advanced": f"{_DOCUMENT}\n    It is advanced in place.",
    "unpack": "    z = state or [0.0] * len(STATES)\n",
    "copy": "list(state or [0.0] * len(STATES))",
    "keep": "    if state is not None:\n        state[:] = z\n",
    "inside": ", z",
    "states_inside": ", states",
    "begin": "    state = [0.0] * len(STATES) if state is None else state\n",
}


def source(model: JointModel, rows: tuple[Fidelity, ...], target: str) -> str:
    """Return the text of the module."""
    law = law_of(model)
    printer = PythonPrinter({"fully_qualified_modules": True})
    rates = ", ".join(printer.doprint(rate) for rate in law.rates)
    limits = ", ".join(written(limit, "math.inf") for limit in law.limits)
    given = STATEFUL if law.states else dict.fromkeys(STATEFUL, "") | {"copy": "[]"}
    given = {**dict.fromkeys(("references", "inner", "hand", "bind"), ""), **given}
    if law.inputs:
        defaults = "".join(f", {name}={number(each.reference)}" for name, each in law.inputs)
        passed = "".join(f", {name}={name}" for name, _ in law.inputs)
        lines = ["Inputs of the law, keywords of its functions:", *(input_line(*each) for each in law.inputs)]
        given |= {
            "start": given["start"] + defaults,
            "argument": given["argument"] + passed,
            "inside": given["inside"] + ", **u",
            "states_inside": given["states_inside"] + ", **u",
            "inner": ", u",
            "hand": ", u",
            "bind": f"    u = dict({passed.removeprefix(', ')})\n",
            "references": comment(lines, "#"),
        }
    return filled(
        "joint.py.txt",
        model,
        printer,
        "math.inf",
        law,
        coefficients="\n".join(f"{name} = {number(value)}  # {what}" for name, value, what in law.numbers),
        comment=comment(preamble(model, target, rows, code_notes(model)), "#"),
        name=ascii(one_line(model.joint.name)),
        motion=ascii(model.joint.motion),
        states=ascii([one_line(name) for name in law.states]),
        limits=f"[{limits}]",
        rates=f"[{rates}]",
        **given,
    )
