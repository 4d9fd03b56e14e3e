"""C: one C99 header with the law and exact stick-slip steps."""

from __future__ import annotations

from sindyjoint.equation.model import JointModel
from sindyjoint.export.base import Export
from sindyjoint.export.code import CPrinter, Law, code_notes, exact_rows, filled, input_line, law_of, written
from sindyjoint.export.text import comment, number, one_line, preamble


def export(model: JointModel) -> Export:
    """Write ``joint.h``."""
    rows, notes = exact_rows(model, "C expression"), code_notes(model)
    law, printer = law_of(model), CPrinter()
    stateful = bool(law.states)
    limits = ", ".join(written(limit, "HUGE_VAL") for limit in law.limits)
    text = filled(
        "joint.h.txt",
        model,
        printer,
        "HUGE_VAL",
        law,
        comment=block_comment(comment(preamble(model, "C", rows, notes), "")),
        name=string_literal(one_line(model.joint.name)),
        coefficients="\n".join(
            f"static const double {name} = {number(value)}; {block_comment(what)}"
            for name, value, what in law.numbers
        ),
        count=str(len(law.states)),
        names=", ".join([*(string_literal(one_line(state)) for state in law.states), "0"]),
        limits=", ".join([limits, "0"] if stateful else ["0"]),
        rates="\n".join(f"    out[{j}] = {printer.doprint(rate)};" for j, rate in enumerate(law.rates)),
        read=", const double *z" if stateful else "",
        write=", double *z" if stateful else "",
        give=", z" if stateful else "",
        z="z" if stateful else "0",
        declare="".join(f", double {name}" for name, _ in law.inputs),
        inputs="".join(f", {name}" for name, _ in law.inputs),
        unused="".join(f" (void){name};" for name, _ in law.inputs),
        references=_references(law),
    )
    return Export("c", {"joint.h": text}, rows, notes)


def _references(law: Law) -> str:
    """Return the lines that say what inputs the functions take, and their values of reference; nothing without."""
    if not law.inputs:
        return ""
    values = ", ".join(number(each.reference) for _, each in law.inputs)
    lines = [block_comment(input_line(*each)) for each in law.inputs]
    head = f"static const double JOINT_REFERENCE[] = {{{values}}}; /* of the inputs, last arguments of functions */"
    return "\n".join([head, *lines, ""])


def block_comment(text: str) -> str:
    """Return text as a C comment that nothing inside can end.

    Examples
    --------
    >>> block_comment("a */ b")
    '/* a * / b */'
    """
    safe = text.replace("\\", "/").replace("*/", "* /").replace("/*", "/ *").rstrip()
    return f"/* {safe.lstrip()} */" if "\n" not in safe else f"/*\n{safe}\n*/"


def string_literal(text: str) -> str:
    r"""Return text as a C string literal of UTF-8 bytes.

    Examples
    --------
    >>> print(string_literal('a "b" ü'))
    "a \042b\042 \303\274"
    """

    def byte(value: int) -> str:
        # Question marks could form trigraphs.
        plain = 32 <= value < 127 and chr(value) not in '"\\?'
        return chr(value) if plain else f"\\{value:03o}"

    return '"' + "".join(byte(value) for value in text.encode("utf-8")) + '"'
