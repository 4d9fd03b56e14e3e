"""All detectors, run on a test of a structure: one list of findings, the severest first."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.soundness.detectors.declared_units import denial
from sindyjoint.soundness.finding import Finding, in_order
from sindyjoint.soundness.structure.copies import find_copies
from sindyjoint.soundness.structure.course import find_course
from sindyjoint.soundness.structure.filling import fill_test
from sindyjoint.soundness.structure.recorded import Recorded, StructureWords, recorded_of, words_of_rig
from sindyjoint.soundness.structure.samples import effect_of, find_dead_drive, find_in_samples
from sindyjoint.soundness.structure.sensors import find_in_sensors
from sindyjoint.substructure.recovery import Recovery, recover


def find_rig_faults(test: RigTest) -> tuple[Finding, ...]:
    """Return what is wrong with the data of a structure, the severest first.

    Samples are looked at first; those that can be filled in are, before runs are looked at as a whole, and runs at
    fault are left out before channels are held against each other.

    Parameters
    ----------
    test : RigTest
    """
    with np.errstate(all="ignore"):
        return in_order(_find_all(test))


def _find_all(test: RigTest) -> Iterator[Finding]:
    words = words_of_rig(test)
    raw = [recorded_of(test, run) for run in test.runs]
    yield from _find_unit_mismatches(raw, words)
    yield from find_dead_drive(raw, words)
    copies = list(find_copies(raw, words))
    yield from copies
    samples = [finding for run in raw for finding in find_in_samples(run, words)]
    yield from samples
    whole = fill_test(test, samples)[0].runs
    course = [f for run in whole for f in find_course(recorded_of(test, run), words)]
    yield from course
    odd = {f.run for f in (*copies, *course, *samples) if f.severity != "note" and not f.masked}
    sound = [run for run in whole if run.name not in odd]
    yield from find_in_sensors(test, list(_recovered(test, sound)), words)


def _recovered(test: RigTest, runs: Sequence[object]) -> Iterator[Recovery]:
    """Yield what is recovered of runs; what is too short for it is for the recovery to say."""
    for run in runs:
        try:
            yield recover(test, run)  # type: ignore[arg-type]
        except InputError:
            continue


def _find_unit_mismatches(runs: Sequence[Recorded], words: StructureWords) -> Iterator[Finding]:
    """Yield the channels whose declared unit is not the one that their file states."""
    for run in runs:
        for unit in () if run.source is None else run.source.units:
            ratio = denial(unit)
            if ratio is None:
                continue
            wrong = (
                "is no such quantity" if ratio == 0 else f"makes every value {1 / ratio:.4g} times what it is"
            )
            yield Finding(
                "unit_mismatch",
                run.name,
                unit.channel,
                "stops",
                f"column {unit.column!r} is declared in {unit.declared!r}, the file states {unit.stated!r}: that "
                f"{wrong}",
                "all frequencies are wrong by that factor: nothing that is recovered holds"
                if unit.channel == "time"
                else effect_of(unit.channel),
                f"declare unit = {unit.stated!r} for the {words.of(unit.channel)}, or correct the file",
            )
