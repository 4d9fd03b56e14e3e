"""Output-error refinement: numbers of a model that make the simulated response, not the moment, fit best."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from sindyjoint.equation.element import JointElement
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.errors import InputError, SimulationError, UnknownNameError
from sindyjoint.limits import RESPONSE
from sindyjoint.numeric import Array, rms, scaled_least_squares
from sindyjoint.record import Campaign, Run
from sindyjoint.response import law_of_test, predicts_worse
from sindyjoint.response.drive import cycle_of
from sindyjoint.response.output_error import ROUGH_STEP, OutputError, without_negative_friction
from sindyjoint.response.output_error_runs import NUISANCE, Nuisance, Parameter, range_of, term_columns
from sindyjoint.response.run import along_motion, followed_motion
from sindyjoint.states import ForceStates, campaign_states

MOST_EVALUATIONS, FEW_EVALUATIONS = 40, 8
# Share of a sum of squares; a fit ends where a step lowers it by less.
FINELY, ROUGHLY = 1e-7, 1e-2
# Steps of the integrator in a run where laws are compared: slow cycles of a stiff joint take more.
QUICKLY = 100_000
# Samples of all runs up to which a response is fitted without being asked for.
SIMULATED = 50_000


@dataclass(frozen=True, eq=False)
class Refinement:
    """The result of :func:`refine`.

    Parameters
    ----------
    model : JointModel
        With refined numbers of terms and elements and their covariance; the given one if the refinement did not
        succeed.
    refined : bool
    reason : str
        One sentence.
    before, after : dict of str to float
        Response NRMSE of each run.
    nuisance : dict of str to (float, float)
        Value and standard error of delay (s), gain and offset, as asked for.
    undetermined : tuple of str
        Directions that the runs do not determine, in words.
    residual : ndarray
        Of the responses of all runs, in units of noise; empty if the refinement did not succeed.
    """

    model: JointModel
    refined: bool
    reason: str
    before: dict[str, float]
    after: dict[str, float]
    nuisance: dict[str, tuple[float, float]]
    undetermined: tuple[str, ...]
    residual: Array = field(default_factory=lambda: np.empty(0))

    @property
    def misfit(self) -> float:
        """Sum of squares of the residual."""
        return float(self.residual @ self.residual)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes reported with the model."""
        values = [
            f"{name} {value:.4g} ± {error:.2g}{NUISANCE[name][1]}"  # type: ignore[index]
            for name, (value, error) in self.nuisance.items()
        ]
        return (self.reason, *([f"estimated together with the coefficients: {', '.join(values)}"] if values else []),
                *self.undetermined)  # fmt: skip


