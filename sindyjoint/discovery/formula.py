"""Formulas of candidate terms: text in, a sympy expression out, and nothing else reachable on the way.

The text is parsed into Python's syntax tree and rebuilt node by node from an allow-list; nothing is
evaluated. From the one expression come the NumPy function (:func:`compile_terms`), the unit check
(:func:`formula_unit`), the LaTeX and the plain text of reports, and the code of exports.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from sindyjoint.discovery.dimensions import formula_unit
from sindyjoint.discovery.evaluation import TermFunction, compile_terms
from sindyjoint.errors import FormulaError

if TYPE_CHECKING:
    import sympy

__all__ = [
    "FUNCTIONS",
    "VARIABLES",
    "TermFunction",
    "compile_terms",
    "formula_latex",
    "formula_pretty",
    "formula_text",
    "formula_unit",
    "parameter_symbol",
    "parse_formula",
    "variable_symbols",
]

VARIABLES = ("theta", "omega", "alpha")
"""Angle, rate and acceleration, in this order everywhere."""

ALIASES = {"x": "theta", "v": "omega", "a": "alpha"}
"""The names a translational joint uses for the same three."""

FUNCTIONS = (
    "abs",
    "sign",
    "sqrt",
    "exp",
    "log",
    "sin",
    "cos",
    "tan",
    "tanh",
    "atan",
    "min",
    "max",
    "heaviside",
)

# A term of a joint's law is a line of text. These bounds leave ten times what such a line needs and keep
# hostile text (towers of powers, thousands of brackets) from costing time or memory.
MAXIMUM_LENGTH = 400
MAXIMUM_NODES = 120
MAXIMUM_DEPTH = 24
MAXIMUM_POWER = 12
MAXIMUM_NUMBER = 1e30

_CHARACTERS = re.compile(r"[A-Za-z0-9_+\-*/().,\s]*", re.ASCII)
_CHARACTER_HINTS = {
    "^": "powers are written **",
    "[": "indexing",
    "'": "a text",
    '"': "a text",
    ":": "a lambda or an assignment",
    "<": "a comparison; heaviside, min and max switch",
    ">": "a comparison; heaviside, min and max switch",
    "=": "a comparison or an assignment",
    "·": "products are written *",
}
_RESERVED = frozenset((*VARIABLES, *ALIASES, *FUNCTIONS, "pi"))


def variable_symbols() -> tuple[sympy.Symbol, sympy.Symbol, sympy.Symbol]:
    """Return the sympy symbols of angle, rate and acceleration (all real)."""
    from sympy import Symbol

    theta, omega, alpha = (Symbol(name, real=True) for name in VARIABLES)
    return theta, omega, alpha


def parameter_symbol(name: str) -> sympy.Symbol:
    """Return the sympy symbol of an inner parameter.

    Raises
    ------
    FormulaError
        If the name is not a plain identifier or already means something in a formula.
    """
    from sympy import Symbol

    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,31}", str(name), re.ASCII):
        raise FormulaError(f"parameter name {name!r}: a letter followed by letters, digits or _ is wanted")
    if name in _RESERVED:
        raise FormulaError(
            f"parameter name {name!r} already means something in a formula; choose another name"
        )
    return Symbol(name, real=True)


def parse_formula(text: str, parameters: Sequence[str] = ()) -> sympy.Expr:
    """Turn the text of a formula into a sympy expression.

    Parameters
    ----------
    text : str
        Python syntax over the angle ``theta``, the rate ``omega``, the acceleration ``alpha`` (for
        translation ``x``, ``v``, ``a``), the named parameters, numbers, ``pi``, ``+ - * / **`` and
        :data:`FUNCTIONS`.
        ``sign(0)`` is 0 and ``heaviside(0)`` is 1/2.
    parameters : sequence of str
        Names of inner parameters that the formula may use.

    Returns
    -------
    sympy.Expr
        Over the symbols of :func:`variable_symbols` and :func:`parameter_symbol`.

    Raises
    ------
    FormulaError
        For anything outside the allow-list, and for formulas that are too long, too deep, not finite or not
        real.

    Examples
    --------
    >>> parse_formula("exp(-abs(omega)/v_s)*sign(omega)", ["v_s"])
    exp(-Abs(omega)/v_s)*sign(omega)
    >>> parse_formula("__import__('os')")
    Traceback (most recent call last):
    ...
    sindyjoint.errors.FormulaError: formula "__import__('os')": the character "'" (a text) is not allowed; ...
    """
    names = {name: symbol for name, symbol in zip(VARIABLES, variable_symbols(), strict=True)}
    names.update({alias: names[name] for alias, name in ALIASES.items()})
    names.update({name: parameter_symbol(name) for name in parameters})
    if not isinstance(text, str):
        raise FormulaError(f"formula {text!r} is a {type(text).__name__}; a text is wanted")
    builder = _Builder(text, names, tuple(parameters))
    try:
        return builder.build()
    except RecursionError:
        raise builder.refusal("it is nested too deeply") from None


@lru_cache(maxsize=1)
def _sympy_functions() -> dict[str, Callable[..., Any]]:
    import sympy

    return {
        "abs": sympy.Abs,
        "sign": sympy.sign,
        "sqrt": sympy.sqrt,
        "exp": sympy.exp,
        "log": sympy.log,
        "sin": sympy.sin,
        "cos": sympy.cos,
        "tan": sympy.tan,
        "tanh": sympy.tanh,
        "atan": sympy.atan,
        "min": sympy.Min,
        "max": sympy.Max,
        "heaviside": sympy.Heaviside,
    }


# Functions of constants are worked out in floating point: sympy would keep towers of exp, or evaluate them
# exactly.
_OF_NUMBERS: dict[str, Callable[..., float]] = {
    "abs": abs,
    "sign": lambda x: float((x > 0) - (x < 0)),
    "min": min,
    "max": max,
    "heaviside": lambda x: 0.5 * (1 + (x > 0) - (x < 0)),
    **{name: getattr(math, name) for name in ("sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "atan")},
}


def _shown(text: str, limit: int = 90) -> str:
    """Return the text on one line, quoted, cut to a readable length."""
    shown = repr(text)
    return shown if len(shown) <= limit else f"{shown[: limit - 4]}...{shown[0]}"


class _Builder:
    """One formula on its way from syntax tree to expression."""

    def __init__(self, text: str, names: dict[str, Any], parameters: tuple[str, ...]):
        self.text = text
        self.names = names
        self.parameters = parameters
        self.nodes = 0

    def refusal(self, why: str) -> FormulaError:
        parameters = f", the parameters {', '.join(self.parameters)}" if self.parameters else ""
        return FormulaError(
            f"formula {_shown(self.text)}: {why}; allowed are numbers, pi, theta, omega, alpha "
            f"(or x, v, a){parameters}, + - * / ** ( ) and the functions {', '.join(FUNCTIONS)}"
        )

    def build(self) -> Any:
        import sympy

        expression = self._node(self._tree(), 0)
        if expression.has(sympy.I, sympy.nan, sympy.oo, sympy.zoo) or expression.is_real is False:
            raise self.refusal("it has no real, finite value")
        for power in expression.atoms(sympy.Pow):
            if power.exp.is_number and abs(power.exp) > MAXIMUM_POWER:
                raise self.refusal(f"its power {power} is beyond {MAXIMUM_POWER}")
        return expression

    def _tree(self) -> ast.expr:
        text = self.text.strip()
        if not text:
            raise self.refusal("it is empty")
        if len(text) > MAXIMUM_LENGTH:
            raise self.refusal(f"it has {len(text)} characters, more than {MAXIMUM_LENGTH}")
        allowed = _CHARACTERS.match(text)
        assert allowed is not None
        if allowed.end() < len(text):
            character = text[allowed.end()]
            hint = _CHARACTER_HINTS.get(character, "")
            raise self.refusal(f"the character {character!r}{hint and f' ({hint})'} is not allowed")
        try:
            with warnings.catch_warnings():
                # Python warns of text such as "1if"; here that is simply a syntax error.
                warnings.simplefilter("error")
                return ast.parse(" ".join(text.split()), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError, Warning) as error:
            detail = getattr(error, "msg", None) or "not an expression"
            where = f" at character {error.offset}" if isinstance(error, SyntaxError) and error.offset else ""
            raise self.refusal(f"it is not an expression ({detail}{where})") from None

    def _piece(self, node: ast.AST) -> str:
        return _shown(ast.unparse(node), 40)

    def _node(self, node: ast.AST, depth: int) -> Any:
        self.nodes += 1
        if depth > MAXIMUM_DEPTH:
            raise self.refusal(f"it is nested deeper than {MAXIMUM_DEPTH} levels")
        if self.nodes > MAXIMUM_NODES:
            raise self.refusal(f"it has more than {MAXIMUM_NODES} parts")
        match node:
            case ast.Constant():
                return self._number(node.value)
            case ast.Name():
                return self._name(node.id)
            case ast.UnaryOp(op=ast.UAdd() | ast.USub()):
                value = self._node(node.operand, depth + 1)
                return -value if isinstance(node.op, ast.USub) else value
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow()):
                left, right = self._node(node.left, depth + 1), self._node(node.right, depth + 1)
                return self._checked(self._operate(node, left, right), node)
            case ast.Call():
                return self._call(node, depth)
        raise self.refusal(f"{self._piece(node)} ({_what(node)}) is not allowed")

    def _number(self, value: object) -> Any:
        import sympy

        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.refusal(f"{value!r} is not a real number")
        if not abs(value) <= MAXIMUM_NUMBER:
            raise self.refusal(f"a number in it is beyond {MAXIMUM_NUMBER:g}")
        return sympy.Integer(value) if isinstance(value, int) else _float(value)

    def _name(self, name: str) -> Any:
        import sympy

        if name == "pi":
            return sympy.pi
        if name in self.names:
            return self.names[name]
        if name in FUNCTIONS:
            raise self.refusal(f"the function {name} stands without its argument")
        close = get_close_matches(name, [*self.names, *FUNCTIONS], n=1)
        hint = f" (did you mean {close[0]}?)" if close else ""
        raise self.refusal(f"the name {_shown(name, 40)} is unknown{hint}")

    def _call(self, node: ast.Call, depth: int) -> Any:
        if not isinstance(node.func, ast.Name) or node.func.id not in FUNCTIONS:
            called = ast.unparse(node.func)
            close = get_close_matches(called, FUNCTIONS, n=1)
            hint = f" (did you mean {close[0]}?)" if close else ""
            raise self.refusal(f"a call of {_shown(called, 40)} is not allowed{hint}")
        name = node.func.id
        if node.keywords:
            raise self.refusal(f"{self._piece(node)} has a named argument")
        count = len(node.args)
        if name in ("min", "max"):
            if not 2 <= count <= 4:
                raise self.refusal(f"{name} takes two to four arguments, {count} given")
        elif count != 1:
            raise self.refusal(f"{name} takes one argument, {count} given")
        values = [self._node(argument, depth + 1) for argument in node.args]
        if all(value.is_number for value in values):
            try:
                return self._number(float(_OF_NUMBERS[name](*map(float, values))))
            except (ValueError, OverflowError):
                raise self.refusal(f"{self._piece(node)} has no finite value") from None
        return self._checked(_sympy_functions()[name](*values), node)

    def _operate(self, node: ast.BinOp, left: Any, right: Any) -> Any:
        match node.op:
            case ast.Add():
                return left + right
            case ast.Sub():
                return left - right
            case ast.Mult():
                return left * right
            case ast.Div():
                if right.is_zero:
                    raise self.refusal(f"{self._piece(node)} divides by zero")
                return left / right
        return self._power(node, left, right)

    def _power(self, node: ast.BinOp, base: Any, exponent: Any) -> Any:
        piece = self._piece(node)
        if not {symbol.name for symbol in exponent.free_symbols} <= set(self.parameters):
            raise self.refusal(f"the exponent of {piece} is not a number")
        if exponent.is_number:
            if abs(float(exponent)) > MAXIMUM_POWER:
                raise self.refusal(f"the exponent of {piece} is beyond {MAXIMUM_POWER}")
            if base.is_zero and exponent.is_negative:
                raise self.refusal(f"{piece} divides by zero")
            # theta**2.0 and theta**0.5 are the exact powers they look like.
            if exponent.is_Float and float(2 * exponent).is_integer():
                from sympy import Rational

                exponent = Rational(int(2 * exponent), 2)
            if base.is_number and not base.is_zero:
                if abs(float(exponent) * math.log10(abs(float(base)))) > math.log10(MAXIMUM_NUMBER):
                    raise self.refusal(f"{piece} is beyond {MAXIMUM_NUMBER:g}")
        return base**exponent

    def _checked(self, value: Any, node: ast.AST) -> Any:
        """Return the value; refuse constants that are not real, finite and of a sane size."""
        if value.is_number:
            if not value.is_real:
                raise self.refusal(f"{self._piece(node)} has no real, finite value")
            if not abs(float(value)) <= MAXIMUM_NUMBER:
                raise self.refusal(f"{self._piece(node)} is beyond {MAXIMUM_NUMBER:g}")
        return value


def _float(value: float) -> Any:
    import sympy

    return sympy.Integer(int(value)) if value.is_integer() and abs(value) < 1e15 else sympy.Float(value, 17)


def _what(node: ast.AST) -> str:
    """Name a refused piece of syntax as a person would."""
    names = {
        ast.Attribute: "attribute access",
        ast.Subscript: "indexing",
        ast.Lambda: "a lambda",
        ast.Compare: "a comparison",
        ast.BoolOp: "a logical operation",
        ast.IfExp: "a condition",
        ast.Tuple: "a list of values",
        ast.NamedExpr: "an assignment",
        ast.Await: "an await",
        ast.GeneratorExp: "a comprehension",
        ast.Starred: "an unpacking",
        ast.BinOp: "this operation",
        ast.UnaryOp: "this operation",
    }
    return names.get(type(node), type(node).__name__)


def formula_text(expression: sympy.Expr, motion: str = "rotation") -> str:
    """Return a formula that :func:`parse_formula` reads back as the same expression, numbers in full.

    For translation it is written with x, v, a.

    Examples
    --------
    >>> formula_text(parse_formula("max(abs(theta) - 0.1, 0)*sign(theta)"))
    'sign(theta)*max(0, abs(theta) - 0.1)'
    """
    from sindyjoint.discovery.rendering import text_line

    return text_line(expression, motion)


def formula_pretty(expression: sympy.Expr, motion: str = "rotation") -> str:
    """Return the expression as a line to read: θ² θ̇, or x² ẋ for translation.

    Examples
    --------
    >>> formula_pretty(parse_formula("theta**2*omega"))
    'θ² θ̇'
    """
    from sindyjoint.discovery.rendering import pretty_line

    return pretty_line(expression, motion)


def formula_latex(expression: sympy.Expr, motion: str = "rotation") -> str:
    r"""Return the expression as LaTeX, with \theta, \dot{\theta}, \ddot{\theta} or x, \dot{x}, \ddot{x}.

    Examples
    --------
    >>> formula_latex(parse_formula("sign(omega)"))
    '\\operatorname{sign}{\\left(\\dot{\\theta} \\right)}'
    """
    from sindyjoint.discovery.rendering import latex_line

    return latex_line(expression, motion)
