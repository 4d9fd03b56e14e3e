"""From measured moment and angle to force states (θ, θ̇, θ̈, M, moving), run by run.

By what a run is known decides how its states are made, and its channels are aligned before.
"""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from sindyjoint.errors import InputError, StandstillError
from sindyjoint.inputs import lagged
from sindyjoint.limits import STATES
from sindyjoint.measurement import WIDEST, interpolated
from sindyjoint.numeric import Array, delayed, kept, main_frequency, smoothing_kernels
from sindyjoint.record import MINIMUM_SAMPLES, Campaign, Run
from sindyjoint.states.broadband import BLOCKS, broadband_states, dwells, path_states
from sindyjoint.states.floor import (
    Floor,
    larger_moment,
    mean_period,
    mean_slope,
    moment_floor,
    moment_size,
    repetition,
    transfer_noise,
    with_scatter,
)
from sindyjoint.states.harmonics import (
    FIRST_ORDERS,
    HarmonicBasis,
    fitted_motion,
    local_noise,
    record_series,
    refine_frequency,
    significant_harmonics,
    unsteady_periods,
)
from sindyjoint.states.periodic import (
    BAND_SHARE,
    MAXIMUM_HARMONICS,
    REPLICATES,
    cut_blocks,
    periodic_states,
    reversal_guard,
)
from sindyjoint.states.record import (
    ForceStates,
    Harmonics,
    NoiseFloor,
    RegressionRows,
    group_labels,
    moving_mask,
    rate_limit,
    regression_rows,
    without_noise_travel,
)

__all__ = [
    "BAND_SHARE",
    "BLOCKS",
    "Choice",
    "FIRST_ORDERS",
    "Floor",
    "ForceStates",
    "HarmonicBasis",
    "Harmonics",
    "MAXIMUM_HARMONICS",
    "NoiseFloor",
    "REPLICATES",
    "RegressionRows",
    "WIDEST",
    "aligned_run",
    "broadband_states",
    "campaign_states",
    "check_bandwidth",
    "content_hash",
    "cut_blocks",
    "dwells",
    "fitted_motion",
    "force_states",
    "group_labels",
    "larger_moment",
    "local_noise",
    "mean_period",
    "mean_slope",
    "moment_floor",
    "moment_size",
    "moving_mask",
    "one_after_another",
    "rate_limit",
    "record_series",
    "refine_frequency",
    "regression_rows",
    "repetition",
    "reversal_guard",
    "run_hash",
    "signals_hash",
    "significant_harmonics",
    "smoothing_kernels",
    "states_of",
    "unsteady_periods",
    "transfer_noise",
    "with_lags",
    "with_later_motion",
    "without_noise_travel",
]


Choice = Literal["auto", "periodic", "broadband"]


def force_states(
    run: Run, method: Choice = "auto", bandwidth: float | None = None, rate_share: float | None = None
) -> ForceStates:
    """Return the force states of a run.

    Parameters
    ----------
    run : Run
    method : {"auto", "periodic", "broadband"}
        ``"auto"``: periodic where the run repeats at its declared (or, without one, its estimated) frequency for
        at least three steady periods, otherwise broadband; a multisine that repeats three times is averaged first.
    bandwidth : float, optional
        Highest frequency kept in the angle, Hz. Default: where the angle falls to its noise.
    rate_share : float
        Share of the peak rate below which a sample of a periodic run counts as reversal, not as motion. Default: 0.05.
        It is 0.02 of a broadband run, and 0.1 where its joint sticks.

    Raises
    ------
    InputError
        For an unknown method, a run too short for it, or a run in which the joint hardly ever moves.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> states = sindyjoint.force_states(test.runs[0])
    >>> states.angle.shape == states.moment.shape
    True
    """
    return _make_states(run, method, bandwidth, rate_share)


def check_bandwidth(bandwidth: float | None) -> None:
    """Refuse a highest frequency that is none."""
    if bandwidth is not None and not bandwidth > 0:
        raise InputError(f"bandwidth is {bandwidth!r} Hz; expected a positive number")


