"""Synthetic replicate of a run that does not repeat: the model's simulated motion, smoothed by the same kernel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sindyjoint.bias.policy import POLICY
from sindyjoint.errors import SimulationError
from sindyjoint.measurement.policy import POLICY as NOISE
from sindyjoint.mechanics.excitation import sampled
from sindyjoint.mechanics.laws import Law
from sindyjoint.mechanics.stickslip import simulate, transfer_moment
from sindyjoint.numeric import Array, convolve, without_line
from sindyjoint.record import Run
from sindyjoint.states import ForceStates
from sindyjoint.states.broadband import smoothing_kernels
from sindyjoint.states.mask import moving_mask

Motion = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class BroadbandReplicate:
    """A run of the model over the middle of the record, as the processing pipeline sees it.

    Parameters
    ----------
    run : str
    driven : {"moment", "angle"}
        What was prescribed.
    motion : tuple of three ndarray, shape (n,)
        Angle, rate and acceleration as the kernel gives them, free of noise.
    moment : ndarray, shape (n,)
        At the sensor, free of noise, N·m.
    kernels : tuple of three ndarray
        The smoothing kernel and its derivatives.
    noise_size : tuple of float
        RMS of the noise of the angle and, where it was measured, of the rate.
    state : ForceStates
        Of the run.
    slowest : float
        Rate below which a sample counts as reversal, rad/s.
    guard : int
    weight : float
        Samples of the run per sample of the replicate.
    """

    run: str
    driven: str
    motion: Motion
    moment: Array
    kernels: Motion
    noise_size: tuple[float, ...]
    state: ForceStates
    slowest: float
    guard: int
    weight: float

    def noise(self, rng: np.random.Generator) -> Motion:
        """Draw noise of the measured channels as the kernels give it."""
        n = self.moment.size + self.kernels[0].size - 1
        drawn = [self.state.draw_angle_noise(n, rng)]
        drawn += [size * rng.normal(size=n) for size in self.noise_size[1:]]
        return _smooth_motion(drawn, self.kernels)

    def rows(self, noise: Motion | None = None, sign: float = 1.0) -> tuple[Array, Array]:
        """Return moving (θ, θ̇, θ̈), shape (m, 3), and the moment, shape (m,), under noise times a sign."""
        motion = np.column_stack(self.motion)
        if noise is not None:
            motion = motion + sign * np.column_stack(noise)
        moving = moving_mask(motion[:, 1], self.slowest, self.guard)
        return motion[moving], self.moment[moving]


def _smooth_motion(channels: list[Array], kernels: Motion) -> Motion:
    """Return angle, rate and acceleration of an angle, or of an angle and a rate, where the kernels cover them."""
    last = channels[-1] - channels[-1].mean() * (len(channels) == 1)
    angle = convolve(channels[0], kernels[0])
    rate, acceleration = (
        convolve(last, kernel) for kernel in (kernels[1:] if len(channels) == 1 else kernels[:2])
    )
    return angle, rate, acceleration


def make_broadband_replicate(law: Law, run: Run, state: ForceStates) -> BroadbandReplicate:
    """Return the synthetic replicate of a run whose states come from the smoothing kernel.

    It covers the states' span less half a kernel on either side.

    Raises
    ------
    SimulationError
        If the law has no finite moment along the measured motion.
    """
    kernels = smoothing_kernels(state.bandwidth, state.sample_rate)
    half = kernels[0].size // 2
    middle = slice(half, state.n_samples - half)
    measured = run.rate is not None
    # The moment smoothed as the angle was, over the states' span.
    whole = np.pad(state.moment, half, mode="wrap") if state.repeated else run.moment
    moment = convolve(whole, kernels[0])
    moved = _simulate_driven(law, state, moment)
    motion = None
    if moved is not None:
        motion = _smooth_motion([moved[0], moved[1]] if measured else [moved[0]], kernels)
        if np.std(motion[0] - state.angle[middle]) > POLICY.largest_difference * np.std(state.angle[middle]):
            motion = None
    if moved is None or motion is None:
        moment, _ = transfer_moment(
            law, state.angle, state.rate, state.sample_rate, acceleration=state.acceleration
        )
        motion = _smooth_motion([state.angle, state.rate] if measured else [state.angle], kernels)
        driven = "angle"
    else:
        moment, driven = moved[2], "moment"
    return BroadbandReplicate(
        run=state.run,
        driven=driven,
        motion=motion,
        moment=moment[middle],
        kernels=kernels,
        noise_size=(state.noise.angle, state.noise.rate / float(np.linalg.norm(kernels[0])))
        if measured
        else (state.noise.angle,),
        state=state,
        slowest=state.slowest,
        guard=state.guard,
        weight=state.n_samples / (state.n_samples - 2 * half),
    )


def _simulate_driven(law: Law, state: ForceStates, moment: Array) -> Motion | None:
    """Return angle, rate and moment of the law under the run's drive; None where the drive is unknown.

    The drive is M + J·θ̈, J the exciter inertia. It is used up to the frequency at which it falls below its noise,
    which must be well below that of the angle: where the motion was prescribed, the moment has the friction's steps.
    """
    if not law.inertia > 0:
        return None
    exciter_inertia = estimate_exciter_inertia(state, moment)
    # Without a mass the moment is known over the whole of its band, and the friction's steps are seen there.
    drive = moment + exciter_inertia * state.acceleration if exciter_inertia > 0 else state.moment
    if np.any(drive):  # else a free decay
        width = _drive_bandwidth(drive, state, exciter_inertia)
        if width is None:
            return None
        low = smoothing_kernels(width, state.sample_rate)[0]
        room = low.size // 2
        if room >= drive.size:
            return None
        # The ends are continued: there the replicate moves a little differently from the joint, but by the law.
        drive = convolve(np.pad(drive, room, mode="reflect", reflect_type="odd"), low)
    try:
        motion = simulate(
            law, sampled(drive, state.sample_rate), drive.size / state.sample_rate, state.sample_rate,
            initial=(float(state.angle[0]), float(state.rate[0])), beam_inertia=exciter_inertia, limits=None, rtol=1e-6,
        )  # fmt: skip
    except SimulationError:
        return None
    return motion.angle, motion.rate, motion.moment


def estimate_exciter_inertia(state: ForceStates, moment: Array) -> float:
    """Return the inertia between a smooth exciter and the sensor, kg·m² (kg); zero where none is detected.

    Above half of the angle's band M follows −J·θ̈ where the exciter's moment is smooth: J = −Σ M² / Σ θ̈·M.

    Parameters
    ----------
    state : ForceStates
    moment : ndarray, shape (n,)
        Smoothed as the angle was, N·m.
    """
    from scipy.signal import welch

    segment = int(min(state.n_samples, max(256, state.n_samples // 4)))
    frequency, density = welch(state.angle, state.sample_rate, window="blackmanharris", nperseg=segment)
    # Where the joint was moved on purpose, stiffness looks like an inertia: only higher frequencies count.
    driven = float(frequency[np.flatnonzero(density > POLICY.main_line * density.max())[-1]])
    edge = max(POLICY.inertia_band * state.bandwidth, POLICY.beyond_lines * driven)
    if edge > 0.9 * state.bandwidth:
        return 0.0
    low = smoothing_kernels(edge, state.sample_rate)[0]
    if low.size >= state.n_samples // 2:
        return 0.0
    half = low.size // 2
    x, y = (
        signal[half : signal.size - half] - convolve(signal, low) for signal in (state.acceleration, moment)
    )
    both, size = -float(x @ y), float(np.linalg.norm(x) * np.linalg.norm(y))
    return float(y @ y) / both if size > 0 and both > POLICY.inertia_correlation * size else 0.0


def _drive_bandwidth(drive: Array, state: ForceStates, exciter_inertia: float) -> float | None:
    """Return the frequency above which a drive is only noise, Hz; None where that is not well below the angle's.

    The last line above the noise counts, not the first gap: a single frequency and its harmonics have gaps.
    """
    from scipy.signal import welch

    segment = int(min(drive.size, max(256, drive.size // 8)))
    frequency, density = welch(
        drive, state.sample_rate, window="blackmanharris", nperseg=segment, detrend=without_line
    )
    unit_noise = 2 / state.sample_rate  # one-sided density of white noise of variance one
    floor = unit_noise * (
        state.noise.moment**2
        + (exciter_inertia * (2 * np.pi * frequency) ** 2 * state.white_noise(frequency)) ** 2
    )
    above = np.flatnonzero(density > NOISE.signal_to_noise * floor)
    last = int(above[-1]) + 1 if above.size else 0
    if not last or last >= frequency.size or frequency[last] >= POLICY.drive_band * state.bandwidth:
        return None
    return float(frequency[last])
