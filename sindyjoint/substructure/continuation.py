"""Following a curve of solutions by its arc length."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from sindyjoint.errors import SimulationError
from sindyjoint.numeric import Array
from sindyjoint.substructure.harmonic_balance import Balance

System = Callable[[Array], tuple[Array, Array]]
Scale = Callable[[Array], Array]

# Relative step of derivatives by a frequency.
STEP = 1e-6
# A frequency that changes by this share counts, along a curve, as much as a motion that doubles.
FREQUENCY_SHARE = 0.1
ITERATIONS = 12


@dataclass(frozen=True, eq=False)
class Solution:
    """A point of the curve: unknowns with the parameter last, Jacobian, unit tangent of the scaled unknowns."""

    unknowns: Array
    jacobian: Array
    tangent: Array
    scale: Array

    def shifted(self, change: Array, normal: Array | None = None) -> Array:
        """Return how the solution moves where the residual changes, in the hyperplane across the curve.

        Parameters
        ----------
        change : ndarray, shape (n, k)
            Derivatives of the residual by k numbers.
        normal : ndarray, shape (n + 1,), optional
            Of another hyperplane, of the unscaled unknowns.

        Returns
        -------
        ndarray, shape (n + 1, k)
        """
        row = self.tangent / self.scale if normal is None else normal
        bordered = np.vstack([self.jacobian * self.scale, row * self.scale])
        right = np.vstack([-change, np.zeros((1, change.shape[1]))])
        moved: Array = self.scale[:, None] * np.linalg.solve(bordered, right)
        return moved


def solve(
    system: System, start: Array, scale: Array, normal: Array, most: int = ITERATIONS
) -> tuple[Array, Array, int] | None:
    """Solve a system in the hyperplane through the start by Newton's method; None where that does not converge.

    Parameters
    ----------
    system : callable
        Unknowns, shape (n + 1,) → residual, shape (n,), and Jacobian, shape (n, n + 1).
    start : ndarray, shape (n + 1,)
    scale : ndarray, shape (n + 1,)
        Size of each unknown.
    normal : ndarray, shape (n + 1,)
        Of the scaled unknowns.
    most : int
        Newton steps.
    """
    y = start.copy()
    for count in range(1, most + 1):
        residual, jacobian = system(y)
        bordered = np.vstack([jacobian * scale, normal])
        try:
            step = np.linalg.solve(bordered, -np.append(residual, normal @ ((y - start) / scale)))
        except np.linalg.LinAlgError:
            return None
        if not np.isfinite(step).all():
            return None
        # A long step is cut: sticking and slipping may change more than once on its way.
        size = float(np.linalg.norm(step))
        y = y + scale * step * min(1.0, 2.0 / size if size else 1.0)
        if size <= 1e-7:
            return y, jacobian, count
    return None


# Along a curve of scaled unknowns: the first step, the least one, and so many points at most.
FIRST, SHORTEST, MOST_POINTS = 0.02, 1e-5, 1000


def follow(
    system: System, starts: Iterable[Array], scale: Scale, longest: float = 0.15
) -> Iterator[Solution]:
    """Yield the curve through a start, towards a rising parameter, at steps that the difficulty chooses.

    Pseudo-arc-length continuation (Keller, Applications of Bifurcation Theory, 1977).

    Parameters
    ----------
    system : callable
        See :func:`solve`.
    starts : iterable of ndarray, shape (n + 1,)
        Guesses of the first point, the best first; all have its parameter.
    scale : callable
        Unknowns → size of each.
    longest : float
        Step along the curve of the scaled unknowns.

    Raises
    ------
    SimulationError
        Where no solution is found.
    """
    sizes, step = np.zeros(1), FIRST
    for start in starts:
        sizes = np.maximum(sizes, scale(start))
        normal = np.eye(1, sizes.size, sizes.size - 1)[0]
        found = solve(system, start, sizes, normal, 3 * ITERATIONS)
        if found is not None:
            break
    else:
        raise SimulationError("harmonic balance finds no solution at the beginning of the curve", time=0.0)
    y, jacobian, _ = found
    sizes = scale(y)
    tangent = _tangent(jacobian * sizes, normal)
    for _ in range(MOST_POINTS):
        yield Solution(y, jacobian, tangent, sizes)
        while True:
            found = solve(system, y + step * sizes * tangent, sizes, tangent)
            if found is not None:
                break
            step /= 2
            if step < SHORTEST:
                raise SimulationError("harmonic balance finds no way on along the curve", time=0.0)
        y, jacobian, count = found
        # After a few Newton steps the next step along the curve is longer.
        step = float(np.clip(step * (1.4 if count <= 4 else 0.7 if count > 7 else 1.0), SHORTEST, longest))
        before, sizes = tangent * sizes, scale(y)
        tangent = _tangent(jacobian * sizes, before / sizes)


# Where the number of harmonics is left to the curve: as many as it is followed with, and the change of a point, as a
# share of its amplitude, that further ones may make before they are enough. A point has at most 47: they leave 0.2 %
# of a structure that its joint's friction alone damps, and twice as many take ten times as long.
FOLLOWED, ENOUGH, MOST_HARMONICS = 11, 1e-3, 47


def refined(
    curve: Callable[[Balance], tuple[System, Scale]], balance: Balance, point: Solution, first: bool = False
) -> tuple[Balance, Solution]:
    """Return a point of a curve with as many harmonics as it needs, and their balance.

    What a balance leaves out is the moment of its joints in the harmonics beyond: they are balanced as well, twice as
    many at a time, until that moves the point, across the curve, by no more than a tolerance.

    Parameters
    ----------
    curve : callable
        Balance → system and scale of :func:`follow`; the last three unknowns are those that are shown.
    balance : Balance
    point : Solution
        Of its curve.
    first : bool
        Whether it is the first.
    """
    while balance.harmonics < MOST_HARMONICS:
        finer = replace(balance, harmonics=2 * balance.harmonics + 1)
        system, scale = curve(finer)
        start, normal = (finer.padded(each, balance.harmonics) for each in (point.unknowns, point.tangent))
        sizes = scale(start)
        across = np.eye(1, start.size, start.size - 1)[0] if first else normal
        found = solve(system, start, sizes, across)
        if found is None:
            break
        unknowns, jacobian, _ = found
        moved = float(np.linalg.norm(((unknowns - start) / sizes)[-3:]))
        sizes = scale(unknowns)
        balance, point = finer, Solution(unknowns, jacobian, _tangent(jacobian * sizes, normal), sizes)
        if moved <= ENOUGH:
            break
    return balance, point


def traced(
    curve: Callable[[Balance], tuple[System, Scale]],
    balance: Balance,
    solutions: Iterable[Solution],
    of_balance: Callable[[Array], Array],
    limits: Array | float,
    refine: bool,
) -> list[tuple[Balance, Array, Solution]]:
    """Return the points of a curve up to where a joint passes its limit: their balance, its unknowns, and they.

    Parameters
    ----------
    curve, balance
        As of :func:`refined`.
    solutions : iterable of Solution
        Of the curve.
    of_balance : callable
        Unknowns of the curve → unknowns of the balance.
    limits : float or ndarray, shape (joints,)
        rad.
    refine : bool
        Whether each point is balanced with as many harmonics as it needs.
    """
    points: list[tuple[Balance, Array, Solution]] = []
    for solution in solutions:
        own, point = refined(curve, balance, solution, not points) if refine else (balance, solution)
        points.append((own, of_balance(point.unknowns), point))
        if np.any(own.peak_angles(points[-1][1]) > limits):
            break
    return points


def _tangent(jacobian: Array, before: Array) -> Array:
    """Return the unit null vector of the scaled Jacobian on the side of the one before."""
    bordered = np.vstack([jacobian, before / np.linalg.norm(before)])
    right = np.zeros(before.size)
    right[-1] = 1.0
    found = np.linalg.solve(bordered, right)
    return np.asarray(found / np.linalg.norm(found))
