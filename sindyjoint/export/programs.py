"""Programs that hold the law: a Python module, FMI 2.0 around it, and a script that makes blocks of Simscape.

The module imports nothing but ``math``, and steps stick and slip exactly. Of Simscape a spring, a damper and a
friction block are in parallel. Elements with internal states are a custom component beside them, in a file of its own.
"""

import hashlib
import math
import os
import sys
import tempfile
from dataclasses import replace
from functools import partialmethod, reduce
from pathlib import Path
from typing import Any

import numpy as np
import sympy
from sympy.printing.str import StrPrinter

from sindyjoint.equation.equation_text import one_line
from sindyjoint.equation.formula import variable_symbols
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import MissingExtraError
from sindyjoint.export import Export
from sindyjoint.export.code import (
    DIRECTION,
    InFull,
    PythonPrinter,
    bounds,
    code,
    code_notes,
    formula_rows,
    identifiers,
    input_line,
    law_of,
)
from sindyjoint.export.fidelity import (
    Cycles,
    Fidelity,
    Represented,
    Rows,
    ascii_line,
    comment,
    elastic_curve,
    elastic_rows,
    exact_rows,
    fidelity_lines,
    fidelity_table,
    filled_in,
    inertia_note,
    inertial_rows,
    left_out,
    not_carried,
    preamble,
    range_note,
    rate_curve,
    rate_rows,
    words_of,
)
from sindyjoint.export.parts import POINTS, RAMP, Curve, Parts


def export_python(model: JointModel) -> Export:
    """Write ``joint.py``."""
    rows = formula_rows(model, "Python expression")
    return Export("python", {"joint.py": _source(model, rows, "Python")}, rows, code_notes(model))


def _source(model: JointModel, rows: tuple[Fidelity, ...], target: str) -> str:
    """Return the text of the module."""
    law = law_of(model)
    lines = ["Inputs of the law, keywords of its functions:", *(input_line(*each) for each in law.inputs)]
    return code(
        "joint.py.j2",
        model,
        PythonPrinter({"fully_qualified_modules": True}),
        "math.inf",
        law,
        comment=comment(preamble(model, target, rows, code_notes(model)), "#"),
        references=comment(lines, "#") if law.inputs else "",
        name=ascii(one_line(model.joint.name)),
        motion=ascii(model.joint.motion),
        states=ascii([one_line(name) for name in law.states]),
    )


def export_fmu(model: JointModel) -> Export:
    """Write ``joint.fmu``: FMI 2.0 co-simulation, the Python module as a slave, packed by pythonfmu.

    The joint with its moving inertia is driven by a moment; the unit returns angle, rate and whether it sticks.

    Raises
    ------
    MissingExtraError
        When pythonfmu is not installed.
    """
    rows = formula_rows(model, "Python expression inside the unit")
    notes = [
        "input: moment, held over each communication step; outputs: angle, rate, stuck, transfer_moment; parameters: "
        "inertia, initial_angle, initial_rate",
        f"{bounds(model)}: the unit then refuses the step",
        "the unit runs Python inside (binaries for Linux and Windows, 64 bit): the machine that runs it needs Python 3",
    ]
    law = law_of(model)
    states, inputs = law.states, law.inputs
    inner = "internal states are local variables, zero at the start: " + ", ".join(states)
    notes += [inner] * bool(states)
    notes += ["the moving inertia is not known: set the parameter inertia"] * (model.inertia == 0)
    notes += ["further inputs, SI: " + "; ".join(input_line(*each) for each in inputs)] * bool(inputs)
    # Two units in one process share Python's table of modules: a name made of the content keeps them apart.
    digest = hashlib.sha256(model.to_json().encode("utf-8", "backslashreplace")).hexdigest()
    module = f"joint_{digest[:12]}"
    words = words_of(model)
    text = filled_in(
        "joint_fmu.py.j2",
        law=law,
        states=ascii([name.replace("JOINT_", "state_", 1) for name in identifiers(states)]),
        inputs=ascii({name: each.reference for name, each in inputs}),
        module=_source(model, rows, "FMI 2.0"),
        description=ascii(one_line(model.joint.name)),
        guid=ascii(digest[:32]),
        angle=ascii(f"{words.angle}, {words.angle_unit}"),
    )
    data = _packed(module, text, "\n".join([*fidelity_lines(rows), "", *not_carried(rows), *notes, ""]))
    return Export("fmu", {"joint.fmu": data}, rows, tuple(notes))


