"""Force states as the rows of a regression: the samples in which the moment is a function of the state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array, smoothing_kernels
from sindyjoint.states.policy import POLICY
from sindyjoint.states.record import ForceStates


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
    blocks: NDArray[np.intp]
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
        same = [f for f in known if abs(state.frequency - f) <= POLICY.same_frequency * f]
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
    X, y, X_other, y_other, groups, runs, blocks = [], [], [], [], [], [], []
    for state, label in zip(states, group_labels(states), strict=True):
        keep = state.moving
        motion = [s[keep] for s in (state.angle, state.rate, state.acceleration)]
        other = motion if state.replicate is None else [s[keep] for s in state.replicate]
        moment = state.moment[keep]
        columns = 3 if inertia is None else 2
        inputs = [values[keep] for values in state.inputs.values()] if with_inputs else []
        X.append(np.column_stack([*motion[:columns], *inputs]))
        X_other.append(np.column_stack([*other[:columns], *inputs]))
        y.append(moment - (inertia or 0.0) * motion[2])
        y_other.append(moment - (inertia or 0.0) * other[2])
        groups.append(np.full(moment.size, label, dtype=object))
        runs.append(np.full(moment.size, state.run, dtype=object))
        blocks.append(state.block[keep])
    single = len(states) == 1
    return RegressionRows(
        np.vstack(X),
        np.concatenate(y),
        None if single else np.concatenate(groups),
        None if single else np.concatenate(runs),
        np.concatenate(blocks),
        np.vstack(X_other),
        np.concatenate(y_other),
    )


def rate_limit(rate: Array, noise: float, share: float) -> float:
    """Return the angular velocity below which its sign is unknown, rad/s.

    The larger of ``share`` of the peak rate and four standard errors of the rate: below it the sign of θ̇, and
    with it the side of the Coulomb friction, is not known.
    """
    return max(share * float(np.max(np.abs(rate))), POLICY.rate_sigmas * noise)


def moving_mask(rate: Array, limit: float, guard: int) -> NDArray[np.bool_]:
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


def within(good: NDArray[np.bool_], guard: int) -> NDArray[np.bool_]:
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
    sure = POLICY.rate_sigmas
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


def _known_angles(angle: Array, still: NDArray[np.bool_], within: float) -> NDArray[np.intp]:
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
