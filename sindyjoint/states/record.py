"""Force states, which every route from signals returns: where the joint moves, and the rows of a regression."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.limits import STATES
from sindyjoint.numeric import Array, Booleans, Integers, smoothing_kernels
from sindyjoint.rig import Fusion

Method = Literal["periodic", "broadband", "path"]


@dataclass(frozen=True)
class NoiseFloor:
    """Root-mean-square of what does not repeat, per channel.

    Parameters
    ----------
    moment : float
        N·m, of single samples of the measured moment.
    angle : float
        rad, of single samples of the measured angle.
    rate : float
        rad/s, standard error of the estimated angular velocity.
    acceleration : float
        rad/s², standard error of the estimated angular acceleration.
    measured, motion_measured : bool
        Whether the noise of the moment, and that of angle and rate, was measured or declared. Where nothing repeats and
        a channel has no flat floor the numbers are only what its noise would be if it were white.
    source : {"declared", "periods", "steady periods", "mean periods", "spectrum", "coherent"}
        What showed the noise of the moment; of "coherent", where its spectrum ends in signal, it is an upper bound.
    at_most : float, optional
        N·m: what samples of nearly one state show of a noise that is not known otherwise.
    """

    moment: float
    angle: float
    rate: float
    acceleration: float
    measured: bool = True
    motion_measured: bool = True
    source: str = "spectrum"
    at_most: float | None = None


@dataclass(frozen=True, eq=False)
class Harmonics:
    """Which harmonics of the excitation frequency a channel was reduced to.

    Parameters
    ----------
    orders : ndarray of int, shape (h,)
        Those kept, ascending.
    standard_error : ndarray, shape (h,)
        Of one of the two coefficients of each, in the channel's unit.
    """

    orders: Integers
    standard_error: Array

    def derivative_noise(self, frequency: float, order: int) -> float:
        """Return the standard error of a derivative of the series of ``frequency``, Hz, RMS over the cycle."""
        angular = 2 * np.pi * frequency * self.orders
        return float(np.sqrt(np.sum((angular**order * self.standard_error) ** 2)))


@dataclass(frozen=True, eq=False)
class ForceStates:
    """The force states of one run: the joint's state and the moment at every usable instant.

    Parameters
    ----------
    run : str
    frequency : float or None
        Excitation frequency as refined from the data, Hz.
    level : str or None
    sample_rate : float
        Hz.
    time : ndarray, shape (n,)
        s, counted from the first sample of the run.
    angle, rate, acceleration : ndarray, shape (n,)
        θ rad, θ̇ rad/s, θ̈ rad/s².
    moment : ndarray, shape (n,)
        Moment at the sensor as measured, N·m. It is not filtered: its noise averages out in the regression, while a
        filter would smear the friction step into its neighbours.
    moving : ndarray of bool, shape (n,)
        False while the joint sticks or reverses; there the moment is not a function of (θ, θ̇).
    block : ndarray of int, shape (n,)
        Replicate block (a segment of whole periods, or of time) to which a sample belongs.
    replicate : tuple of three ndarray, or None
        Angle, rate and acceleration estimated from each block separately. Their scatter carries the noise of the angle
        channel into standard errors. ``None`` where blocks share one estimate.
    noise : NoiseFloor
    method : {"periodic", "broadband", "path"}
    bandwidth : float
        Highest frequency kept in the angle, Hz.
    dropped : float
        Seconds left out at the start as transient (periodic) or at the edges (broadband).
    repeated : bool
        Whether the samples are the mean of repeated segments (the periods of a multisine), so that the last
        precedes the first.
    rate_measured : bool
        Whether the angular velocity comes from a separate channel.
    began : float
        Start of the run since that of the campaign's first one, s; zero where not requested.
    slowest : float
        Rate below which a sample counts as reversal, rad/s.
    guard : int
        Samples left out on either side of a reversal.
    series : tuple of Harmonics
        Of the angle and, where it was measured, of the rate; empty where the states are no series.
    completed : bool
        Whether the harmonics that the series lacks were added from a simulation of the model.
    lead : tuple of two ndarray, shape (k,), or None
        Angle and rate at the samples before the first one, back to the start of the record, as far as the kernel knows
        them there: too rough for a fit, but they show what internal states have come to.
    inputs : mapping of str to ndarray, shape (n,)
        Declared inputs of the law at the same instants, SI, filtered as the angle is.
    fusion : Fusion or None
        The sensors of a run with an accelerometer.
    """

    run: str
    frequency: float | None
    level: str | None
    sample_rate: float
    time: Array
    angle: Array
    rate: Array
    acceleration: Array
    moment: Array
    moving: Booleans
    block: Integers
    replicate: tuple[Array, Array, Array] | None
    noise: NoiseFloor
    method: Method
    bandwidth: float
    dropped: float
    repeated: bool = False
    rate_measured: bool = False
    began: float = 0.0
    slowest: float = 0.0
    guard: int = 0
    series: tuple[Harmonics, ...] = ()
    completed: bool = False
    lead: tuple[Array, Array] | None = None
    inputs: Mapping[str, Array] = field(default_factory=dict)
    fusion: Fusion | None = None

    @property
    def mean_known(self) -> bool:
        """Whether the mean angle was measured: an accelerometer does not see it."""
        return self.fusion is None or self.fusion.mean_known

    @property
    def fundamental(self) -> float:
        """Excitation frequency of a run that repeats, Hz."""
        assert self.frequency is not None
        return self.frequency

    def white_noise(self, frequency: ArrayLike) -> Array:
        """Return the RMS of white noise as dense as that of the angle at some frequencies, Hz, rad."""
        if self.fusion is None:
            return np.full(np.shape(frequency), self.noise.angle)
        return self.fusion.white_noise(frequency, self.sample_rate)

    def draw_angle_noise(self, size: int, generator: np.random.Generator) -> Array:
        """Return so many samples of noise of the angle, rad."""
        if self.fusion is None:
            return self.noise.angle * generator.standard_normal(size)
        return self.fusion.draw(size, self.sample_rate, generator)

    @property
    def n_samples(self) -> int:
        """Number of samples, moving or not."""
        return self.angle.size

    def part(self, low: float, high: float) -> "ForceStates":
        """Return a share of the samples."""
        chosen = slice(int(low * self.n_samples), int(high * self.n_samples))
        names = ("time", "angle", "rate", "acceleration", "moment", "moving", "block")
        return replace(self, replicate=None, **{name: getattr(self, name)[chosen] for name in names})

    @property
    def moving_fraction(self) -> float:
        """Share of the samples in which the joint moves."""
        return float(np.mean(self.moving))

    def transfer_moment(self, inertia: float) -> Array:
        """Transfer moment M_T = M − I·θ̈, N·m (the paper, Eq. 5). ``inertia`` in kg·m²."""
        return self.moment - inertia * self.acceleration


@dataclass(frozen=True, eq=False)
class RegressionRows:
    """Moving force states of several runs, stacked.

    Parameters
    ----------
    X : ndarray, shape (n, 2 + k) or (n, 3 + k)
        θ, θ̇ and, where the inertia is to be identified, θ̈; behind them the inputs of the states, in their order.
    y : ndarray, shape (n,)
        Transfer moment M − I·θ̈, or the moment at the sensor where the inertia is to be identified.
    groups : ndarray of str, shape (n,), or None
        Frequency where runs differ in it, else the run; ``None`` for a single run.
    runs, blocks : ndarray, shape (n,)
        ``runs`` is None for a single run.
    X_replicate, y_replicate : ndarray
        The same rows from each block separately.
    """

    X: Array
    y: Array
    groups: NDArray[Any] | None
    runs: NDArray[Any] | None
    blocks: Integers
    X_replicate: Array
    y_replicate: Array

    def fit_arguments(self) -> dict[str, Any]:
        """Return everything as keyword arguments of ``JointRegressor.fit``."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}


