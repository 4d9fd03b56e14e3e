"""What a diagnosis adds, sorted: terms and elements of the joint's law, nuisances of the test."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from sindyjoint.diagnosis.campaign import GapRun
from sindyjoint.diagnosis.campaign.gap_rows import base_columns
from sindyjoint.diagnosis.campaign.regression import stack
from sindyjoint.diagnosis.campaign.repair import Repaired, modelled, scaled_covariance, unique_shares
from sindyjoint.diagnosis.campaign.start import ChannelDrift
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.element import Value
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import Enters, Nuisance, TestNuisances
from sindyjoint.numeric import COARSE_DIFFERENCE, Array
from sindyjoint.response.laws import with_coefficients


@dataclass(frozen=True, eq=False)
class Numbers:
    """All numbers of a repaired model together.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Coefficients of the terms, then of each effect the coefficients and the nonlinear parameters.
    covariance : ndarray, shape (n, n)
    places : dict of str to range
        Where those of an effect stand.
    """

    values: Array
    covariance: Array
    places: dict[str, range]

    def value(self, at: int) -> tuple[float, float]:
        """Return one of them with its standard error."""
        return float(self.values[at]), float(np.sqrt(self.covariance[at, at]))


def numbers_of(repaired: Repaired, runs: Sequence[GapRun]) -> Numbers:
    """Return the numbers of a repaired model, and their covariance by linearisation at the fit.

    s²(JᵀJ)⁻¹ of whitened rows, J holding the columns and, for nonlinear parameters, their derivatives (Seber and Wild
    1989, section 2.1.2); s² is the reduced χ² where that is above one.
    """
    model, effects = repaired.model, repaired.effects
    values = np.concatenate([model.coefficients, *(each.numbers for each in effects)])
    ends = np.cumsum([len(model.terms), *(each.numbers.size for each in effects)])
    places = {e.name: range(a, b) for e, a, b in zip(effects, ends[:-1], ends[1:], strict=True)}
    covariance = repaired.covariance
    if covariance is None or covariance.shape[0] != values.size:
        columns = stack(runs, lambda run: number_columns(run, model, effects))
        residual = [run.white(run.target - modelled(run, model, effects)) for run in runs]
        covariance = scaled_covariance(columns, np.concatenate(residual))
    return Numbers(values, covariance, places)


def number_columns(run: GapRun, model: JointModel, effects: Sequence[FittedEffect]) -> Array:
    """Return the derivatives of a run's moment by all numbers, in their order.

    A delay is out of the states already: its column is the derivative by what is left of it.
    """
    parts = [base_columns(model, run)]
    for each in effects:
        parts.append(each.variant.along(run.motion, each.values))
        parts += [_slope_by(run, each, k)[:, None] for k in range(each.values.size)]
    return np.hstack(parts)


def _slope_by(run: GapRun, effect: FittedEffect, k: int) -> Array:
    """Return the derivative of an effect's moment by a nonlinear parameter.

    At the edge of its range the law may not exist on one side: the difference is then taken on the other.
    """
    step = np.zeros(effect.values.size)
    step[k] = COARSE_DIFFERENCE * effect.values[k]
    sides = {}
    for sign in (-1, 0, 1):
        moment = effect.variant.along(run.motion, effect.values + sign * step) @ effect.coefficients
        if np.isfinite(moment).all():
            sides[sign] = moment
    low, high = min(sides), max(sides)
    return np.asarray((sides[high] - sides[low]) / ((high - low) * step[k]), dtype=np.float64)


def whole_model(repaired: Repaired, runs: Sequence[GapRun]) -> JointModel:
    """Return the model with what the effects add to the joint's law: terms of angle and rate, and elements.

    An effect that the model has a term of is added to that term.
    """
    model, effects = repaired.model, repaired.effects
    numbers = numbers_of(repaired, runs)
    motion = model.joint.motion
    terms = {term.id: term for term in model.terms}
    for each in effects:
        if not each.is_term:
            continue
        for new in each.terms(motion):
            terms.setdefault(new.id, new)
    parts = _parts_of_whole(repaired, numbers)
    adding = [each for each in effects if not each.shifts]
    columns = [*range(len(model.terms))]
    for each in adding:
        columns += numbers.places[each.name][: each.coefficients.size]
    shares = dict(zip(columns, unique_shares(runs, model, adding), strict=True))
    known = tuple(
        replace(term, unique_share=float(shares[part[0]]))
        for term, part in zip(terms.values(), parts, strict=False)
    )
    elements = tuple(each.element(motion) for each in effects if is_element(each))
    sums = np.array([np.isin(np.arange(numbers.values.size), part) for part in parts], dtype=np.float64)
    whole = replace(model, terms=known, elements=elements, covariance=())
    return whole.with_numbers(sums @ numbers.values, sums @ numbers.covariance @ sums.T)


def from_whole(repaired: Repaired, runs: Sequence[GapRun], whole: JointModel) -> Repaired:
    """Return a repaired model of which a model with other numbers is the :func:`whole_model`.

    What is new in a sum goes to its first part; numbers of the test stay as they are.
    """
    numbers = numbers_of(repaired, runs)
    parts = _parts_of_whole(repaired, numbers)
    values, covariance = numbers.values.copy(), numbers.covariance.copy()
    first = [part[0] for part in parts]
    values[first] += whole.numbers - [values[part].sum() for part in parts]
    touched = [at for part in parts for at in part]
    covariance[touched, :] = covariance[:, touched] = 0.0
    covariance[np.ix_(first, first)] = np.array(whole.covariance)
    return with_numbers(repaired, values, covariance)


def _parts_of_whole(repaired: Repaired, numbers: Numbers) -> list[list[int]]:
    """Return which numbers each number of the whole model is the sum of: its terms, then its elements."""
    parts = {term.id: [i] for i, term in enumerate(repaired.model.terms)}
    for each in repaired.effects:
        for k, at in enumerate(numbers.places[each.name][: each.coefficients.size] if each.is_term else ()):
            parts.setdefault(each.name if k == 0 else f"{each.name}_{k + 1}", []).append(at)
    elements = (each for each in repaired.effects if is_element(each))
    return [*parts.values(), *([at] for each in elements for at in numbers.places[each.name])]


def with_numbers(repaired: Repaired, values: Array, covariance: Array) -> Repaired:
    """Return a repaired model with other numbers, in the order of :class:`Numbers`; delays stay as they are."""
    sizes = [len(repaired.model.terms), *(each.numbers.size for each in repaired.effects)]
    own, *parts = np.split(values, np.cumsum(sizes)[:-1])
    later = []
    for each, part in zip(repaired.effects, parts, strict=True):
        coefficients, inner = np.split(part, [each.coefficients.size])
        later.append(each if each.shifts else replace(each, coefficients=coefficients, values=inner))
    model = with_coefficients(repaired.model, own, covariance[: own.size, : own.size])
    return replace(repaired, model=model, effects=tuple(later), covariance=covariance)


def is_element(effect: FittedEffect) -> bool:
    """Return whether an effect is a part of the joint's law that has a memory."""
    return effect.effect.enters == "moment" and bool(effect.variant.states) and not _of_test(effect)


