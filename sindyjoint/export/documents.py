r"""Documents that hold the model itself: LaTeX (packages ``booktabs`` and ``amsmath``), and JSON."""

from __future__ import annotations

import json
import re
from dataclasses import asdict
from decimal import Decimal

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.equation_text import latex_symbol, latex_text
from sindyjoint.equation.formula import formula_latex, parameter_symbol
from sindyjoint.equation.model import JointModel, ModelTerm
from sindyjoint.export import Export
from sindyjoint.export.fidelity import Cycles, Represented, fidelity_table
from sindyjoint.export.text import Fidelity, comment, preamble, words_of


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
            f"  {model.latex()}",
            r"\end{equation}",
            r"\begin{table}",
            r"  \centering",
            rf"  \caption{{Terms of the transfer {words.moment} of {latex_text(model.joint.name)}, with standard "
            rf"errors, identified up to $ {_scientific(fitted.angle, 3)} $ {_unit(words.angle_unit)} and "
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


def _row(term: ModelTerm) -> str:
    parameters = "".join(
        rf", $ {latex_symbol(name)} = {_scientific(value, 4)} $" for name, value in term.parameters
    )
    return (
        rf"{latex_text(term.name)}{parameters} & $ {latex_symbol(term.symbol)} $ & "
        rf"$ {with_error(term.coefficient, term.standard_error)} $ & {_unit(term.unit)} \\"
    )


def _element_rows(element: JointElement) -> list[str]:
    symbols = [latex_symbol(column.name) for column in element.columns]
    symbols += [formula_latex(parameter_symbol(parameter.name)) for parameter in element.parameters]
    return [
        rf"{latex_text(element.name)} & $ {symbol} $ & "
        rf"$ {with_error(number.value, number.standard_error)} $ & {_unit(number.unit)} \\"
        for symbol, number in zip(symbols, element.numbers, strict=True)
    ]


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
    text = latex_text(unit).replace(r"\textasciicircum{}", "^").replace("*", r"\,")
    return re.sub(r"\^(-?\d+)", r"\\textsuperscript{\1}", text)
