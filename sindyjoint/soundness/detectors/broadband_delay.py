"""A delay between the channels of runs that do not repeat, by regression over their force states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from sindyjoint.discovery.delay import estimate_delay, law_of_channels, reference_of, shifted
from sindyjoint.equation.catalogue import term_columns
from sindyjoint.equation.terms import ResolvedTerm
from sindyjoint.errors import SindyJointError
from sindyjoint.numeric import Array, scaled_least_squares
from sindyjoint.record import Campaign, Run
from sindyjoint.soundness.detectors.shape import RIVALS
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.words import Words
from sindyjoint.states.build import force_states
from sindyjoint.states.record import ForceStates

# Reaches of memory that are tried, in parts of the swing or of the time in which it is swept.
MEMORIES = (0.03, 0.1, 0.3, 1.0)


def find_broadband_delay(campaign: Campaign, runs: Sequence[Run], words: Words) -> Iterator[Finding]:
    """Yield the delay of a campaign without declared frequencies, where removing it restores the paper's law.

    Parameters
    ----------
    campaign : Campaign
    runs : sequence of Run
        Those that may be looked at; the first ones are, up to a number of samples.
    words : Words
    """
    alive = [r for r in runs if np.ptp(r.moment) > 0 and np.ptp(r.angle) > 0]
    if not alive or any(r.frequency is not None for r in runs):
        return
    sizes = np.cumsum([r.n_samples for r in alive])
    chosen = alive[: max(1, int(np.count_nonzero(sizes <= POLICY.delay_samples)))]
    try:
        found = _measure(chosen, campaign.joint.inertia)
    # A joint that hardly moves, too short a run, states that are all alike or beyond what squares can hold.
    except (SindyJointError, np.linalg.LinAlgError, ValueError):
        return
    if found is None:
        return
    time, error = found
    yield Finding(
        "channel_delay",
        None,
        "moment",
        "biases",
        f"the {words.moment} {'lags' if time > 0 else 'leads'} the {words.angle} by {1e3 * abs(time):.3g} ± "
        f"{1e3 * error:.2g} ms",
        f"shifts c1 by about {-time:+.2g} s times k1, and makes damping of the inertia and of k3",
        "check the common trigger, run with --align, or declare [channels] skew",
    )


def _measure(runs: Sequence[Run], inertia: float | None) -> tuple[float, float] | None:
    """Return a delay that stands out and its standard error, s, or None."""
    states = [force_states(run) for run in runs]
    terms = law_of_channels(inertia).resolve(reference_of(states))
    delay = estimate_delay(states, terms, inertia)
    if not (delay.significant and POLICY.least_delay < abs(delay.time) < POLICY.longest_broadband):
        return None
    before = _misfit(states, terms, inertia)
    left = _misfit([shifted(s, delay.time) for s in states], terms, inertia)
    won = (before / max(left, 1e-12)) ** 2 - 1
    if not (won > POLICY.broadband_gain and left < POLICY.broadband_left):
        return None
    # A law with memory lags as well, and damping shifts a phase: what either explains better is no fault of the data.
    explained = min(_misfit(states, terms, inertia, column) for column in _rivals(states))
    if explained < POLICY.broadband_memory * left:
        return None
    # A delay is the same in every run; what a law shifts is not.
    delay = replace(delay, standard_error=max(delay.standard_error, _scatter(states, terms, inertia)))
    return (delay.time, delay.standard_error) if delay.significant else None


def _scatter(states: Sequence[ForceStates], terms: Sequence[ResolvedTerm], inertia: float | None) -> float:
    """Return the standard error of the mean of the delays of single runs, s; zero of fewer than three."""
    if len(states) < 3:
        return 0.0
    times = [estimate_delay([each], terms, inertia).time for each in states]
    return float(np.std(times, ddof=1) / np.sqrt(len(times)))


def _each_direction(angle: Array, rate: Array) -> Array:
    """Return the column of damping that differs between the directions."""
    return np.abs(rate)


def _rivals(states: Sequence[ForceStates]) -> Iterator[Sequence[Array]]:
    """Yield columns that may pass for a delay, an array for each of the states given.

    Those of damping and stiffness, and the states of laws with memory: relaxation, ż = ω − z/τ, and friction that comes
    late, τ·ż = sgn ω − z, over times about that of the motion, and presliding, dz/dθ = 1 − sgn(ω)·z/θ_y (Dahl 1968),
    over angles below the largest.
    """
    swing = max(float(np.max(np.abs(s.angle))) for s in states)
    fastest = max(float(np.max(np.abs(s.rate))) for s in states)
    for rival in (*RIVALS, _each_direction):
        yield [rival(s.angle / swing, s.rate / fastest) for s in states]
    for share in MEMORIES:
        time = share * swing / fastest
        yield [_relaxed(s.angle, 1 / s.sample_rate, time) for s in states]
        yield [_late(np.sign(s.rate), 1 / s.sample_rate, time) for s in states]
        yield [_along_path(s.angle, share * swing) for s in states]


def _relaxed(angle: Array, step: float, time: float) -> Array:
    forget = np.exp(-step / time)
    return np.asarray(lfilter([1.0], [1.0, -forget], np.diff(angle, prepend=angle[0])))


def _late(sign: Array, step: float, time: float) -> Array:
    forget = np.exp(-step / time)
    return np.asarray(lfilter([1.0 - forget], [1.0, -forget], sign))


def _along_path(angle: Array, reach: float) -> Array:
    """Return the presliding state: over the travelled path it is a relaxation."""
    path = np.cumsum(np.abs(np.diff(angle, prepend=angle[0])))
    # Noise travels, too: no finer than there are samples.
    grid = np.linspace(0.0, path[-1], int(np.clip(path[-1] / reach * 20, 100, 4 * angle.size)))
    state = _relaxed(np.interp(grid, path, angle), grid[1], reach)
    return np.asarray(np.interp(path, grid, state))


def _misfit(
    states: Sequence[ForceStates],
    terms: Sequence[ResolvedTerm],
    inertia: float | None,
    column: Sequence[Array] = (),
) -> float:
    """Return the RMS that the law, with a column more if given, leaves of the moving samples, per the moment's."""
    columns = np.vstack(
        [term_columns(terms, s.angle[s.moving], s.rate[s.moving], s.acceleration[s.moving]) for s in states]
    )
    if column:
        more = np.concatenate([z[s.moving] for z, s in zip(column, states, strict=True)])
        columns = np.column_stack([columns, more])
    target = np.concatenate([s.transfer_moment(inertia or 0.0)[s.moving] for s in states])
    rest = target - columns @ scaled_least_squares(columns, target)
    return float(np.sqrt(np.mean(rest**2) / max(float(np.mean(target**2)), 1e-300)))
