"""A structure's test that was checked: its findings, what is used of it, and what every result on it says first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.record import Motion
from sindyjoint.soundness.checked import Checked, check_accepted, list_faults
from sindyjoint.soundness.finding import Soundness
from sindyjoint.soundness.structure.faults import find_rig_faults
from sindyjoint.soundness.structure.filling import fill_test
from sindyjoint.soundness.structure.recorded import Recorded, StructureWords, recorded_of, words_of_rig


@dataclass(frozen=True, eq=False, repr=False)
class RigCheck(Checked):
    """The check of a structure's test.

    Parameters
    ----------
    test : RigTest
        As it was read.
    soundness : Soundness
    usable : RigTest
        Its samples at fault filled in, where they can be.
    warnings : tuple of str
        What every result on it says first: accepted faults, those that bias, what is filled in.
    """

    test: RigTest = field(repr=False)
    soundness: Soundness
    usable: RigTest
    warnings: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Of the structure."""
        return self.test.name

    @property
    def motion(self) -> Motion:
        """Of the joints."""
        return self.test.motion

    @property
    def simulated(self) -> bool:
        """Whether the runs come from a virtual test."""
        return self.test.simulated

    @property
    def words(self) -> StructureWords:
        """What the channels are called."""
        return words_of_rig(self.test)

    @cached_property
    def recorded(self) -> Sequence[Recorded]:
        """The runs."""
        return [recorded_of(self.test, run) for run in self.test.runs]

    @property
    def excitations(self) -> Sequence[tuple[float | None, str | None]]:
        """Frequency and level of the runs that are used for identification."""
        return [(run.frequency, run.level) for run in self.test.identification_runs]


def check_rig_test(test: RigTest, accept: Sequence[str] = ()) -> RigCheck:
    """Return the check of a structure's test.

    Parameters
    ----------
    test : RigTest
        With runs.
    accept : sequence of str
        Ids of findings that no longer stop the work.

    Raises
    ------
    UnknownNameError
        For an id that no finding has.
    """
    check_accepted(accept)
    soundness = Soundness(find_rig_faults(test), tuple(dict.fromkeys(accept)))
    usable, filled = fill_test(test, soundness.findings)
    faults = list_faults(soundness, words_of_rig(test), test.motion)
    return RigCheck(test, soundness, usable, (*faults, *filled))
