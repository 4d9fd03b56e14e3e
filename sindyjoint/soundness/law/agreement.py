"""How sensors and drive of a structure agree, and which fault of one channel makes them agree better.

At each harmonic the channels are y = A·u + noise of the unknowns u, the drive and the moments of the cut-open joints
(:mod:`sindyjoint.substructure.recovery`). More sensors than joints over-determine them. With a factor g of one channel,
yᵢ/g in the place of yᵢ, or a delay, yᵢ·exp(iωτ), the residual r(g, τ, p) depends on these and on the structure's
numbers p, which are known to σ: χ² = min Σ|r|² + Σ(p/σ)², u eliminated harmonic by harmonic (variable projection:
Golub and Pereyra 1973). Noise is divided by g with its channel.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import DIFFERENCE, Array
from sindyjoint.substructure import jump_columns, open_joints
from sindyjoint.substructure.recovery import Recovery, solved, with_numbers
from sindyjoint.substructure.spectra import strongest

Complex = NDArray[np.complex128]

SMALLEST = 1e-3  # factor below which a channel shows nothing


@dataclass(frozen=True, eq=False)
class Equations:
    """The strongest harmonics of all runs as linear equations.

    Parameters
    ----------
    run : ndarray of int, shape (l,)
        Number of the run of each line.
    angular : ndarray, shape (l,)
        rad/s.
    values : ndarray of complex, shape (l, channels)
    sigma : ndarray, shape (l, channels)
        Standard error of a real part.
    design : ndarray of complex, shape (l, channels, 1 + joints)
    slopes : ndarray of complex, shape (k, l, channels, 1 + joints)
        Derivatives by the structure's numbers.
    ends : ndarray of complex, shape (m, l, channels)
        What jumps at the ends of records that do not repeat add
        (:func:`~sindyjoint.substructure.jump_columns`), each of the
        size that is expected of it.
    prior : ndarray, shape (k + m,)
        Standard uncertainty of the numbers, relative, and of the jumps.
    offset : ndarray, shape (k + m,)
        Change of the numbers at which the design stands; zero of the jumps.
    angles : ndarray of complex, shape (l, joints, 1 + joints)
        Of the joints, by the unknowns.
    """

    run: NDArray[np.intp]
    angular: Array
    values: Complex
    sigma: Array
    design: Complex
    slopes: Complex
    ends: Complex
    prior: Array
    offset: Array
    angles: Complex

    @property
    def degrees(self) -> int:
        """Real numbers that the channels show beyond the unknowns."""
        return 2 * len(self.run) * (self.design.shape[1] - self.design.shape[2])

    def of(self, run: int | None) -> NDArray[np.bool_]:
        """Return the lines of a run, or all."""
        return np.ones(len(self.run), dtype=bool) if run is None else self.run == run


class Fault(NamedTuple):
    """A factor and a delay of one channel, in all lines or in those of one run."""

    channel: int
    run: int | None = None
    gain: float = 1.0
    delay: float = 0.0

    def removed(self, equations: Equations) -> Equations:
        """Return the equations without it."""
        rows, values, sigma = equations.of(self.run), equations.values.copy(), equations.sigma.copy()
        gain = np.copysign(max(abs(self.gain), SMALLEST), self.gain)
        values[rows, self.channel] *= np.exp(1j * equations.angular[rows] * self.delay) / gain
        sigma[rows, self.channel] /= abs(gain)
        return replace(equations, values=values, sigma=sigma)


class Fit(NamedTuple):
    """How channels agree.

    Parameters
    ----------
    fault : Fault or None
    chi_squared : float
    by_run : ndarray, shape (runs,)
        What each run contributes.
    numbers : ndarray, shape (k + m,)
        Change of the structure's numbers, and jumps at the ends.
    errors : tuple of float
        Standard errors of the fault's gain (relative) and delay (s) by the noise.
    """

    fault: Fault | None
    chi_squared: float
    by_run: Array
    numbers: Array
    errors: tuple[float, float] = (0.0, 0.0)


def equations_of(test: RigTest, recoveries: Sequence[Recovery]) -> Equations:
    """Return the strongest harmonics of runs as equations; the test's uncertain numbers are the structure's."""
    # Harmonics of all runs together that are looked at, and of one run.
    each = int(np.clip(240 // max(len(recoveries), 1), 8, 60))
    kept = [strongest(recovery.spectra, each) for recovery in recoveries]
    angular = np.concatenate([lines for _, lines in kept])
    ends = _ends_of(test, recoveries, [lines for _, lines in kept])
    prior = np.concatenate([[number.uncertainty for number in test.uncertain], np.ones(len(ends))])
    design, slopes, angles = _designs(test, angular)
    return Equations(
        np.repeat(np.arange(len(kept)), [lines.size for _, lines in kept]),
        angular,
        np.concatenate([spectra.amplitudes.T for spectra, _ in kept]),
        np.sqrt(np.concatenate([spectra.variance.T for spectra, _ in kept])),
        design,
        slopes,
        ends,
        prior,
        np.zeros(prior.size),
        angles,
    )


def _ends_of(test: RigTest, recoveries: Sequence[Recovery], lines: Sequence[Array]) -> Complex:
    """Return what jumps at the ends of the records add to the lines of all runs, shape (m, l, channels)."""
    total, first = sum(each.size for each in lines), 0
    parts = [np.zeros((0, total, 1 + len(test.sensors)), dtype=complex)]
    for recovery, angular in zip(recoveries, lines, strict=True):
        spectra = recovery.spectra
        if recovery.ends is not None:
            period, sensors = 1 / spectra.frequency, spectra.amplitudes[1:]
            shown = jump_columns(test.structure, test.sensors, spectra.angular, period, sensors)[0]
            own = np.zeros((shown.shape[2], total, shown.shape[1]), dtype=complex)
            rows = np.searchsorted(spectra.angular, angular)
            own[:, first : first + angular.size] = shown[rows].transpose(2, 0, 1)
            parts.append(own)
        first += angular.size
    return np.concatenate(parts)


def moved(equations: Equations, test: RigTest, numbers: Array) -> Equations:
    """Return equations whose design stands at changed numbers of the structure, on which it depends not linearly."""
    offset = np.where(np.arange(numbers.size) < len(test.uncertain), numbers, 0.0)
    there = with_numbers(test, numbers[: len(test.uncertain)])
    design, slopes, angles = _designs(there, equations.angular)
    return replace(equations, design=design, slopes=slopes, angles=angles, offset=offset)


def _designs(test: RigTest, angular: Array) -> tuple[Complex, Complex, Complex]:
    """Return how channels follow drive and moments, its derivatives by the structure's numbers, and the angles."""
    tests = [test, *(with_numbers(test, step) for step in DIFFERENCE * np.eye(len(test.uncertain)))]
    here, *others = (open_joints(t.structure, t.at, t.sensors, angular) for t in tests)
    slopes = [(other.design - here.design) / DIFFERENCE for other in others]
    return here.design, np.array(slopes).reshape(len(slopes), *here.design.shape), here.angles


