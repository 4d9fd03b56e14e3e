"""Candidate terms: a formula, the unit and meaning of its coefficient, the nonlinear parameters it may have."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.equation import formula
from sindyjoint.errors import InputError
from sindyjoint.plain import Identifier, Line, same

if TYPE_CHECKING:
    import sympy

    from sindyjoint.record import Motion

Scale = Literal["angle", "rate", "moment"]


@dataclass(frozen=True)
class Reference:
    """The scales of a set of data that nonlinear parameters may refer to.

    Parameters
    ----------
    angle, rate, moment : float, optional
        Largest absolute angle (rad), rate (rad/s) and moment (N·m); m, m/s and N for translation.
    inputs : tuple of (str, float)
        Reference value of each declared input, SI.
    swing : float, optional
        Half of the range of an angle that is counted from far off its middle.
    """

    angle: float | None = None
    rate: float | None = None
    moment: float | None = None
    inputs: tuple[tuple[str, float], ...] = field(default=(), kw_only=True)
    swing: float | None = field(default=None, kw_only=True)

    @classmethod
    def of(
        cls,
        angle: ArrayLike,
        rate: ArrayLike,
        moment: ArrayLike | None = None,
        inputs: Iterable[tuple[str, float]] = (),
    ) -> Reference:
        """Take the scales from signals, each array_like of any shape; ``inputs`` are reference values by name."""
        largest = [
            None if each is None else float(max(np.max(each), -np.min(each)))
            for each in (angle, rate, moment)
        ]
        return cls(*largest, inputs=tuple(inputs))


@dataclass(frozen=True)
class Parameter:
    """A nonlinear parameter of a term, one that the moment does not depend on linearly.

    Parameters
    ----------
    name : str
    unit : str
        SI unit for a rotational joint.
    value : float
        In that unit; with ``relative_to``, a multiple of that scale of the data.
    relative_to : {"angle", "rate", "moment"}, optional
    lower, upper : float, optional
        Bounds, meant like the value.
    open : {"lower", "upper"}, optional
        End of the range that is a limiting form, and may be reached.
    special : {"lower", "upper"}, optional
        End of the range at which an effect becomes one that it contains.
    """

    name: Line
    unit: Line
    value: float
    relative_to: Scale | None = None
    lower: float | None = None
    upper: float | None = None
    open: Literal["lower", "upper"] | None = None
    special: Literal["lower", "upper"] | None = None

    def unit_for(self, motion: Motion) -> str:
        """Return the unit for rotation or translation."""
        return self.unit if motion == "rotation" else formula.unit_for(self.unit, motion)

    def resolve(self, reference: Reference | None) -> float:
        """Return the value in SI units."""
        if self.relative_to is None:
            return self.value
        scale = None if reference is None else getattr(reference, self.relative_to)
        if scale is None or not (np.isfinite(scale) and scale > 0):
            raise InputError(
                f"parameter {self.name!r} is {self.value:g} times the largest {self.relative_to} of the "
                f"data, which is {scale!r} here; give a reference with a positive {self.relative_to}"
            )
        return self.value * float(scale)


@dataclass(frozen=True)
class TermInput:
    """An input that a term depends on.

    Parameters
    ----------
    name : str
        In the formula, and in ``[inputs]`` of the campaign.
    unit : str
        SI.
    reference : str
        What the formula calls the input's reference value; empty where it does not use it.
    levels : int
        At how many levels of the input the term is offered, at least.
    offered_for : tuple of str
        SI units of the inputs for which it is offered; empty for all.
    """

    name: Line
    unit: Line
    reference: str = ""
    levels: int = 2
    offered_for: tuple[Line, ...] = ()


@dataclass(frozen=True)
class Term:
    """A candidate term: coefficient × formula is a moment.

    Parameters
    ----------
    id : str
        Name used in results, options and other catalogues.
    symbol : str
        Of the coefficient, as in "k1".
    formula : str
        As the catalogue writes it.
    unit : str
        SI unit of the coefficient for a rotational joint; see :meth:`unit_for`.
    name, meaning, family, source : str
    confused_with : tuple of str
        Ids of terms that leave a similar mark on data.
    parameters : tuple of Parameter
    expression : sympy.Expr
        The parsed formula, parameters still symbols.
    inputs : tuple of TermInput
    within : tuple of str
        Ids of terms without which this one makes no sense: k1·T without k1.
    """

    WRITTEN: ClassVar = {
        **same("id", "symbol", "formula", "unit", "name", "meaning", "family", "source", "confused_with"),
        "parameters": ("parameters", same("name", "unit", "value", "relative_to", "lower", "upper")),
        **same("inputs", "within"),
    }
    id: Identifier
    symbol: Line
    formula: Line
    unit: Line
    name: Line
    meaning: Line
    family: Line
    source: str = ""
    confused_with: tuple[Identifier, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    expression: Any = field(repr=False, default=None)
    inputs: tuple[TermInput, ...] = ()
    within: tuple[Identifier, ...] = ()

    def unit_for(self, motion: Motion) -> str:
        """Return the unit of the coefficient for rotation or translation."""
        if self.inputs:
            # The units of inputs are the same for either kind of motion: a load stays N where N*m becomes N.
            own = {p.name: p.unit_for(motion) for p in self.parameters}
            return formula.coefficient_unit(self.expression, own | input_units(self.inputs), motion)
        return self.unit if motion == "rotation" else formula.unit_for(self.unit, motion)

    def text(self, motion: Motion = "rotation") -> str:
        """Return the formula in the catalogues' syntax: as written, or with x, v, a for translation."""
        return self.formula if motion == "rotation" else formula.formula_text(self.expression, motion)

    def pretty(self, motion: Motion = "rotation") -> str:
        """Return the formula as a line to read."""
        return formula.formula_pretty(self.expression, motion)

    def latex(self, motion: Motion = "rotation") -> str:
        """Return the formula as LaTeX."""
        return formula.formula_latex(self.expression, motion)

    @property
    def needs_acceleration(self) -> bool:
        """Whether the formula holds the acceleration."""
        return formula.variable_symbols()[2] in self.expression.free_symbols

    @property
    def symmetry(self) -> Literal["odd", "even", "neither"]:
        """What becomes of the term when angle, rate and acceleration all change sign.

        Found by evaluating it at points of many sizes: sympy does not see that max(min(θ, g), -g) is odd.
        """
        names = [*self.symbols, *(each.name for each in self.inputs)]
        motion = np.random.default_rng(0).normal(size=(3, 256)) * np.logspace(-4, 2, 256)
        evaluate = formula.compile_terms([self.expression], [*formula.VARIABLES, *names])
        here = evaluate(*motion, *np.linspace(0.5, 1.0, len(names)))
        mirrored = evaluate(*-motion, *np.linspace(0.5, 1.0, len(names)))
        if np.allclose(mirrored, here, rtol=1e-9, atol=0, equal_nan=True):
            return "even"
        return "odd" if np.allclose(mirrored, -here, rtol=1e-9, atol=0, equal_nan=True) else "neither"

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of the nonlinear parameters, and of the reference values of inputs."""
        references = (each.reference for each in self.inputs if each.reference)
        return (*(parameter.name for parameter in self.parameters), *references)

    def resolve(self, reference: Reference | None = None) -> ResolvedTerm:
        """Set the nonlinear parameters to numbers.

        Raises
        ------
        InputError
            If a parameter is relative to a scale that the reference does not give.
        """
        try:
            values = tuple((parameter.name, parameter.resolve(reference)) for parameter in self.parameters)
            values += tuple(self._references(reference))
        except InputError as error:
            raise InputError(f"term {self.id!r}: {error}") from None
        return self.with_parameters(dict(values))

    def _references(self, reference: Reference | None) -> Iterator[tuple[str, float]]:
        known = {} if reference is None else dict(reference.inputs)
        for each in self.inputs:
            if each.name not in known:
                raise InputError(
                    f"it depends on the input {each.name!r}, which these data do not have (they have "
                    f"{', '.join(known) or 'none'}); declare it in [inputs] of the campaign, or leave the term out"
                )
            if each.reference:
                yield each.reference, known.get(each.reference, known[each.name])

    def with_parameters(self, values: dict[str, float]) -> ResolvedTerm:
        """Set the nonlinear parameters to the given numbers, in SI units."""
        names = list(self.symbols)
        if set(values) != set(names):
            raise InputError(
                f"term {self.id!r}: values for {', '.join(values) or 'nothing'} given; "
                f"expected {', '.join(names) or 'nothing'}"
            )
        numbers = tuple((name, float(values[name])) for name in names)
        return ResolvedTerm(self, numbers, with_numbers(self.expression, numbers))


@dataclass(frozen=True)
class ResolvedTerm:
    """A term whose nonlinear parameters are numbers.

    Parameters
    ----------
    term : Term
    values : tuple of (str, float)
        Inner parameters in SI units.
    expression : sympy.Expr
        Over angle, rate and acceleration only.
    """

    term: Term
    values: tuple[tuple[str, float], ...]
    expression: sympy.Expr = field(repr=False)

    @property
    def id(self) -> str:
        """Id of the term."""
        return self.term.id


def term_columns(
    terms: Sequence[ResolvedTerm],
    angle: ArrayLike,
    rate: ArrayLike,
    acceleration: ArrayLike | None = None,
    *,
    inputs: Mapping[str, ArrayLike] | None = None,
) -> NDArray[np.float64]:
    """Evaluate terms along measured motion.

    Parameters
    ----------
    terms : sequence of ResolvedTerm
    angle, rate, acceleration : array_like, shape (n,)
        rad, rad/s, rad/s²; the acceleration only where a term needs it.
    inputs : mapping of str to array_like, shape (n,) or (), optional
        Inputs of the law, SI.

    Returns
    -------
    ndarray, shape (n, p)
        Fortran-ordered, a column per term.

    Raises
    ------
    InputError
        If a term needs the acceleration and none is given, or has no finite value somewhere.
    """
    if acceleration is None:
        lacking = [term.id for term in terms if term.term.needs_acceleration]
        if lacking:
            raise InputError(
                f"term(s) {', '.join(lacking)} need the acceleration; give it as the third signal"
            )
        acceleration = np.nan
    known = dict(inputs or {})
    lacking = [each.name for term in terms for each in term.term.inputs if each.name not in known]
    if lacking:
        raise InputError(
            f"the terms depend on the input {lacking[0]!r}, of which no values are given; give them"
        )
    compiled = formula.compile_terms([term.expression for term in terms], (*formula.VARIABLES, *known))
    columns = compiled(angle, rate, acceleration, *known.values())
    # One sum per column finds NaN and infinity without a second array of the same size.
    bad = np.flatnonzero(~np.isfinite(columns.sum(axis=0)))
    for index in map(int, bad):
        rows = np.flatnonzero(~np.isfinite(columns[:, index]))
        if rows.size:
            raise InputError(
                f"term {terms[index].id!r} ({terms[index].term.formula}) has no finite value at sample "
                f"{rows[0]} (theta {np.asarray(angle)[rows[0]]:.6g}, omega {np.asarray(rate)[rows[0]]:.6g}); "
                "leave the term out or change its formula"
            )
    return columns


def input_units(inputs: Sequence[TermInput]) -> dict[str, str]:
    """Return the units of inputs and of their reference values by name."""
    return {name: each.unit for each in inputs for name in (each.name, each.reference) if name}


@lru_cache(maxsize=1024)
def with_numbers(expression: sympy.Expr, numbers: tuple[tuple[str, float], ...]) -> sympy.Expr:
    """Return an expression with numbers for nonlinear parameters."""
    from sympy import Float

    return expression.xreplace({formula.parameter_symbol(name): Float(value, 17) for name, value in numbers})