def _packed(module: str, text: str, documentation: str) -> bytes:
    """Return the unit of a script, and leave no trace of having made it."""
    try:
        from pythonfmu.builder import FmuBuilder
    except ImportError as error:
        raise MissingExtraError(
            "an FMU is made with the package pythonfmu, which is not installed; "
            "install it with: pip install 'sindyjoint[fmu]'"
        ) from error
    with tempfile.TemporaryDirectory(prefix="sindyjoint-") as temporary:
        folder = Path(temporary)
        script = folder / f"{module}.py"
        script.write_text(text, encoding="utf-8")
        (folder / "documentation").mkdir()
        (folder / "documentation" / "fidelity.txt").write_text(documentation, encoding="utf-8")
        path, before = list(sys.path), sys.modules.get(module)
        written = sys.dont_write_bytecode
        sys.dont_write_bytecode = True
        try:
            unit = FmuBuilder.build_FMU(
                script, dest=folder / "joint.fmu", documentation_folder=folder / "documentation"
            )
            data = Path(os.fspath(unit)).read_bytes()
        finally:
            # The builder imports the script and leaves it, and its folder, behind.
            sys.dont_write_bytecode = written
            sys.path[:] = path
            sys.modules.pop(module, None)
            sys.modules.update({} if before is None else {module: before})
    return data


NAME = "sindyjoint_elements"
VECTORS = {"deformation": "deformations", "velocity": "velocities"}


def export_simscape(model: JointModel) -> Export:
    """Write ``joint.m`` and, for a model with elements, ``sindyjoint_elements.ssc``."""
    parts, cycles = Parts.of(model), Cycles.of(model)
    curve = elastic_curve(parts, POINTS)
    rates = rate_curve(parts, parts.other_rate)
    threshold = RAMP * model.fitted.rate  # the block reaches 76 % of its friction here: ω_Coul
    words = words_of(model)
    kind = "Rotational" if model.joint.motion == "rotation" else "Translational"
    rows = fidelity_table(
        model,
        cycles,
        {
            **elastic_rows(parts, cycles, curve.x, f"Nonlinear {kind} Spring, table of {POINTS} points"),
            **_friction_rows(parts, cycles, threshold, kind),
            **rate_rows(
                parts, parts.other_rate, cycles, rates.x, f"Nonlinear {kind} Damper, table of {rates.x.size} points"
            ),
            **left_out(
                parts.coupled, f"these blocks have no {words.moment} of {words.angle} and {words.rate} together"
            ),
            **inertial_rows(parts),
            **{e.id: Represented(f"component {NAME}", cycles.element(e)) for e in model.elements},
        },
    )  # fmt: skip
    notes = (
        f"put the blocks in parallel: Nonlinear {kind} Spring and Damper (Simscape Driveline, by table lookup, linear "
        f"interpolation) and {kind} Friction (Foundation Library)",
        *(
            (
                f"elements are the custom component {NAME} in {NAME}.ssc, in parallel to the blocks; its internal "
                "states are variables, and its ports are R and C as those of the blocks",
            )
            if model.elements
            else ()
        ),
        *(
            (
                f"the friction block is a smooth curve, tanh({words.rate}/{threshold:.4g}): it creeps instead of "
                f"sticking, slower than that {words.rate}",
            )
            if parts.friction > 0
            else ()
        ),
        range_note(model, "set the extrapolation method to linear"),
        *inertia_note(model),
    )
    text = comment(preamble(model, "Simscape", rows, notes), "%")
    text += _script(model, parts, curve, rates if parts.other_rate else None, threshold)
    files: dict[str, str | bytes] = {"joint.m": text}
    if model.elements:
        files[f"{NAME}.ssc"] = _component(model, comment(preamble(model, "Simscape", rows, notes), "%"))
    return Export("simscape", files, rows, notes)


