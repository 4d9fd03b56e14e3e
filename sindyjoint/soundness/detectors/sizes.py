"""What was declared and the data deny: units, sizes, zeros, two sensors of one motion, coverage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from sindyjoint.files.units import unit_ratio
from sindyjoint.inputs import ColumnUnit
from sindyjoint.measurement.sensors import disagreement
from sindyjoint.record import Campaign
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.record import Record
from sindyjoint.soundness.words import Words

# Relative difference of two spellings of one unit.
SAME_UNIT = 1e-3


def find_unit_mismatches(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield the channels whose declared unit is not the one that their file states."""
    for record in records:
        for unit in () if record.source is None else record.source.units:
            ratio = _denial(unit)
            if ratio is None:
                continue
            factor = f"makes every value {1 / ratio:.4g} times what it is" if ratio else "is no such quantity"
            effect = words.effect("unit_mismatch", unit.channel)
            if unit.channel == "time":
                effect = "all frequencies are wrong by that factor, c1 too, and the inertia by its square"
            yield Finding(
                "unit_mismatch",
                record.name,
                unit.channel,
                "stops",
                f"column {unit.column!r} is declared in {unit.declared!r}, the file states {unit.stated!r}: "
                f"that {factor}",
                effect,
                f"declare unit = {unit.stated!r} for the {words.of(unit.channel)}, or correct the file",
            )


def _denial(unit: ColumnUnit) -> float | None:
    """Return the stated unit in declared ones where they differ, zero for another quantity, or None."""
    ratio = unit_ratio(unit.stated, unit.declared)
    if ratio is None or abs(ratio - 1) < SAME_UNIT:
        return None
    # The ending of a name may mean another thing ("force_in"): it denies only a unit of the same quantity.
    return None if ratio == 0 and unit.named else ratio


def find_unequal_units(campaign: Campaign, words: Words) -> Iterator[Finding]:
    """Yield runs in which a column that no file gives a unit is declared in another than in most runs."""
    columns: dict[tuple[str, str], dict[str, str]] = {}
    for run in campaign.runs:
        for unit in run.file_units:
            if unit.column and not unit.stated:
                columns.setdefault((unit.channel, unit.column), {})[run.name] = unit.unit
    for (channel, column), declared in columns.items():
        usual, count = Counter(declared.values()).most_common(1)[0]
        for run_name, stated in declared.items():
            ratio = unit_ratio(stated, usual)
            if not ratio or abs(ratio - 1) < SAME_UNIT:
                continue
            yield Finding(
                "unit_mismatch",
                run_name,
                channel,
                "biases",
                f"column {column!r} is declared in {stated!r} here and in {usual!r} in {count} of {len(declared)} "
                f"runs, and no file states which: {ratio:.4g} between them",
                "the coefficients are those of two scales",
                f"declare one unit for the {words.of(channel)} of all runs",
            )


