"""From the text of a formula to a sympy expression, node by node from an allow-list.

Every part must be real and finite for every motion before it becomes part of something larger. That keeps
useless terms out, and it keeps sympy quick: on expressions that may be complex it can take minutes.
"""

from __future__ import annotations

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from functools import cache
from typing import TYPE_CHECKING, Any

from sindyjoint.errors import FormulaError

if TYPE_CHECKING:
    import sympy

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
"""Names of the functions that a formula may call."""

VARIABLES = ("theta", "omega", "alpha")
"""Angle, rate and acceleration, in this order everywhere."""

ALIASES = {"x": "theta", "v": "omega", "a": "alpha"}
"""The names a translational joint uses for the same three."""

# A term of a joint's law is a line of text. These bounds leave several times what such a line needs and keep
# hostile text (towers of powers, thousands of brackets) from costing time or memory.
MOST = {
    "characters": 400,
    "parts": 80,
    "levels": 20,
    # Functions of functions; shipped terms have three. Every further level takes sympy four times as long to print.
    "calls": 5,
    "arguments": 4,  # of min and max
    "power": 12,
    "number": int(1e30),
}

_OTHER_CHARACTER = re.compile(r"[^A-Za-z0-9_+\-*/().,\s]", re.ASCII)
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
_SYNTAX = {
    ast.Attribute: "attribute access",
    ast.Lambda: "a lambda",
    ast.Compare: "a comparison",
    ast.BoolOp: "a logical operation",
    ast.IfExp: "a condition",
    ast.Tuple: "a list of values",
    ast.GeneratorExp: "a comprehension",
    ast.Starred: "an unpacking",
    ast.BinOp: "this operation",
    ast.UnaryOp: "this operation",
}


_OPERATORS: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}


def build_expression(text: str, names: Mapping[str, Any], positive: tuple[str, ...]) -> Any:
    """Build the expression of a formula; see :func:`sindyjoint.equation.formula.parse_formula`.

    Parameters
    ----------
    text : str
    names : mapping of str to sympy.Symbol
        Every name that the formula may use, functions and pi aside.
    positive : tuple of str
        Those among them, parameters, that stand for positive numbers and may be exponents.
    """
    if not isinstance(text, str):
        raise FormulaError(f"formula {text!r} is a {type(text).__name__}; expected a text")
    builder = _Builder(text, names, positive)
    try:
        return builder.build()
    except FormulaError:
        raise
    except (RecursionError, ValueError, TypeError, ArithmeticError) as error:
        # Refusals of sympy: it found a part that has no real value.
        raise builder.refusal(f"it cannot be worked out ({error})") from None


@cache
def _sympy_functions() -> dict[str, Callable[..., Any]]:
    import sympy

    functions = {
        name: getattr(sympy, name) for name in FUNCTIONS if name not in ("abs", "min", "max", "heaviside")
    }
    # Unevaluated: sympy would compare every pair of arguments.
    functions["min"] = lambda *values: sympy.Min(*values, evaluate=False)
    functions["max"] = lambda *values: sympy.Max(*values, evaluate=False)
    return functions | {"abs": sympy.Abs, "heaviside": sympy.Heaviside}


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


def shown(text: str, limit: int = 90) -> str:
    """Return a text on one line, quoted, cut to a readable length."""
    quoted = repr(text)
    return quoted if len(quoted) <= limit else f"{quoted[: limit - 4]}...{quoted[0]}"


