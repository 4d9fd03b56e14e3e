"""How a law is simulated against a run: by its moment, windows of that or its motion, and where that starts.

A joint without restoring moment is restarted from the measured state at every segment: multiple shooting.
"""

from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from sindyjoint.errors import InputError, SimulationError
from sindyjoint.limits import MEASUREMENT, RESPONSE
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.excitation import Excitation, Interpolation, sampled
from sindyjoint.mechanics.stickslip import Motion, simulate
from sindyjoint.numeric import COARSE_DIFFERENCE, DIFFERENCE, Array, Integers, kept, rms, without_line
from sindyjoint.record import Run
from sindyjoint.response.laws import LawInRun, elastic_moment
from sindyjoint.states import ForceStates, HarmonicBasis

Drive = Literal["moment", "windows", "motion", "free run"]


def choose_drive(law: Law, states: ForceStates) -> Drive:
    """Choose how a law is simulated against a run.

    By the moment where the joint has inertia and a restoring moment over the run's angles, or moves freely; by multiple
    shooting ("windows") where it has inertia only, and errors of a measured moment add up; by the motion where it has
    none, since then the moment does not determine the motion, and where an input moves the law within the run.
    """
    if not law.inertia > 0 or isinstance(law, LawInRun) or states.method == "path":
        return "motion"
    if not np.ptp(states.moment) > 0:
        return "moment"
    middle, reach = float(np.mean(states.angle)), float(np.ptp(states.angle)) / 2
    low, high = elastic_moment(law, [middle - reach, middle + reach])
    restoring = (high - low) / 2
    return (
        "moment" if restoring > RESPONSE.minor_share * rms(states.transfer_moment(law.inertia)) else "windows"
    )


# Every simulation of a run asks.
@kept
def prescribed(states: ForceStates, spurious: bool = False, inertia: float = 0.0) -> bool:
    """Return whether a run's motion was its drive: a sinusoid of the angle alone, but not of the moment; or a path.

    A joint that answers to a sinusoidal moment moves with the harmonics of its friction and its stiffness. Of dozens of
    harmonics one or two of noise alone are kept now and then: with ``spurious`` a run that has no others counts, too.
    They move its reversals, where friction jumps, so that its moment is compared where the joint moves alone. A motion
    that does not repeat was the drive where a joint of that ``inertia`` shows no answer to what the moment holds beyond
    the band of the angle.
    """
    if states.method == "path":
        return True
    if states.method == "broadband" and not states.repeated:
        return unanswered(states, inertia) > RESPONSE.clearly
    if states.method != "periodic" or states.frequency is None:
        return False
    if not (_sinusoidal(states) if spurious else states.bandwidth <= 1.5 * states.frequency):
        return False
    basis = HarmonicBasis.build(states.time, states.frequency, np.arange(1, 2))
    residual = states.moment - basis.series(*basis.fit(states.moment))
    floor = max(states.noise.moment, 1e-3 * float(np.std(states.moment)))
    return bool(np.std(residual) > RESPONSE.clearly * floor)


