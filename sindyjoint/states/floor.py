"""The floor of every model: the part of the moment that no law of the motion explains, for it does not repeat.

The end of a spectrum shows the noise of a sensor. It does not show that a joint is not the same from one cycle to the
next. Where two periods of a run have the same motion, though the run as a whole starts, ramps or ends, the
difference of their moments is what no law of the motion can explain.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sindyjoint.numeric import Array, main_frequency
from sindyjoint.states.policy import POLICY
from sindyjoint.states.record import ForceStates
from sindyjoint.states.smoothing import smoothing_kernels

#: What showed the noise of a moment, in words.
SOURCES = {
    "declared": "declared",
    "periods": "from the periods of each run",
    "steady periods": "from periods of one motion inside the runs",
    "mean periods": "from the periods of the excitation",
    "spectrum": "from the end of the spectrum",
    "coherent": "at most: from the end of a spectrum that still holds signal",
}
UNKNOWN = "the data do not show how far they repeat"
# Samples of a period below which two of them cannot be laid over each other, and places to which one is shifted for it.
SHORTEST, PLACES = 32, 41
# Periods of a record beyond which more of them say nothing new.
MOST_PERIODS = 64


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


def moment_floor(states: Sequence[ForceStates], inertia: float | None) -> Floor:
    """Return the floor of some runs, pooled over their moving samples, whatever law explains them.

    The noise of a transfer moment is that of the moment, the inertia's times that of the acceleration, and what noise
    of a motion that does not repeat adds through the slopes of the moment over angle and rate. The noise of the motion
    must be known where it would matter were it twice as large.

    Parameters
    ----------
    states : sequence of ForceStates
    inertia : float or None
        Between the sensor and the joint, kg·m² (kg); None where it is identified: that of the linear law then.
    """
    weight = np.array([np.count_nonzero(s.moving) for s in states], dtype=float)
    slopes = _slopes(states, inertia)
    known = np.array([_known(s, slopes[2]) for s in states], dtype=bool)
    size = moment_size(states, inertia)
    if not weight[known].sum() > 0.5 * weight.sum():
        return Floor(float("nan"), float("nan"), UNKNOWN)
    variance = np.array([_variance(s, slopes) for s in states])
    moment = float(np.sqrt(np.average(variance[known], weights=weight[known])))
    used = [s.noise.source for s, k in zip(states, known, strict=True) if k]
    words = ", ".join(SOURCES[name] for name in dict.fromkeys(used))
    return Floor(moment, moment / size if size > 0 else float("nan"), words, "coherent" in used)


def _slopes(states: Sequence[ForceStates], inertia: float | None) -> Array:
    """Return stiffness, damping and inertia of the linear law nearest to the moment of the moving samples."""
    columns = [(s.angle, s.rate, s.acceleration, np.ones_like(s.rate)) for s in states]
    rows = np.hstack([np.array(each)[:, s.moving] for each, s in zip(columns, states, strict=True)]).T
    moment = np.concatenate([s.transfer_moment(inertia or 0.0)[s.moving] for s in states])
    if inertia is not None:
        rows[:, 2] = 0.0
    scale = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    found = np.linalg.lstsq(rows / scale, moment, rcond=1e-9)[0] / scale if len(rows) else np.zeros(4)
    return np.array([found[0], found[1], max(found[2], 0.0) if inertia is None else inertia])


def _variance(states: ForceStates, slopes: Array) -> float:
    """Return σ_M² + (I·σ_θ̈)² + (k·σ_θ)² + (c·σ_θ̇)²; a mean period has no noise of angle and rate."""
    noise, (stiffness, damping, inertia) = states.noise, slopes
    variance = noise.moment**2 + (inertia * noise.acceleration) ** 2
    if states.method == "broadband":
        kernel = smoothing_kernels(states.bandwidth, states.sample_rate)[0]
        variance += (stiffness * noise.angle * float(np.linalg.norm(kernel))) ** 2 + (
            damping * noise.rate
        ) ** 2
    return float(variance)


def moment_size(states: Sequence[ForceStates], inertia: float | None) -> float:
    """Return the RMS that gaps and floors are relative to: of the larger moment, over all moving samples."""
    squares = [larger_moment(s, inertia or 0.0)[s.moving] ** 2 for s in states]
    return float(np.sqrt(np.sum(np.concatenate(squares)) / max(sum(square.size for square in squares), 1)))


def _known(states: ForceStates, inertia: float) -> bool:
    if not states.noise.measured:
        return False
    return states.noise.motion_measured or 2 * inertia * states.noise.acceleration <= states.noise.moment


def larger_moment(states: ForceStates, inertia: float) -> Array:
    """Return the moment at the sensor or in the joint, whichever is larger: a free decay has none at the sensor."""
    transfer = states.transfer_moment(inertia)
    return states.moment if np.mean(states.moment**2) >= np.mean(transfer**2) else transfer


def transfer_noise(states: ForceStates, inertia: float) -> float:
    """Return the noise of a single sample of the transfer moment, N·m: the sensor's, and I times that of θ̈."""
    return float(np.hypot(states.noise.moment, inertia * states.noise.acceleration))


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
