"""Force states of a joint of the amplitudes that were recovered of it, and how well sensors show it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy

from sindyjoint.described import same
from sindyjoint.limits import MEASUREMENT, STATES, SUBSTRUCTURE
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import Array, Booleans, Complex, rms, scaled_least_squares
from sindyjoint.states import (
    BLOCKS,
    ForceStates,
    HarmonicBasis,
    Harmonics,
    NoiseFloor,
    dwells,
    moving_mask,
    rate_limit,
    record_series,
    reversal_guard,
    significant_harmonics,
)
from sindyjoint.substructure import open_joints
from sindyjoint.substructure.recovery import Recovery, solved
from sindyjoint.substructure.spectra import strongest
from sindyjoint.substructure.unseen import Slow, within_record


def kept_orders(amplitude: Complex, standard_error: Array, tone: bool) -> Booleans:
    """Return the harmonics up to the last that stands out of its noise, shape (h,).

    None between is left out: what is left out of one side of the law for its noise stands on the other, and biases.
    """
    size = np.abs(amplitude)
    out = significant_harmonics(size, standard_error) if tone else lines(size, standard_error)
    return np.logical_or.accumulate(out[::-1])[::-1]


def lines(size: Array, standard_error: Array) -> Booleans:
    """Return which lines of a spectrum stand out of their noise, shape (h,)."""
    return np.asarray(size > SUBSTRUCTURE.line * standard_error)


def strongest_line(size: Array, standard_error: Array) -> int:
    """Return the place of the strongest line of a spectrum that stands out of its noise, which grows as 1/ω²."""
    return int(np.argmax(np.where(lines(size, standard_error), size, 0.0)))


def kept_of(recovery: Recovery, joint: int) -> Booleans:
    """Return which harmonics of a joint's angle and of its moment are used: none where either has none."""
    rows, values = recovery.rows(joint), recovery.values
    power = np.abs(recovery.spectra.amplitudes[0]) ** 2
    # A tone: the first harmonic is most of the drive.
    tone = bool(power[0] > 0.5 * power.sum())
    if recovery.spectra.repeats:
        kept = [kept_orders(values[row], recovery.standard_error[row], tone) for row in rows]
    else:
        kept = [up_to_end(values[row], recovery.noise[row]) for row in rows]
    return np.logical_or(*kept) & kept[0].any() & kept[1].any()


