"""Sizes that cannot be, zeros far from the middle, signs that contradict dissipation, and what a campaign covers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.record import Campaign
from sindyjoint.soundness.cycle import Cycles, synthesise
from sindyjoint.soundness.detectors.common_law import CommonLaw, rows_of, scale_of, solve
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.profile import Profile
from sindyjoint.soundness.words import Words


def find_sizes(profiles: Sequence[Profile], words: Words) -> Iterator[Finding]:
    """Yield angles beyond half a turn, and motions too small or too large for any joint."""
    rotation = words.angle_unit == "rad"
    for profile in profiles:
        angle = profile.channel("angle")
        if angle is None:
            continue
        low, high = np.quantile(angle.values, [0.005, 0.995])
        peak, swing = float(max(abs(low), abs(high))), float(high - low) / 2
        largest = POLICY.largest_angle if rotation else POLICY.largest_stroke
        if peak <= largest and swing >= POLICY.smallest_motion:
            continue
        stops = swing > POLICY.absurd_turns * largest or peak <= largest
        yield Finding(
            "implausible_size",
            profile.run.name,
            "angle",
            "stops" if stops else "biases",
            f"the {words.angle} reaches {peak:.3g} {words.angle_unit}, its amplitude is {swing:.3g} {words.angle_unit}"
            + (f" ({np.degrees(peak):.3g}°)" if rotation and peak < 1e3 else ""),
            f"k1 in {words.moment_unit}/{words.angle_unit} is wrong by the factor of the unit, k3 by its cube",
            "check the unit ('Grad' is read as giga-radian, degrees are 'deg') and the gain of the channel",
        )


def find_inertia(cycles: Cycles, campaign: Campaign, words: Words) -> Iterator[Finding]:
    """Yield an inertia whose moment is above the measured one, and that the frequencies deny."""
    inertia = campaign.joint.inertia
    if not inertia or not len(cycles):
        return
    acceleration, moment = cycles.motion()[2], synthesise(cycles.moment)
    ratio = float(
        np.median(inertia * np.std(acceleration, axis=1) / np.maximum(np.std(moment, axis=1), 1e-300))
    )
    if ratio < POLICY.inertia_above:
        return
    scale = scale_of(cycles)
    declared, free = (
        np.sqrt(solve(rows_of(cycles, CommonLaw(scale, value)).products.sum(axis=0))[1] / len(cycles))
        for value in (inertia, None)
    )
    # At resonance the moment of the inertia is above the measured one, and rightly so.
    denied = free < POLICY.inertia_denied * declared
    yield Finding(
        "implausible_size",
        None,
        "moment",
        "stops" if denied and ratio > POLICY.inertia_absurd else "biases" if denied else "note",
        f"inertia times acceleration is {ratio:.3g} times the measured {words.moment}",
        "k1 is wrong by inertia times ω²",
        f"check the unit of the {words.angle}, of the {words.moment} and of the inertia",
    )


def find_offsets(profiles: Sequence[Profile], words: Words) -> Iterator[Finding]:
    """Yield motions whose zero is far from their middle, in all runs or in one."""
    rows = [(p, *_middle(c.values)) for p in profiles if (c := p.channel("angle")) is not None]
    rows = [(p, middle, swing) for p, middle, swing in rows if swing > 0]
    if not rows:
        return
    usual = float(np.median([middle for _, middle, _ in rows]))
    typical = float(np.median([swing for _, _, swing in rows]))
    if abs(usual) > POLICY.far_offset * typical:
        steady = all(p.frequency is not None for p, _, _ in rows)
        yield Finding(
            "angle_offset",
            None,
            "angle",
            "biases" if steady else "note",
            f"the middle of the {words.angle} is at {usual:.3g} {words.angle_unit}, {100 * abs(usual) / typical:.3g} % "
            "of its amplitude from zero",
            "k1, k2 and k3 are those of a Taylor series about a point that is not the middle: even terms appear",
            f"give the {words.angle} channel an offset that makes the unloaded position zero",
        )
    if len(rows) < 3:
        return
    for p, middle, swing in rows:
        others = [m for q, m, _ in rows if q is not p]
        away, scatter = abs(middle - usual), float(np.ptp(others))
        if p.frequency is not None and away > POLICY.odd_offset * swing and away > 2 * scatter:
            yield Finding(
                "angle_offset",
                p.run.name,
                "angle",
                "biases",
                f"the middle of its {words.angle} is {middle - usual:.3g} {words.angle_unit} from that of the other "
                f"runs, {100 * away / swing:.3g} % of its amplitude",
                "k2 and the unequal parts of M_F are drawn towards that run, k3 is blurred",
                "zero the sensor before each run, or give that run an offset",
            )


def _middle(values: Array) -> tuple[float, float]:
    low, high = np.quantile(values, [0.005, 0.995])
    return 0.5 * float(high + low), 0.5 * float(high - low)


def find_signs(
    profiles: Sequence[Profile], cycles: Cycles, inertia: float | None, words: Words
) -> Iterator[Finding]:
    """Yield campaigns in which every run gives off energy."""
    if len(cycles):
        _, rate, acceleration = cycles.motion()
        load = synthesise(cycles.moment) - (inertia or 0.0) * acceleration
        angle = cycles.motion()[0]
        loss, stiff = _likeness(load, rate), _likeness(load - load.mean(axis=1, keepdims=True), angle)
        names = cycles.names
    else:
        rows = [(p, *_course_of(p)) for p in profiles if {"moment", "angle"} <= {c.name for c in p.channels}]
        if not rows:
            return
        loss, stiff = np.array([r[1] for r in rows]), np.array([r[2] for r in rows])
        names = tuple(r[0].run.name for r in rows)
    backwards = loss < -POLICY.given_off
    if backwards.all():
        reversed_too = bool(np.all(stiff < 0)) or bool(np.all(loss < -POLICY.mostly_given_off))
        yield Finding(
            "reversed_sign" if reversed_too else "gives_off_energy",
            None,
            "moment",
            "stops",
            f"every run gives off energy: {words.moment} times {words.rate} is {100 * np.median(loss):.2g} % of the "
            f"product of their RMS"
            + (f", and the {words.moment} falls with the {words.angle}" if reversed_too else ""),
            "c1 and M_F come out negative" + (", and so does k1" if reversed_too else ""),
            "reverse one channel: a negative gain in [channels]"
            if reversed_too
            else "check the time delay between the channels, and whether the records run backwards",
        )
        return
    if len(names) >= 3 and backwards.sum() <= len(names) // 3:
        for i in np.flatnonzero(backwards):
            flipped = stiff[i] * np.median(np.delete(stiff, i)) < 0
            yield Finding(
                "reversed_sign" if flipped else "gives_off_energy",
                names[i],
                "moment",
                "stops",
                f"this run gives off energy ({100 * loss[i]:.2g} % of the product of the RMS of {words.moment} and "
                f"{words.rate}) while the others dissipate",
                "c1 and M_F are drawn towards zero" + (", and so is k1" if flipped else ""),
                "reverse one channel of that run"
                if flipped
                else "the record may run backwards: leave it out",
            )


def _likeness(one: Array, other: Array) -> Array:
    norm = np.sqrt(np.mean(one**2, axis=1) * np.mean(other**2, axis=1))
    return np.asarray(np.mean(one * other, axis=1) / np.maximum(norm, 1e-300))


def _course_of(profile: Profile) -> tuple[float, float]:
    """Return the same two numbers for a run that does not repeat, from differences over some samples."""
    moment, angle = profile.channel("moment"), profile.channel("angle")
    assert moment is not None and angle is not None
    rate = np.gradient(angle.values)
    centred = (moment.values - moment.values.mean())[None]
    loss = float(_likeness(moment.values[None], rate[None])[0])
    return loss, float(_likeness(centred, (angle.values - angle.values.mean())[None])[0])


def find_coverage(profiles: Sequence[Profile], words: Words) -> Iterator[Finding]:
    """Yield what the runs, sound as each may be, cannot show together."""
    known = [p.frequency for p in profiles if p.frequency is not None]
    alive = [c for p in profiles if (c := p.channel("angle")) is not None]
    steady = bool(alive) and len(known) == len(profiles)
    if len(profiles) == 1:
        yield Finding(
            "coverage", None, None, "note", "one run only", "no coefficient can be checked on a run that was left out",
            "make runs at several levels and frequencies",
        )  # fmt: skip
    elif steady and max(known) < POLICY.same_frequency * min(known):
        yield Finding(
            "coverage", None, None, "note", f"one frequency only, {known[0]:g} Hz",
            "c1 and the inertia cannot be told from M_F and k1", "make runs at three frequencies or more",
        )  # fmt: skip
    ranges = [c.range for c in alive]
    if steady and len(profiles) > 1 and max(ranges) < POLICY.same_level * min(ranges):
        yield Finding(
            "coverage", None, None, "note",
            f"one level only, an amplitude of {0.5 * max(ranges):.3g} {words.angle_unit}",
            "k3 cannot be told from k1, nor M_F from c1", "make runs at two levels or more",
        )  # fmt: skip
    few = [p for p in profiles if p.samples_per_period and p.samples_per_period < POLICY.few_samples]
    if few:
        least = min(p.samples_per_period or 0.0 for p in few)
        yield Finding(
            "few_samples_per_period", few[0].run.name if len(few) == 1 else None, "time", "note",
            f"{least:.3g} samples per period in {len(few)} run(s)",
            "few harmonics remain: k3 and c1 carry an error of the processing",
            f"sample at {POLICY.few_samples:g} times the excitation frequency or more",
        )  # fmt: skip