# A check of the data, the search and what trusts its result take the same ones.
@kept
def _make_states(run: Run, method: Choice, bandwidth: float | None, rate_share: float | None) -> ForceStates:
    if method not in ("auto", "periodic", "broadband"):
        raise InputError(f"method is {method!r}; expected 'auto', 'periodic' or 'broadband'")
    check_bandwidth(bandwidth)
    if run.quasi_static:
        if method != "auto" or bandwidth is not None:
            raise InputError(
                f"{run.label}: its samples have no time: nothing is filtered; leave out the method of the states and "
                "the bandwidth"
            )
        return path_states(run)
    if method == "periodic" or (method == "auto" and repeats(run)):
        if run.frequency is None:
            run = replace(run, frequency=estimate_frequency(run))
        states = periodic_states(run, bandwidth, rate_share)
    elif method == "auto" and (period := repetition(run)) is not None:
        states = _average_periods(run, period, bandwidth)
    else:
        states = broadband_states(run, bandwidth)
    count = int(np.count_nonzero(states.moving))
    # Pure noise exceeds four of its standard errors now and then.
    if count < MINIMUM_SAMPLES:
        aside = f", {states.dropped:.2g} s at either end aside that smoothing takes" if states.dropped else ""
        raise StandstillError(
            f"{run.label}: {count or 'no'} moving samples: the velocity hardly rises above its noise "
            f"({states.noise.rate:.2g} rad/s or m/s){aside}; expected a larger excitation, a longer record, a less "
            "noisy motion channel, its [[run]] taken out of the manifest, or time = 'none' where the samples were not "
            "taken at a known rate"
        )
    return states