def refine(
    model: JointModel,
    campaign: Campaign,
    *,
    states: Sequence[ForceStates] | None = None,
    nuisance: Sequence[Nuisance] = (),
    test: TestNuisances | None = None,
    window: float | None = None,
    progress: Callable[[str], None] | None = None,
) -> Refinement:
    """Refine the numbers of a model's terms and elements by bounded least squares on the simulated response.

    The runs that may be used for identification are simulated (see
    :func:`~sindyjoint.response.run.choose_drive`) and compared with the measured response in units of its
    noise. Initial angle and rate of each run that does not repeat are estimated, too, and where a joint without
    restoring moment is simulated by multiple shooting, those of every segment. Where the motion was prescribed it is
    the drive, and the moment the response. A model with elements is fitted from two more starts, see
    :func:`spread_starts`; the best end is used. Where it predicts the runs kept for
    validation worse than the model as it was, that is kept.

    Parameters
    ----------
    model : JointModel
    campaign : Campaign
    states : sequence of ForceStates, optional
        Of the identification runs.
    nuisance : sequence of {"delay", "gain", "offset"}
        What to estimate with the coefficients: the time by which the moment lags the response, s; the factor by which
        the response channel reads too high; its zero error, rad (m).
    test : TestNuisances, optional
        Moments and error of the inertia of this test; ``campaign`` and ``states`` have its channels put right already.
    window : float, optional
        Length of a multiple-shooting segment, s, for joints without a restoring moment. Default: a mean cycle of the
        motion, at least 1 s.
    progress : callable, optional

    Returns
    -------
    Refinement

    Raises
    ------
    InputError, UnknownNameError
        For a model without terms and elements or an unknown nuisance parameter.
    """
    unknown = [name for name in nuisance if name not in NUISANCE]
    if unknown:
        raise UnknownNameError(
            f"nuisance parameter {unknown[0]!r} is not known; expected one of {', '.join(NUISANCE)}"
        )
    if not (model.terms or model.elements):
        raise InputError("the model has no terms: there is nothing to refine; run discover first")
    if campaign.quasi_static:
        reason = "not refined: the samples have no time, so that no response can be simulated"
        return Refinement(model, False, reason, {}, {}, {}, ())
    states = campaign_states(campaign) if states is None else states
    kinds = tuple(dict.fromkeys(nuisance))
    pairs = list(zip(campaign.identification_runs, states, strict=True))

    def problem_of(pairs: Sequence[tuple[Run, ForceStates]]) -> OutputError:
        return OutputError.of(model, [r for r, _ in pairs], [s for _, s in pairs], kinds, window, test)

    try:
        problem = problem_of(pairs)
        failing = problem.failing_runs()
        pairs = [(run, state) for run, state in pairs if run.name not in failing]
        problem = problem_of(pairs) if failing and pairs else problem
    except SimulationError as error:
        return Refinement(model, False, f"not refined: {error}", {}, {}, {}, ())
    left_out = [f"{name} ({why})" for name, why in failing.items()]
    if not pairs:
        return Refinement(model, False, f"not refined: {'; '.join(left_out)}", {}, {}, {}, ())
    start = problem.table[0]
    before = problem.nrmse(start)
    if progress is not None:
        progress("fitting the simulated response")
    starts = [start, *(problem.start_of(other) for other in spread_starts(problem.model, states))]
    if problem.goes_on_alone:
        starts.insert(0, _grown(problem, pairs, problem_of))
    refined = _summarise_refinement(model, problem, _best_end(problem, starts), before, left_out)
    # An error of a channel is of all runs: where one is estimated, those kept out are not comparable without it.
    worse = (
        ""
        if kinds
        else predicts_worse(problem.model, refined.model, campaign, test or TestNuisances(""), window)
    )
    if worse:
        reason = f"not refined: {worse}; the model lacks something that its numbers cannot stand in for"
        return Refinement(model, False, reason, before, {}, {}, ())
    return replace(refined, model=_update_residual(_without_stale(model, refined.model), states, test))


def told_by_response(states: Sequence[ForceStates]) -> bool:
    """Return whether the numbers of a law that leaves noise alone are better fitted to the simulated response.

    Where no run repeats, noise of force states is correlated from sample to sample, that of an angle with its rate and
    acceleration, and a regression on few samples knows less than it says. The response is compared with the angle as
    it was measured. So many samples that they are not simulated in some seconds know enough of their states.
    """
    repeats = any(state.method != "broadband" or state.repeated for state in states)
    return not repeats and sum(state.n_samples for state in states) <= SIMULATED


def fit_nearby(
    model: JointModel,
    runs: Sequence[Run],
    states: Sequence[ForceStates],
    start: Array | None = None,
    least: float = ROUGHLY,
) -> tuple[float, Array]:
    """Return what a few steps of a fit leave of the responses, a sum of squares in units of noise, and where they end.

    They begin at ``start``, where an earlier call ended (default: at the model's numbers), and end where one wins
    less than the share ``least``. What a measured state starts is a tenth of the noise off the steady motion after a
    period: enough to compare laws, not for their numbers. Infinite where a run takes too many steps.
    """
    problem = replace(OutputError.of(model, runs, states, (), None, settled=1), most_steps=QUICKLY)
    if problem.failing_runs():
        return np.inf, problem.table[0]
    end, cost = _fit(problem, problem.table[0] if start is None else start, FEW_EVALUATIONS, least)
    return 2 * cost, end


def _grown(
    problem: OutputError,
    pairs: Sequence[tuple[Run, ForceStates]],
    problem_of: Callable[[Sequence[tuple[Run, ForceStates]]], OutputError],
) -> Array:
    """Return parameters fitted to the first cycles of runs that nothing drives, to twice as many, and so on.

    Over many cycles a wrong period has optima of its own, in which the phase is off by whole ones.
    """
    # A free motion is fitted to its first two cycles first.
    x, cycles = problem.table[0], 2
    lengths = [state.n_samples / state.sample_rate / cycle_of(state) for _, state in pairs]
    while cycles < max(lengths):
        ends = [(run, s.part(0.0, min(cycles / n, 1.0))) for (run, s), n in zip(pairs, lengths, strict=True)]
        x = _fit(problem_of(ends), x, FEW_EVALUATIONS, ROUGHLY)[0]
        cycles *= 2
    return x


