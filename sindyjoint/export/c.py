"""C: one C99 header with the law and exact stick-slip steps."""

from __future__ import annotations

from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.export.base import Export
from sindyjoint.export.code import CPrinter, code_notes, exact_rows, filled
from sindyjoint.export.text import ascii_line, comment, number, one_line, preamble


def export(model: JointModel) -> Export:
    """Write ``joint.h``."""
    rows, notes = exact_rows(model, "C expression"), code_notes(model)
    text = filled(
        "joint.h.txt",
        model,
        CPrinter(),
        "HUGE_VAL",
        _coefficient,
        comment=block_comment(comment(preamble(model, "C", rows, notes), "")),
        name=string_literal(one_line(model.joint.name)),
    )
    return Export("c", {"joint.h": text}, rows, notes)


def _coefficient(name: str, term: ModelTerm) -> str:
    meaning = block_comment(f"{ascii_line(term.unit)}, {ascii_line(term.name)}")
    return f"static const double {name} = {number(term.coefficient)}; {meaning}"


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
