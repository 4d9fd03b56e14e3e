"""Which effects physics admits: friction that opposes motion, numbers within their range, no energy from nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sindyjoint.diagnosis.campaign.repair import Repaired, all_columns
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.equation.terms import Reference
from sindyjoint.text import spelled

FRICTION = "friction"


def number_complaint(fitted: FittedEffect, reference: Reference, policy: DiagnosisPolicy) -> str:
    """Return which nonlinear parameter of an effect stands at the end of its range; empty if none does.

    The data then ask for a value beyond it: another effect, or a limiting form that has a name of its own. An end that
    the catalogue calls open (a ramp that is a step) may be reached.
    """
    for parameter, value, (low, high) in zip(
        fitted.variant.parameters, fitted.values, fitted.variant.bounds(reference), strict=True
    ):
        margin = policy.bound_margin * np.log(high / low)
        ends = {"lower": np.log(value / low), "upper": np.log(high / value)}
        for end, distance in ends.items():
            if distance < margin and parameter.open != end:
                return f"{parameter.name} of {spelled(fitted.name)} stands at the {end} end of its range"
    return ""


def law_complaint(repaired: Repaired, runs: Sequence[GapRun], policy: DiagnosisPolicy) -> str:
    """Return what a model with effects does along the measured motion that no joint can; empty if nothing.

    Dry friction that pushes, or a run in which the joint gives off energy: ∮ M dθ < 0.
    """
    model, effects = repaired.model, repaired.effects
    families = [t.family for t in model.terms]
    families += [e.family for e in effects for _ in e.variant.columns]
    numbers = np.concatenate([model.coefficients, *(e.coefficients for e in effects)])
    dry = np.array([family == FRICTION for family in families])
    size = model.fitted.moment_rms
    for run in runs:
        if run.half_cycles is not None:
            continue
        columns = all_columns(run, model, effects)
        if dry.any():
            pushing = (columns[:, dry] @ numbers[dry]) * np.sign(run.rate) < -policy.admissible_share * size
            if np.mean(pushing) > policy.pushing_share:
                return f"dry friction would push along the motion in {100 * np.mean(pushing):.0f} % of {run.name}"
        power = float(np.mean((columns @ numbers) * run.rate))
        if power < -policy.admissible_share * size * float(np.sqrt(np.mean(run.rate**2))):
            return f"the joint would give off energy in {run.name}"
    return ""
