"""Motion of one joint under a moment, and the moment of a joint under a motion, with exact sticking.

The equation is (J + I)·θ̈ + M_T(θ, θ̇, z) = M(t): I the moving inertia between sensor and joint (the law's), J a
beam inertia between exciter and sensor. The sensor sees I·θ̈ + M_T = M − J·θ̈ (paper Eq. 7).
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.clock import STEP_SAMPLES, spend
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.excitation import Excitation
from sindyjoint.numeric import DIFFERENCE, Array, Booleans, kept

# Runge-Kutta of order 4 is stable up to 2.8 of a step times the rate at which a state settles.
STIFF, MOST_SUBSTEPS = 2.0, 512
# Most steps of a simulation: usual are fewer than ten a sample; a law that takes hundreds is not that of the samples.
STEPS_PER_SAMPLE, LEAST_STEPS = 400, 2_000_000


@dataclass(frozen=True, eq=False)
class Motion:
    """Simulated motion of one joint, or of several runs along a leading axis.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s.
    angle, rate, acceleration : ndarray, shape (n,) or (runs, n)
        rad, rad/s, rad/s² (m, m/s, m/s²).
    moment : ndarray, shape (n,) or (runs, n)
        What the sensor sees, I·θ̈ + M_T, N·m (N).
    stuck : ndarray of bool, shape (n,) or (runs, n)
    state : ndarray, shape (n_states, n) or (runs, n_states, n)
        Internal states of the law.
    steps : int
        Steps taken while slipping, over all runs.
    """

    time: Array
    angle: Array
    rate: Array
    acceleration: Array
    moment: Array
    stuck: Booleans
    state: Array
    steps: int = 0

    @property
    def sample_rate(self) -> float:
        """Sampling rate, Hz."""
        return 1.0 / (self.time[1] - self.time[0])


def _describe_failure(status: int, time: float, limits: Array, where: str) -> SimulationError:
    import sindyjoint.mechanics.stickslip_kernel as kernel

    texts = {
        kernel.LIMIT: (
            f"the joint left its range ({limits[0]:.4g} to {limits[1]:.4g}) at t = {time:.6g} s: past a "
            "softening limit its tangent stiffness is negative and it snaps through, with negative damping it swings "
            "ever wider; lower the excitation, or pass limits=None to follow it"
        ),
        kernel.NOT_FINITE: f"the state is no longer finite at t = {time:.6g} s; the law is unbounded there",
        kernel.STEP_TOO_SMALL: (
            f"the step fell to zero at t = {time:.6g} s; the law jumps where only friction may (at zero rate)"
        ),
        kernel.ACTIVE_FRICTION: (
            f"at t = {time:.6g} s the joint came to a standstill with negative friction "
            "(the moment there is larger for slip towards −1 than towards +1); Coulomb friction must not be negative"
        ),
        kernel.TOO_MANY_STEPS: (
            f"hundreds of steps a sample did not suffice; it stopped at t = {time:.6g} s; the law is too stiff"
        ),
    }
    return SimulationError(where + texts[status], time=float(time))


def _expand_parameters(
    parameters: ArrayLike | None, given: Array, places: NDArray[np.int64], runs: int
) -> Array:
    """Return what the law reads in each run, shape (runs, n_numbers)."""
    numbers = np.tile(given, (runs, 1))
    if parameters is None:
        return numbers
    sets, count = np.atleast_2d(np.asarray(parameters, dtype=np.float64)), places.size
    if sets.shape[1] != count or sets.shape[0] not in (1, runs):
        raise InputError(
            f"parameters have shape {sets.shape}; expected ({runs}, {count}): one row of the law's "
            "parameters per run"
        )
    numbers[:, places] = sets
    return numbers


def _find_limits(law: Law, limits: tuple[float, float] | str | None) -> Array:
    if isinstance(limits, str) and limits != "softening":
        raise InputError(f"limits is {limits!r}; expected 'softening', a pair of angles or None")
    chosen = (-np.inf, np.inf) if limits is None else limits
    return np.array(law.softening_limit if limits == "softening" else chosen, dtype=np.float64)


def simulate_many(
    law: Law,
    excitations: Sequence[Excitation],
    duration: float,
    sample_rate: float,
    *,
    parameters: ArrayLike | None = None,
    beam_inertia: ArrayLike = 0.0,
    initial: ArrayLike = (0.0, 0.0),
    initial_state: ArrayLike | None = None,
    limits: tuple[float, float] | str | None = "softening",
    rtol: float = 1e-7,
    max_step: float = np.inf,
    most_steps: int | None = None,
    threads: int | None = None,
) -> Motion:
    """Simulate many runs of one law on threads.

    Parameters
    ----------
    law : Law
    excitations : sequence of Excitation
        Moment of each run, N·m; a single one serves every parameter set.
    duration : float
        s; the runs have ``round(duration · sample_rate)`` samples, the first at time zero.
    sample_rate : float
        Hz.
    parameters : array_like, shape (runs, n_parameters), optional
        A set of the compiled law's parameters per run; otherwise the law's.
    beam_inertia : float or array_like, shape (runs,)
        J between exciter and sensor, kg·m².
    initial : array_like, shape (2,) or (runs, 2)
        Angle and rate at time zero.
    initial_state : array_like, shape (n_states,) or (runs, n_states), optional
    limits : {"softening"}, pair of float, or None
        Angles past which the simulation is stopped with an error.
    rtol : float
        Tolerance of a step relative to the largest value of each variable so far.
    max_step : float
        s.
    most_steps : int, optional
        After which a run ends with an error. Default: :data:`STEPS_PER_SAMPLE` a sample, at least two million.
    threads : int, optional
        Default: one per core.

    Returns
    -------
    Motion
        With a leading axis of runs.

    Raises
    ------
    InputError
        For shapes or numbers that do not fit.
    SimulationError
        When a run leaves the range where its law holds; carries the time.
    """
    import sindyjoint.mechanics.stickslip_kernel as kernel
    from sindyjoint.mechanics.kernels import PAPER_CALLBACK

    compiled = law.compiled()
    address = 0 if compiled.callback is PAPER_CALLBACK else compiled.address
    excitations = list(excitations)
    runs = max(len(excitations), 1 if parameters is None else np.atleast_2d(np.asarray(parameters)).shape[0])
    if not excitations or len(excitations) not in (1, runs):
        raise InputError(
            f"{len(excitations)} excitation(s) for {runs} parameter sets; expected one, or one per set"
        )
    n_samples = round(duration * sample_rate) if np.isfinite(duration * sample_rate) else 0
    if n_samples < 2 or not sample_rate > 0 or not 1e-13 <= rtol < 1 or not max_step > 0:
        raise InputError(
            f"duration {duration!r} s at {sample_rate!r} Hz with rtol {rtol!r} and max_step {max_step!r}; "
            "expected at least two samples, 1e-13 ≤ rtol < 1 and a positive step"
        )
    sets = _expand_parameters(parameters, compiled.numbers, compiled.places, runs)
    beam = np.broadcast_to(np.asarray(beam_inertia, dtype=np.float64), runs)
    total = np.ascontiguousarray(beam + law.inertia)
    if not np.all(total > 0):
        raise InputError(
            f"the moving inertia is {total.min():g}; a moment-driven joint needs a positive one: state it, or "
            "prescribe the motion"
        )

    y = np.zeros((runs, 2 + compiled.n_states))
    y[:, :2] = initial
    y[:, 2:] = 0.0 if initial_state is None else initial_state
    bounds = np.ascontiguousarray(np.broadcast_to(_find_limits(law, limits), (runs, 2)))
    drives = excitations * runs if len(excitations) < runs else excitations
    most = max(STEPS_PER_SAMPLE * n_samples, LEAST_STEPS) if most_steps is None else int(most_steps)
    steps = 1.0 / sample_rate, float(rtol), float(max_step), most
    angle, rate, acceleration = (np.empty((runs, n_samples)) for _ in range(3))
    states, stuck = np.empty((runs, compiled.n_states, n_samples)), np.zeros((runs, n_samples), dtype=np.int8)

    def integrate(r: int, e: Excitation) -> tuple[int, float, int]:
        # What the drive could do within a millionth of a piece: below it, no relative accuracy is asked for.
        sizes = np.full(y.shape[1], 1e-300)
        sizes[1] += 1e-6 * np.abs(e.pieces[:, 0]).max() * abs(e.scale) / total[r] * e.step
        sizes[0] += sizes[1] * e.step
        # One set of types, so that the integrator is compiled once.
        tone = float(e.step), e.periodic, e.smooth, float(e.scale), float(e.ramp)
        return kernel.integrate(
            address, sets[r], total[r], e.pieces, tone, y[r], sizes,
            np.zeros(11 * compiled.n_states + 6), *steps, (bounds[r, 0], bounds[r, 1]),
            (angle[r], rate[r], acceleration[r], states[r], stuck[r]),
        )  # fmt: skip

    if threads == 1 or runs == 1:
        ends = list(map(integrate, range(runs), drives))
    else:
        with ThreadPoolExecutor(min(threads or os.cpu_count() or 1, runs)) as pool:
            ends = list(pool.map(integrate, range(runs), drives))
    taken = sum(int(count) for _, _, count in ends)
    spend(STEP_SAMPLES * taken)
    for r, (status, reached, _) in enumerate(ends):
        if status:
            raise _describe_failure(status, reached, bounds[r], f"run {r}: " if runs > 1 else "")
    time = np.arange(n_samples) / sample_rate
    drive = np.stack([_sampled(e, n_samples, sample_rate) for e in excitations])
    driven = np.broadcast_to(drive, (runs, n_samples))
    moment = driven - beam[:, None] * acceleration if beam.any() else driven
    return Motion(time, angle, rate, acceleration, moment, stuck.view(np.bool_), states, taken)


# Many laws are driven by one excitation.
@kept
def _sampled(excitation: Excitation, n_samples: int, sample_rate: float) -> Array:
    return excitation(np.arange(n_samples) / sample_rate)


def simulate(law: Law, excitation: Excitation, duration: float, sample_rate: float, **options: Any) -> Motion:
    """Simulate one run; parameters, options and errors are those of :func:`simulate_many`.

    Examples
    --------
    >>> from sindyjoint.mechanics.excitation import harmonic
    >>> from sindyjoint.mechanics import INTER_PANEL
    >>> motion = simulate(INTER_PANEL, harmonic(5.0, 4.0), duration=1.0, sample_rate=1000)
    >>> bool(motion.stuck[:15].all()), bool(motion.stuck[-250:].any())
    (True, True)
    """
    many = simulate_many(law, [excitation], duration, sample_rate, threads=1, **options)
    return Motion(
        many.time, many.angle[0], many.rate[0], many.acceleration[0], many.moment[0], many.stuck[0], many.state[0],
        many.steps,
    )  # fmt: skip


def slip_direction(rate: ArrayLike) -> Array:
    """Sign of the rate; where the rate is zero, that of the motion before (after, at the start).

    Examples
    --------
    >>> slip_direction([0, 2, 0, -1, 0])
    array([ 1.,  1.,  1., -1., -1.])
    """
    sign = np.sign(np.asarray(rate, dtype=np.float64))
    moving = np.flatnonzero(sign)
    if not moving.size:
        return np.ones_like(sign)
    return sign[np.maximum.accumulate(np.where(sign != 0, np.arange(sign.size), moving[0]))]


APPROACH = 200  # samples


def brought_from_rest(law: Law, angle: Array, rate: Array, rest: float = 0.0, held: bool = False) -> Array:
    """Return the internal states of a joint brought from an angle of rest to the first one, as fast as it moves later.

    Where it was ``held`` there, what relaxes has relaxed: rates of the states are then zero, by one step of Newton's.
    A state that changes at standstill is no memory of the motion but a clock, which the approach does not advance.
    """
    from sindyjoint.mechanics.kernels import integrate_states

    compiled = law.compiled()
    state = np.zeros((compiled.n_states, APPROACH))
    fastest = float(np.abs(rate).max()) if rate.size else 0.0
    way = float(angle[0]) - rest if angle.size else 0.0
    if not (fastest > 0 and np.isfinite(fastest) and way != 0):
        return state[:, 0]
    duration = 0.5 * np.pi * abs(way) / fastest
    phase = np.linspace(0.0, np.pi, APPROACH)
    approach, speed = rest + 0.5 * way * (1 - np.cos(phase)), 0.5 * way * np.sin(phase) * np.pi / duration
    integrate_states(compiled.address, approach, speed, compiled.numbers, duration / (APPROACH - 1), 1, state)
    brought, step = state[:, -1:], DIFFERENCE * abs(way)
    if held and np.isfinite(brought).all():
        at = np.hstack([brought, brought + step * np.eye(compiled.n_states)])
        none = np.zeros(at.shape[1])
        still = law.state_rate(none + angle[0], none, none, at)
        slopes = (still[:, 1:] - still[:, :1]) / step
        brought = brought - np.linalg.lstsq(slopes, still[:, :1], rcond=None)[0]
    zero = np.zeros(1)
    clock = law.state_rate(zero, zero, zero, np.zeros((compiled.n_states, 1)))
    return np.where(clock == 0, brought, 0.0)[:, 0]


def transfer_moment(
    law: Law,
    angle: ArrayLike,
    rate: ArrayLike,
    sample_rate: float,
    *,
    acceleration: ArrayLike | None = None,
    substeps: int = 8,
    rest: float = 0.0,
) -> tuple[Array, Array]:
    """Return the moment at the sensor for a prescribed motion, I·θ̈ + M_T, and the internal states.

    Parameters
    ----------
    law : Law
    angle, rate : array_like, shape (n,)
        rad, rad/s (m, m/s).
    sample_rate : float
        Hz.
    acceleration : array_like, shape (n,), optional
        rad/s²; without it the inertia moment is omitted and only M_T is returned.
    substeps : int
        Runge–Kutta steps of the internal states per sample; more where a state settles faster than they follow.
    rest : float
        Angle of the joint before the motion, rad (m).

    Returns
    -------
    moment : ndarray, shape (n,)
        N·m (N). Where the rate is exactly zero, friction keeps the side of the motion before: while a prescribed
        motion stands still, its moment is not determined.
    state : ndarray, shape (n_states, n)
        From those of a joint brought from standstill at ``rest`` to the first angle; a slider that never slips
        afterwards keeps them.

    Raises
    ------
    SimulationError
        When an internal state is no longer finite; carries the time.
    """
    theta, omega = np.asarray(angle, dtype=np.float64), np.asarray(rate, dtype=np.float64)
    state = internal_states(law, theta, omega, sample_rate, substeps=substeps, rest=rest)
    moment = law.moment(theta, omega, slip_direction(omega), state)
    if acceleration is not None:
        moment = moment + law.inertia * np.asarray(acceleration, dtype=np.float64)
    return moment, state


def prescribed_motion(law: Law, angle: Excitation, samples: int, sample_rate: float) -> Motion:
    """Return a motion whose angle is prescribed, and the moment at the sensor that it takes."""
    time = np.arange(samples) / sample_rate
    motion = angle(time), angle.derivative(time), angle.derivative(time, 2)
    moment, state = transfer_moment(law, motion[0], motion[1], sample_rate, acceleration=motion[2])
    return Motion(time, *motion, moment, np.zeros(samples, dtype=np.bool_), state)


def internal_states(
    law: Law,
    angle: ArrayLike,
    rate: ArrayLike,
    sample_rate: float,
    *,
    substeps: int = 8,
    rest: float = 0.0,
    held: bool = False,
) -> Array:
    """Return the internal states of a law along a prescribed motion, shape (n_states, n).

    Parameters and what is raised: :func:`transfer_moment`; ``held``: :func:`brought_from_rest`.
    """
    from sindyjoint.mechanics.kernels import fastest_decay, integrate_states

    theta, omega = np.asarray(angle, dtype=np.float64), np.asarray(rate, dtype=np.float64)
    if theta.shape != omega.shape or theta.ndim != 1:
        raise InputError(
            f"angle and rate have shapes {theta.shape} and {omega.shape}; expected equal one-dimensional shapes"
        )
    direction = slip_direction(omega)
    compiled = law.compiled()
    state = np.zeros((compiled.n_states, theta.size))
    if compiled.n_states:
        state[:, 0] = brought_from_rest(law, theta, omega, rest, held)
        step, steps = 1.0 / sample_rate, int(substeps)
        integrate_states(compiled.address, theta, omega, compiled.numbers, step, steps, state)
        decay = fastest_decay(compiled.address, theta, omega, direction, compiled.numbers, state) * step
        if decay > STIFF * steps and steps < MOST_SUBSTEPS:
            steps = int(min(np.ceil(decay), MOST_SUBSTEPS))
            integrate_states(compiled.address, theta, omega, compiled.numbers, step, steps, state)
        spend(float(theta.size * steps))
        bad = np.flatnonzero(~np.isfinite(state).all(axis=0))
        if bad.size:
            time = bad[0] / sample_rate
            raise SimulationError(
                f"an internal state is no longer finite at t = {time:.6g} s; raise substeps (now {steps}) or check "
                "the law's parameters",
                time=time,
            )
    return state
