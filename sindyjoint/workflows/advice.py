"""Which run would tell two effects apart: the rivals are laid along motions that nobody has measured yet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sindyjoint.discovery.model import JointModel
from sindyjoint.discrepancy.effects import Effect, MeasuredMotion
from sindyjoint.discrepancy.gap import GapRun, base_columns, slopes
from sindyjoint.discrepancy.naming import COLUMN_ERROR, TEMPER, FittedEffect, Problem, fit_effect, stack
from sindyjoint.workflows.diagnosis import Advice, Step

Array = NDArray[np.float64]

FREQUENCIES = (0.25, 0.5, 1.0, 2.0, 4.0)  # times the geometric mean of those tested
LEVELS = (0.15, 0.4, 0.7, 1.0)  # of the largest angle tested
PHASES = 240


def advise(
    rows: Sequence[GapRun],
    model: JointModel,
    found: Sequence[FittedEffect],
    steps: Sequence[Step],
    candidates: Sequence[Effect],
) -> tuple[Advice, ...]:
    """Return, for each name that has rivals in its class, the sinusoidal motion that separates it best."""
    known = {effect.id: effect for effect in candidates}
    advice = []
    for step in steps:
        rivals = [m for m in step.members if m != step.effect and m in known]
        mine = next((f for f in found if f.effect.id == step.effect), None)
        if mine is None or not rivals:
            continue
        others = [f for f in found if f is not mine and f.effect.enters != "time shift"]
        problem = Problem.build(rows, model, others)
        rival = fit_effect(problem, known[rivals[0]])
        best = _best_run(problem, rows, model, mine, rival)
        if best is not None:
            frequency, level, confidence = best
            advice.append(Advice((step.effect, rivals[0]), frequency, level, "sinusoidal angle", confidence))
    return tuple(advice)


def _best_run(
    problem: Problem, rows: Sequence[GapRun], model: JointModel, mine: FittedEffect, rival: FittedEffect
) -> tuple[float, float, float] | None:
    """Return frequency, level and expected confidence of the run on which the rivals differ most."""
    tested = [r.motion.frequency for r in rows if r.motion.frequency > 0]
    if not tested:
        return None
    middle = float(np.exp(np.mean(np.log(tested))))
    sigma = float(np.median(np.concatenate([r.sigma for r in rows])))
    angle = problem.reference.angle or 1.0
    best: tuple[float, float, float] | None = None
    blur = TEMPER + COLUMN_ERROR**2 * mine.gain
    for frequency in (middle * f for f in FREQUENCIES):
        for level in (angle * x for x in LEVELS):
            run = _sinusoid(model, frequency, level, sigma)
            difference = _separation(problem, model, run, mine, rival)
            confidence = float(1 / (1 + np.exp(-0.5 * difference / blur)))
            if best is None or confidence > best[2]:
                best = (float(f"{frequency:.3g}"), float(f"{level:.3g}"), confidence)
    return best


def _separation(
    problem: Problem, model: JointModel, run: GapRun, mine: FittedEffect, rival: FittedEffect
) -> float:
    """Return χ² left on all runs and the new one when the rival is fitted to what the named effect would make."""
    runs = [*problem.runs, run]
    truth = stack(runs, lambda r: mine.variant.along(r.motion, mine.values)) @ mine.coefficients
    columns = np.hstack(
        [
            stack(runs, lambda r: base_columns(model, r)),
            stack(runs, lambda r: rival.variant.along(r.motion, rival.values)),
        ]
    )
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    basis = left[:, singular > 1e-9 * singular[0]]
    rest = truth - basis @ (basis.T @ truth)
    return float(rest @ rest)


def _sinusoid(model: JointModel, frequency: float, level: float, sigma: float) -> GapRun:
    """Return a run of a sinusoidal angle with the noise of those measured."""
    phase = 2 * np.pi * (np.arange(PHASES) + 0.5) / PHASES
    w = 2 * np.pi * frequency
    angle, rate, acceleration = (
        level * np.sin(phase),
        level * w * np.cos(phase),
        -level * w**2 * np.sin(phase),
    )
    stiffness, damping = slopes(model, angle, rate)
    keep = np.flatnonzero(np.abs(np.cos(phase)) > 0.05)
    motion = MeasuredMotion(
        angle, rate, acceleration, 1 / (frequency * PHASES), phase / w, frequency,
        stiffness * rate + damping * acceleration, stiffness, keep, True,
    )  # fmt: skip
    one = np.full(keep.size, sigma)
    return GapRun("advised", "advised", None, motion, np.zeros(keep.size), 1 / one, one)
