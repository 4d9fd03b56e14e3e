"""The law that runs may have in common: rows of their motion and moment, its least squares, and what undoes a fault."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sindyjoint.numeric import Array, rms
from sindyjoint.soundness.law.motions import Motions
from sindyjoint.soundness.policy import POLICY

# Ridge of the flexible law: rounding.
RIDGE = 1e-9


@dataclass(frozen=True)
class Scale:
    """Usual angle and rate of a campaign, and least and largest inputs, by which the columns are scaled."""

    angle: float
    rate: float
    inputs: tuple[tuple[float, float], ...] = ()


def scale_of(runs: Motions) -> Scale:
    """Return the scale of a campaign: medians, so that one run in another unit does not set it."""
    swing = np.abs(runs.angle - runs.angle.mean(axis=1, keepdims=True)).max(axis=1)
    ends = np.moveaxis(runs.inputs, 2, 0)
    return Scale(
        float(np.median(swing)) or 1.0,
        float(np.median(np.abs(runs.rate).max(axis=1))) or 1.0,
        tuple((float(values.min()), float(values.max())) for values in ends),
    )


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of some runs, each run's moment scaled to an RMS of one; rows of standstill are zero.

    Parameters
    ----------
    columns : ndarray, shape (r, n, p)
    target : ndarray, shape (r, n)
    """

    columns: Array
    target: Array

    @cached_property
    def products(self) -> Array:
        """Products of [columns | target] of each run, shape (r, p + 1, p + 1)."""
        both = np.concatenate([self.columns, self.target[:, :, None]], axis=2)
        return np.asarray(both.transpose(0, 2, 1) @ both) / self.target.shape[1]

    def left_by(self, law: Array, run: int = 0) -> float:
        """Return the RMS that a law leaves of a run, in parts of its moment's."""
        return rms(self.target[run] - self.columns[run] @ law)


def rows_of(runs: Motions, scale: Scale, inertia: float | None) -> Rows:
    """Return the moving rows of runs under a flexible law.

    Powers of the angle up to the fifth, viscous, quadratic and angle-dependent damping, friction with its dependence on
    the angle; of runs that do not repeat also damping that differs between the directions, and stiffness that depends
    on the rate, which a few mean cycles could not tell from the gain of a run. Each of the paper's coefficients may
    depend on each input.
    """
    a, v = runs.angle / scale.angle, runs.rate / scale.rate
    sign = np.sign(v)
    plain = [np.ones_like(a), a, a**2, a**3, v, sign]
    built = [*plain, a**5, v * np.abs(v), a * v, a**2 * v, np.abs(a) * sign, a * sign]
    built += [np.abs(v), a * v**2] if runs.frequency is None else []
    for values, (low, high) in zip(np.moveaxis(runs.inputs, 2, 0), scale.inputs, strict=True):
        built += [column * (values - low) / (high - low) for column in plain if high > low]
    if inertia is None:
        built.append(runs.acceleration * scale.angle / scale.rate**2)
    moving = np.abs(runs.rate) > POLICY.moving_rate * np.abs(runs.rate).max(axis=1, keepdims=True)
    weight = moving / np.where(runs.size == 0, 1.0, runs.size)[:, None]
    load = runs.moment - (inertia or 0.0) * runs.acceleration
    return Rows(np.stack(built, axis=2) * weight[:, :, None], load * weight)


def solve(products: Array) -> tuple[Array, float]:
    """Return coefficients and residual mean square, over the runs, of the law of some runs' products."""
    pooled = products.sum(axis=0)
    gram, right, square = pooled[:-1, :-1], pooled[:-1, -1], pooled[-1, -1]
    law = inverted(gram) @ right
    rest = square - 2 * right @ law + law @ gram @ law
    return law, float(max(rest, 0.0)) / len(products)


def inverted(gram: Array) -> Array:
    """Return the inverse of products of columns, scaled to unit norm and with a ridge."""
    norms = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scale = np.outer(norms, norms)
    return np.asarray(np.linalg.inv(gram / scale + RIDGE * np.eye(norms.size)) / scale)


def misfit(runs: Motions, inertia: float | None, scale: Scale | None = None) -> float:
    """Return the RMS that one law leaves of runs, in parts of their moments'."""
    return float(np.sqrt(solve(rows_of(runs, scale or scale_of(runs), inertia).products)[1]))


def least(left: Callable[[float], float], grid: Array) -> tuple[float, float]:
    """Return where a function of one number is least, by ever finer grids, and its value there.

    Examples
    --------
    >>> round(least(lambda x: (x - 0.3) ** 2, np.linspace(-1, 1, 7))[0], 2)
    0.3
    """
    for _ in range(4):
        values = [left(float(x)) for x in grid]
        at = int(np.argmin(values))
        best, value = float(grid[at]), float(values[at])
        grid = np.linspace(grid[max(at - 1, 0)], grid[min(at + 1, grid.size - 1)], 9)
    return best, value
