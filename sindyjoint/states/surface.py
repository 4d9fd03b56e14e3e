"""The averaged force–state map: the mean moment over the plane of angle and rate (the paper, section 4.2).

On one excitation frequency the states wind round the origin on a spiral, so no surface passes through them. The
plane is therefore cut into n × n cells and the moment is averaged within each; counts say how much a cell can be
trusted. Crawley and O'Donnell (1987) introduced such maps; Masri and Caughey (1979) the restoring-force surface.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sindyjoint.errors import InputError
from sindyjoint.numeric import Array, Booleans, Integers, scaled_least_squares
from sindyjoint.states.record import ForceStates

#: Cells of a map along either axis.
MAP_CELLS = 24


@dataclass(frozen=True, eq=False)
class ForceStateMap:
    """Moments averaged over cells of the plane (θ, θ̇).

    Parameters
    ----------
    angle_edges, rate_edges : ndarray, shape (n + 1,)
        rad, rad/s; increasing. For even n zero rate is an edge, so that no cell averages over the friction step.
    count : ndarray of int, shape (n, n)
        Samples per cell; first axis angle, second axis rate.
    moment : ndarray, shape (n, n)
        Mean transfer moment, N·m; NaN where a cell is empty.
    spread : ndarray, shape (n, n)
        Standard deviation of the samples within a cell, N·m; NaN where empty.
    angle, rate : ndarray, shape (n, n)
        Mean state of the samples of a cell, rad and rad/s; NaN where empty.
    """

    angle_edges: Array
    rate_edges: Array
    count: Integers
    moment: Array
    spread: Array
    angle: Array
    rate: Array

    @property
    def n(self) -> int:
        """Cells along each axis."""
        return self.angle_edges.size - 1

    @property
    def filled(self) -> Booleans:
        """Cells that hold samples, shape (n, n)."""
        return self.count > 0

    @property
    def centres(self) -> tuple[Array, Array]:
        """Angle and rate of the middle of each cell, two arrays of shape (n, n)."""
        angle = 0.5 * (self.angle_edges[1:] + self.angle_edges[:-1])
        rate = 0.5 * (self.rate_edges[1:] + self.rate_edges[:-1])
        grid = np.meshgrid(angle, rate, indexing="ij")
        return grid[0], grid[1]


@dataclass(frozen=True)
class SurfaceFit:
    """The paper's fit of a surface to an averaged map.

    Parameters
    ----------
    coefficients : tuple of float
        k1, k2, k3, c1, M_F, SI.
    residual_rms : float
        Over the filled cells, N·m.
    cells : int
    """

    coefficients: tuple[float, ...]
    residual_rms: float
    cells: int


def force_state_map(angle: ArrayLike, rate: ArrayLike, moment: ArrayLike, n: int = 24) -> ForceStateMap:
    """Average the moment over n × n cells of the states.

    Parameters
    ----------
    angle, rate, moment : array_like, shape (m,)
        rad, rad/s, N·m.
    n : int
        Cells along each axis. The angle spans what was reached, the rate ± its largest absolute value.

    Raises
    ------
    InputError
        For signals of different length, without samples, or a number of cells below two.

    Examples
    --------
    >>> angle, rate = np.random.default_rng(0).uniform(-1, 1, (2, 9000))
    >>> force_state_map(angle, rate, 3 * angle + 0.5 * np.sign(rate)).moment.shape
    (24, 24)
    """
    theta, omega, torque = (np.asarray(signal, dtype=np.float64) for signal in (angle, rate, moment))
    if not theta.shape == omega.shape == torque.shape or theta.ndim != 1 or theta.size == 0:
        raise InputError(
            f"angle, rate and moment have shapes {theta.shape}, {omega.shape} and {torque.shape}; expected three "
            "signals of one length"
        )
    if n < 2:
        raise InputError(f"a map of {n} cells along each axis was asked for; expected at least 2")
    angle_edges = _make_edges(float(theta.min()), float(theta.max()), n)
    top = float(np.max(np.abs(omega)))
    rate_edges = _make_edges(-top, top, n)
    cell = _find_cells(theta, angle_edges) * n + _find_cells(omega, rate_edges)
    count = np.bincount(cell, minlength=n * n)

    def mean(values: Array) -> Array:
        with np.errstate(invalid="ignore"):
            return np.bincount(cell, values, minlength=n * n) / count

    average = mean(torque)
    # The deviation from the cell's mean: squares of large numbers would cancel.
    spread = np.sqrt(mean((torque - average[cell]) ** 2))
    return ForceStateMap(
        angle_edges,
        rate_edges,
        count.reshape(n, n),
        average.reshape(n, n),
        spread.reshape(n, n),
        mean(theta).reshape(n, n),
        mean(omega).reshape(n, n),
    )


def map_of_states(
    states: Sequence[ForceStates], inertia: float = 0.0, n: int = 24, moving: bool = True
) -> ForceStateMap:
    """Return the map of one or several runs.

    Parameters
    ----------
    states : sequence of ForceStates
    inertia : float
        I of the transfer moment M − I·θ̈, kg·m².
    n : int
    moving : bool
        Leave out samples in which the joint sticks: there the moment is not a function of the state. The paper
        averages them in.
    """
    keep = [s.moving if moving else np.ones(s.n_samples, dtype=bool) for s in states]
    pairs = list(zip(states, keep, strict=True))
    return force_state_map(
        np.concatenate([s.angle[k] for s, k in pairs]),
        np.concatenate([s.rate[k] for s, k in pairs]),
        np.concatenate([s.transfer_moment(inertia)[k] for s, k in pairs]),
        n,
    )


def fit_surface(surface: ForceStateMap, at: str = "centres") -> SurfaceFit:
    """Fit the paper's five terms to the cell means by least squares, each filled cell counted once.

    M_T = k1·θ + k2·θ² + k3·θ³ + c1·θ̇ + M_F·sign(θ̇) (the paper, Eq. 6).

    Parameters
    ----------
    surface : ForceStateMap
    at : {"centres", "means"}
        State to which a cell's mean moment belongs: at the middle of the cell, as a map is read, or at the mean
        state of its samples, which is less biased in cells that are half empty.

    Raises
    ------
    InputError
        For an unknown ``at``, or fewer filled cells than terms.

    Examples
    --------
    >>> grid = np.meshgrid(np.linspace(-1, 1, 40), np.linspace(-1, 1, 40))
    >>> angle, rate = grid[0].ravel(), grid[1].ravel()
    >>> fit = fit_surface(force_state_map(angle, rate, 3 * angle + 0.5 * np.sign(rate)), at="means")
    >>> [f"{abs(value):.6f}" for value in fit.coefficients]
    ['3.000000', '0.000000', '0.000000', '0.000000', '0.500000']
    """
    if at not in ("centres", "means"):
        raise InputError(f"at is {at!r}; expected 'centres' or 'means'")
    filled = surface.filled
    angle, rate = surface.centres if at == "centres" else (surface.angle, surface.rate)
    theta, omega, moment = angle[filled], rate[filled], surface.moment[filled]
    columns = np.column_stack([theta, theta**2, theta**3, omega, np.sign(omega)])
    if moment.size <= columns.shape[1]:
        raise InputError(f"{moment.size} filled cells for {columns.shape[1]} terms; expected a finer map")
    solved = scaled_least_squares(columns, moment)
    residual = moment - columns @ solved
    rms = float(np.sqrt(np.mean(residual**2)))
    return SurfaceFit(tuple(float(value) for value in solved), rms, int(moment.size))


def _make_edges(low: float, high: float, n: int) -> Array:
    """Return n + 1 increasing edges; a signal that does not vary gets a cell around it."""
    if not high > low:
        half = abs(low) * 1e-9 or 1e-30
        low, high = low - half, high + half
    return np.linspace(low, high, n + 1)


def _find_cells(values: Array, edges: Array) -> Integers:
    """Return the cell of each value; the last cell holds its upper edge too."""
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, edges.size - 2)