def _solved(equations: Equations) -> tuple[Complex, Complex, Complex]:
    """Return the residual of equations, the unknowns, and what projects on what the unknowns can show."""
    sigma = equations.sigma
    estimator, unknowns, left = solved(equations.design, sigma, equations.values)
    return left, unknowns, (equations.design / sigma[:, :, None]) @ (estimator * sigma[:, None, :])


def unknowns_of(equations: Equations) -> tuple[Complex, Complex]:
    """Return the joints' angles and moments that the channels show, each shape (l, joints)."""
    unknowns = _solved(equations)[1]
    return np.einsum("lju,lu->lj", equations.angles, unknowns), unknowns[:, 1:]


def fit_fault(equations: Equations, fault: Fault | None = None, delayed: bool = True) -> Fit:
    """Return how well channels agree with a fault of one of them undone, its size found from where it stands.

    Parameters
    ----------
    equations : Equations
    fault : Fault, optional
        None: the structure's numbers alone are found.
    delayed : bool
        Whether its delay is found as well.
    """
    best = now = _step(equations, fault, delayed)
    # Four further rounds at most, until χ² falls by less than a ten-thousandth.
    for _ in range(4 if fault else 0):
        now = _step(equations, now[1], delayed)
        settled = now[0].chi_squared > (1 - 1e-4) * best[0].chi_squared
        best = min(best, now, key=lambda each: each[0].chi_squared)
        if settled:
            break
    return best[0]


