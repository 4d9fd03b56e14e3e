"""A model with effects added: its fit, its gap on runs it never saw, and the law that simulates it."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from sindyjoint.clock import STEP_SAMPLES, spend
from sindyjoint.diagnosis.campaign import GapRun, reference_scales, row_groups
from sindyjoint.diagnosis.campaign.gap_rows import base_columns
from sindyjoint.diagnosis.campaign.regression import GapRegression, stack
from sindyjoint.diagnosis.effects import Variant
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect, law_of
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.diagnosis.verdict import ZERO_ERRORS
from sindyjoint.discovery.delay import shifted
from sindyjoint.equation.candidates import made_by_shift
from sindyjoint.equation.formula import VARIABLES, compile_terms
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SindyJointError
from sindyjoint.mechanics.stickslip import STEPS_PER_SAMPLE
from sindyjoint.numeric import Array, delayed, norms_of, rising_zero
from sindyjoint.record import Run
from sindyjoint.response.drive import Drive, choose_drive, prescribed
from sindyjoint.response.laws import with_coefficients
from sindyjoint.response.run import SimulatedRun, simulate_run
from sindyjoint.states import ForceStates

FRICTION = "friction"  # the family


@dataclass(frozen=True, eq=False)
class Repaired:
    """A model, the effects added to it, and all coefficients estimated together.

    Parameters
    ----------
    model : JointModel
        Its terms with their new coefficients; needless ones are gone.
    effects : tuple of FittedEffect
    dropped : tuple of str
        Ids of terms that became needless.
    covariance : ndarray, optional
        Of the coefficients of terms and effects, in that order.
    residual : ndarray, optional
        Of a free motion fitted to its simulation: what that leaves, in units of noise.
    """

    model: JointModel
    effects: tuple[FittedEffect, ...]
    dropped: tuple[str, ...] = ()
    covariance: Array | None = None
    residual: Array | None = None


def refit(
    runs: Sequence[GapRun],
    model: JointModel,
    effects: Sequence[FittedEffect],
    drops: bool | None = None,
) -> Repaired:
    """Estimate terms and effects together; drop needless terms, the least first; default: where there are effects.

    A term is needless that does not stand out of its error or is friction that pushes, and beside effects carries no
    share of the moment. Beside a zero error no term is that a shift of the displacement makes of another one: it may
    be small by where the zero is.
    """
    dropped: list[str] = []
    drops = bool(effects) if drops is None else drops
    shifted = any(each.name in ZERO_ERRORS for each in effects)
    target = np.concatenate([run.white(run.target) for run in runs])
    while True:
        columns = whitened(runs, np.vstack([all_columns(run, model, effects) for run in runs]))
        coefficients, covariance = least_squares(columns, target)
        size = model.coefficients.size
        ratio = np.abs(coefficients[:size]) / np.sqrt(np.diag(covariance)[:size])
        share = np.abs(coefficients[:size]) * _own_rms(runs, model) / model.fitted.moment_rms
        pushing = coefficients[:size] < [0.0 if t.family == FRICTION else -np.inf for t in model.terms]
        # Columns of effects have errors of their own, which a term may have taken up.
        small = share < CAMPAIGN.column_error if effects else True
        weak = np.flatnonzero((pushing | (ratio < CAMPAIGN.significant)) & small)
        if shifted:
            weak = weak[~np.array(made_by_shift([term.expression for term in model.terms]))[weak]]
        if not drops or not weak.size or size <= 1:
            break
        least = int(min(weak, key=lambda i: ratio[i]))
        dropped.append(model.terms[least].id)
        model = without(model, {model.terms[least].id})
    own, *parts = np.split(
        coefficients, size + np.cumsum([0, *(len(e.variant.columns) for e in effects)])[:-1]
    )
    model = with_coefficients(model, own, covariance[:size, :size])
    later = tuple(replace(e, coefficients=part) for e, part in zip(effects, parts, strict=True))
    return Repaired(model, later, tuple(dropped), covariance)


def least_squares(columns: Array, target: Array) -> tuple[Array, Array]:
    """Return coefficients of whitened rows and their covariance, widened by the residual beyond noise."""
    norm = norms_of(columns)
    u, singular, right = np.linalg.svd(columns / norm, full_matrices=False)
    inverse = np.where(singular > 1e-9 * singular[0], 1 / np.maximum(singular, 1e-300), 0.0)
    coefficients = (right.T * inverse) @ (u.T @ target)
    residual = target - (columns / norm) @ coefficients
    scale = max(1.0, float(residual @ residual) / max(target.size - norm.size, 1))
    covariance = (right.T * inverse**2) @ right * scale
    return coefficients / norm, covariance / np.outer(norm, norm)


def scaled_covariance(jacobian: Array, residual: Array) -> Array:
    """Return the covariance of the numbers that whitened rows were fitted with, widened by the misfit.

    ``jacobian`` has shape (m, n), ``residual`` (m,).
    """
    _, covariance = least_squares(jacobian, np.zeros_like(residual))
    return covariance * max(1.0, float(residual @ residual) / max(residual.size - jacobian.shape[1], 1))


def all_columns(run: GapRun, model: JointModel, effects: Sequence[FittedEffect]) -> Array:
    """Return the columns of the model's terms and of the effects at the kept samples."""
    return np.hstack([base_columns(model, run), *(e.variant.along(run.motion, e.values) for e in effects)])