def unanswered(states: ForceStates, inertia: float) -> float:
    """Return the angle that the moment would make above the angle's band, over its noise there: a ratio of powers.

    A moment that drives moves the joint by M/(k + Jω²) at least, k the secant stiffness; above its band the angle
    shows no such motion. Friction's steps in the moment of a prescribed motion move nothing. Zero without an inertia.
    """
    if not inertia > 0 or not np.ptp(states.moment) > 0:
        return 0.0
    segment = int(min(states.n_samples, max(256, states.n_samples // 8)))
    frequency, density = scipy.signal.welch(
        states.moment, states.sample_rate, window="blackmanharris", nperseg=segment, detrend=without_line
    )
    unit_noise = 2 / states.sample_rate  # one-sided density of white noise of variance one
    floor = unit_noise * states.noise.moment**2
    beyond = (frequency > states.bandwidth) & (density > MEASUREMENT.outstanding * floor)
    frequency, density = frequency[beyond], density[beyond]
    stiffness = float(np.std(states.moment)) / max(float(np.std(states.angle)), 1e-300)
    answer = density / (stiffness + inertia * (2 * np.pi * frequency) ** 2) ** 2
    noise = unit_noise * states.white_noise(frequency) ** 2
    return float(np.sum(answer) / np.sum(noise)) if np.any(noise) else 0.0


def _sinusoidal(states: ForceStates) -> bool:
    """Return whether the angle of periodic states has no harmonic but the first that its noise could not make."""
    count = max(1, round(states.bandwidth / states.fundamental))
    _, a, b = HarmonicBasis.build(states.time, states.fundamental, np.arange(1, count + 1)).fit(states.angle)
    chance = RESPONSE.stands_out * states.noise.angle * np.sqrt(2 / states.n_samples)
    return bool(np.all(np.hypot(a, b)[1:] <= chance))


# Periods after which a run that repeats is taken for steady.
SETTLED = 3
# Parts of the samples that a start is fitted to, one after the other: a wrong rate leads far astray only in time.
STAGES = (1 / 8, 1 / 4, 1 / 2, 1)
# Error of what cannot be simulated, in RMS of the response: larger than that of anything that can.
FAR_OFF = 10.0


def cycle_of(states: ForceStates) -> float:
    """Return the time of a mean cycle of a motion, s."""
    return 2 * np.pi * float(np.std(states.angle)) / max(rms(states.rate), 1e-300)


def start_on_parabola(run: Run, states: ForceStates, samples: int) -> Array:
    """Return angle and rate where a parabola through the first of some samples begins, an eighth of a cycle at most."""
    count = min(samples, max(RESPONSE.fewest_initial, round(cycle_of(states) / 8 * run.sample_rate)))
    return np.polyfit(np.arange(count) / run.sample_rate, run.angle[:count], 2)[:0:-1]


def internal_size(law: Law, along: Array) -> Array:
    """Return by how much the internal states of a law vary along a motion; zero for a clock, which is known."""
    zero = np.zeros(1)
    alone = (
        law.state_rate(zero, zero, np.ones(1), np.zeros((law.n_states, 1)))[:, 0]
        if law.n_states
        else zero[:0]
    )
    return np.where(alone == 0, np.std(along, axis=1), 0.0)


def steady_start(
    law: Law,
    excitation: Excitation,
    start: Array,
    inner: Array,
    lasting: Integers,
    states: ForceStates,
    **options: Any,
) -> tuple[Array, Array]:
    """Return angle and rate, and internal states, at the first instant of a period once the motion is steady.

    Parameters
    ----------
    law : Law
    excitation : Excitation
        That repeats.
    start, inner : ndarray, shapes (2,) and (n_states,)
        Angle and rate as measured, rad and rad/s, and internal states to begin with.
    lasting : ndarray of int
        Places of the internal states that the motion never forgets: those with which it follows the measured one best.
    states : ForceStates
        Measured, from the first instant of a period on.
    **options
        Of :func:`~sindyjoint.mechanics.stickslip.simulate`.
    """
    nodes, step = len(excitation.pieces), excitation.step
    measured = np.interp(np.arange(nodes) * step, states.time - states.time[0], states.angle)
    size = float(np.std(measured))

    def settled(at: Array) -> Motion:
        begun = inner.copy()
        begun[lasting] = at * size
        duration = (SETTLED * nodes + 1) * step
        return simulate(law, excitation, duration, 1 / step, initial=start, initial_state=begun, **options)

    def apart(at: Array) -> Array:
        try:
            return (settled(at).angle[-nodes - 1 : -1] - measured) / size
        except SimulationError:
            return np.full(nodes, FAR_OFF)

    found = inner[lasting] / size
    if lasting.size:
        step_of = COARSE_DIFFERENCE * np.eye(lasting.size)
        found = scipy.optimize.least_squares(
            apart,
            found,
            lambda x: np.column_stack([apart(x + h) - apart(x) for h in step_of]) / COARSE_DIFFERENCE,
        ).x
    motion = settled(found)
    return np.array([motion.angle[-1], motion.rate[-1]]), motion.state[:, -1]


def fitted_start(
    law: Law,
    excitation: Excitation,
    measured: Array,
    sample_rate: float,
    start: Array,
    size: Array,
    noise: float,
    **options: Any,
) -> Array:
    """Return the angle, rate and internal states from which a simulation comes nearest to some measured angles.

    Parameters
    ----------
    law : Law
    excitation : Excitation
        Moment from the first of these samples on.
    measured : ndarray, shape (n,)
        Angles, rad.
    sample_rate : float
        Hz.
    start : ndarray, shape (2 + n_states,)
        First guess, SI.
    size : ndarray, shape (2 + n_states,)
        RMS of each over the run: how far angle and rate may lie from the guess is a share of it, how far an internal
        state is likely to. One without a size is not fitted.
    noise : float
        Of the angle, in its RMS: by it a likely internal state is weighed against the angles.
    **options
        Of :func:`~sindyjoint.mechanics.stickslip.simulate`.
    """
    free = np.flatnonzero(size)
    bound, found = np.where(free < 2, RESPONSE.reach, np.inf), np.zeros(free.size)
    for share in STAGES:
        count = min(max(round(share * measured.size), RESPONSE.fewest_initial), measured.size)

        def residual(x: Array, count: int = count) -> Array:
            from_here = start.copy()
            from_here[free] += size[free] * x
            begin = {"initial": from_here[:2], "initial_state": from_here[2:]}
            try:
                motion = simulate(law, excitation, count / sample_rate, sample_rate, **options | begin)
                apart = (motion.angle - measured[:count]) / size[0]
            except SimulationError:
                apart = np.full(count, FAR_OFF)
            return np.concatenate([apart, noise * x[free > 1]])

        def jacobian(x: Array, at: Any = residual) -> Array:
            here = at(x)
            return np.column_stack(
                [(at(x + step) - here) / DIFFERENCE for step in DIFFERENCE * np.eye(x.size)]
            )

        found = np.asarray(scipy.optimize.least_squares(residual, found, jacobian, bounds=(-bound, bound)).x)
    result = start.copy()
    result[free] += size[free] * found
    return result


def segment_starts(n_samples: int, sample_rate: float, window: float) -> list[int]:
    """Return the first sample of every segment; a remainder of fewer than four samples joins the last segment.

    Parameters
    ----------
    n_samples : int
    sample_rate : float
        Hz.
    window : float
        Length of a segment, s.

    Raises
    ------
    InputError
        For a segment of fewer than four samples.

    Examples
    --------
    >>> segment_starts(1002, 100.0, 5.0)
    [0, 500]
    """
    length = round(window * sample_rate)
    if length < 4:
        raise InputError(f"window is {window!r} s at {sample_rate!r} Hz; expected at least four samples")
    starts = list(range(0, n_samples, length))
    return starts[:-1] if len(starts) > 1 and n_samples - starts[-1] < 4 else starts


def simulate_segments(
    law: Law,
    moment: ArrayLike,
    sample_rate: float,
    window: float,
    initial: ArrayLike,
    *,
    interpolation: Interpolation = "linear",
    initial_state: ArrayLike | None = None,
    **options: Any,
) -> Motion:
    """Simulate a measured moment by multiple shooting: each segment restarts from a given state.

    A drive without restoring stiffness drifts; restarting keeps the comparison with a measurement meaningful.

    Parameters
    ----------
    law : Law
    moment : array_like, shape (n,)
        Measured moment, N·m (N).
    sample_rate : float
        Hz.
    window : float
        Length of a segment, s.
    initial : array_like, shape (n, 2)
        Measured angle and rate at every sample, from which each segment starts.
    interpolation : {"linear", "cubic", "hold"}
    initial_state : array_like, shape (n_states, n), optional
        Internal states at every sample.
    **options
        As in :func:`simulate_many`.

    Returns
    -------
    Motion
        One record of n samples, the segments one after another.
    """
    values, start = np.asarray(moment, dtype=np.float64), np.asarray(initial, dtype=np.float64)
    if start.shape != (values.size, 2):
        raise InputError(f"initial has shape {start.shape}; expected ({values.size}, 2), a state per sample")
    starts = segment_starts(values.size, sample_rate, window)
    ends = [*starts[1:], values.size]
    parts = []
    for a, b in zip(starts, ends, strict=True):
        z0 = None if initial_state is None else np.asarray(initial_state)[:, a]
        excitation = sampled(values[a:b], sample_rate, interpolation)
        parts.append(
            simulate(
                law,
                excitation,
                (b - a) / sample_rate,
                sample_rate,
                initial=start[a],
                initial_state=z0,
                **options,
            )
        )
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=-1)
        for name in ("angle", "rate", "acceleration", "moment", "stuck", "state")
    }
    return Motion(
        time=np.arange(values.size) / sample_rate, **joined, steps=sum(part.steps for part in parts)
    )