def _best_end(problem: OutputError, starts: Sequence[Array]) -> Array:
    """Return the parameters of the best end over all starts; after the first those are followed that come near it.

    One is lower by more than ``significant`` standard errors of one number more.
    """
    best, least = _fit(problem, starts[0], MOST_EVALUATIONS)
    lower = 1 - RESPONSE.significant**2 / problem.residual(best).size
    for other in starts[1:]:
        # After a few evaluations another start is followed or left.
        trial, cost = _fit(problem, other, FEW_EVALUATIONS)
        apart = np.abs((trial - best) / problem.table[1])[: problem.n_shared].max()
        # Two ends whose numbers differ by less than this share of their scales are one.
        if cost > (1 + RESPONSE.large_part) * least or (apart < 0.02 and cost >= lower * least):
            continue
        end, cost = _fit(problem, trial, MOST_EVALUATIONS)
        if cost < lower * least:
            best, least = end, cost
    return best


def _fit(problem: OutputError, start: Array, most: int, least: float = FINELY) -> tuple[Array, float]:
    """Fit from one start, with at most so many evaluations; return the parameters and half the sum of squares.

    A rough sum of squares is fitted over a coarse step, and from where that ends over a finer one.
    """
    end = _descend(problem, start, most, ROUGH_STEP, least)
    ends = [end, _descend(problem, end[0], most, 0.3 * ROUGH_STEP, least)] if problem.rough else [end]
    return min(ends, key=lambda each: each[1])


def _descend(problem: OutputError, start: Array, most: int, step: float, least: float) -> tuple[Array, float]:
    _, scale, low, high = problem.table
    solution = scipy.optimize.least_squares(
        lambda x: problem.residual(x * scale),
        np.clip(start, low, high) / scale,
        lambda x: problem.jacobian(x * scale, step) * scale,
        bounds=(low / scale, high / scale),
        method="trf",
        x_scale=1.0,
        ftol=least,
        xtol=1e-6,
        gtol=1e-8,
        max_nfev=most,
    )
    return solution.x * scale, float(solution.cost)


def _summarise_refinement(
    model: JointModel,
    problem: OutputError,
    found: Array,
    before: dict[str, float],
    left_out: Sequence[str],
) -> Refinement:
    """Return what a fit came to; residual and shares of the model are those before."""
    after = problem.nrmse(found)
    lasting = problem.parameters[: problem.n_shared]
    scale = problem.table[1][: problem.n_shared]
    physical = problem.covariance(found)
    covariance = physical / np.outer(scale, scale)
    errors = np.sqrt(np.diag(physical))
    indices = problem.number_indices
    new = model.with_numbers(found[indices], physical[np.ix_(indices, indices)])
    values = {
        parameter.name: (float(found[i]), float(errors[i]))
        for i, parameter in enumerate(lasting)
        if parameter.kind == "nuisance"
    }
    at_bound = [
        parameter.name
        for parameter, value in zip(lasting, found, strict=False)
        if min(value - parameter.low, parameter.high - value) <= 1e-6 * parameter.scale
        and not (parameter.name == "coulomb_friction" and value < 1e-6 * parameter.scale)
    ]
    count = len(problem.runs)
    what = "coefficients and elements" if model.elements else "coefficients"
    reason = (
        f"{what} refined on the simulated response of {count} run(s): NRMSE "
        f"{100 * rms(list(before.values())):.3f} % before, {100 * rms(list(after.values())):.3f} % after"
    )
    negative = without_negative_friction(model) is not model
    said = [
        (negative, "negative Coulomb friction, which cannot be simulated, was started from zero"),
        (at_bound, f"at the end of the range searched: {', '.join(at_bound)}"),
        (
            left_out,
            f"left out, since the model to start from does not reach their end: {'; '.join(left_out)}",
        ),
    ]
    return Refinement(
        model=new,
        refined=True,
        reason="; ".join([reason, *(words for there, words in said if there)]),
        before=before,
        after=after,
        nuisance=values,
        undetermined=undetermined_directions(lasting, covariance),
        residual=problem.residual(found),
    )