def about_zero(run: GapRun, model: JointModel, effects: Sequence[FittedEffect]) -> GapRun:
    """Return the rows of a run with the secants of the law in the place of its slopes, where the angle has an error.

    What a zero error and a drift d(t) add is M(θ) − M(θ − d), linear in d by the secant alone.
    """
    found = Corrections.of(effects)
    motion = run.motion
    away = found.zero + found.drift * motion.time
    if not np.any(away):
        return run
    laws = [e for e in effects if e.effect.enters == "moment"]
    here = replace(run, motion=replace(motion, keep=np.arange(motion.angle.size)))
    own = replace(here.motion, angle=motion.angle - away, centre=motion.centre - found.zero)
    change = modelled(here, model, laws) - modelled(replace(here, motion=own), model, laws)
    slope = np.where(away == 0, motion.moment_slope, change / np.where(away == 0, 1.0, away))
    return replace(run, motion=replace(motion, moment_slope=slope), secant=True)


def rest_angle(runs: Sequence[GapRun], model: JointModel) -> float | None:
    """Return where the elastic moment of the terms and a constant is zero, nearest to the mean of the motion; rad.

    None where there is no such angle within the motion, or no stiffness about it stands out of its error.
    """
    rows = stack(runs, lambda run: np.column_stack([base_columns(model, run), np.ones(run.target.size)]))
    solved, covariance = least_squares(rows, np.concatenate([run.white(run.target) for run in runs]))
    moved = np.concatenate([run.motion.angle for run in runs])
    angle = np.linspace(float(moved.min()), float(moved.max()), 401)
    still = np.zeros_like(angle)
    inputs = model.input_arrays(None, angle.shape)
    terms = compile_terms([term.expression for term in model.terms], (*VARIABLES, *inputs))
    elastic = np.column_stack([terms(angle, still, still, *inputs.values()), still + 1])
    rest = rising_zero(angle, elastic @ solved, float(moved.mean()))
    if rest is None:
        return None
    slope = np.array([np.interp(rest, angle, np.gradient(column, angle)) for column in elastic.T])
    sure = slope @ solved > CAMPAIGN.significant * np.sqrt(slope @ covariance @ slope)
    return rest if sure else None


def coefficients_of(model: JointModel, effects: Sequence[FittedEffect]) -> Array:
    """Return the coefficients of those columns."""
    return np.concatenate([model.coefficients, *(e.coefficients for e in effects)])


def modelled(run: GapRun, model: JointModel, effects: Sequence[FittedEffect]) -> Array:
    """Return the moment of a model with effects, time shifts aside, at the kept samples, N·m."""
    adding = [e for e in effects if not e.shifts]
    return all_columns(run, model, adding) @ coefficients_of(model, adding)


def _own_rms(runs: Sequence[GapRun], model: JointModel) -> Array:
    columns = np.vstack([base_columns(model, run) for run in runs])
    return np.sqrt(np.mean(columns**2, axis=0))


def without(model: JointModel, ids: Collection[str]) -> JointModel:
    """Return a model without some of its terms."""
    keep = [i for i, term in enumerate(model.terms) if term.id not in ids]
    covariance = tuple(tuple(model.covariance[i][j] for j in keep) for i in keep) if model.covariance else ()
    return replace(model, terms=tuple(model.terms[i] for i in keep), covariance=covariance)


