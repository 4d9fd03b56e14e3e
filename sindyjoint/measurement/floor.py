"""The floor of every model: the part of the moment that no law of the motion explains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.states import ForceStates
from sindyjoint.states.broadband import smoothing_kernels

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


class Law(Protocol):
    """A moment over angle and rate."""

    def slopes(self, angle: Array, rate: Array) -> tuple[Array, Array]:
        """Return ∂M/∂θ and ∂M/∂θ̇ along a motion."""


def moment_floor(states: Sequence[ForceStates], inertia: float, law: Law | None = None) -> Floor:
    """Return the floor of some runs, pooled over their moving samples.

    The noise of a transfer moment is that of the moment, the inertia's times that of the acceleration, and what noise
    of a motion that does not repeat adds through the slopes of the law. The noise of the motion must be known where it
    would matter were it twice as large.

    Parameters
    ----------
    states : sequence of ForceStates
    inertia : float
        kg·m² (kg).
    law : Law, optional
        What explains the moment.
    """
    weight = np.array([np.count_nonzero(s.moving) for s in states], dtype=float)
    known = np.array([_known(s, inertia) for s in states], dtype=bool)
    squares = [np.mean(larger_moment(s, inertia)[s.moving] ** 2) if s.moving.any() else 0.0 for s in states]
    size = float(np.sqrt(weight @ np.array(squares) / max(weight.sum(), 1.0)))
    if not weight[known].sum() > 0.5 * weight.sum():
        return Floor(float("nan"), float("nan"), UNKNOWN)
    variance = np.array([s.noise.moment**2 + (inertia * s.noise.acceleration) ** 2 for s in states])
    if law is not None:
        variance += [_through_slopes(s, law) for s in states]
    moment = float(np.sqrt(np.average(variance[known], weights=weight[known])))
    used = [s.noise.source for s, k in zip(states, known, strict=True) if k]
    words = ", ".join(SOURCES[name] for name in dict.fromkeys(used))
    return Floor(moment, moment / size if size > 0 else float("nan"), words, "coherent" in used)


def _through_slopes(states: ForceStates, law: Law) -> float:
    """Return the variance of a law's moment by noise of the motion, ⟨(k·σ_θ)² + (c·σ_θ̇)²⟩; a mean period has none."""
    if states.method != "broadband" or not states.moving.any():
        return 0.0
    stiffness, damping = law.slopes(states.angle[states.moving], states.rate[states.moving])
    kernel = smoothing_kernels(states.bandwidth, states.sample_rate)[0]
    angle = states.noise.angle * float(np.linalg.norm(kernel))
    return float(np.mean((stiffness * angle) ** 2 + (damping * states.noise.rate) ** 2))


def _known(states: ForceStates, inertia: float) -> bool:
    if not states.noise.measured:
        return False
    return states.noise.motion_measured or 2 * inertia * states.noise.acceleration <= states.noise.moment


def larger_moment(states: ForceStates, inertia: float) -> Array:
    """Return the moment at the sensor or in the joint, whichever is larger: a free decay has none at the sensor."""
    transfer = states.transfer_moment(inertia)
    return states.moment if np.mean(states.moment**2) >= np.mean(transfer**2) else transfer
