"""What the gap is made of, in parts that add up, and the regions that hold more of it than their share."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.described import Maybe
from sindyjoint.diagnosis.policy import DiagnosisPolicy


@dataclass(frozen=True)
class Budget:
    """The mean square gap, relative to that of the signal, in parts that add up.

    Parameters
    ----------
    state : float
        Of a campaign: what a function of (θ, θ̇), any law without memory, predicts of runs that it never saw. Of a
        structure: what memoryless effects of the joint, and its coefficients within their uncertainty, explain.
    history : float
        The same for laws with a memory.
    run : float
        Of a campaign: what differs between runs (frequency, time, drift), and what repeats within a run but is
        predicted by nothing that holds for the others. Of a structure: what lies outside the joint, or is explained by
        nothing.
    processing : float
        What the same pipeline leaves of the model's own simulation; of a structure, the time step.
    noise : float
        What does not repeat.
    """

    state: Maybe
    history: Maybe
    run: Maybe
    processing: Maybe
    noise: Maybe

    @property
    def total(self) -> float:
        """Sum of the parts."""
        return self.state + self.history + self.run + self.processing + self.noise


#: Of a gap that was not divided.
NOT_DIVIDED = Budget(*[float("nan")] * 5)


def divide_gap(
    total: float,
    noise: float,
    processing: float,
    shares: Callable[[float], dict[str, float]],
    drift: float = 0.0,
) -> Budget:
    """Return the budget of a gap.

    Parameters
    ----------
    total, noise, processing, drift : float
        Mean squares relative to the signal's: of the gap, of noise, of processing, and of what is gone without the
        drift of a channel. Where they are more than the total, they are cut in this order.
    shares : callable
        ``shares(noise)`` returns what ``"state"``, ``"history"`` and ``"run"`` explain of the gap beyond these, from 0
        to 1; ``noise`` is the share of the total that is noise.
    """
    noise = min(noise, total)
    processing = min(processing, total - noise)
    drift = float(np.clip(drift, 0.0, total - noise - processing))
    beyond = total - noise - processing - drift
    credit = shares(noise / total) if beyond > 0 else {}
    state, history, run = (beyond * credit.get(kind, 0.0) for kind in ("state", "history", "run"))
    # To the last digit the sum is the total.
    return Budget(state, history, run + drift, processing, total - state - history - run - drift - processing)


Span = tuple[float, float] | str


@dataclass(frozen=True)
class Place:
    """A region that holds more of the gap than its share of the samples."""

    axis: str
    range: Span
    share: float
    words: str


class Regions:
    """The regions of some samples that hold more of a gap than their share of them, each with its information.

    Parameters
    ----------
    excess : ndarray, shape (n,)
        Square of the gap beyond noise at each sample; not all zero.
    samples : str
        What the samples are called.
    policy : DiagnosisPolicy
    """

    def __init__(self, excess: NDArray[np.float64], samples: str, policy: DiagnosisPolicy) -> None:
        self.found: list[tuple[float, Place]] = []
        self._excess, self._samples, self._policy = excess, samples, policy
        self._total = float(excess.sum())

    def add(self, axis: str, span: Span, words: str, mask: NDArray[np.bool_]) -> None:
        """Keep the region of some samples, if it is informative enough."""
        samples, share = float(mask.mean()), float(self._excess[mask].sum()) / self._total
        text = f"{words}: {100 * share:.0f} % of the gap in {100 * samples:.0f} % of the {self._samples}"
        self.weigh(axis, span, share, samples, text)

    def weigh(self, axis: str, span: Span, share: float, samples: float, words: str) -> None:
        """Keep a region by its shares of gap and samples, if it is informative enough: share·ln(share / samples)."""
        if share > self._policy.large_part and share > self._policy.significant_excess * samples:
            telling = share * float(np.log(share / max(samples, 1e-3)))
            self.found.append((telling, Place(axis, span, share, words)))


def most_informative(
    regions: Iterable[tuple[float, Place]], policy: DiagnosisPolicy, one_per_axis: bool = False
) -> tuple[Place, ...]:
    """Return the most informative regions; of one axis bands that do not overlap, or the first one only."""
    kept: list[Place] = []
    for _, place in sorted(regions, key=lambda each: -each[0]):
        same = [other for other in kept if other.axis == place.axis]
        if not any(one_per_axis or _overlap(other.range, place.range) for other in same):
            kept.append(place)
    return tuple(kept[: policy.most_regions])


def _overlap(first: Span, second: Span) -> bool:
    if isinstance(first, str) or isinstance(second, str):
        return False
    return max(first[0], second[0]) < min(first[1], second[1])
