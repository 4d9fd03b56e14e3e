"""An accelerometer and a displacement sensor that do not show one motion: another gain, another time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sindyjoint.accelerometer import disagreement
from sindyjoint.numeric import main_frequency
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.profile import Profile
from sindyjoint.soundness.words import Words


def find_disagreement(profile: Profile, words: Words) -> Iterator[Finding]:
    """Yield a run in which the acceleration is not the one of the angle."""
    run = profile.run
    fusion = run.fusion
    if fusion is None or fusion.angle is None:
        return
    found = disagreement(fusion.angle, fusion.acceleration, run.sample_rate, fusion.angle_noise, fusion.noise)
    if found is None:
        return
    gain, gain_error, delay, delay_error = found
    frequency = profile.frequency or main_frequency(run.angle, run.sample_rate)
    apart = abs(gain - 1) > max(POLICY.sensors_gain, POLICY.sensors_sigmas * gain_error)
    phase = 2 * np.pi * frequency * abs(delay)
    late = phase > POLICY.sensors_delay and abs(delay) > POLICY.sensors_sigmas * delay_error
    if not (apart or late):
        return
    wrong = abs(gain - 1) > POLICY.sensors_unit
    said = [
        f"the acceleration is {gain:.4g} ± {gain_error:.2g} times that of the {words.angle}" if apart else "",
        f"it comes {1e3 * abs(delay):.3g} ms {'later' if delay > 0 else 'earlier'}" if late else "",
    ]
    delayed = f"declare delay = '{1e3 * delay:.3g} ms' of the acceleration" if late else ""
    calibrate = "check unit, gain, sign and place of both sensors" if apart else ""
    yield Finding(
        "sensors_disagree",
        run.name,
        "acceleration",
        "stops" if wrong else "biases",
        ", ".join(filter(None, said)),
        "low frequencies follow one sensor and high ones the other: "
        + (
            "k1, k3 and c1 are wrong by a part of that factor"
            if apart
            else "c1 takes a part of the stiffness"
        ),
        "; ".join(filter(None, (calibrate, delayed))),
    )
