"""What is known before a plan is made: ranges of the joint, how far it was tested, what runs have told."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from math import inf

import numpy as np

from sindyjoint.discovery import Evidence, block_scores
from sindyjoint.equation.catalogue import load_catalogue
from sindyjoint.equation.model import INERTIA, Fitted, JointModel, model_terms
from sindyjoint.errors import InputError, SindyJointError, UnknownNameError
from sindyjoint.limits import PLANNING
from sindyjoint.mechanics import PaperLaw
from sindyjoint.mechanics.excitation import Actuator, Drive
from sindyjoint.numeric import Array
from sindyjoint.paper import PARAMETERS
from sindyjoint.planning.information import Information, Sensors, stacked
from sindyjoint.record import Campaign, Joint
from sindyjoint.response.laws import with_coefficients
from sindyjoint.states import ForceStates, force_states
from sindyjoint.text import spelled


@dataclass(frozen=True, eq=False)
class JointRange:
    """A joint whose coefficients lie in ranges.

    Parameters
    ----------
    model : JointModel
        Its terms and inertia; the coefficients are those in the middle. Elements with a memory, where it has some, are
        the same in every joint of the range.
    low, high : ndarray, shape (p,)
        Ends of the range of each coefficient, in the order of the terms, SI.
    """

    model: JointModel
    low: Array
    high: Array

    def draws(self, count: int, random_state: int | np.random.Generator = 0) -> list[JointModel]:
        """Return joints of the range, spread evenly over every coefficient (a Latin hypercube)."""
        rng = np.random.default_rng(random_state)
        strata = np.array([rng.permutation(count) for _ in self.low]).T
        share = (strata + rng.random(strata.shape)) / count
        return [with_coefficients(self.model, row) for row in self.low + share * (self.high - self.low)]

    def corners(self) -> list[JointModel]:
        """Return the joints at the ends of all ranges; of many coefficients some of the combinations."""
        wide = np.flatnonzero(self.high > self.low)
        most = 64
        if 2**wide.size <= most:
            choices = np.array(list(product((0.0, 1.0), repeat=int(wide.size)))).reshape(-1, wide.size)
        else:
            choices = np.random.default_rng(0).integers(0, 2, (most, wide.size)).astype(float)
        corners = np.tile(self.low, (len(choices), 1))
        corners[:, wide] += choices * (self.high - self.low)[wide]
        return [with_coefficients(self.model, row) for row in np.unique(corners, axis=0)]

    def narrowed(self, ranges: Mapping[str, tuple[float, float]]) -> "JointRange":
        """Return the same joint with some of its coefficients in other ranges.

        Raises
        ------
        UnknownNameError
            For a term that the joint does not have.
        InputError
            For a range whose ends are not finite and ascending.
        """
        low, high = self.low.copy(), self.high.copy()
        for name, (least, most) in ranges.items():
            if name not in self.model:
                known = ", ".join(self.model.ids)
                raise UnknownNameError(f"range of {name!r}: the joint has no such term; it has {known}")
            if not (np.isfinite(least) and np.isfinite(most) and least <= most):
                raise InputError(
                    f"range of {name}: {least:g} to {most:g}; expected two ascending finite numbers"
                )
            at = self.model.ids.index(name)
            low[at], high[at] = least, most
        return JointRange(with_coefficients(self.model, (low + high) / 2), low, high)


def like_law(law: PaperLaw) -> JointRange:
    """Return the range of joints like one of the paper's: every coefficient within a share of its own."""
    catalogue = load_catalogue("paper").select(list(PARAMETERS))
    values = np.array([getattr(law, symbol) for symbol in PARAMETERS.values()])
    resolved = list(catalogue.resolve())
    order = [list(PARAMETERS).index(term.id) for term in resolved]
    zero = np.zeros(len(order))
    terms = model_terms(resolved, values[order], np.diag(zero), zero + np.nan, 1, "rotation")
    fitted = Fitted(1.0, 0.0, 0.0, 1.0, 0, 0, min(law.softening_angle, 1.0), 1.0)
    model = JointModel(Joint(law.name, inertia=law.inertia), terms, (), fitted)
    half = PLANNING.large_part * np.abs(model.coefficients)
    return JointRange(model, model.coefficients - half, model.coefficients + half)


