"""The stages of a diagnosis, what each may cost, and what it says where that is used up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.policy import DiagnosisPolicy


@dataclass(frozen=True, eq=False)
class Stages:
    """The portions of the stages of one diagnosis, and who hears which of them is running.

    Advice keeps account of itself: see :class:`~sindyjoint.diagnosis.effort.Effort`.

    Parameters
    ----------
    search, verdict, numbers, parts : Portion
        From every start together: the rounds of the loop and the starts themselves; what a verdict needs to know; the
        numbers refined on the simulated response; the parts of the first gap and where it lies.
    say : callable
    """

    search: Portion
    verdict: Portion
    numbers: Portion
    parts: Portion
    say: Callable[[str], None]

    @classmethod
    def of(cls, policy: DiagnosisPolicy, say: Callable[[str], None]) -> Stages:
        """Return the portions that a policy gives."""
        return cls(
            Portion(policy.search_work, policy.search_seconds),
            Portion(policy.verdict_work, policy.verdict_seconds),
            Portion(policy.numbers_work, policy.numbers_seconds),
            Portion(policy.parts_work, policy.parts_seconds),
            say,
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Return what each stage whose portion was used up left out."""
        named = {
            "the search": self.search,
            "the verdict": self.verdict,
            "the refinement on the simulated response": self.numbers,
            "the division of the gap": self.parts,
        }
        return tuple(
            f"{name} ended {portion.stopped}; left out: {', '.join(portion.left_out)}"
            for name, portion in named.items()
            if portion.stopped
        )
