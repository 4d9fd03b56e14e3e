"""The equation as MathML, which every browser typesets without help from the net."""

from __future__ import annotations

from html import escape
from typing import Any

from sympy.printing.mathml import MathMLPresentationPrinter

from sindyjoint.discovery.model import INERTIA, JointModel, ModelTerm

_NAMES = "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi rho sigma tau phi chi psi omega"
THIN_SPACE = '<mspace width="0.17em"/>'
# sympy names entities that are not XML, and sets a hyphen where a minus belongs.
_BETTER = {
    "<mo>&InvisibleTimes;</mo>": THIN_SPACE,
    "<mi>&ExponentialE;</mi>": "<mi>e</mi>",
    "<mo>-</mo>": "<mo>−</mo>",
}
GREEK = dict(zip(_NAMES.split(), "αβγδεζηθκλμνξρστφχψω", strict=True))
_DOTS = {"theta": ("", "θ", "x"), "omega": ("˙", "θ", "x"), "alpha": ("¨", "θ", "x")}


class _StatePrinter(MathMLPresentationPrinter):
    """Presentation MathML with θ, θ̇, θ̈ (x, ẋ, ẍ) for the variables of a formula."""

    def __init__(self, motion: str):
        super().__init__()
        self._motion = motion

    def _print_Symbol(self, sym: Any, style: str = "plain") -> Any:
        if sym.name not in _DOTS:
            return super()._print_Symbol(sym, style)
        dots, angle, displacement = _DOTS[sym.name]
        letter = self.dom.createElement("mi")
        letter.appendChild(self.dom.createTextNode(displacement if self._motion == "translation" else angle))
        if not dots:
            return letter
        over = self.dom.createElement("mover")
        over.setAttribute("accent", "true")
        over.appendChild(letter)
        accent = self.dom.createElement("mo")
        accent.appendChild(self.dom.createTextNode(dots))
        over.appendChild(accent)
        return over

    def _print_sign(self, expr: Any) -> Any:
        row = self.dom.createElement("mrow")
        for tag, text in (("mi", "sgn"), ("mo", "("), (None, ""), ("mo", ")")):
            if tag is None:
                row.appendChild(self._print(expr.args[0]))
                continue
            element = self.dom.createElement(tag)
            element.appendChild(self.dom.createTextNode(text))
            if tag == "mo":
                element.setAttribute("stretchy", "false")
            row.appendChild(element)
        return row

    def _print_Float(self, expr: Any) -> Any:
        number = self.dom.createElement("mn")
        number.appendChild(self.dom.createTextNode(f"{float(expr):.4g}"))
        return number


def mathml(model: JointModel) -> str:
    """Return the equation, with symbols for coefficients, as a ``<math>`` element; all text in it is escaped."""
    motion = model.joint.motion
    printer = _StatePrinter(motion)
    parts = [_term(printer, term) for term in sorted(model.terms, key=lambda t: t.id != INERTIA)]
    if model.joint.inertia is not None:
        letter, variable = ("m", "x") if motion == "translation" else ("I", "θ")
        second = f'<mover accent="true"><mi>{variable}</mi><mo>¨</mo></mover>'
        parts.insert(0, f"<mi>{letter}</mi><mo>⁢</mo>{second}")
    left = "F" if motion == "translation" else "M"
    # Each summand is a row of its own: a browser may break the line only between them.
    right = "<mo>+</mo>".join(f"<mrow>{part}</mrow>" for part in parts) or "<mn>0</mn>"
    return f'<math display="block"><mi>{left}</mi><mo>=</mo>{right}</math>'


def symbol_mathml(symbol: str) -> str:
    """Return a coefficient's symbol, its index lowered: k1 as k with index 1."""
    head, tail = split_symbol(symbol)
    if not tail:
        return f"<mi>{escape(head)}</mi>"
    return f"<msub><mi>{escape(head)}</mi><mi>{escape(tail)}</mi></msub>"


def symbol_html(symbol: str) -> str:
    """Return a coefficient's symbol for a line of text: k1 as *k* with index 1."""
    head, tail = split_symbol(symbol)
    return f"<i>{escape(head)}</i>" + (f"<sub>{escape(tail)}</sub>" if tail else "")


def split_symbol(symbol: str) -> tuple[str, str]:
    """Return letter and index of a coefficient's symbol.

    Examples
    --------
    >>> split_symbol("k1"), split_symbol("M_F"), split_symbol("I")
    (('k', '1'), ('M', 'F'), ('I', ''))
    >>> split_symbol("mu_a")
    ('μ', 'a')
    """
    head, _, tail = symbol.partition("_")
    if not tail and len(head) > 1 and head[0].isalpha() and head[1:].isdigit():
        head, tail = head[0], head[1:]
    return GREEK.get(head, head), GREEK.get(tail, tail)


def _term(printer: _StatePrinter, term: ModelTerm) -> str:
    symbol = symbol_mathml(term.symbol)
    if term.expression.is_number and term.expression == 1:
        return symbol
    formula = printer.doprint(term.expression)
    for written, wanted in _BETTER.items():
        formula = formula.replace(written, wanted)
    if term.expression.is_Add or term.expression.could_extract_minus_sign():
        formula = f"<mrow><mo>(</mo>{formula}<mo>)</mo></mrow>"
    return f"{symbol}{THIN_SPACE}{formula}"
