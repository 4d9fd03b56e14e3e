"""Runs held against the others: the law that all other runs have in common, and the one that departs from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from sindyjoint.numeric import Array
from sindyjoint.soundness.cycle import Complex, Cycles, synthesise
from sindyjoint.soundness.finding import Finding
from sindyjoint.soundness.policy import POLICY
from sindyjoint.soundness.words import Words

Columns = Callable[[Array, Array], list[Array]]
# Directions in which the motion that runs cover is bounded.
HULL = 32


@dataclass(frozen=True)
class Scale:
    """Largest angle and rate of a campaign, by which the columns are scaled."""

    angle: float
    rate: float


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

    def __len__(self) -> int: ...

    def take(self, index: Sequence[int]) -> Self:
        """Return some of the runs."""

    def turned(self, gain: float) -> Self:
        """Return the runs with their angles times a factor."""

    def load(self) -> Array:
        """Return the moment, shape (r, n)."""

    def motion(self) -> tuple[Array, Array, Array]:
        """Return angle, rate and acceleration, each shape (r, n)."""


M = TypeVar("M", bound=Motions)


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
    return _rows(cycles.motion(angle), load, measured, law)


def rows_of_motions(motions: Motions, scale: Scale, inertia: float | None) -> Rows:
    """Return the moving rows of runs under a flexible law: where they do not repeat, a wide one."""
    load = motions.load()
    columns = flexible_columns if motions.repeats else wide_columns
    return _rows(motions.motion(), load, load, CommonLaw(scale, inertia, columns))


def _rows(motion: tuple[Array, Array, Array], load: Array, measured: Array, law: CommonLaw) -> Rows:
    (theta, rate, acceleration), scale, inertia = motion, law.scale, law.inertia
    norm = np.std(measured, axis=1, keepdims=True)
    norm[norm == 0] = 1.0
    load = load - (inertia or 0.0) * acceleration
    moving = np.abs(rate) > law.slowest * np.abs(rate).max(axis=1, keepdims=True)
    weight = moving / norm
    built = law.columns(theta / scale.angle, rate / scale.rate)
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
    return Scale(float(np.median(swing)) or 1.0, float(np.median(np.abs(rate).max(axis=1))) or 1.0)


def solve(products: Array) -> tuple[Array, float]:
    """Return coefficients and residual mean square of the fit whose products are given."""
    p = len(products) - 1
    gram, right, square = products[:p, :p], products[:p, p], products[p, p]
    norms = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scaled = gram / np.outer(norms, norms) + POLICY.ridge * np.eye(p)
    coefficients = np.linalg.solve(scaled, right / norms) / norms
    rest = square - 2 * right @ coefficients + coefficients @ gram @ coefficients
    return coefficients, float(max(rest, 0.0))


@dataclass(frozen=True, eq=False)
class OddRuns:
    """Runs that depart from the law of the others.

    Parameters
    ----------
    index : tuple of int
    departure : float
        Least RMS that the law of the others leaves of one of their moments, in parts of it.
    common : float
        RMS that this law leaves of the others.
    """

    index: tuple[int, ...]
    departure: float
    common: float


def odd_runs(rows: Rows, size: int) -> OddRuns | None:
    """Return the runs, ``size`` of them, without which the others have a law in common as they have not with them."""
    products = rows.products
    count = len(products)
    everything = float(np.sqrt(solve(products.sum(axis=0))[1] / count))
    if everything < POLICY.run_departure / np.sqrt(count):
        return None
    best: OddRuns | None = None
    for index in combinations(range(count), size):
        others = np.delete(
            products, index, axis=0
        )  # not a difference of sums: one run may be a thousand times as large
        law, rest = solve(others.sum(axis=0))
        common = float(np.sqrt(rest / len(others)))
        if best is None or common < best.common:
            best = OddRuns(index, min(rows.left_by(law, i) for i in index), common)
    if best is None:
        return None
    alike = best.common < min(POLICY.common_misfit, POLICY.common_gain * everything)
    apart = best.departure > max(POLICY.run_departure, POLICY.run_contrast * best.common)
    return best if alike and apart else None


def find_odd_runs(cycles: M, inertia: float | None, words: Words) -> tuple[list[Finding], M]:
    """Return findings on runs that differ from the others, with what explains it, and the cycles of the others."""
    remaining = list(range(len(cycles)))
    odd: list[int] = []
    common = 0.0
    while len(remaining) >= POLICY.fewest_compared and len(odd) <= len(cycles) // 3:
        others = cycles.take(remaining)
        rows = rows_of_motions(others, scale_of(others), inertia)
        found = odd_runs(rows, 1)
        if found is None and len(remaining) >= 2 * POLICY.fewest_compared:
            found = odd_runs(rows, 2)  # two runs that have each other's channel
        if found is None:
            break
        common = found.common
        odd += [remaining[i] for i in found.index]
        remaining = [r for r in remaining if r not in odd]
    others = cycles.take(remaining)
    if not odd or len(remaining) < 2:
        return [], others
    held = Held(cycles, tuple(remaining), inertia, common)
    found_odd = [_describe(cycles.take([i]), held, words) for i in odd]
    return [
        f for i, f in zip(odd, found_odd, strict=True) if f.id != "run_differs" or held.departs(i)
    ], others


@dataclass(frozen=True, eq=False)
class Held:
    """Runs held against the law of some of them.

    Parameters
    ----------
    runs : Motions
    alike : tuple of int
        Those that have a law in common.
    inertia : float or None
    common : float
        RMS that their law leaves of them.
    """

    runs: Motions
    alike: tuple[int, ...]
    inertia: float | None
    common: float

    @cached_property
    def scale(self) -> Scale:
        """Scale of the runs that are alike."""
        return scale_of(self.runs.take(self.alike))

    @cached_property
    def law(self) -> Array:
        """Coefficients of their law."""
        return self.law_of(self.alike)

    def law_of(self, index: Sequence[int]) -> Array:
        """Return the coefficients of the law of some runs."""
        return solve(self.rows(index).products.sum(axis=0))[0]

    def rows(self, index: Sequence[int]) -> Rows:
        """Return rows of some runs."""
        return rows_of_motions(self.runs.take(index), self.scale, self.inertia)

    def departs(self, run: int) -> bool:
        """Return whether a run departs where the others can say what is expected, and its kin does not depart alike.

        No law that was fitted holds beyond the motion that it was fitted to, two runs leave open which of three is odd,
        and what all runs of a frequency show is the joint's. A few rows at the steps of friction are no departure.
        """
        rows, covered = self.rows([run]), self._covered(run)
        if len(self.alike) < POLICY.fewest_compared or np.mean(covered) < POLICY.compared_rows:
            return False
        left = np.sort(np.abs(rows.target[0] - rows.columns[0] @ self.law)[covered])
        within = rms(left[: int(np.ceil((1 - POLICY.stray_rows) * left.size))])
        return within > max(POLICY.run_departure, POLICY.run_contrast * self.common) and not self._kin_too(
            run
        )

    def _covered(self, run: int) -> NDArray[np.bool_]:
        """Return the rows whose angle and rate lie in the convex hull of the others'.

        None where no other run has as small an amplitude: a law with memory depends on it.
        """
        turn = np.linspace(0, 2 * np.pi, HULL, endpoint=False)
        ways = np.stack([np.cos(turn) / self.scale.angle, np.sin(turn) / self.scale.rate])
        angle, rate, _ = self.runs.take([run]).motion()
        others, their_rate, _ = self.runs.take(self.alike).motion()
        furthest = (np.stack([others.ravel(), their_rate.ravel()], axis=1) @ ways).max(axis=0)
        inside: NDArray[np.bool_] = np.all(np.stack([angle[0], rate[0]], axis=1) @ ways <= furthest, axis=1)
        smallest = float(np.ptp(others, axis=1).min())
        return inside & (smallest <= POLICY.same_level * float(np.ptp(angle)))

    def _kin_too(self, run: int) -> bool:
        """Return whether all other runs of its frequency depart from the law of other frequencies as well."""
        if self.runs.frequency is None:
            return False
        ratio = self.runs.frequency / self.runs.frequency[run]
        same = np.maximum(ratio, 1 / ratio) < POLICY.same_frequency
        kin = [i for i in np.flatnonzero(same).tolist() if i != run]
        rest = [i for i in self.alike if not same[i]]
        if not kin or len(rest) < 2:
            return False
        law = self.law_of(rest)
        left = [self.rows([i]).left_by(law, 0) for i in (run, *kin)]
        return min(left[1:]) > POLICY.kin_departs * left[0]


def _describe(run: Motions, held: Held, words: Words) -> Finding:
    """Return the finding: the factor on moment or angle that restores the law, or that none does."""
    law, common, scale, inertia = held.law, held.common, held.scale, held.inertia
    rows = rows_of_motions(run, scale, inertia)
    expected, target = rows.columns[0] @ law, rows.target[0]
    moment_gain = float(target @ expected / max(float(expected @ expected), 1e-300))
    after_moment = rms(target - moment_gain * expected)
    angle_gain, after_angle = _best_angle_gain(run, law, scale, inertia)
    departure = rms(target - expected)
    if min(after_moment, after_angle) > POLICY.gain_explains * min(departure, 1.0):
        return Finding(
            "run_differs",
            run.names[0],
            None,
            "biases",
            f"the law of the other runs leaves {100 * departure:.3g} % of its {words.moment}, of theirs "
            f"{100 * common:.2g} %",
            "the coefficients (k1, k3, c1, M_F) are a mean of two joints or two set-ups",
            "look at what was changed before that run; leave it out, or diagnose it apart",
        )
    on_moment = after_moment <= after_angle
    gain = moment_gain if on_moment else angle_gain
    name = "moment" if on_moment else "angle"
    if gain < 0:
        return Finding(
            "reversed_sign",
            run.names[0],
            name,
            "stops",
            f"its {words.of(name)} is that of the other runs times {gain:.3g}",
            "k1, c1 and M_F of this run have the other sign",
            "reverse the channel (gain = -1), or leave the run out",
        )
    return Finding(
        "gain_differs",
        run.names[0],
        name,
        "biases" if 0.6 < gain < 1.6 else "stops",
        f"its {words.of(name)} is {gain:.4g} times what the law of the other runs has for it (they agree within "
        f"{100 * common:.2g} %, it departs by {100 * departure:.3g} %)",
        "k1, k3, c1 and M_F are drawn towards that run",
        "compare gain and unit of that run with the others'; correct it or leave it out",
    )


def _best_angle_gain(run: Motions, law: Array, scale: Scale, inertia: float | None) -> tuple[float, float]:
    """Return the factor of the angle under which the law fits best, and the RMS that it then leaves."""

    def left(gain: float) -> float:
        return rows_of_motions(run.turned(1 / gain), scale, inertia).left_by(law, 0)

    size = float(np.abs(run.motion()[0]).max()) / scale.angle
    grid = np.concatenate([np.geomspace(0.5, 2.0, 25), np.geomspace(0.2, 5.0, 25) * size, [-1.0]])
    best = float(min(grid, key=left))
    for width in (0.06, 0.02, 0.007):
        best = float(min(best * (1 + width * np.linspace(-1, 1, 7)), key=left))
    return best, left(best)
