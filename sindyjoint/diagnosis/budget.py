"""What the gap is made of, in parts that add up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sindyjoint.described import Maybe


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
