"""The gaps of a model with effects on runs it never saw, beside what noise alone leaves: size, place, pictures."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.diagnosis.campaign import GapRun
from sindyjoint.diagnosis.campaign.gap_rows import gap_runs
from sindyjoint.diagnosis.campaign.numbers import number_columns
from sindyjoint.diagnosis.campaign.refined import continuation_gap
from sindyjoint.diagnosis.campaign.regression import GapRegression, stack
from sindyjoint.diagnosis.campaign.repair import (
    about_zero,
    held_out_gap,
    modelled,
    refit,
    simulated,
)
from sindyjoint.diagnosis.campaign.start import Work
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect, law_of
from sindyjoint.diagnosis.parts import Place, Regions, most_informative
from sindyjoint.diagnosis.result import Gap, RunGap
from sindyjoint.discovery.delay import shifted
from sindyjoint.equation.element import Value
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import Enters, Nuisance, TestNuisances
from sindyjoint.errors import SindyJointError
from sindyjoint.mechanics import Law
from sindyjoint.numeric import Array, norms_of, rms
from sindyjoint.record import Run
from sindyjoint.response import compare_run, compared_states, corrected, pooled_errors
from sindyjoint.response.drive import prescribed
from sindyjoint.response.laws import with_coefficients
from sindyjoint.response.output_error import DRAWS
from sindyjoint.response.run import SimulatedRun, averaged, moment_scale, pooled_nrmse, span_of
from sindyjoint.states import ForceStates, moment_floor, moment_size
from sindyjoint.text import in_words_of


def gap_of(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> Gap:
    """Return the gaps of a model with effects.

    On runs marked for validation where there are any, as a verification computes it; else each group of runs is
    left out of the fit in turn, and the response is simulated over all. A free run is simulated from where two thirds
    of it end, which it was fitted to.
    """
    adding = [e for e in effects if not e.shifts]
    free = work.campaign.moves_freely
    if free and not work.campaign.validation_runs:
        return Gap(np.nan, continuation_gap(work, model, effects))
    moment, response = pooled_errors(simulated_runs(work, model, effects))
    if not work.campaign.validation_runs:
        moment = moment_gap(work, model, adding)
    elif np.isnan(moment):
        # A law that no simulation can follow has a moment along the measured motion.
        moment = _kept_moment(work, model, effects)
    # The moment of a free motion is that of its inertia, and decides nothing.
    return Gap(np.nan if free else moment, response)


def moment_gap(work: Work, model: JointModel, adding: Sequence[FittedEffect]) -> float:
    """Return the moment gap of a model with effects on groups of runs, each left out in turn."""
    size = moment_size(work.states, work.campaign.joint.inertia)
    return held_out_gap(work.rows, model, adding, work.noise, work.policy, size=size)


def gap_without(work: Work, found: Sequence[FittedEffect], names: Collection[str]) -> Gap:
    """Return the gap of the model without some of its effects, the others fitted anew."""
    kept = [f for f in found if f.name not in names]
    fitted = refit(work.rows, work.model, [f for f in kept if not f.shifts])
    return gap_of(work, fitted.model, (*(f for f in kept if f.shifts), *fitted.effects))


def kept_rows(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> tuple[GapRun, ...]:
    """Return the moments of the runs kept for validation, with a delay among the effects removed."""
    shift = Corrections.of(effects).shift
    states = [shifted(s, shift) for s in work.kept_states]
    rows = gap_runs(states, model, [s.run for s in states], work.policy)
    return tuple(about_zero(row, model, effects) for row in rows)


def _kept_moment(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return what the rows of the runs kept for validation leave of the moment, relative RMS."""
    rows = kept_rows(work, model, effects)
    left = np.concatenate([run.target - modelled(run, model, effects) for run in rows])
    return rms(left) / rms(np.concatenate([run.target for run in rows]))


def gap_rows(work: Work, model: JointModel, effects: Sequence[FittedEffect] = ()) -> tuple[GapRun, ...]:
    """Return the moments of which gaps are reported: of the runs kept for validation, or else of all."""
    return kept_rows(work, model, effects) if work.campaign.validation_runs else work.moment_rows()