def group_labels(states: Sequence[ForceStates]) -> list[str]:
    """Return the group in which each run is held out: its frequency, or the run itself where all share one.

    Frequencies are refined run by run: within one per cent they are the same. Runs without time are held out by their
    level.
    """
    if all(state.method == "path" and state.level for state in states):
        labels = [str(state.level) for state in states]
        return labels if len(set(labels)) > 1 else [s.run for s in states]
    known: list[float] = []
    labels = []
    for state in states:
        if state.frequency is None:
            labels.append(state.run)
            continue
        same = [f for f in known if abs(state.frequency - f) <= STATES.small_share * f]
        if not same:
            known.append(state.frequency)
        labels.append(f"{same[0] if same else state.frequency:.4g} Hz")
    return labels if len(set(labels)) > 1 else [s.run for s in states]


def regression_rows(
    states: Sequence[ForceStates], inertia: float | None, with_inputs: bool = True
) -> RegressionRows:
    """Return the moving samples of all runs.

    Parameters
    ----------
    states : sequence of ForceStates
    inertia : float or None
        kg·m²; ``None``: θ̈ becomes a column.
    with_inputs : bool
        Whether inputs of the states are columns, too.

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> rows = sindyjoint.regression_rows(sindyjoint.campaign_states(test), test.joint.inertia)
    >>> sindyjoint.JointRegressor("paper").fit(**rows.fit_arguments()).selected_
    ('linear_stiffness', 'quadratic_stiffness', 'cubic_stiffness', 'linear_damping', 'coulomb_friction')
    """
    parts = []
    for state, label in zip(states, group_labels(states), strict=True):
        keep = state.moving
        motion = [s[keep] for s in (state.angle, state.rate, state.acceleration)]
        other = motion if state.replicate is None else [s[keep] for s in state.replicate]
        moment = state.moment[keep]
        columns = 3 if inertia is None else 2
        inputs = [values[keep] for values in state.inputs.values()] if with_inputs else []
        size = np.count_nonzero(keep)
        parts.append(
            (
                np.column_stack([*motion[:columns], *inputs]),
                moment - (inertia or 0.0) * motion[2],
                np.full(size, label, dtype=object),
                np.full(size, state.run, dtype=object),
                state.block[keep],
                np.column_stack([*other[:columns], *inputs]),
                moment - (inertia or 0.0) * other[2],
            )
        )
    X, y, groups, runs, *rest = (np.concatenate(column) for column in zip(*parts, strict=True))
    single = len(states) == 1
    return RegressionRows(X, y, None if single else groups, None if single else runs, *rest)


