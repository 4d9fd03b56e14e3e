"""Sensors held against each other: the channel whose gain, sign, delay or place makes all others agree."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.rig_test import DRIVE, RigTest, UncertainNumber, uncertain_numbers
from sindyjoint.mechanics.structure import LumpedMass
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.structure.agreement import (
    Equations,
    Fit,
    equations_of,
    first_guess,
    fit_fault,
    left_out,
    moved,
    swapped,
)
from sindyjoint.soundness.structure.explained import Explained, Place, describe_fault, structure_finding
from sindyjoint.soundness.words import Words
from sindyjoint.substructure.recovery import Recovery

# Runs that may have a fault of their own, at most; faults that are looked for one after the other.
ODD_RUNS, FAULTS = 3, 3


def with_assumed_numbers(test: RigTest) -> RigTest:
    """Return a test in which every stiffness and mass of the structure may be off, as stated or as is usual."""
    usual = POLICY.usual_uncertainty
    if test.chain is None:
        structure, zero = test.structure, np.zeros_like(test.structure.mass)
        assumed: tuple[UncertainNumber, ...] = (
            UncertainNumber("stiffness", usual, zero, structure.stiffness, zero),
            UncertainNumber("mass", usual, structure.mass, zero, zero),
        )
    else:
        chain = test.chain
        of_parts = {
            item.name: {"stiffness": usual, "mass": usual} if isinstance(item, Beam) else {"mass": usual}
            for item in chain.items
            if isinstance(item, Beam | LumpedMass)
        }
        of_clamp = usual if np.isfinite(chain.clamp_stiffness) else 0.0
        assumed = uncertain_numbers(chain.items, chain.clamp_stiffness, of_parts, of_clamp)
    stated = {number.name: number for number in test.uncertain}
    numbers = {number.name: number for number in assumed} | stated
    widened = (replace(n, uncertainty=max(n.uncertainty, usual)) for n in numbers.values())
    return replace(test, uncertain=tuple(widened))


def find_in_sensors(test: RigTest, recoveries: Sequence[Recovery], words: Words) -> Iterator[Finding]:
    """Yield what drive and sensors deny of each other.

    Parameters
    ----------
    test : RigTest
    recoveries : sequence of Recovery
        Of runs in which no samples are at fault.
    words : Words
    """
    spare = len(test.sensors) - test.structure.n_joints
    if spare < 1:
        yield Finding(
            "coverage", None, None, "note", "as many sensors as joints",
            "nothing shows whether sensors and structure are the ones described",
            "add a sensor",
        )  # fmt: skip
        return
    if not recoveries:
        return
    numbered = with_assumed_numbers(test)
    equations = equations_of(numbered, recoveries)
    names = [DRIVE, *(sensor.name for sensor in test.sensors)]
    mains = [_main_frequency(equations, run) for run in range(len(recoveries))]
    for _ in range(FAULTS):
        fit = fit_fault(equations)
        # Beams and masses that are not as described show in no linear way where a mode is near.
        nearer = fit_fault(moved(equations, numbered, fit.numbers))
        if min(fit.chi_squared, nearer.chi_squared) <= POLICY.clearly * equations.degrees:
            return
        found = _best_explanation(equations, fit, mains, spare)
        if found is None:
            yield structure_finding(min(fit, nearer, key=lambda each: each.chi_squared), equations)
            return
        run = None if found.run is None else recoveries[found.run].run.name
        yield from describe_fault(found, equations, Place(run, names, words, max(mains)))
        if found.kind == "left_out":
            return
        equations = found.equations


def _main_frequency(equations: Equations, run: int) -> float:
    """Return the frequency of the strongest line of a run, Hz, by all channels together."""
    rows = equations.run == run
    size = np.abs(equations.values[rows]) / np.abs(equations.values[rows]).max(axis=0).clip(1e-300)
    return float(equations.angular[rows][np.argmax(size.sum(axis=1))] / (2 * np.pi))


def _odd_runs(fit: Fit, equations: Equations) -> list[int | None]:
    """Return the runs that agree worst, each of which may have a fault of its own, and None for all runs."""
    per = fit.by_run / np.maximum(np.bincount(equations.run), 1)
    odd = [int(r) for r in np.argsort(-per)[:ODD_RUNS] if per[r] > (1 + POLICY.large_part) * np.median(per)]
    return [None, *odd] if len(per) > 1 else [None]


def _best_explanation(
    equations: Equations, before: Fit, mains: Sequence[float], spare: int
) -> Explained | None:
    """Return the fault that leaves least, where it leaves clearly less than no fault and than any other channel's."""
    channels, runs = equations.values.shape[1], _odd_runs(before, equations)
    known: list[Explained] = []

    def add(kind: str, which: tuple[int, ...], run: int | None, fit: Fit, clean: Equations) -> None:
        ratio = fit.chi_squared / clean.degrees / (before.chi_squared / equations.degrees)
        known.append(Explained(kind, which, run, fit, clean, ratio, spare > 1))

    longest = POLICY.large_part / max(mains)
    for run in runs:
        for channel in range(channels):
            guess = first_guess(equations, channel, run, longest)
            for fault, delayed in ((guess, True), (guess._replace(delay=0.0), False)):
                fit = fit_fault(equations, fault, delayed)
                assert fit.fault is not None
                if abs(fit.fault.delay) <= longest:
                    add("fault", (channel,), run, fit, fit.fault.removed(equations))
        for pair in combinations(range(1, channels), 2):
            clean = swapped(equations, *pair, run)
            add("swapped", pair, run, fit_fault(clean), clean)
    known.sort(key=lambda each: each.ratio)
    best = known[0]
    # Two explanations that undo the same thing: a delay that is none, one run among all.
    rivals = [
        each
        for each in known
        if each.channels != best.channels and not set(each.channels) & set(best.channels)
    ]
    clear = not rivals or rivals[0].ratio >= POLICY.clearly * best.ratio
    if best.ratio <= POLICY.explains and clear:
        alike = [e for e in known if (e.channels, e.kind) == (best.channels, best.kind)]
        simplest = [e for e in alike if e.run is None and e.ratio <= (1 + POLICY.nearly) * best.ratio]
        plain = [e for e in simplest if e.fit.fault is None or e.fit.fault.delay == 0.0]
        return (plain or simplest or [best])[0]
    return _left_out(equations, before, channels) if spare > 1 else None


def _left_out(equations: Equations, before: Fit, channels: int) -> Explained | None:
    """Return the one channel without which all others agree."""
    found = []
    for channel in range(1, channels):
        clean = left_out(equations, channel)
        fit = fit_fault(clean)
        ratio = fit.chi_squared / clean.degrees / (before.chi_squared / equations.degrees)
        found.append(Explained("left_out", (channel,), None, fit, clean, ratio))
    found.sort(key=lambda each: each.ratio)
    clear = found[1].ratio >= POLICY.clearly * found[0].ratio
    return found[0] if found[0].ratio <= POLICY.explains / 2 and clear else None
