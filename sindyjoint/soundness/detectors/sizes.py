"""What was declared and the data deny: units, sizes, zeros, coverage, the main line; mains and noise."""

import shlex
from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from sindyjoint.files.units import unit_ratio
from sindyjoint.inputs import FileUnit
from sindyjoint.limits import SOUNDNESS
from sindyjoint.measurement.sensors import disagreement
from sindyjoint.numeric import Array, line_spectrum
from sindyjoint.record import Campaign
from sindyjoint.soundness import Finding, Words
from sindyjoint.soundness.detectors import Channel, Record
from sindyjoint.trust import PLACES

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
            yield words.finding(
                "unit_mismatch",
                record.name,
                unit.channel,
                "stops",
                f"column {unit.column!r} is declared in {unit.unit!r}, the file states {unit.stated!r}: "
                f"that {factor}",
                f"declare unit = {unit.stated!r} for the {words.of(unit.channel)}, or correct the file",
            )


def _denial(unit: FileUnit) -> float | None:
    """Return the stated unit in declared ones where they differ, zero for another quantity, or None."""
    ratio = unit_ratio(unit.stated, unit.unit)
    if ratio is None or abs(ratio - 1) < SAME_UNIT:
        return None
    # The ending of a name may mean another thing ("force_in"): it denies only a unit of the same quantity.
    return None if ratio == 0 and unit.named else ratio


def find_unequal_units(campaign: Campaign, words: Words) -> Iterator[Finding]:
    """Yield runs in which a column that no file gives a unit is declared in another than in most runs."""
    columns: dict[tuple[str, str], dict[str, str]] = {}
    for run in campaign.runs:
        for unit in () if run.source is None else run.source.units:
            if unit.column and not unit.stated and unit.channel != "time":
                columns.setdefault((unit.channel, unit.column), {})[run.name] = unit.unit
    for (channel, column), declared in columns.items():
        usual, count = Counter(declared.values()).most_common(1)[0]
        for run_name, stated in declared.items():
            ratio = unit_ratio(stated, usual)
            if ratio and abs(ratio - 1) >= SAME_UNIT:
                yield Finding(
                    "unit_mismatch",
                    run_name,
                    channel,
                    "biases",
                    f"column {column!r} is declared in {stated!r} here and in {usual!r} in {count} of {len(declared)} "
                    f"runs, and no file states which: {ratio:.4g} between them",
                    "the coefficients are a mean of two scales",
                    f"declare one unit for the {words.of(channel)} of all runs",
                )


def find_guesses(campaign: Campaign) -> Iterator[Finding]:
    """Yield what was guessed of channels, units and rates, and is not settled."""
    if campaign.guessed:
        settled = "".join(f" --set {shlex.quote(each.replace(' = ', '=', 1))}" for each in campaign.guessed)
        folder = shlex.quote(places.subject) if (places := PLACES.get()) else "CAMPAIGN"
        yield Finding(
            "unsettled_guess",
            None,
            None,
            "biases",
            f"init guessed {', '.join(campaign.guessed)}, which no file tells",
            "in a wrong unit or of a wrong column every coefficient is wrong",
            "if right, delete the line 'guessed' in campaign.toml, else answer with what is: sindyjoint init "
            f"{folder} --force{settled}",
        )


def find_other_sensors(campaign: Campaign, words: Words) -> Iterator[Finding]:
    """Yield columns that measure what a channel does, move otherwise, and are used nowhere."""
    units = (unit for run in campaign.runs if run.source is not None for unit in run.source.units)
    for channel, column, other in sorted({(u.channel, u.column, other) for u in units for other in u.beside}):
        yield words.finding(
            "other_sensor",
            None,
            channel,
            "note" if channel == "moment" else "biases",
            f"column {other!r} is not used; it shows the {words.of(channel)} too, and not as {column!r} does",
            "make sure that the one that is used acts on the joint"
            if channel == "moment"
            else f"is it of the other body, write minus = {other!r} in the channel's line, else minus = 'none'",
        )


