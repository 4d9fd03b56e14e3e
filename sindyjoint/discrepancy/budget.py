"""What the gap is made of, and where it lies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discrepancy.gap import GapRun, row_groups
from sindyjoint.discrepancy.naming import Problem, stack

Array = NDArray[np.float64]

CELLS = (6, 6)
RANK = 1e-6  # singular values below this share of the largest are nothing
FINE = 24


@dataclass(frozen=True)
class Budget:
    """The mean square gap, relative to that of the moment, in parts that add up.

    Parameters
    ----------
    state : float
        What a function of (θ, θ̇) could still win, cross-validated: any law without memory.
    history : float
        What repeats and is no function of the state: a law with memory.
    run : float
        What differs between runs (frequency, level) and is no function of the state.
    processing : float
        What the same chain leaves of the model's own simulation.
    noise : float
        What does not repeat.
    """

    state: float
    history: float
    run: float
    processing: float
    noise: float

    @property
    def total(self) -> float:
        """Sum of the parts."""
        return self.state + self.history + self.run + self.processing + self.noise


@dataclass(frozen=True)
class Place:
    """A region that holds more of the gap than its share of the samples."""

    axis: str
    range: tuple[float, float] | str
    share: float
    words: str


def surface_columns(run: GapRun, angle: float, rate: float) -> Array:
    """Return a non-parametric basis over (θ, θ̇): cells of both, and fine steps of each alone, by side of slip.

    Piecewise linear hats; the 2-D cells carry coupling, the fine ones what changes quickly along one axis.
    """
    x, v = run.angle / angle, run.rate / rate
    coarse = _hats(x, CELLS[0])[:, :, None] * _hats(v, CELLS[1])[:, None, :]
    side = (v > 0).astype(float)[:, None]
    fine = _hats(x, FINE)
    return np.hstack([coarse.reshape(x.size, -1), fine * side, fine * (1 - side), _hats(v, FINE)])


def _hats(x: Array, count: int) -> Array:
    """Return piecewise linear hat functions with ``count`` knots on [−1, 1], shape (n, count)."""
    position = np.clip((x + 1) / 2, 0, 1) * (count - 1)
    return np.maximum(0.0, 1 - np.abs(position[:, None] - np.arange(count)[None, :]))


def run_columns(run: GapRun, index: int, count: int) -> Array:
    """Return θ, θ̇ and 1 of one run, zero for all others, shape (m, 3·count)."""
    columns = np.zeros((run.target.size, 3 * count))
    columns[:, 3 * index : 3 * index + 3] = np.column_stack([run.angle, run.rate, np.ones(run.target.size)])
    return columns


def explained_by_state(problem: Problem) -> float:
    """Return the share of χ² beyond noise that a surface over (θ, θ̇) predicts on groups left out, from 0 to 1."""
    groups = row_groups(problem.runs)
    reference = problem.reference
    columns = stack(
        problem.runs, lambda run: surface_columns(run, reference.angle or 1.0, reference.rate or 1.0)
    )
    columns = np.hstack([problem.base / np.maximum(np.linalg.norm(problem.base, axis=0), 1e-300), columns])
    left = 0.0
    for group in dict.fromkeys(groups.tolist()):
        out = groups == group
        left += _ridge_error(columns[~out], problem.target[~out], columns[out], problem.target[out])
    before = _base_held_out(problem, groups)
    return float(np.clip((before - left) / before, 0.0, 1.0)) if before > 0 else 0.0


def _base_held_out(problem: Problem, groups: NDArray[np.object_]) -> float:
    left = 0.0
    for group in dict.fromkeys(groups.tolist()):
        out = groups == group
        left += _ridge_error(
            problem.base[~out], problem.target[~out], problem.base[out], problem.target[out], 0.0
        )
    return left


def _ridge_error(
    columns: Array, target: Array, other: Array, other_target: Array, ridge: float = 1e-4
) -> float:
    """Return the squared error on held-out rows of a ridge fit; the ridge is relative to the largest column."""
    norm = np.linalg.norm(columns, axis=0)
    norm[norm < 1e-9 * norm.max()] = np.inf
    scaled = columns / norm
    # Many rows and few columns: the eigenvectors of the products are the right singular vectors.
    square, right = np.linalg.eigh(scaled.T @ scaled)
    singular = np.sqrt(np.maximum(square, 0.0))
    kept = singular > RANK * singular[-1]
    damped = np.where(kept, 1 / np.where(kept, square + ridge * square[-1], 1.0), 0.0)
    solution = right @ (damped * (right.T @ (scaled.T @ target)))
    rest = other_target - (other / norm) @ solution
    return float(rest @ rest)


def explained_by_run(problem: Problem) -> float:
    """Return the share of χ² that stiffness, damping and offset of each run's own win, above their number."""
    count = len(problem.runs)
    if count < 2:
        return 0.0
    place = {run.name: i for i, run in enumerate(problem.runs)}
    columns = stack(problem.runs, lambda run: run_columns(run, place[run.name], count))
    basis, _ = np.linalg.qr(np.hstack([problem.base / np.linalg.norm(problem.base, axis=0), columns]))
    rest = problem.target - basis @ (basis.T @ problem.target)
    won = problem.chi_square - float(rest @ rest) - 3 * count
    return float(np.clip(won / problem.chi_square, 0.0, 1.0))