def _step(equations: Equations, fault: Fault | None, delayed: bool) -> tuple[Fit, Fault | None]:
    """Return χ² of a fault as it stands, the numbers alone free, and the fault after a step of Gauss and Newton."""
    clean = equations if fault is None else fault.removed(equations)
    left, unknowns, onto = _solved(clean)
    changes = np.concatenate([np.einsum("klcu,lu->klc", clean.slopes, unknowns), clean.ends]) / clean.sigma
    if fault is not None:
        # By ln g and by the delay: the channel's own values turn.
        own = np.zeros_like(left)
        own[:, fault.channel] = np.where(
            clean.of(fault.run), (clean.values / clean.sigma)[:, fault.channel], 0
        )
        changes = np.concatenate([changes, [own, -1j * clean.angular[:, None] * own][: 1 + delayed]])
    columns = np.einsum("lcd,kld->klc", onto, changes) - changes
    flat = columns.reshape(len(columns), left.size)
    design = np.hstack([flat.real, flat.imag]).T
    target = np.concatenate([left.ravel().real, left.ravel().imag])
    k, free = equations.prior.size, len(columns) - equations.prior.size
    known = np.concatenate([1 / equations.prior**2, np.zeros(free)])
    normal = design.T @ design + np.diag(known)
    slope = design.T @ target + known * np.concatenate([equations.offset, np.zeros(free)])
    step = -np.linalg.lstsq(normal, slope, rcond=1e-14)[0]
    numbers = -np.linalg.solve(normal[:k, :k], slope[:k]) if free else step
    squares = ((target + design[:, :k] @ numbers) ** 2).reshape(2, len(equations.run), -1).sum(axis=(0, 2))
    total = float(squares.sum() + np.sum(((equations.offset + numbers) / equations.prior) ** 2))
    by_run = np.asarray(np.bincount(equations.run, squares), dtype=float)
    errors = np.sqrt(np.maximum(np.diag(np.linalg.pinv(normal)), 0))[k:].tolist()
    fit = Fit(fault, total, by_run, equations.offset + numbers, (*errors, 0.0, 0.0)[:2])
    if fault is None:
        return fit, None
    gain, delay = float(np.exp(np.clip(step[k], -1, 1))), float(step[-1]) if delayed else 0.0
    return fit, fault._replace(gain=fault.gain * gain, delay=fault.delay + delay)


def swapped(equations: Equations, one: int, other: int, run: int | None = None) -> Equations:
    """Return equations with two channels in each other's place, in all lines or in those of one run."""
    order = np.arange(equations.values.shape[1])
    order[[one, other]] = other, one
    rows = equations.of(run)[:, None]
    values, sigma = (np.where(rows, x[:, order], x) for x in (equations.values, equations.sigma))
    return replace(equations, values=values, sigma=sigma)


def left_out(equations: Equations, channel: int) -> Equations:
    """Return the equations without a channel."""
    keep = [c for c in range(equations.values.shape[1]) if c != channel]
    return replace(
        equations, values=equations.values[:, keep], sigma=equations.sigma[:, keep],
        design=equations.design[:, keep], slopes=equations.slopes[:, :, keep], ends=equations.ends[:, :, keep],
    )  # fmt: skip


def first_guess(equations: Equations, channel: int, run: int | None, longest: float) -> Fault:
    """Return the factor and the delay by which a channel is nearest to what all others predict of it.

    Parameters
    ----------
    equations : Equations
    channel : int
    run : int or None
        Of one run alone.
    longest : float
        Largest delay that is tried, s.
    """
    others, rows = _solved(left_out(equations, channel))[1], equations.of(run)
    shown = equations.values[rows, channel]
    expected = np.einsum("lu,lu->l", equations.design[:, channel], others)[rows]
    # Lines count as they are strong, none by more than its noise allows; for starting values a prediction is taken to
    # be off by a twentieth.
    weight = 1 / (equations.sigma[rows, channel] ** 2 + 0.05**2 * np.abs(shown) ** 2)
    delays = longest * np.linspace(-1, 1, 81)
    cross = np.real(
        (np.exp(1j * np.outer(delays, equations.angular[rows])) * shown) @ (weight * expected.conj())
    )
    at = int(np.argmax(np.abs(cross)))
    gain = float(cross[at]) / max(float(np.sum(weight * np.abs(expected) ** 2)), 1e-300)
    return Fault(channel, run, float(np.copysign(max(abs(gain), SMALLEST), gain)), float(delays[at]))