def _without_stale(before: JointModel, after: JointModel) -> JointModel:
    """Return a refined model whose terms have the share of the moment that goes with their new coefficients."""
    terms = tuple(
        replace(new, unique_share=old.unique_share * abs(new.coefficient / old.coefficient))
        if old.coefficient
        else new
        for old, new in zip(before.terms, after.terms, strict=True)
    )
    return replace(after, terms=terms)


def _update_residual(
    model: JointModel, states: Sequence[ForceStates], test: TestNuisances | None
) -> JointModel:
    """Return the model with the residual of the moment under its new numbers."""
    test = test or TestNuisances("")
    moments = [along_motion(law_of_test(test, model, s), s, s.sample_rate)[0] for s in states]
    residuals = [(s.moment - moment)[s.moving] for s, moment in zip(states, moments, strict=True)]
    return replace(model, fitted=replace(model.fitted, residual_rms=rms(np.concatenate(residuals))))


def undetermined_directions(parameters: Sequence[Parameter], covariance: Array) -> tuple[str, ...]:
    """Name the combinations of parameters that the runs do not determine.

    Parameters
    ----------
    parameters : sequence of Parameter
    covariance : ndarray, shape (p, p)
        In units of the parameters' scales.
    """
    variances, directions = np.linalg.eigh(covariance)
    entangled = (
        np.sqrt(np.diag(covariance) * np.diag(np.linalg.pinv(covariance, hermitian=True)))
        > RESPONSE.many_times
    )
    sentences = []
    for variance, direction in zip(variances[::-1], directions.T[::-1], strict=True):
        size = float(np.sqrt(variance))
        order = np.argsort(-np.abs(direction))
        named = [parameters[i].name for i in order if abs(direction[i]) >= RESPONSE.large_part]
        single = len(named) == 1
        seen = RESPONSE.reach / (1 if single else RESPONSE.many_times)
        if size <= seen or not (single or entangled[order[1]]):
            continue
        sentences.append(
            f"{named[0]} is not determined by these runs: its standard error is {100 * size:.0f} % of it"
            if single
            else f"{', '.join(named[:-1])} and {named[-1]} are not determined one by one: they can change together, by "
            f"{100 * size:.0f} % of their sizes, without a visible change of the response"
        )
    return tuple(sentences)


def spread_starts(model: JointModel, states: Sequence[ForceStates]) -> list[JointModel]:
    """Return a model with the nonlinear parameters of its elements larger and smaller by turns, and the opposite.

    The response has several minima over these: a gap that is too small and a ramp that is too long fit each other.
    Coefficients are those of least squares on the moment along the measured motion. None for a model without nonlinear
    parameters; a start whose elements would have to push the other way is left out.
    """
    inner = [(i, number.name) for i, each in enumerate(model.elements) for number in each.parameters]
    starts = []
    for turn in (1, -1) if inner else ():
        signs = {key: turn * (-1) ** place for place, key in enumerate(inner)}
        elements = [_spread(each, i, signs) for i, each in enumerate(model.elements)]
        starts.append(_fitted(model, elements, states))
    return [start for start in starts if start is not None]


def _spread(element: JointElement, index: int, signs: dict[tuple[int, str], int]) -> JointElement:
    numbers = [(number.value, number.standard_error) for number in element.numbers]
    for place, number in enumerate(element.parameters, len(element.columns)):
        factor = range_of(element, number) ** (signs[index, number.name] / 3)
        numbers[place] = number.value * factor, number.standard_error
    return element.with_numbers(numbers)


def _fitted(
    model: JointModel, elements: Sequence[JointElement], states: Sequence[ForceStates]
) -> JointModel | None:
    """Return the model with these elements, all coefficients fitted to the moment of moving samples."""
    columns, targets = [], []
    for state in states:
        inner = [each.columns_along(*followed_motion(state), 1 / state.sample_rate) for each in elements]
        columns.append(np.hstack([term_columns(model, model.terms, state), *inner])[state.moving])
        targets.append(state.transfer_moment(model.joint.inertia or 0.0)[state.moving])
    matrix = np.vstack(columns)
    if not np.isfinite(matrix).all() or not np.any(matrix, axis=0).all():
        return None
    rest = iter(scaled_least_squares(matrix, np.concatenate(targets)))
    numbers = [next(rest) for _ in model.terms]
    for before, each in zip(model.elements, elements, strict=True):
        own = np.array([next(rest) for _ in each.columns])
        if np.any(own * before.coefficients < 0):
            return None
        numbers += [*own, *each.values]
    return model.with_numbers(numbers)
