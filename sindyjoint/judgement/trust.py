"""Can I trust it: made once from a campaign and a model, by the same call for every verb.

Four questions, of which the worst answer decides. *Data*: is what was measured sound? *Explained*: is the moment along
the measured motion explained to within what does not repeat? *Predicts*: is that so for runs that no fit has seen?
*Determined*: did the runs excite what the coefficients stand for?
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy

from sindyjoint.diagnosis.policy import CAMPAIGN as DIAGNOSIS
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.errors import InputError, SindyJointError, StandstillError
from sindyjoint.limits import JUDGEMENT
from sindyjoint.numeric import Array
from sindyjoint.record import Campaign, Run
from sindyjoint.response import law_of_test, simulated_gap
from sindyjoint.response.completion import completed_states
from sindyjoint.response.laws import as_followed
from sindyjoint.response.run import along_motion, cut_states, settling
from sindyjoint.soundness import Soundness
from sindyjoint.states import (
    Floor,
    ForceStates,
    group_labels,
    larger_moment,
    moment_floor,
    one_after_another,
    states_of,
)
from sindyjoint.text import list_some, percent, quantities, spelled
from sindyjoint.trust import Colour, Light


class Explained(NamedTuple):
    """The residual of one run: sums of squares of it and of the transfer moment, in each of its blocks."""

    group: str
    residual: Array
    moment: Array


@dataclass(frozen=True)
class Gap:
    """RMS residual over RMS moment, with its 95 % interval."""

    value: float
    interval: tuple[float, float]

    @classmethod
    def of(cls, runs: Sequence[Explained]) -> "Gap":
        """Return the gap of some runs; its interval by the jackknife over runs, or over the blocks of fewer than three.

        Of the mean square, whose square root it is (Efron and Stein 1981).
        """
        if len(runs) >= 3:
            parts = np.array([(run.residual.sum(), run.moment.sum()) for run in runs])
        else:
            parts = np.concatenate([np.column_stack([run.residual, run.moment]) for run in runs])
        total = parts.sum(axis=0)
        if not total[1] > 0:
            return cls(float("nan"), (float("nan"), float("nan")))
        square, count = total[0] / total[1], len(parts)
        without = (total[0] - parts[:, 0]) / np.maximum(total[1] - parts[:, 1], 1e-300)
        error = np.sqrt((count - 1) / count * np.sum((without - without.mean()) ** 2)) if count > 1 else 0.0
        half = error * scipy.special.stdtrit(max(count - 1, 1), 0.975)
        ends = np.sqrt(np.maximum([square - half, square + half], 0.0))
        return cls(float(np.sqrt(square)), (float(ends[0]), float(ends[1])))


def assess(
    model: JointModel,
    campaign: Campaign,
    soundness: Soundness,
    seen: Mapping[str, bool | None],
    test: TestNuisances | None = None,
    states: Sequence[ForceStates] | None = None,
    as_measured: Campaign | None = None,
) -> tuple[Light, ...]:
    """Return the four lights of a model and a campaign.

    Parameters
    ----------
    model : JointModel
    campaign : Campaign
        Its channels put right, and without the samples that the check leaves out.
    soundness : Soundness
    seen : mapping of str to bool or None
        Whether a fit of the model has used a run; None where that is not known.
    test : TestNuisances, optional
        Moments of the test that belong to no joint.
    states : sequence of ForceStates, optional
        Of the runs for identification, completed by the model, where they are at hand.
    as_measured : Campaign, optional
        With its channels as they are, where some were put right: what does not repeat is the measurement's, and a
        channel that was moved in time is interpolated.
    """
    data = judge_soundness(soundness, campaign.simulated, campaign.joint.motion)
    if not (model.terms or model.elements):
        return (
            data,
            Light("explained", "poor", "no set of terms predicts the moment"),
            Light("predicts", "poor", "there is no model"),
            coverage(campaign),
        )
    campaign = as_followed(campaign, model)
    test = test or TestNuisances("")
    runs = campaign.identification_runs or campaign.validation_runs
    try:
        if states is None:
            states = _completed(model, campaign, runs)
        floor = _floor(as_measured, states, model.joint.inertia)
        fitted = [
            _explained(model, test, each, group)
            for each, group in zip(states, group_labels(states), strict=True)
        ]
        gap = Gap.of(fitted)
        if math.isnan(gap.value):
            raise StandstillError("under it the joint moves in none of them")
        predicts = _predicts(model, campaign, test, seen, states, gap)
        if campaign.moves_freely:
            predicts = _goes_on(predicts, model, campaign, test)
    except SindyJointError as error:
        lost = Light("explained", "poor", f"the model cannot be compared with these runs: {error}")
        unknown = Light("predicts", "poor", "nothing could be predicted")
        return data, lost, unknown, _determined(model, campaign)
    return data, judge_gap(gap, floor, model.joint.motion), predicts, _determined(model, campaign)


def _goes_on(predicts: Light, model: JointModel, campaign: Campaign, test: TestNuisances) -> Light:
    """Return what a law predicts of a free motion: nothing, where its simulation misses most of what was measured."""
    missed = simulated_gap(model, campaign, test)
    if missed <= JUDGEMENT.mostly:
        return predicts
    words = (
        f"the simulated motion misses by {percent(missed)}"
        if missed > 0
        else "the motion cannot be simulated"
    )
    return replace(predicts, colour="poor", sentence=f"{predicts.sentence}, yet {words}")


def judge_soundness(soundness: Soundness, simulated: bool, motion: str) -> Light:
    """Return what the check of the data found."""
    faults = [f.id for f in soundness.findings if f.severity != "note"]
    virtual = ", simulated" if simulated else ""
    if soundness.verdict == "sound":
        return Light("data", "good", f"sound{virtual}: nothing found that shifts a coefficient")
    named = list_some([spelled(fault, motion) for fault in dict.fromkeys(faults)], "findings")
    colour: Colour = "fair" if soundness.verdict == "doubtful" else "poor"
    return Light("data", colour, f"{soundness.verdict}{virtual}: {named}")


def judge_gap(gap: Gap, floor: Floor, motion: str) -> Light:
    """Return whether a gap is explained beside the floor of the same runs."""
    load = quantities(motion).moment.lower()
    light = partial(Light, "explained", gap=gap.value, floor=floor.relative, interval=gap.interval)
    size = f"gap {percent(gap.value)} of the RMS {load} ({percent(gap.interval[0])} to {percent(gap.interval[1])})"
    if not math.isfinite(floor.relative):
        return light(colour_of_size(gap.value), f"{size}; {floor.words}")
    colour = colour_of_misfit(gap.value, floor.relative, JUDGEMENT.predicts)
    sentence = f"{size}, noise floor {percent(floor.relative)} {floor.words}"
    if (floor.bound or floor.relative >= 1) and colour == "good":
        # What a law lacks is in the bound, too; a floor as large as the moment hides any.
        return light(colour_of_size(gap.value), sentence)
    if colour != "good":
        sentence += f": {percent(beyond_noise(gap.value, floor.relative))} is neither model nor noise"
    return light(colour, sentence)


def colour_of_misfit(relative: float, floor: float, within: float = JUDGEMENT.clearly) -> Colour:
    """Return the colour of a misfit beside its measured noise floor, both relative RMS.

    Good is what noise and the processing leave, and no more; of a response up to half as much again.
    """
    if relative <= within * math.hypot(floor, DIAGNOSIS.processing_error):
        return "good"
    return colour_of_size(beyond_noise(relative, floor))


def colour_of_size(value: float, most: float = JUDGEMENT.large_part) -> Colour:
    """Return the colour of what is not known to be noise: never good, and poor beyond ``most``."""
    return "fair" if value <= most else "poor"


def beyond_noise(relative: float, floor: float) -> float:
    """Return what of a relative RMS is not noise."""
    return math.sqrt(max(relative**2 - floor**2, 0.0))


def coverage(campaign: Campaign) -> Light:
    """Return whether the runs tell alike terms apart."""
    runs = campaign.identification_runs or campaign.runs
    return judge_coverage([run.frequency for run in runs], [run.level for run in runs])


def judge_coverage(frequencies: Sequence[float | None], levels: Sequence[str | None]) -> Light:
    """Return whether runs of some frequencies, Hz, and levels, None where a run has none, tell alike terms apart."""
    runs = len(frequencies)
    tested = len({f for f in frequencies if f is not None})
    heights = len({level for level in levels if level is not None})
    of_runs = f"{runs} run{'s' * (runs != 1)}"
    if not tested:
        return Light(
            "determined",
            "good" if runs >= JUDGEMENT.fewest else "fair",
            f"{runs} aperiodic {of_runs.split()[1]}",
        )
    least = min(tested, heights) if heights else tested
    colour: Colour = "good" if least >= JUDGEMENT.fewest else "fair" if runs > 1 else "poor"
    written = f"{tested} frequenc{'ies' if tested != 1 else 'y'}"
    if heights:
        written += f", {heights} level{'s' * (heights != 1)}"
    advice = "" if colour == "good" else f"; {JUDGEMENT.fewest} of each tell the terms apart"
    return Light("determined", colour, f"{written} in {of_runs}{advice}")


def _determined(model: JointModel, campaign: Campaign) -> Light:
    """Return what was excited, and which coefficient is least sure: one whose interval holds zero is not determined."""
    light = coverage(campaign)
    if INERTIA in model and model[INERTIA].coefficient < 0:
        q, value = quantities(model.joint.motion), model[INERTIA].coefficient
        words = (
            f"{q.inertia.lower()} identified as {value:.3g} {q.inertia_unit}: negative, which is impossible"
        )
        return Light("determined", "poor", words, inertia=value)
    widths = {
        term.symbol: 0.5 * (term.interval95[1] - term.interval95[0]) / abs(term.coefficient)
        for term in model.terms
        if term.coefficient and np.all(np.isfinite(term.interval95))
    }
    if not widths:
        return light
    worst = max(widths, key=lambda name: widths[name])
    colour = light.colour if widths[worst] < 1 or light.colour == "poor" else "fair"
    sentence = f"{light.sentence}; least sure {worst} ± {percent(widths[worst])}"
    return Light("determined", colour, sentence, widest=widths[worst])


def _completed(model: JointModel, campaign: Campaign, runs: Sequence[Run]) -> tuple[ForceStates, ...]:
    """Return the states of some runs with what their processing cuts off the motion, where the model gives it."""
    states = one_after_another(campaign, states_of(campaign, runs))
    try:
        return completed_states(model, runs, states)
    except InputError:  # an input moves the law within a run
        return states


def _floor(as_measured: Campaign | None, states: Sequence[ForceStates], inertia: float | None) -> Floor:
    """Return the floor of the runs for identification, the noise of the moment as it was measured."""
    if as_measured is not None:
        runs = as_measured.identification_runs or as_measured.validation_runs
        measured = one_after_another(as_measured, states_of(as_measured, runs))
        pairs = zip(states, measured, strict=True)
        states = [
            replace(s, noise=replace(m.noise, rate=s.noise.rate, acceleration=s.noise.acceleration))
            for s, m in pairs
        ]
    return moment_floor(states, inertia, bounded=True)


def _residual(model: JointModel, test: TestNuisances, states: ForceStates) -> tuple[ForceStates, Array]:
    """Return the states that count and the moment along their motion less the measured one, N·m."""
    skip, law = settling(states), law_of_test(test, model, states)
    moment, _ = along_motion(law, states, states.sample_rate)
    return cut_states(states, skip), (moment - states.moment)[skip:]


def _explained(model: JointModel, test: TestNuisances, states: ForceStates, group: str) -> Explained:
    """Return what a model leaves of one run, block by block, over moving samples."""
    kept, residual = _residual(model, test, states)
    moment = larger_moment(kept, model.joint.inertia or 0.0)
    # Blocks of a run whose residuals show how sure a gap is.
    rows = np.array_split(np.flatnonzero(kept.moving), 8)
    squares = [np.array([np.sum(signal[part] ** 2) for part in rows]) for signal in (residual, moment)]
    return Explained(group, squares[0], squares[1])


def _predicts(
    model: JointModel,
    campaign: Campaign,
    test: TestNuisances,
    seen: Mapping[str, bool | None],
    states: Sequence[ForceStates],
    gap: Gap,
) -> Light:
    """Return how a model does on what no fit has seen.

    That is the runs kept for validation; or all of them, where it was fitted to others; or each group of runs in turn
    under the coefficients of the others, internal states with the shapes that they have.
    """
    kept = [run for run in campaign.validation_runs if seen[run.name] is False]
    kept = kept if campaign.identification_runs else []
    if kept:
        others = _completed(model, campaign, kept)
        error = Gap.of([_explained(model, test, each, each.run) for each in others]).value
        floor = moment_floor(others, campaign.joint.inertia).relative
        what = f"on {len(kept)} run{'s' * (len(kept) != 1)} kept for validation"
        return _of_unseen(error, gap.value, floor, what)
    if all(seen[each.run] is False for each in states):
        floor = moment_floor(states, campaign.joint.inertia).relative
        return _of_unseen(gap.value, gap.value, floor, "on these runs, which no fit has seen")
    error, inside = left_out_error(model, test, states)
    ratio, colour = _beside(error, inside)
    left = "groups of runs" if len(states) > 1 else "parts of the run"
    sentence = f"error {percent(error)} on {left} left out of the fit, {ratio:.2f} times the residual"
    return Light("predicts", colour, sentence, error=error)


def _beside(error: float, fitted: float) -> tuple[float, Colour]:
    """Return how many times the error of a fit one on unseen data is, and its colour."""
    ratio = error / max(fitted, 1e-300)
    return ratio, "good" if ratio <= JUDGEMENT.predicts else colour_of_size(ratio, JUDGEMENT.contradicts)


def _of_unseen(error: float, gap: float, floor: float, what: str) -> Light:
    """Return how an error on unseen runs stands beside their floor and the gap of the fit."""
    noise = math.isfinite(floor) and colour_of_misfit(error, floor) == "good"
    colour = "good" if noise else _beside(error, gap)[1]
    return Light("predicts", colour, f"error {percent(error)} {what}", error=error)


def left_out_error(
    model: JointModel, test: TestNuisances, states: Sequence[ForceStates]
) -> tuple[float, float]:
    """Return the relative RMS error of groups of runs left out, and that of the fit to all.

    Groups are frequencies, else runs, else consecutive parts of the only run. Columns are the terms, and the moments
    of the elements as they are; what the test adds is not fitted again. Both are relative to the moment that a gap is.
    """
    rows = [_columns(model, test, each) for each in states]
    size = sum(float(_explained(model, test, each, "").moment.sum()) for each in states)
    if len(states) == 1:
        rows = list(zip(*(np.array_split(part, 4) for part in rows[0]), strict=True))
    groups = group_labels(states) if len(states) > 1 else list(map(str, range(len(rows))))
    scale = np.sqrt(np.mean(np.concatenate([X for X, _ in rows]) ** 2, axis=0))
    scale[scale == 0] = 1.0
    rows = [(X / scale, y) for X, y in rows]
    names = sorted(set(groups))
    chosen = {name: [i for i, group in enumerate(groups) if group == name] for name in names}
    grams = {name: np.sum([rows[i][0].T @ rows[i][0] for i in chosen[name]], axis=0) for name in names}
    rights = {name: np.sum([rows[i][0].T @ rows[i][1] for i in chosen[name]], axis=0) for name in names}
    whole, right = (np.sum(list(each.values()), axis=0) for each in (grams, rights))

    def error(name: str, matrix: Array, vector: Array) -> float:
        coefficients = np.linalg.lstsq(matrix, vector, rcond=1e-14)[0]
        return sum(float(np.sum((rows[i][1] - rows[i][0] @ coefficients) ** 2)) for i in chosen[name])

    outside = sum(error(name, whole - grams[name], right - rights[name]) for name in names)
    inside = sum(error(name, whole, right) for name in names)
    return math.sqrt(outside / size), math.sqrt(inside / size)


def _columns(model: JointModel, test: TestNuisances, states: ForceStates) -> tuple[Array, Array]:
    """Return the columns of terms and elements at the moving samples of a run, and what they are to explain."""
    from sindyjoint.equation.formula import VARIABLES, compile_terms

    kept, residual = _residual(model, test, states)
    inputs = model.input_arrays(kept.inputs, kept.angle.shape)
    function = compile_terms([term.expression for term in model.terms], (*VARIABLES, *inputs))
    rate = np.where(kept.rate == 0, 1e-300, kept.rate)
    columns = function(kept.angle, rate, kept.acceleration, *inputs.values())
    coefficients = np.array([term.coefficient for term in model.terms])
    held = kept.moment - kept.acceleration * (0.0 if INERTIA in model else model.inertia)
    added = residual + held - columns @ coefficients
    if model.elements:
        columns, target = np.column_stack([columns, added]), held
    else:
        target = held - added
    return columns[kept.moving], target[kept.moving]
