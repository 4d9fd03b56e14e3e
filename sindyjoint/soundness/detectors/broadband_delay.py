"""A delay between the channels of runs that do not repeat, by regression over their force states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sindyjoint.discovery.delay import estimate_delay, law_of_channels, reference_of, shifted
from sindyjoint.equation.catalogue import term_columns
from sindyjoint.equation.terms import ResolvedTerm
from sindyjoint.errors import SindyJointError
from sindyjoint.numeric import scaled_least_squares
from sindyjoint.record import Campaign, Run
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.words import Words
from sindyjoint.states.build import force_states
from sindyjoint.states.record import ForceStates


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
    size, contrast = abs(delay.time), abs(delay.time) / max(delay.standard_error, 1e-300)
    if not (POLICY.least_delay < size < POLICY.longest_broadband and contrast > POLICY.broadband_contrast):
        return None
    before = _misfit(states, terms, inertia)
    left = _misfit([shifted(s, delay.time) for s in states], terms, inertia)
    won = (before / max(left, 1e-12)) ** 2 - 1
    stands = won > POLICY.broadband_gain and left < POLICY.broadband_left
    return (delay.time, delay.standard_error) if stands else None


def _misfit(states: Sequence[ForceStates], terms: Sequence[ResolvedTerm], inertia: float | None) -> float:
    """Return the RMS that the law leaves of the moving samples, in parts of the moment's."""
    columns = np.vstack(
        [term_columns(terms, s.angle[s.moving], s.rate[s.moving], s.acceleration[s.moving]) for s in states]
    )
    target = np.concatenate([s.transfer_moment(inertia or 0.0)[s.moving] for s in states])
    rest = target - columns @ scaled_least_squares(columns, target)
    return float(np.sqrt(np.mean(rest**2) / max(float(np.mean(target**2)), 1e-300)))
