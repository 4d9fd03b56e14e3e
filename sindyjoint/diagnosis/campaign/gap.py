"""The two gaps of a model with effects, on runs it never saw, and the noise beside which they stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sindyjoint.diagnosis.campaign.free_decay import continuation_gap
from sindyjoint.diagnosis.campaign.repair import held_out_gap, kept_gap
from sindyjoint.diagnosis.campaign.response_gap import response_gap
from sindyjoint.diagnosis.campaign.rows.build import gap_runs
from sindyjoint.diagnosis.campaign.start import Work, is_free, sample_noise
from sindyjoint.diagnosis.effects.fitted import Corrections, FittedEffect
from sindyjoint.diagnosis.result import Gap
from sindyjoint.discovery.delay import shifted
from sindyjoint.equation.model import JointModel
from sindyjoint.states import force_states


def gap_of(work: Work, model: JointModel, effects: Sequence[FittedEffect]) -> Gap:
    """Return the gaps of a model with effects.

    On runs marked for validation where there are any; else each group of runs is left out of the fit in turn, and the
    response is simulated over all. A free run is simulated from where two thirds of it end, which it was fitted to.
    """
    adding = [e for e in effects if not e.shifts]
    kept = work.campaign.validation_runs
    if kept:
        shift = Corrections.of(effects).shift
        states = [shifted(force_states(run, rate_share=work.policy.rate_share), shift) for run in kept]
        rows = gap_runs(states, model, [run.name for run in kept], work.policy)
        moment, weighted = kept_gap(
            rows, model, adding, {s.run: sample_noise(s, model.inertia) for s in states}
        )
    else:
        moment, weighted = held_out_gap(work.rows, model, adding, work.noise, work.policy)
    of_response = continuation_gap if is_free(work.campaign) and not kept else response_gap
    return Gap(moment, of_response(work, model, effects), weighted)


def noise_floor(work: Work) -> Gap:
    """Return what does not repeat, relative to the signals, over all runs."""
    weight = np.array([np.count_nonzero(s.moving) for s in work.states], dtype=float)
    noise = np.array([work.noise[s.run] for s in work.states])
    inertia = work.model.joint.inertia or 0.0
    own = np.array([np.mean(s.transfer_moment(inertia)[s.moving] ** 2) for s in work.states])
    angle = np.array([s.noise.angle for s in work.states])
    spread = np.array([np.var(s.angle) for s in work.states])
    moment = float(np.sqrt((weight @ noise**2) / (weight @ own))) if np.any(own) else 0.0
    return Gap(moment, float(np.sqrt(np.mean(angle**2) / np.mean(spread))))
