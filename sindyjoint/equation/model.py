"""The discovered model of a joint: its terms, how sure they are, and its moment."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from sindyjoint.described import Described, same
from sindyjoint.equation.element import JointElement
from sindyjoint.equation.formula import VARIABLES, compile_terms
from sindyjoint.equation.model_parts import INERTIA, Fitted, ModelTerm, model_at, range_warnings
from sindyjoint.equation.terms import ResolvedTerm
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.errors import InputError, UnknownNameError, refuse
from sindyjoint.inputs import Input
from sindyjoint.numeric import Array
from sindyjoint.plain import from_plain
from sindyjoint.record import Joint
from sindyjoint.text import rounded

__all__ = ["INERTIA", "Fitted", "JointModel", "ModelTerm", "model_terms"]


@dataclass(frozen=True)
class JointModel(Described):
    """The equation of a joint: Σ coefficient · term(θ, θ̇), and the moments of elements with a memory.

    Parameters
    ----------
    joint : Joint
    terms : tuple of ModelTerm
        Inertia among them only where it was identified.
    covariance : tuple of tuple of float
        Of all :attr:`numbers`, in their order.
    fitted : Fitted
    elements : tuple of JointElement
    inputs : tuple of Input
        On which the terms depend beside angle and rate, with the range that was tested.
    test : TestNuisances, optional
        Errors of the test that it was found in: those of the rig hold in every campaign of that.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> model = sindyjoint.discover(test, "paper", correct=False).model
    >>> model.ids
    ('linear_stiffness', 'quadratic_stiffness', 'cubic_stiffness', 'linear_damping', 'coulomb_friction')
    >>> f"{model['M_F'].coefficient:.2f} {model['M_F'].unit}"
    '1.86 N*m'
    >>> sindyjoint.JointModel.from_json(model.to_json()) == model
    True
    """

    SCHEMA: ClassVar = 2
    KIND: ClassVar = "JointModel"
    WRITTEN: ClassVar = {
        **same("joint", "terms", "elements", "covariance", "fitted"),
        **{"inputs?": "inputs", "test?": "test"},
    }
    FORMERLY: ClassVar = ("fidelity",)  # of an export to JSON
    joint: Joint
    terms: tuple[ModelTerm, ...]
    covariance: tuple[tuple[float, ...], ...]
    fitted: Fitted
    elements: tuple[JointElement, ...] = ()
    inputs: tuple[Input, ...] = ()
    test: TestNuisances | None = None

    def __getitem__(self, term_id: str) -> ModelTerm:
        for term in self.terms:
            if term_id in (term.id, term.symbol):
                return term
        known = ", ".join(f"{term.id} ({term.symbol})" for term in self.terms)
        raise UnknownNameError(f"the model has no term {term_id!r}; it has {known or 'none'}")

    def __contains__(self, term_id: object) -> bool:
        return term_id in self.ids

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the terms."""
        return tuple(term.id for term in self.terms)

    @property
    def coefficients(self) -> NDArray[np.float64]:
        """Coefficients in the order of the terms, SI."""
        return np.array([term.coefficient for term in self.terms])

    @property
    def standard_errors(self) -> NDArray[np.float64]:
        """Standard errors in the order of the terms, SI."""
        return np.array([term.standard_error for term in self.terms])

    @property
    def numbers(self) -> NDArray[np.float64]:
        """Coefficients of the terms, then of each element the coefficients and the nonlinear parameters, SI."""
        inner = [number.value for element in self.elements for number in element.numbers]
        return np.concatenate([self.coefficients, inner])

    @property
    def number_errors(self) -> NDArray[np.float64]:
        """Standard errors of all :attr:`numbers`, SI."""
        inner = [number.standard_error for element in self.elements for number in element.numbers]
        return np.concatenate([self.standard_errors, inner])

    @property
    def covariance_matrix(self) -> NDArray[np.float64]:
        """Covariance of all :attr:`numbers`; zeros where none is known."""
        size = self.numbers.size
        matrix = np.array(self.covariance, dtype=np.float64)
        return matrix.reshape(size, size) if matrix.size else np.zeros((size, size))

    @property
    def inertia(self) -> float:
        """Moving inertia, kg·m² (kg): declared, or identified, or zero."""
        if self.joint.inertia is not None:
            return self.joint.inertia
        return self[INERTIA].coefficient if INERTIA in self else 0.0

    def with_terms(self, terms: Iterable[ModelTerm], covariance: ArrayLike) -> JointModel:
        """Return the model with other terms, and no elements.

        Parameters
        ----------
        terms : iterable of ModelTerm
        covariance : array_like, shape (n, n)
            Of their coefficients, SI.
        """
        rows = np.asarray(covariance, dtype=np.float64).tolist()
        return replace(self, terms=tuple(terms), elements=(), covariance=tuple(map(tuple, rows)))

    def without_elements(self) -> JointModel:
        """Return the model of the terms alone."""
        size = len(self.terms)
        own = tuple(row[:size] for row in self.covariance[:size])
        return replace(self, elements=(), covariance=own)

    def with_numbers(self, numbers: ArrayLike, covariance: ArrayLike | None = None) -> JointModel:
        """Return the model with other :attr:`numbers`.

        Parameters
        ----------
        numbers : array_like, shape (n,)
        covariance : array_like, shape (n, n), optional
            Of them; without it errors and covariance stay. Intervals become ±1.96 standard errors.
        """
        values = np.asarray(numbers, dtype=np.float64)
        matrix = self.covariance if covariance is None else np.asarray(covariance, dtype=np.float64).tolist()
        errors = self.number_errors if covariance is None else np.sqrt(np.diag(np.asarray(covariance)))
        pairs = [(float(value), float(error)) for value, error in zip(values, errors, strict=True)]
        size = len(self.terms)
        terms = tuple(
            replace(
                term,
                coefficient=value,
                standard_error=error,
                interval95=(value - 1.96 * error, value + 1.96 * error),
            )
            for term, (value, error) in zip(self.terms, pairs[:size], strict=True)
        )
        rest = iter(pairs[size:])
        elements = tuple(each.with_numbers([next(rest) for _ in each.numbers]) for each in self.elements)
        return replace(self, terms=terms, elements=elements, covariance=tuple(map(tuple, matrix)))

    @property
    def used_inputs(self) -> tuple[Input, ...]:
        """Inputs on which terms depend."""
        used = {name for term in self.terms for name in term.inputs}
        return tuple(each for each in self.inputs if each.name in used)

    def at(self, **inputs: float) -> JointModel:
        """Return the law at values of its inputs, SI; those not given are at their reference.

        Raises
        ------
        UnknownNameError
            For a name that is no input of the model.
        """
        return model_at(self, inputs)

    def moment(
        self,
        angle: ArrayLike,
        rate: ArrayLike,
        step: float | None = None,
        inputs: Mapping[str, ArrayLike] | None = None,
        rest: float = 0.0,
    ) -> NDArray[np.float64]:
        """Return the transfer moment at a state, or along a motion; without the part of the inertia.

        Along a motion beyond the tested range a warning (``UserWarning``) says so, with the share of the time.

        Parameters
        ----------
        angle, rate : array_like, shape (...)
            rad, rad/s. At a rate of zero sign(θ̇) is zero.
        step : float, optional
            s between the samples of a motion, shape (n,). A model with elements needs it: what they transfer depends
            on how a state was reached.
        inputs : mapping of str to array_like, shape (...) or (), optional
            SI; those not given are at their reference.
        rest : float
            Angle from which the joint came to the first sample of a motion, rad: sliders are in their middle there.

        Returns
        -------
        ndarray, shape (...)
            N·m.

        Raises
        ------
        InputError
            If the model has elements and no step is given.
        """
        angle, rate = np.broadcast_arrays(np.asarray(angle, float), np.asarray(rate, float))
        if self.elements and step is None:
            names = ", ".join(element.id for element in self.elements)
            raise InputError(
                f"the moment of {names} depends on the motion before; give angle and rate along a motion, and the step "
                "between its samples"
            )
        if step is not None:
            for line in range_warnings(
                self.fitted, self.joint.motion, angle, rate, "this motion", not self.fitted.quasi_static
            ):
                warnings.warn(line, UserWarning, stacklevel=2)
        terms = [term for term in self.terms if term.id != INERTIA]
        total = np.zeros(angle.shape)
        if terms:
            values = self.input_arrays(inputs, angle.shape)
            columns = compile_terms([term.expression for term in terms], (*VARIABLES, *values))(
                angle.ravel(), rate.ravel(), np.nan, *values.values()
            )
            total = (columns @ np.array([term.coefficient for term in terms])).reshape(angle.shape)
        for element in self.elements:
            total = total + element.along(angle, rate, float(step or 0.0), rest)
        return total

    def slopes(self, angle: Array, rate: Array) -> tuple[Array, Array]:
        """Return ∂M/∂θ and ∂M/∂θ̇ of the smooth moment along a motion, by central differences.

        The step is a thousandth of the range, and a rate keeps its sign: the friction step is no slope.
        """
        small = 1e-3 * self.fitted.angle
        along = (self.moment(angle + small, rate) - self.moment(angle - small, rate)) / (2 * small)
        tiny = np.minimum(1e-3 * self.fitted.rate, 0.5 * np.abs(rate)) + 1e-300
        across = (self.moment(angle, rate + tiny) - self.moment(angle, rate - tiny)) / (2 * tiny)
        return along, np.where(np.abs(rate) > 1e-9 * self.fitted.rate, across, 0.0)

    def __repr__(self) -> str:
        return f"<JointModel: {self.joint.name}, {len(self.terms) + len(self.elements)} terms>"

    def __str__(self) -> str:
        numbers = (
            f"  {each.symbol} = {rounded(each.coefficient, each.standard_error)} {each.unit}"
            for each in self.terms
        )
        return "\n".join([f"{self.joint.name}: {self.equation()}", *numbers])

    def _repr_latex_(self) -> str:
        return f"$\\displaystyle {self.latex()}$"

    def input_arrays(
        self, given: Mapping[str, ArrayLike] | None, shape: tuple[int, ...]
    ) -> dict[str, NDArray[np.float64]]:
        """Return the inputs by name, each of that shape and then flat; the reference where none is given."""
        known = {each.name: each.reference for each in self.inputs}
        values = known | {name: value for name, value in (given or {}).items() if name in known}
        return {
            name: np.broadcast_to(np.asarray(value, float), shape).ravel() for name, value in values.items()
        }

    def equation(self) -> str:
        """Return the equation as text, with symbols for coefficients, and the rates of internal states behind it."""
        from sindyjoint.equation.equation_text import PLAIN

        return PLAIN.equation(self.joint, self.terms, self.elements)

    def latex(self) -> str:
        """Return the equation as LaTeX, with symbols for coefficients."""
        from sindyjoint.equation.equation_text import LATEX

        return LATEX.equation(self.joint, self.terms, self.elements)

    def to_json(self) -> str:
        """Return the model as JSON text; floats keep every bit."""
        return json.dumps(self.to_dict(), indent=1, ensure_ascii=False)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> JointModel:
        """Return the model that :meth:`to_dict` wrote, of this schema or the first.

        Raises
        ------
        InputError
            If it is not one; the message names the field.
        """
        if not isinstance(data, Mapping) or data.get("schema") not in (1, cls.SCHEMA) or "terms" not in data:
            raise InputError(
                f"not a joint model: expected 'schema': {cls.SCHEMA} (or 1) and 'terms', as in model.json"
            )
        # A model from elsewhere must be read in seconds, whatever it holds.
        # Entries that a model may have.
        most = {"terms": 200, "elements": 50, "inputs": 20}
        counts = {name: len(own) for name in most if isinstance(own := data.get(name), list)}
        refuse(
            (count > most[name], f"not a joint model: {count} {name}; expected at most {most[name]}")
            for name, count in counts.items()
        )
        try:
            return from_plain(cls, data)
        except InputError as error:
            raise InputError(f"not a joint model: {error}") from None

    def checked(self) -> JointModel:
        """Return it after it was read; InputError where its parts do not fit together, or a formula cannot be read."""
        _ = [term.expression for term in self.terms], [element.form for element in self.elements]
        ids = [*self.ids, *(element.id for element in self.elements)]
        size, lengths = self.numbers.size, {len(row) for row in self.covariance}
        twice = next((name for name in ids if ids.count(name) > 1), None)
        rows = f"{len(self.covariance)} row(s) of {', '.join(map(str, sorted(lengths)))} numbers"
        fits = len(self.covariance) == size and lengths == {size}
        matrix = self.covariance_matrix if fits else np.zeros((0, 0))
        scale = np.sqrt(np.abs(np.diagonal(matrix)))
        bound = (1 + 1e-6) * np.outer(scale, scale)
        negative = np.any(np.diagonal(matrix) < 0) or np.any(np.abs(matrix) > bound)
        refuse(
            [
                (twice is not None, f"the id {twice!r} is used twice; expected each id once"),
                (
                    self.covariance and not fits,
                    f"covariance has {rows}; expected {size} of {size}, one for each number of the model",
                ),
                (negative, "in covariance a variance is negative, or a correlation is beyond 1"),
                (np.any(np.abs(matrix - matrix.T) > 1e-6 * bound), "covariance is not symmetric"),
            ]
        )
        return self

    @classmethod
    def from_json(cls, text: str) -> JointModel:
        """Return the model that :meth:`to_json` wrote."""
        try:
            data = json.loads(text)
        except ValueError as error:
            raise InputError(f"not a joint model: the text is not JSON ({error})") from None
        return cls.from_dict(data)


