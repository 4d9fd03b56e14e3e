"""From the text of a formula to a sympy expression, node by node from an allow-list.

sympy decides on the way whether parts are real or positive, and on expressions that may be complex it can
take minutes. So this module keeps its own account of bounds, takes roots and logarithms only of what cannot be
negative, and works out constants in floating point: what reaches sympy is real and small.
"""

from __future__ import annotations

import ast
import math
import re
import warnings
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from functools import cache
from typing import Any, NamedTuple

from sindyjoint.discovery import intervals
from sindyjoint.errors import FormulaError

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

# A term of a joint's law is a line of text. These bounds leave several times what such a line needs and keep
# hostile text (towers of powers, thousands of brackets) from costing time or memory.
MAXIMUM_LENGTH = 400
MAXIMUM_NODES = 80
MAXIMUM_DEPTH = 20
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


class _Value(NamedTuple):
    """An expression and the bounds of its value."""

    expression: Any
    bounds: intervals.Interval


def build_expression(text: str, names: Mapping[str, Any], positive: tuple[str, ...]) -> Any:
    """Build the expression of a formula; see :func:`sindyjoint.discovery.formula.parse_formula`.

    Parameters
    ----------
    text : str
    names : mapping of str to sympy.Symbol
        Every name that the formula may use, functions and pi aside.
    positive : tuple of str
        Those among them, parameters, that stand for positive numbers and may be exponents.
    """
    if not isinstance(text, str):
        raise FormulaError(f"formula {text!r} is a {type(text).__name__}; a text is wanted")
    builder = _Builder(text, names, positive)
    try:
        return builder.build()
    except FormulaError:
        raise
    except (RecursionError, ValueError, TypeError, ArithmeticError) as error:
        # sympy's own refusals: it found a part that has no real value.
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


