"""Two effects that only show together: each alone wins little, as Coulomb friction and quadratic damping in a decay."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from sindyjoint.diagnosis.campaign.regression import GapRegression, effect_rows
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.numeric import Array


def hidden_pair(
    problem: GapRegression, fitted: Sequence[FittedEffect]
) -> tuple[FittedEffect, FittedEffect] | None:
    """Return the two effects that together win clearly more than the best one and any companion, or None.

    Nonlinear parameters stay as each effect alone has them. The first of the two is the one that wins more alone.
    """
    usable = [f for f in fitted if f.effect.enters == "moment"]
    if len(usable) < 3:
        return None
    columns = [problem.projected(effect_rows(problem.runs, f)) for f in usable]
    best = max(range(len(usable)), key=lambda i: usable[i].gain)
    gains = {
        pair: _gain([columns[i] for i in pair], problem.residual, [usable[i] for i in pair])
        for pair in combinations(range(len(usable)), 2)
    }
    greedy = max(
        [usable[best].gain, *(gain for pair, gain in gains.items() if best in pair)],
    )
    pair, gain = max(gains.items(), key=lambda item: item[1])
    if best in pair or not _clearly(problem, gain, greedy):
        return None
    first, second = sorted((usable[i] for i in pair), key=lambda f: -f.gain)
    return first, second


def _clearly(problem: GapRegression, gain: float, greedy: float) -> bool:
    """Return whether a pair clearly beats the best effect and its best companion."""
    if not problem.free:
        return gain > problem.policy.pair_gain * greedy
    # The errors of the model set the noise.
    return problem.chi_square - gain < problem.policy.pair_residual * (problem.chi_square - greedy)


def _gain(columns: Sequence[Array], residual: Array, fitted: Sequence[FittedEffect]) -> float:
    """Return by how much χ² falls with the columns of several effects together; 0 where a sign is impossible."""
    joined = np.hstack(columns)
    norm = np.linalg.norm(joined, axis=0)
    if not np.all(np.isfinite(norm)) or np.any(norm == 0):
        return 0.0
    joined = joined / norm
    products = joined.T @ joined
    if np.linalg.eigvalsh(products)[0] < 1e-6:
        return 0.0
    moments = joined.T @ residual
    coefficients = np.linalg.solve(products, moments)
    positive = [column.positive for f in fitted for column in f.variant.columns]
    if any(must and value <= 0 for must, value in zip(positive, coefficients, strict=True)):
        return 0.0
    # Two of one family that work against each other are one shape of it, and not two effects.
    if len({f.effect.family for f in fitted}) < len(fitted) == coefficients.size and np.ptp(
        np.sign(coefficients)
    ):
        return 0.0
    return float(moments @ coefficients)
