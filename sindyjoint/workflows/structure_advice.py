"""Which pulse would tell two effects of a structure apart: the rivals are simulated under pulses not given yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sindyjoint.mechanics.rigs import MeasuredResponse
from sindyjoint.workflows.diagnosis import Advice
from sindyjoint.workflows.structure_naming import SIMULATION_ERROR, TEMPER, FittedChange
from sindyjoint.workflows.structure_problem import PulseProblem

Array = NDArray[np.float64]

# Pulses that are tried, as multiples of the one that was given.
FORCES = (0.2, 0.5, 2.0, 5.0)
# A pulse that would leave the rivals nearly as likely as before is no advice.
LEAST_CONFIDENCE = 0.6


def advise(
    problem: PulseProblem, classes: Sequence[Sequence[FittedChange]], period: float
) -> tuple[Advice, ...]:
    """Return, for each class, the pulse and the output point that separate its two likeliest members best.

    Parameters
    ----------
    problem : PulseProblem
        With everything that was named.
    classes : sequence of sequence of FittedChange
        The members of each named effect, itself first.
    period : float
        Of the main oscillation, s.

    Returns
    -------
    tuple of Advice
        The level is the peak displacement at the point, m.
    """
    advice = []
    for members in classes:
        if len(members) < 2:
            continue
        found = _best_pulse(problem, members[0], members[1])
        if found is not None and found[2] >= LEAST_CONFIDENCE:
            force, point, confidence, level = found
            words = f"pulse {force:g} times as strong, measured at {point}"
            names = (members[0].change.effect, members[1].change.effect)
            advice.append(Advice(names, float(f"{1 / period:.3g}"), float(f"{level:.3g}"), words, confidence))
    return tuple(advice)


def _best_pulse(
    problem: PulseProblem, mine: FittedChange, rival: FittedChange
) -> tuple[float, str, float, float] | None:
    """Return force, point, expected confidence and peak displacement of the pulse that separates two rivals best."""
    base = replace(problem, found=tuple(c for c in problem.found if c is not mine.change), _kept={})
    if mine.x.size != base.base_size + mine.change.size:
        return None
    points = [name for name, row in problem.rig.structure().points.items() if row.any()]
    rate, duration = problem.records[0].sample_rate, problem.duration
    answer = None
    for force in (1.0, *FORCES):
        rig = replace(problem.rig, excitation=problem.rig.excitation.scaled(force))
        blank = [MeasuredResponse(p, np.zeros(round(duration * rate)), rate) for p in dict.fromkeys(points)]
        new = replace(
            base,
            rig=rig,
            records=tuple(blank),
            noise=(problem.noise[0],) * len(blank),
            step_error=(),
            _kept={},
        )
        truth = new.simulate(new.setup(mine.x, mine.change), duration)
        if truth is None:
            continue
        for i, record in enumerate(blank):
            one = replace(
                new, records=(replace(record, displacement=truth[i]),), noise=(problem.noise[0],), _kept={}
            )
            left = one.residuals(rival.x, duration, rival.change)
            if left is None:
                continue
            columns = one.derivatives(
                rival.x, left, duration, range(base.base_size, rival.x.size), rival.change
            )
            basis, _ = np.linalg.qr(columns)
            rest = left - basis @ (basis.T @ left)
            # The same blur as in naming, for what is new; the effect is as large a share of the gap as before.
            apart = float(rest @ rest) / (TEMPER + SIMULATION_ERROR**2 * mine.gain * force**2)
            confidence = float(1 / (1 + np.exp(-min(0.5 * apart, 50.0))))
            if answer is None or confidence > answer[2] + 1e-3:
                answer = force, record.point, confidence, float(np.abs(truth[i]).max())
    return answer
