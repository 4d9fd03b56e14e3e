"""How sensors and drive of a structure agree, and which fault of one channel makes them agree better.

At each harmonic the channels are y = A·u + noise of the unknowns u, the drive and the moments of the cut-open joints
(:mod:`sindyjoint.substructure.recovery`). More sensors than joints over-determine them. With a factor g of one channel,
yᵢ/g in the place of yᵢ, or a delay, yᵢ·exp(iωτ), the residual r(g, τ, p) depends on these and on the structure's
numbers p, which are known to σ: χ² = min Σ|r|² + Σ(p/σ)², u eliminated harmonic by harmonic (variable projection:
Golub and Pereyra 1973). Noise is divided by g with its channel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import Array
from sindyjoint.substructure.ends import jump_columns
from sindyjoint.substructure.recovery import BLIND, Recovery
from sindyjoint.substructure.spectra import strongest
from sindyjoint.substructure.transfer import open_joints
from sindyjoint.substructure.update import with_numbers

Complex = NDArray[np.complex128]

# Harmonics of all runs together that are looked at, and of one run.
LINES, FEWEST_LINES, MOST_LINES = 240, 8, 60
STEP = 1e-4  # relative change by which the structure's numbers are varied
ROUNDS = 5
SETTLED = 1e-4  # relative change of χ² at which an iteration ends
SMALLEST = 1e-3  # factor below which a channel shows nothing
# Of the longest delay that is sought so many are tried, either way.
DELAYS = 40


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
        What jumps at the ends of records that do not repeat add (:mod:`sindyjoint.substructure.ends`), each of the
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

    def with_values(self, values: Complex, sigma: Array) -> Equations:
        """Return the equations of other values."""
        return replace(self, values=values, sigma=sigma)

    def of_runs(self, kept: Sequence[int]) -> Equations:
        """Return the lines of some runs."""
        rows = np.isin(self.run, kept)
        return replace(
            self, run=self.run[rows], angular=self.angular[rows], values=self.values[rows], sigma=self.sigma[rows],
            design=self.design[rows], slopes=self.slopes[:, rows], ends=self.ends[:, rows], angles=self.angles[rows],
        )  # fmt: skip


class Fault(NamedTuple):
    """A factor and a delay of one channel, in all lines or in those of one run."""

    channel: int
    run: int | None = None
    gain: float = 1.0
    delay: float = 0.0

    def lines(self, equations: Equations) -> NDArray[np.bool_]:
        """Return the lines that have it."""
        return np.ones(len(equations.run), dtype=bool) if self.run is None else equations.run == self.run

    def removed(self, equations: Equations) -> Equations:
        """Return the equations without it."""
        rows = self.lines(equations)
        values, sigma = equations.values.copy(), equations.sigma.copy()
        gain = np.copysign(max(abs(self.gain), SMALLEST), self.gain)
        values[rows, self.channel] *= np.exp(1j * equations.angular[rows] * self.delay) / gain
        sigma[rows, self.channel] /= abs(gain)
        return equations.with_values(values, sigma)


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
    each = int(np.clip(LINES // max(len(recoveries), 1), FEWEST_LINES, MOST_LINES))
    kept = [strongest(recovery.spectra, each) for recovery in recoveries]
    counts = [lines.size for _, lines in kept]
    angular = np.concatenate([lines for _, lines in kept])
    design, slopes, angles = _designs(test, angular)
    ends = _ends_of(test, recoveries, [lines for _, lines in kept])
    prior = np.concatenate([[number.uncertainty for number in test.uncertain], np.ones(len(ends))])
    return Equations(
        np.repeat(np.arange(len(kept)), counts),
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
    total, first, parts = sum(each.size for each in lines), 0, []
    for recovery, angular in zip(recoveries, lines, strict=True):
        spectra = recovery.spectra
        if recovery.ends is not None:
            shown = jump_columns(
                test.structure, test.sensors, spectra.angular, 1 / spectra.frequency, spectra.amplitudes[1:]
            )[0]
            own = np.zeros((shown.shape[2], total, shown.shape[1]), dtype=complex)
            rows = np.searchsorted(spectra.angular, angular)
            own[:, first : first + angular.size] = shown[rows].transpose(2, 0, 1)
            parts.append(own)
        first += angular.size
    return np.concatenate(parts) if parts else np.zeros((0, total, 1 + len(test.sensors)), dtype=complex)


def moved(equations: Equations, test: RigTest, numbers: Array) -> Equations:
    """Return equations whose design stands at changed numbers of the structure, on which it depends not linearly."""
    numbers = numbers[: len(test.uncertain)]
    design, slopes, angles = _designs(with_numbers(test, numbers), equations.angular)
    offset = np.concatenate([numbers, np.zeros(len(equations.ends))])
    return replace(equations, design=design, slopes=slopes, angles=angles, offset=offset)


def _designs(test: RigTest, angular: Array) -> tuple[Complex, Complex, Complex]:
    """Return the design, its derivatives by the structure's numbers, and the angles."""
    design, angles = design_of(test, angular)
    units = np.eye(len(test.uncertain))
    slopes = [(design_of(with_numbers(test, STEP * unit), angular)[0] - design) / STEP for unit in units]
    return design, np.array(slopes).reshape(len(slopes), *design.shape), angles


def design_of(test: RigTest, angular: Array) -> tuple[Complex, Complex]:
    """Return how channels and joint angles follow drive and moments at some angular frequencies."""
    transfer = open_joints(test.structure, test.at, test.sensors, angular)
    design = np.zeros((angular.size, 1 + len(test.sensors), 1 + test.structure.n_joints), dtype=complex)
    design[:, 0, 0] = 1.0
    design[:, 1:] = transfer.sensors
    return design, transfer.angles