def model_terms(
    resolved: list[ResolvedTerm],
    coefficients: NDArray[np.float64],
    covariance: NDArray[np.float64],
    unique_share: NDArray[np.float64],
    degrees: ArrayLike,
    motion: str,
) -> tuple[ModelTerm, ...]:
    """Return model terms with Student-t intervals on ``degrees`` degrees of freedom, one for all or one each."""
    errors = np.sqrt(np.diagonal(covariance))
    half = errors * scipy.special.stdtrit(np.maximum(np.broadcast_to(degrees, coefficients.shape), 1), 0.975)
    ends = zip((coefficients - half).tolist(), (coefficients + half).tolist(), strict=True)
    numbers = zip(coefficients.tolist(), errors.tolist(), ends, unique_share.tolist(), strict=True)
    return tuple(
        ModelTerm(
            id=item.id,
            symbol=item.term.symbol,
            name=item.term.name,
            family=item.term.family,
            formula=item.term.formula,
            parameters=item.values,
            unit=item.term.unit_for(motion),  # type: ignore[arg-type]
            coefficient=value,
            standard_error=error,
            interval95=interval,
            unique_share=share,
            inputs=tuple(each.name for each in item.term.inputs),
        )
        for item, (value, error, interval, share) in zip(resolved, numbers, strict=True)
    )
