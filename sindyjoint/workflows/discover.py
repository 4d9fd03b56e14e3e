"""A campaign goes in, checked; a joint model comes out, with a verdict on the paper's terms; of a rig, its joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from sindyjoint.clock import single_threaded
from sindyjoint.discovery.delay import ChannelDelay, find_delay, without_delay
from sindyjoint.discovery.long_runs import fit_long, has_long_runs
from sindyjoint.discovery.regression import TermRegression
from sindyjoint.equation.calibration import with_gain_uncertainty
from sindyjoint.equation.candidates import NO_DELAY, catalogue_of, rate_free
from sindyjoint.equation.catalogue import DEFAULT, default_candidates
from sindyjoint.equation.model import INERTIA
from sindyjoint.equation.test_record import TestNuisances, channel_delay
from sindyjoint.errors import InputError, checks_options
from sindyjoint.files.campaign import LONGEST
from sindyjoint.judgement.discovery import Discovery, fitted_to, stopped_by_data
from sindyjoint.judgement.over_inputs import InputLag, find_lags, lag_notes
from sindyjoint.judgement.term_search import (
    TermSearch,
    campaign_model,
    denies_inertia,
    error_left_out,
    inertia_notes,
    may_lack_inertia,
    on_response,
    search_completed,
    search_response,
    searched,
    with_delay_uncertainty,
    with_omissions,
)
from sindyjoint.judgement.verdict import (
    Verdict,
    judge,
    leaves_noise,
    undecided_by_data,
    undecided_without_time,
    unresolved_delay,
)
from sindyjoint.mechanics.rig_test import RigTest
from sindyjoint.numeric import RNG
from sindyjoint.parallel import Executor, check_unused, executor
from sindyjoint.record import Campaign
from sindyjoint.soundness.check import (
    check_accepted,
    check_data,
    require_sound,
)
from sindyjoint.soundness.warnings import list_warnings
from sindyjoint.states import (
    ForceStates,
    campaign_states,
    content_hash,
    with_lags,
    with_later_motion,
)
from sindyjoint.workflows.check import the_campaign

if TYPE_CHECKING:
    from sindyjoint.judgement.rig_discovery import RigDiscovery


def regressor_options() -> tuple[str, ...]:
    """Return the names of the options that a discovery passes on to its regressor."""
    return TermRegression.parameters()


@checks_options(regressor_options)
@single_threaded()
def discover(
    campaign: Campaign | str | Path | Any = None,
    library: Any = "extended",
    *,
    states: str = "auto",
    bandwidth: float | None = None,
    align: bool = False,
    accept: Sequence[str] = (),
    correct: bool = True,
    paper: bool = False,
    rng: RNG = None,
    progress: Callable[[str], None] | None = None,
    jobs: int = 1,
    workers: int | None = None,
    cluster: str | None = None,
    **options: Any,
) -> Discovery:
    """Find which terms the equation of a joint has.

    Parameters
    ----------
    campaign : Campaign, path of a campaign.toml, data frame or several by name, or None
        A frame as in :meth:`~sindyjoint.Campaign.from_frames`, with units in the names or attributes of its columns.
        ``None``: the built-in virtual test of the paper's inter-panel joint, which is simulated.
    library : str, Path, Catalogue, feature library of pysindy, or sequence of these
        Candidate terms; see :class:`~sindyjoint.JointRegressor`. With the default, sin θ is among them where the joint
        turns by 0.3 rad or more.
    states : {"auto", "periodic", "broadband"}
        How force states are made of signals.
    bandwidth : float, optional
        Highest frequency kept in the angle, Hz.
    align : bool
        Remove the time delay between the channels whatever the law found leaves; by default one with which it leaves no
        more than noise, and needs no more terms, or with which fewer terms predict better what was left out.
    accept : sequence of str
        Ids of findings of the check of the data that shall not stop the work; see :func:`~sindyjoint.check`.
    correct : bool
        Choose the terms again on force states that are completed, by a simulation of the model, with the part of the
        motion that their processing cuts off; of a free motion then on the simulated response, to which the numbers
        of all runs that do not repeat are fitted in the end.
    paper : bool
        Put the question of the paper's five terms first, as for the paper's joints.
    rng : int, Generator or None
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

    Examples
    --------
    >>> import sindyjoint
    >>> test = sindyjoint.simulate(frequencies=[3, 5], levels=[0.9, 0.5], duration=3.0, rng=0)
    >>> found = sindyjoint.discover(test, "paper", correct=False)
    >>> found.model.ids
    ('linear_stiffness', 'quadratic_stiffness', 'cubic_stiffness', 'linear_damping', 'coulomb_friction')
    >>> print(found.model.equation())
    M = I·θ̈ + k1·θ + k2·θ² + k3·θ³ + c1·θ̇ + M_F·sgn(θ̇)
    """
    say = progress or (lambda stage: None)
    catalogue = catalogue_of(library)
    check_accepted(accept)
    if campaign is None:
        say("simulating the virtual test")
    campaign = the_campaign(campaign, rng, LONGEST)
    unused = "" if has_long_runs(campaign) else check_unused(jobs, workers, cluster)
    options.setdefault("inputs", campaign.inputs)
    if campaign.quasi_static:
        if align:
            raise InputError(f"align: {NO_DELAY}")
        catalogue, correct = rate_free(catalogue), False
    regressor = TermRegression(catalogue, motion=campaign.joint.motion, random_state=rng, **options)
    say("checking the data")
    checked = check_data(campaign, accept)
    if checked.stopping:
        return stopped_by_data(checked, regressor)
    make_states = partial(campaign_states, method=states, bandwidth=bandwidth)  # type: ignore[arg-type]
    prepared = started = _prepare(checked.usable, regressor, library, make_states, align, say)
    say("selecting terms")
    long = has_long_runs(prepared.campaign)
    with executor(jobs, workers, cluster) if long else nullcontext() as here:

        def find(
            fresh: TermRegression, prepared: _Prepared
        ) -> tuple[TermSearch, Verdict, ChannelDelay | None]:
            first = _select_terms(fresh, prepared, here, bandwidth, say)
            best = search_completed(first, prepared.moved, say) if correct and not long else first
            free = correct and not long and best.model.terms and prepared.campaign.moves_freely
            by_response = search_response(best, prepared.moved, say) if free else best
            best = with_omissions(best) if by_response is best else by_response
            return best, *_judge_terms(best, prepared)

        best, verdict, left_in = find(regressor, prepared)
        if left_in is not None and not left_in.at_limit:
            say("removing the time delay between the channels")
            without = prepared.without(left_in)
            again = find(regressor.again(), without)
            if align or _is_simpler(again[0], best):
                prepared, (best, verdict, left_in) = without, again
        declared = campaign.joint.inertia
        if correct and not long and declared and may_lack_inertia(best, prepared.campaign, prepared.lag):
            say("looking at the declared inertia")
            freed = started._replace(
                campaign=replace(started.campaign, joint=replace(campaign.joint, inertia=None))
            )
            again = find(regressor.again(), freed)
            # At one frequency it is no column of its own.
            if INERTIA not in again[0].model and INERTIA in again[0].regressor.evidence_.ids:
                fresh = regressor.again()
                fresh.forced = (*fresh.forced, INERTIA)
                again = find(fresh, freed)
            if denies_inertia(again[0], best, declared, prepared.lag):
                prepared, (best, verdict, left_in) = freed, again
        if correct and not long:
            best = on_response(best, prepared.moved, say)
    delay = prepared.delay if prepared.lag else left_in
    model = with_delay_uncertainty(best, delay) if prepared.lag and delay is not None else best.model
    model = with_gain_uncertainty(model, prepared.campaign.gain_uncertainty)
    aligned, alike = prepared.lag != 0.0, best.regressor.indistinct_
    verdict = undecided_by_data(verdict, checked.undecided_by(aligned))
    warnings = list_warnings(prepared.campaign, best.states, model, delay, aligned, alike)
    if aligned and delay is not None:
        removed = channel_delay(prepared.lag, delay.standard_error)
        model = replace(model, test=TestNuisances(content_hash(campaign), campaign.joint.name, (removed,)))
    return Discovery(
        model=fitted_to(model, campaign),
        verdict=verdict,
        found=bool(model.terms),
        reason=best.regressor.selection_result_.reason,
        skew=prepared.delay,
        warnings=(
            *checked.warned(aligned),
            *inertia_notes(campaign, model),
            *warnings,
            *lag_notes(prepared.lags),
            *[f"{unused}: not used, for no run is too long for the memory of this process"] * bool(unused),
        ),
        states=best.states,
        regressor=best.regressor,
        campaign=prepared.campaign,
        soundness=checked.soundness,
        measured=campaign,
        paper=paper,
        lag=prepared.lag,
    )


class _Prepared(NamedTuple):
    """A campaign with the lags of its inputs, its force states, and the delay between its channels."""

    campaign: Campaign
    make_states: Callable[[Campaign], tuple[ForceStates, ...]]
    states: tuple[ForceStates, ...]
    delay: ChannelDelay | None = None
    lag: float = 0.0
    lags: Sequence[InputLag] = ()

    def without(self, delay: ChannelDelay) -> _Prepared:
        """Return it with a delay between the channels removed: states made anew, on the clock of the runs."""
        aligned = without_delay(self.campaign, delay)
        states = tuple(
            replace(made, time=made.time + (run.n_samples - late.n_samples) / 2 / run.sample_rate)
            for made, run, late in zip(
                self.make_states(aligned),
                self.campaign.identification_runs,
                aligned.identification_runs,
                strict=True,
            )
        )
        return self._replace(states=states, delay=delay, lag=delay.time)

    @property
    def moved(self) -> Campaign:
        """The campaign with its motion where that of the states is."""
        runs = tuple(with_later_motion(run, self.lag) for run in self.campaign.runs)
        return replace(self.campaign, runs=runs) if self.lag else self.campaign


def _prepare(
    campaign: Campaign,
    regressor: TermRegression,
    library: Any,
    make_states: Callable[[Campaign], tuple[ForceStates, ...]],
    align: bool,
    say: Callable[[str], None],
) -> _Prepared:
    """Return what terms are sought in; with the default library the candidates are those of the angles reached."""
    inertia = campaign.joint.inertia
    say("force states")
    made = make_states(campaign)
    if isinstance(library, str) and library == DEFAULT:
        largest = max(float(np.abs(s.angle).max()) for s in made)
        found = default_candidates(largest, campaign.joint.motion)
        regressor.library = rate_free(found) if campaign.quasi_static else found
    if campaign.quasi_static:
        return _Prepared(campaign, make_states, made)
    lags = find_lags(made, inertia, campaign.inputs)
    if lags:
        campaign = with_lags(campaign, {lag.name: lag.time for lag in lags})
        made = make_states(campaign)
        regressor.inputs = campaign.inputs
    say("time delay between the channels")
    delay = find_delay(made, inertia, campaign.inputs)
    prepared = _Prepared(campaign, make_states, made, delay, lags=lags)
    return prepared.without(delay) if align and delay is not None and delay.significant else prepared


def _select_terms(
    regressor: TermRegression,
    prepared: _Prepared,
    here: Executor | None,
    bandwidth: float | None,
    say: Callable[[str], None],
) -> TermSearch:
    """Fit a regressor to force states, or to runs that are too long for memory."""
    campaign, states = prepared.campaign, prepared.states
    if here is None:
        return searched(regressor, campaign, states)
    regressor, counts = fit_long(
        regressor, campaign, states, here, bandwidth=bandwidth, lag=prepared.lag, say=say
    )
    return TermSearch(regressor, campaign_model(regressor, campaign, states, counts), states)


def _is_simpler(aligned: TermSearch, plain: TermSearch) -> bool:
    """Return whether a law found with a delay removed is better than that with which the delay was found.

    What a law lacks looks like a delay, too. Believed is one with which noise alone is left, where without it more is
    left or as many terms are asked for; and one with which fewer terms predict better what was left out.
    """
    fewer = len(plain.model.terms) - len(aligned.model.terms)
    if leaves_noise(aligned.model):
        return fewer >= 0 or not leaves_noise(plain.model)
    return fewer > 0 and error_left_out(aligned) < error_left_out(plain)


def _judge_terms(found: TermSearch, prepared: _Prepared) -> tuple[Verdict, ChannelDelay | None]:
    """Return the verdict on the paper's terms, and the delay that is left in the channels."""
    regressor, model, states = found.regressor, found.model, found.states
    left = unresolved_delay(prepared.delay, regressor, model, states) if prepared.lag == 0.0 else None
    slowest = min(s.sample_rate for s in states)
    unresolved = left if left is not None and left.unresolved(slowest) else None
    verdict = judge(regressor, model, unresolved)
    return (undecided_without_time(verdict) if prepared.campaign.quasi_static else verdict), left


