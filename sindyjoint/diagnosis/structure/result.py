"""What a diagnosis of a structure tells: gaps on what was held out, their budget and place, the verdict, the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign.budget import Budget
from sindyjoint.diagnosis.effects.structure import Change
from sindyjoint.diagnosis.result import Diagnosis, Gap, Step
from sindyjoint.diagnosis.structure.gap import RecordGap, audible_end, most, relative_gap, where
from sindyjoint.diagnosis.structure.problem import Fit, PulseProblem, fit, prior_root
from sindyjoint.diagnosis.structure.search import FittedChange, rows_of
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.mechanics.rigs import Rig
from sindyjoint.response.model_law import with_coefficients
from sindyjoint.text import spelled

# What is left in mean square, in units of noise, is noise up to this; beyond, it is something.
SIGNIFICANT_EXCESS = 1.25
# More than this share of the RMS gap left unexplained beyond noise: something unknown is there.
UNEXPLAINED = 0.25


@dataclass(frozen=True, eq=False)
class StructureDiagnosis(Diagnosis):
    """The diagnosis of a structure.

    Parameters
    ----------
    rig : str
        Its name.
    records : tuple of RecordGap
    """

    rig: str = ""
    records: tuple[RecordGap, ...] = ()


@dataclass(frozen=True, eq=False)
class State:
    """Where the loop stands: the problem with what was named, and its best numbers over the whole record."""

    problem: PulseProblem
    best: Fit
    named: tuple[FittedChange, ...] = ()


def held_out_gap(records: Sequence[RecordGap], as_given: bool = False) -> Gap:
    """Return the relative RMS of the response gap on what was held out; no moment is measured in a structure."""
    gaps = [record.gap_before if as_given else record.gap_after for record in records]
    return Gap(float("nan"), float(np.sqrt(np.mean(np.square(gaps)))))


def record_gaps(problem: PulseProblem, state: State, others: Sequence[PulseProblem]) -> list[RecordGap]:
    """Return the records that were held out, whole or in their second half, beside the simulations."""
    split = _split(problem)
    if others:
        return [gap for each in others for gap in _beside(each, state, state.best.x, 0.0, each.rig.name)]
    half = fit(state.problem, state.best.x, split, iterations=4)
    return _beside(problem, state, state.best.x if half is None else half.x, split, "")


def _split(problem: PulseProblem) -> float:
    """Return the middle of the time in which the records stand out of their noise, s."""
    ends = [
        audible_end(r.displacement, r.sample_rate, n.sigma)
        for r, n in zip(problem.records, problem.noise, strict=True)
    ]
    return 0.5 * min(max(ends), problem.duration)


def _beside(
    problem: PulseProblem, state: State, x: np.ndarray, held_from: float, name: str
) -> list[RecordGap]:
    given = problem if not problem.found else replace(problem, found=())
    before = given.simulate(given.setup(given.start()), problem.duration)
    repaired = replace(problem, found=state.problem.found)
    after = repaired.simulate(repaired.setup(x), problem.duration)
    gaps = []
    for i, (record, noise) in enumerate(zip(problem.records, problem.noise, strict=True)):
        measured = record.displacement
        stop = audible_end(measured, record.sample_rate, noise.sigma)
        held = slice(
            int(held_from * record.sample_rate),
            max(int(stop * record.sample_rate), int(held_from * record.sample_rate) + 8),
        )
        own = float(np.std(measured[held]))
        shown = (None if before is None else before[i], None if after is None else after[i])
        gaps.append(
            RecordGap(
                f"{record.point} of {name}" if name else record.point,
                np.arange(measured.size) / record.sample_rate, measured, *shown, noise.sigma, held_from,
                relative_gap(measured, shown[0], held), relative_gap(measured, shown[1], held),
                noise.sigma / own if own > 0 else float("nan"),
            )
        )  # fmt: skip
    return gaps


def noise_floor(records: Sequence[RecordGap]) -> Gap:
    """Return the noise of the records relative to their RMS over what was held out."""
    return Gap(float("nan"), float(np.sqrt(np.mean([r.noise_floor**2 for r in records]))))


def verdict_of(problem: PulseProblem, given: Fit, state: State, steps: Sequence[Step]) -> tuple[str, str]:
    """Return the verdict and its reason."""
    rows = rows_of(problem)
    first, last = given.cost / rows, state.best.cost / rows
    left = np.sqrt(max(last - 1, 0.0) / max(first - 1, 1e-9)) if last > SIGNIFICANT_EXCESS else 0.0
    if not steps:
        if last > SIGNIFICANT_EXCESS:
            return (
                "unknown",
                f"the gap is {last:.1f} times noise in mean square and no known effect explains it",
            )
        return "nothing_missing", "noise and the model's own uncertainty explain the gap"
    if left > UNEXPLAINED:
        return (
            "unknown",
            f"the effects found leave {100 * left:.0f} % of the gap (RMS) beyond noise unexplained",
        )
    classes = [step.members for step in steps if len(step.members) > 1]
    if classes:
        apart = "; ".join(" or ".join(spelled(m) for m in members) for members in classes)
        return "ambiguous", f"this record cannot tell apart: {apart}"
    return "named", "found: " + ", then ".join(spelled(step.effect) for step in steps)


def kind_of(change: Change) -> str:
    """Return the part of the budget that an effect belongs to."""
    return "run" if not change.inside else "history" if change.memory else "state"


def budget_of(problem: PulseProblem, given: Fit, state: State, drops: Sequence[tuple[str, float]]) -> Budget:
    """Return what the mean square gap is made of, relative to the records' own.

    ``state``: what memoryless effects of the joint, and its coefficients within their uncertainty, explained;
    ``history``: effects of the joint with memory; ``run``: what lies outside the joint, and what nothing explains;
    ``processing``: the time step.
    """
    start = problem.residuals(problem.start(), problem.duration)
    rows = rows_of(problem)
    own = sum(float(np.sum((r.displacement - r.displacement.mean()) ** 2)) / n.weight**2
              for r, n in zip(problem.records, problem.noise, strict=True))  # fmt: skip
    total = given.cost if start is None else float(start @ start)
    # Beside a large gap the coefficients are dragged after it: what they then win is the effects' own.
    parts = {"state": 0.0 if drops else max(total - given.cost, 0.0), "history": 0.0, "run": 0.0}
    for kind, drop in drops:
        parts[kind] += max(drop, 0.0)
    noise = min(rows, total)
    parts["run"] += max(state.best.cost - noise, 0.0)
    step = sum(float(e @ e) / n.weight**2 for e, n in zip(problem.step_error, problem.noise, strict=False))
    beyond = total - noise
    scale = beyond / max(sum(parts.values()), 1e-300)
    processing = min(step, beyond)
    scale *= 1 - processing / beyond if beyond > 0 else 0.0
    state_, history, run = (parts[k] * scale / own for k in ("state", "history", "run"))
    return Budget(state_, history, run, processing / own, noise / own)


def places_of(problem: PulseProblem, verdict: str) -> tuple[Any, ...]:
    """Return where the first gap lies; nowhere where nothing is missing."""
    shown = problem.simulate(problem.setup(problem.start()), problem.duration)
    if verdict == "nothing_missing" or shown is None:
        return ()
    places = []
    for record, noise, signal in zip(problem.records, problem.noise, shown, strict=True):
        places += where(
            record.point, record.displacement, signal, record.sample_rate, noise.sigma, len(problem.records) > 1
        )  # fmt: skip
    return most(places)


def model_after(state: State) -> JointModel:
    """Return the model with its coefficients and covariance beside the effects."""
    model = state.problem.model
    kept = [i for i, term in enumerate(model.terms) if term.id != INERTIA]
    root = prior_root(model)
    values = model.coefficients.copy()
    values[kept] += root @ state.best.x[2 : state.problem.priors]
    normal = state.best.jacobian.T @ state.best.jacobian
    scale = np.sqrt(np.diag(normal))
    scale[scale == 0] = 1.0
    inverse = np.linalg.pinv(normal / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale)
    covariance = np.asarray(model.covariance, dtype=np.float64).reshape(values.size, -1).copy()
    own = slice(2, state.problem.priors)
    covariance[np.ix_(kept, kept)] = root @ inverse[own, own] @ root.T
    return with_coefficients(model, values, (covariance + covariance.T) / 2)


def warnings_of(
    rig: Rig,
    hidden: str | None,
    drawn: bool,
    records: Sequence[RecordGap],
    others: Sequence[PulseProblem],
    state: State,
) -> list[str]:
    """Return what to know before believing the diagnosis."""
    lines = []
    if hidden is not None:
        lines.append("the response is simulated (a virtual pulse test of the rig), not measured")
    if drawn:
        lines.append("no model was given: the terms of the rig's own joint were taken as known to 0.5 %")
    if not others:
        lines.append(
            f"one pulse only: the gaps are those of a fit to the first {records[0].held_from:.3g} s, told on the rest"
        )
    for record, noise in zip(state.problem.records, state.problem.noise, strict=True):
        if noise.length > 3:
            lines.append(
                f"the noise at {record.point} is not white: {noise.length:.3g} neighbouring samples count as one"
            )
    for error, noise in zip(state.problem.step_error, state.problem.noise, strict=False):
        if np.sqrt(np.mean(error**2)) > 3 * noise.sigma:
            lines.append(f"the time step of {rig.step:g} s is coarse for this noise; reduce step in [output]")
            break
    return lines
