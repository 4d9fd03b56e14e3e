"""Noise, resolution and pick-up of a channel."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from sindyjoint.soundness.cycle import Spectrum
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.profile import Profile
from sindyjoint.soundness.words import Words

MAINS = (50.0, 60.0)


def find_coarse_steps(profile: Profile, words: Words) -> Iterator[Finding]:
    """Yield channels whose resolution is a sizeable part of what they measure."""
    for channel in profile.channels:
        share = channel.step / channel.std if channel.std else 0.0
        if (
            not channel.quantised
            or share < POLICY.visible_step
            or channel.levels[0].size > channel.values.size / 4
        ):
            continue
        yield Finding(
            "coarse_quantisation",
            profile.run.name,
            channel.name,
            "biases" if share > POLICY.coarse_step else "note",
            f"the {words.of(channel.name)} comes in steps of {channel.step:.3g} {words.unit(channel.name)}, "
            f"{100 * share:.2g} % of its standard deviation",
            "steps follow the motion and do not average out: shifts k1, k3 and M_F"
            if share > POLICY.coarse_step
            else "adds a noise floor of a third of a step",
            "use a smaller range of the amplifier or of the converter",
        )


def find_noise(profiles: Sequence[Profile], words: Words) -> Iterator[Finding]:
    """Yield runs in which a channel is far noisier than in the others."""
    for name in ("moment", "angle"):
        alive = [(p, c) for p in profiles if (c := p.channel(name)) is not None and c.std > 0]
        if len(alive) < 3:
            continue
        noise = np.array([c.noise for _, c in alive])
        share = noise / np.array([c.std for _, c in alive])
        for i, (p, _) in enumerate(alive):
            others, usual = np.delete(share, i), float(np.median(np.delete(noise, i)))
            if not usual:
                # Of most of the others no noise is known: with few samples per period motion hides it.
                continue
            if share[i] > POLICY.excess_noise * others.max() and noise[i] > POLICY.excess_noise * usual:
                much = share[i] > POLICY.noticeable_noise
                yield Finding(
                    "excess_noise",
                    p.run.name,
                    name,
                    "biases" if much else "note",
                    f"noise of {noise[i]:.3g} {words.unit(name)} RMS, {100 * share[i]:.2g} % of the {words.of(name)}, "
                    f"{noise[i] / usual:.3g} times that of the other runs",
                    "widens the intervals of all coefficients"
                    if name == "moment"
                    else "noise of the motion draws k1 and c1 towards zero",
                    "look at shielding and sensor of that run; leave it out if the others suffice",
                )


def mains_line(spectrum: Spectrum, frequency: float, mains: float) -> tuple[float, float]:
    """Return amplitude of the mains line, and how far it stands out of the bins around it; zeros where harmonics lie.

    Parameters
    ----------
    spectrum : Spectrum
    frequency : float
        Of the excitation, Hz.
    mains : float
        Hz.
    """
    at = mains / frequency * spectrum.periods
    order = mains / frequency
    if at + 12 >= spectrum.bins.size or abs(order - round(order)) * spectrum.periods < 1.5:
        return 0.0, 0.0
    near = np.arange(int(at) - 12, int(at) + 14)
    near = near[near > 0]
    distance = np.abs((near + spectrum.periods // 2) % spectrum.periods - spectrum.periods // 2)
    modulus = np.abs(spectrum.bins[near])
    line = np.abs(near - at) <= 1.5
    around = modulus[~line & (np.abs(near - at) > 3) & (distance > 2)]
    if around.size < 4:
        return 0.0, 0.0
    height = float(np.sqrt(np.sum(modulus[line] ** 2)))
    return 2 * height, height / max(float(np.median(around)), 1e-300)


def find_mains(profile: Profile, spectra: dict[str, Spectrum], words: Words) -> Iterator[Finding]:
    """Yield channels of a steady run that carry a line of the mains."""
    for name, spectrum in spectra.items():
        channel = profile.channel(name)
        if channel is None or name == "rate" or channel.std == 0:
            continue
        for mains in MAINS:
            amplitude, contrast = mains_line(spectrum, profile.frequency or 1.0, mains)
            share = amplitude / np.sqrt(2) / channel.std
            if contrast < POLICY.line_contrast or share < POLICY.visible_line:
                continue
            yield Finding(
                "mains_hum",
                profile.run.name,
                name,
                "biases" if share > POLICY.strong_line else "note",
                f"a line at {mains:g} Hz of {amplitude:.3g} {words.unit(name)} in the {words.of(name)}, "
                f"{100 * share:.2g} % of its RMS",
                "raises the noise floor; where the mains is a harmonic of the excitation, shifts k3 and M_F"
                if name == "moment"
                else "its derivatives are larger still: spoils c1 and the inertia",
                "look for an earth loop; use another excitation frequency than a divisor of the mains",
            )