@checks_options(regressor_options)
def discover_rig(
    rig: RigTest | str | Path,
    library: Any = "extended",
    *,
    accept: Sequence[str] = (),
    refine: bool | None = None,
    rng: RNG = None,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> RigDiscovery:
    """Find the law of the joints in an assembled structure from its sensors.

    Parameters
    ----------
    rig : RigTest, str or Path
        Or a ``rig.toml`` with sensors and runs.
    library
        Candidate terms, as for :func:`~sindyjoint.discover`.
    accept : sequence of str
        Ids of findings of the check of the data that shall not stop the work; see :func:`~sindyjoint.check`.
    refine : bool
        Fit the laws' numbers, and the structure's uncertain ones, to the simulated response of the runs in the end;
        their intervals are then those of that fit. Default: where no run repeats, as then those of the regression are
        too narrow; from one start instead of three.
    rng : int, Generator or None
    progress : callable, optional
    **options
        Parameters of :class:`~sindyjoint.JointRegressor`: forced, forbidden, ...

    Returns
    -------
    RigDiscovery

    Raises
    ------
    InputError
        For a file that cannot be used, too few sensors, or runs that are too short.
    UnsoundError
        Where findings of the check stop the work.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import sindyjoint
    >>> plan = sindyjoint.load_rig_plan("pulse-rig")
    >>> recorder = replace(plan.recorder, duration=4.0, settling=4.0)
    >>> test = sindyjoint.virtual_rig_test(plan.test, plan.drives[:2], recorder)
    >>> found = sindyjoint.discover_rig(test, "paper", refine=False)
    >>> found.laws[0].discovery.model.ids
    ('linear_stiffness', 'quadratic_stiffness', 'cubic_stiffness', 'linear_damping', 'coulomb_friction')
    """
    from sindyjoint.judgement.rig_discovery import of_data
    from sindyjoint.mechanics.rig_test_file import load_rig_test

    say = progress or (lambda stage: None)
    test = rig if isinstance(rig, RigTest) else load_rig_test(rig)
    if not test.identification_runs:
        raise InputError("no run is for identification; expected at least one [[run]] with use = 'identify'")
    catalogue_of(library)  # before work that takes seconds
    say("checking the data")
    checked = require_sound(check_data(test, accept))
    return of_data(laws_of_rig(checked.usable, library, refine, say, random_state=rng, **options), checked)


def laws_of_rig(
    test: RigTest, library: Any, refine: bool | None, say: Callable[[str], None], **options: Any
) -> RigDiscovery:
    """Return the laws of the joints of a structure's test that was checked."""
    from sindyjoint.judgement.joint_laws import find_laws, with_uncertain_structure
    from sindyjoint.judgement.rig_discovery import (
        RigDiscovery,
        described,
        misfit_warnings,
        refine_rig,
        unstated_numbers,
        with_narrow_intervals,
        with_refinement,
        with_terms_of_the_response,
    )
    from sindyjoint.soundness.law.sensors import with_assumed_numbers
    from sindyjoint.substructure.recovery import (
        held_spectra,
        held_warnings,
        recover,
        unsettled_warnings,
        update_structure,
        with_numbers,
    )
    from sindyjoint.substructure.states import joints_seen, worth_of_sensors

    runs = test.identification_runs
    say("recovering angles and moments of the joints")
    recoveries = tuple(recover(test, run) for run in runs)
    held = held_spectra(test)
    unstated = not test.uncertain and bool(misfit_warnings(recoveries))
    if unstated:
        test = with_assumed_numbers(test)
    update = update_structure(test, recoveries, held)
    if update is not None:
        say("updating the structure's numbers")
        changed = with_numbers(test, update.change)
        better = tuple(recover(changed, each.run, each.spectra) for each in recoveries)
        if unstated and misfit_warnings(better):  # something else is at fault
            test, update = replace(test, uncertain=()), None
        else:
            test, recoveries = changed, better
    laws = find_laws(test, recoveries, say, library=library, **options)
    if update is not None:
        say("what the structure's numbers leave uncertain")
        laws = tuple(with_uncertain_structure(law, test, update) for law in laws)
    seen = joints_seen(test, recoveries)
    said = (unstated_numbers(update),) if unstated and update is not None else misfit_warnings(recoveries)
    warnings = (
        *said,
        *unsettled_warnings(recoveries),
        *held_warnings(test, held),
        *(each.words for each in seen if each.words),
        *(law.alike for law in laws if "differ" in law.alike),
    )
    found = RigDiscovery(test, laws, update, recoveries, seen, worth_of_sensors(test, recoveries), warnings)
    passing = all(run.frequency is None for run in runs)
    if not found.found or not (passing if refine is None else refine):
        return with_narrow_intervals(found) if passing and found.found else found
    models = {law.kind: law.discovery.model for law in laws if law.discovery is not None}
    # Numbers that were found untold are known well, and fitting them needs segments in which the joints stand still.
    known = replace(found.test, uncertain=()) if unstated else described(found)
    refined = partial(
        refine_rig,
        known,
        recoveries,
        starts=3 if refine else 1,
        random_state=options.get("random_state"),
        progress=say,
    )
    first = refined(models)
    if passing:
        found, first = with_terms_of_the_response(found, first, refined, options.get("forbidden", ()))
    return with_refinement(found, first)
