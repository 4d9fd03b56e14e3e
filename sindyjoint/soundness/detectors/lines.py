"""Which frequency each channel has: another than declared, or not the same in both."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.profile import Profile
from sindyjoint.soundness.words import Words


def find_lines(profile: Profile, words: Words) -> Iterator[Finding]:
    """Yield a run whose channels, or one of them, have their strongest line elsewhere than declared."""
    declared = profile.run.frequency
    moment, angle = profile.channel("moment"), profile.channel("angle")
    if declared is None or moment is None or angle is None:
        return
    if profile.run.n_samples * declared / profile.run.sample_rate < POLICY.fewest_periods:
        return
    rate = profile.run.sample_rate
    found = {name: main_line(c.values, rate, declared) for name, c in (("moment", moment), ("angle", angle))}
    elsewhere = {name: f for name, (f, share) in found.items() if share < POLICY.line_share}
    if not elsewhere:
        return
    if len(elsewhere) == 2 and abs(elsewhere["moment"] / elsewhere["angle"] - 1) < 0.1:
        yield Finding(
            "wrong_frequency",
            profile.run.name,
            "time",
            "stops",
            f"the strongest line of both channels is at {elsewhere['angle']:.4g} Hz, {declared:g} Hz is declared",
            "periods are cut at the wrong places: every coefficient, and c1 and the inertia by the ratio",
            "correct the frequency or the sampling rate of that run",
        )
        return
    name = "moment" if "moment" in elsewhere else "angle"
    other = "angle" if name == "moment" else "moment"
    multiple = elsewhere[name] / declared
    if len(elsewhere) == 1 and abs(multiple - round(multiple)) < 0.02:
        # Waveforms of several tones: damping and inertia raise the high ones of the moment.
        values = {"moment": moment, "angle": angle}[other].values
        if main_line(values, rate, declared, elsewhere[name])[1] >= POLICY.line_share:
            return
    yield Finding(
        "channels_disagree",
        profile.run.name,
        name,
        "stops",
        f"the strongest line of the {words.of(name)} is at {elsewhere[name]:.4g} Hz, that of the {words.of(other)} at "
        f"{found[other][0]:.4g} Hz",
        "load and motion are not of one test: no coefficient can be trusted",
        "check whether the column belongs to another run, or was rectified",
    )


def main_line(values: Array, rate: float, declared: float, at: float = 0.0) -> tuple[float, float]:
    """Return the frequency of a channel's strongest line, Hz, and the share of it that the declared one has.

    Or that another one has, ``at`` Hz; what lies far below the declared frequency is drift.
    """
    at = at or declared
    size = values.size
    modulus = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(size)))
    frequency = np.fft.rfftfreq(size, 1 / rate)
    modulus[frequency < 0.5 * min(declared, frequency[-1])] = 0
    near = np.abs(frequency - at) <= max(2 * rate / size, 0.02 * declared)
    tallest = int(np.argmax(modulus))
    share = float(modulus[near].max(initial=0.0) / max(float(modulus[tallest]), 1e-300))
    return float(frequency[tallest]), share


def strongest_line(values: Array, rate: float) -> float:
    """Return the frequency of a channel's strongest line, Hz, between the bins of its spectrum."""
    size = values.size
    modulus = np.abs(np.fft.rfft((values - values.mean()) * np.hanning(size)))
    at = int(np.clip(np.argmax(modulus), 1, modulus.size - 2))
    # A parabola through the logarithms is the main lobe of the window but for 1 %.
    low, middle, high = np.log(np.maximum(modulus[at - 1 : at + 2], 1e-300))
    curve = low - 2 * middle + high
    between = 0.5 * (low - high) / curve if curve < 0 else 0.0
    return float((at + between) * rate / size)
