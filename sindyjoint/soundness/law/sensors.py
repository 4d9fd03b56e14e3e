"""Sensors held against each other: the channel whose gain, sign, delay or place makes all others agree."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from sindyjoint.errors import InputError
from sindyjoint.limits import SOUNDNESS
from sindyjoint.mechanics.beam import Beam
from sindyjoint.mechanics.rig_test import RigRun, RigTest, UncertainNumber, uncertain_numbers
from sindyjoint.mechanics.structure import LumpedMass
from sindyjoint.soundness import Finding, Severity, Words
from sindyjoint.soundness.law.agreement import (
    SMALLEST,
    Equations,
    Fit,
    equations_of,
    first_guess,
    fit_fault,
    left_out,
    moved,
    swapped,
    unknowns_of,
)
from sindyjoint.substructure.recovery import Recovery, recover

# Factors that look like a unit taken for another.
UNITS = {
    9.80665: "g for m/s²", 1 / 9.80665: "m/s² for g", 1000.0: "mm for m", 0.001: "m for mm", 25.4e-3: "inch for m",
    1 / 4.44822: "lbf for N", 4.44822: "N for lbf",
}  # fmt: skip


class Explained(NamedTuple):
    """What makes the channels agree better.

    Parameters
    ----------
    kind : {"fault", "swapped", "left_out"}
    channels : tuple of int
    run : int or None
    fit : Fit
    equations : Equations
        With it undone.
    ratio : float
        χ² with it undone over that before, each by its degrees of freedom.
    """

    kind: str
    channels: tuple[int, ...]
    run: int | None
    fit: Fit
    equations: Equations
    ratio: float


#: What is said of a channel at fault: id, severity, extent and remedy of its finding.
Told = tuple[str, Severity, str, str]


def with_assumed_numbers(test: RigTest) -> RigTest:
    """Return a test in which each stiffness, mass and loss of the structure may be off, as stated or as is usual."""
    usual = SOUNDNESS.usual_uncertainty
    if test.chain is None:
        structure, zero = test.structure, np.zeros_like(test.structure.mass)
        assumed: tuple[UncertainNumber, ...] = (
            UncertainNumber("stiffness", usual, zero, structure.stiffness, zero),
            UncertainNumber("mass", usual, structure.mass, zero, zero),
        )
    else:
        chain = test.chain
        of_parts = {
            item.name: {"stiffness": usual, "mass": usual, "loss": SOUNDNESS.usual_loss}
            if isinstance(item, Beam)
            else {"mass": usual}
            for item in chain.items
            if isinstance(item, Beam | LumpedMass)
        }
        of_clamp = usual if np.isfinite(chain.clamp_stiffness) else 0.0
        assumed = uncertain_numbers(chain.items, chain.clamp_stiffness, of_parts, of_clamp)
    numbers = {n.name: replace(n, uncertainty=max(n.uncertainty, usual)) for n in (*assumed, *test.uncertain)}
    return replace(test, uncertain=tuple(numbers.values()))


def recovered(test: RigTest, runs: Sequence[RigRun]) -> Iterator[Recovery]:
    """Yield what is recovered of runs; what is too short for it is for the recovery to say."""
    for run in runs:
        try:
            yield recover(test, run)
        except InputError:
            continue


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
    main = max(_main_frequency(equations, run) for run in range(len(recoveries)))
    # Faults are looked for one after the other.
    for _ in range(3):
        fit = fit_fault(equations)
        # Beams and masses that are not as described show in no linear way where a mode is near.
        nearer = fit_fault(moved(equations, numbered, fit.numbers))
        least = min(fit.chi_squared, nearer.chi_squared) / equations.degrees
        if least <= SOUNDNESS.clearly:
            return
        found = _best_explanation(equations, fit, SOUNDNESS.large_part / main, spare)
        if found is None:
            yield Finding(
                "structure_differs",
                None,
                None,
                "note",
                f"the sensors disagree by {np.sqrt(least):.3g} times their noise, and no single one of them accounts "
                "for it",
                "the structure is not quite the one described: angles are differences of large numbers, and k1, k3 "
                "and c1 depend on it",
                "state how uncertain its stiffness and mass are; look at the places of the sensors",
            )
            return
        run = None if found.run is None else recoveries[found.run].run.name
        yield from _describe(found, equations, run, test.channels, words, main, spare > 1)
        if found.kind == "left_out":
            return
        equations = found.equations


def _main_frequency(equations: Equations, run: int) -> float:
    """Return the frequency of the strongest line of a run, Hz, by all channels together."""
    rows = equations.of(run)
    size = np.abs(equations.values[rows]) / np.abs(equations.values[rows]).max(axis=0).clip(1e-300)
    return float(equations.angular[rows][np.argmax(size.sum(axis=1))] / (2 * np.pi))


def _odd_runs(fit: Fit, equations: Equations) -> list[int | None]:
    """Return the runs that agree worst, each of which may have a fault of its own, and None for all runs."""
    per = fit.by_run / np.maximum(np.bincount(equations.run), 1)
    # Three runs at most may have a fault of their own.
    odd = [int(r) for r in np.argsort(-per)[:3] if per[r] > (1 + SOUNDNESS.large_part) * np.median(per)]
    return [None, *odd] if len(per) > 1 else [None]


def _best_explanation(equations: Equations, before: Fit, longest: float, spare: int) -> Explained | None:
    """Return the fault that leaves least, where it leaves clearly less than no fault and than any other channel's.

    Where none does, the one channel without which all others agree.
    """
    channels = range(equations.values.shape[1])

    def explained(
        kind: str, which: tuple[int, ...], run: int | None, fit: Fit, clean: Equations
    ) -> Explained:
        ratio = fit.chi_squared / clean.degrees / (before.chi_squared / equations.degrees)
        return Explained(kind, which, run, fit, clean, ratio)

    runs, pairs = _odd_runs(before, equations), list(combinations(channels[1:], 2))
    guesses = [first_guess(equations, channel, run, longest) for run in runs for channel in channels]
    ways = [way for guess in guesses for way in ((guess, True), (guess._replace(delay=0.0), False))]
    fits = [fit_fault(equations, fault, delayed) for fault, delayed in ways]
    others = [(pair, run, swapped(equations, *pair, run)) for run in runs for pair in pairs]
    known = [
        *(
            explained("fault", (f.channel,), f.run, fit, f.removed(equations))
            for fit in fits
            if (f := fit.fault) is not None and abs(f.delay) <= longest
        ),
        *(explained("swapped", pair, run, fit_fault(clean), clean) for pair, run, clean in others),
    ]
    best = min(known, key=lambda each: each.ratio)
    # Two explanations that undo the same thing: a delay that is none, one run among all.
    rivals = [each.ratio for each in known if not set(each.channels) & set(best.channels)]
    if best.ratio <= SOUNDNESS.explains and min(rivals, default=np.inf) >= SOUNDNESS.clearly * best.ratio:
        alike = [e for e in known if (e.channels, e.kind) == (best.channels, best.kind)]
        simplest = [e for e in alike if e.run is None and e.ratio <= (1 + SOUNDNESS.minor_share) * best.ratio]
        plain = [e for e in simplest if e.fit.fault is None or e.fit.fault.delay == 0.0]
        return min(plain or simplest or [best], key=lambda each: each.ratio)
    if spare < 2:
        return None
    without = {channel: left_out(equations, channel) for channel in channels[1:]}
    lacking = [explained("left_out", (c,), None, fit_fault(w), w) for c, w in without.items()]
    first, second = sorted(lacking, key=lambda each: each.ratio)[:2]
    # A channel less leaves less, whichever it is: what a second one explains as well is the structure.
    alone = first.ratio <= SOUNDNESS.explains / 2 and second.ratio >= SOUNDNESS.explains
    return first if alone else None


def _describe(
    found: Explained,
    before: Equations,
    run: str | None,
    names: Sequence[str],
    words: Words,
    main: float,
    certain: bool,
) -> Iterator[Finding]:
    """Yield the finding of an explanation; none where it is smaller than what sensors are calibrated to.

    Parameters
    ----------
    found : Explained
    before : Equations
        With the fault.
    run : str or None
        None: in all of them.
    names : sequence of str
        Of the channels.
    words : Words
    main : float
        Highest main frequency of the runs, Hz.
    certain : bool
        Whether there are sensors enough to tell it from another structure.
    """
    norm = np.linalg.norm
    rows = slice(None) if found.run is None else before.run == found.run
    angle, moment = (
        float(np.max(norm((new - old)[rows], axis=0) / np.maximum(norm(new[rows], axis=0), 1e-300)))
        for old, new in zip(unknowns_of(before), unknowns_of(found.equations), strict=True)
    )
    shift, said = max(angle, moment), [words.of(names[channel]) for channel in found.channels]
    severity: Severity = (
        "stops" if shift > SOUNDNESS.unknown else "biases" if shift > SOUNDNESS.small_share else "note"
    )
    better = f"agree {found.ratio**-0.5:.3g} times better"
    if found.kind == "swapped":
        told: Told | None = (
            "swapped_channels",
            "stops",
            f"{said[0]} and {said[1]} are in each other's place: the channels then {better}",
            "exchange their columns or their points in [[sensor]]",
        )
    elif found.kind == "left_out":
        told = (
            "sensors_disagree",
            severity,
            f"without the {said[0]} all others {better}, and no gain, sign or delay of it explains that",
            "look at its place and direction, and at how it is mounted; or leave it out",
        )
    else:
        told = _tell_fault(found, said[0], severity, main, certain)
    if told is not None:
        sizes = [f"{100 * share:.2g} %" if share < 1 else "more than itself" for share in (angle, moment)]
        effect = (
            f"shifts the recovered angle by {sizes[0]}, the moment by {sizes[1]}, of the joint that it moves most: "
            "k1, k3, c1 and M_F"
        )
        id, grade, extent, remedy = told
        yield Finding(id, run, names[found.channels[0]], grade, extent, effect, remedy)


def _tell_fault(found: Explained, said: str, severity: Severity, main: float, certain: bool) -> Told | None:
    """Return what is said of a factor or a delay; None of one that is hardly there."""
    fault, errors = found.fit.fault, found.fit.errors
    assert fault is not None
    agree = f"the channels then agree {found.ratio**-0.5:.3g} times better"
    off, turn = abs(abs(fault.gain) - 1), 2 * np.pi * main
    late = abs(turn * fault.delay)
    # Standard errors by the noise, and by what the fault leaves beyond it.
    sure = SOUNDNESS.outstanding * max(1.0, found.fit.chi_squared / found.equations.degrees) ** 0.5
    if abs(fault.gain) < SOUNDNESS.tolerated:
        extent = f"the {said} shows {100 * max(abs(fault.gain), SMALLEST):.2g} % of what the others predict: {agree}"
        return "no_signal", "stops", extent, "check its cable, range and unit; leave it out"
    if fault.gain < 0:
        size = "" if off < SOUNDNESS.gain else f", times {abs(fault.gain):.4g}"
        extent = f"the {said} has the other sign than the others predict{size}: {agree}"
        return "reversed_sign", "stops", extent, "turn its sign in the file, or leave it out"
    if off >= max(SOUNDNESS.gain, sure * errors[0]) and (off >= late or late < SOUNDNESS.small_share):
        units = [f" (as {u})" for factor, u in UNITS.items() if abs(fault.gain / factor - 1) < SOUNDNESS.gain]
        extent = f"the {said} is {fault.gain:.4g} times what the others predict{''.join(units[:1])}: {agree}"
        remedy = "compare its calibration, gain and unit; correct or leave it out"
        if not certain:
            other = "or its part of the structure is another: with one sensor more than joints nothing tells"
            return "gain_differs", "note" if severity == "note" else "biases", f"{extent}, {other}", remedy
        return "gain_differs", "stops" if off > SOUNDNESS.unknown else severity, extent, remedy
    if late < max(SOUNDNESS.small_share, sure * errors[1] * turn):
        return None
    return (
        "channel_delay",
        severity,
        f"the {said} comes {1e3 * abs(fault.delay):.3g} ms {'later' if fault.delay > 0 else 'earlier'} than the others "
        f"predict ({np.degrees(late):.2g}° at {main:.3g} Hz): {agree}",
        "record all channels with one clock and one filter; shift it in time, or leave it out",
    )