_OF_NUMBERS: dict[str, Callable[..., float]] = {
    "abs": abs,
    "sign": intervals.sign,
    "min": min,
    "max": max,
    "heaviside": intervals.heaviside,
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

    def refusal(self, why: str) -> FormulaError:
        own = [name for name in self.names if name not in ("theta", "omega", "alpha", "x", "v", "a")]
        return FormulaError(
            f"formula {shown(self.text)}: {why}; allowed are numbers, pi, theta, omega, alpha (or x, v, a)"
            f"{', ' if own else ''}{', '.join(own)}, + - * / ** ( ) and the functions {', '.join(FUNCTIONS)}"
        )

    def build(self) -> Any:
        import sympy

        # doit settles the min and max that were kept as written; what it cannot settle has no finite value.
        expression = self._node(self._tree(), 0).expression.doit()
        if expression.has(sympy.I, sympy.nan, sympy.oo, sympy.zoo):
            raise self.refusal("it has no real, finite value")
        for power in expression.atoms(sympy.Pow):
            if power.exp.is_number and abs(float(power.exp)) > MAXIMUM_POWER:
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
        return shown(ast.unparse(node), 40)

    def _node(self, node: ast.AST, depth: int) -> _Value:
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
            case ast.UnaryOp(op=ast.UAdd()):
                return self._node(node.operand, depth + 1)
            case ast.UnaryOp(op=ast.USub()):
                operand = self._node(node.operand, depth + 1)
                return self._checked(node, -operand.expression, intervals.negate(operand.bounds))
            case ast.BinOp(op=ast.Add() | ast.Sub() | ast.Mult() | ast.Div() | ast.Pow()):
                left, right = self._node(node.left, depth + 1), self._node(node.right, depth + 1)
                return (
                    self._power(node, left, right)
                    if isinstance(node.op, ast.Pow)
                    else self._sum(node, left, right)
                )
            case ast.Call():
                return self._call(node, depth)
        raise self.refusal(
            f"{self._piece(node)} ({_SYNTAX.get(type(node), type(node).__name__)}) is not allowed"
        )

    def _number(self, value: object) -> _Value:
        import sympy

        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.refusal(f"{value!r} is not a real number")
        if not abs(value) <= MAXIMUM_NUMBER:
            raise self.refusal(f"a number in it is beyond {MAXIMUM_NUMBER:g}")
        whole = isinstance(value, int) or (value.is_integer() and abs(value) < 1e15)
        number = sympy.Integer(int(value)) if whole else sympy.Float(value, 17)
        return _Value(number, (float(value), float(value)))

    def _name(self, name: str) -> _Value:
        import sympy

        if name == "pi":
            return _Value(sympy.pi, (math.pi, math.pi))
        if name in self.names:
            return _Value(
                self.names[name], intervals.POSITIVE if name in self.positive else intervals.EVERYTHING
            )
        if name in FUNCTIONS:
            raise self.refusal(f"the function {name} stands without its argument")
        raise self.refusal(f"the name {shown(name, 40)} is unknown{_hint(name, [*self.names, *FUNCTIONS])}")

    def _call(self, node: ast.Call, depth: int) -> _Value:
        if not isinstance(node.func, ast.Name) or node.func.id not in FUNCTIONS:
            called = ast.unparse(node.func)
            raise self.refusal(
                f"a call of {shown(called, 40)} is not allowed{_hint(called, list(FUNCTIONS))}"
            )
        name = node.func.id
        count = len(node.args)
        if name in ("min", "max"):
            if not 2 <= count <= 4:
                raise self.refusal(f"{name} takes two to four arguments, {count} given")
        elif count != 1:
            raise self.refusal(f"{name} takes one argument, {count} given")
        values = [self._node(argument, depth + 1) for argument in node.args]
        expressions = [value.expression for value in values]
        if all(expression.is_number for expression in expressions):
            try:
                return self._number(float(_OF_NUMBERS[name](*map(float, expressions))))
            except (ValueError, OverflowError):
                raise self.refusal(f"{self._piece(node)} has no finite value") from None
        if name == "log" and values[0].bounds[0] <= 0:
            raise self.refusal(
                f"the argument of {self._piece(node)} can be zero or negative; log(1 + abs(...)) cannot"
            )
        if name == "sqrt" and values[0].bounds[0] < 0:
            raise self.refusal(f"the argument of {self._piece(node)} can be negative; sqrt(abs(...)) cannot")
        bounds = intervals.of_function(name, [value.bounds for value in values])
        return self._checked(node, _sympy_functions()[name](*expressions), bounds)

    def _sum(self, node: ast.BinOp, left: _Value, right: _Value) -> _Value:
        one, other = left.expression, right.expression
        match node.op:
            case ast.Add():
                return self._checked(node, one + other, intervals.add(left.bounds, right.bounds))
            case ast.Sub():
                return self._checked(
                    node, one - other, intervals.add(left.bounds, intervals.negate(right.bounds))
                )
            case ast.Mult():
                square = one == other
                bounds = (
                    intervals.power(left.bounds, 2)
                    if square
                    else intervals.multiply(left.bounds, right.bounds)
                )
                return self._checked(node, one * other, bounds)
        if other == 0:
            raise self.refusal(f"{self._piece(node)} divides by zero")
        return self._checked(node, one / other, intervals.divide(left.bounds, right.bounds))

    def _power(self, node: ast.BinOp, left: _Value, right: _Value) -> _Value:
        import sympy

        base, exponent = left.expression, right.expression
        piece = self._piece(node)
        if not {symbol.name for symbol in exponent.free_symbols} <= set(self.positive):
            raise self.refusal(f"the exponent of {piece} is not a number")
        value = None
        if exponent.is_number:
            value = float(exponent)
            if abs(value) > MAXIMUM_POWER:
                raise self.refusal(f"the exponent of {piece} is beyond {MAXIMUM_POWER}")
            if base == 0 and value < 0:
                raise self.refusal(f"{piece} divides by zero")
            if (
                base.is_number
                and base != 0
                and abs(value * math.log10(abs(float(base)))) > math.log10(MAXIMUM_NUMBER)
            ):
                raise self.refusal(f"{piece} is beyond {MAXIMUM_NUMBER:g}")
            # theta**2.0 and abs(theta)**0.5 are the exact powers they look like.
            if exponent.is_Float and (2 * value).is_integer():
                exponent = sympy.Rational(int(2 * value), 2)
        if not (value is not None and value.is_integer()) and left.bounds[0] < 0:
            raise self.refusal(f"the base of {piece} can be negative; a power of abs(...) is real")
        return self._checked(node, base**exponent, intervals.power(left.bounds, value))

    def _checked(self, node: ast.AST, expression: Any, bounds: intervals.Interval) -> _Value:
        """Return the value; refuse constants that are not of a sane size."""
        if expression.is_number:
            value = float(expression)
            if not abs(value) <= MAXIMUM_NUMBER:
                raise self.refusal(f"{self._piece(node)} is beyond {MAXIMUM_NUMBER:g}")
            bounds = (value, value)
        return _Value(expression, bounds)


def _hint(word: str, known: list[str]) -> str:
    close = get_close_matches(word, known, n=1)
    return f" (did you mean {close[0]}?)" if close else ""
