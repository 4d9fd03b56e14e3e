"""Python: a module that imports nothing but ``math``, with the law and exact stick-slip steps; FMI 2.0 around it."""

import hashlib
import os
import sys
import tempfile
from pathlib import Path

from sindyjoint.equation.equation_text import one_line
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import MissingExtraError
from sindyjoint.export import Export
from sindyjoint.export.code import (
    PythonPrinter,
    bounds,
    code,
    code_notes,
    exact_rows,
    identifiers,
    input_line,
    law_of,
)
from sindyjoint.export.fidelity import (
    Fidelity,
    comment,
    fidelity_lines,
    filled_in,
    not_carried,
    preamble,
    words_of,
)


def export(model: JointModel) -> Export:
    """Write ``joint.py``."""
    rows = exact_rows(model, "Python expression")
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
    rows = exact_rows(model, "Python expression inside the unit")
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
