"""How surely the runs of a plan separate effects."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from sindyjoint.described import Maybe

TELL_APART = "tell-apart"


@dataclass(frozen=True)
class Separation:
    """How surely effects are told apart.

    Parameters
    ----------
    effects : tuple of str
        That are held against each other.
    before : float
        Probability that the true one of them has by the runs that were made, or by the plan's other runs; NaN where
        these show none of them.
    after : tuple of float
        The same after each further run that separates them, expected.
    words : str
        What that means; where no run that can be made separates them, that.
    """

    effects: tuple[str, ...]
    before: Maybe
    after: tuple[float, ...]
    words: str

    enough: ClassVar[float] = 0.9  # at which effects are told apart
