"""The floor of every model: the part of the moment that no law of the motion explains, for it does not repeat.

The end of a spectrum shows the noise of a sensor. It does not show that a joint is not the same from one cycle to the
next. Where two periods of a run have the same motion, though the run as a whole starts, ramps or ends, the
difference of their moments is what no law of the motion can explain. Where the excitation repeats though it is no
sinusoid, the periods of a multisine, they are averaged into one.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy

from sindyjoint.limits import STATES
from sindyjoint.numeric import Array, convolve, main_frequency, scaled_least_squares, smoothing_kernels
from sindyjoint.record import Run
from sindyjoint.states.record import ForceStates


def repetition(run: Run) -> int | None:
    """Return the number of samples after which a run repeats itself, or None where it does not.

    The shortest lag at which angle and moment both come back within 15 % of their RMS, for at least three periods,
    and no farther away with each of them. Only whole numbers of samples are found, as signal generators make them.

    Parameters
    ----------
    run : Run
    """
    late = run.n_samples // STATES.fewest
    if late < STATES.shortest_repetition:
        return None
    angle, moment = (signal - np.mean(signal) for signal in (run.angle, run.moment))
    if not np.any(moment) or not np.any(angle):
        return None
    likeness = np.minimum(_autocorrelation(angle), _autocorrelation(moment))
    near = likeness[STATES.shortest_repetition : late + 1]
    passing = np.flatnonzero(near > 1 - STATES.alike**2)
    if not passing.size:
        return None
    top = int(passing[0])
    while top + 1 < near.size and near[top + 1] > near[top]:
        top += 1
    lag = STATES.shortest_repetition + top
    alike = all(
        np.std(late_part[lag:] - late_part[:-lag]) <= STATES.alike * np.sqrt(2) * np.std(late_part)
        for late_part in (angle[run.n_samples // 4 :], moment[run.n_samples // 4 :])
    )
    if not alike or _departs(angle, lag) or _departs(moment, lag):
        return None
    wasted = run.n_samples % lag
    return lag if wasted <= STATES.minor_share * run.n_samples else None


def _departs(signal: Array, lag: int) -> bool:
    """Return whether a signal is farther away after two periods than after one: it only nearly repeats.

    What repeats differs by its noise, as much after two periods as after one. Lines whose frequencies have no common
    period differ by a growing phase, twice as much; their mean period does not close, and holds no noise.
    """
    late = signal[max(signal.size // 4, signal.size - 3 * lag) :]
    first, second, third = late[: -2 * lag], late[lag:-lag], late[2 * lag :]
    one = float(np.sqrt(np.mean((second - first) ** 2 + (third - second) ** 2) / 2))
    two = float(np.sqrt(np.mean((third - first) ** 2)))
    return two > max(STATES.clearly * one, STATES.small_share * float(np.std(signal)))


def mean_period(run: Run, period: int) -> tuple[Run, int]:
    """Return one mean period of a run that repeats, and the first sample of the periods that it is the mean of.

    A first period that differs more from the others than these differ among themselves is left out.

    Parameters
    ----------
    run : Run
    period : int
        Samples.
    """
    count = run.n_samples // period
    stacks = {
        name: getattr(run, name)[: count * period].reshape(count, period)
        for name in ("angle", "moment", "rate")
        if getattr(run, name) is not None
    }
    angle = stacks["angle"]
    away = np.sqrt(np.mean((angle[:-1] - angle[-1]) ** 2, axis=1))
    skipped = 1 if count > STATES.fewest - 1 and away[0] > STATES.clearly * np.median(away[1:]) else 0
    valid, weight = None, None
    if run.valid is not None:
        weight = run.valid[: count * period].reshape(count, period)[skipped:].astype(float)
        valid = np.asarray(weight.any(axis=0))
        # An instant that is valid in no period keeps what was interpolated.
        weight[:, ~valid] = 1.0
    mean: dict[str, Any] = {
        name: np.average(stack[skipped:], axis=0, weights=weight) for name, stack in stacks.items()
    }
    # An input that changes from period to period is no part of what repeats: its mean over them is.
    inputs = {
        name: values[: count * period].reshape(count, period)[skipped:].mean(axis=0)
        for name, values in run.inputs.items()
    }
    fewer = 1 / float(np.sqrt(count - skipped))
    noise, fusion = run.noise.scaled(fewer), run.fusion and run.fusion.scaled(fewer)
    found = replace(run, source=None, noise=noise, valid=valid, inputs=inputs, fusion=fusion, **mean)
    return found, skipped * period


def mean_slope(signal: Array, sample_rate: float, states: ForceStates) -> tuple[float, float, float, float]:
    """Return slope per RMS, its standard error, the duration and the slope itself, from means of whole periods."""
    start = int(round(states.dropped * sample_rate))
    part = signal[start : start + states.n_samples]
    edges = np.round(np.arange(0, part.size + 1, sample_rate / states.fundamental)).astype(int)
    edges = edges[edges <= part.size]
    means = np.add.reduceat(part[: edges[-1]], edges[:-1]) / np.diff(edges)
    if means.size < 4 or not np.ptp(part):
        return 0.0, np.inf, 0.0, 0.0
    time = (edges[:-1] + edges[1:]) / 2 / sample_rate
    centred = time - time.mean()
    spread = centred @ centred
    slope = float(centred @ means / spread)
    residual = means - means.mean() - slope * centred
    error = float(np.sqrt(residual @ residual / max(means.size - 2, 1) / spread)) + 1e-12 * float(
        np.std(part)
    )
    rms = float(np.std(part))
    return slope / rms, error / rms, part.size / sample_rate, slope


def _autocorrelation(signal: Array) -> Array:
    """Return the normalised correlation of a signal with itself at every lag, each over the samples that overlap."""
    n = signal.size
    product = convolve(signal, signal[::-1], mode="full")[n - 1 :]
    square = np.cumsum(signal**2)
    head, tail = square[::-1], square[-1] - np.concatenate([[0.0], square[:-1]])
    return product / np.maximum(np.sqrt(head * tail), 1e-300)


#: What showed the noise of a moment, in words.
SOURCES = {
    "declared": "declared",
    "periods": "from the periods of each run",
    "steady periods": "from periods of one motion inside the runs",
    "mean periods": "from the periods of the excitation",
    "spectrum": "from the end of the spectrum",
    "coherent": "at most, as signal reaches the end of the spectrum",
    "neighbours": "at most, from samples of nearly one state, half a period or more apart",
}
#: What shows an upper bound only: a joint with memory has another moment in the same state, too.
BOUNDS = {"coherent", "neighbours"}
UNKNOWN = "the data do not show how far they repeat"


@dataclass(frozen=True)
class Floor:
    """What of the transfer moment of some runs does not repeat.

    Parameters
    ----------
    moment : float
        RMS over moving samples, N·m (N); NaN where most of it is not known.
    relative : float
        The same as a share of the RMS of the transfer moment.
    words : str
        What showed it.
    bound : bool
        Whether it is an upper bound: a gap below it may be noise, or not.
    """

    moment: float
    relative: float
    words: str
    bound: bool = False


def moment_floor(states: Sequence[ForceStates], inertia: float | None, bounded: bool = False) -> Floor:
    """Return the floor of some runs, pooled over their moving samples, whatever law explains them.

    The noise of a transfer moment is that of the moment, the inertia's times that of the acceleration, and what noise
    of a motion that does not repeat adds through the slopes of the moment over angle and rate. The noise of the motion
    must be known where it would matter were it twice as large.

    Parameters
    ----------
    states : sequence of ForceStates
    inertia : float or None
        Between the sensor and the joint, kg·m² (kg); None where it is identified: that of the linear law then.
    bounded : bool
        Whether what samples of nearly one state bound stands for a noise that nothing shows.
    """
    weight = np.array([np.count_nonzero(s.moving) for s in states], dtype=float)
    law = _law(states, inertia)
    motion = [_of_motion(s, law) for s in states]
    sources = [_source(s, each, bounded) for s, each in zip(states, motion, strict=True)]
    known = np.array([source is not None for source in sources], dtype=bool)
    size = moment_size(states, inertia)
    if not weight[known].sum() > 0.5 * weight.sum():
        return Floor(float("nan"), float("nan"), UNKNOWN)
    # What neighbours differ by holds the noise of the motion, too.
    variance = [
        (s.noise.at_most or 0.0) ** 2 if source == "neighbours" else s.noise.moment**2 + each
        for s, each, source in zip(states, motion, sources, strict=True)
    ]
    moment = float(np.sqrt(np.average(np.array(variance)[known], weights=weight[known])))
    used = [source for source in sources if source]
    words = ", ".join(SOURCES[name] for name in dict.fromkeys(used))
    return Floor(moment, moment / size if size > 0 else float("nan"), words, not BOUNDS.isdisjoint(used))


def _law(states: Sequence[ForceStates], inertia: float | None) -> Array:
    """Return k1, k2, k3, c, I of the law k1 θ + k2 θ² + k3 θ³ + c θ̇ + I θ̈ + M_F sign θ̇ + M_0 nearest to the moment."""
    columns = [(s.angle, s.angle**2, s.angle**3, s.rate, s.acceleration, np.sign(s.rate)) for s in states]
    rows = np.hstack([np.array(each)[:, s.moving] for each, s in zip(columns, states, strict=True)]).T
    rows = np.column_stack([rows, np.ones(len(rows))])
    moment = np.concatenate([s.transfer_moment(inertia or 0.0)[s.moving] for s in states])
    if inertia is not None:
        rows[:, 4] = 0.0
    found = scaled_least_squares(rows, moment, 1e-9)[:5] if len(rows) else np.zeros(5)
    if inertia is not None:
        found[4] = inertia
    return found


def _of_motion(states: ForceStates, law: Array) -> float:
    """Return the variance that the noise of angle, rate and acceleration makes of the moment of a law, (N·m)².

    mean tᵀ Σ t over the moving samples, with t = (∂M/∂θ, c, I) and Σ the covariance of the three, which are made of one
    channel by linear operators.
    """
    angle = states.angle[states.moving]
    stiffness = law[0] + 2 * law[1] * angle + 3 * law[2] * angle**2
    tangent = np.array([stiffness, np.full(angle.size, law[3]), np.full(angle.size, law[4])])
    return float(np.sum(motion_covariance(states) * (tangent @ tangent.T))) / max(angle.size, 1)


def motion_covariance(states: ForceStates) -> Array:
    """Return the covariance of the noise of angle, rate and acceleration at one sample, shape (3, 3)."""
    if states.series and states.frequency is not None:
        angular = 2 * np.pi * states.frequency * states.series[0].orders
        made = np.array([np.ones_like(angular), 1j * angular, -(angular**2)])
        made = made * states.series[0].standard_error
        own_rate = len(states.series) > 1
    elif states.method == "broadband":
        kernels = smoothing_kernels(states.bandwidth, states.sample_rate)
        size = max(states.n_samples, kernels[0].size)
        density = states.white_noise(np.fft.rfftfreq(size, 1 / states.sample_rate)[1:])
        made = np.fft.rfft(np.array(kernels), size)[:, 1:] * density / np.sqrt(size // 2)
        own_rate = states.rate_measured
    else:
        return np.zeros((3, 3))
    covariance = np.asarray((made @ made.conj().T).real)
    if own_rate:
        covariance = np.diag([covariance[0, 0], states.noise.rate**2, states.noise.acceleration**2])
    return covariance


def moment_size(states: Sequence[ForceStates], inertia: float | None) -> float:
    """Return the RMS that gaps and floors are relative to: of the larger moment, over all moving samples."""
    squares = [larger_moment(s, inertia or 0.0)[s.moving] ** 2 for s in states]
    return float(np.sqrt(np.sum(np.concatenate(squares)) / max(sum(square.size for square in squares), 1)))


def _source(states: ForceStates, of_motion: float, bounded: bool) -> str | None:
    """Return what shows the noise of a run, or a bound of it where one is asked for; None where nothing does."""
    noise = states.noise
    if noise.measured and (noise.motion_measured or 4 * of_motion <= noise.moment**2):
        return noise.source
    return "neighbours" if bounded and noise.at_most is not None else None


def larger_moment(states: ForceStates, inertia: float) -> Array:
    """Return the moment at the sensor or in the joint, whichever is larger: a free decay has none at the sensor."""
    transfer = states.transfer_moment(inertia)
    return states.moment if np.mean(states.moment**2) >= np.mean(transfer**2) else transfer


def transfer_noise(states: ForceStates, inertia: float) -> float:
    """Return the noise of a single sample of the transfer moment, N·m: the sensor's, and I times that of θ̈."""
    return float(np.hypot(states.noise.moment, inertia * states.noise.acceleration))