def like_model(model: JointModel) -> JointRange:
    """Return the range of a model: every coefficient within some of its standard errors.

    Raises
    ------
    InputError
        For a model without terms.
    """
    if not model.terms:
        raise InputError("the model has no terms; a plan is made for terms of angle and rate")
    half = PLANNING.significant * model.standard_errors
    low, high = model.coefficients - half, model.coefficients + half
    for index, term in enumerate(model.terms):
        if (term.family == "friction" or term.id == INERTIA) and term.coefficient > 0:
            # Without inertia a joint under a moment does not move as a body.
            low[index] = max(low[index], 0.1 * term.coefficient if term.id == INERTIA else 0.0)
    return JointRange(replace(model, covariance=()), low, high)


@dataclass(frozen=True)
class Tested:
    """What runs have reached, beyond which nothing is known of a joint.

    Parameters
    ----------
    largest : mapping of str to float
        Largest ``"moment"``, ``"angle"`` and ``"rate"``, SI, where known.
    band : (float, float) or None
        Hz; ``None`` where no run repeats.
    """

    largest: Mapping[str, float]
    band: tuple[float, float] | None

    def actuator(
        self, drive: Drive, band: tuple[float, float] | None, limits: Mapping[str, float]
    ) -> Actuator:
        """Return what stays within, unless limits are given.

        Moment, angle and rate are those of one motion: a limit of one that was not tested so far lets all three go.

        Raises
        ------
        InputError
            Where no frequency was tested and no band is given.
        """
        band = band or self.band
        if band is None:
            raise InputError(
                "no run that was tested has a frequency; give the band of the runs to be planned"
            )
        kept = all(value <= self.largest.get(name, 0.0) for name, value in limits.items())
        return Actuator(drive, band, **{**(self.largest if kept else {}), **limits})

    def beyond(self, reached: Mapping[str, float], frequencies: Sequence[float], units: Sequence[str]) -> str:
        """Return by how much planned runs leave it, in words; empty where they do not."""
        tested = {name: value for name, value in self.largest.items() if name in reached}
        found = [
            f"{name} up to {reached[name]:.3g} {unit} where {tested[name]:.3g} was tested "
            f"({reached[name] / tested[name]:.2g} times)"
            for name, unit in zip(("moment", "angle", "rate"), units, strict=True)
            if reached[name] > tested.get(name, inf)
        ]
        low, high = self.band or (0.0, inf)
        # That of a tested run is refined from its data, by less than one in a hundred.
        away = sorted(f for f in {*frequencies} if not 0.99 * low <= f <= 1.01 * high)
        if away:
            found.append(
                f"{', '.join(f'{f:g}' for f in away)} Hz where {low:.3g} to {high:.3g} Hz were tested"
            )
        return "; ".join(found)


def tested_by(campaign: Campaign) -> Tested:
    """Return what the runs of a campaign have reached."""
    states = []
    for run in campaign.runs:
        # A run without states shows nothing; that it has none is said by the check of the data.
        with suppress(SindyJointError):
            states.append(force_states(run))
    timed = not campaign.quasi_static
    # The largest of n samples of noise is not the joint's.
    beyond = [s.noise.moment * float(np.sqrt(2 * np.log(s.moment.size))) for s in states]
    largest = {
        "moment": [float(np.abs(s.moment).max()) - n for s, n in zip(states, beyond, strict=True)],
        "angle": [float(np.abs(s.angle).max()) for s in states],
        "rate": [float(np.abs(s.rate).max()) * timed for s in states],
    }
    return _tested(
        {name: max(values, default=0.0) for name, values in largest.items()},
        [s.frequency for s in states if s.frequency],
    )


def _tested(largest: Mapping[str, float], frequencies: Sequence[float]) -> Tested:
    band = (min(frequencies), max(frequencies)) if frequencies else None
    return Tested({name: value for name, value in largest.items() if value > 0}, band)


def tested_of(model: JointModel) -> Tested | None:
    """Return to what a model was tested; nothing of one that was fitted to no data."""
    fitted = model.fitted
    largest = {"angle": fitted.angle, "rate": fitted.rate}
    return _tested(largest, fitted.frequencies) if fitted.samples else None


