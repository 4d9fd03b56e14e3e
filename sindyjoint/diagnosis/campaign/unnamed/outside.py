"""How likely it is that what was found stands in for something that no catalogue holds.

An effect of the catalogue that is really there leaves noise. One that only resembles what is there leaves a residual,
and this has a form: a stiffness and damping that differ between frequencies or between runs, or a surface over the
state. Each form is a rival without a name, as likely as its gain allows, less what its many numbers cost (Schwarz
1978). Several effects of which none explains the gap alone are a series expansion sooner than so many faults.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from sindyjoint.diagnosis.campaign.regression import GapRegression, stack
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.campaign.unnamed.families import hats
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.numeric import Array

# A moment that no law of the joint's own frequencies makes differs between frequencies in these ways.
OF_FREQUENCY = ("inertia_error", "frequency_dependent_stiffness", "maxwell_branch", "fractional_damping")
CELLS, FINE = 6, 24


def outside_probability(
    first: GapRegression, last: GapRegression, found: Sequence[FittedEffect], terms: int = 0
) -> float:
    """Return the probability that something outside the catalogue is there.

    Parameters
    ----------
    first, last : GapRegression
        Before the first effect, and with all of them. Rows must be mean periods, whose noise is known.
    found : sequence of FittedEffect
    terms : int
        That discovery found beside them.

    Notes
    -----
    As with the ranking of effects, gains are tempered, and columns along an estimated motion err: a residual in
    proportion to what was explained is no evidence.
    """
    policy = last.policy
    explained = max(first.chi_square - last.chi_square, 0.0)
    inflated = policy.temper + policy.outside_error**2 * explained
    formed = max(gain - cost for gain, cost in unnamed_gains(last)) - policy.found_error**2 * explained
    shapeless = last.chi_square - policy.noise_known * last.degrees - policy.shapeless * explained
    nats = 0.5 * max(formed, shapeless, 0.0) / inflated
    return float(1 / (1 + np.exp(-np.clip(nats + prior(found, policy, terms), -50.0, 50.0))))


def prior(found: Sequence[FittedEffect], policy: DiagnosisPolicy = CAMPAIGN, terms: int = 0) -> float:
    """Return the logarithm of the odds that effects stand in for something else, their number alone considered.

    Errors of the channels come with any joint and count for nothing. Two effects that both only make the stiffness
    depend on frequency are one dependence that neither of them is.
    """
    own = [f for f in found if f.effect.family != "measurement"]
    one_dependence = sum(f.effect.id in OF_FREQUENCY for f in own) > 1
    return max(_odds(len(own) + terms, policy), policy.outside_prior[-1] if one_dependence else -np.inf)


def series_probability(
    found: Sequence[FittedEffect],
    terms: int,
    known: Collection[str] = (),
    policy: DiagnosisPolicy = CAMPAIGN,
) -> float:
    """Return the probability that effects and terms that explain a gap together stand in for one other law.

    By their number alone, less terms ``known`` before that come back: no residual is left that tells. They explain what
    was left out of the fit, and so it is never above ``policy.outside``, where they would be no answer.
    """
    laws = terms + sum(f.effect.family != "measurement" and f.name not in known for f in found)
    return float(min(1 / (1 + np.exp(-_odds(laws, policy))), policy.outside))


def _odds(laws: int, policy: DiagnosisPolicy) -> float:
    return policy.outside_prior[min(laws, len(policy.outside_prior) - 1)]


def unnamed_gains(problem: GapRegression) -> list[tuple[float, float]]:
    """Return by how much χ² falls with forms that have no name, and twice what their numbers cost in nats."""
    runs = problem.runs
    return [_gain(problem, stack(runs, columns)) for columns in (
        lambda run: _apart(run, [r.motion.frequency == run.motion.frequency for r in runs], runs),
        lambda run: _apart(run, [r is run for r in runs], runs, offset=True),
        lambda run: surface(run, problem.reference.angle or 1.0, problem.reference.rate or 1.0),
    )]  # fmt: skip


def _apart(run: GapRun, same: Sequence[bool], runs: Sequence[GapRun], offset: bool = False) -> Array:
    """Return θ, θ̇ (and 1) of a run in columns of the first of those runs that are the same as it."""
    own = np.column_stack([run.angle, run.rate, *([np.ones(run.target.size)] if offset else [])])
    columns = np.zeros((run.target.size, own.shape[1] * len(runs)))
    place = own.shape[1] * list(same).index(True)
    columns[:, place : place + own.shape[1]] = own
    return columns


def surface(run: GapRun, angle: float, rate: float) -> Array:
    """Return piecewise linear functions over (θ, θ̇): coarse cells of both, fine steps of each by side of slip."""
    x, v = run.angle / angle, run.rate / rate
    coarse, narrow = np.linspace(-1, 1, CELLS), np.linspace(-1, 1, FINE)
    cells = hats(x, coarse)[:, :, None] * hats(v, coarse)[:, None, :]
    forward, fine = (v > 0).astype(float)[:, None], hats(x, narrow)
    return np.hstack([cells.reshape(x.size, -1), fine * forward, fine * (1 - forward), hats(v, narrow)])


def _gain(problem: GapRegression, columns: Array) -> tuple[float, float]:
    size = np.linalg.norm(columns, axis=0)
    new = problem.projected(columns[:, size > 0])
    norm = np.linalg.norm(new, axis=0)
    kept = norm > 1e-6 * size[size > 0]
    if not kept.any():
        return 0.0, 0.0
    basis, singular, _ = np.linalg.svd(new[:, kept] / norm[kept], full_matrices=False)
    basis = basis[:, singular > 1e-6 * singular[0]]
    explained = basis.T @ problem.residual
    return float(explained @ explained), basis.shape[1] * float(np.log(problem.target.size))
