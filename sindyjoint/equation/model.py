"""The discovered model of a joint: its terms, how sure they are, and its moment."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.record import Joint

if TYPE_CHECKING:
    import sympy

    from sindyjoint.equation.terms import ResolvedTerm

SCHEMA = 1
INERTIA = "inertia"


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
    """

    id: str
    symbol: str
    name: str
    family: str
    formula: str
    parameters: tuple[tuple[str, float], ...]
    unit: str
    coefficient: float
    standard_error: float
    interval95: tuple[float, float]
    unique_share: float

    @cached_property
    def expression(self) -> sympy.Expr:
        """The formula with numbers for its nonlinear parameters."""
        from sympy import Float

        from sindyjoint.equation.formula import parameter_symbol, parse_formula

        parsed = parse_formula(self.formula, [name for name, _ in self.parameters])
        return parsed.xreplace({parameter_symbol(name): Float(value, 17) for name, value in self.parameters})


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
    """

    moment_rms: float
    residual_rms: float
    noise_floor: float
    moving_fraction: float
    samples: int
    runs: int
    angle: float
    rate: float
    frequencies: tuple[float, ...] = ()
    simulated: bool = False

    @property
    def misfit(self) -> float:
        """Share of the moment's RMS that neither model nor noise explains; all that is left where no noise is known."""
        floor = self.noise_floor if math.isfinite(self.noise_floor) else 0.0
        beyond = max(self.residual_rms**2 - floor**2, 0.0)
        return float(np.sqrt(beyond)) / self.moment_rms if self.moment_rms > 0 else 0.0


