r"""Documents that hold the model itself: LaTeX (packages ``booktabs`` and ``amsmath``), and JSON."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from decimal import Decimal

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.equation_text import latex_symbol, numbered, renamed
from sindyjoint.equation.formula import formula_latex, parameter_symbol
from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.export import Export
from sindyjoint.export.fidelity import Cycles, Represented, fidelity_table
from sindyjoint.export.text import Fidelity, comment, one_line, preamble, words_of

_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)?", re.ASCII)
_SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "|": r"\textbar{}", '"': r"\textquotedbl{}",
}  # fmt: skip


def export_json(model: JointModel) -> Export:
    """Write ``model.json``: the model as discover writes it, with its fidelity table; every command reads it back."""
    rows = _rows(model, "formula, coefficient, covariance", "formulas, numbers, covariance")
    record = {**model.to_dict(), "fidelity": [asdict(row) for row in rows]}
    return Export("json", {"model.json": json.dumps(record, indent=1) + "\n"}, rows)


def _rows(model: JointModel, term: str, element: str) -> tuple[Fidelity, ...]:
    cycles = Cycles.of(model)
    represented = {t.id: Represented(term, cycles.term(t)) for t in model.terms}
    represented |= {e.id: Represented(element, cycles.element(e)) for e in model.elements}
    return fidelity_table(model, cycles, represented)


def export_latex(model: JointModel) -> Export:
    """Write ``joint.tex``, to be input into a document: the equation and a table of the terms."""
    rows = _rows(model, "formula and coefficient", "formulas and numbers")
    notes = ("needs the packages booktabs and amsmath; coefficients are rounded to their standard errors",)
    rotation, words = model.joint.motion == "rotation", words_of(model)
    inertia = (
        rf" The moving inertia is $ {'I' if rotation else 'm'} = {_scientific(model.joint.inertia, 4)} $ "
        rf"{_unit(words.inertia_unit)}."
        if model.joint.inertia is not None
        else ""
    )
    fitted = model.fitted
    text = comment(preamble(model, "LaTeX", rows, notes), "%", ascii_only=False)
    text += "\n".join(
        [
            r"\begin{equation}",
            f"  {equation(model)}",
            r"\end{equation}",
            r"\begin{table}",
            r"  \centering",
            rf"  \caption{{Terms of the transfer {words.moment} of {escape(model.joint.name)}, with standard errors, "
            rf"identified up to $ {_scientific(fitted.angle, 3)} $ {_unit(words.angle_unit)} and "
            rf"$ {_scientific(fitted.rate, 3)} $ {_unit(words.angle_unit + '/s')}.{inertia}}}",
            r"  \begin{tabular}{llll}",
            r"    \toprule",
            r"    Term & Symbol & Coefficient & Unit \\",
            r"    \midrule",
            *(f"    {_row(term)}" for term in model.terms),
            *(f"    {line}" for element in model.elements for line in _element_rows(element)),
            r"    \bottomrule",
            r"  \end{tabular}",
            r"\end{table}",
            "",
        ]
    )
    return Export("latex", {"joint.tex": text}, rows, notes)


def equation(model: JointModel) -> str:
    """Return what ``model.latex()`` does, with symbols that are no plain names set as text."""
    symbols = [term.symbol for term in model.terms] + [c.name for e in model.elements for c in e.columns]
    if all(_PLAIN.fullmatch(symbol) for symbol in symbols):
        return model.latex()
    motion = model.joint.motion
    rotation = model.joint.motion == "rotation"
    parts = [r"I\,\ddot{\theta}" if rotation else r"m\,\ddot{x}"] if model.joint.inertia is not None else []
    parts += [
        rf"{_symbol(term.symbol)}\,\left({formula_latex(term.expression, model.joint.motion)}\right)"
        for term in model.terms
    ]
    rates = []
    for element, names in zip(model.elements, numbered(model.elements), strict=True):
        columns, states = renamed(element, names)
        parts += [
            rf"{_symbol(c.symbol)}\,\left({formula_latex(c.expression, motion)}\right)" for c in columns
        ]
        for name, rate, limit in states:
            bound = "" if limit is None else rf",\ |{_symbol(name)}| \leq {formula_latex(limit, motion)}"
            rates.append(rf"\dot{{{_symbol(name)}}} = {formula_latex(rate, motion)}{bound}")
    return r",\quad ".join([("M = " if rotation else "F = ") + " + ".join(parts), *rates])


def escape(text: str) -> str:
    r"""Return text that LaTeX prints as it stands.

    Examples
    --------
    >>> print(escape("50% of A_1 & {B}"))
    50\% of A\_1 \& \{B\}
    """
    return "".join(_SPECIAL.get(c, c) for c in one_line(text))


def _row(term: ModelTerm) -> str:
    parameters = "".join(
        rf", $ {_symbol(name)} = {_scientific(value, 4)} $" for name, value in term.parameters
    )
    return (
        rf"{escape(term.name)}{parameters} & $ {_symbol(term.symbol)} $ & "
        rf"$ {with_error(term.coefficient, term.standard_error)} $ & {_unit(term.unit)} \\"
    )


def _element_rows(element: JointElement) -> list[str]:
    symbols = [_symbol(column.name) for column in element.columns]
    symbols += [_parameter(parameter.name) for parameter in element.parameters]
    return [
        rf"{escape(element.name)} & $ {symbol} $ & "
        rf"$ {with_error(number.value, number.standard_error)} $ & {_unit(number.unit)} \\"
        for symbol, number in zip(symbols, element.numbers, strict=True)
    ]


def _parameter(name: str) -> str:
    """Return the name of a nonlinear parameter as formulas have it."""
    return formula_latex(parameter_symbol(name)) if _PLAIN.fullmatch(name) else _symbol(name)


def _symbol(symbol: str) -> str:
    return latex_symbol(symbol) if _PLAIN.fullmatch(symbol) else rf"\text{{{escape(symbol)}}}"


def with_error(value: float, error: float) -> str:
    r"""Return value and standard error with two digits of the error.

    Examples
    --------
    >>> with_error(-2.684e9, 1.234e7)
    '(-2.684 \\pm 0.012) \\cdot 10^{9}'
    >>> with_error(48.13, 0.0)
    '48.13'
    """
    if not error > 0:
        return _scientific(value, 6)
    exponent = Decimal(value).adjusted() if value else Decimal(error).adjusted()
    if -3 < exponent < 4:
        exponent = 0
    digits = max(exponent - Decimal(error).adjusted() + 1, 0)
    body = f"{value / 10.0**exponent:.{digits}f} \\pm {error / 10.0**exponent:.{digits}f}"
    return rf"({body}) \cdot 10^{{{exponent}}}" if exponent else body


def _scientific(value: float, digits: int) -> str:
    mantissa, _, exponent = f"{value:.{digits}g}".partition("e")
    return rf"{mantissa} \cdot 10^{{{int(exponent)}}}" if exponent else mantissa


def _unit(unit: str) -> str:
    text = escape(unit).replace(r"\textasciicircum{}", "^").replace("*", r"\,")
    return re.sub(r"\^(-?\d+)", r"\\textsuperscript{\1}", text)
