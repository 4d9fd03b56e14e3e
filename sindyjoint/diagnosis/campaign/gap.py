"""The two gaps of a model with effects on runs it never saw, kept out of the fit or left out, beside their noise."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from sindyjoint.diagnosis.campaign.numbers.free_decay import continuation_gap
from sindyjoint.diagnosis.campaign.numbers.whole import number_columns
from sindyjoint.diagnosis.campaign.regression import stack
from sindyjoint.diagnosis.campaign.repair import (
    about_zero,
    held_out_gap,
    modelled,
    refit,
)
from sindyjoint.diagnosis.campaign.response_gap import response_gap
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.campaign.start import Work, is_free
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect, law_of
from sindyjoint.diagnosis.result import Gap
from sindyjoint.discovery.delay import shifted
from sindyjoint.equation.element import Value
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import Enters, Nuisance, TestNuisances
from sindyjoint.errors import SindyJointError
from sindyjoint.mechanics.laws import Law
from sindyjoint.response.compared import compare_run, compared_states, corrected, pooled_errors
from sindyjoint.response.drive import prescribed
from sindyjoint.response.run import SimulatedRun, moment_scale, pooled_nrmse
from sindyjoint.states import ForceStates
from sindyjoint.states.floor import moment_floor, moment_size


def gap_of(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> Gap:
    """Return the gaps of a model with effects.

    On runs marked for validation where there are any, as a verification computes it; else each group of runs is
    left out of the fit in turn, and the response is simulated over all. A free run is simulated from where two thirds
    of it end, which it was fitted to.
    """
    adding = [e for e in effects if not e.shifts]
    if work.campaign.validation_runs:
        moment, response = pooled_errors(kept_runs(work, model, effects))
        return Gap(moment, response)
    moment = _held_out(work, model, adding)
    of_response = continuation_gap if is_free(work.campaign) else response_gap
    return Gap(moment, of_response(work, model, effects))


def moment_gap(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return the gap of the moment alone, for which nothing is simulated unless runs are kept for validation."""
    if work.campaign.validation_runs:
        return gap_of(work, model, effects).moment
    adding = [e for e in effects if not e.shifts]
    return _held_out(work, model, adding)


def _held_out(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return the moment gap on runs left out, relative to what the noise floor is."""
    size = moment_size(work.states, work.campaign.joint.inertia)
    return held_out_gap(work.rows, model, effects, work.noise, work.policy, size=size)


def gap_without(work: Work, found: Sequence[FittedEffect], names: Collection[str]) -> Gap:
    """Return the gap of the model without some of its effects, the others fitted anew."""
    kept = [f for f in found if f.name not in names]
    fitted = refit(work.rows, work.model, [f for f in kept if not f.shifts], work.policy)
    return gap_of(work, fitted.model, (*(f for f in kept if f.shifts), *fitted.effects))


def kept_rows(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> tuple[GapRun, ...]:
    """Return the moments of the runs kept for validation, with a delay among the effects removed."""
    shift = Corrections.of(effects).shift
    states = [shifted(s, shift) for s in work.kept_states]
    rows = gap_runs(states, model, [s.run for s in states], work.policy)
    return tuple(about_zero(row, model, effects) for row in rows)


def gap_rows(work: Work, model: JointModel, effects: Sequence[FittedEffect] = ()) -> tuple[GapRun, ...]:
    """Return the moments of which gaps are reported: of the runs kept for validation, or else of all."""
    return kept_rows(work, model, effects) if work.campaign.validation_runs else work.moment_rows()


def kept_misfit(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> float:
    """Return the errors on runs kept for validation, RMS in units of what noise makes expected of each row.

    √(rᵀ(I + K(JᵀJ)⁻¹Kᵀ)⁻¹r / n), r the residual of the kept rows, K and J the derivatives by all numbers of these and
    of the rows that were fitted: what the numbers' own errors predict is no misfit.
    """
    adding = [e for e in effects if not e.shifts]
    kept = kept_rows(work, model, effects)
    residual = np.concatenate([run.white(run.target - modelled(run, model, adding)) for run in kept])
    fitted, other = (
        stack(rows, lambda run: number_columns(run, model, adding)) for rows in (work.plain, kept)
    )
    scale = np.linalg.norm(fitted, axis=0)
    scale[scale == 0] = 1.0
    fitted, other = fitted / scale, other / scale
    along = other.T @ residual
    explained = along @ np.linalg.lstsq(fitted.T @ fitted + other.T @ other, along, rcond=None)[0]
    return float(np.sqrt(max(residual @ residual - explained, 0.0) / residual.size))


def noise_floor(work: Work) -> Gap:
    """Return the noise relative to the signals, over the runs of which gaps are reported; NaN where it is not known."""
    states, inertia = work.kept_states or work.states, work.model.inertia
    known = all(s.noise.motion_measured for s in states)
    response = _response_floor(states, inertia) if known else float("nan")
    return Gap(moment_floor(states, work.campaign.joint.inertia).relative, response)


def _response_floor(states: Sequence[ForceStates], inertia: float) -> float:
    """Return the noise of what answers, pooled as responses are: of the moment where the motion was the drive."""
    floors = []
    for s in states:
        if inertia > 0 and not prescribed(s, inertia=inertia):
            scale = float(np.std(s.angle))
            floors.append(("angle", s.noise.angle / scale, scale))
        else:
            scale = moment_scale(s.moment, s, inertia)
            floors.append(
                ("moment", float(np.hypot(s.noise.moment, inertia * s.noise.acceleration)) / scale, scale)
            )
    return pooled_nrmse(floors)


def kept_runs(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> list[SimulatedRun]:
    """Return the runs kept for validation beside their simulation; without those that no simulation can follow."""
    campaign = corrected(_channels(effects), work.campaign)
    runs = {run.name: run for run in campaign.validation_runs}
    timed = any(each.variant.uses & {"time", "elapsed"} for each in effects if each.effect.enters == "moment")

    def law(states: ForceStates) -> Law:
        return law_of(model, effects, states)

    found = []
    for states in compared_states(campaign, list(runs.values()), timed):
        try:
            found.append(compare_run(law, runs[states.run], states))
        except SindyJointError:
            continue  # a law that no simulation can follow: the gap says so by having no figure
    return found


def _channels(effects: Sequence[FittedEffect]) -> TestNuisances:
    """Return what effects put right in the channels; the inertia belongs to the law."""
    found = Corrections.of(effects)
    values: tuple[tuple[Enters, float], ...] = (
        ("time shift", found.shift),
        ("angle zero", found.zero),
        ("angle drift", found.drift),
    )
    made = [Nuisance(way, way, Value("", value, 0.0, (value, value), "")) for way, value in values if value]
    return TestNuisances("", nuisances=tuple(made))