class _Projected(NamedTuple):
    """The residual of equations, what of the numbers shows in it, and what projects."""

    left: Complex
    columns: Complex
    unknowns: Complex
    onto: Complex


def _project(equations: Equations) -> _Projected:
    weight = 1 / equations.sigma
    weighted = equations.design * weight[:, :, None]
    norms = np.linalg.norm(weighted, axis=1, keepdims=True)
    norms[norms == 0] = 1.0
    inverse = np.linalg.pinv(weighted / norms, rcond=BLIND)
    onto = (weighted / norms) @ inverse
    y = equations.values * weight
    unknowns = (inverse @ y[:, :, None])[:, :, 0] / norms[:, 0]
    left = y - (onto @ y[:, :, None])[:, :, 0]
    by_numbers = np.einsum("klcu,lu->klc", equations.slopes, unknowns)
    moved = np.concatenate([by_numbers, equations.ends]) * weight
    columns = moved - np.einsum("lcd,kld->klc", onto, moved)
    return _Projected(left, -columns, unknowns, onto)


def unknowns_of(equations: Equations) -> tuple[Complex, Complex]:
    """Return the joints' angles and moments that the channels show, each shape (l, joints)."""
    unknowns = _project(equations).unknowns
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
    k, free = equations.prior.size, 0 if fault is None else 1 + delayed
    best: Fit | None = None
    now = fault
    for _ in range(ROUNDS if free else 1):
        clean = equations if now is None else now.removed(equations)
        projected = _project(clean)
        columns = [*projected.columns]
        if now is not None:
            columns += _fault_columns(clean, projected, now)[:free]
        flat = np.array([c.ravel() for c in columns]).reshape(len(columns), projected.left.size)
        design = np.hstack([flat.real, flat.imag]).T
        target = np.concatenate([projected.left.ravel().real, projected.left.ravel().imag])
        known = np.concatenate([1 / equations.prior**2, np.zeros(free)])
        normal = design.T @ design + np.diag(known)
        slope = design.T @ target + known * np.concatenate([equations.offset, np.zeros(free)])
        if free:
            # χ² of this fault as it stands, the numbers alone free.
            numbers = -np.linalg.solve(normal[:k, :k], slope[:k])
        step = -np.linalg.lstsq(normal, slope, rcond=1e-14)[0]
        numbers = numbers if free else step
        rest = target + design[:, :k] @ numbers
        here = _fit_of(equations, now, rest, numbers, normal, free)
        if best is not None and here.chi_squared > (1 - SETTLED) * best.chi_squared:
            if here.chi_squared < best.chi_squared:
                best = here
            break
        best = here
        if now is not None:
            gain = now.gain * float(np.exp(np.clip(step[k], -1, 1)))
            now = now._replace(gain=gain, delay=now.delay + (float(step[k + 1]) if delayed else 0.0))
    assert best is not None
    return best


def _fault_columns(clean: Equations, projected: _Projected, fault: Fault) -> list[Complex]:
    """Return derivatives of the residual by ln g and by the delay."""
    rows = fault.lines(clean)
    own = np.where(rows, clean.values[:, fault.channel] / clean.sigma[:, fault.channel], 0)

    def of(change: NDArray[Any]) -> Complex:
        moved = np.zeros_like(projected.left)
        moved[:, fault.channel] = change
        return np.asarray(moved - projected.onto[:, :, fault.channel] * change[:, None])

    return [of(-own), of(1j * clean.angular * own)]


def _fit_of(
    equations: Equations, fault: Fault | None, rest: Array, numbers: Array, normal: Array, free: int
) -> Fit:
    squares = (rest**2).reshape(2, len(equations.run), -1).sum(axis=(0, 2))
    by_run = np.asarray(np.bincount(equations.run, squares), dtype=float)
    numbers = equations.offset + numbers
    total = float(squares.sum() + np.sum((numbers / equations.prior) ** 2))
    errors = np.sqrt(np.maximum(np.diag(np.linalg.pinv(normal))[-free:], 0)) if free else np.zeros(2)
    return Fit(fault, total, by_run, numbers, (float(errors[0]), float(errors[1]) if free > 1 else 0.0))


def swapped(equations: Equations, one: int, other: int, run: int | None = None) -> Equations:
    """Return equations with two channels in each other's place, in all lines or in those of one run."""
    rows = np.ones(len(equations.run), dtype=bool) if run is None else equations.run == run
    values, sigma = equations.values.copy(), equations.sigma.copy()
    at = np.flatnonzero(rows)[:, None]
    both, turned = (at, np.array([one, other])), (at, np.array([other, one]))
    values[both], sigma[both] = equations.values[turned], equations.sigma[turned]
    return equations.with_values(values, sigma)


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
    others = _project(left_out(equations, channel)).unknowns
    predicted = np.einsum("lu,lu->l", equations.design[:, channel], others)
    rows = np.ones(len(equations.run), dtype=bool) if run is None else equations.run == run
    shown, expected = equations.values[rows, channel], predicted[rows]
    # Lines count as they are strong, none by more than its noise allows.
    weight = 1 / (equations.sigma[rows, channel] ** 2 + POOR**2 * np.abs(shown) ** 2)
    delays = longest * np.linspace(-1, 1, 2 * DELAYS + 1)
    turned = np.exp(1j * np.outer(delays, equations.angular[rows])) * shown
    cross = np.real(turned @ (weight * expected.conj()))
    power = float(np.sum(weight * np.abs(expected) ** 2))
    at = int(np.argmax(np.abs(cross)))
    gain = float(cross[at]) / max(power, 1e-300)
    gain = np.copysign(max(abs(gain), SMALLEST), gain)
    return Fault(channel, run, float(gain), float(delays[at]))


# Relative error of a prediction that is taken for granted where starting values are sought.
POOR = 0.05
