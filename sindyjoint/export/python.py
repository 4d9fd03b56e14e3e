"""Python: a module that imports nothing but ``math``, with the law and exact stick-slip steps."""

from __future__ import annotations

from sindyjoint.equation.model import JointModel
from sindyjoint.export.base import Cycles, Export, Fidelity, Represented, fidelity_table, not_carried
from sindyjoint.export.text import ascii_line, comment, number, one_line, preamble


def export(model: JointModel) -> Export:
    """Write ``joint.py``."""
    rows = exact_rows(model, "Python expression")
    notes = code_notes(model)
    missing = not_carried(rows)
    return Export("python", {"joint.py": source(model, rows, "Python")}, rows, missing, notes)


def source(model: JointModel, rows: tuple[Fidelity, ...], target: str) -> str:
    """Return the text of the module."""
    from sindyjoint.export.code import code_of, template

    code = code_of(model, "python")
    lines = preamble(model, target, rows, not_carried(rows), code_notes(model))
    return template("joint.py.txt").substitute(
        comment=comment(lines, "#"),
        name=ascii(one_line(model.joint.name)),
        motion=ascii(model.joint.motion),
        inertia=number(code.inertia),
        inertia_unit=inertia_unit(model),
        low=_number(code.limits[0]),
        high=_number(code.limits[1]),
        stiffness=number(code.stiffness),
        damping=number(code.damping),
        coefficients="\n".join(
            f"{name} = {number(value)}  # {ascii_line(unit)}, {ascii_line(what)}"
            for name, value, unit, what in code.coefficients
        ),
        law=code.law,
    )


def _number(value: float) -> str:
    return number(value) if abs(value) != float("inf") else ("math.inf" if value > 0 else "-math.inf")


def inertia_unit(model: JointModel) -> str:
    """Return the unit of the moving inertia."""
    return "kg*m^2" if model.joint.motion == "rotation" else "kg"


def exact_rows(model: JointModel, how: str) -> tuple[Fidelity, ...]:
    """Return the fidelity table of a target that computes the formulas themselves."""
    from sindyjoint.equation.model import INERTIA
    from sindyjoint.export.parts import Parts

    cycles, inertial = Cycles.of(model), Parts.of(model).inertial
    represented = {term.id: Represented(how, cycles.term(term)) for term in model.terms}
    for term in inertial:
        if term.id == INERTIA:
            represented[term.id] = Represented("the number INERTIA, used in steps", cycles.term(term))
        else:
            represented[term.id] = Represented("not carried: a formula of the acceleration", None)
    return fidelity_table(model, cycles, represented)


def code_notes(model: JointModel) -> tuple[str, ...]:
    """Return what a user of generated code has to know."""
    from sindyjoint.export.code import bounds

    notes = [bounds(model)]
    if model.inertia == 0:
        notes.append("the moving inertia is not known: give one to step()")
    return tuple(notes)