def find_sizes(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield angles beyond half a turn, and motions too small or too large for any joint."""
    unit = words.unit("angle")
    largest = POLICY.largest_angle if unit == "rad" else POLICY.largest_stroke
    for record in records:
        angle = record.channel("angle")
        if angle is None:
            continue
        low, high = np.quantile(angle.values, [0.005, 0.995])
        peak, swing = float(max(abs(low), abs(high))), float(high - low) / 2
        if peak <= largest and swing >= POLICY.smallest_motion:
            continue
        degrees = f" ({np.degrees(peak):.3g}°)" if unit == "rad" and peak < 1e3 else ""
        yield Finding(
            "implausible_size",
            record.name,
            "angle",
            "stops" if swing > POLICY.another_scale * largest or peak <= largest else "biases",
            f"the {words.of('angle')} reaches {peak:.3g} {unit}, its amplitude is {swing:.3g} {unit}{degrees}",
            f"k1 in {words.unit('moment')}/{unit} is wrong by the factor of the unit, k3 by its cube",
            "check the unit ('Grad' is read as giga-radian, degrees are 'deg') and the gain of the channel",
        )


def find_offsets(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield motions whose zero is far from their middle, in all runs or in one."""
    some = [(r, c) for r in records if (c := r.channel("angle")) is not None and c.amplitude > 0]
    if not some:
        return
    middles = np.array([np.mean(np.quantile(c.values, [0.01, 0.99])) for _, c in some])
    usual, typical = float(np.median(middles)), float(np.median([c.amplitude for _, c in some]))
    unit, angle = words.unit("angle"), words.of("angle")
    if abs(usual) > POLICY.far_offset * typical:
        yield Finding(
            "angle_offset",
            None,
            "angle",
            "biases" if all(r.frequency for r, _ in some) else "note",
            f"the middle of the {angle} is at {usual:.3g} {unit}, {100 * abs(usual) / typical:.3g} % of its amplitude "
            "from zero",
            "k1, k2 and k3 belong to a series about a point beside the middle: even terms appear",
            f"give the {angle} channel an offset that makes the unloaded position zero",
        )
    for i, (record, channel) in enumerate(some if len(some) >= POLICY.fewest else ()):
        away, scatter = float(abs(middles[i] - usual)), float(np.ptp(np.delete(middles, i)))
        if record.frequency and away > max(POLICY.far_offset / 2 * channel.amplitude, 2 * scatter):
            yield Finding(
                "angle_offset",
                record.name,
                "angle",
                "biases",
                f"the middle of its {angle} is {middles[i] - usual:.3g} {unit} from that of the other runs, "
                f"{100 * away / channel.amplitude:.3g} % of its amplitude",
                "pulls k2 and the unequal parts of M_F towards that run and makes k3 unsure",
                "zero the sensor before each run, or give that run an offset",
            )


def find_disagreement(record: Record, words: Words) -> Iterator[Finding]:
    """Yield a run in which the acceleration is not the one of the angle: another gain, another time."""
    fusion = None if record.run is None else record.run.fusion
    if fusion is None or fusion.angle is None:
        return
    found = disagreement(
        fusion.angle, fusion.acceleration, record.sample_rate, fusion.angle_noise, fusion.noise
    )
    if found is None:
        return
    gain, gain_error, delay, delay_error = found
    phase = 2 * np.pi * (record.frequency or record.main) * abs(delay)
    apart = abs(gain - 1) > max(POLICY.gain, POLICY.outstanding * gain_error)
    late = phase > POLICY.bears and abs(delay) > POLICY.outstanding * delay_error
    if not (apart or late):
        return
    factor = f"the acceleration is {gain:.4g} ± {gain_error:.2g} times that of the {words.of('angle')}"
    when = f"it comes {1e3 * abs(delay):.3g} ms {'later' if delay > 0 else 'earlier'}"
    remedies = (
        "check unit, gain, sign and place of both sensors",
        f"declare delay = '{1e3 * delay:.3g} ms' of the acceleration",
    )
    wrong = (
        "k1, k3 and c1 are wrong by a part of that factor" if apart else "c1 takes a part of the stiffness"
    )
    yield Finding(
        "sensors_disagree",
        record.name,
        "acceleration",
        "stops" if abs(gain - 1) > POLICY.unit else "biases",
        ", ".join([factor] * apart + [when] * late),
        f"low frequencies follow one sensor and high ones the other: {wrong}",
        "; ".join([remedies[0]] * apart + [remedies[1]] * late),
    )


def find_coverage(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield what the runs, sound as each may be, cannot show together."""
    known = [r.frequency for r in records if r.frequency is not None]
    ranges = [c.range for r in records if (c := r.channel("angle")) is not None]
    steady = bool(ranges) and len(known) == len(records)
    said = []
    if len(records) == 1:
        said.append((
            "one run only", "no coefficient can be checked on a run that was left out",
            "make runs at several levels and frequencies",
        ))  # fmt: skip
    elif steady and max(known) < POLICY.same * min(known):
        said.append((
            f"one frequency only, {known[0]:g} Hz", "c1 and the inertia cannot be told from M_F and k1",
            "make runs at three frequencies or more",
        ))  # fmt: skip
    if steady and len(records) > 1 and max(ranges) < POLICY.same_level * min(ranges):
        said.append((
            f"one level only, an amplitude of {0.5 * max(ranges):.3g} {words.unit('angle')}",
            "k3 cannot be told from k1, nor M_F from c1", "make runs at two levels or more",
        ))  # fmt: skip
    yield from (Finding("coverage", None, None, "note", *each) for each in said)
