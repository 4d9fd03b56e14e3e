"""A further run of a hidden joint, as a laboratory would make it on advice: with the simulator alone."""

from dataclasses import replace

import numpy as np

from sindyjoint.mechanics import SumLaw, transfer_moment
from sindyjoint.record import Run
from tests.diagnosis.hidden_effects import law_at

SEVERAL = {"two-tone angle, sin(2*pi*f*t) + 0.8*sin(6*pi*f*t)": {1: 1.0, 3: 0.8},
           "two-tone angle, sin(2*pi*f*t) + 0.5*sin(10*pi*f*t)": {1: 1.0, 5: 0.5},
           "multisine angle, harmonics 1 to 5 alike": {1: 1.0, 2: 1.0, 3: 1.0, 4: -1.0, 5: 1.0}}  # fmt: skip


def one_more(hidden, frequency, level, waveform, noise, index=0):
    """Return a further run of a hidden joint, its channels as wrong and as noisy as before."""
    generator = np.random.default_rng((90_000 + hidden.plan.seed, index))
    name, (amount, *_) = hidden.name, (*hidden.parameters, 0.0)
    law = law_at(hidden, frequency)
    made = _by_moment if waveform.startswith("sinusoidal moment") else _by_angle
    moment, angle, rate = made(hidden.plan, law, frequency, level, waveform)
    if name == "channel_delay":
        time = np.arange(moment.size) / rate
        moment = np.interp(time - amount, time, moment)
    if name == "angle_offset":
        angle = angle + amount
    moment, angle = (x + noise * np.std(x) * generator.standard_normal(x.size) for x in (moment, angle))
    return Run(f"advised-{index}", moment, angle, rate, frequency=frequency, level=f"advised {level:.3g}")


def _by_angle(plan, law, frequency, level, waveform):
    """Return moment, angle and sample rate under a prescribed angle of peak ``level`` rad."""
    rate = max(plan.sample_rate, 400 * frequency)
    time = np.arange(round(max(plan.duration, 6 / frequency) * rate)) / rate
    shape, slope, bend = _waveform(waveform, 2 * np.pi * frequency * time + 0.1)
    w = 2 * np.pi * frequency
    whole = plan.law if law is None else SumLaw(plan.law, law)
    angle, speed, acceleration = level * shape, level * w * slope, level * w**2 * bend
    moment, _ = transfer_moment(whole, angle, speed, rate, acceleration=acceleration)
    return moment, angle, rate


def _by_moment(plan, law, frequency, level, waveform):
    """Return the same under a sinusoidal moment that moves the joint by ``level`` rad at most."""
    rate = max(plan.sample_rate, 400 * frequency)
    part = replace(
        plan, drive="moment", frequencies=(frequency,), levels=(level / plan.angle_limit,), sample_rate=rate,
        duration=max(plan.duration, 6 / frequency),
    )  # fmt: skip
    (run,) = part.campaign(0.0, hidden=law).runs
    return run.moment, run.angle, rate


def _waveform(words, phase):
    """Return a waveform of peak one and its derivatives by phase, from the words of the advice."""
    tones = {1: 1.0}
    if words.startswith("swept"):
        # sin u with u = 3x − 2 sin x.
        u, first, second = 3 * phase - 2 * np.sin(phase), 3 - 2 * np.cos(phase), 2 * np.sin(phase)
        return np.sin(u), first * np.cos(u), second * np.cos(u) - first**2 * np.sin(u)
    if words in SEVERAL:
        tones = SEVERAL[words]
    elif words.startswith("triangular"):
        tones = {1: 1.0, 3: -1 / 9, 5: 1 / 25, 7: -1 / 49, 9: 1 / 81}
    elif not words.startswith("sinusoidal"):
        raise ValueError(f"no waveform {words!r}")
    shape = sum(a * np.sin(n * phase) for n, a in tones.items())
    peak = np.abs(shape).max()
    slope = sum(a * n * np.cos(n * phase) for n, a in tones.items())
    bend = -sum(a * n**2 * np.sin(n * phase) for n, a in tones.items())
    return shape / peak, slope / peak, bend / peak
