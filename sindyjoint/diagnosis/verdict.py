"""What a diagnosis comes to: named, ambiguous, unknown or nothing missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.result import Step
from sindyjoint.text import spelled

#: The name under which what is outside the catalogue stands among the rivals of a step.
UNKNOWN = "unknown"
#: The verdict where the data are not sound enough for any other.
UNDECIDED = "undecided"


@dataclass(frozen=True)
class Residual:
    """What the effects found leave.

    Parameters
    ----------
    share : float
        Of the gap beyond noise, from 0 to 1.
    most : float
        Share above which something unknown is there.
    outside : float
        Probability that the effects stand in for something outside the catalogue.
    data : str
        What cannot tell effects apart: "these runs", "this record".
    """

    share: float
    most: float
    outside: float = 0.0
    data: str = "these runs"


def share_beyond_noise(
    before: tuple[float, float], after: tuple[float, float], policy: DiagnosisPolicy
) -> float:
    """Return what remains of a gap beyond noise, from 0 to 1; zero where all that remains is noise.

    Parameters
    ----------
    before, after : (float, float)
        χ² and its degrees of freedom, before the first effect and with all of them.
    policy : DiagnosisPolicy
    """
    if after[0] <= policy.significant_excess * after[1]:
        return 0.0
    share = float(np.clip((after[0] - after[1]) / max(before[0] - before[1], 1e-9), 0.0, 1.0))
    return float(np.sqrt(share)) if policy.unexplained_rms else share


def judge(steps: Sequence[Step], residual: Residual, policy: DiagnosisPolicy) -> tuple[str, str]:
    """Return the verdict and its reason."""
    percent = f"{100 * residual.share:.0f} %" + (" (RMS)" if policy.unexplained_rms else "")
    if residual.share > residual.most:
        if steps:
            return "unknown", f"the effects found leave {percent} of the gap beyond noise unexplained"
        return "unknown", f"no known effect explains the gap; {percent} of it is more than noise"
    if not steps:
        return "nothing_missing", "the residual is no more than noise and the model's own uncertainty"
    if residual.outside > policy.outside:
        return "unknown", (
            "the effects found leave a residual that they would not leave if they were there, or are too many: "
            f"something outside the catalogue is there with a probability of {residual.outside:.2f}"
        )
    apart = [" or ".join(map(spelled, s.members)) for s in steps if len(s.members) > 1]
    if apart:
        return "ambiguous", f"{residual.data} cannot tell apart: {'; '.join(apart)}"
    return "named", "found: " + ", then ".join(spelled(s.effect) for s in steps)


def discount(
    steps: Sequence[Step], verdict: str, outside: float, policy: DiagnosisPolicy
) -> tuple[Step, ...]:
    """Give what is outside the catalogue its probability, taken from all names of each step.

    Where something unknown remains, no name may be near certain: it may stand in for what is not known.
    """
    if verdict == "unknown":
        outside = max(outside, policy.outside)
    if outside < policy.least_outside:
        return tuple(steps)
    inside = 1 - outside
    later = []
    for step in steps:
        rivals = [(name, inside * p) for name, p in step.rivals] + [(UNKNOWN, outside)]
        rivals.sort(key=lambda each: -each[1])
        later.append(replace(step, probability=inside * step.probability, rivals=tuple(rivals)))
    return tuple(later)
