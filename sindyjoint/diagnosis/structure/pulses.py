"""Which pulse would tell two effects of a structure apart: the rivals are simulated under pulses not given yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.problem import Say
from sindyjoint.diagnosis.result import Advice
from sindyjoint.diagnosis.structure.output_error import PulseProblem
from sindyjoint.diagnosis.structure.search import FittedChange
from sindyjoint.evidence.policy import POLICY as EVIDENCE
from sindyjoint.mechanics.rigs import MeasuredResponse

# Pulses that are tried, as multiples of the one that was given; that one first, which costs no further test.
FORCES = (1.0, 0.3, 3.0)


def separating_pulses(
    problem: PulseProblem, members: Sequence[FittedChange], period: float, search: Portion, say: Say
) -> tuple[tuple[Advice, ...], int, int]:
    """Return the pulse and the output point that separate the two likeliest members of a class best, if any does.

    Beside it how many pulses were tried, and of how many. The problem holds everything that was named, ``members`` the
    named effect first; the level that is advised is the peak displacement at the point, m.
    """
    mine, rival = members[:2]
    base = replace(problem, found=tuple(c for c in problem.found if c is not mine.change), _kept={})
    if mine.x.size != base.base_size + mine.change.size:
        return (), 0, len(FORCES)
    found, tried = list[Advice](), 0
    for force in FORCES:
        say(f"advice: {tried} of {len(FORCES)} pulses tried")

        def promised(force: float = force) -> list[Advice]:
            return _promised(base, mine, rival, force, float(f"{1 / period:.3g}"))

        more = search.do(promised, None, "")
        if more is None:
            break
        found, tried = [*found, *more], tried + 1
    # The first of those that promise as much: that costs least.
    best = max(found, key=lambda each: round(each.expected_confidence, 3), default=None)
    enough = best is not None and best.expected_confidence >= problem.policy.least_confidence
    return (best,) if best is not None and enough else (), tried, len(FORCES)


def _promised(
    base: PulseProblem, mine: FittedChange, rival: FittedChange, force: float, frequency: float
) -> list[Advice]:
    """Return what a pulse of so many times the force is expected to show at each point."""
    points = [name for name, row in base.rig.structure().points.items() if row.any() and name != "tip"]
    points = list(dict.fromkeys([*(r.point for r in base.records), *points]))
    rate, duration = base.records[0].sample_rate, base.duration
    rig = replace(base.rig, excitation=base.rig.excitation.scaled(force))
    blank = tuple(MeasuredResponse(p, np.zeros(round(duration * rate)), rate) for p in points)
    noise = (base.noise[0],) * len(points)
    new = replace(base, rig=rig, records=blank, noise=noise, step_error=(), _kept={})
    truth = new.simulate(new.setup(mine.x, mine.change), duration)
    if truth is None:
        return []
    measured = tuple(replace(b, displacement=signal) for b, signal in zip(blank, truth, strict=True))
    new = replace(new, records=measured)
    residual = new.residuals(rival.x, duration, rival.change)
    if residual is None:
        return []
    columns = new.derivatives(rival.x, residual, duration, range(base.base_size, rival.x.size), rival.change)
    # What columns err by is as large a share of the effect as in any search.
    inflated = 1 + (EVIDENCE.column_error * force) ** 2 * mine.gain
    pulse = "second record of the same pulse" if force == 1 else f"pulse {force:g} times as strong, measured"
    found = []
    for i, point in enumerate(points):
        rows = slice(i * truth[i].size, (i + 1) * truth[i].size)
        basis, _ = np.linalg.qr(columns[rows])
        apart = residual[rows] - basis @ (basis.T @ residual[rows])
        confidence = float(1 / (1 + np.exp(-min(0.5 * float(apart @ apart) / inflated, 50.0))))
        peak = float(f"{np.abs(truth[i]).max():.3g}")
        found.append(Advice((mine.name, rival.name), frequency, peak, f"{pulse} at {point!r}", confidence))
    return found