def rate_limit(rate: Array, noise: float, share: float) -> float:
    """Return the angular velocity below which its sign is unknown, rad/s.

    The larger of ``share`` of the peak rate and four standard errors of the rate: below it the sign of θ̇, and
    with it the side of the Coulomb friction, is not known.
    """
    return max(share * float(np.max(np.abs(rate))), STATES.outstanding * noise)


def moving_mask(rate: Array, limit: float, guard: int) -> Booleans:
    """Return where |θ̇| passes ``limit`` with ``guard`` samples to spare on both sides.

    Parameters
    ----------
    rate : ndarray, shape (n,)
        rad/s.
    limit : float
        rad/s.
    guard : int
        Samples removed around every sample that is below the limit or in which the sign of the rate changes.
    """
    slow = np.abs(rate) <= limit
    slow[1:] |= np.sign(rate[1:]) != np.sign(rate[:-1])
    return within(~slow, guard)


def within(good: Booleans, guard: int) -> Booleans:
    """Return where all samples up to ``guard`` to either side are good, shape (n,)."""
    count = np.concatenate([[0], np.cumsum(~good)])
    n = good.size
    low = np.maximum(np.arange(n) - guard, 0)
    high = np.minimum(np.arange(n) + guard + 1, n)
    return count[high] == count[low]


def without_noise_travel(states: ForceStates, angle: Array, rate: Array, step: float) -> tuple[Array, Array]:
    """Return angle and rate, straight from one known angle to the next where the rate is within its noise.

    Known are the ends of such a standstill, and between them angles that stand out of the noise of the angle (Douglas
    and Peucker, 1973). Samples are ``step`` seconds apart.
    """
    sure = STATES.outstanding
    still = np.abs(rate) <= sure * states.noise.rate
    if not still.any():
        return angle, rate
    low = smoothing_kernels(states.bandwidth, states.sample_rate)[0]
    # A sample and the chord between two others have noise alike.
    apart = np.sqrt(2) * states.noise.angle * float(np.linalg.norm(low))
    known = _known_angles(angle, still, sure * apart)
    place = np.arange(angle.size)
    straight = np.interp(place, known, angle[known])
    slope = np.repeat(np.diff(angle[known]) / (step * np.diff(known)), np.diff(known))
    return straight, np.where(still, np.append(slope, rate[-1:]), rate)


def _known_angles(angle: Array, still: Booleans, within: float) -> Integers:
    """Return the samples between which the angle is straight: all that move, of a standstill those beyond noise."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    known = ~still
    known[[0, -1]] = True
    open_ends = [(max(begin - 1, 0), min(end, angle.size - 1)) for begin, end in edges.reshape(-1, 2)]
    while open_ends:
        begin, end = open_ends.pop()
        if end - begin < 2:
            continue
        chord = np.linspace(angle[begin], angle[end], end - begin + 1)
        away = np.abs(angle[begin : end + 1] - chord)
        farthest = int(np.argmax(away))
        if away[farthest] > within:
            known[begin + farthest] = True
            open_ends += [(begin, begin + farthest), (begin + farthest, end)]
    return np.flatnonzero(known)
