"""A campaign goes in, a joint model comes out, with a verdict on the paper's five terms."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sindyjoint.discovery.delay import ChannelDelay, estimate_delay, find_delay, shifted
from sindyjoint.discovery.input_lag import InputLag, find_lags, lag_notes
from sindyjoint.discovery.large.segments import LONGEST, SampleCount, fit_long, has_long_runs
from sindyjoint.equation.calibration import with_gain_uncertainty
from sindyjoint.equation.catalogue import DEFAULT, default_candidates
from sindyjoint.equation.model import INERTIA, JointModel
from sindyjoint.equation.without_rate import NO_DELAY, rate_free
from sindyjoint.errors import InputError
from sindyjoint.judgement.discovery import Discovery, stopped_by_data
from sindyjoint.judgement.policy import POLICY
from sindyjoint.judgement.second_search import campaign_model, search_again, softened
from sindyjoint.judgement.verdict import (
    Verdict,
    judge,
    noise_alike,
    undecided_by_data,
    undecided_without_time,
)
from sindyjoint.options import checks_options
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.parallel import Executor, check_unused, executor
from sindyjoint.record import Campaign
from sindyjoint.soundness.check import check_accepted, check_campaign
from sindyjoint.soundness.warnings import list_warnings
from sindyjoint.states import ForceStates, campaign_states, regression_rows
from sindyjoint.states.campaigns import content_hash, with_lags
from sindyjoint.text import spelled
from sindyjoint.threads import single_threaded
from sindyjoint.versions import versions

if TYPE_CHECKING:
    from sindyjoint.bias.correction import Corrected
    from sindyjoint.discovery.estimator import JointRegressor
    from sindyjoint.response.output_error_parts import Nuisance


def regressor_options() -> tuple[str, ...]:
    """Return the names of the options that a discovery passes on to its regressor."""
    from sindyjoint.discovery.estimator import JointRegressor

    return tuple(inspect.signature(JointRegressor).parameters)


@checks_options(regressor_options)
@single_threaded()
def discover(
    campaign: Campaign | str | Path | None = None,
    library: Any = "extended",
    *,
    states: str = "auto",
    bandwidth: float | None = None,
    align: bool = False,
    accept: Sequence[str] = (),
    correct: bool = True,
    paper: bool = False,
    random_state: Any = None,
    progress: Callable[[str], None] | None = None,
    jobs: int = 1,
    workers: int | None = None,
    cluster: str | None = None,
    **options: Any,
) -> Discovery:
    """Find which terms the equation of a joint has.

    Parameters
    ----------
    campaign : Campaign, path of a campaign.toml, or None
        ``None``: the built-in virtual test of the paper's inter-panel joint, which is simulated.
    library : str, Path, Catalogue, feature library of pysindy, or sequence of these
        Candidate terms; see :class:`~sindyjoint.JointRegressor`. With the default, sin θ is among them where the joint
        turns by 0.3 rad or more.
    states : {"auto", "periodic", "broadband"}
        How force states are made of signals.
    bandwidth : float, optional
        Highest frequency kept in the angle, Hz.
    align : bool
        Remove the time delay that is found between the channels.
    accept : sequence of str
        Ids of findings of the check of the data that shall not stop the work; see :func:`~sindyjoint.check`.
    correct : bool
        Simulate the model under the drive of the campaign and take out of the coefficients what noise and processing
        do to them.
    paper : bool
        Put the question of the paper's five terms first, as for the paper's joints.
    random_state : int, Generator or None
    progress : callable, optional
        Called with the name of each stage.
    jobs, workers, cluster
        Where the segments of runs that are too long for memory are processed; see
        :func:`~sindyjoint.parallel.executor`.
    **options
        Parameters of :class:`~sindyjoint.JointRegressor`: method, threshold, selection, forced, forbidden, ...

    Returns
    -------
    Discovery

    Raises
    ------
    InputError, UnknownNameError
        For data or options that cannot be used.
    """
    from sindyjoint.discovery.estimator import JointRegressor
    from sindyjoint.discovery.foreign_library import catalogue_of

    say = progress or (lambda stage: None)
    catalogue = catalogue_of(library)
    check_accepted(accept)
    if campaign is None:
        say("simulating the virtual test")
    campaign = opened = the_campaign(campaign, random_state, LONGEST)
    unused = "" if has_long_runs(campaign) else check_unused(jobs, workers, cluster)
    unused = unused and f"{unused}: not used, for no run is too long for the memory of this process"
    options.setdefault("inputs", campaign.inputs)
    if campaign.quasi_static:
        if align:
            raise InputError(f"align: {NO_DELAY}")
        catalogue, correct = rate_free(catalogue), False
    regressor = JointRegressor(catalogue, motion=campaign.joint.motion, random_state=random_state, **options)
    say("checking the data")
    checked = check_campaign(campaign, accept)
    if checked.stopping:
        return stopped_by_data(checked, regressor)
    measured_campaign, campaign = campaign, checked.usable
    prepared = _prepare(campaign, regressor, library, states, bandwidth, align, say)
    campaign, force_states, delay, lag = prepared.campaign, prepared.states, prepared.delay, prepared.lag
    say("selecting terms")
    with executor(jobs, workers, cluster) if has_long_runs(campaign) else nullcontext() as here:
        regressor, counts = _select_terms(regressor, campaign, force_states, here, bandwidth, lag, say)
    say("judging")
    model = campaign_model(regressor, campaign, force_states, counts)
    measured, note = regressor, ""
    if correct and not has_long_runs(campaign):
        again = search_again(regressor, model, campaign, force_states, counts, say)
        regressor, model, force_states, note = again.regressor, again.model, again.states, again.note
    left_in = _unresolved_delay(delay, regressor, model, force_states) if lag == 0.0 else None
    verdict = _judge_terms(regressor, measured, model, campaign, force_states, left_in, correct)
    verdict = undecided_without_time(verdict) if campaign.quasi_static else verdict
    verdict = undecided_by_data(verdict, checked.undecided_by(aligned=lag != 0.0))
    say("measuring the bias of the processing")
    fixed = _correct_model(regressor, measured, model, campaign, force_states) if correct else None
    model = fixed.model if fixed is not None else model
    told = delay if align else left_in
    model = with_gain_uncertainty(model, campaign.gain_uncertainty)
    left = (note, *lag_notes(prepared.lags), unused, _unmeasured_bias(fixed))
    warnings = list_warnings(campaign, force_states, model, told, align, regressor.indistinct_)
    return Discovery(
        model=fitted_to(model, opened),
        verdict=verdict,
        found=bool(model.terms),
        reason=regressor.selection_result_.reason,
        skew=delay,
        warnings=(*checked.warnings, *warnings, *filter(None, left)),
        states=force_states,
        regressor=regressor,
        campaign=campaign,
        bias=fixed.bias if fixed is not None else None,
        soundness=checked.soundness,
        measured=measured_campaign,
        paper=paper,
    )


class _Prepared(NamedTuple):
    """A campaign with the lags of its inputs, its force states, and the delay between its channels."""

    campaign: Campaign
    states: tuple[ForceStates, ...]
    delay: ChannelDelay | None
    lag: float
    lags: Sequence[InputLag]


def _prepare(
    campaign: Campaign,
    regressor: JointRegressor,
    library: Any,
    states: str,
    bandwidth: float | None,
    align: bool,
    say: Callable[[str], None],
) -> _Prepared:
    """Return what terms are sought in; with the default library the candidates are those of the angles reached."""
    inertia = campaign.joint.inertia
    say("force states")
    made = campaign_states(campaign, states, bandwidth)  # type: ignore[arg-type]
    if isinstance(library, str) and library == DEFAULT:
        largest = max(float(np.abs(s.angle).max()) for s in made)
        found = default_candidates(largest, campaign.joint.motion)
        regressor.set_params(library=rate_free(found) if campaign.quasi_static else found)
    if campaign.quasi_static:
        return _Prepared(campaign, made, None, 0.0, ())
    lags = find_lags(made, inertia, campaign.inputs)
    if lags:
        campaign = with_lags(campaign, {lag.name: lag.time for lag in lags})
        made = campaign_states(campaign, states, bandwidth)  # type: ignore[arg-type]
        regressor.set_params(inputs=campaign.inputs)
    say("time delay between the channels")
    delay = find_delay(made, inertia, campaign.inputs)
    lag = delay.time if align and delay is not None and delay.significant else 0.0
    return _Prepared(campaign, tuple(shifted(s, lag) for s in made), delay, lag, lags)


def _select_terms(
    regressor: JointRegressor,
    campaign: Campaign,
    states: Sequence[ForceStates],
    here: Executor | None,
    bandwidth: float | None,
    lag: float,
    say: Callable[[str], None],
) -> tuple[JointRegressor, tuple[SampleCount, ...]]:
    """Fit a regressor to force states, or to runs that are too long for memory; count the samples it saw."""
    if here is not None:
        return fit_long(regressor, campaign, states, here, bandwidth=bandwidth, lag=lag, say=say)
    regressor.fit(**regression_rows(states, campaign.joint.inertia).fit_arguments())
    return regressor, tuple(SampleCount(int(np.count_nonzero(s.moving)), s.n_samples) for s in states)


def _judge_terms(
    regressor: JointRegressor,
    measured: JointRegressor,
    model: JointModel,
    campaign: Campaign,
    states: Sequence[ForceStates],
    delay: ChannelDelay | None,
    correct: bool,
) -> Verdict:
    """Return the verdict on the paper's terms, with the delay that is left in the channels."""
    slowest = min(s.sample_rate for s in states)
    unresolved = delay if delay is not None and delay.unresolved(slowest) else None
    verdict = judge(regressor, model, measured is not regressor, unresolved)
    if correct and verdict.verdict == "refuted":
        return softened(verdict, regressor, model, campaign, states)
    return verdict


