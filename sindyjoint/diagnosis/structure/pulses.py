"""Which pulse would tell two effects of a structure apart: the rivals are simulated under pulses not given yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.diagnosis.effort import Effort
from sindyjoint.diagnosis.result import Advice
from sindyjoint.diagnosis.structure.output_error import PulseProblem
from sindyjoint.diagnosis.structure.search import FittedChange
from sindyjoint.mechanics.rigs import MeasuredResponse

# Pulses that are tried, as multiples of the one that was given; that one first, which costs no further test.
FORCES = (1.0, 0.3, 3.0)


def separating_pulses(
    problem: PulseProblem, members: Sequence[FittedChange], period: float, effort: Effort
) -> tuple[Advice, ...]:
    """Return the pulse and the output point that separate the two likeliest members of a class best, if any does.

    The problem holds everything that was named, ``members`` the named effect first; the level that is advised is the
    peak displacement at the point, m.
    """
    found = _best_pulse(problem, members[0], members[1], effort)
    if found is None or found[2] < problem.policy.least_confidence:
        return ()
    force, point, confidence, level = found
    pulse = "second record of the same pulse" if force == 1 else f"pulse {force:g} times as strong, measured"
    names = (members[0].name, members[1].name)
    frequency, peak = float(f"{1 / period:.3g}"), float(f"{level:.3g}")
    return (Advice(names, frequency, peak, f"{pulse} at {point!r}", confidence),)


def _best_pulse(
    problem: PulseProblem, mine: FittedChange, rival: FittedChange, effort: Effort
) -> tuple[float, str, float, float] | None:
    """Return force, point, expected confidence and peak displacement of the pulse that separates two rivals best."""
    base = replace(problem, found=tuple(c for c in problem.found if c is not mine.change), _kept={})
    if mine.x.size != base.base_size + mine.change.size:
        return None
    points = [name for name, row in problem.rig.structure().points.items() if row.any() and name != "tip"]
    points = list(dict.fromkeys([*(r.point for r in problem.records), *points]))
    rate, duration = problem.records[0].sample_rate, problem.duration
    answer = None
    # The pulse, and it again with each of the rival's numbers a little larger.
    work = duration * rate * (1 + rival.x.size)
    effort.planned += len(FORCES)
    for count, force in enumerate(FORCES):
        effort.report(
            f"advice: {effort.tried} of {effort.planned} pulses tried",
            {"pulse": work * (len(FORCES) - count)},
        )
        if not effort.allows("pulse", work):
            break
        effort.tried += 1
        rig = replace(problem.rig, excitation=problem.rig.excitation.scaled(force))
        blank = tuple(MeasuredResponse(p, np.zeros(round(duration * rate)), rate) for p in points)
        noise = (problem.noise[0],) * len(points)
        new = replace(base, rig=rig, records=blank, noise=noise, step_error=(), _kept={})
        truth = new.simulate(new.setup(mine.x, mine.change), duration)
        if truth is None:
            continue
        measured = tuple(replace(b, displacement=signal) for b, signal in zip(blank, truth, strict=True))
        new = replace(new, records=measured)
        residual = new.residuals(rival.x, duration, rival.change)
        if residual is None:
            continue
        columns = new.derivatives(
            rival.x, residual, duration, range(base.base_size, rival.x.size), rival.change
        )
        # The same model-error inflation as in naming; the effect is as large a share of the gap as before.
        inflated = problem.policy.temper + problem.policy.column_error**2 * mine.gain * force**2
        for i, point in enumerate(points):
            rows = slice(i * truth[i].size, (i + 1) * truth[i].size)
            basis, _ = np.linalg.qr(columns[rows])
            apart = residual[rows] - basis @ (basis.T @ residual[rows])
            confidence = float(1 / (1 + np.exp(-min(0.5 * float(apart @ apart) / inflated, 50.0))))
            if answer is None or confidence > answer[2] + 1e-3:
                answer = force, point, confidence, float(np.abs(truth[i]).max())
    return answer
