"""An effect that explains more than any other and that physics does not admit: what is named beside it is in doubt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.result import Gap
from sindyjoint.diagnosis.verdict import ZERO_ERRORS
from sindyjoint.text import percent, spelled


@dataclass(frozen=True)
class Inadmissible:
    """The best candidate of a round, which physics does not admit.

    Parameters
    ----------
    effect : str
    complaint : str
        Why it is not admitted: a sign, the end of a range, an angle of yield, energy.
    before, after : Gap
        Without it and with it, on data left out of the fit; NaN after where it was not computed.
    """

    effect: str
    complaint: str
    before: Gap
    after: Gap = Gap(float("nan"), float("nan"))

    def beats(self, final: Gap, floor: Gap, policy: DiagnosisPolicy) -> bool:
        """Return whether it explains clearly more of the held-out moment than the law that the search came to."""
        if not final.moment > np.nan_to_num(floor.moment):
            return False
        return bool(self.after.moment < (1 - policy.least_gain) * final.moment)

    @property
    def words(self) -> str:
        """What a verdict says of it."""
        known = np.isfinite(self.after.moment) and self.after.moment < self.before.moment
        gap = f" (a gap of {percent(self.before.moment)} → {percent(self.after.moment)})" if known else ""
        return (
            f"{spelled(self.effect)} would explain most{gap} but is not admissible: {self.complaint}; look for a law "
            "of that shape that the catalogue lacks"
        )


def before_doubt(
    been: Sequence[Any], doubts: Sequence[tuple[int, Inadmissible]], policy: DiagnosisPolicy
) -> tuple[int, Inadmissible | None]:
    """Return up to which place a search holds, and the inadmissible candidate that explains more than the law there.

    Where the law found in the end explains the data as well as the inadmissible candidate of a round, with effects that
    physics admits, this one is no evidence against them. Otherwise nothing that came after it is a name, but for zero
    errors of the sensors.

    Parameters
    ----------
    been : sequence of Progress
        From the start to the end of the search.
    doubts : sequence of (int, Inadmissible)
        Places in it where one led, in their order.
    policy : DiagnosisPolicy
    """
    floor = been[-1].problem.floor()

    def with_zeros(place: int, end: int) -> int:
        while place < end and been[place + 1].steps and been[place + 1].steps[-1].effect in ZERO_ERRORS:
            place += 1
        return place

    end = len(been) - 1
    while True:
        beaten = [at for at, each in doubts if each.beats(been[end].gap, floor, policy)]
        sooner = min((with_zeros(at, end) for at in beaten if at <= end), default=end)
        if sooner == end:
            break
        end = sooner
    standing = [each for at, each in doubts if at <= end and with_zeros(at, end) == end]
    standing = [e for e in standing if np.isnan(e.after.moment) or e.beats(been[end].gap, floor, policy)]
    return end, min(standing, key=lambda each: np.nan_to_num(each.after.moment, nan=np.inf), default=None)
