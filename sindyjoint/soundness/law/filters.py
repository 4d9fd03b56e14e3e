"""What the law between the channels shows of all runs: signs, the inertia, a filter on one channel, a delay."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from sindyjoint.discovery.delay import find_delay
from sindyjoint.errors import SindyJointError
from sindyjoint.limits import SOUNDNESS
from sindyjoint.numeric import Array, rms
from sindyjoint.record import Campaign, Run
from sindyjoint.soundness import Finding, Words
from sindyjoint.soundness.detectors import Record
from sindyjoint.soundness.law import POINTS, Motions, least, misfit, scale_of
from sindyjoint.states import force_states, moment_floor


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
    backwards, load_name = loss < -SOUNDNESS.gain, words.of("moment")
    if backwards.all():
        flipped = bool(np.all(stiff < 0) or np.all(loss < -SOUNDNESS.explains))
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
    for i in np.flatnonzero(backwards) if SOUNDNESS.fewest * max(backwards.sum(), 1) <= len(rows) else ():
        flipped = bool(stiff[i] * np.median(np.delete(stiff, i)) < 0)
        yield Finding(
            "reversed_sign" if flipped else "gives_off_energy",
            rows[i][0],
            "moment",
            "stops",
            f"this run gives off energy ({100 * loss[i]:.2g} % of the product of the RMS of {load_name} and "
            f"{words.of('rate')}) while the others dissipate",
            "pulls c1 and M_F towards zero" + ", and k1 with them" * flipped,
            "reverse one channel of that run"
            if flipped
            else "its channels may be swapped: name each one's column in its [run.channels]; or the record runs "
            "backwards: leave it out",
        )


def _likeness(one: Array, other: Array) -> float:
    return float(np.mean(one * other) / max(np.sqrt(np.mean(one**2) * np.mean(other**2)), 1e-300))


def find_inertia(cycles: Motions, inertia: float | None, words: Words) -> Iterator[Finding]:
    """Yield an inertia whose moment is above the measured one, and that the frequencies deny."""
    if not inertia or not len(cycles):
        return
    sizes = inertia * np.std(cycles.acceleration, axis=1) / np.maximum(cycles.size, 1e-300)
    ratio = float(np.median(sizes))
    if ratio < 1:
        return
    # At resonance the moment of the inertia is above the measured one, and rightly so.
    denied = misfit(cycles, None) ** 2 < SOUNDNESS.explains * misfit(cycles, inertia) ** 2
    # Of the inertia's moment over the measured one, from which it stops.
    yield Finding(
        "implausible_size",
        None,
        "moment",
        "stops" if denied and ratio > 3.0 else "biases" if denied else "note",
        f"inertia times acceleration is {ratio:.3g} times the measured {words.of('moment')}",
        "k1 is wrong by inertia times ω²",
        f"check the unit of the {words.of('angle')}, of the {words.of('moment')} and of the inertia",
    )


class Undone(NamedTuple):
    """A filter undone: its id, its channel, its corner (Hz) or time (s), and the misfit that is left."""

    id: str
    channel: str
    parameter: float
    left: float


#: By fault what undoes it: a first-order high-pass of a corner in Hz, a first-order low-pass or a delay of a time in s.
INVERSES: dict[str, Callable[[Array, float], Any]] = {
    "ac_coupling": lambda lines, corner: 1 + (lines > 0) * corner / (1j * np.where(lines > 0, lines, 1.0)),
    "low_pass": lambda lines, time: 1 + 2j * np.pi * lines * time,
    "channel_delay": lambda lines, time: np.exp(2j * np.pi * lines * time),
}


def find_filters(runs: Motions, inertia: float | None, words: Words) -> Iterator[Finding]:
    """Yield the filter that one channel has passed and the other has not, where undoing it restores the law.

    A low-pass lags as a delay does, which must leave more. Friction that builds up with time lags as a low-pass on the
    moment does, but not by one time in runs that are fast and in those that are slow.
    """
    if len(runs) < 2 or runs.frequency is None:
        return
    before = misfit(runs, inertia)
    if before < SOUNDNESS.minor_share * SOUNDNESS.departs:
        return
    best = min(_undone(runs, inertia), key=lambda each: each.left)
    if best.id == "channel_delay" or best.left > min(np.sqrt(SOUNDNESS.explains) * before, SOUNDNESS.departs):
        return
    slowest = float(runs.cycle.min())
    gain = f"one law leaves {100 * before:.2g} % of the {words.of('moment')}, {100 * best.left:.2g} % with that undone"
    if best.id == "ac_coupling":
        lead = float(np.arctan(best.parameter / slowest))
        yield Finding(
            best.id,
            None,
            best.channel,
            "stops" if lead > SOUNDNESS.unknown else "biases",
            f"the {words.of(best.channel)} seems AC coupled with a corner of {best.parameter:.3g} Hz: it leads by "
            f"{np.degrees(lead):.2g}° at {slowest:g} Hz and less above ({gain})",
            "k1 and c1 depend on the frequency, k2 and the mean are lost, M_F fades over each half-cycle",
            "switch the coupling to DC and repeat the tests",
        )
    elif best.channel == "angle" or _is_one_time(runs, inertia, best):
        yield Finding(
            best.id,
            None,
            best.channel,
            "biases",
            f"the {words.of(best.channel)} seems to have passed a low-pass with a corner of "
            f"{1 / (2 * np.pi * best.parameter):.3g} Hz that the other channel has not: it lags by "
            f"{1e3 * best.parameter:.3g} ms ({gain})",
            f"shifts c1 by about {'-' if best.channel == 'moment' else '+'}{best.parameter:.2g} s times k1, and rounds "
            "M_F",
            "set the same filter on both channels and repeat the tests",
        )


def _undone(runs: Motions, inertia: float | None, kinds: Sequence[str] = tuple(INVERSES)) -> list[Undone]:
    """Return each filter, on each channel, with the parameter under which the runs have most of a law in common."""
    scale, slowest = scale_of(runs), float(runs.cycle.min())
    # Corner of a high-pass, and delay and time of a low-pass in radians of the slowest run, up to which they are tried.
    most = {"ac_coupling": 0.6 * slowest}
    grids = {kind: np.linspace(0, most.get(kind, 0.3 / (2 * np.pi * slowest)), 9) for kind in kinds}

    def left(kind: str, channel: str, parameter: float) -> float:
        return misfit(runs.filtered(channel, INVERSES[kind](runs.lines, parameter)), inertia, scale)

    return [
        Undone(kind, channel, *least(partial(left, kind, channel), grid))
        for kind, grid in grids.items()
        for channel in ("moment", "angle")
    ]


def _is_one_time(runs: Motions, inertia: float | None, best: Undone) -> bool:
    """Return whether the slower half of the runs and the faster one show one time."""
    halves = [runs.take(half.tolist()) for half in np.array_split(np.argsort(runs.cycle), 2)]
    times = [_undone(half, inertia, [best.id])[0].parameter for half in halves if len(half) > 1]
    return all(abs(time - best.parameter) < SOUNDNESS.large_part * best.parameter for time in times)


def find_channel_delay(campaign: Campaign, runs: Sequence[Run], words: Words) -> Iterator[Finding]:
    """Yield the delay between the channels under the paper's law, by its error that holds what the law lacks.

    Parameters
    ----------
    campaign : Campaign
    runs : sequence of Run
        Those that may be looked at; of many samples every second one is, or every third.
    words : Words
    """
    try:
        # Samples in which a delay is sought.
        every = [force_states(run) for run in runs[:: 1 + sum(r.n_samples for r in runs) // 100_000]]
        states = [s for s in every if np.count_nonzero(s.moving) >= POINTS]
        delay = find_delay(states, campaign.joint.inertia, campaign.inputs) if states else None
    # A joint that hardly moves, too short a run, states that are all alike or beyond what squares can hold.
    except (SindyJointError, np.linalg.LinAlgError, ValueError):
        return
    if delay is None or delay.at_limit or not delay.significant:
        return
    usual = float(np.median([np.std(s.rate) / max(float(np.std(s.angle)), 1e-300) for s in states]))
    size = abs(delay.time)
    # What the law leaves must be little beyond noise, or beside what the delay moves: it may be taken for a delay.
    floor = moment_floor(states, campaign.joint.inertia or 0.0).moment
    moved = size * usual * rms(np.concatenate([s.moment[s.moving] for s in states]))
    more = delay.residual_rms**2 - floor**2  # unknown where the floor is
    unexplained = (
        more > (SOUNDNESS.minor_share * moved) ** 2
        and delay.residual_rms > (1 + SOUNDNESS.minor_share) * floor
    )
    if size * usual < SOUNDNESS.small_share or unexplained:
        return
    yield Finding(
        "channel_delay",
        None,
        "moment",
        "biases",
        f"the {words.of('moment')} {'lags' if delay.time > 0 else 'leads'} the {words.of('angle')} by "
        f"{1e3 * size:.3g} ± {1e3 * delay.standard_error:.2g} ms",
        f"shifts c1 by about {-delay.time:+.2g} s times k1, and makes damping of the inertia and of k3",
        "check the common trigger, run with --align, or declare [channels] skew",
    )
