"""By what a law is simulated against a run: its moment, windows of that, or its motion."""

from __future__ import annotations

from typing import Literal
from weakref import WeakKeyDictionary

import numpy as np

from sindyjoint.measurement.policy import POLICY as NOISE
from sindyjoint.mechanics.laws import Law
from sindyjoint.numeric import rms, without_line
from sindyjoint.response.law_in_run import LawInRun
from sindyjoint.response.model_law import elastic_moment
from sindyjoint.response.policy import POLICY
from sindyjoint.states import ForceStates

Drive = Literal["moment", "windows", "motion", "free run"]


def choose_drive(law: Law, states: ForceStates) -> Drive:
    """Choose how a law is simulated against a run.

    By the moment where the joint has inertia and a restoring moment over the run's angles; by multiple shooting
    ("windows") where it has inertia only; by the motion where it has none, since then the moment does not determine
    the motion, and where an input moves the law within the run.
    """
    if not law.inertia > 0 or isinstance(law, LawInRun) or states.method == "path":
        return "motion"
    middle, reach = float(np.mean(states.angle)), float(np.ptp(states.angle)) / 2
    low, high = elastic_moment(law, [middle - reach, middle + reach])
    restoring = (high - low) / 2
    return (
        "moment"
        if restoring > POLICY.restoring_share * rms(states.transfer_moment(law.inertia))
        else "windows"
    )


def prescribed(states: ForceStates, spurious: bool = False, inertia: float = 0.0) -> bool:
    """Return whether a run's motion was its drive: a sinusoid of the angle alone, but not of the moment; or a path.

    A joint that answers to a sinusoidal moment moves with the harmonics of its friction and its stiffness. Of dozens of
    harmonics one or two of noise alone are kept now and then: with ``spurious`` a run that has no others counts, too.
    They move its reversals, where friction jumps, so that its moment is compared where the joint moves alone. A motion
    that does not repeat was the drive where a joint of that ``inertia`` shows no answer to what the moment holds beyond
    the band of the angle. What was found of states is kept: every simulation of a run asks.
    """
    known = _known.setdefault(states, {})
    if (spurious, inertia) not in known:
        known[spurious, inertia] = _find_prescribed(states, spurious, inertia)
    return known[spurious, inertia]


_known: WeakKeyDictionary[ForceStates, dict[tuple[bool, float], bool]] = WeakKeyDictionary()


def _find_prescribed(states: ForceStates, spurious: bool, inertia: float) -> bool:
    if states.method == "path":
        return True
    if states.method == "broadband" and not states.repeated:
        return unanswered(states, inertia) > POLICY.unanswered
    if states.method != "periodic" or states.frequency is None:
        return False
    if not (_sinusoidal(states) if spurious else states.bandwidth <= 1.5 * states.frequency):
        return False
    phase = 2 * np.pi * states.frequency * states.time
    basis = np.column_stack([np.ones(phase.size), np.cos(phase), np.sin(phase)])
    residual = states.moment - basis @ np.linalg.lstsq(basis, states.moment, rcond=None)[0]
    floor = max(states.noise.moment, 1e-3 * float(np.std(states.moment)))
    return bool(np.std(residual) > POLICY.pure * floor)


def unanswered(states: ForceStates, inertia: float) -> float:
    """Return the angle that the moment would make above the angle's band, over its noise there: a ratio of powers.

    A moment that drives moves the joint by M/(k + Jω²) at least, k the secant stiffness; above its band the angle
    shows no such motion. Friction's steps in the moment of a prescribed motion move nothing. Zero without an inertia.
    """
    from scipy.signal import welch

    if not inertia > 0 or not np.ptp(states.moment) > 0:
        return 0.0
    segment = int(min(states.n_samples, max(256, states.n_samples // 8)))
    frequency, density = welch(
        states.moment, states.sample_rate, window="blackmanharris", nperseg=segment, detrend=without_line
    )
    unit_noise = 2 / states.sample_rate  # one-sided density of white noise of variance one
    floor = unit_noise * states.noise.moment**2
    beyond = (frequency > states.bandwidth) & (density > NOISE.signal_to_noise * floor)
    frequency, density = frequency[beyond], density[beyond]
    stiffness = float(np.std(states.moment)) / max(float(np.std(states.angle)), 1e-300)
    answer = density / (stiffness + inertia * (2 * np.pi * frequency) ** 2) ** 2
    noise = unit_noise * states.white_noise(frequency) ** 2
    return float(np.sum(answer) / np.sum(noise)) if np.any(noise) else 0.0


def _sinusoidal(states: ForceStates) -> bool:
    """Return whether the angle of periodic states has no harmonic but the first that its noise could not make."""
    assert states.frequency is not None
    count = max(1, round(states.bandwidth / states.frequency))
    phase = 2 * np.pi * states.frequency * np.outer(states.time, np.arange(1, count + 1))
    basis = np.hstack([np.ones((states.n_samples, 1)), np.cos(phase), np.sin(phase)])
    parts = np.linalg.lstsq(basis, states.angle, rcond=None)[0][1:]
    amplitudes = np.hypot(parts[:count], parts[count:])[1:]
    return bool(np.all(amplitudes <= POLICY.sinusoidal * states.noise.angle * np.sqrt(2 / states.n_samples)))
