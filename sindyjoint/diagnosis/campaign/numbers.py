"""What a diagnosis adds, sorted: terms and elements of the joint's law, nuisances of the test."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count
from typing import cast

import numpy as np

from sindyjoint.diagnosis.campaign.regression import stack
from sindyjoint.diagnosis.campaign.repair import (
    Repaired,
    all_columns,
    coefficients_of,
    scaled_covariance,
    unique_shares,
)
from sindyjoint.diagnosis.campaign.rows import GapRun
from sindyjoint.diagnosis.campaign.start import ChannelDrift
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.equation.element import Value
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import Drift, Enters, Nuisance, TestNuisances
from sindyjoint.numeric import COARSE_DIFFERENCE, Array
from sindyjoint.response.laws import with_coefficients


@dataclass(frozen=True, eq=False)
class Numbers:
    """All numbers of a repaired model together.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Coefficients of the terms, of the effects' columns, then nonlinear parameters of the effects.
    covariance : ndarray, shape (n, n)
    coefficients, inner : dict of str to slice
        Where those of an effect stand.
    """

    values: Array
    covariance: Array
    coefficients: dict[str, slice]
    inner: dict[str, slice]

    def value(self, at: int) -> tuple[float, float]:
        """Return one of them with its standard error."""
        return float(self.values[at]), float(np.sqrt(self.covariance[at, at]))


def numbers_of(repaired: Repaired, runs: Sequence[GapRun]) -> Numbers:
    """Return the numbers of a repaired model, and their covariance by linearisation at the fit.

    s²(JᵀJ)⁻¹ of whitened rows, J holding the columns and, for nonlinear parameters, their derivatives (Seber and Wild
    1989, section 2.1.2); s² is the reduced χ² where that is above one.
    """
    model, effects = repaired.model, repaired.effects
    adding = tuple(e for e in effects if not e.shifts)
    size = len(model.terms)
    at = count(size)
    columns = {e.name: _slice(at, len(e.variant.columns)) for e in adding}
    # A delay is out of the states already: its column is the derivative by what is left of it.
    columns |= {e.name: _slice(at, 1) for e in effects if e.shifts}
    inner = {e.name: _slice(at, e.values.size) for e in adding}
    shifts = [float(e.coefficients[0]) for e in effects if e.shifts]
    values = np.concatenate([coefficients_of(model, adding), shifts, *(e.values for e in adding)])
    covariance = repaired.covariance
    if covariance is None or covariance.shape[0] != values.size:
        covariance = _joint_covariance(runs, model, effects, adding)
    return Numbers(values, covariance, columns, inner)


def _slice(at: "count[int]", size: int) -> slice:
    places = [next(at) for _ in range(size)]
    return slice(places[0], places[0] + size) if places else slice(0, 0)


def _joint_covariance(
    runs: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect], adding: Sequence[FittedEffect]
) -> Array:
    shifts = [e for e in effects if e.shifts]
    whole = stack(runs, lambda run: number_columns(run, model, adding, shifts))
    target = np.concatenate([run.white(run.target) for run in runs])
    linear = coefficients_of(model, adding)
    residual = target - whole[:, : linear.size] @ linear
    return scaled_covariance(whole, residual)


def number_columns(
    run: GapRun, model: JointModel, adding: Sequence[FittedEffect], shifts: Sequence[FittedEffect] = ()
) -> Array:
    """Return the derivatives of a run's moment by all numbers: columns, delays, then nonlinear parameters."""
    parts = [all_columns(run, model, adding)]
    parts += [e.variant.along(run.motion, e.values) for e in shifts]
    for each in adding:
        for k in range(each.values.size):
            parts.append(_slope_by(run, each, k)[:, None])
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
    shares = unique_shares(runs, model, [e for e in effects if not e.shifts])
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
        if each.is_term:
            for k, at in enumerate(_indices(numbers.coefficients[each.name])):
                parts.setdefault(each.name if k == 0 else f"{each.name}_{k + 1}", []).append(at)
    places = [
        place[e.name]
        for e in repaired.effects
        if is_element(e)
        for place in (numbers.coefficients, numbers.inner)
    ]
    return [*parts.values(), *([at] for place in places for at in _indices(place))]


def with_numbers(repaired: Repaired, values: Array, covariance: Array) -> Repaired:
    """Return a repaired model with other numbers, in the order of :func:`numbers_of`; delays stay as they are."""
    size = len(repaired.model.terms)
    adding = [e for e in repaired.effects if not e.shifts]
    at = size
    places = {}
    for each in adding:
        places[each.name] = slice(at, at + len(each.variant.columns))
        at += len(each.variant.columns)
    at += len(repaired.effects) - len(adding)
    later = []
    for each in repaired.effects:
        if not each.shifts:
            inner = slice(at, at + each.values.size)
            at = inner.stop
            each = replace(each, coefficients=values[places[each.name]], values=values[inner])
        later.append(each)
    model = with_coefficients(repaired.model, values[:size], covariance[:size, :size])
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
            number = blank.renewed(*numbers.value(numbers.coefficients[each.name].start))
            found.append(Nuisance(each.name, cast(Enters, enters), number))
        elif not each.is_term and not is_element(each):
            places = (numbers.coefficients[each.name], numbers.inner[each.name])
            sure = [numbers.value(at) for place in places for at in _indices(place)]
            moments.append(each.element(motion).with_numbers(sure))
    return TestNuisances(
        campaign="",
        nuisances=tuple(found),
        drift=None if drift is None else Drift(drift.effect, dict(drift.slopes)),
        moments=tuple(moments),
    )


def _indices(places: slice) -> range:
    return range(places.start, places.stop)