# What motion and moment of samples that should be alike differ by, shapes (n, k) and (n,).
Pair = tuple[Array, Array]


def with_scatter(states: ForceStates, inertia: float | None) -> ForceStates:
    """Return the states of a run, the noise of its moment no less than what does not repeat in it."""
    if states.method != "broadband" or states.repeated:
        return states
    noise = states.noise
    scatter = scatter_of(_pairs(states, inertia))
    if scatter is None:
        if noise.measured and noise.motion_measured:
            return states
        return replace(states, noise=replace(noise, at_most=scatter_of(_neighbours(states, inertia))))
    # It holds the noise of the motion, which is counted for itself.
    scatter = float(np.sqrt(max(scatter**2 - _of_motion(states, _law([states], inertia)), 0.0)))
    if scatter <= noise.moment:
        return states
    return replace(states, noise=replace(noise, moment=scatter, measured=True, source="steady periods"))


def scatter_of(found: Iterable[Pair]) -> float | None:
    """Return the RMS of what the moment does not repeat in pairs of one motion, N·m; None where there are none.

    With the differences ΔM of the moments of a pair and those of its motion, s² = ½ mean (ΔM − a₁ Δθ − a₂ Δθ² − a₃ Δθ³
    − b Δθ̇)²: what a small difference of the motion makes of the moment is taken out to first order, by least squares
    over all pairs, with a stiffness that may change along the angle. M is the transfer moment; where the inertia is not
    known, Δθ̈ is a column, too.
    """
    pairs = list(found)
    if not pairs:
        return None
    motion, moment = map(np.concatenate, zip(*pairs, strict=True))
    left = moment - motion @ scaled_least_squares(motion, moment)
    return float(np.sqrt(0.5 * np.sum(left**2) / max(left.size - motion.shape[1], 1)))