def _average_periods(run: Run, period: int, bandwidth: float | None) -> ForceStates:
    """Return the broadband states of a run's mean period, timed from the start of the averaged periods.

    The noise of the mean moment is that of the periods about it, over the root of their number.
    """
    mean, first = mean_period(run, period)
    states = broadband_states(mean, bandwidth, repeated=True)
    start = first / run.sample_rate
    noise = states.noise
    if run.noise.moment is None:
        stack = run.moment[first : first + (run.n_samples - first) // period * period].reshape(-1, period)
        scatter = float(np.sqrt(np.mean(np.var(stack, axis=0, ddof=1)) / stack.shape[0]))
        noise = replace(noise, moment=scatter, measured=True, source="mean periods")
    return replace(states, time=states.time + start, dropped=start, noise=noise)


def campaign_states(
    campaign: Campaign,
    method: Choice = "auto",
    bandwidth: float | None = None,
    rate_share: float | None = None,
) -> tuple[ForceStates, ...]:
    """Return the force states of every run that may be used for identification.

    Parameters
    ----------
    campaign : Campaign
    method, bandwidth, rate_share
        As of :func:`force_states`.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> states = sindyjoint.campaign_states(test)
    >>> 0.5 < states[0].moving.mean() < 0.6
    np.True_
    """
    runs = campaign.identification_runs
    if not runs:
        raise InputError("every run is marked use = 'validate'; expected at least one run to identify from")
    return states_of(campaign, runs, method, bandwidth, rate_share)


def states_of(
    campaign: Campaign,
    runs: Sequence[Run],
    method: Choice = "auto",
    bandwidth: float | None = None,
    rate_share: float | None = None,
) -> tuple[ForceStates, ...]:
    """Return the force states of some runs of a campaign; the noise of a moment is no less than what repeats show."""
    made = (force_states(run, method, bandwidth, rate_share) for run in runs)
    return tuple(with_scatter(states, campaign.joint.inertia) for states in made)


def estimate_frequency(run: Run) -> float:
    """Return the frequency of the strongest line of the angle's spectrum, Hz, interpolated between bins."""
    return main_frequency(run.angle, run.sample_rate, between_bins=True)


def repeats(run: Run) -> bool:
    """Return whether the second half of the run repeats with the excitation frequency.

    The frequency is the declared one, or else the strongest line; the run repeats when shifting it by one period
    changes it by less than 0.2·√2 of its RMS (independent noise of 20 % in both halves). What no moment drives at that
    frequency dies away, however slowly.
    """
    frequency = run.frequency if run.frequency is not None else estimate_frequency(run)
    per = run.sample_rate / frequency
    if per < 10 or run.n_samples < (STATES.fewest + 0.5) * per or not _driven_at(run, frequency):
        return False
    late = run.angle[run.n_samples // 3 :]
    usable = int(late.size - np.ceil(per))
    spread = float(np.std(late))
    if usable < per or spread == 0:
        return False

    def alike(lag: float) -> bool:
        grid = np.arange(late.size)
        count = int(late.size - np.ceil(lag))
        change = np.interp(grid[:count] + lag, grid, late) - late[:count]
        return bool(np.sqrt(np.mean(change**2)) <= STATES.large_part * np.sqrt(2) * spread)

    if run.frequency is not None:
        return alike(per)
    # Undeclared: a slow decay repeats from one period to the next; it must also repeat across the record.
    lag = int(usable / per / 2) * per
    return lag >= 2 * per and alike(per) and alike(lag)


def _driven_at(run: Run, frequency: float) -> bool:
    """Return whether the moment has a line at a frequency that stands out of the rest of it as of white noise."""
    wave = np.exp(-2j * np.pi * frequency / run.sample_rate * np.arange(run.n_samples))
    moment = run.moment - np.mean(run.moment)
    line = abs(wave @ moment) * np.sqrt(2 / run.n_samples)
    rest = max(float(moment @ moment) - line**2, 0.0) / run.n_samples
    return bool(line > STATES.stands_out * np.sqrt(rest))


def one_after_another(campaign: Campaign, states: Sequence[ForceStates]) -> tuple[ForceStates, ...]:
    """Return the states with the start of their run, as if the runs had followed one another without a break."""
    ends = np.cumsum([run.duration for run in campaign.runs])
    starts = {run.name: float(end - run.duration) for run, end in zip(campaign.runs, ends, strict=True)}
    return tuple(replace(s, began=starts[s.run]) for s in states)


def content_hash(campaign: Campaign) -> str:
    """Return the hash by which a campaign is known: of the samples, rates and frequencies of its runs.

    What a run is used for, and where its file lies, do not change it.
    """
    digest = hashlib.sha256(campaign.joint.motion.encode())
    for run in campaign.runs:
        digest.update(repr((run.name, float(run.sample_rate), run.frequency, run.n_samples)).encode())
        digest.update(b"".join(_content(run)))
    return f"sha256:{digest.hexdigest()}"


def run_hash(run: Run) -> str:
    """Return the hash by which a run is known, whatever its name: of its samples and their rate."""
    return signals_hash(run.sample_rate, _content(run))


def signals_hash(sample_rate: float, signals: Iterable[bytes | Array]) -> str:
    """Return the hash of what was recorded at a rate, Hz."""
    digest = hashlib.sha256(repr(float(sample_rate)).encode())
    for signal in signals:
        digest.update(signal if isinstance(signal, bytes) else np.ascontiguousarray(signal).tobytes())
    # Two of a million runs would share so many digits in one of 10⁷ cases.
    return digest.hexdigest()[:16]


def _content(run: Run) -> list[bytes]:
    parts = [b"-" if signal is None else np.ascontiguousarray(signal).tobytes()
             for signal in (run.moment, run.angle, run.rate)]  # fmt: skip
    parts += [
        name.encode() + np.ascontiguousarray(values).tobytes() for name, values in sorted(run.inputs.items())
    ]
    return parts + ([run.source.sha256.encode()] if run.whole is not None and run.source is not None else [])


def aligned_run(run: Run, delay: float) -> Run:
    """Return a run whose motion comes ``delay`` s later, by cubic splines, without the ends where it is not known.

    A lag of the moment behind the motion is thereby undone.
    """
    lost = int(np.ceil(abs(delay * run.sample_rate))) + 1
    kept = slice(lost, run.n_samples - lost)
    later = with_later_motion(run, delay)
    rate = None if later.rate is None else later.rate[kept]
    valid = None if run.valid is None else run.valid[kept]
    inputs = {name: values[kept] for name, values in run.inputs.items()}
    moment = run.moment[kept]
    return interpolated(
        replace(run, angle=later.angle[kept], rate=rate, moment=moment, valid=valid, inputs=inputs), run
    )


def with_later_motion(run: Run, delay: float) -> Run:
    """Return a run whose motion comes ``delay`` s later, as long as it was: at its ends it stands still."""
    samples = delay * run.sample_rate
    rate = None if run.rate is None else delayed(run.rate, samples)
    return interpolated(replace(run, angle=delayed(run.angle, samples), rate=rate), run)


def with_lags(campaign: Campaign, lags: Mapping[str, float]) -> Campaign:
    """Return a campaign whose inputs are as the joint follows them; lags that are declared stay.

    Parameters
    ----------
    campaign : Campaign
    lags : mapping of str to float
        Time constants, s, by the names of inputs.
    """
    own = {each.name: lags.get(each.name, 0.0) for each in campaign.inputs if not each.lag}
    own = {name: time for name, time in own.items() if time}
    if not own or campaign.quasi_static:
        return campaign
    runs = tuple(
        replace(run, inputs={n: lagged(v, own.get(n, 0.0) * run.sample_rate) for n, v in run.inputs.items()})
        for run in campaign.runs
    )
    inputs = tuple(replace(each, lag=own.get(each.name, each.lag)) for each in campaign.inputs)
    return replace(campaign, runs=runs, inputs=inputs)