class _Builder:
    """One formula on its way from syntax tree to expression."""

    def __init__(self, text: str, names: Mapping[str, Any], positive: tuple[str, ...]):
        self.text = text
        self.names = names
        self.positive = positive
        self.nodes = 0
        self.calls = 0

    def check(self, allowed: object, why: str) -> None:
        """Refuse the formula where something of it is not allowed."""
        if not allowed:
            raise self.refusal(why)

    def refusal(self, why: str) -> FormulaError:
        extra = [name for name in self.names if name not in ("theta", "omega", "alpha", "x", "v", "a")]
        return FormulaError(
            f"formula {shown(self.text)}: {why}; allowed are numbers, pi, theta, omega, alpha (or x, v, a)"
            f"{', ' if extra else ''}{', '.join(extra)}, + - * / ** ( ) and the functions {', '.join(FUNCTIONS)}"
        )

    def build(self) -> Any:
        import sympy

        # doit settles the min and max that were kept as written; what it cannot settle has no finite value.
        expression = self._node(self._tree(), 0).doit()
        infinite = expression.has(sympy.I, sympy.nan, sympy.oo, sympy.zoo)
        self.check(not infinite, "it has no real, finite value")
        for part in sympy.postorder_traversal(expression):
            self._check_size(float(part) if part.is_number else 0.0)
            if part.is_Pow and part.exp.is_number and abs(float(part.exp)) > MOST["power"]:
                raise self.refusal(f"its power {part} is beyond {MOST['power']}")
        return expression

    def _check_size(self, value: float) -> None:
        self.check(abs(value) <= MOST["number"], f"a number in it is beyond {MOST['number']:g}")

    def _tree(self) -> ast.expr:
        text = self.text.strip()
        self.check(text, "it is empty")
        within = len(text) <= MOST["characters"]
        self.check(within, f"it has {len(text)} characters, more than {MOST['characters']}")
        if other := _OTHER_CHARACTER.search(text):
            hint = _CHARACTER_HINTS.get(other[0], "")
            raise self.refusal(f"the character {other[0]!r}{hint and f' ({hint})'} is not allowed")
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
        return shown(ast.unparse(node), 40)

    def _node(self, node: ast.AST, depth: int) -> Any:
        self.nodes += 1
        self.check(depth <= MOST["levels"], f"it is nested deeper than {MOST['levels']} levels")
        self.check(self.nodes <= MOST["parts"], f"it has more than {MOST['parts']} parts")
        match node:
            case ast.Constant():
                return self._number(node.value)
            case ast.Name():
                return self._name(node.id)
            case ast.UnaryOp(op=ast.UAdd() | ast.USub()):
                operand = self._node(node.operand, depth + 1)
                return -operand if isinstance(node.op, ast.USub) else operand
            case ast.BinOp() if type(node.op) in _OPERATORS or isinstance(node.op, ast.Pow):
                left, right = self._node(node.left, depth + 1), self._node(node.right, depth + 1)
                known = _OPERATORS.get(type(node.op))
                value = self._power(node, left, right) if known is None else known(left, right)
                return self._check_result(node, value)
            case ast.Call():
                return self._call(node, depth)
        kind = _SYNTAX.get(type(node), type(node).__name__)
        raise self.refusal(f"{self._piece(node)} ({kind}) is not allowed")

    def _number(self, value: object) -> Any:
        import sympy

        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.refusal(f"{value!r} is not a real number")
        self._check_size(value)
        whole = isinstance(value, int) or (value.is_integer() and abs(value) < 1e15)
        return sympy.Integer(int(value)) if whole else sympy.Float(value, 17)

    def _name(self, name: str) -> Any:
        import sympy

        if name == "pi":
            return sympy.pi
        if name in self.names:
            return self.names[name]
        self.check(name not in FUNCTIONS, f"the function {name} stands without its argument")
        raise self.refusal(f"the name {shown(name, 40)} is unknown{_hint(name, [*self.names, *FUNCTIONS])}")

    def _call(self, node: ast.Call, depth: int) -> Any:
        if not isinstance(node.func, ast.Name) or node.func.id not in FUNCTIONS:
            called = ast.unparse(node.func)
            raise self.refusal(
                f"a call of {shown(called, 40)} is not allowed{_hint(called, list(FUNCTIONS))}"
            )
        name = node.func.id
        if node.keywords:
            raise self.refusal(f"{self._piece(node)} (an unpacking) is not allowed")
        count = len(node.args)
        several = name in ("min", "max")
        takes = f"two to {MOST['arguments']} arguments" if several else "one argument"
        fits = 2 <= count <= MOST["arguments"] if several else count == 1
        self.check(fits, f"{name} takes {takes}, {count} given")
        self.calls += 1
        self.check(
            self.calls <= MOST["calls"], f"its functions are nested deeper than {MOST['calls']} levels"
        )
        values = [self._node(argument, depth + 1) for argument in node.args]
        self.calls -= 1
        if all(value.is_number for value in values):
            try:
                return self._number(float(_OF_NUMBERS[name](*map(float, values))))
            except (ValueError, OverflowError):
                raise self.refusal(f"{self._piece(node)} has no finite value") from None
        return self._check_result(node, _sympy_functions()[name](*values))

    def _power(self, node: ast.BinOp, base: Any, exponent: Any) -> Any:
        import sympy

        piece = self._piece(node)
        known = {symbol.name for symbol in exponent.free_symbols} <= set(self.positive)
        self.check(known, f"the exponent of {piece} is not a number")
        if exponent.is_number:
            value = float(exponent)
            self.check(abs(value) <= MOST["power"], f"the exponent of {piece} is beyond {MOST['power']}")
            digits = abs(value * math.log10(abs(float(base)))) if base.is_number and base != 0 else 0.0
            self.check(digits <= math.log10(MOST["number"]), f"{piece} is beyond {MOST['number']:g}")
            # theta**2.0 and abs(theta)**0.5 are the exact powers they look like.
            if exponent.is_Float and (2 * value).is_integer():
                exponent = sympy.Rational(int(2 * value), 2)
        return base**exponent

    def _check_result(self, node: ast.AST, value: Any) -> Any:
        """Return the value; refuse what may be infinite or complex, and constants beyond a sane size."""
        if not value.is_extended_real:
            raise self.refusal(
                f"{self._piece(node)} is not real and finite for every motion; divide by, and take roots and "
                "logarithms of, what cannot be zero or negative, such as 1 + abs(...)"
            )
        if value.is_number and not abs(float(value)) <= MOST["number"]:
            raise self.refusal(f"{self._piece(node)} is beyond {MOST['number']:g}")
        return value


def _hint(word: str, known: list[str]) -> str:
    close = get_close_matches(word, known, n=1)
    return f" (did you mean {close[0]}?)" if close else ""


def variable_symbols() -> tuple[sympy.Symbol, sympy.Symbol, sympy.Symbol]:
    """Return the sympy symbols of angle, rate and acceleration (all real)."""
    from sympy import Symbol

    theta, omega, alpha = (Symbol(name, real=True) for name in VARIABLES)
    return theta, omega, alpha


def parameter_symbol(name: str) -> sympy.Symbol:
    """Return the sympy symbol of a nonlinear parameter, a positive number.

    Raises
    ------
    FormulaError
        If the name is not a plain identifier or already means something in a formula.
    """
    from sympy import Symbol

    return Symbol(_checked_name(name), positive=True)


def state_symbol(name: str) -> sympy.Symbol:
    """Return the sympy symbol of a further variable, of either sign; raises as :func:`parameter_symbol`."""
    from sympy import Symbol

    return Symbol(_checked_name(name), real=True)


def _checked_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,31}", str(name), re.ASCII):
        raise FormulaError(f"parameter name {name!r}: expected a letter followed by letters, digits or _")
    if name in (*VARIABLES, *ALIASES, *FUNCTIONS, "pi"):
        raise FormulaError(f"parameter name {name!r} already means something in a formula; take another name")
    return name