def find_sizes(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield angles beyond half a turn, and motions too small or too large for any joint."""
    unit = words.unit("angle")
    largest = SOUNDNESS.largest_angle if unit == "rad" else SOUNDNESS.largest_stroke
    for record, angle in ((r, c) for r in records if (c := r.channel("angle")) is not None):
        low, high = np.quantile(angle.values, [0.005, 0.995])
        peak, swing = float(max(abs(low), abs(high))), float(high - low) / 2
        if peak <= largest and swing >= SOUNDNESS.smallest_motion:
            continue
        degrees = f" ({np.degrees(peak):.3g}°)" if unit == "rad" and peak < 1e3 else ""
        yield Finding(
            "implausible_size",
            record.name,
            "angle",
            "stops" if swing > SOUNDNESS.many_times * largest or peak <= largest else "biases",
            f"the {words.of('angle')} reaches {peak:.3g} {unit}, its amplitude is {swing:.3g} {unit}{degrees}",
            f"k1 in {words.unit('moment')}/{unit} is wrong by the factor of the unit, k3 by its cube",
            "check the unit and the gain of the channel",
        )


def find_offsets(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield motions whose zero is far from their middle, in all runs or in one."""
    some = [(r, c) for r in records if (c := r.channel("angle")) is not None and c.amplitude > 0]
    if not some:
        return
    middles = np.array([np.mean(np.quantile(c.values, [0.01, 0.99])) for _, c in some])
    usual, typical = float(np.median(middles)), float(np.median([c.amplitude for _, c in some]))
    unit, angle = words.unit("angle"), words.of("angle")
    if abs(usual) > SOUNDNESS.far_offset * typical:
        yield Finding(
            "angle_offset",
            None,
            "angle",
            "biases" if all(r.frequency for r, _ in some) else "note",
            f"the middle of the {angle} is at {usual:.3g} {unit}, {100 * abs(usual) / typical:.3g} % of its amplitude "
            "from zero",
            "k1, k2 and k3 are counted from a point beside the middle of the motion, and even terms appear",
            f"give the {angle} channel an offset that makes the unloaded position zero",
        )
    for i, (record, channel) in enumerate(some if len(some) >= SOUNDNESS.fewest else ()):
        away, scatter = float(abs(middles[i] - usual)), float(np.ptp(np.delete(middles, i)))
        if record.frequency and away > max(SOUNDNESS.far_offset / 2 * channel.amplitude, 2 * scatter):
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
    apart = abs(gain - 1) > max(SOUNDNESS.gain, SOUNDNESS.outstanding * gain_error)
    late = phase > SOUNDNESS.small_share and abs(delay) > SOUNDNESS.outstanding * delay_error
    if not (apart or late):
        return
    said = [
        (
            f"the acceleration is {gain:.4g} ± {gain_error:.2g} times that of the {words.of('angle')}",
            "k1, k3 and c1 are wrong by a part of that factor",
            "check unit, gain, sign and place of both sensors",
        )
    ] * apart + [
        (
            f"it comes {1e3 * abs(delay):.3g} ms {'later' if delay > 0 else 'earlier'}",
            "c1 takes a part of the stiffness",
            f"declare delay = '{1e3 * delay:.3g} ms' of the acceleration",
        )
    ] * late
    extents, wrong, remedies = zip(*said, strict=True)
    yield Finding(
        "sensors_disagree",
        record.name,
        "acceleration",
        "stops" if abs(gain - 1) > SOUNDNESS.unknown else "biases",
        ", ".join(extents),
        f"low frequencies follow one sensor and high ones the other: {wrong[0]}",
        "; ".join(remedies),
    )


def find_coverage(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield what the runs, sound as each may be, cannot show together."""
    known = [r.frequency for r in records if r.frequency is not None]
    ranges = [c.range for r in records if (c := r.channel("angle")) is not None]
    steady = bool(ranges) and len(known) == len(records)
    one, swing = len(records) == 1, 0.5 * max(ranges, default=0.0)
    said: list[tuple[object, str, str, str]] = [
        (
            one,
            "one run only",
            "no coefficient can be checked on a run that was left out",
            "make runs at several levels and frequencies",
        ),
        (
            steady and not one and max(known) < (1 + SOUNDNESS.small_share) * min(known),
            f"one frequency only, {next(iter(known), 0.0):g} Hz",
            "c1 and the inertia cannot be told from M_F and k1",
            "make runs at three frequencies or more",
        ),
        (
            steady and not one and max(ranges) < (1 + SOUNDNESS.alike) * min(ranges),
            f"one level only, an amplitude of {swing:.3g} {words.unit('angle')}",
            "k3 cannot be told from k1, nor M_F from c1",
            "make runs at two levels or more",
        ),
    ]
    yield from (Finding("coverage", None, None, "note", *each[1:]) for each in said if each[0])
    # A file that ends where it was cut off looks whole.
    lasting = np.array([r.duration for r in records])
    usual = float(np.median(lasting))
    alike = np.abs(lasting - usual) <= SOUNDNESS.small_share * usual
    some = alike.sum() >= SOUNDNESS.fewest and alike.mean() > SOUNDNESS.mostly
    for record in records if some else ():
        if record.duration < SOUNDNESS.mostly * usual:
            yield Finding(
                "coverage",
                record.name,
                None,
                "note",
                f"lasts {record.duration:.3g} s, and {alike.sum()} of {len(records)} runs {usual:.3g} s",
                "what is missing counts for nothing, and slow changes within the run are not seen",
                "was its file cut off? Compare it with the recorder's",
            )


# Bins on either side of the mains that are its line, that belong to neither, and that are compared.
LINE, GAP, AROUND = 1.5, 3, 12


def find_lines(record: Record, words: Words) -> Iterator[Finding]:
    """Yield a run whose channels, or one of them, have their strongest line elsewhere than declared."""
    declared, rate = record.declared, record.sample_rate
    clock, load = record.channel(record.driven_by), record.channel("moment")
    if declared is None or clock is None or record.duration * declared < SOUNDNESS.fewest:
        return
    if words.structure:
        multiple = record.main / declared
        if abs(multiple - max(1, round(multiple))) > SOUNDNESS.tolerated:
            yield _frequency_finding(
                record, "the drive", record.main, "nothing repeats, and nothing is recovered"
            )
    if load is None or words.structure:
        return
    both = {c.name: main_line(c.values, rate, declared) for c in (load, clock)}
    elsewhere = {name: f for name, (f, share) in both.items() if share < SOUNDNESS.unknown}
    if len(elsewhere) == 2 and abs(elsewhere["moment"] / elsewhere["angle"] - 1) < SOUNDNESS.minor_share:
        yield _frequency_finding(
            record,
            "both channels",
            elsewhere["angle"],
            "every coefficient, and c1 and the inertia by the ratio",
        )
    elif elsewhere:
        name, other = (load, clock) if "moment" in elsewhere else (clock, load)
        at = elsewhere[name.name]
        if len(elsewhere) == 2 or not _raised(name, other, record, at):
            yield Finding(
                "channels_disagree",
                record.name,
                name.name,
                "stops",
                f"the strongest line of the {words.of(name.name)} is at {at:.4g} Hz, that of the "
                f"{words.of(other.name)} at {both[other.name][0]:.4g} Hz",
                "load and motion are not of one test: no coefficient can be trusted",
                "check whether the column belongs to another run, or was rectified",
            )


def _raised(name: Channel, other: Channel, record: Record, at: float) -> bool:
    """Return whether a tone is in both channels: damping and inertia raise the high ones of the moment."""
    multiple = at / (record.declared or at)
    shown = main_line(other.values, record.sample_rate, record.declared or at, at)[1]
    return abs(multiple - round(multiple)) < SOUNDNESS.small_share and shown >= SOUNDNESS.unknown


def _frequency_finding(record: Record, what: str, at: float, said: str) -> Finding:
    return Finding(
        "wrong_frequency",
        record.name,
        "time",
        "stops",
        f"the strongest line of {what} is at {at:.4g} Hz, {record.declared:g} Hz is declared",
        f"periods are cut at the wrong places: {said}",
        "correct the frequency or the sampling rate of that run",
    )


def main_line(values: Array, rate: float, declared: float, at: float = 0.0) -> tuple[float, float]:
    """Return the frequency of a channel's strongest line, Hz, and the share of it that the declared one has.

    Or that another one has, ``at`` Hz; what lies far below the declared frequency is drift.
    """
    modulus, frequency = line_spectrum(values), np.fft.rfftfreq(values.size, 1 / rate)
    modulus[frequency < 0.5 * min(declared, frequency[-1])] = 0
    near = np.abs(frequency - (at or declared)) <= max(2 * rate / values.size, 0.02 * declared)
    tallest = int(np.argmax(modulus))
    share = float(modulus[near].max(initial=0.0) / max(float(modulus[tallest]), 1e-300))
    return float(frequency[tallest]), share


def find_noise(records: Sequence[Record], words: Words) -> Iterator[Finding]:
    """Yield runs in which a channel is far noisier than in the others."""
    for name in ("moment", "angle"):
        some = [(r, c) for r in records if (c := r.channel(name)) is not None and c.std > 0]
        noise = np.array([c.noise for _, c in some])
        share = noise / np.array([c.std for _, c in some])
        for i, (record, _) in enumerate(some if len(some) >= SOUNDNESS.fewest else ()):
            others, usual = np.delete(share, i), float(np.median(np.delete(noise, i)))
            # Of most of the others no noise may be known: with few samples per period motion hides it.
            if usual and min(noise[i] / usual, share[i] / others.max()) > SOUNDNESS.outstanding:
                yield words.finding(
                    "excess_noise",
                    record.name,
                    name,
                    "biases" if share[i] > SOUNDNESS.tolerated else "note",
                    f"noise of {noise[i]:.3g} {words.unit(name)} RMS, {100 * share[i]:.2g} % of the {words.of(name)}, "
                    f"{noise[i] / usual:.3g} times that of the other runs",
                    "look at shielding and sensor of that run; leave it out if the others suffice",
                )


def find_mains(record: Record, words: Words) -> Iterator[Finding]:
    """Yield channels of a steady run that carry a line of the mains, which is no harmonic of the excitation."""
    for channel in record.alive if record.frequency else ():
        for mains in (50.0, 60.0) if channel.name != "rate" else ():
            amplitude = mains_line(channel.values, record, mains)
            share = amplitude / np.sqrt(2) / channel.std
            if share >= SOUNDNESS.small_share:
                yield words.finding(
                    "mains_hum",
                    record.name,
                    channel.name,
                    "biases" if share > SOUNDNESS.gain else "note",
                    f"a line at {mains:g} Hz of {amplitude:.3g} {words.unit(channel.name)} in the "
                    f"{words.of(channel.name)}, {100 * share:.2g} % of its RMS",
                    "look for an earth loop; use another excitation frequency than a divisor of the mains",
                )


def mains_line(values: Array, record: Record, mains: float) -> float:
    """Return the amplitude of a line of the mains; zero where it does not stand out, or is near a harmonic."""
    bins = np.arange(-AROUND, AROUND + 1)
    spectrum = 4 / values.size * line_spectrum(values)
    at = round(mains * values.size / record.sample_rate)
    order = (at + bins) * record.sample_rate / values.size / (record.frequency or mains)
    harmonic = np.abs(order - np.round(order)) * values.size / record.samples_per_period <= GAP
    if at + AROUND >= spectrum.size or at < AROUND or harmonic[np.abs(bins) <= LINE].any():
        return 0.0
    around = spectrum[at + bins][~harmonic & (np.abs(bins) > GAP)]
    height = float(spectrum[at + bins][np.abs(bins) <= LINE].max())
    # A median modulus of noise is 1.18 of its deviations; of a hundred thousand the largest has five.
    return height if around.size >= 4 and height > SOUNDNESS.outstanding * np.median(around) * 1.5 else 0.0