def kept_misfit(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return the errors on runs kept for validation, RMS in units of what noise makes expected of each row.

    √(rᵀ(I + K(JᵀJ)⁻¹Kᵀ)⁻¹r / n), r the residual of the kept rows, K and J the derivatives by all numbers of these and
    of the rows that were fitted: what the numbers' own errors predict is no misfit.
    """
    adding = [e for e in effects if not e.shifts]
    kept = kept_rows(work, model, effects)
    residual = np.concatenate([run.white(run.target - modelled(run, model, adding)) for run in kept])
    fitted, other = (
        stack(rows, lambda run: number_columns(run, model, adding)) for rows in (work.plain, kept)
    )
    scale = norms_of(fitted)
    fitted, other = fitted / scale, other / scale
    along = other.T @ residual
    explained = along @ np.linalg.lstsq(fitted.T @ fitted + other.T @ other, along, rcond=None)[0]
    return float(np.sqrt(max(residual @ residual - explained, 0.0) / residual.size))


def noise_floor(work: Work) -> Gap:
    """Return the noise relative to the signals, over the runs of which gaps are reported; NaN where it is not known."""
    states, inertia = work.kept_states or work.states, work.model.inertia
    known = all(s.noise.motion_measured for s in states)
    response = _response_floor(states, inertia) if known else float("nan")
    return Gap(moment_floor(states, work.campaign.joint.inertia).relative, response)


def _response_floor(states: Sequence[ForceStates], inertia: float) -> float:
    """Return the noise of what answers, pooled as responses are: of the moment where the motion was the drive."""
    floors = []
    for s in states:
        if inertia > 0 and not prescribed(s, inertia=inertia):
            scale = float(np.std(s.angle))
            floors.append(("angle", s.noise.angle / scale, scale))
        else:
            scale = moment_scale(s.moment, s, inertia)
            floors.append(
                ("moment", float(np.hypot(s.noise.moment, inertia * s.noise.acceleration)) / scale, scale)
            )
    return pooled_nrmse(floors)


def simulated_runs(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> list[SimulatedRun]:
    """Return the runs of which gaps are reported beside their simulation: those kept for validation, or else all.

    The angle answers where the moment drives, the moment where the motion does. Runs that the model cannot follow (it
    snaps through, say) are left out: the gap says so by having no figure.
    """
    if not work.campaign.validation_runs:
        pairs = zip(work.runs, work.states, strict=True)
        made = [simulated(run, states, model, effects) for run, states in pairs]
        return [each for each in made if each is not None and np.isfinite(each.response_nrmse)]
    campaign = corrected(_channels(effects), work.campaign)
    runs = {run.name: run for run in campaign.validation_runs}
    timed = any(each.variant.uses & {"time", "elapsed"} for each in effects if each.effect.enters == "moment")

    def law(states: ForceStates) -> Law:
        return law_of(model, effects, states)

    found = []
    for states in compared_states(campaign, list(runs.values()), timed):
        with suppress(SindyJointError):
            found.append(compare_run(law, runs[states.run], states))
    return found


def _channels(effects: Sequence[FittedEffect]) -> TestNuisances:
    """Return what effects put right in the channels; the inertia belongs to the law."""
    found = Corrections.of(effects)
    values: tuple[tuple[Enters, float], ...] = (
        ("time shift", found.shift),
        ("angle zero", found.zero),
        ("angle drift", found.drift),
    )
    made = [Nuisance(way, way, Value("", value, 0.0, (value, value), "")) for way, value in values if value]
    return TestNuisances("", nuisances=tuple(made))


def locate_gap(problem: GapRegression, motion: str = "rotation") -> tuple[Place, ...]:
    """Return the regions that hold most of the gap beyond noise, compared with their share of the samples.

    Of bands that overlap the most informative one is named; words speak of the kind of motion, axes are called
    ``angle`` and ``rate`` for both.
    """
    sides = in_words_of(motion, "angles")
    excess = np.maximum(problem.residual**2 - 1.0, 0.0)
    if not excess.any():
        return ()
    angle, rate = (
        np.concatenate([getattr(run, name) for run in problem.runs]) / (largest or 1.0)
        for name, largest in (("angle", problem.reference.angle), ("rate", problem.reference.rate))
    )
    regions = Regions(excess, "samples", problem.policy)
    for axis, values, what in (
        ("angle", np.abs(angle), in_words_of(motion, "|angle|")),
        ("rate", np.abs(rate), in_words_of(motion, "|rate|")),
    ):
        for low, high in ((0.0, 0.1), (0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.01)):
            top = min(high, 1.0)
            words = f"{what} from {100 * low:.0f} % to {100 * top:.0f} % of the largest"
            regions.add(axis, (low, top), words, (values >= low) & (values < high))
    after = angle * rate < 0
    for axis, span, words, mask in (
        ("side", "positive angle", f"at positive {sides}", angle > 0),
        ("side", "negative angle", f"at negative {sides}", angle < 0),
        ("direction", "forward", "in forward motion", rate > 0),
        ("direction", "backward", "in backward motion", rate < 0),
        ("phase", "after reversal", "after the reversals, on the way back to zero", after),
        ("phase", "before reversal", "before the reversals, on the way out", ~after),
    ):
        regions.add(axis, span, words, mask)
    for axis, label, rows in _labelled(problem.runs):
        regions.add(axis, label, f"{axis} {label}", rows)
    return most_informative(regions.found, problem.policy)


def _labelled(runs: Sequence[GapRun]) -> Iterator[tuple[str, str, NDArray[np.bool_]]]:
    """Yield each frequency, level and run by name, and which rows are of it."""
    for axis, labels in (
        ("frequency", [f"{r.motion.frequency:.3g} Hz" if r.motion.frequency else "" for r in runs]),
        ("level", [r.level or "" for r in runs]),
        ("run", [r.name for r in runs]),
    ):
        rows = np.concatenate(
            [np.full(r.target.size, label, dtype=object) for r, label in zip(runs, labels, strict=True)]
        )
        for label in dict.fromkeys(labels):
            if label:
                yield axis, label, rows == label


# Of a long run one stretch, of which curves are drawn, and evenly some of the other rows, for maps.
CURVE_ROWS = 400


def run_gaps(
    rows: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect] = (), zero: float = 0.0
) -> tuple[RunGap, ...]:
    """Return up to twelve runs, spread over the campaign, beside a model with effects; long ones thinned.

    Rows are moments of the joint, channels put right: a time shift among the effects is in them already. Angles are as
    measured: ``zero``, from which those of the rows are counted, is added.
    """
    chosen = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), 12)).round().astype(int))
    whole = [rows[i].whole() for i in chosen]
    return tuple(_beside(run, modelled(run, model, effects), zero) for run in whole)


def _beside(run: GapRun, model: Array, zero: float) -> RunGap:
    keep = run.motion.keep
    time = np.asarray(run.motion.step * keep if run.folded else run.motion.time[keep], dtype=np.float64)
    curve = _stretch(run, time)
    part = np.concatenate([curve, _others(time.size, curve)])
    return RunGap(
        run=run.name,
        level=run.level,
        frequency=run.motion.frequency,
        repeats=run.folded,
        time=time[part],
        angle=run.angle[part] + zero,
        rate=run.rate[part],
        measured=run.target[part],
        model=model[part],
        noise=_noise(run),
        curve=curve.size,
    )


def _stretch(run: GapRun, time: Array) -> NDArray[np.intp]:
    """Return the rows of a stretch: the mean period; some periods of a sine; of other runs where most is going on."""
    every = np.arange(time.size)
    if run.folded or time.size < 2:
        return every
    span, periodic = time[-1] - time[0], run.motion.frequency > 0
    length = 2 / run.motion.frequency if periodic else CURVE_ROWS * float(np.median(np.diff(time)))
    # A sine has settled in the middle half of its run; the stretch that holds most rows is shown.
    low, high = (0.25 * span, 0.75 * span) if periodic else (0.0, max(span - length, 0.0))
    starts = time[0] + np.linspace(low, high, 41)
    first = np.searchsorted(time, starts)
    last = np.searchsorted(time, starts + length, side="right")
    weight = np.ones(time.size) if periodic else run.target**2
    held = np.append(0.0, np.cumsum(weight))
    best = int(np.argmax(held[last] - held[first]))
    return every[first[best] : last[best] : max(1, -(-int(last[best] - first[best]) // CURVE_ROWS))]


def _others(size: int, curve: NDArray[np.intp]) -> NDArray[np.intp]:
    left = np.setdiff1d(np.arange(size), curve)
    # Of all rows 1500 are kept, for maps.
    return left[:: max(1, -(-left.size // (1500 - CURVE_ROWS)))]


def _noise(run: GapRun) -> float:
    """Return the RMS of a row's noise: of a mean period from the covariance of its rows, (F'F)⁻¹."""
    if not run.folded:
        return float(np.sqrt(run.variance))
    lower = np.linalg.inv(run.factor)
    return float(np.sqrt(np.mean(np.sum(lower**2, axis=1))))


def response_error(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return by how much simulations of the same law differ: other numbers within their errors, other noise."""
    rng = np.random.default_rng(0)
    adding = [e for e in effects if not e.shifts]
    covariance = _covariance(work.rows, model, adding)
    given = {each.run: each for each in simulated_runs(work, model, effects)}
    errors = []
    for _ in range(DRAWS):
        drawn = _drawn(model, effects, covariance, rng)
        for other in simulated_runs(_noisier(work, rng), *drawn):
            one, two = given.get(other.run), other.simulated_response
            if one is None or one.simulated_response is None or two is None:
                continue
            error, scale = rms(two - one.simulated_response), one.response_scale
            if np.isfinite(error):
                errors.append((one.channel, error / scale, scale))
    return pooled_nrmse(errors) if errors else 0.0