def make_budget(problem: Problem, total: float, noise: float, processing: float) -> Budget:
    """Return the budget of a gap.

    Parameters
    ----------
    problem : Problem
    total, noise, processing : float
        Mean squares relative to the moment's: of the gap, of what does not repeat, of the chain.
    """
    noise = min(noise, total)
    beyond = total - noise
    processing = min(processing, beyond)
    beyond -= processing
    state = beyond * explained_by_state(problem)
    run = min(beyond - state, beyond * explained_by_run(problem))
    return Budget(state, beyond - state - run, run, processing, noise)


def where(problem: Problem, most: int = 4) -> tuple[Place, ...]:
    """Return the regions that hold most of the gap beyond noise, compared with their share of the samples."""
    excess = np.maximum(problem.residual**2 - 1.0, 0.0)
    total = float(excess.sum())
    if total <= 0:
        return ()
    runs = problem.runs
    join = {
        name: np.concatenate([getattr(r, name) for r in runs]) for name in ("angle", "rate", "acceleration")
    }
    angle, rate = (
        join["angle"] / (problem.reference.angle or 1.0),
        join["rate"] / (problem.reference.rate or 1.0),
    )
    places: list[tuple[float, Place]] = []

    def add(axis: str, mask: NDArray[np.bool_], span: tuple[float, float] | str, words: str) -> None:
        rows = float(mask.mean())
        share = float(excess[mask].sum()) / total
        if 0 < rows < 0.95 and share > 1.3 * rows and share > 0.15:
            text = f"{words}: {share:.0%} of the gap in {rows:.0%} of the samples"
            places.append((share * np.log(share / rows), Place(axis, span, share, text)))

    for axis, values, what in (("angle", np.abs(angle), "|angle|"), ("rate", np.abs(rate), "|rate|")):
        for low, high in ((0.0, 0.1), (0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.01)):
            mask = (values >= low) & (values < high)
            add(
                axis,
                mask,
                (low, min(high, 1.0)),
                f"{what} from {low:.0%} to {min(high, 1.0):.0%} of the largest",
            )
    add("side", angle > 0, "positive angle", "at positive angles")
    add("side", angle < 0, "negative angle", "at negative angles")
    add("direction", rate > 0, "forward", "in forward motion")
    add("direction", rate < 0, "backward", "in backward motion")
    after = angle * rate < 0
    add("phase", after, "after reversal", "after the reversals, on the way back to zero")
    add("phase", ~after, "before reversal", "before the reversals, on the way out")
    for axis, labels in (
        ("frequency", [f"{r.motion.frequency:.3g} Hz" if r.motion.frequency else "" for r in runs]),
        ("level", [r.level or "" for r in runs]),
        ("run", [r.name for r in runs]),
    ):
        rows = np.concatenate(
            [np.full(r.target.size, label, dtype=object) for r, label in zip(runs, labels, strict=True)]
        )
        for label in dict.fromkeys(labels):
            if label:
                add(axis, rows == label, label, f"{axis} {label}")
    places.sort(key=lambda each: -each[0])
    return tuple(place for _, place in places[:most])