def _correct_model(
    regressor: JointRegressor,
    measured: JointRegressor,
    model: JointModel,
    campaign: Campaign,
    states: Sequence[ForceStates],
) -> Corrected:
    """Take out of a model's coefficients what the processing does to them.

    ``measured`` was fitted to the states before their completion, which has moved the coefficients: a part of that
    stays uncertain, as of any correction.
    """
    from sindyjoint.bias.correction import corrected_model
    from sindyjoint.discovery.evidence import fit_columns

    chosen = [term for term in regressor.terms_ if term.id in model]
    fitted = [term for term in chosen if term.id in regressor.evidence_.ids]
    known = [term for term in chosen if term.id not in regressor.evidence_.ids]
    moved = None
    if measured is not regressor and {term.id for term in fitted} <= set(measured.evidence_.ids):
        columns = [measured.evidence_.ids.index(term.id) for term in fitted]
        before = fit_columns(measured.evidence_, columns).coefficients
        moved = np.array([model[term.id].coefficient for term in fitted]) - before
    return corrected_model(model, fitted, campaign, states, known=known, moved=moved)


def _unmeasured_bias(fixed: Corrected | None) -> str:
    """Return a warning where the bias of the processing was to be taken out and could not be measured."""
    if fixed is None or not fixed.reason:
        return ""
    return f"the bias of the processing could not be measured ({fixed.reason}): the intervals hold the noise only"


