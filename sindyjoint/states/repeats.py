"""What of the moment does not repeat where the motion does: the floor of every model, measured inside a run.

The end of a spectrum shows the noise of a sensor. It does not show that a joint is not the same from one cycle to the
next. Where two periods of a run have the same motion, though the run as a whole starts, ramps or ends, the
difference of their moments is what no law of the motion can explain.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from sindyjoint.numeric import Array, main_frequency
from sindyjoint.states.policy import POLICY
from sindyjoint.states.record import ForceStates

# Samples of a period below which two of them cannot be laid over each other, and places to which one is shifted for it.
SHORTEST, PLACES = 32, 41
# Periods of a record beyond which more of them say nothing new.
MOST_PERIODS = 64


class Pair(NamedTuple):
    """Two periods of one motion: differences of the motion (a column each) and of the moment, where the joint moves."""

    motion: Array
    moment: Array


def with_scatter(states: ForceStates, inertia: float | None) -> ForceStates:
    """Return the states of a run, the noise of its moment no less than what does not repeat in it."""
    if states.method != "broadband" or states.repeated:
        return states
    scatter = scatter_of_repeats(states, inertia)
    if scatter is None:
        return states
    # That of a transfer moment holds the noise of the acceleration, which is counted for itself.
    scatter = float(np.sqrt(max(scatter**2 - ((inertia or 0.0) * states.noise.acceleration) ** 2, 0.0)))
    if scatter <= states.noise.moment:
        return states
    return replace(
        states, noise=replace(states.noise, moment=scatter, measured=True, source="steady periods")
    )


def scatter_of_repeats(states: ForceStates, inertia: float | None) -> float | None:
    """Return the RMS of what the moment does not repeat in periods of one motion, N·m; None where none is repeated.

    With the differences ΔM of the moments of two periods and those of their motion, s² = ½ mean (ΔM − a₁ Δθ − a₂ Δθ² −
    a₃ Δθ³ − b Δθ̇)²: what a small difference of the motion makes of the moment is taken out to first order, by least
    squares over all pairs, with a stiffness that may change along the angle. M is the transfer moment; where the
    inertia is not known, Δθ̈ is a column, too.

    Parameters
    ----------
    states : ForceStates
        Of a run that does not repeat as a whole.
    inertia : float or None
        kg·m², as declared.
    """
    pairs = list(_pairs(states, inertia))
    if not pairs:
        return None
    motion = np.concatenate([pair.motion for pair in pairs])
    moment = np.concatenate([pair.moment for pair in pairs])
    scale = np.maximum(np.sqrt(np.mean(motion**2, axis=0)), 1e-300)
    coefficients = np.linalg.lstsq(motion / scale, moment, rcond=None)[0]
    left = moment - motion / scale @ coefficients
    return float(np.sqrt(0.5 * np.mean(left**2)))


def _pairs(states: ForceStates, inertia: float | None) -> Iterator[Pair]:
    """Yield neighbouring periods whose motion is the same within ``same_motion``, each laid over the other."""
    frequency = states.frequency or main_frequency(states.angle, states.sample_rate)
    per = int(round(states.sample_rate / frequency)) if frequency > 0 else 0
    count = states.n_samples // per if per >= SHORTEST else 0
    if count < 2 or count > MOST_PERIODS:
        return
    motion = [states.angle, states.angle**2, states.angle**3, states.rate]
    motion += [states.acceleration] if inertia is None else []
    signals, moment = np.column_stack(motion), states.transfer_moment(inertia or 0.0)
    reach = per // PLACES
    for first in range(0, (count - 1) * per, per):
        early = slice(first, first + per)
        begins = np.unique(np.linspace(first + per - reach, first + per + reach, PLACES).astype(int))
        begins = begins[begins + per <= states.n_samples]
        away = [float(np.mean((states.angle[b : b + per] - states.angle[early]) ** 2)) for b in begins]
        if not away or min(away) > 2 * (POLICY.same_motion * np.std(states.angle[early])) ** 2:
            continue
        late = slice(begins[int(np.argmin(away))], begins[int(np.argmin(away))] + per)
        both = states.moving[early] & states.moving[late]
        if np.count_nonzero(both) >= SHORTEST // 2:
            yield Pair((signals[late] - signals[early])[both], (moment[late] - moment[early])[both])