def _of_test(effect: FittedEffect) -> bool:
    """Return whether an effect depends on time or frequency, which are the test's."""
    names = {symbol.name for symbol in effect.variant.symbols}
    known = {"theta", "omega", *effect.variant.names, *(state.name for state in effect.variant.states)}
    return bool(names - known)


def nuisances_of(
    repaired: Repaired,
    runs: Sequence[GapRun],
    drift: ChannelDrift | None,
    motion: str,
    zero: tuple[float, float] = (0.0, 0.0),
) -> TestNuisances:
    """Return what belongs to the test among the effects, without the hash of its campaign.

    Displacements are counted from ``zero``, given with its standard error, already: that is a zero error of the
    channel, too.
    """
    numbers = numbers_of(repaired, runs)
    found, moments = [], []
    if zero[0]:
        blank = Value("theta_0", 0.0, 0.0, (0.0, 0.0), "rad" if motion == "rotation" else "m")
        found.append(Nuisance("angle_offset", "angle zero", blank.renewed(*zero)))
    for each in repaired.effects:
        enters = "inertia" if each.name == "inertia_error" else each.effect.enters
        if enters != "moment":
            symbol = each.variant.columns[0].symbol
            blank = Value(symbol, 0.0, 0.0, (0.0, 0.0), each.variant.units(motion)[symbol])
            number = blank.renewed(*numbers.value(numbers.places[each.name][0]))
            found.append(Nuisance(each.name, cast(Enters, enters), number))
        elif not each.is_term and not is_element(each):
            sure = [numbers.value(at) for at in numbers.places[each.name]]
            moments.append(each.element(motion).with_numbers(sure))
    return TestNuisances(
        campaign="",
        nuisances=tuple(found),
        drift=None if drift is None else drift.drift,
        moments=tuple(moments),
    )
