"""The sign of the dissipated energy, and the moment of the inertia: what no joint and no declared mass can do."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.law.motions import Motions, misfit
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.record import Record
from sindyjoint.soundness.words import Words

# Of the inertia's moment over the measured one, from which it stops.
ABSURD = 3.0


def find_signs(
    records: Sequence[Record], cycles: Motions, inertia: float | None, words: Words
) -> Iterator[Finding]:
    """Yield campaigns in which every run gives off energy, or runs that do while the others dissipate."""
    if len(cycles):
        load = cycles.moment - (inertia or 0.0) * cycles.acceleration
        rows = list(zip(cycles.names, load, cycles.rate, cycles.angle, strict=True))
    else:
        both = [(r.name, r.channel("moment"), r.channel("angle")) for r in records]
        rows = [
            (n, m.values, np.gradient(a.values), a.values)
            for n, m, a in both
            if m is not None and a is not None
        ]
    if not rows:
        return
    loss = np.array([_likeness(moment, rate) for _, moment, rate, _ in rows])
    stiff = np.array(
        [_likeness(moment - moment.mean(), angle - angle.mean()) for _, moment, _, angle in rows]
    )
    backwards, load_name = loss < -POLICY.given_off, words.of("moment")
    if backwards.all():
        flipped = bool(np.all(stiff < 0) or np.all(loss < -POLICY.explains))
        falls = f", and the {load_name} falls with the {words.of('angle')}" if flipped else ""
        yield Finding(
            "reversed_sign" if flipped else "gives_off_energy",
            None,
            "moment",
            "stops",
            f"every run gives off energy: {load_name} times {words.of('rate')} is {100 * np.median(loss):.2g} % of the "
            f"product of their RMS{falls}",
            "c1 and M_F come out negative" + ", and so does k1" * flipped,
            "reverse one channel: a negative gain in [channels]"
            if flipped
            else "check the time delay between the channels, and whether the records run backwards",
        )
        return
    for i in np.flatnonzero(backwards) if POLICY.fewest * max(backwards.sum(), 1) <= len(rows) else ():
        flipped = bool(stiff[i] * np.median(np.delete(stiff, i)) < 0)
        yield Finding(
            "reversed_sign" if flipped else "gives_off_energy",
            rows[i][0],
            "moment",
            "stops",
            f"this run gives off energy ({100 * loss[i]:.2g} % of the product of the RMS of {load_name} and "
            f"{words.of('rate')}) while the others dissipate",
            "pulls c1 and M_F towards zero" + ", and so is k1" * flipped,
            "reverse one channel of that run" if flipped else "the record may run backwards: leave it out",
        )


def _likeness(one: Array, other: Array) -> float:
    norm = np.sqrt(np.mean(one**2) * np.mean(other**2))
    return float(np.mean(one * other) / max(norm, 1e-300))


def find_inertia(cycles: Motions, inertia: float | None, words: Words) -> Iterator[Finding]:
    """Yield an inertia whose moment is above the measured one, and that the frequencies deny."""
    if not inertia or not len(cycles):
        return
    sizes = inertia * np.std(cycles.acceleration, axis=1) / np.maximum(cycles.size, 1e-300)
    ratio = float(np.median(sizes))
    if ratio < 1:
        return
    # At resonance the moment of the inertia is above the measured one, and rightly so.
    denied = misfit(cycles, None) ** 2 < POLICY.explains * misfit(cycles, inertia) ** 2
    yield Finding(
        "implausible_size",
        None,
        "moment",
        "stops" if denied and ratio > ABSURD else "biases" if denied else "note",
        f"inertia times acceleration is {ratio:.3g} times the measured {words.of('moment')}",
        "k1 is wrong by inertia times ω²",
        f"check the unit of the {words.of('angle')}, of the {words.of('moment')} and of the inertia",
    )
