"""Text for decks and code: names that people gave are data, and stay harmless in every syntax."""

from __future__ import annotations

import re
import textwrap
import unicodedata
from collections import namedtuple
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from sindyjoint.described import Maybe
from sindyjoint.equation.equation_text import Style, one_line
from sindyjoint.equation.formula import formula_text

if TYPE_CHECKING:
    from sindyjoint.equation.model import JointModel


@dataclass(frozen=True)
class Fidelity:
    """A row of the fidelity table.

    Parameters
    ----------
    term, symbol : str
        Id of the term or element and symbol of its coefficient; the last row is :data:`ALL_TERMS`.
    representation : str
        How the target represents it; for what is left out, "not carried" and why.
    carried : bool
    error, largest_error : float
        RMS and largest deviation from the term of the model over the tested range, as shares of the RMS moment of the
        test; over moving states, as everywhere: at a reversal friction is set-valued, and the representation says in
        words how the target sticks. For an omitted term this is the error of omitting it.
    """

    term: str
    symbol: str
    representation: str
    carried: bool
    error: Maybe
    largest_error: Maybe


def ascii_line(text: str) -> str:
    """Return one line of ASCII: accents dropped, Greek letters by name, other characters as question marks.

    Examples
    --------
    >>> ascii_line("Gelenk Süd, θ")
    'Gelenk Sud, theta'
    """
    plain = unicodedata.normalize("NFKD", one_line(text))
    return "".join(_ascii(c) for c in plain if not unicodedata.combining(c))


def _ascii(character: str) -> str:
    if character.isascii():
        return character
    name = unicodedata.name(character, "")
    if name.startswith("GREEK SMALL LETTER "):
        return name.removeprefix("GREEK SMALL LETTER ").lower()
    return {"·": "*", "−": "-", "–": "-", "±": "+-", "≤": "<=", "≥": ">=", "⋅": "*"}.get(character, "?")


def number(value: float) -> str:
    """Return the shortest text that reads back as the same float, with a decimal point or exponent."""
    return repr(float(value))


ALL_TERMS = "all terms"
Words = namedtuple(
    "Words", "moment angle rate angle_unit moment_unit stiffness_unit damping_unit inertia_unit"
)
_ROTATION = Words("moment", "angle", "rate", "rad", "N*m", "N*m/rad", "N*m*s/rad", "kg*m^2")
_TRANSLATION = Words("force", "displacement", "velocity", "m", "N", "N/m", "N*s/m", "kg")


def words_of(model: JointModel) -> Words:
    """Return words and units for the motion of a model."""
    return _ROTATION if model.joint.motion == "rotation" else _TRANSLATION


def heading(model: JointModel, target: str) -> list[str]:
    """Return what every file says first: joint, origin, equation, units."""
    words, fitted = words_of(model), model.fitted
    # Of samples without time there is no rate.
    rate = "without time" if fitted.quasi_static else f"{fitted.rate:.6g} {words.angle_unit}/s"
    return [
        f"Joint: {one_line(model.joint.name)}",
        f"Written by sindyjoint for {target}. Units: {words.angle_unit}, {words.moment_unit}, s, {words.inertia_unit} "
        "(SI)",
        f"Equation: {ASCII.equation(model.joint, model.terms, model.elements)}",
        f"Tested up to {fitted.angle:.6g} {words.angle_unit} and {rate}; RMS "
        f"{words.moment} {fitted.moment_rms:.6g} {words.moment_unit}"
        + ("; from simulated tests" if fitted.simulated else "")
        + (
            ""
            if fitted.mean_known
            else f"; the mean {words.angle} was not measured: zero is where the {words.moment} is"
        ),
    ]


ASCII = Style(formula_text, ascii_line, "*", ("I*alpha", "m*a"), "d{}/dt = {}", " with |{}| <= {}", "; ")


def fidelity_lines(rows: Sequence[Fidelity]) -> list[str]:
    """Return the fidelity table as aligned lines of text."""
    cells = [
        ("term", "symbol", "RMS error", "largest", "represented as"),
        *((r.term, r.symbol, _percent(r.error), _percent(r.largest_error), r.representation) for r in rows),
    ]
    lines = [tuple(map(one_line, line)) for line in cells]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)][:4]
    return [
        "Fidelity over the moving states of the tested range, errors in % of the RMS moment:",
        *("  ".join([*map(str.ljust, line[:4], widths), line[4]]).rstrip() for line in lines),
    ]


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share > 1e-12 else "0"


def preamble(model: JointModel, target: str, rows: Sequence[Fidelity], notes: Sequence[str]) -> list[str]:
    """Return heading, fidelity table, what is not carried, and notes."""
    held = () if any(term.inputs for term in model.terms) else model.inputs
    missing = [
        *(f"{each.label}: the law is that at {each.shown(each.reference)}" for each in held),
        *not_carried(rows),
    ]
    lines = [*heading(model, target), "", *fidelity_lines(rows), ""]
    lines += ["Not carried:", *(f"- {text}" for text in missing)] if missing else ["Everything is carried."]
    return [*lines, *(["", "Notes:", *(f"- {text}" for text in notes)] if notes else [])]


def not_carried(rows: Sequence[Fidelity]) -> tuple[str, ...]:
    """Return a sentence for each term or element that a table does not carry."""
    load = "force" if any(row.term == ALL_TERMS and row.symbol == "F" for row in rows) else "moment"
    return tuple(
        f"{row.term} ({row.symbol}): {row.representation.removeprefix('not carried: ')}; "
        f"leaving it out costs {100 * row.error:.3g} % of the RMS {load}"
        for row in rows
        if not row.carried and row.term != ALL_TERMS
    )


def comment(lines: Sequence[str], prefix: str, width: int = 110, ascii_only: bool = True) -> str:
    """Return lines as comments, wrapped, each after ``prefix``; ends with a line feed."""
    cleaned = ascii_line if ascii_only else one_line
    wrapped: list[str] = []
    for line in lines:
        # Columns of a table are aligned with spaces, which one_line would join.
        clean = "".join(part if part.isspace() else cleaned(part) for part in re.split("( {2,})", line))
        wrapped += textwrap.wrap(clean, width - len(prefix) - 1, subsequent_indent="    ") or [""]
    return "".join(f"{prefix} {part}".rstrip() + "\n" for part in wrapped)