def refined(result: Discovery, nuisance: Sequence[Nuisance] = (), **options: object) -> Discovery:
    """Return a discovery whose coefficients are refined on the simulated response, with the notes of that."""
    from sindyjoint.response.refine import refine

    if not result.found:
        return result
    refinement = refine(
        result.model,
        result.campaign,
        states=result.states,
        nuisance=nuisance,
        **options,  # type: ignore[arg-type]
    )
    apart = _warn_of_disagreement(result.model, refinement.model) if refinement.refined else ()
    # The intervals of a refinement hold noise alone.
    refined_model = refinement.model
    if refinement.refined:
        plain = replace(refined_model, fitted=replace(refined_model.fitted, gains=()))
        refined_model = with_gain_uncertainty(plain, result.campaign.gain_uncertainty)
    return replace(
        result,
        model=refined_model,
        warnings=(*result.warnings, *refinement.notes, *apart),
        # What was taken out of the coefficients of the regression says nothing of these.
        bias=None if refinement.refined else result.bias,
    )


def _warn_of_disagreement(before: JointModel, after: JointModel) -> tuple[str, ...]:
    """Return a warning for terms that regression and simulation give values that their errors do not reconcile."""
    apart = []
    for term in after.terms:
        if term.id not in before:
            continue
        other = before[term.id]
        error = float(np.hypot(term.standard_error, other.standard_error))
        if abs(term.coefficient - other.coefficient) > POLICY.refined_apart * error:
            apart.append(
                f"{spelled(term.id)} ({other.coefficient:.4g} ± {other.standard_error:.2g} by regression, "
                f"{term.coefficient:.4g} ± {term.standard_error:.2g} on the response)"
            )
    if not apart:
        return ()
    return (
        f"regression and simulated response disagree by more than {POLICY.refined_apart:g} standard errors: "
        f"{'; '.join(apart)}; the model lacks something, or samples are too few for derivatives",
    )


def the_campaign(
    campaign: Campaign | str | Path | None, random_state: Any = None, longest: int | None = None
) -> Campaign:
    """Return a campaign from itself, a file, or the built-in virtual test; of runs beyond ``longest`` a segment."""
    if isinstance(campaign, Campaign):
        return campaign
    if campaign is None:
        from sindyjoint.mechanics.virtual import virtual_campaign

        return virtual_campaign(
            "inter-panel", noise=0.01, random_state=0 if random_state is None else random_state
        )
    from sindyjoint.files import load_campaign

    return load_campaign(campaign, longest)


def fitted_to(model: JointModel, campaign: Campaign) -> JointModel:
    """Return a model that knows the campaign it was fitted to, as it was given, and by which versions."""
    return replace(model, fitted=replace(model.fitted, data=content_hash(campaign), versions=versions()))


def _unresolved_delay(
    delay: ChannelDelay | None, regressor: JointRegressor, model: JointModel, states: Sequence[ForceStates]
) -> ChannelDelay | None:
    """Return the delay that is left in the channels, or that explains the moment as well as terms beyond the paper's.

    A law that lacks a term takes a delay for it, and a delay is taken for terms: the one that leaves less is believed.
    States that lack weak harmonics show one too, that is not there once they are completed.
    """
    if delay is None or not model.terms:
        return None
    extra = [term for term in model.ids if term not in (*PAPER_TERMS, INERTIA)]
    completed = any(s.completed for s in states)
    if not extra and not completed:
        return delay if delay.significant else None
    if extra and delay.significant and not delay.at_limit and noise_alike(delay.residual_rms, model):
        return delay
    chosen = [term for term in regressor.terms_ if term.id in model]
    try:
        found = estimate_delay(states, chosen, model.joint.inertia)
    except (np.linalg.LinAlgError, InputError):
        return None
    return found if found.significant else None