def _pairs(states: ForceStates, inertia: float | None) -> Iterator[Pair]:
    """Yield neighbouring periods whose motion is the same within ``tolerated``, each laid over the other."""
    frequency = states.frequency or main_frequency(states.angle, states.sample_rate)
    per = int(round(states.sample_rate / frequency)) if frequency > 0 else 0
    # Samples of a period below which two of them cannot be laid over each other, and places to which one is shifted.
    shortest, places = 32, 41
    count = states.n_samples // per if per >= shortest else 0
    # Periods of a record beyond which more of them say nothing new.
    if count < 2 or count > 64:
        return
    signals, moment = _differing(states, inertia)
    reach = per // places
    for first in range(0, (count - 1) * per, per):
        early = slice(first, first + per)
        begins = np.unique(np.linspace(first + per - reach, first + per + reach, places).astype(int))
        begins = begins[begins + per <= states.n_samples]
        away = [float(np.mean((states.angle[b : b + per] - states.angle[early]) ** 2)) for b in begins]
        if not away or min(away) > 2 * (STATES.tolerated * np.std(states.angle[early])) ** 2:
            continue
        late = slice(begins[int(np.argmin(away))], begins[int(np.argmin(away))] + per)
        both = states.moving[early] & states.moving[late]
        if np.count_nonzero(both) >= shortest // 2:
            yield (signals[late] - signals[early])[both], (moment[late] - moment[early])[both]