def held_out_gap(
    runs: Sequence[GapRun],
    model: JointModel,
    effects: Sequence[FittedEffect],
    noise: dict[str, float],
    policy: DiagnosisPolicy = CAMPAIGN,
    size: float | None = None,
) -> float:
    """Return the moment gap on runs that were left out, relative RMS.

    Relative to ``size``, N·m; default: the RMS of the rows.

    Each group of runs is left out in turn; coefficients and nonlinear
    parameters come from the others.
    The noise of single samples that a mean period averages away, or that lies beyond the band, is added back: a perfect
    model has the noise floor.
    So is what the processing leaves of the model's own simulation.
    """
    labels, white_labels = row_groups(runs), row_groups(runs, white=True)
    plain = np.vstack([all_columns(run, model, effects) for run in runs])
    white = whitened(runs, plain)
    target = np.concatenate([run.target for run in runs])
    whole = whitened(runs, target)
    residual = np.empty(target.size)
    # The range of a number is that of the campaign: runs that go less far do not narrow it.
    reference = reference_scales(runs)
    ranged = [e if e.within is not None else replace(e, within=e.variant.bounds(reference)) for e in effects]
    for group in dict.fromkeys(labels.tolist()):
        out, others = labels == group, white_labels != group
        used, rows = plain, white
        train = [run for run in runs if run.group != group]
        if train and len(train) < len(runs) and any(e.values.size for e in effects):
            # Along the motion itself where it is short: a kink that is followed roughly has its numbers elsewhere.
            if sum(run.motion.angle.size for run in train) > 100_000:
                train = [run.rough() for run in train]
            later = refit_nonlinear(train, model, ranged, policy)
            used = np.vstack([all_columns(run, model, later) for run in runs])
            rows = whitened(runs, used)
        coefficients, _ = least_squares(rows[others], whole[others])
        residual[out] = target[out] - used[out] @ coefficients
    return _rms(runs, residual, noise) / (size or float(np.sqrt(np.mean(target**2))))


def model_errors(runs: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect]) -> list[float]:
    """Return the residual of each run beyond its noise, RMS in N·m; zero where it repeats.

    Where the model is wrong by more than the noise, weights that know of the noise alone would trust it too much.
    """
    residuals = [run.target - modelled(run, model, effects) for run in runs]
    return [
        0.0
        if run.folded or run.half_cycles
        else float(np.sqrt(max(float(np.mean(r**2)) - run.variance, 0.0)))
        for run, r in zip(runs, residuals, strict=True)
    ]


def whitened(runs: Sequence[GapRun], rows: Array) -> Array:
    """Return stacked rows of all runs in units of noise."""
    ends = np.cumsum([run.target.size for run in runs])[:-1]
    return np.concatenate([run.white(part) for run, part in zip(runs, np.split(rows, ends), strict=True)])


def _rms(runs: Sequence[GapRun], residual: Array, noise: dict[str, float]) -> float:
    """Return the RMS of a residual, within the band in which accelerations are known, and of noise beyond it."""
    ends = np.cumsum([run.target.size for run in runs])[:-1]
    square = []
    for run, part in zip(runs, np.split(residual, ends), strict=True):
        part = part if run.processing is None else part + run.processing
        within = part if run.band is None else run.band.within(part)
        beyond = noise[run.name] ** 2 if run.folded else 0.0
        if run.band is not None:
            beyond = min(float(np.mean((part - within) ** 2)), (1 - run.band.passed) * noise[run.name] ** 2)
        square.append(within**2 + beyond)
    return float(np.sqrt(np.mean(np.concatenate(square))))


def refit_nonlinear(
    runs: Sequence[GapRun],
    model: JointModel,
    effects: Sequence[FittedEffect],
    policy: DiagnosisPolicy,
) -> list[FittedEffect]:
    """Return effects with their nonlinear parameters fitted to some runs, one beside the others."""
    later = list(effects)
    for index, each in enumerate(later):
        others = later[:index] + later[index + 1 :]
        later[index] = refine_effect(GapRegression.build(runs, model, others, policy), each)
    return later


def unique_shares(runs: Sequence[GapRun], model: JointModel, effects: Sequence[FittedEffect]) -> Array:
    """Return the moment that no other column can take over, of each, relative to the RMS moment."""
    columns = np.vstack([all_columns(run, model, effects) for run in runs])
    coefficients = coefficients_of(model, effects)
    size = np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)
    products = (columns / size).T @ (columns / size) / len(columns)
    own = np.sqrt(1 / np.maximum(np.diag(np.linalg.pinv(products)), 1.0))
    return np.abs(coefficients) * size * own / model.fitted.moment_rms