def up_to_end(amplitude: Complex, standard_error: Array) -> Booleans:
    """Return the harmonics up to where a continuous spectrum ends in noise, shape (h,)."""
    power = np.abs(amplitude) ** 2 / (2 * standard_error**2)
    smooth = scipy.ndimage.median_filter(power, min(power.size, max(5, power.size // 60)) | 1, mode="nearest")
    above = np.flatnonzero(smooth > MEASUREMENT.outstanding)
    return np.arange(power.size) <= (above[-1] if above.size else -1)


def slow_orders(recovery: Recovery, joint: int) -> Booleans:
    """Return which harmonics below the strongest one the sensors hardly show, as accelerations small, shape (h,)."""
    size, error = np.abs(recovery.values[joint]), recovery.standard_error[joint]
    main = strongest_line(size, error)
    if not recovery.spectra.repeats:
        # The errors of all harmonics from one up, against the angle about and above where its rate is largest.
        # Of thousands of lines none stands out by chance more often than one alone does.
        outlying = np.sqrt(1 + 2 * np.log(size.size) / SUBSTRUCTURE.line**2)
        main = strongest_line(size * recovery.spectra.angular, outlying * error * recovery.spectra.angular)
        above = np.sqrt(np.cumsum(error[::-1] ** 2)[::-1])
        slow = above > SUBSTRUCTURE.small_share * np.sqrt(np.sum(size[main // 2 :] ** 2))
        return slow & (np.arange(size.size) < main // 2)
    slow = error > SUBSTRUCTURE.granted_share * size[main]
    slow[main:] = False
    return slow


def slow_part(recovery: Recovery, joint: int) -> Slow:
    """Return the harmonics of a joint's angle that the sensors hardly show."""
    rows = slow_orders(recovery, joint)
    # What the states hold of them already is not added once more.
    missing = np.where(kept_of(recovery, joint), 0.0, recovery.values[joint])
    drift = 0.0 if recovery.spectra.repeats else recovery.spectra.frequency
    level = 0.0
    if recovery.run.frequency and drift:
        # A velocity that is another at the end takes a moment M·ω·v/(ωT) of those M·ω·v of a vibration of angular ω.
        of_moment = recovery.values[recovery.rows(joint)[1]]
        level = (
            rms(np.abs(of_moment)) * np.sqrt(of_moment.size / 2) * drift / (np.pi * recovery.run.frequency)
        )
    return Slow(
        np.flatnonzero(rows) + 1,
        missing[rows],
        recovery.standard_error[joint, rows],
        recovery.spectra.frequency,
        drift,
        level,
    )


def joint_states(
    recovery: Recovery,
    joint: int,
    name: str,
    mean_moment: float = 0.0,
) -> ForceStates:
    """Return the force states of a joint in a run.

    Parameters
    ----------
    recovery : Recovery
    joint : int
        Its number in the structure.
    name : str
        Of the run and the joint, as the states are called.
    mean_moment : float
        N·m; sensors of acceleration do not see it.
    """
    if not recovery.spectra.repeats:
        return record_states(recovery, joint, name, mean_moment)
    spectra, run = recovery.spectra, recovery.run
    values, errors, blocks = recovery.values, recovery.standard_error, recovery.blocks
    of_angle, of_moment = recovery.rows(joint)
    keep = kept_of(recovery, joint)
    # What the law will tell of the slow part it tells of the whole run, not of each block.
    slow = slow_orders(recovery, joint)
    blocks[:, of_angle, slow] = values[of_angle, slow]
    known = keep & ~slow
    orders = np.flatnonzero(keep) + 1
    time = np.arange(spectra.edges[-1]) / run.sample_rate
    basis = HarmonicBasis.build(time, spectra.frequency, orders)

    def motion(amplitudes: Complex, rows: slice = slice(None)) -> Array:
        return basis.rows(rows).motion(0.0, amplitudes.real, -amplitudes.imag)

    spans = [slice(low, high) for low, high in zip(spectra.edges[:-1], spectra.edges[1:], strict=True)]
    angle, rate, acceleration = motion(values[of_angle, keep])
    first, second, third = np.hstack(
        [motion(part[of_angle, keep], rows) for part, rows in zip(blocks, spans, strict=True)]
    )
    moments = [motion(part[of_moment, keep], rows)[0] for part, rows in zip(blocks, spans, strict=True)]
    series = Harmonics(orders, errors[of_angle, keep])
    rate_noise = series.derivative_noise(spectra.frequency, 1)
    highest = float(orders[-1] * spectra.frequency)
    guard = reversal_guard(run.sample_rate, spectra.frequency, highest)
    slowest = rate_limit(rate, rate_noise, STATES.periodic_rate_share)
    noise = NoiseFloor(
        float(np.sqrt(len(spans) * np.sum(errors[of_moment, keep] ** 2))),
        float(np.sqrt(np.sum(errors[of_angle, known] ** 2))),
        rate_noise,
        series.derivative_noise(spectra.frequency, 2),
    )
    return ForceStates(
        run=name, frequency=spectra.frequency, level=run.level, sample_rate=run.sample_rate,
        time=time + spectra.first / run.sample_rate, angle=angle, rate=rate, acceleration=acceleration,
        moment=mean_moment + np.concatenate(moments), moving=moving_mask(rate, slowest, guard),
        block=np.repeat(np.arange(len(spans)), np.diff(spectra.edges)),
        replicate=(first, second, third), noise=noise, method="periodic", bandwidth=highest,
        dropped=spectra.first / run.sample_rate, slowest=slowest, guard=guard, series=(series,),
    )  # fmt: skip


def record_states(recovery: Recovery, joint: int, name: str, mean_moment: float = 0.0) -> ForceStates:
    """Return the force states of a joint in a run that does not repeat; parameters as of :func:`joint_states`."""
    spectra, run = recovery.spectra, recovery.run
    of_moment, n = recovery.rows(joint)[1], int(spectra.edges[-1])
    values, errors = recovery.values, recovery.standard_error
    kept = kept_of(recovery, joint)
    known = kept & ~slow_orders(recovery, joint)
    angular = spectra.angular
    angle, rate, acceleration = (
        record_series((1j * angular) ** order * values[joint] * kept, n) for order in range(3)
    )
    time = np.arange(n) / run.sample_rate
    # Drift and bend are not known yet: a joint does not travel on and on, and the law will tell the rest.
    bend, drift = np.polyfit(time, rate, 1)
    angle, rate = angle - (bend / 2 * time + drift) * time, rate - (bend * time + drift)
    moment = mean_moment + _with_jump(values[of_moment] * kept, angular, n)
    angle_noise, rate_noise, acceleration_noise = (
        float(np.sqrt(np.sum((angular[known] ** order * errors[joint, known]) ** 2))) for order in range(3)
    )
    highest = float(angular[kept][-1] / (2 * np.pi)) if kept.any() else 0.0
    share, periods = (
        (STATES.minor_share, STATES.periodic_guard)
        if dwells(rate)
        else (STATES.passing_rate_share, STATES.passing_guard)
    )
    guard = int(np.ceil(periods * run.sample_rate / max(highest, 1e-9)))
    slowest = rate_limit(rate, rate_noise, share)
    moving = moving_mask(rate, slowest, guard) & within_record(n, run.sample_rate, highest)
    return ForceStates(
        run=name, frequency=None, level=run.level, sample_rate=run.sample_rate, time=time,
        angle=angle, rate=rate, acceleration=acceleration, moment=moment, moving=moving,
        block=np.arange(n) * BLOCKS // n, replicate=None,
        noise=NoiseFloor(
            float(np.sqrt(np.sum(errors[of_moment, kept] ** 2))), angle_noise, rate_noise, acceleration_noise
        ),
        method="broadband", bandwidth=highest, dropped=0.0, slowest=slowest, guard=guard,
    )  # fmt: skip


def _with_jump(amplitudes: Complex, angular: Array, n: int) -> Array:
    """Return a series over a record whose end is not its beginning: the jumps of value and slope in closed form.

    They are found in the upper half of the spectrum, where nothing else has their phases.
    """
    length = 2 * np.pi / angular[0]
    part = np.arange(n) / n
    # A sawtooth t/T − ½ and the parabola whose slope it is: (2/T)·i/ω and (2/T)/ω².
    shapes = np.column_stack([1j / angular, 1 / angular**2]) * 2 / length
    last = int(np.flatnonzero(amplitudes)[-1]) + 1 if np.any(amplitudes) else 0
    upper = slice(last // 2, last)
    known, said = shapes[upper], amplitudes[upper]
    jumps = scaled_least_squares(np.vstack([known.real, known.imag]), np.concatenate([said.real, said.imag]))
    smooth = np.where(np.arange(amplitudes.size) < last, amplitudes - shapes @ jumps, 0.0)
    return (
        record_series(smooth, n) + jumps[0] * (part - 0.5) + jumps[1] * length * (part**2 - part + 1 / 6) / 2
    )


UNSEEN = 1e6  # factor of a variance that leaves a sensor out


@dataclass(frozen=True)
class JointSeen:
    """How well a joint is shown.

    Parameters
    ----------
    joint : str
    largest_angle : float
        Recovered: half of its range where the joint moves, rad (m); its mean is not known.
    angle_error, moment_error : float
        Standard error of the strongest harmonic, relative, of the run that shows it best.
    together : tuple of str
        Joints from whose moments the sensors cannot tell its own.
    """

    WRITTEN: ClassVar = {"name": "joint", **same("largest_angle", "angle_error", "moment_error", "together")}
    joint: str
    largest_angle: float
    angle_error: float
    moment_error: float
    together: tuple[str, ...]

    @property
    def words(self) -> str:
        """What there is to say of it; empty where it is well shown."""
        if self.together:
            others = ", ".join(map(repr, self.together))
            return f"joint {self.joint!r} shows only together with {others}: add a sensor between them"
        if self.moment_error > SUBSTRUCTURE.unknown:
            return (
                f"the moment of joint {self.joint!r} is known to {100 * self.moment_error:.0f} % only: add a sensor "
                "near it, or drive it harder"
            )
        return ""


def joints_seen(test: RigTest, recoveries: Sequence[Recovery]) -> tuple[JointSeen, ...]:
    """Return how well each joint is shown by the runs together.

    Parameters
    ----------
    test : RigTest
    recoveries : sequence of Recovery
    """
    joints = test.structure.n_joints
    names = [hinge.name for hinge in test.structure.hinges]
    errors, peaks, correlations = [], [], []
    for recovery in recoveries:
        size = np.abs(recovery.values)
        main = np.array([strongest_line(*pair) for pair in zip(size, recovery.standard_error, strict=True)])
        at = np.arange(2 * joints)
        errors.append(recovery.standard_error[at, main] / np.maximum(size[at, main], 1e-300))
        peaks.append([_peak(recovery, joint) for joint in range(joints)])
        of_moments = recovery.covariance[int(np.median(main[joints:]))][joints:, joints:]
        scale = np.sqrt(np.diag(of_moments).real)
        correlations.append(np.abs(of_moments) / np.outer(scale, scale))
    best, common = np.min(errors, axis=0), np.min(correlations, axis=0)
    hidden = best[joints:] > SUBSTRUCTURE.unknown
    return tuple(
        JointSeen(
            names[j], float(np.max(peaks, axis=0)[j]), float(best[j]), float(best[joints + j]),
            tuple(names[k] for k in range(joints) if k != j and common[j, k] > SUBSTRUCTURE.together and hidden[j]),
        )
        for j in range(joints)
    )  # fmt: skip


def _peak(recovery: Recovery, joint: int) -> float:
    """Return half of the range of a joint's angle where it moves, rad: its mean and slow drift are not known."""
    if not kept_of(recovery, joint).any():
        return 0.0
    state = joint_states(recovery, joint, "")
    return float(np.ptp(state.angle[state.moving] if state.moving.any() else state.angle)) / 2


def worth_of_sensors(test: RigTest, recoveries: Sequence[Recovery]) -> Array:
    """Return by what factor the error of each joint's moment grows without each sensor, shape (joints, sensors).

    Of the strongest harmonics of all runs together; infinite where the joint is no longer determined.
    """
    joints, sensors = test.structure.n_joints, len(test.sensors)
    total = np.zeros((1 + sensors, joints))
    for recovery in recoveries:
        # Harmonics of each run from which the worth of sensors is computed.
        spectra, angular = strongest(recovery.freed, 8)
        design = open_joints(test.structure, test.at, test.sensors, angular).design
        # With all, then without each sensor.
        for channel in range(1 + sensors):
            variance = spectra.variance.copy()
            if channel:
                variance[channel] *= UNSEEN
            estimator = solved(design, np.sqrt(variance.T), spectra.amplitudes.T)[0][:, 1:]
            total[channel] += np.sum(1 / np.einsum("hkc,ch->hk", np.abs(estimator) ** 2, variance), axis=0)
    factor = np.sqrt(total[0] / total[1:]).T
    return np.where(factor > np.sqrt(UNSEEN) / 30, np.inf, factor)