def _neighbours(states: ForceStates, inertia: float | None) -> Iterator[Pair]:
    """Yield the samples that have one of nearly the same angle and rate half a period away or more, with it.

    The distance is in standard deviations of angle and rate. The estimate of noise from nearest neighbours is that of
    Stefánsson, Končar and Jones (Neural Comput. Appl. 5, 1997), with the differences of their motion taken out.
    """
    moving = np.flatnonzero(states.moving)
    moving, fewest = moving[:: 1 + moving.size // 40_000], 200
    state = np.column_stack([states.angle[moving], states.rate[moving]])
    spread = state.std(axis=0)
    frequency = states.frequency or main_frequency(states.angle, states.sample_rate)
    if moving.size < fewest or not spread.all() or not frequency > 0:
        return
    away, place = scipy.spatial.cKDTree(state / spread).query(
        state / spread, 9, distance_upper_bound=STATES.tolerated
    )
    other = moving[np.where(np.isfinite(away), place, 0)]
    apart = np.isfinite(away) & (np.abs(other - moving[:, None]) > states.sample_rate / frequency / 2)
    paired = apart.any(axis=1)
    if np.count_nonzero(paired) < fewest:
        return
    first, second = moving[paired], other[np.arange(moving.size), apart.argmax(axis=1)][paired]
    signals, moment = _differing(states, inertia)
    yield signals[second] - signals[first], moment[second] - moment[first]


def _differing(states: ForceStates, inertia: float | None) -> tuple[Array, Array]:
    """Return the signals of which a small difference changes the moment, a column each, and the moment."""
    motion = [states.angle, states.angle**2, states.angle**3, states.rate]
    motion += [states.acceleration] if inertia is None else []
    return np.column_stack(motion), states.transfer_moment(inertia or 0.0)