def _friction_rows(parts: Parts, cycles: Cycles, threshold: float, kind: str) -> Rows:
    how = f"{kind} Friction, Coulomb and breakaway friction; creeps instead of sticking"
    smooth = np.tanh(cycles.rate / threshold)
    viscous = exact_rows(parts.viscous, cycles, f"{kind} Friction, viscous coefficient")
    coulomb = {term.id: Represented(how, term.coefficient * smooth) for term in parts.coulomb}
    if parts.damping < 0:
        viscous = left_out(parts.viscous, "the block's viscous coefficient must not be negative")
    if parts.friction < 0:
        coulomb = left_out(parts.coulomb, "the block's friction must not be negative")
    return viscous | coulomb


def _script(model: JointModel, parts: Parts, curve: Curve, rates: Curve | None, threshold: float) -> str:
    words = words_of(model)
    vectors = [("spring", "deformation", words.angle_unit, curve)] if parts.elastic else []
    vectors += [] if rates is None else [("damper", "velocity", f"{words.angle_unit}/s", rates)]
    return filled_in(
        "joint.m.j2", words=words, vectors=vectors, plural=VECTORS,
        name=ascii_line(model.joint.name).replace("'", "''"),
        quantity="torque" if model.joint.motion == "rotation" else "force", friction=max(parts.friction, 0.0),
        damping=max(parts.damping, 0.0),
        breakaway=10 * threshold,  # the block takes a tenth of it as the threshold of its Coulomb part
    )  # fmt: skip


class SimscapePrinter(InFull, StrPrinter):
    """Formulas in the language of Simscape: powers by ^, max and min of two."""

    def _print_Abs(self, expr: Any) -> str:
        return f"abs({self._print(expr.args[0])})"

    def _nested(self, name: str, expr: Any) -> str:
        printed = map(self._print, reversed(expr.args))
        return reduce(lambda others, first: f"{name}({first}, {others})", printed)

    _print_Max = partialmethod(_nested, "max")
    _print_Min = partialmethod(_nested, "min")

    def _print_Heaviside(self, expr: Any) -> str:
        return f"(1 + sign({self._print(expr.args[0])}))/2"


def _component(model: JointModel, head: str) -> str:
    """Return the file of the component, headed by a comment."""
    rotation = model.joint.motion == "rotation"
    law = law_of(replace(model, terms=(), covariance=()))  # the elements alone
    load, unit, angle, rate = ("t", "N*m", "rad", "w") if rotation else ("f", "N", "m", "v")
    limits = [limit if math.isfinite(limit) else None for limit in law.limits]
    return filled_in(
        "elements.ssc.j2",
        name=NAME,
        head=head.rstrip("\n"),
        domain="rotational.rotational" if rotation else "translational.translational",
        load=load,
        unit=unit,
        angle=angle,
        rate=rate,
        law=law,
        rates=list(zip(map(_written, law.rates), limits, strict=True)),
        moment=_written(law.moment),
        ascii_line=ascii_line,
    )


def _written(expression: Any) -> str:
    """Return an expression of the law with z1 for z[0], and the sign of the rate for the direction of slip."""
    renamed = {DIRECTION: sympy.sign(variable_symbols()[1])}
    for symbol in expression.free_symbols:
        if symbol.name.startswith("z["):
            renamed[symbol] = sympy.Symbol(f"z{int(symbol.name[2:-1]) + 1}", real=True)
    return SimscapePrinter().doprint(expression.xreplace(renamed)).replace("**", "^")
