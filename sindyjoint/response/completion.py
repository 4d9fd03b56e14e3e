"""Force states completed by what their processing cuts off the motion, from a simulation of the model.

A series ends where its harmonics sink into the noise or where the sampling ends, a kernel takes what is fast. What they
cut matters: to the rate at reversals, to the acceleration where a joint begins to stick, and so to the coefficients.
The model's motion x under the measured drive has it. With P the processing of the measurement, its states are completed
to P·measured + (x − P·x); harmonics that are known to less than a tenth are the model's, too.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy

from sindyjoint.equation.model import JointModel
from sindyjoint.errors import SimulationError
from sindyjoint.limits import MEASUREMENT, RESPONSE
from sindyjoint.measurement import signal_end
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.excitation import repeated
from sindyjoint.mechanics.stickslip import simulate
from sindyjoint.numeric import Array, Complex, kept, rms
from sindyjoint.record import Run
from sindyjoint.response.drive import steady_start
from sindyjoint.response.laws import held_laws
from sindyjoint.response.run import RTOL, along_motion, angle_limits, remembered, simulate_motion, span_of
from sindyjoint.states import (
    BAND_SHARE,
    ForceStates,
    HarmonicBasis,
    Harmonics,
    fitted_motion,
    record_series,
    significant_harmonics,
    smoothing_kernels,
)

# Points of a simulated period, and of the moment that drives it.
POINTS, DRIVE_POINTS = 2048, 512


def completed_states(
    model: JointModel, runs: Sequence[Run], states: Sequence[ForceStates]
) -> tuple[ForceStates, ...]:
    """Return states with the part of a model's motion that their processing cuts off.

    Parameters
    ----------
    model : JointModel
    runs : sequence of Run
    states : sequence of ForceStates
        Of the same runs, as measured. A run whose motion was prescribed, or which the simulation does not follow, stays
        as it is.

    Raises
    ------
    InputError
        If an input moves the law within a run.
    """
    between = inertia_between(runs, states)
    laws = held_laws(model, states)
    return tuple(
        _completed(law, run, state, between) for law, run, state in zip(laws, runs, states, strict=True)
    )


def _completed(law: Law, run: Run, state: ForceStates, between: float) -> ForceStates:
    if not law.inertia > 0:
        return state
    try:
        better = _of_period(law, state, between) if state.series else _of_record(law, run, state, between)
    except SimulationError:
        return state
    if better is None or not _agrees(better, run, state):
        return state
    # Smoothed, a joint moves on a little where it sticks.
    return replace(better, moving=better.moving & (np.abs(better.rate) > better.slowest))


def _agrees(better: ForceStates, run: Run, state: ForceStates) -> bool:
    """Return whether completed states leave of the measured angle no more than its noise, within chance.

    And no more than the noise that a narrower kernel keeps out of them: the simulation may err by that.
    """
    if state.repeated or state.fusion is not None:
        return True
    measured = run.angle[span_of(run, state)]
    floor = max(state.noise.angle, rms(measured - state.angle))
    passed = [_passed(each) for each in (state, better)]
    more = RESPONSE.significant / np.sqrt(2 * measured.size)
    return rms(measured - better.angle) <= floor * np.sqrt((1 + more) ** 2 + passed[0] - passed[1])


def _passed(state: ForceStates) -> float:
    """Return the share of white noise that the kernel of a run passes; of a series next to nothing is left."""
    if state.series:
        return 0.0
    return float(np.sum(smoothing_kernels(state.bandwidth, state.sample_rate)[0] ** 2))


def _follows(angle: Array, state: ForceStates) -> bool:
    return bool(np.std(angle - state.angle) < RESPONSE.alike * np.std(state.angle))


def _of_period(law: Law, state: ForceStates, between: float) -> ForceStates | None:
    """Return the states of a periodic run, completed; None where its drive is not known or not followed."""
    excitation = _drive(state, between)
    if excitation is None:
        return None
    start, reach = np.array([state.angle[0], state.rate[0]]), angle_limits(law, state, "windows")
    options = {"rtol": RTOL, "beam_inertia": between, "limits": reach}
    driven = repeated(excitation, 1 / state.fundamental)
    inner = along_motion(law, state, state.sample_rate)[1][:, 0]
    start, inner = steady_start(law, driven, start, inner, remembered(law, state), state, **options)
    motion = simulate(
        law, driven, 1 / state.fundamental, POINTS * state.fundamental, initial=start, initial_state=inner, **options,
    )  # fmt: skip
    place = state.fundamental * (state.time - state.time[0]) * POINTS
    whole = [
        np.interp(place, np.arange(POINTS), signal, period=POINTS)
        for signal in (motion.angle, motion.rate, motion.acceleration)
    ]
    if not _follows(whole[0], state):
        return None
    series, measured, of_blocks = _strong(state)
    cut = np.array(whole) - fitted_motion(_bases(state, series), whole)
    replicate = None
    if of_blocks is not None:
        first, second, third = of_blocks + cut
        replicate = (first, second, third)
    angle, rate, acceleration = measured + cut
    order = 1 if len(series) == 1 else 0
    noise = replace(
        state.noise,
        rate=series[-1].derivative_noise(state.fundamental, order),
        acceleration=series[-1].derivative_noise(state.fundamental, order + 1),
    )
    return replace(
        state, angle=angle, rate=rate, acceleration=acceleration, replicate=replicate, noise=noise, series=series,
        completed=True,
    )  # fmt: skip


def _bases(state: ForceStates, series: Sequence[Harmonics]) -> list[HarmonicBasis]:
    """Return the bases of some harmonics at the samples of a run."""
    return [
        HarmonicBasis.build(state.time - state.time[0], state.fundamental, each.orders) for each in series
    ]


# The search completes the same states by one model after the other.
@kept
def _strong(state: ForceStates) -> tuple[tuple[Harmonics, ...], Array, Array | None]:
    """Return the harmonics of angle, and of a measured rate, that are known to a tenth, and the first.

    And the motion that they make, shape (3, n), and that of each block, fitted to that alone, where there are several.
    """
    bases, series = [], []
    for found, basis, signal in zip(
        state.series, _bases(state, state.series), (state.angle, state.rate), strict=False
    ):
        _, a, b = basis.fit(signal)
        strong = np.hypot(a, b) > RESPONSE.many_times * found.standard_error
        strong[0] = True
        bases.append(basis.take(strong))
        series.append(Harmonics(found.orders[strong], found.standard_error[strong]))
    motion = fitted_motion(bases, (state.angle, state.rate))
    if state.replicate is None:
        return tuple(series), motion, None
    edges = np.flatnonzero(np.diff(state.block, prepend=-1, append=-1))
    blocks = (slice(*ends) for ends in zip(edges[:-1], edges[1:], strict=True))
    parts = [fitted_motion(bases, state.replicate, rows) for rows in blocks]
    return tuple(series), motion, np.hstack(parts)


@kept
def _spectrum(state: ForceStates) -> tuple[Array, Complex, Complex, Array, float]:
    """Return all orders that the sampling shows, the moment's and the angle's harmonics, the angle's errors, the mean.

    The angle's are zero where they were not kept.
    """
    top = int(BAND_SHARE * state.sample_rate / state.fundamental)
    orders = np.arange(1, min(top, (state.n_samples - 8) // 4, DRIVE_POINTS // 4) + 1)
    basis = HarmonicBasis.build(state.time - state.time[0], state.fundamental, orders)
    mean, a, b = basis.fit_all(np.array([state.moment, state.angle]))
    found = state.series[0]
    moment, angle = a - 1j * b
    angle = np.where(np.isin(orders, found.orders), angle, 0.0)
    error = np.interp(orders, found.orders, found.standard_error)
    return orders.astype(float), np.asarray(moment), angle, error, float(mean[0])


def inertia_between(runs: Sequence[Run], states: Sequence[ForceStates]) -> float:
    """Return the inertia between a smooth exciter and the sensor, kg·m² (kg); zero where none is detected.

    An exciter whose moment is smooth drives inertia J and joint: M + J·θ̈ at the sensor has few harmonics, though M has
    the friction's steps. J = −Σ|M|² / Re Σ θ̈*·M over kept harmonics beyond the first, or over the upper half of the
    band of what was smoothed, where no more than noise may be left of M + J·θ̈.
    """
    accelerations, moments, values = [np.empty(0)], [np.empty(0)], 0.0
    noise = np.zeros(2)
    for run, state in zip(runs, states, strict=True):
        if state.series and state.frequency is not None:
            orders, harmonics, angle, _, _ = _spectrum(state)
            later = (angle != 0) & (orders > 1)
            acceleration = -((2 * np.pi * state.frequency * orders) ** 2) * angle
            accelerations.append(acceleration[later].view(float))
            moments.append(harmonics[later].view(float))
            values += later.sum()
        elif state.method == "broadband":
            moment = state.moment if state.repeated else run.moment[span_of(run, state)]
            lower, band = RESPONSE.mostly, 2 * state.bandwidth / state.sample_rate
            accelerations.append(_upper(state.acceleration, state))
            # The acceleration went through the kernel once already.
            moments.append(_upper(_low_passed(moment, state, state.bandwidth), state))
            part = np.array([(1 - lower) * band, 1 - lower**5])
            levels = np.array([state.noise.moment, state.noise.acceleration])
            noise += moment.size * part * np.nan_to_num(levels) ** 2
            values += moment.size * part[0] / 2
    x, y = np.concatenate(accelerations), np.concatenate(moments)
    both, square = -float(x @ y), float(y @ y) - noise[0]
    size = float(np.linalg.norm(x) * np.linalg.norm(y))
    if not (size > 0 and square > 0):
        return 0.0
    least = max(RESPONSE.mostly, RESPONSE.significant / np.sqrt(2 * max(values, 1)))
    if not both > least * size:
        return 0.0
    inertia = square / both
    left, noise_left = float(np.sum((y + inertia * x) ** 2)), noise[0] + inertia**2 * noise[1]
    return inertia if not noise_left > 0 or left <= MEASUREMENT.outstanding * noise_left else 0.0


def _upper(signal: Array, state: ForceStates) -> Array:
    """Return what of a signal lies in the upper part of the band of a run's motion."""
    band = state.bandwidth
    return _low_passed(signal, state, band) - _low_passed(signal, state, RESPONSE.mostly * band)


