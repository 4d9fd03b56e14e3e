"""Force states of a joint of the amplitudes that were recovered of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sindyjoint.states.harmonics import HarmonicBasis, significant_harmonics
from sindyjoint.states.mask import moving_mask, rate_limit
from sindyjoint.states.periodic import reversal_guard
from sindyjoint.states.policy import POLICY
from sindyjoint.states.record import ForceStates, Harmonics, NoiseFloor
from sindyjoint.substructure.recovery import Recovery
from sindyjoint.substructure.unseen import Slow

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Orders = NDArray[np.bool_]

# Standard errors beyond which a line is signal where a drive has many of them, and each may be there or not.
LINE = 3.5
# Standard error of a harmonic of the angle, of the strongest one, beyond which the law tells it better.
HARDLY_SEEN = 0.003


def kept_orders(amplitude: Complex, standard_error: Array, tone: bool) -> Orders:
    """Return which harmonics stand out of their noise, shape (h,)."""
    size = np.abs(amplitude)
    return significant_harmonics(size, standard_error) if tone else size > LINE * standard_error


def is_tone(drive: Complex) -> bool:
    """Return whether the first harmonic is most of a drive."""
    power = np.abs(drive) ** 2
    return bool(power[0] > 0.5 * power.sum())


def kept_of(recovery: Recovery, joint: int) -> tuple[Orders, Orders]:
    """Return which harmonics of a joint's angle, and of its moment, stand out of their noise."""
    joints = recovery.transfer.angles.shape[1]
    values, errors = recovery.values, recovery.standard_error
    tone = is_tone(recovery.spectra.amplitudes[0])
    angle, moment = (kept_orders(values[row], errors[row], tone) for row in (joint, joints + joint))
    return angle, moment


def slow_orders(recovery: Recovery, joint: int) -> Orders:
    """Return which harmonics below the strongest one the sensors hardly show, as accelerations small, shape (h,)."""
    size, error = np.abs(recovery.values[joint]), recovery.standard_error[joint]
    main = int(np.argmax(size))
    slow = error > HARDLY_SEEN * size[main]
    slow[main:] = False
    return slow


def slow_part(recovery: Recovery, joint: int) -> Slow:
    """Return the harmonics of a joint's angle that the sensors hardly show."""
    rows = slow_orders(recovery, joint)
    # What the states hold of them already is not added once more.
    missing = np.where(kept_of(recovery, joint)[0], 0.0, recovery.values[joint])
    return Slow(np.flatnonzero(rows) + 1, missing[rows], recovery.standard_error[joint, rows])


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
    spectra, run = recovery.spectra, recovery.run
    joints = recovery.transfer.angles.shape[1]
    values, errors, blocks = recovery.values, recovery.standard_error, recovery.blocks
    of_angle, of_moment = joint, joints + joint
    keep = kept_of(recovery, joint)
    # What the law will tell of the slow part it tells of the whole run, not of each block.
    slow = slow_orders(recovery, joint)
    blocks[:, of_angle, slow] = values[of_angle, slow]
    known = keep[0] & ~slow
    orders = [np.flatnonzero(one) + 1 for one in keep]
    time = np.arange(spectra.edges[-1]) / run.sample_rate
    bases = [HarmonicBasis.build(time, spectra.frequency, one) for one in orders]

    def motion(amplitudes: Complex, rows: slice = slice(None)) -> list[Array]:
        part, a, b = bases[0].rows(rows), amplitudes.real, -amplitudes.imag
        return [part.series(0.0, a, b), part.derivative(a, b), part.second_derivative(a, b)]

    spans = [slice(low, high) for low, high in zip(spectra.edges[:-1], spectra.edges[1:], strict=True)]
    angle, rate, acceleration = motion(values[of_angle, keep[0]])
    replicate = [motion(part[of_angle, keep[0]], rows) for part, rows in zip(blocks, spans, strict=True)]
    moments = [part[of_moment, keep[1]] for part in blocks]
    moment = np.concatenate(
        [
            bases[1].rows(rows).series(mean_moment, m.real, -m.imag)
            for m, rows in zip(moments, spans, strict=True)
        ]
    )
    series = Harmonics(orders[0], errors[of_angle, keep[0]])
    rate_noise = series.derivative_noise(spectra.frequency, 1)
    highest = float(orders[0][-1] * spectra.frequency)
    guard = reversal_guard(run.sample_rate, spectra.frequency, highest)
    slowest = rate_limit(rate, rate_noise, POLICY.periodic_rate_share)
    first, second, third = (np.concatenate(column) for column in zip(*replicate, strict=True))
    noise = NoiseFloor(
        float(np.sqrt(len(spans) * np.sum(errors[of_moment, keep[1]] ** 2))),
        float(np.sqrt(np.sum(errors[of_angle, known] ** 2))),
        rate_noise,
        series.derivative_noise(spectra.frequency, 2),
    )
    return ForceStates(
        run=name, frequency=spectra.frequency, level=run.level, sample_rate=run.sample_rate,
        time=time + spectra.first / run.sample_rate, angle=angle, rate=rate, acceleration=acceleration, moment=moment,
        moving=moving_mask(rate, slowest, guard), block=np.repeat(np.arange(len(spans)), np.diff(spectra.edges)),
        replicate=(first, second, third), noise=noise, method="periodic", bandwidth=highest,
        dropped=spectra.first / run.sample_rate, slowest=slowest, guard=guard, series=(series,),
    )  # fmt: skip
