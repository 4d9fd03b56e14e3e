"""Fast NumPy evaluation of many formulas at once, without generating code.

The expressions become one short program of array operations in which every repeated piece, powers and
partial products included, is worked out once. The program runs over blocks of rows that stay in the
processor's cache, and being plain data it can be pickled, shipped to other processes, or translated for a
simulator.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, reduce
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.errors import FormulaError, InputError
from sindyjoint.numeric import BLOCK, chunks

if TYPE_CHECKING:
    import sympy

FUNCTIONS: dict[str, np.ufunc] = {
    "abs": np.absolute,
    "sign": np.sign,
    "sqrt": np.sqrt,
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "tanh": np.tanh,
    "atan": np.arctan,
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "divide": np.divide,
    "power": np.power,
    "minimum": np.minimum,
    "maximum": np.maximum,
    "heaviside": np.heaviside,
}


@dataclass(frozen=True)
class TermFunction:
    """A compiled set of expressions, called with one array per argument.

    Registers are numbered: the arguments, then the constants, then the result of each operation in turn.

    Parameters
    ----------
    arguments : tuple of str
        Names of the arguments, in the order of the call.
    constants : tuple of float
    operations : tuple of (str, int, int)
        Name in :data:`FUNCTIONS`, register of the first operand, register of the second or -1.
    outputs : tuple of int
        Register of each expression.
    """

    arguments: tuple[str, ...]
    constants: tuple[float, ...]
    operations: tuple[tuple[str, int, int], ...]
    outputs: tuple[int, ...]

    def __call__(self, *values: ArrayLike) -> NDArray[np.float64]:
        """Evaluate every expression.

        Parameters
        ----------
        *values : array_like, shape (n,) or ()
            One per argument; scalars are held constant.

        Returns
        -------
        ndarray, shape (n, p)
            Fortran-ordered, a column per expression; NaN or infinity where a formula has no finite value.
        """
        if len(values) != len(self.arguments):
            raise InputError(
                f"{len(values)} arrays given; expected {len(self.arguments)} ({', '.join(self.arguments)})"
            )
        arrays = [np.asarray(value, dtype=np.float64) for value in values]
        sizes = {array.size for array in arrays if array.ndim}
        if any(array.ndim > 1 for array in arrays) or len(sizes) > 1:
            shapes = ", ".join(
                f"{name} {array.shape}" for name, array in zip(self.arguments, arrays, strict=True)
            )
            raise InputError(
                f"arrays of shape {shapes} given; expected one-dimensional arrays of equal length"
            )
        n = sizes.pop() if sizes else 1
        out = np.empty((n, len(self.outputs)), order="F")
        for rows in chunks(n, BLOCK):
            registers: list[Any] = [array[rows] if array.ndim else array[()] for array in arrays]
            registers += self.constants
            with np.errstate(all="ignore"):
                for name, one, other in self.operations:
                    operands = [registers[one]] if other < 0 else [registers[one], registers[other]]
                    registers.append(FUNCTIONS[name](*operands))
            for column, register in enumerate(self.outputs):
                out[rows, column] = registers[register]
        return out


def compile_terms(
    expressions: Sequence[sympy.Expr], arguments: Sequence[str] = ("theta", "omega", "alpha")
) -> TermFunction:
    """Compile expressions into one function of arrays.

    Parameters
    ----------
    expressions : sequence of sympy.Expr
        As :func:`sindyjoint.equation.formula.parse_formula` makes them.
    arguments : sequence of str
        Names of the variables, and of parameters that are to stay free, in the order of the call.

    Returns
    -------
    TermFunction
        ``f(*arrays) -> (n, p)`` array, one column per expression.

    Raises
    ------
    FormulaError
        If an expression holds a symbol that is no argument, or a function that formulas do not have.

    Examples
    --------
    >>> from sindyjoint.equation.formula import parse_formula
    >>> formulas = ["theta**2", "theta**2*sign(omega)"]
    >>> f = compile_terms([parse_formula(text) for text in formulas], ["theta", "omega"])
    >>> f([2.0, 3.0], [1.0, -1.0])
    array([[ 4.,  4.],
           [ 9., -9.]])
    """
    return _compiled(tuple(expressions), tuple(arguments))


@lru_cache(maxsize=256)
def _compiled(expressions: tuple[Any, ...], arguments: tuple[str, ...]) -> TermFunction:
    program = _Program(arguments)
    outputs = [program.register(expression) for expression in expressions]
    return program.finish(outputs)


Register = tuple[str, int]


class _Program:
    """Collects operations; asking for the same one twice gives the same register.

    A register is ("argument", i), ("constant", i) or ("operation", i) until :meth:`finish` numbers them.
    """

    def __init__(self, arguments: tuple[str, ...]):
        self.arguments = arguments
        self.known: dict[Any, Register] = {}
        self.constants: dict[float, Register] = {}
        self.operations: dict[tuple[str, Register, Register | None], Register] = {}

    def register(self, expression: Any) -> Register:
        """Return the register that will hold the expression."""
        register = self.known.get(expression)
        if register is None:
            register = self.known[expression] = self._translate(expression)
        return register

    def finish(self, outputs: list[Register]) -> TermFunction:
        """Give every register its number and return the finished program."""
        first = {"argument": 0, "constant": len(self.arguments)}
        first["operation"] = first["constant"] + len(self.constants)

        def number(register: Register | None) -> int:
            return -1 if register is None else first[register[0]] + register[1]

        operations = tuple((name, number(one), number(other)) for name, one, other in self.operations)
        return TermFunction(
            self.arguments, tuple(self.constants), operations, tuple(number(register) for register in outputs)
        )

    def _constant(self, value: float) -> Register:
        return self.constants.setdefault(value, ("constant", len(self.constants)))

    def _operation(self, name: str, one: Register, other: Register | None = None) -> Register:
        return self.operations.setdefault((name, one, other), ("operation", len(self.operations)))

    def _translate(self, expression: Any) -> Register:
        if expression.is_Symbol:
            if expression.name not in self.arguments:
                raise FormulaError(
                    f"the formula holds {expression.name}, which has no value; "
                    f"known are {', '.join(self.arguments)}"
                )
            return ("argument", self.arguments.index(expression.name))
        if expression.is_number:
            return self._constant(float(expression))
        if expression.is_Add:
            return self._sum(expression.args)
        if expression.is_Mul:
            return self._product(expression)
        if expression.is_Pow:
            return self._power(*expression.args)
        name = _NAMES.get(type(expression).__name__)
        if name is None:
            raise FormulaError(
                f"{expression} cannot be evaluated: {type(expression).__name__} is no allowed function"
            )
        if FUNCTIONS[name].nin == 2:
            return self._fold(name, [self.register(argument) for argument in expression.args])
        return self._operation(name, self.register(expression.args[0]))

    def _fold(self, name: str, registers: list[Register]) -> Register:
        return reduce(lambda result, register: self._operation(name, result, register), registers)

    def _sum(self, terms: Sequence[Any]) -> Register:
        negative = [term for term in terms if term.as_coeff_Mul()[0].is_negative]
        positive = [term for term in terms if term not in negative]
        result = (
            self._fold("add", [self.register(term) for term in positive]) if positive else self._constant(0.0)
        )
        for term in negative:
            result = self._operation("subtract", result, self.register(-term))
        return result

    def _product(self, expression: Any) -> Register:
        above, below = [], []
        for factor in expression.args:
            if factor.is_Pow and factor.exp.is_number and factor.exp.is_negative:
                below.append(self.register(1 / factor))
            else:
                above.append(self.register(factor))
        result = self._fold("multiply", above) if above else self._constant(1.0)
        return self._operation("divide", result, self._fold("multiply", below)) if below else result

    def _power(self, base: Any, exponent: Any) -> Register:
        if exponent.is_number and exponent.is_negative:
            return self._operation("divide", self._constant(1.0), self.register(base**-exponent))
        if exponent.is_Integer:
            # Squares and products: theta**5 is theta**4 * theta, and theta**4 is shared with its neighbours.
            n = int(exponent)
            if n % 2:
                return self._operation("multiply", self.register(base ** (n - 1)), self.register(base))
            half = self.register(base ** (n // 2))
            return self._operation("multiply", half, half)
        if exponent.is_Rational and exponent.p == 1 and exponent.q == 2:
            return self._operation("sqrt", self.register(base))
        return self._operation("power", self.register(base), self.register(exponent))


_NAMES = {
    "Abs": "abs",
    "exp": "exp",
    "sign": "sign",
    "log": "log",
    "sin": "sin",
    "cos": "cos",
    "tan": "tan",
    "tanh": "tanh",
    "atan": "atan",
    "Min": "minimum",
    "Max": "maximum",
    "Heaviside": "heaviside",
}
