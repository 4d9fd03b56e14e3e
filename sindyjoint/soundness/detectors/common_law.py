"""The law that runs may have in common: rows of their motion and moment, and its least squares."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, Self

import numpy as np

from sindyjoint.numeric import Array
from sindyjoint.soundness.cycle import Complex, Cycles, Gains, synthesise
from sindyjoint.soundness.policy import POLICY

Columns = Callable[[Array, Array], list[Array]]


@dataclass(frozen=True)
class Scale:
    """Largest angle and rate of a campaign, and least and largest inputs, by which the columns are scaled."""

    angle: float
    rate: float
    inputs: tuple[tuple[float, float], ...] = ()


def flexible_columns(a: Array, v: Array) -> list[Array]:
    """Return columns of a flexible law over scaled angle and rate.

    Powers of the angle up to the fifth, viscous, quadratic and angle-dependent damping, friction with its dependence on
    the angle.
    """
    sign = np.sign(v)
    return [
        np.ones_like(a), a, a**2, a**3, a**5, v, v * np.abs(v), a * v, a**2 * v, sign, np.abs(a) * sign, a * sign,
    ]  # fmt: skip


def wide_columns(a: Array, v: Array) -> list[Array]:
    """Return those columns, damping that differs between the directions, and stiffness that depends on the rate.

    A few mean cycles could not tell all of them from the gain of a run.
    """
    return [*flexible_columns(a, v), np.abs(v), a * v**2]


def plain_columns(a: Array, v: Array) -> list[Array]:
    """Return the columns of the paper's law and a constant."""
    return [np.ones_like(a), a, a**2, a**3, v, np.sign(v)]


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

    def left_by(self, law: Array, run: int) -> float:
        """Return the RMS that a law leaves of a run, in parts of its moment's."""
        return rms(self.target[run] - self.columns[run] @ law)


class Motions(Protocol):
    """Motion and moment of some runs: mean cycles, or samples of runs that do not repeat."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the runs."""

    @property
    def repeats(self) -> bool:
        """Whether they are mean cycles."""

    @property
    def frequency(self) -> Array | None:
        """Of the runs, Hz; None of runs that do not repeat."""

    @property
    def inputs(self) -> Array:
        """Declared inputs along the motion, shape (r, n, k)."""

    def __len__(self) -> int: ...

    def take(self, index: Sequence[int]) -> Self:
        """Return some of the runs."""

    def scaled(self, moment: Gains = 1.0, angle: Gains = 1.0) -> Self:
        """Return the runs with their moments and angles times factors, one for each run or one for all."""

    def load(self) -> Array:
        """Return the moment, shape (r, n)."""

    def motion(self) -> tuple[Array, Array, Array]:
        """Return angle, rate and acceleration, each shape (r, n)."""


@dataclass(frozen=True)
class CommonLaw:
    """A law that runs may have in common.

    Parameters
    ----------
    scale : Scale
    inertia : float or None
        kg·m²; None where it is a column.
    columns : callable
    slowest : float
        Share of a run's largest rate below which a row counts as standstill.
    """

    scale: Scale
    inertia: float | None
    columns: Columns = flexible_columns
    slowest: float = POLICY.moving_rate


def rows_of(
    cycles: Cycles, law: CommonLaw, angle: Complex | None = None, moment: Complex | None = None
) -> Rows:
    """Return the moving rows of mean cycles; other harmonics of the channels may be put in."""
    measured = cycles.load()
    load = measured if moment is None else synthesise(moment)
    return _rows(cycles.motion(angle), load, measured, cycles.inputs, law)


def rows_of_motions(motions: Motions, scale: Scale, inertia: float | None) -> Rows:
    """Return the moving rows of runs under a flexible law: where they do not repeat, a wide one."""
    load = motions.load()
    columns = flexible_columns if motions.repeats else wide_columns
    return _rows(motions.motion(), load, load, motions.inputs, CommonLaw(scale, inertia, columns))


def _rows(
    motion: tuple[Array, Array, Array], load: Array, measured: Array, inputs: Array, law: CommonLaw
) -> Rows:
    (theta, rate, acceleration), scale, inertia = motion, law.scale, law.inertia
    norm = np.std(measured, axis=1, keepdims=True)
    norm[norm == 0] = 1.0
    load = load - (inertia or 0.0) * acceleration
    moving = np.abs(rate) > law.slowest * np.abs(rate).max(axis=1, keepdims=True)
    weight = moving / norm
    built = law.columns(theta / scale.angle, rate / scale.rate)
    # Each of the paper's coefficients may depend on each input.
    offered = plain_columns(theta / scale.angle, rate / scale.rate)
    for values, (low, high) in zip(np.moveaxis(inputs, 2, 0), scale.inputs, strict=True):
        built += [column * (values - low) / (high - low) for column in offered if high > low]
    if inertia is None:
        built.append(acceleration * scale.angle / scale.rate**2)
    return Rows(np.stack(built, axis=2) * weight[:, :, None], load * weight)


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def scale_of(cycles: Motions) -> Scale:
    """Return the scale of a campaign: medians, so that one run in another unit does not set it."""
    angle, rate, _ = cycles.motion()
    swing = np.abs(angle - angle.mean(axis=1, keepdims=True)).max(axis=1)
    ends = np.moveaxis(cycles.inputs, 2, 0)
    return Scale(
        float(np.median(swing)) or 1.0,
        float(np.median(np.abs(rate).max(axis=1))) or 1.0,
        tuple((float(values.min()), float(values.max())) for values in ends),
    )


def solve(products: Array) -> tuple[Array, float]:
    """Return coefficients and residual mean square of the fit whose products are given."""
    p = len(products) - 1
    gram, right, square = products[:p, :p], products[:p, p], products[p, p]
    norms = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scaled = gram / np.outer(norms, norms) + POLICY.ridge * np.eye(p)
    coefficients = np.linalg.solve(scaled, right / norms) / norms
    rest = square - 2 * right @ coefficients + coefficients @ gram @ coefficients
    return coefficients, float(max(rest, 0.0))
