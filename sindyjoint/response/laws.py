"""A discovered model as a law that can be simulated."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.equation.element import Form, JointElement
from sindyjoint.equation.model import INERTIA, JointModel, ModelTerm
from sindyjoint.equation.test_record import TEST_SIGNALS
from sindyjoint.errors import InputError, refuse
from sindyjoint.limits import RESPONSE
from sindyjoint.mechanics import FormulaLaw, Law, LawWithNumbers, PaperLaw, SumLaw
from sindyjoint.mechanics.excitation import sampled
from sindyjoint.mechanics.stickslip import simulate
from sindyjoint.numeric import Array, root_of
from sindyjoint.paper import PARAMETERS as PAPER_PARAMETERS
from sindyjoint.record import Campaign
from sindyjoint.states import ForceStates, with_lags
from sindyjoint.text import in_words_of


def model_law(model: JointModel) -> Law:
    """Return a model as a law of :mod:`sindyjoint.mechanics`: its terms, and its elements with their internal states.

    Inputs are held at their reference.

    Models of the paper's five terms, or some of them, become a :class:`~sindyjoint.mechanics.PaperLaw`, which
    needs no compilation; all others a :class:`~sindyjoint.mechanics.FormulaLaw` made of their formulas. Its
    parameters are the coefficients in the order of the terms, without the inertia, so that other coefficients of the
    same terms need no further compilation.

    Parameters
    ----------
    model : JointModel

    Returns
    -------
    Law
        With the model's inertia; ``sign(θ̇)`` is set-valued at standstill.

    Raises
    ------
    InputError
        For a term of the acceleration other than the inertia: no law of angle and rate has it.

    Examples
    --------
    >>> from sindyjoint.equation.model import Fitted
    >>> from sindyjoint.record import Joint
    >>> def term(id, formula, value):
    ...     return ModelTerm(id, id, id, "", formula, (), "", value, 0.0, (value, value), 1.0)
    >>> def model(*terms):
    ...     return JointModel(Joint(inertia=0.02), terms, (), Fitted(1, 0, 0, 1, 100, 1, 1e-3, 0.02))
    >>> model_law(model(term("linear_stiffness", "theta", 6000.0))).k1
    6000.0
    >>> law = model_law(model(term("quadratic_damping", "omega*abs(omega)", 100.0)))
    >>> law.moment([0.0], [-0.1], [-1.0])
    array([-1.])
    """
    elements = sum_law(parts_of(model.elements))
    if any(term.inputs for term in model.terms):
        model = model.at()
    terms = law_terms(model)
    # PaperLaw refuses negative friction, which a prescribed motion can still use.
    negative = any(term.id == "coulomb_friction" and term.coefficient < 0 for term in terms)
    law: Law
    if not negative and {term.id for term in terms} <= PAPER_PARAMETERS.keys():
        values = {PAPER_PARAMETERS[term.id]: term.coefficient for term in terms}
        law = PaperLaw(**{"k1": 0.0, **values}, inertia=model.inertia, name=model.joint.name)
    else:
        law = _build_formula_law(model, terms)
    return law if elements is None else SumLaw(law, elements)


def simulated_states(model: JointModel, start: Array, time: Array, moment: Array) -> Array:
    """Return angle and rate of a joint under a sampled moment, shape (n, 2), with exact sticking.

    Parameters
    ----------
    model : JointModel
        With an inertia.
    start : ndarray, shape (2,)
        Angle and rate at the first instant.
    time, moment : ndarray, shape (n,)
        Evenly spaced instants, s, and the moment at the sensor, N·m.

    Raises
    ------
    InputError
        If the model has no inertia.
    """
    if not model.inertia > 0:
        raise InputError("the model has no inertia: its motion under a moment is not determined; declare one")
    rate = 1.0 / float(time[1] - time[0])
    motion = simulate(model_law(model), sampled(moment, rate), time.size / rate, rate, initial=start)
    return np.column_stack([motion.angle, motion.rate])


def law_terms(model: JointModel) -> tuple[ModelTerm, ...]:
    """Return the terms of the transfer moment: all but the inertia."""
    return tuple(term for term in model.terms if term.id != INERTIA)


def with_coefficients(
    model: JointModel, coefficients: ArrayLike, covariance: ArrayLike | None = None
) -> JointModel:
    """Return a model with other coefficients.

    Parameters
    ----------
    model : JointModel
    coefficients : array_like, shape (n_terms,)
        In the order of the model's terms, inertia among them where it is one; SI.
    covariance : array_like, shape (n_terms, n_terms), optional
        Of the new coefficients; without it errors and covariance stay. Intervals become ±1.96 standard errors.
    """
    values = np.asarray(coefficients, dtype=np.float64)
    count = len(model.terms)
    if values.shape != (count,):
        raise InputError(f"coefficients of shape {values.shape} given; expected ({count},), one per term")
    if not model.elements:
        return model.with_numbers(values, covariance)
    numbers = np.concatenate([values, model.numbers[count:]])
    if covariance is None:
        return model.with_numbers(numbers)
    # What the elements share with the old coefficients is not known of the new ones.
    whole = model.covariance_matrix
    whole[:count], whole[:, :count] = 0.0, 0.0
    whole[:count, :count] = covariance
    return model.with_numbers(numbers, whole)


def draw_models(model: JointModel, count: int, generator: np.random.Generator) -> list[JointModel]:
    """Draw models from the normal distribution of their numbers; negative friction is set to zero."""
    root = root_of(model.covariance_matrix)
    draws = model.numbers + generator.standard_normal((count, model.numbers.size)) @ root.T
    return [model.with_numbers(draw) for draw in physical_numbers(model, draws)]


def physical_numbers(model: JointModel, numbers: Array) -> Array:
    """Return other numbers of a model, shape (..., n), with friction that does not become negative.

    Numbers of an element that are positive stay so: yield angles, times, slider stiffness.
    """
    own = model.numbers
    rubs = [term.id == "coulomb_friction" and term.coefficient >= 0 for term in model.terms]
    # No positive number of an element is drawn below this share of it.
    least = np.where(own > 0, 0.02 * own, -np.inf)
    least[: len(rubs)] = np.where(rubs, 0.0, -np.inf)
    return np.maximum(numbers, least)


def _build_formula_law(model: JointModel, terms: Sequence[ModelTerm]) -> FormulaLaw:
    from sympy import Float, Symbol

    expression = Float(0)
    values = {}
    for index, term in enumerate(terms):
        symbols = {symbol.name for symbol in term.expression.free_symbols}
        if symbols - {"theta", "omega"}:
            needed = in_words_of(model.joint.motion, "angle and rate, and inertia")
            raise InputError(
                f"term {term.id!r} ({term.formula}) depends on {', '.join(sorted(symbols - {'theta', 'omega'}))}; a "
                f"simulation needs terms of {needed}"
            )
        # Numbered symbols: a coefficient of a user's catalogue may have the name of a symbol in a formula.
        symbol = f"coefficient_{index}"
        expression += Symbol(symbol, real=True) * term.expression
        values[symbol] = term.coefficient
    law = FormulaLaw(expression, values, inertia=model.inertia)
    return replace(law, softening_limit=_find_softening_limit(law, model.fitted.angle))


def elastic_moment(law: Law, angle: ArrayLike) -> Array:
    """Return the moment at standstill, in the middle of the friction interval, N·m (N), internal states at zero."""
    return law.friction_interval(np.atleast_1d(angle), 0.0)[0]


def _find_softening_limit(law: Law, tested: float) -> tuple[float, float]:
    """Angles on either side of zero where the elastic moment first begins to fall; infinite where it never does."""
    if not tested > 0:
        return -np.inf, np.inf
    # The softening limit of a general law is searched up to this multiple of the largest angle tested.
    angle = np.linspace(0, 3.0 * tested, 3000)
    limits = []
    for side in (-1.0, 1.0):
        moment = elastic_moment(law, side * angle)
        rise = side * np.diff(moment)
        falls = np.flatnonzero(rise < -(1e-9 * float(np.abs(np.diff(moment)).max())))
        # Without a stiffness at zero nothing can soften.
        limits.append(side * float(angle[falls[0]]) if falls.size and falls[0] > 0 else side * np.inf)
    return limits[0], limits[1]


CLOCK = "clock"  # the state that gives a law the time


@dataclass(frozen=True)
class Instant:
    """When a law is asked: ``time`` s into a run that ``began`` s after the first; whether time ``runs`` on."""

    time: float = 0.0
    began: float = 0.0
    runs: bool = False

    @classmethod
    def of(cls, states: ForceStates) -> Self:
        """Return when a run's states are: what repeats is as it is in its middle, elsewhere time runs on.

        It runs from the first sample along which internal states are brought, that of the lead where there is one.
        """
        if states.method == "periodic":
            return cls(float(np.mean(states.time)), states.began)
        early = 0 if states.lead is None else states.lead[0].size
        return cls(float(states.time[0]) - early / states.sample_rate, states.began, True)


class Part(NamedTuple):
    """A form with its numbers: nonlinear parameters, and coefficients of the columns; SI."""

    form: Form
    values: Array
    coefficients: Array


def parts_of(elements: Sequence[JointElement]) -> list[Part]:
    """Return elements as parts of a law."""
    return [Part(each.form, each.values, each.coefficients) for each in elements]


def sum_law(
    parts: Sequence[Part], frequency: float = 0.0, instant: Instant | None = None
) -> FormulaLaw | None:
    """Return the sum of the moments of some parts as a law; None where nothing adds one.

    Parameters
    ----------
    parts : sequence of Part
    frequency : float
        Of the excitation, Hz.
    instant : Instant, optional
        Time that runs is a state with the rate one.
    """
    if not parts:
        return None
    from sympy import Float, Symbol

    instant = instant or Instant()
    now = {"frequency": frequency, "time": instant.time, "elapsed": instant.time + instant.began}
    expression: Any = Float(0)
    rates: dict[str, Any] = {}
    values: dict[str, float] = {}
    for index, (form, inner, coefficients) in enumerate(parts):
        names = {n: f"p{index}_{n}" for n in form.names}
        values |= {names[n]: float(v) for n, v in zip(form.names, inner, strict=True)}
        given: dict[str, Any] = {}
        used = {symbol.name for symbol in form.symbols}
        for signal in [signal for signal in TEST_SIGNALS if signal in used]:
            # It is a parameter: another frequency, or segment of a run, needs no compilation of its own.
            values[f"at_{signal}"] = now[signal]
            given[signal] = Symbol(f"at_{signal}", real=True)
            if instant.runs and signal != "frequency":
                given[signal] += Symbol(CLOCK, real=True)
                rates[CLOCK] = Float(1)
        columns, own = form.written(names | {s.name: f"state{index}_{s.name}" for s in form.states}, given)
        for place, (column, value) in enumerate(zip(columns, coefficients, strict=True)):
            values[f"c{index}_{place}"] = float(value)
            expression += Symbol(f"c{index}_{place}", real=True) * column
        rates |= own
    return FormulaLaw(expression, values, rates)


@dataclass(frozen=True, eq=False)
class LawInRun(LawWithNumbers):
    """A law whose inputs move within a run: held at their means, and what they add along the measured motion.

    Parameters
    ----------
    added : ndarray, shape (n,)
        Moment at the samples of the run's states, N·m (N).
    moves : tuple of str
        Inputs that move the law.
    """

    added: Array
    moves: tuple[str, ...]

    @classmethod
    def of(cls, held: Law, added: Array, moves: tuple[str, ...]) -> Self:
        """Return a law that is held at the means of its inputs, with what these add."""
        return cls(held, held.compiled().parameters, held.inertia, added, moves)


def with_added(law: Law | LawInRun, added: Law | None) -> Law | LawInRun:
    """Return a law with another one added, if there is one."""
    if added is None:
        return law
    if isinstance(law, LawInRun):
        return LawInRun.of(SumLaw(law.law, added), law.added, law.moves)
    return SumLaw(law, added)


def as_followed(campaign: Campaign, model: JointModel) -> Campaign:
    """Return a campaign whose inputs are as a model takes them: its references, and the lags of its joint.

    Raises
    ------
    InputError
        If the campaign has no input that the law depends on, or has it in a unit of another kind.
    """
    declared = {each.name: each for each in campaign.inputs}
    refuse(
        (
            each.name not in declared,
            f"the model depends on the input {each.name!r}, which the campaign does not have (it has "
            f"{', '.join(declared) or 'none'}); declare it in [inputs], or use the model at a value of it",
        )
        for each in model.used_inputs
    )
    pairs = [(declared[each.name], each) for each in model.used_inputs]
    refuse(
        (
            other.unit != each.unit,
            f"the input {each.name!r} is in {other.shown_unit} in the campaign and in {each.shown_unit} in the model; "
            "state in [inputs] of the campaign a unit of the model's kind",
        )
        for other, each in pairs
    )
    # One reference for the coefficients that the model has and for those that are added.
    of_model = {each.name: each.reference for each in model.inputs if each.name in declared}
    inputs = tuple(
        replace(each, reference=of_model.get(each.name, each.reference)) for each in campaign.inputs
    )
    return with_lags(replace(campaign, inputs=inputs), {each.name: each.lag for each in model.inputs})


def law_in_run(model: JointModel, states: ForceStates) -> Law | LawInRun:
    """Return the law of a model in a run.

    An input that makes the moment differ from that at its mean by less than a hundredth is held there.

    Raises
    ------
    InputError
        If the run has no value of an input on which the model depends.
    """
    used = [each.name for each in model.used_inputs]
    if not used:
        return model_law(model)
    lacking = [name for name in used if name not in states.inputs]
    if lacking:
        raise InputError(
            f"run {states.run!r} has no value of {lacking[0]!r}, on which the model depends; declare it in [inputs]"
        )
    held = model.at(**{name: float(np.mean(states.inputs[name])) for name in used})
    law = model_law(held)
    moves = tuple(name for name in used if np.ptp(states.inputs[name]) > 0)
    if not moves:
        return law
    # At standstill friction keeps the side of the motion before.
    rate = np.where(states.rate == 0, 1e-300, states.rate)
    along = model.without_elements().moment(states.angle, rate, inputs=states.inputs)
    added = along - held.without_elements().moment(states.angle, rate)
    return LawInRun.of(law, added, moves) if np.std(added) > RESPONSE.small_share * np.std(along) else law


def held_laws(model: JointModel, states: Sequence[ForceStates]) -> list[Law]:
    """Return the law of a model in each run, for simulations of which no measured motion is at hand.

    Raises
    ------
    InputError
        If an input moves the law within a run.
    """
    if not any(term.inputs for term in model.terms):
        return [model_law(model)] * len(states)
    laws = [law_in_run(model, each) for each in states]
    moved = [(law, each) for law, each in zip(laws, states, strict=True) if isinstance(law, LawInRun)]
    refuse(
        (True, f"{', '.join(law.moves)} moves the law within run {each.run!r}: it is not simulated")
        for law, each in moved
    )
    return laws
