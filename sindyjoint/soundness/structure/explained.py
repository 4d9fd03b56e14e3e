"""What makes the channels of a structure agree, as a finding: how much, what it does to the joints, what to do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.soundness.finding import Finding, Severity
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.structure.agreement import SMALLEST, Complex, Equations, Fault, Fit, unknowns_of
from sindyjoint.soundness.words import Words

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
    certain : bool
        Whether there are sensors enough to tell it from another structure.
    """

    kind: str
    channels: tuple[int, ...]
    run: int | None
    fit: Fit
    equations: Equations
    ratio: float
    certain: bool = True


class Place(NamedTuple):
    """Where a fault was found.

    Parameters
    ----------
    run : str or None
        None: in all of them.
    names : sequence of str
        Of the channels.
    words : Words
    main : float
        Highest main frequency of the runs, Hz.
    """

    run: str | None
    names: Sequence[str]
    words: Words
    main: float


def structure_finding(fit: Fit, equations: Equations) -> Finding:
    """Return the finding of channels that disagree as no fault of a single one makes them."""
    times = float(np.sqrt(fit.chi_squared / equations.degrees))
    return Finding(
        "structure_differs",
        None,
        None,
        "note",
        f"the sensors disagree by {times:.3g} times their noise, and no single one of them accounts for it",
        "the structure is not quite the one described: angles are differences of large numbers, and k1, k3 and c1 "
        "depend on it",
        "state how uncertain its stiffness and mass are; look at the places of the sensors",
    )


def describe_fault(found: Explained, before: Equations, place: Place) -> Iterator[Finding]:
    """Yield the finding of an explanation; none where it is smaller than what sensors are calibrated to."""
    angle, moment = _shifts(found, before)
    shift = max(angle, moment)
    severity: Severity = "stops" if shift > POLICY.unit else "biases" if shift > POLICY.bears else "note"
    said = [place.words.of(place.names[channel]) for channel in found.channels]
    better = f"{found.ratio**-0.5:.3g} times better"
    told: tuple[str, Severity, str, str] | None
    if found.kind == "swapped":
        told = (
            "swapped_channels", "stops",
            f"{said[0]} and {said[1]} are in each other's place: the channels then agree {better}",
            "exchange their columns or their points in [[sensor]]",
        )  # fmt: skip
    elif found.kind == "left_out":
        told = (
            "sensors_disagree", severity,
            f"without the {said[0]} all others agree {better}, and no gain, sign or delay of it explains that",
            "look at its place and direction, and at how it is mounted; or leave it out",
        )  # fmt: skip
    else:
        assert found.fit.fault is not None
        told = _tell_fault(found.fit.fault, found, said[0], severity, place.main)
    if told is None:
        return
    kind, severity, extent, remedy = told
    effect = (
        f"shifts the recovered angle by {_percent(angle)}, the moment by {_percent(moment)}, of the joint that it "
        "moves most: k1, k3, c1 and M_F"
    )
    yield Finding(kind, place.run, place.names[found.channels[0]], severity, extent, effect, remedy)


def _tell_fault(
    fault: Fault, found: Explained, said: str, severity: Severity, main: float
) -> tuple[str, Severity, str, str] | None:
    """Return id, severity, extent and remedy of a factor or a delay; None of one that is hardly there."""
    agree = f"the channels then agree {found.ratio**-0.5:.3g} times better"
    off, turn = abs(abs(fault.gain) - 1), 2 * np.pi * main
    late, errors = abs(turn * fault.delay), found.fit.errors
    # Standard errors by the noise, and by what the fault leaves beyond it.
    sure = POLICY.outstanding * max(1.0, found.fit.chi_squared / found.equations.degrees) ** 0.5
    if abs(fault.gain) < POLICY.changed:
        shown = 100 * max(abs(fault.gain), SMALLEST)
        extent = f"the {said} shows {shown:.2g} % of what the others predict: {agree}"
        return "no_signal", "stops", extent, "check its cable, range and unit; leave it out"
    if fault.gain < 0:
        size = "" if off < POLICY.gain else f", times {abs(fault.gain):.4g}"
        extent = f"the {said} has the other sign than the others predict{size}: {agree}"
        return "reversed_sign", "stops", extent, "turn its sign in the file, or leave it out"
    if off >= max(POLICY.gain, sure * errors[0]) and (off >= late or late < POLICY.bears):
        extent = (
            f"the {said} is {fault.gain:.4g} times what the others predict{_unit_of(fault.gain)}: {agree}"
        )
        remedy = "compare its calibration, gain and unit; correct or leave it out"
        if not found.certain:
            extent += (
                ", or its part of the structure is another: with one sensor more than joints nothing tells"
            )
            return "gain_differs", "note" if severity == "note" else "biases", extent, remedy
        return "gain_differs", "stops" if off > POLICY.unit else severity, extent, remedy
    if late >= max(POLICY.bears, sure * errors[1] * turn):
        when = "later" if fault.delay > 0 else "earlier"
        extent = (
            f"the {said} comes {1e3 * abs(fault.delay):.3g} ms {when} than the others predict "
            f"({np.degrees(late):.2g}° at {main:.3g} Hz): {agree}"
        )
        remedy = "record all channels with one clock and one filter; shift it in time, or leave it out"
        return "channel_delay", severity, extent, remedy
    return None


def _shifts(found: Explained, before: Equations) -> tuple[float, float]:
    """Return by how much angles and moments of the joints change when a fault is undone, of the joint it moves most."""
    rows = slice(None) if found.run is None else before.run == found.run
    shifts = [
        float(np.max(_size((new - old)[rows]) / np.maximum(_size(new[rows]), 1e-300)))
        for old, new in zip(unknowns_of(before), unknowns_of(found.equations), strict=True)
    ]
    return shifts[0], shifts[1]


def _size(values: Complex) -> Array:
    return np.asarray(np.sqrt(np.sum(np.abs(values) ** 2, axis=0)))


def _unit_of(gain: float) -> str:
    """Return the unit that a factor looks like, as the end of a clause; empty for any other."""
    known = (words for factor, words in UNITS.items() if abs(gain / factor - 1) < POLICY.gain)
    return next((f" (as {words})" for words in known), "")


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %" if share < 1 else "more than itself"