def _noisier(work: Work, rng: np.random.Generator) -> Work:
    """Return the work with moments that are as uncertain once more: by their noise, and between their samples.

    Where friction jumps between two samples, straight lines place the jump by half a sample: half the difference of a
    sample to the mean of its neighbours, the same in every period.
    """

    def noisier(run: Run, states: ForceStates) -> Run:
        # A mean of periods has the noise of the mean.
        periods = run.n_samples // states.n_samples if states.repeated else 1
        own = float(np.nan_to_num(states.noise.moment)) * np.sqrt(periods)
        once = round(run.sample_rate / states.frequency) if states.frequency else states.n_samples
        once = min(once, run.n_samples)
        mean = run.moment[: run.n_samples // once * once].reshape(-1, once).mean(axis=0)
        jump = np.convolve(np.pad(mean, 1, mode="edge"), [-0.25, 0.5, -0.25], mode="valid")
        between = np.resize(rng.standard_normal(once) * jump, run.n_samples)
        moment = run.moment + own * rng.standard_normal(run.n_samples) + between
        return replace(run, moment=moment, source=None)

    campaign, kept = work.campaign, {states.run: states for states in work.kept_states}
    if campaign.validation_runs:
        runs = (noisier(run, kept[run.name]) if run.name in kept else run for run in campaign.runs)
        return replace(work, campaign=campaign.with_runs(tuple(runs)))
    made = tuple(map(noisier, work.runs, work.states))
    states = (
        replace(s, moment=averaged(run, s).moment[span_of(run, s)]) if s.repeated else s
        for run, s in zip(made, work.states, strict=True)
    )
    return replace(work, runs=made, states=tuple(states))


def _drawn(
    model: JointModel, effects: Sequence[FittedEffect], covariance: Array, rng: np.random.Generator
) -> tuple[JointModel, list[FittedEffect]]:
    """Return the law with other numbers, as its covariance allows; nonlinear parameters stay positive."""
    values, vectors = np.linalg.eigh(covariance)
    step = vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.standard_normal(values.size))
    at, later = model.coefficients.size, []
    drawn = with_coefficients(model, model.coefficients + step[:at], covariance[:at, :at])
    for each in effects:
        if not each.shifts:
            linear, inner = np.split(step[at : at + each.numbers.size], [each.coefficients.size])
            at += each.numbers.size
            moved = each.values * np.exp(np.clip(inner / each.values, -1.0, 1.0))
            each = replace(each, coefficients=each.coefficients + linear, values=moved)
        later.append(each)
    return drawn, later


def _covariance(runs: Sequence[GapRun], model: JointModel, adding: Sequence[FittedEffect]) -> Array:
    """Return the covariance of numbers fitted to whitened rows, of whose variance a share is noise."""
    white = stack(runs, lambda run: number_columns(run, model, adding))
    share = np.concatenate([np.full(run.white_size, run.noise_share) for run in runs])
    norm = norms_of(white)
    inverse = np.linalg.pinv(white / norm, rcond=1e-9)
    return np.asarray((inverse * share) @ inverse.T / np.outer(norm, norm))