def refine_effect(problem: GapRegression, fitted: FittedEffect) -> FittedEffect:
    """Return an effect with its nonlinear parameters refitted near where they were."""
    if not fitted.values.size:
        return fitted
    within = fitted.variant.bounds(problem.reference) if fitted.within is None else fitted.within
    bounds = np.log(within).T
    start = np.clip(np.log(fitted.values), *bounds)
    # A ridge is followed slowly: many trials for each parameter.
    found = scipy.optimize.minimize(
        lambda p: -problem.gain(fitted.variant, np.exp(np.clip(p, *bounds)))[0],
        start,
        method="Nelder-Mead",
        options={
            "initial_simplex": np.vstack(
                # Nonlinear parameters are refined until their gain rises by less than this, or this share of it.
                [start, start + np.diag(np.where(start + 0.1 < bounds[1], 0.1, -0.1))]
            ),
            "xatol": 1e-3,
            "fatol": max(0.02, 1e-5 * fitted.gain),
            "maxfev": 80 * start.size,
        },
    )
    values = np.exp(np.clip(found.x, *bounds))
    gain, coefficients = problem.gain(fitted.variant, values)
    return replace(fitted, values=values, gain=gain, coefficients=coefficients)


def sticks(variant: Variant, values: Array, runs: Sequence[GapRun], share: float) -> bool:
    """Return whether a slider sticks along more than a share of the measured motion: it is then a spring.

    Of sliders with a sharp limit: smooth hysteresis dissipates long before it yields. Half-cycles count by their
    stroke: between pulls a motion that hardly moves turns round many times.
    """
    if all(state.limit is None for state in variant.states):
        return False
    limit = float(np.min(variant.limits(np.asarray(values, dtype=np.float64))))
    strokes = np.concatenate([np.abs(np.diff(_reversals(run))) for run in runs] or [np.empty(0)])
    return bool(strokes[strokes / 2 < limit].sum() > share * strokes.sum())


def _reversals(run: GapRun) -> NDArray[np.float64]:
    """Return the angles at which a run's motion turns round."""
    angle, rate = run.motion.angle, run.motion.rate
    # Below a twentieth of the largest rate a sign is noise.
    fast = np.flatnonzero(np.abs(rate) > 0.05 * np.max(np.abs(rate), initial=0.0))
    turns = np.flatnonzero(np.diff(np.sign(rate[fast])) != 0)
    return angle[(fast[turns] + fast[turns + 1]) // 2]


def simulated(
    run: Run,
    states: ForceStates,
    model: JointModel,
    effects: Sequence[FittedEffect],
    by: Drive | None = None,
) -> SimulatedRun | None:
    """Return a run beside its simulation with the channel errors that were found put right.

    None where it failed, or the drive is another than it has to be.
    """
    spend(STEP_SAMPLES * states.n_samples)
    found = Corrections.of(effects)
    shift, zero, drift = found.shift, found.zero, found.drift
    motion = prescribed(states, inertia=model.inertia)
    if shift and not motion:
        # The states were moved to meet the late moment; here the moment is moved, so they go back to their own time.
        run = replace(run, moment=np.interp(run.time + shift, run.time, run.moment), source=None)
        states = shifted(states, -shift)
    if zero:
        run = replace(run, angle=run.angle - zero, source=None)
        states = replace(states, angle=states.angle - zero)
    if drift:
        run = replace(run, angle=run.angle - drift * _drifting_time(states, run.time), source=None)
        states = replace(states, angle=states.angle - drift * _drifting_time(states, states.time))
    try:
        law = law_of(model, effects, states)
        drive: Drive = "motion" if motion else choose_drive(law, states)
        if by not in (None, drive):
            return None
        most = STEPS_PER_SAMPLE * states.n_samples
        return simulate_run(law, run, states, drive=drive, most_steps=most)
    except SindyJointError:
        # Snap-through, a negative inertia, or a law that no simulation can follow: the gap says so by having no figure.
        return None


def as_recorded(
    angle: Array, time: Array, sample_rate: float, states: ForceStates, effects: Sequence[FittedEffect]
) -> Array:
    """Return a simulated angle with the errors of the channels back in it, as states moved to meet the moment have it.

    ``time`` is that of its samples in the run, s.
    """
    found = Corrections.of(effects)
    seen = angle + found.zero + found.drift * _drifting_time(states, time)
    return delayed(seen, found.shift * sample_rate) if found.shift else seen


def _drifting_time(states: ForceStates, time: Array) -> Array | float:
    """Return the time by which a channel has drifted, s: what repeats is as it is in its middle."""
    return float(np.mean(states.time)) if states.method == "periodic" else time