@dataclass(frozen=True, eq=False)
class Prior:
    """What is known before the plan.

    Parameters
    ----------
    joint : JointRange
    information : Information, optional
        Of the runs that were made, with axis (runs,).
    runs : tuple of (float, float)
        Frequency and swing of the angle of each, Hz and rad.
    seconds : float
        Duration of these runs.
    model : JointModel, optional
        That was found in them.
    ids : tuple of str
        Terms that the joint was said to have; default: all of the range's.
    notes : tuple of str
    tested : Tested, optional
        What the joint was tested to.
    """

    joint: JointRange
    information: Information | None = None
    runs: tuple[tuple[float, float], ...] = ()
    seconds: float = 0.0
    model: JointModel | None = None
    ids: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    tested: Tested | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "ids", self.ids or self.joint.model.ids)

    def expanded(self, joints: int) -> Information | None:
        """Return the information of the made runs for as many joints."""
        if self.information is None:
            return None
        return Information.of(
            lambda each: np.repeat(each[:, None], joints, axis=1).astype(float), self.information
        )

    def half_widths(self) -> Array:
        """Return the half-widths of the 95 % intervals that the runs made so far have given; infinite without any."""
        terms = self.joint.model.terms
        if self.model is None:
            return np.full(len(terms), np.inf)
        return np.array([(term.interval95[1] - term.interval95[0]) / 2 for term in self.model.terms])


def prior_of_runs(
    model: JointModel,
    evidence: Evidence,
    states: Sequence[ForceStates],
    seconds: float,
    before: JointRange | None = None,
) -> Prior:
    """Return the information of runs on the terms of a model that was found in them.

    Parameters
    ----------
    model : JointModel
    evidence : Evidence
        Of the runs, for these terms among others.
    states : sequence of ForceStates
    seconds : float
        Duration of the runs.
    before : JointRange, optional
        What was known of its coefficients before the runs; both hold.

    Raises
    ------
    InputError
        For a model of which no plan is made, and coefficients that were not fitted.
    """
    joint = like_model(model)
    lacking = [spelled(name) for name in model.ids if name not in evidence.ids]
    if lacking:
        raise InputError(f"{', '.join(lacking)}: fixed in the fit of the campaign; plan with ranges")
    columns = [evidence.ids.index(name) for name in model.ids]
    parts, size = [], len(columns)
    for run in evidence.take(columns).runs:
        scores, _ = block_scores(Evidence(model.ids, (run,)), range(size), model.coefficients)
        triangle = run.pooled.triangle[:, :-1]
        parts.append(Information(triangle.T @ triangle, scores.T @ scores, np.array(float(len(run.blocks)))))
    notes: tuple[str, ...] = ()
    if before is not None:
        joint, notes = _both(joint, before)
    runs = tuple((state.frequency or 0.0, float(np.ptp(state.angle)) / 2) for state in states)
    ids = () if before is None else before.model.ids
    return Prior(joint, stacked(parts), runs, seconds, model, ids, notes)


def _both(found: JointRange, before: JointRange) -> tuple[JointRange, tuple[str, ...]]:
    """Return the ranges that both allow; where none does, that of the runs, with a note."""
    low, high = found.low.copy(), found.high.copy()
    notes = []
    for at, name in enumerate(found.model.ids):
        if name not in before.model:
            continue
        there = before.model.ids.index(name)
        least, most = max(low[at], before.low[there]), min(high[at], before.high[there])
        if least <= most:
            low[at], high[at] = least, most
        else:
            notes.append(
                f"the runs put {spelled(name)} outside of the range that was given, "
                f"{before.low[there]:.4g} to {before.high[there]:.4g}: the runs are believed"
            )
    # A discovery knows no elements: those that the joint was said to have stay.
    model = replace(found.model, elements=before.model.elements, covariance=())
    return JointRange(model, low, high), tuple(notes)


def measured_sensors(states: Sequence[ForceStates]) -> Sensors:
    """Return rate and noise of the sensors as runs have shown them: each channel's noise is the mean over the runs."""
    noise = [[getattr(state.noise, name) for state in states] for name in ("moment", "angle")]
    moment, angle = (float(np.sqrt(np.mean(np.square(each)))) for each in noise)
    rate = float(np.median([state.sample_rate for state in states]))
    # What could not be told apart from nothing is no noise of zero.
    return Sensors(rate, moment=moment if moment > 0 else None, angle=angle if angle > 0 else None)
