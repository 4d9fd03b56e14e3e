"""What every route from signals to force states returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sindyjoint.numeric import Array
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
    """

    moment: float
    angle: float
    rate: float
    acceleration: float
    measured: bool = True
    motion_measured: bool = True
    source: str = "spectrum"


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

    orders: NDArray[np.intp]
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
    moving: NDArray[np.bool_]
    block: NDArray[np.intp]
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

    @property
    def moving_fraction(self) -> float:
        """Share of the samples in which the joint moves."""
        return float(np.mean(self.moving))

    def transfer_moment(self, inertia: float) -> Array:
        """Transfer moment M_T = M − I·θ̈, N·m (the paper, Eq. 5). ``inertia`` in kg·m²."""
        return self.moment - inertia * self.acceleration
