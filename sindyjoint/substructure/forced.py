"""Frequency response of a structure with joints under a harmonic force, round its folds."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import ClassVar

import numpy as np

from sindyjoint.described import Maybe, Shown, same
from sindyjoint.numeric import Array, Booleans
from sindyjoint.record import Motion
from sindyjoint.substructure.continuation import (
    FREQUENCY_SHARE,
    STEP,
    Scale,
    Solution,
    System,
    follow,
    traced,
)
from sindyjoint.substructure.harmonic_balance import Balance
from sindyjoint.substructure.joint_curves import Varied
from sindyjoint.substructure.modes import ModeCurve, sizes_of_unknowns


@dataclass(frozen=True, eq=False)
class ForcedResponse:
    """Frequency response at one level of the force, along the curve.

    Parameters
    ----------
    force : float
        Amplitude, N.
    frequency : ndarray, shape (n,)
        Hz; where the curve folds it turns back.
    amplitude, phase : ndarray, shape (n,)
        Of the first harmonic of the deflection, m, and rad ahead of the force.
    angle : ndarray, shape (joints, n)
        Half of the peak-to-peak angle of each joint, rad.
    stable : ndarray of bool, shape (n,)
        False between two folds: no test stays there.
    frequency_error, log_error : ndarray, shape (n,)
        Standard error across the curve: its part along the frequency, Hz, and along ln amplitude; zeros where nothing
        is uncertain.
    tested : ndarray of bool, shape (n,)
        Whether every joint stays within the angle that its model was fitted to; true of a joint without a model.
    harmonics : int
        That were balanced, at most.
    """

    WRITTEN: ClassVar = {
        "force": "force",
        "peak": {
            "frequency": "peak_frequency",
            "amplitude": "peak_amplitude",
            "interval95": "peak_interval95",
        },
        **same(
            "folds",
            "frequency",
            "amplitude",
            "phase",
            "stable",
            "tested",
            "frequency_error",
            "log_error",
            "angle",
        ),
    }
    force: float
    frequency: Array
    amplitude: Array
    phase: Array
    angle: Array
    stable: Booleans
    frequency_error: Array
    log_error: Array
    tested: Booleans
    harmonics: int

    def band95(self, side: int) -> tuple[Array, Array]:
        """Return frequency and amplitude along one edge of the 95 % band; ``side`` is −1 or +1."""
        shift = 1.96 * side
        return self.frequency + shift * self.frequency_error, self.amplitude * np.exp(shift * self.log_error)

    @property
    def peak(self) -> tuple[float, float]:
        """Frequency, Hz, and amplitude, m, of the largest response."""
        place = int(np.argmax(self.amplitude))
        log_amplitude, frequency = self._extremum(np.log(self.amplitude), place)
        return frequency, float(np.exp(log_amplitude))

    @property
    def peak_error(self) -> float:
        """Standard error of the logarithm of the largest amplitude."""
        return float(np.abs(self.log_error[int(np.argmax(self.amplitude))]))

    @property
    def peak_frequency(self) -> float:
        """Frequency of the largest response, Hz."""
        return self.peak[0]

    @property
    def peak_amplitude(self) -> float:
        """Amplitude of the largest response, m."""
        return self.peak[1]

    @property
    def peak_interval95(self) -> tuple[float, float]:
        """Interval of 95 % of the largest amplitude, m."""
        edge = float(np.exp(1.96 * self.peak_error))
        return self.peak_amplitude / edge, self.peak_amplitude * edge

    @property
    def folds(self) -> list[float]:
        """Frequencies at which the response jumps, Hz."""
        turns = np.flatnonzero(np.diff(self.stable.astype(int)))
        return [self._extremum(self.frequency, int(place))[0] for place in turns]

    def _extremum(self, values: Array, place: int) -> tuple[float, float]:
        """Extreme value near a place and the frequency there: parabolas over the length of the curve."""
        first = min(max(place - 1, 0), max(values.size - 3, 0))
        near = slice(first, first + 3)
        if values[near].size < 3:
            return float(values[place]), float(self.frequency[place])
        steps = np.hypot(
            np.diff(np.log(self.frequency[near])) / FREQUENCY_SHARE, np.diff(np.log(self.amplitude[near]))
        )
        length = np.concatenate([[0.0], np.cumsum(steps)])
        bend, slope, _ = curve = np.polyfit(length, values[near], 2)
        at = float(np.clip(-slope / (2 * bend), 0.0, length[-1])) if bend else float(length[1])
        return float(np.polyval(curve, at)), float(
            np.polyval(np.polyfit(length, self.frequency[near], 2), at)
        )


def frequency_response(
    balance: Balance,
    force: float,
    band: tuple[float, float],
    *,
    refine: bool = False,
    varied: Varied | None = None,
    tested: Array | float = np.inf,
    limits: Array | float = np.inf,
) -> ForcedResponse:
    """Follow the periodic response under F·cos Ωt from the lower end of a band to its upper one.

    Parameters
    ----------
    balance : Balance
    force : float
        F, N.
    band : (float, float)
        Hz.
    refine : bool
        Whether each point is balanced with as many harmonics as it needs, beyond those of the balance.
    varied : Varied, optional
        For the errors of the curve.
    tested, limits : float or ndarray, shape (joints,)
        Angle of each joint up to which its model was tested, and at which the curve ends, rad.

    Raises
    ------
    SimulationError
        Where no periodic response is found.
    """

    def curve(balance: Balance) -> tuple[System, Scale]:
        def system(y: Array) -> tuple[Array, Array]:
            residual, jacobian = balance.residual(y[:-1], y[-1], force)
            step = STEP * y[-1]
            ahead, _ = balance.residual(y[:-1], y[-1] + step, force, slopes=False)
            return residual, np.column_stack([jacobian, (ahead - residual) / step])

        def scale(y: Array) -> Array:
            deflection = float(np.hypot(y[-3], y[-2]))
            return np.append(sizes_of_unknowns(balance, 1, deflection), FREQUENCY_SHARE * y[-1])

        return system, scale

    low, high = (2 * np.pi * end for end in band)
    system, scale = curve(balance)
    starts = (np.append(guess, low) for guess in _first_guesses(balance, low, force))
    within = takewhile(lambda p: low * (1 - 1e-9) <= p.unknowns[-1] <= high, follow(system, starts, scale))
    points = traced(curve, balance, within, lambda y: y[:-1], limits, refine)
    omega = np.array([p.unknowns[-1] for *_, p in points])
    deflection = np.array([own.deflection(x, p.unknowns[-1]) for own, x, p in points])
    angle = np.array([own.peak_angles(x) for own, x, _ in points]).T
    errors = np.array(
        [
            [0.0, 0.0] if varied is None else _error_across(own, point, varied, force)
            for own, _, point in points
        ]
    )
    return ForcedResponse(
        force, omega / (2 * np.pi), np.abs(deflection), np.angle(deflection),
        angle, np.array([p.tangent[-1] > 0 for *_, p in points]),
        errors[:, 0], errors[:, 1],
        np.all(angle <= np.reshape(tested, (-1, 1)), axis=0), max(own.harmonics for own, *_ in points),
    )  # fmt: skip


def _first_guesses(balance: Balance, omega: float, force: float) -> Iterator[Array]:
    """Yield the response with all joints stuck, without friction, and as a force arrives that rises from small."""
    linear, first = balance.linear(omega), balance.first
    push = np.zeros(first.size)
    push[-2] = force
    stuck, sliding = np.zeros(balance.size), np.zeros(balance.size)
    stuck[-2:] = np.linalg.solve(linear[-2:, -2:], push[-2:])
    springs = np.diag(np.append(np.repeat(balance.tangents, 2), [0.0, 0.0]))
    sliding[first] = np.linalg.solve(linear[np.ix_(first, first)] + springs, push)
    yield from (stuck, sliding)

    def system(y: Array) -> tuple[Array, Array]:
        residual, jacobian = balance.residual(y[:-1], omega, y[-1])
        column = np.zeros(balance.size)
        column[-2] = -1.0
        return residual, np.column_stack([jacobian, column])

    sizes = np.append(sizes_of_unknowns(balance, 1, float(np.hypot(*sliding[-2:]))), force)
    # Where a force begins to rise that arrives at the first point of a curve, as a share of it.
    for point in follow(system, [0.02 * np.append(stuck, force)], lambda y: sizes):
        if point.unknowns[-1] >= force:
            yield point.unknowns[:-1]
            return


def _error_across(balance: Balance, point: Solution, varied: Varied, force: float) -> Array:
    """Return the standard error across the curve in ln f / FREQUENCY_SHARE and ln amplitude: (Hz, ln amplitude).

    Along the curve an error is none: a shifted point lies on the shifted curve wherever it is put on it.
    """
    y = point.unknowns
    moved = point.shifted(
        varied.slopes(
            lambda laws: replace(balance, laws=laws).residual(y[:-1], y[-1], force, slopes=False)[0]
        )
    )
    here = np.log(abs(balance.deflection(y[:-1], y[-1])))

    def seen(direction: Array) -> Array:
        """Return derivatives of (ln f / share, ln amplitude) along a direction of the unknowns."""
        step = STEP / (float(np.abs(direction / point.scale).max()) or 1.0)
        ahead = y + step * direction
        change = np.log(abs(balance.deflection(ahead[:-1], ahead[-1]))) - here
        return np.array([direction[-1] / (y[-1] * FREQUENCY_SHARE), change / step])

    tangent = seen(point.tangent * point.scale)
    normal = np.array([-tangent[1], tangent[0]]) / (float(np.linalg.norm(tangent)) or 1.0)
    error = varied.errors(np.array([normal @ seen(column) for column in moved.T]))
    return np.asarray(error * normal * [FREQUENCY_SHARE * y[-1] / (2 * np.pi), 1.0])


@dataclass(frozen=True)
class JointRange:
    """A joint of the rig, and the angle up to which its model was tested.

    Parameters
    ----------
    name : str
    tested_angle : float
        rad (m); not finite for a joint without a model.
    """

    name: str
    tested_angle: Maybe


@dataclass(frozen=True, eq=False, repr=False)
class StructureCurves(Shown):
    """The result of :func:`sindyjoint.curves` for a rig.

    Parameters
    ----------
    name : str
        Of the rig.
    at, point : str
        Where the force acts, and whose deflection the response is.
    joints : tuple of str
    tested : ndarray, shape (joints,)
        Largest angle that each joint's model was fitted to, rad (m); not finite for a joint without a model.
    sliding, locked : ndarray, shape (modes,)
        Natural frequencies with the joints' stiffness at zero, and with locked joints, Hz.
    modes : tuple of ModeCurve
    levels : tuple of ForcedResponse
    harmonics : int
        That were balanced, at most.
    simulated : bool
        True: what is shown follows from a model.
    warnings : tuple of str
    motion : {"rotation", "translation"}
        Of the joints.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "rig": "name",
        **same("motion", "at", "point", "harmonics"),
        "joints": "ranges",
        "frequencies": same("sliding", "locked"),
        **same("modes", "levels", "warnings"),
    }
    name: str
    at: str
    point: str
    joints: tuple[str, ...]
    tested: Array
    sliding: Array
    locked: Array
    modes: tuple[ModeCurve, ...]
    levels: tuple[ForcedResponse, ...]
    harmonics: int
    simulated: bool = True
    warnings: tuple[str, ...] = ()
    motion: Motion = "rotation"

    @property
    def ranges(self) -> tuple[JointRange, ...]:
        """The joints of the rig."""
        return tuple(map(JointRange, self.joints, self.tested.tolist()))
