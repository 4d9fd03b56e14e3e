"""What a discovery has to show, gathered into small arrays that are saved with it.

A campaign may hold millions of samples; pictures need some thousands. :func:`gather` makes them once, the page and
the figures draw from them, and ``figures/data.json`` keeps them, so that any figure can be drawn again later
without the measurements.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError
from sindyjoint.judgement.discovery import Discovery, estimates_by_group
from sindyjoint.judgement.over_inputs import OverInput
from sindyjoint.numeric import Array
from sindyjoint.states import ForceStates
from sindyjoint.states.surface import MAP_CELLS, ForceStateMap, force_state_map, map_of_states
from sindyjoint.trust import Trust

PHASE_BINS, TIME_BINS = 60, 40


@dataclass(frozen=True, eq=False)
class Loop:
    """One run as it is drawn: its moment–angle loop, and where its residual lies.

    Parameters
    ----------
    run : str
    frequency : float or None
        Hz.
    level : str or None
    method : str
    samples : int
    moving_fraction : float
    moment_noise : float
        Noise of single samples of the moment, N·m.
    residual_rms : float
        Of moving samples, N·m.
    angle, moment, model : ndarray, shape (m,)
        Consecutive samples: rad, measured and modelled transfer moment N·m. For a periodic run one period, closed.
    moving : ndarray of bool, shape (m,)
    time, residual_over_time : ndarray, shape (k,)
        s, RMS of the residual in intervals of the run, N·m; NaN where nothing moves.
    residual_over_phase : ndarray, shape (60,)
        Mean residual at the phase of the cycle counted from the largest angle, N·m; empty for aperiodic runs.
    """

    run: str
    frequency: float | None
    level: str | None
    method: str
    samples: int
    moving_fraction: float
    moment_noise: float
    residual_rms: float
    angle: Array
    moment: Array
    model: Array
    moving: NDArray[np.bool_]
    time: Array
    residual_over_time: Array
    residual_over_phase: Array


@dataclass(frozen=True, eq=False)
class PathStep:
    """One model of the threshold path.

    Parameters
    ----------
    terms : tuple of str
        Ids.
    threshold, residual_rms, held_out_rms, least_t : float
        Held-out error is NaN where nothing could be held out.
    """

    terms: tuple[str, ...]
    threshold: float
    residual_rms: float
    held_out_rms: float
    least_t: float


@dataclass(frozen=True, eq=False)
class GroupFit:
    """The chosen terms fitted to a single group (usually a frequency).

    Parameters
    ----------
    group : str
    coefficients, standard_errors : ndarray, shape (k,)
        In the order of the model's terms, SI.
    """

    group: str
    coefficients: Array
    standard_errors: Array


@dataclass(frozen=True, eq=False)
class ReportData:
    """Everything a report of a discovery shows, together with the model's record.

    Parameters
    ----------
    model : JointModel
    verdict, verdict_reason, selection_reason : str
    warnings : tuple of str
    loops : tuple of Loop
    surface, residual_map : ForceStateMap
        Averaged transfer moment, and averaged residual, of moving samples.
    upper, lower : ndarray, shape (17, 9)
        The model on a grid of angles (first axis) and of rates above and below zero, N·m. The friction step is the
        difference of the two at rate zero.
    path : tuple of PathStep
    chosen : int or None
        Index into path.
    candidates : tuple of str
    groups : tuple of GroupFit
    trust : Trust
    paper : bool
        Whether the question of the paper's five terms comes first.
    over : tuple of OverInput
        The law over each declared input.
    """

    model: JointModel
    verdict: str
    verdict_reason: str
    selection_reason: str
    warnings: tuple[str, ...]
    loops: tuple[Loop, ...]
    surface: ForceStateMap
    residual_map: ForceStateMap
    upper: Array
    lower: Array
    path: tuple[PathStep, ...]
    chosen: int | None
    candidates: tuple[str, ...]
    groups: tuple[GroupFit, ...]
    trust: Trust
    paper: bool = False
    over: tuple[OverInput, ...] = ()

    def __post_init__(self) -> None:
        cells = (self.surface.n, self.surface.n)
        shapes = [self.surface.moment.shape, self.surface.count.shape, self.residual_map.moment.shape]
        if not self.loops or any(shape != cells for shape in shapes) or self.upper.shape != self.lower.shape:
            raise InputError("expected loops and a square map")


def gather(result: Discovery) -> ReportData:
    """Return what a discovery has to show."""
    model, selection = result.model, result.selection
    states, inertia = result.states, model.inertia
    residuals = [
        state.transfer_moment(inertia) - model.moment(state.angle, state.rate, inputs=state.inputs)
        for state in states
    ]
    ids = result.regressor.evidence_.ids
    surface = map_of_states(states, inertia, MAP_CELLS)
    upper, lower = model_sheets(model, surface)
    return ReportData(
        model=model,
        verdict=result.verdict.verdict,
        verdict_reason=result.verdict.reason,
        selection_reason=result.reason,
        warnings=result.warnings,
        loops=tuple(_summarize_run(model, s, r, inertia) for s, r in zip(states, residuals, strict=True)),
        surface=surface,
        residual_map=force_state_map(
            np.concatenate([state.angle[state.moving] for state in states]),
            np.concatenate([state.rate[state.moving] for state in states]),
            np.concatenate([each[state.moving] for state, each in zip(states, residuals, strict=True)]),
            MAP_CELLS,
        ),
        upper=upper,
        lower=lower,
        path=tuple(
            PathStep(
                tuple(ids[c] for c in step.columns),
                step.threshold,
                step.fit.residual_rms,
                step.held_out_rms,
                float(step.fit.t_ratios.min()),
            )
            for step in selection.path
        ),
        chosen=selection.chosen,
        candidates=tuple(ids),
        groups=_fit_groups(result),
        paper=result.leads_with_paper,
        over=result.over_inputs,
        trust=result.trust,
    )


def model_sheets(model: JointModel, surface: ForceStateMap) -> tuple[Array, Array]:
    """Return the model's moment above and below zero rate on a grid over the map, N·m.

    Returns
    -------
    upper, lower : ndarray, shape (17, 9)
        First axis: angles over the map's range. Second axis of ``upper``: rates from just above zero to the top;
        of ``lower``: from the bottom to just below zero.
    """
    angles = np.linspace(surface.angle_edges[0], surface.angle_edges[-1], 17)
    top = float(surface.rate_edges[-1])
    rates = np.linspace(0.0, top, 9)
    rates[0] = 1e-9 * top
    grid = np.meshgrid(angles, rates, indexing="ij")
    return model.moment(*grid), model.moment(grid[0], -grid[1])[:, ::-1]


def _summarize_run(model: JointModel, state: ForceStates, residual: Array, inertia: float) -> Loop:
    shown, kept = _shown(state), residual[state.moving]
    centres, rms = _over_time(state, residual)
    return Loop(
        run=state.run,
        frequency=state.frequency,
        level=state.level,
        method=state.method,
        samples=state.n_samples,
        moving_fraction=state.moving_fraction,
        moment_noise=state.noise.moment,
        residual_rms=float(np.sqrt(np.mean(kept**2))) if kept.size else float("nan"),
        angle=state.angle[shown],
        moment=state.transfer_moment(inertia)[shown],
        model=model.moment(
            state.angle[shown], state.rate[shown], inputs={n: v[shown] for n, v in state.inputs.items()}
        ),
        moving=state.moving[shown],
        time=centres,
        residual_over_time=rms,
        residual_over_phase=_over_phase(state, residual),
    )


def _shown(state: ForceStates) -> NDArray[np.intp]:
    """Return the samples to draw: the middle period of a periodic run, some consecutive cycles of any other."""
    n = state.n_samples
    turns = np.count_nonzero(np.diff(np.sign(state.angle - np.mean(state.angle))) != 0) / 2
    period = n / max(turns, 1.0)
    if state.method == "periodic" and state.frequency is not None:
        period = state.sample_rate / state.frequency
        length = round(period) + 1
    else:
        # Twelve cycles, which leave 40 drawn samples to each.
        length = round(min(n, 12 * period)) if turns >= 2 else n
    start = max(0, (n - length) // 2)
    stop = min(n, start + max(length, 2))
    return np.arange(start, stop, max(1, -(-(stop - start) // 480)))


def _over_time(state: ForceStates, residual: Array) -> tuple[Array, Array]:
    edges = np.linspace(0, state.n_samples, min(TIME_BINS, state.n_samples) + 1).astype(int)
    interval = np.searchsorted(edges, np.arange(state.n_samples), side="right") - 1
    bins = edges.size - 1
    count = np.bincount(interval[state.moving], minlength=bins)
    with np.errstate(invalid="ignore"):
        mean = np.bincount(interval[state.moving], residual[state.moving] ** 2, minlength=bins) / count
    centre = 0.5 * (edges[1:] + edges[:-1] - 1)
    return np.interp(centre, np.arange(state.n_samples), state.time), np.sqrt(mean)


def _over_phase(state: ForceStates, residual: Array) -> Array:
    if state.method != "periodic" or state.frequency is None:
        return np.empty(0)
    turn = 2 * np.pi * state.frequency * state.time
    fundamental = np.mean((state.angle - np.mean(state.angle)) * np.exp(-1j * turn))
    phase = np.mod(turn + np.angle(fundamental), 2 * np.pi)
    bin_ = np.minimum((phase * PHASE_BINS / (2 * np.pi)).astype(int), PHASE_BINS - 1)[state.moving]
    count = np.bincount(bin_, minlength=PHASE_BINS)
    with np.errstate(invalid="ignore"):
        mean = np.bincount(bin_, residual[state.moving], minlength=PHASE_BINS) / count
    # A bin half of which sticks holds few samples, and their mean would show noise as a spike.
    return np.where(count >= 0.5 * np.median(count[count > 0]), mean, np.nan)


def _fit_groups(result: Discovery) -> tuple[GroupFit, ...]:
    """Return the model's terms fitted to each single group where there are several and each determines them."""
    if len(result.regressor.evidence_.groups) < 2 or not result.model.terms:
        return ()
    try:
        found = estimates_by_group(result)
    except np.linalg.LinAlgError:
        return ()
    fits = map(GroupFit, found.groups, found.coefficients, found.standard_errors)
    return tuple(fits) if found.ids == result.model.ids else ()


def run_labels(loops: Sequence[Loop]) -> dict[str, str]:
    """Return a short label of each run: frequency and level where they tell runs apart, else the name."""
    frequencies = ["" if loop.frequency is None else f"{loop.frequency:.3g} Hz" for loop in loops]
    labels = [
        " · ".join(filter(None, (frequency, loop.level)))
        for frequency, loop in zip(frequencies, loops, strict=True)
    ]
    return {
        loop.run: label if label and labels.count(label) == 1 else loop.run
        for label, loop in zip(labels, loops, strict=True)
    }
