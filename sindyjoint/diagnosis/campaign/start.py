"""What a diagnosis starts from: the campaign as rows, the model fitted to it, the effects that it can show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign.change import MEMBER, changes, segments
from sindyjoint.diagnosis.campaign.processing import processing_errors, without_processing
from sindyjoint.diagnosis.campaign.repair import (
    Repaired,
    about_zero,
    model_errors,
    refit,
    refit_nonlinear,
)
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.rows.run import GapRun
from sindyjoint.diagnosis.effects.catalogue import Effect
from sindyjoint.diagnosis.effects.fitted import FittedEffect, effects_of
from sindyjoint.diagnosis.policy import CAMPAIGN, DiagnosisPolicy
from sindyjoint.equation.candidates import is_rate_free, rate_free
from sindyjoint.equation.catalogue import as_catalogue
from sindyjoint.equation.model import Fitted, JointModel
from sindyjoint.errors import InputError, UnknownNameError
from sindyjoint.record import Campaign, Run
from sindyjoint.states import (
    ForceStates,
    one_after_another,
    regression_rows,
    states_of,
    transfer_noise,
)
from sindyjoint.states.floor import moment_floor
from sindyjoint.states.harmonics import HarmonicBasis
from sindyjoint.states.periodic import kept_harmonics
from sindyjoint.states.policy import POLICY as STATES
from sindyjoint.states.record import group_labels

# Rows of all runs that are searched; more of them hardly change what is found.
SEARCHED = 6000


@dataclass(frozen=True, eq=False)
class Work:
    """A campaign on its way through the search: runs, states and rows as corrected so far.

    ``rows`` are weighted by noise and by what the model leaves beyond it, ``plain`` ones by noise alone.
    """

    campaign: Campaign
    runs: tuple[Run, ...]
    states: tuple[ForceStates, ...]
    groups: tuple[str, ...]
    model: JointModel
    rows: tuple[GapRun, ...]
    plain: tuple[GapRun, ...]
    policy: DiagnosisPolicy = CAMPAIGN

    @classmethod
    def build(
        cls,
        campaign: Campaign,
        runs: Sequence[Run],
        states: Sequence[ForceStates],
        groups: Sequence[str],
        model: JointModel,
        effects: Sequence[FittedEffect] = (),
        policy: DiagnosisPolicy = CAMPAIGN,
    ) -> Work:
        """Return the work with the rows that its states, and the model with its effects, make."""
        free = is_free(campaign)
        rows = gap_runs(states, model, groups, policy, free=free)
        errors = processing_errors(runs, states, rows, model, effects, policy)
        plain = without_processing(rows, errors)
        beyond = model_errors(plain, model, effects)
        if sum(row.target.size for row in plain) > SEARCHED:
            plain = gap_runs(states, model, groups, policy, free=free, most=SEARCHED)
        if any(beyond):
            rows = gap_runs(states, model, groups, policy, errors=beyond, free=free)
        rows = without_processing(rows, errors)
        rows, plain = (tuple(about_zero(row, model, effects) for row in each) for each in (rows, plain))
        return cls(campaign, tuple(runs), tuple(states), tuple(groups), model, rows, plain, policy)

    def again(
        self,
        model: JointModel,
        effects: Sequence[FittedEffect] = (),
        states: Sequence[ForceStates] | None = None,
    ) -> Work:
        """Return the work with another model, effects and, where channels were put right, states."""
        states = self.states if states is None else states
        return Work.build(self.campaign, self.runs, states, self.groups, model, effects, self.policy)

    def moment_rows(self) -> tuple[GapRun, ...]:
        """Return rows that are moments of the joint, in free motion too."""
        if not is_free(self.campaign):
            return self.rows
        return gap_runs(self.states, self.model, self.groups, self.policy)

    @cached_property
    def kept_states(self) -> tuple[ForceStates, ...]:
        """States of the runs kept for validation, as measured."""
        kept = self.campaign.validation_runs
        states = states_of(self.campaign, kept, rate_share=STATES.passing_rate_share)
        return one_after_another(self.campaign, states)

    @cached_property
    def harmonics(self) -> tuple[HarmonicBasis, ...]:
        """What the angles of runs that repeat are reduced to."""
        return tuple(map(kept_harmonics, self.states))

    @property
    def noise(self) -> dict[str, float]:
        """Noise of a single sample of the transfer moment, per run, N·m."""
        return {s.run: transfer_noise(s, self.model.inertia) for s in self.states}


def is_free(campaign: Campaign) -> bool:
    """Return whether no run has a measured moment."""
    return all(np.ptp(run.moment) == 0 for run in campaign.identification_runs)


def kept_out(campaign: Campaign, names: Sequence[str]) -> Campaign:
    """Return the campaign with some runs marked as kept for validation.

    UnknownNameError names one it lacks; InputError, where no other is left.
    """
    known = [run.name for run in campaign.runs]
    for name in names:
        if name not in known:
            raise UnknownNameError(f"hold_out names run {name!r}; the campaign has {', '.join(known)}")
    if set(names) == set(known):
        raise InputError("every run is kept out; expected at least one run to identify from")
    if not names:
        return campaign
    return campaign.with_runs(
        tuple(replace(r, use="validate") if r.name in names else r for r in campaign.runs)
    )


def applicable(
    campaign: Campaign, effects: Sequence[Effect], states: Sequence[ForceStates]
) -> tuple[Effect, ...]:
    """Return the effects that the campaign can show.

    In free motion there is no moment to compare with: the inertia only sets the scale of everything, and a time delay
    between the channels has no meaning. Samples without time show what does without rate. Where every run is one mean
    period, nothing is seen of what changes within it.
    """
    if campaign.quasi_static:
        return tuple(
            replace(effect, variants=variants)
            for effect in effects
            if effect.enters in ("moment", "angle zero")
            and (variants := tuple(v for v in effect.variants if is_rate_free(v)))
        )
    timed = any(s.method != "periodic" or MEMBER in s.run for s in states)
    kept = []
    for effect in effects:
        variants = tuple(v for v in effect.variants if timed or not v.uses & {"time", "elapsed"})
        if variants:
            kept.append(replace(effect, variants=variants))
    if not is_free(campaign):
        return tuple(kept)
    return tuple(e for e in kept if e.id != "inertia_error" and e.enters != "time shift")


def cut_up(
    runs: Sequence[Run],
    states: Sequence[ForceStates],
    policy: DiagnosisPolicy = CAMPAIGN,
) -> tuple[tuple[Run, ...], tuple[ForceStates, ...], tuple[str, ...]]:
    """Return runs, states and group labels of the segments of runs that change in time; whole runs otherwise."""
    labels = group_labels(states)
    if not changes(runs, states, policy):
        return tuple(runs), tuple(states), tuple(labels)
    parts = [segments(run, s, policy) for run, s in zip(runs, states, strict=True)]
    return (
        tuple(each.run for part in parts for each in part),
        tuple(each.states for part in parts for each in part),
        tuple(label for label, part in zip(labels, parts, strict=True) for _ in part),
    )


def first_model(
    campaign: Campaign,
    states: Sequence[ForceStates],
    model: JointModel | None,
    base: Any,
    policy: DiagnosisPolicy = CAMPAIGN,
    known: Sequence[Effect] = (),
) -> Repaired:
    """Return the model to start from, fitted to the campaign; its elements become effects, with their ranges."""
    from sindyjoint.discovery.regression import TermRegression

    inertia = campaign.joint.inertia
    rows = regression_rows(states, inertia, with_inputs=False)
    if model is None:
        catalogue = rate_free(as_catalogue(base)) if campaign.quasi_static else as_catalogue(base)
        fitted = (
            TermRegression(catalogue, threshold=0.0, motion=campaign.joint.motion)
            .fit(**rows.fit_arguments())
            .model_
        )
    else:
        fitted = model
    count = np.array([np.count_nonzero(s.moving) for s in states], dtype=float)
    data = Fitted(
        moment_rms=float(np.sqrt(np.mean(rows.y**2))),
        residual_rms=fitted.fitted.residual_rms,
        noise_floor=moment_floor(states, inertia).moment,
        moving_fraction=float(count.sum() / sum(s.n_samples for s in states)),
        samples=int(count.sum()),
        runs=len(states),
        angle=float(np.abs(rows.X[:, 0]).max()),
        rate=float(np.abs(rows.X[:, 1]).max()),
        frequencies=tuple(sorted({round(s.frequency, 6) for s in states if s.frequency is not None})),
        simulated=campaign.simulated,
        mean_known=campaign.mean_known,
        quasi_static=campaign.quasi_static,
    )
    effects = effects_of(fitted, known)
    start = Repaired(
        replace(fitted, joint=campaign.joint, fitted=data, inputs=campaign.inputs).without_elements(), effects
    )
    # The rows' own noise needs the slopes of a law, and the law is fitted best under that noise: twice is enough.
    # No term of a model that was given is dropped before anything is found.
    for _ in range(2):
        own = gap_runs(states, start.model, group_labels(states), policy)
        later = refit_nonlinear(own, start.model, start.effects, policy) if effects else ()
        start = refit(own, start.model, later, drops=not effects)
    return start
