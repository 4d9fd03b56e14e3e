"""C: one C99 header with the law and exact stick-slip steps."""

from __future__ import annotations

from sindyjoint.equation.model import JointModel
from sindyjoint.export.base import Export, not_carried
from sindyjoint.export.python import code_notes, exact_rows, inertia_unit
from sindyjoint.export.text import ascii_line, comment, number, one_line, preamble


def export(model: JointModel) -> Export:
    """Write ``joint.h``."""
    from sindyjoint.export.code import code_of, template

    code = code_of(model, "c")
    rows = exact_rows(model, "C expression")
    missing, notes = not_carried(rows), code_notes(model)
    text = template("joint.h.txt").substitute(
        comment=block_comment(comment(preamble(model, "C", rows, missing, notes), "")),
        name=string_literal(one_line(model.joint.name)),
        inertia=number(code.inertia),
        inertia_unit=inertia_unit(model),
        low=_number(code.limits[0]),
        high=_number(code.limits[1]),
        stiffness=number(code.stiffness),
        damping=number(code.damping),
        coefficients="\n".join(
            f"static const double {name} = {number(value)}; "
            + block_comment(f"{ascii_line(unit)}, {ascii_line(what)}")
            for name, value, unit, what in code.coefficients
        ),
        law=code.law,
    )
    return Export("c", {"joint.h": text}, rows, missing, notes)


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


def _number(value: float) -> str:
    return number(value) if abs(value) != float("inf") else ("HUGE_VAL" if value > 0 else "-HUGE_VAL")
