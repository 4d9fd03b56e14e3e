"""What a search may cost: work that is counted alike on every machine, and processor time as a last resort."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from sindyjoint.clock import ProcessorTime


@dataclass(eq=False)
class Effort:
    """Takes account of a search while it goes on, and ends it.

    Parameters
    ----------
    work : float
        What may be done, in any unit that the search counts in.
    seconds : float
        Processor time after which nothing more is begun; nor is what would, by its like so far, pass it.
    say : callable
        Hears how far the search is.
    clock : ProcessorTime
    """

    work: float
    seconds: float
    say: Callable[[str], None] = lambda stage: None
    clock: ProcessorTime = field(default_factory=ProcessorTime)
    tried: int = 0
    planned: int = 0
    stopped: str = ""
    _spent: float = 0.0
    _rates: dict[str, float] = field(default_factory=dict)
    _begun: tuple[str, float, float] = ("", 0.0, 0.0)

    def allows(self, kind: str, work: float) -> bool:
        """Return whether a portion of work may begin, and count it; once not, nothing more may.

        Parameters
        ----------
        kind : str
            Of what a unit of work takes about the same time.
        work : float
        """
        self._end_portion()
        if not self.stopped:
            now = self.clock.seconds
            if self._spent + work > self.work:
                self.stopped = "after as many trials as are allowed on any machine"
            elif now >= self.seconds or now + work * self._rates.get(kind, 0.0) > self.seconds:
                self.stopped = f"after {now:.0f} s of processor time"
        if self.stopped:
            return False
        self._spent += work
        self._begun = (kind, work, self.clock.seconds)
        return True

    def report(self, stage: str, ahead: dict[str, float]) -> None:
        """Say how far the search is, and how long the work ahead, by its kind, will take by what it took so far."""
        self._end_portion()
        usual = next(reversed(self._rates.values()), 0.0)
        expected = sum(work * self._rates.get(kind, usual) for kind, work in ahead.items())
        seconds = min(expected, max(self.seconds - self.clock.seconds, 0.0))
        self.say(f"{stage}, about {max(np.ceil(seconds), 1):.0f} s more" if self._rates else stage)

    def _end_portion(self) -> None:
        kind, work, start = self._begun
        if work:
            # The latest stands last: what is not known yet goes about as fast.
            self._rates.pop(kind, None)
            self._rates[kind] = (self.clock.seconds - start) / work
            self._begun = ("", 0.0, 0.0)