def _drive(state: ForceStates, between: float) -> Array | None:
    """Return one period of the moment that drove a run, M + J·θ̈, of what stands out of its noise; None without one.

    It must have fewer harmonics than the angle: where the motion was prescribed it has more, and the friction's steps
    cannot be distinguished from it. Where sampling cuts the angle, and not the noise, their number means nothing.
    """
    orders, moment, angle, angle_error, mean = _spectrum(state)
    inertia = between * (2 * np.pi * state.fundamental * orders) ** 2
    error = np.hypot(state.noise.moment * np.sqrt(2 / state.n_samples), inertia * angle_error)
    highest = int(state.series[0].orders[-1])
    known = (angle != 0) | (between == 0)
    driven = significant_harmonics(np.abs(moment - inertia * angle), error) & known & (orders <= highest)
    if not driven.any() or (orders[driven][-1] >= highest and highest + 1 < orders[-1]):
        return None
    return mean + record_series(np.where(driven, moment - inertia * angle, 0.0), DRIVE_POINTS)


def _of_record(law: Law, run: Run, state: ForceStates, between: float) -> ForceStates | None:
    """Return the states of a run that was smoothed, completed; None where a simulation does not follow it.

    Of a simulated motion x they are x + K·(measured − x), K a kernel that ends where the angle is known to a tenth.
    Where the moment was no drive that ends well below the band of the angle, the motion was prescribed: its band is
    that of an actuator, and the kernel takes little of it.
    """
    if state.method != "broadband" or state.fusion is not None:
        return None
    drive = _drive_of_record(run, state, between)
    if drive is None:
        return None
    moment = run.moment.copy()
    if not state.repeated:
        moment[span_of(run, state)] = drive
    driven, options = replace(state, moment=drive), {"rtol": RTOL, "beam_inertia": between}
    motion = simulate_motion(
        law, replace(run, moment=moment), driven, "moment", None, 0, np.zeros((law.n_states, 1)), options
    )
    if not _follows(motion.angle, state):
        return None
    moved = np.array([motion.angle, motion.rate, motion.acceleration])
    known = signal_end(state.angle, state.sample_rate, RESPONSE.many_times * state.noise.angle / 2)
    measured = np.array([state.angle, state.rate, state.acceleration])
    band = min(known.cutoff, state.bandwidth)
    moved += _smoothed(state, band, measured - moved)
    angle, rate, acceleration = moved
    narrow, wide = (
        np.linalg.norm(smoothing_kernels(each, state.sample_rate), axis=1) for each in (band, state.bandwidth)
    )
    passed = (narrow / wide)[0 if state.rate_measured else 1 :]
    noise = replace(
        state.noise, rate=state.noise.rate * passed[0], acceleration=state.noise.acceleration * passed[1]
    )
    moving = state.moving.copy()
    if (
        not state.repeated
    ):  # a period of the cut-off beyond the ends the kernel sees a reflection, noise and all
        edge = int(np.ceil(state.sample_rate / band))
        moving[:edge] = moving[moving.size - edge :] = False
    return replace(
        state, angle=angle, rate=rate, acceleration=acceleration, noise=noise, bandwidth=band, moving=moving,
        completed=True,
    )  # fmt: skip


