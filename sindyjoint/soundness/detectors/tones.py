"""What a spectrum shows: a main line elsewhere than declared, a line of the mains, noise beyond that of other runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sindyjoint.numeric import Array, line_spectrum
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.record import Channel, Record
from sindyjoint.soundness.words import Words

MAINS = (50.0, 60.0)
# Bins on either side of the mains that are its line, that belong to neither, and that are compared.
LINE, GAP, AROUND = 1.5, 3, 12
LOST = "periods are cut at the wrong places: "


def find_lines(record: Record, words: Words) -> Iterator[Finding]:
    """Yield a run whose channels, or one of them, have their strongest line elsewhere than declared."""
    declared, rate = record.declared, record.sample_rate
    clock, load = record.channel(record.driven_by), record.channel("moment")
    if declared is None or clock is None or record.duration * declared < POLICY.fewest:
        return
    if words.structure:
        multiple = record.main / declared
        if abs(multiple - max(1, round(multiple))) > POLICY.changed:
            yield _frequency_finding(
                record, "the drive", record.main, "nothing repeats, and nothing is recovered"
            )
        return
    if load is None:
        return
    both = {c.name: main_line(c.values, rate, declared) for c in (load, clock)}
    elsewhere = {name: f for name, (f, share) in both.items() if share < POLICY.unit}
    if len(elsewhere) == 2 and abs(elsewhere["moment"] / elsewhere["angle"] - 1) < POLICY.nearly:
        said = "every coefficient, and c1 and the inertia by the ratio"
        yield _frequency_finding(record, "both channels", elsewhere["angle"], said)
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
    return abs(multiple - round(multiple)) < POLICY.same - 1 and shown >= POLICY.unit


def _frequency_finding(record: Record, what: str, at: float, said: str) -> Finding:
    extent = f"the strongest line of {what} is at {at:.4g} Hz, {record.declared:g} Hz is declared"
    remedy = "correct the frequency or the sampling rate of that run"
    return Finding("wrong_frequency", record.name, "time", "stops", extent, LOST + said, remedy)


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
        for i, (record, _) in enumerate(some if len(some) >= POLICY.fewest else ()):
            others, usual = np.delete(share, i), float(np.median(np.delete(noise, i)))
            # Of most of the others no noise may be known: with few samples per period motion hides it.
            stands = noise[i] > POLICY.outstanding * usual and share[i] > POLICY.outstanding * others.max()
            if not usual or not stands:
                continue
            yield words.finding(
                "excess_noise",
                record.name,
                name,
                "biases" if share[i] > POLICY.changed else "note",
                f"noise of {noise[i]:.3g} {words.unit(name)} RMS, {100 * share[i]:.2g} % of the {words.of(name)}, "
                f"{noise[i] / usual:.3g} times that of the other runs",
                "look at shielding and sensor of that run; leave it out if the others suffice",
            )


def find_mains(record: Record, words: Words) -> Iterator[Finding]:
    """Yield channels of a steady run that carry a line of the mains, which is no harmonic of the excitation."""
    for channel in record.alive if record.frequency else ():
        for mains in MAINS if channel.name != "rate" else ():
            amplitude = mains_line(channel.values, record, mains)
            share = amplitude / np.sqrt(2) / channel.std
            if share < POLICY.visible:
                continue
            yield words.finding(
                "mains_hum",
                record.name,
                channel.name,
                "biases" if share > POLICY.gain else "note",
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
    return height if around.size >= 4 and height > POLICY.outstanding * np.median(around) * 1.5 else 0.0
