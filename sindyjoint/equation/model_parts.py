"""What a discovered model is made of: its terms, on what data it was fitted, and its inputs held at values."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.errors import UnknownNameError
from sindyjoint.limits import EQUATION
from sindyjoint.plain import Count, Maybe, MaybeSize, Size, same
from sindyjoint.text import percent, quantities

if TYPE_CHECKING:
    import sympy


INERTIA = "inertia"
# Among what a model has seen: nobody wrote down all of it.
UNKNOWN = "unknown"


@dataclass(frozen=True)
class ModelTerm:
    """A term of a discovered model.

    Parameters
    ----------
    id, symbol : str
    name, family : str
    formula : str
        In the catalogues' syntax; nonlinear parameters by name.
    parameters : tuple of (str, float)
        Values of the nonlinear parameters, SI.
    unit : str
        SI unit of the coefficient for this joint's kind of motion.
    coefficient, standard_error : float
    interval95 : tuple of float
    unique_share : float
        Moment that no other term can take over, relative to the RMS moment.
    inputs : tuple of str
        Names of the inputs that the formula uses.
    """

    WRITTEN: ClassVar = {
        **same("id", "symbol", "name", "family", "formula", "parameters", "unit", "coefficient"),
        **same("standard_error", "interval95", "unique_share"),
        "inputs?": "inputs",
    }
    id: str
    symbol: str
    name: str
    family: str
    formula: str
    parameters: tuple[tuple[str, float], ...]
    unit: str
    coefficient: float
    standard_error: Size
    interval95: tuple[float, float]
    unique_share: float
    inputs: tuple[str, ...] = ()

    @cached_property
    def expression(self) -> sympy.Expr:
        """The formula with numbers for its nonlinear parameters."""
        from sindyjoint.equation.formula import parse_formula
        from sindyjoint.equation.terms import with_numbers

        parsed = parse_formula(self.formula, [name for name, _ in self.parameters], self.inputs)
        return with_numbers(parsed, self.parameters)


@dataclass(frozen=True)
class Fitted:
    """On what data a model was fitted and how well.

    Parameters
    ----------
    moment_rms, residual_rms, noise_floor : float
        Of the transfer moment over moving samples, N·m. The noise floor is the part of the residual that the data
        themselves cannot repeat; NaN where it could not be measured.
    moving_fraction : float
    samples : int
        Moving samples.
    runs : int
    angle, rate : float
        Largest absolute angle (rad) and rate (rad/s) tested.
    frequencies : tuple of float
        Hz.
    simulated : bool
    data : str
        Hash of the campaign's content, see :func:`~sindyjoint.states.content_hash`; empty where not known.
    versions : mapping of str to str
        Names and versions of what fitted it.
    gains : mapping of str to float
        Declared relative uncertainty of the gain of each channel, which is in the intervals.
    mean_known : bool
        Whether the mean angle was measured; otherwise zero is where the elastic moment is zero.
    quasi_static : bool
        Whether the samples had no time: the rate is then that of the path, one.
    seen : tuple of str
        Runs that any fit of it used, by :func:`~sindyjoint.states.run_hash`; with ``"unknown"`` among them
        there may be others.
    """

    WRITTEN: ClassVar = {
        **same(
            "moment_rms", "residual_rms", "noise_floor", "moving_fraction", "samples", "runs", "angle", "rate"
        ),
        **same("frequencies", "simulated", "data", "versions"),
        **{"mean_known?": "mean_known", "quasi_static?": "quasi_static", "seen": "seen", "gains?": "gains"},
    }
    moment_rms: MaybeSize
    residual_rms: MaybeSize
    noise_floor: MaybeSize
    moving_fraction: Maybe
    samples: Count
    runs: Count
    angle: MaybeSize
    rate: MaybeSize
    frequencies: tuple[float, ...] = ()
    simulated: bool = False
    data: str = ""
    versions: Mapping[str, str] = field(default_factory=dict, hash=False)
    gains: Mapping[str, Size] = field(default_factory=dict, hash=False)
    mean_known: bool = True
    quasi_static: bool = False
    seen: tuple[str, ...] = (UNKNOWN,)

    @property
    def misfit(self) -> float:
        """Share of the moment's RMS that neither model nor noise explains; all that is left where no noise is known."""
        floor = self.noise_floor if math.isfinite(self.noise_floor) else 0.0
        beyond = max(self.residual_rms**2 - floor**2, 0.0)
        return float(np.sqrt(beyond)) / self.moment_rms if self.moment_rms > 0 else 0.0


def has_seen(fitted: Fitted, run: str) -> bool | None:
    """Return whether a fit has used a run, known by its hash; None where that is not known."""
    return True if run in fitted.seen else None if UNKNOWN in fitted.seen else False


def range_warnings(
    fitted: Fitted, motion: str, angle: ArrayLike, rate: ArrayLike, where: str, timed: bool = True
) -> tuple[str, ...]:
    """Return what to say of a motion that goes beyond the angle or rate that a model was tested to; often nothing.

    Parameters
    ----------
    fitted : Fitted
        Of the model.
    motion : str
        Of its joint.
    angle, rate : array_like, shape (n,)
        rad, rad/s (m, m/s).
    where : str
        Of which motion this is.
    timed : bool
        Whether it is a motion in time.
    """
    words = quantities(motion)
    unit = "rad" if motion == "rotation" else "m"
    found = []
    if fitted.quasi_static or not timed:
        rate = np.zeros(1)
    untimed = f"{where}: the model was fitted to samples without time: what depends on the rate is not in it"
    lines = (untimed,) if fitted.quasi_static and timed else ()
    for name, signal, tested, si in (
        (words.angle.lower(), angle, fitted.angle, unit),
        (words.rate.lower(), rate, fitted.rate, f"{unit}/s"),
    ):
        size = np.abs(np.asarray(signal, dtype=np.float64))
        share = float(np.mean(size > (1 + EQUATION.tolerated) * tested)) if tested > 0 else 0.0
        if share > EQUATION.trivial_share:
            found.append(
                f"{name} up to {size.max():.3g} {si} where {tested:.3g} was tested ({percent(share)} of the time)"
            )
    return (*lines, f"{where}: beyond the tested range: {'; '.join(found)}") if found else lines