def _smoothed(state: ForceStates, band: float, motion: Array) -> Array:
    """Return angle, rate and acceleration, shape (3, n), as a kernel gives them of an angle, or of angle and rate."""
    low, first, second = smoothing_kernels(band, state.sample_rate)
    angle, rate, _ = motion
    own = [(rate, low), (rate, first)] if state.rate_measured else [(angle, first), (angle, second)]
    return np.array([_convolved(signal, kernel, state) for signal, kernel in [(angle, low), *own]])


def _convolved(signal: Array, kernel: Array, state: ForceStates) -> Array:
    """Return a signal convolved with a kernel; its ends are continued."""
    half = kernel.size // 2
    if half >= signal.size:
        raise SimulationError("the kernel is longer than the record")
    mode: dict[str, Any] = {"mode": "wrap"} if state.repeated else {"mode": "reflect", "reflect_type": "odd"}
    return np.asarray(scipy.signal.fftconvolve(np.pad(signal, half, **mode), kernel, mode="valid"))


def _drive_of_record(run: Run, state: ForceStates, between: float) -> Array | None:
    """Return the moment that drove a run over the span of its states, M + J·θ̈, free of its noise."""
    moment = state.moment if state.repeated else run.moment[span_of(run, state)]
    drive = moment + between * state.acceleration
    band, noise = state.bandwidth, between * state.noise.acceleration

    def of_acceleration(frequency: Array) -> Array:
        """Return the noise of an angle that was differentiated twice, within the band."""
        return np.where(frequency < band, 5 * noise**2 * frequency**4 / band**5, 0.0)

    end = signal_end(drive, state.sample_rate, rising=of_acceleration)
    drives = between > 0 or end.bandwidth < RESPONSE.drive_band * band
    return _low_passed(drive, state, min(end.cutoff, band)) if drives else None


def _low_passed(signal: Array, state: ForceStates, band: float) -> Array:
    return _convolved(signal, smoothing_kernels(band, state.sample_rate)[0], state)