@dataclass(frozen=True)
class JointModel:
    """The equation of a joint: Σ coefficient · term(θ, θ̇) = transfer moment.

    Parameters
    ----------
    joint : Joint
    terms : tuple of ModelTerm
        Inertia among them only where it was identified.
    covariance : tuple of tuple of float
        Of the coefficients, in their order.
    fitted : Fitted
    """

    joint: Joint
    terms: tuple[ModelTerm, ...]
    covariance: tuple[tuple[float, ...], ...]
    fitted: Fitted

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
    def inertia(self) -> float:
        """Moving inertia, kg·m² (kg): declared, or identified, or zero."""
        if self.joint.inertia is not None:
            return self.joint.inertia
        return self[INERTIA].coefficient if INERTIA in self else 0.0

    def with_terms(self, terms: Iterable[ModelTerm], covariance: ArrayLike) -> JointModel:
        """Return the model with other terms.

        Parameters
        ----------
        terms : iterable of ModelTerm
        covariance : array_like, shape (n, n)
            Of their coefficients, SI.
        """
        rows = np.asarray(covariance, dtype=np.float64).tolist()
        return replace(self, terms=tuple(terms), covariance=tuple(map(tuple, rows)))

    def moment(self, angle: ArrayLike, rate: ArrayLike) -> NDArray[np.float64]:
        """Return the transfer moment at a state; without the part of the inertia.

        Parameters
        ----------
        angle, rate : array_like, shape (...)
            rad, rad/s. At a rate of zero sign(θ̇) is zero.

        Returns
        -------
        ndarray, shape (...)
            N·m.
        """
        from sindyjoint.equation.formula import compile_terms

        angle, rate = np.broadcast_arrays(np.asarray(angle, float), np.asarray(rate, float))
        terms = [term for term in self.terms if term.id != INERTIA]
        if not terms:
            return np.zeros(angle.shape)
        columns = compile_terms([term.expression for term in terms])(angle.ravel(), rate.ravel(), np.nan)
        return (columns @ np.array([term.coefficient for term in terms])).reshape(angle.shape)

    def equation(self) -> str:
        """Return the equation as one line of text, with symbols for coefficients."""
        from sindyjoint.equation.formula import formula_pretty

        motion = self.joint.motion
        parts = [_product(t.symbol, formula_pretty(t.expression, motion), "·") for t in self._ordered()]
        if self.joint.inertia is not None:
            parts.insert(0, "I·θ̈" if motion == "rotation" else "m·ẍ")
        return f"{'M' if motion == 'rotation' else 'F'} = {' + '.join(parts) or '0'}"

    def latex(self) -> str:
        """Return the equation as LaTeX, with symbols for coefficients."""
        from sindyjoint.equation.formula import formula_latex

        motion = self.joint.motion
        parts = [
            _product(latex_symbol(t.symbol), formula_latex(t.expression, motion), r"\,")
            for t in self._ordered()
        ]
        if self.joint.inertia is not None:
            parts.insert(0, r"I\,\ddot{\theta}" if motion == "rotation" else r"m\,\ddot{x}")
        return f"{'M' if motion == 'rotation' else 'F'} = {' + '.join(parts) or '0'}"

    def _ordered(self) -> list[ModelTerm]:
        """Inertia first, as the field writes it."""
        return sorted(self.terms, key=lambda term: term.id != INERTIA)

    def to_dict(self) -> dict[str, Any]:
        """Return the model as plain JSON data; floats keep every bit."""
        data = asdict(self)
        data["joint"]["labels"] = dict(self.joint.labels)
        if math.isnan(self.fitted.noise_floor):
            data["fitted"]["noise_floor"] = None  # JSON has no NaN
        return {"schema": SCHEMA, "kind": "JointModel", **data}

    def to_json(self) -> str:
        """Return the model as JSON text."""
        return json.dumps(self.to_dict(), indent=1, ensure_ascii=False)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> JointModel:
        """Return the model that :meth:`to_dict` wrote.

        Raises
        ------
        InputError
            If it is not one; the message names the field.
        """
        if not isinstance(data, Mapping) or data.get("schema") != SCHEMA or "terms" not in data:
            raise InputError("not a joint model: expected 'schema': 1 and 'terms', as in model.json")
        try:
            terms = tuple(
                ModelTerm(
                    **{
                        **term,
                        "parameters": tuple((str(n), float(v)) for n, v in term["parameters"]),
                        "interval95": (float(term["interval95"][0]), float(term["interval95"][1])),
                    }
                )
                for term in data["terms"]
            )
            fitted = {**data["fitted"], "frequencies": tuple(data["fitted"]["frequencies"])}
            if fitted.get("noise_floor", 0.0) is None:
                fitted["noise_floor"] = math.nan
            model = cls(
                joint=Joint(**data["joint"]),
                terms=terms,
                covariance=tuple(tuple(float(v) for v in row) for row in data["covariance"]),
                fitted=Fitted(**fitted),
            )
            for term in terms:
                _ = term.expression
        except (KeyError, TypeError, IndexError) as error:
            raise InputError(f"not a joint model: {type(error).__name__}: {error}") from None
        return model

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
    from scipy.special import stdtrit

    quantiles = stdtrit(np.maximum(np.broadcast_to(degrees, coefficients.shape), 1), 0.975)
    terms = []
    for index, item in enumerate(resolved):
        value, error = float(coefficients[index]), float(np.sqrt(covariance[index, index]))
        quantile = float(quantiles[index])
        terms.append(
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
                interval95=(value - quantile * error, value + quantile * error),
                unique_share=float(unique_share[index]),
            )
        )
    return tuple(terms)


def _product(symbol: str, formula: str, times: str) -> str:
    if formula == "1":
        return symbol
    # A formula that begins with a sign is not a factor as it stands.
    return f"{symbol}{times}({formula})" if formula.startswith("-") else f"{symbol}{times}{formula}"


def latex_symbol(symbol: str) -> str:
    r"""Return k1 as k_{1}, M_F as M_{F} and mu_a as \mu_{a}."""
    from sympy.core.alphabets import greeks

    head, _, tail = symbol.partition("_")
    if not tail and len(head) > 1 and head not in greeks:
        head, tail = head[0], head[1:]
    head, tail = (f"\\{part}" if part in greeks else part for part in (head, tail))
    return f"{head}_{{{tail}}}" if tail else head