# A joint model; its own module is above this one.
Model = TypeVar("Model", bound=Any)
#: Formula, nonlinear parameters and inputs of a term.
Written = tuple[str, tuple[tuple[str, float], ...], tuple[str, ...]]


def input_values(model: Any, given: Mapping[str, float]) -> dict[str, float]:
    """Return a value for each input of a model: the given one, or its reference.

    Raises
    ------
    UnknownNameError
        For a name that is no input of the model.
    """
    values = {each.name: each.reference for each in model.inputs}
    for name in given:
        if name not in values:
            known = ", ".join(values) or "none"
            raise UnknownNameError(f"the model has no input {name!r}; its inputs: {known}")
    return values | {name: float(value) for name, value in given.items()}


def model_at(model: Model, given: Mapping[str, float]) -> Model:
    """Return a model with its inputs held; see :meth:`JointModel.at`.

    What then has the form of another term is added to its coefficient: k1 + k1T·(T − T0) is the k1 at T.
    """
    values = tuple(sorted(input_values(model, given).items()))
    if not model.inputs:
        return model
    rows, formulas, matrix = _held(model, values)
    numbers = matrix @ model.numbers
    covariance = matrix @ model.covariance_matrix @ matrix.T if model.covariance else None
    terms = tuple(
        _term(model.terms[place], formulas[place], numbers[row], covariance, row)
        for row, place in enumerate(rows)
    )
    kept = () if covariance is None else tuple(map(tuple, covariance.tolist()))
    at = dict(values)
    inputs = tuple(replace(each, reference=at[each.name]) for each in model.inputs)
    return replace(model, terms=terms, covariance=kept, inputs=inputs)


def _held(model: Any, values: tuple[tuple[str, float], ...]) -> tuple[list[int], tuple[str, ...], np.ndarray]:
    """Return the places of the terms that stay, the formulas of all, and the matrix of their numbers."""
    written = tuple((term.formula, term.parameters, term.inputs) for term in model.terms)
    joined, formulas = _plan(written, values)
    size, count = model.numbers.size, len(model.terms)
    rows = [place for place, target in enumerate(joined) if target is not None and target[0] == place]
    matrix = np.zeros((len(rows) + size - count, size))
    matrix[len(rows) :, count:] = np.eye(size - count)
    for place, target in enumerate(joined):
        if target is not None:
            matrix[rows.index(target[0]), place] = target[1]
    return rows, formulas, matrix


def _term(term: ModelTerm, formula: str, value: float, covariance: np.ndarray | None, row: int) -> ModelTerm:
    own = term.standard_error
    error = own if covariance is None else float(np.sqrt(max(covariance[row, row], 0.0)))
    half = (term.interval95[1] - term.interval95[0]) / 2 * (error / own if own > 0 else 1.0)
    parameters = () if term.inputs else term.parameters
    return replace(
        term,
        formula=formula,
        parameters=parameters,
        inputs=(),
        coefficient=float(value),
        standard_error=error,
        interval95=(float(value) - half, float(value) + half),
    )


@lru_cache(maxsize=512)
def _plan(
    written: tuple[Written, ...], values: tuple[tuple[str, float], ...]
) -> tuple[tuple[tuple[int, float] | None, ...], tuple[str, ...]]:
    """Return of each term to which one it is added and times what (None: it vanishes), and its formula."""
    from sympy import Float

    from sindyjoint.equation.formula import formula_text, parse_formula, state_symbol, variable_symbols
    from sindyjoint.equation.parsing import parameter_symbol

    motion = variable_symbols()
    held = {state_symbol(name): Float(value, 17) for name, value in values}
    expressions = []
    for formula, parameters, inputs in written:
        parsed = parse_formula(formula, [name for name, _ in parameters], inputs)
        if inputs:
            numbers = {parameter_symbol(name): Float(value, 17) for name, value in parameters}
            parsed = parsed.xreplace(held | numbers)
        expressions.append(parsed)
    bases = {expressions[i]: i for i, (_, _, inputs) in reversed([*enumerate(written)]) if not inputs}
    joined: list[tuple[int, float] | None] = []
    for place, (expression, (_, _, inputs)) in enumerate(zip(expressions, written, strict=True)):
        factor, base = expression.as_independent(*motion, as_Add=False) if inputs else (1, expression)
        target = (bases[base], float(factor)) if inputs and base in bases else (place, 1.0)
        joined.append(None if expression == 0 or factor == 0 else target)
    formulas = (
        formula_text(expression) if inputs else formula
        for expression, (formula, _, inputs) in zip(expressions, written, strict=True)
    )
    return tuple(joined), tuple(formulas)


# What a model says it was computed with.
PACKAGES = ("sindyjoint", "pysindy", "scikit-learn", "numpy", "scipy", "matplotlib", "sympy", "numba")


@cache
def versions() -> tuple[tuple[str, str], ...]:
    """Return the versions of this package, of Python and of what it computes with."""
    found = [("Python", platform.python_version())]
    for name in PACKAGES:
        try:
            found.append((name, version(name)))
        except PackageNotFoundError:
            continue
    return tuple(found)
