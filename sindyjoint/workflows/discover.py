"""A campaign goes in, a joint model comes out, with a verdict on the paper's five terms."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sindyjoint.discovery.delay import ChannelDelay, estimate_delay, reference_of, shifted
from sindyjoint.discovery.segments import LONGEST, SampleCount, fit_long, has_long_runs
from sindyjoint.equation.catalogue import Catalogue, as_catalogue, load_catalogue
from sindyjoint.equation.model import INERTIA, Fitted, JointModel
from sindyjoint.errors import InputError, SimulationError
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.parallel import executor
from sindyjoint.record import Campaign
from sindyjoint.soundness.warnings import cautions
from sindyjoint.states import ForceStates, campaign_states, regression_rows
from sindyjoint.text import spelled
from sindyjoint.workflows.verdict import Verdict, judge

# The model that completes the states is itself found on incomplete ones: as often as its terms change, at most.
COMPLETIONS = 4
# By how much the residual must fall for the new end of that search to be taken.
BETTER = 0.998

if TYPE_CHECKING:
    from sindyjoint.bias.correction import Bias, Corrected
    from sindyjoint.discovery.estimator import JointRegressor
    from sindyjoint.discovery.selection import Selection


@dataclass(frozen=True, eq=False)
class Discovery:
    """The result of :func:`discover`.

    Parameters
    ----------
    model : JointModel
        Bias of the processing taken out, where it could be measured; the model of the regressor still contains it.
    verdict : Verdict
    found : bool
        Whether a model passed; if not, ``model`` has no terms and ``reason`` says why.
    reason : str
        How the terms were chosen.
    skew : ChannelDelay or None
        Time by which the moment lags the angle, as searched for before anything else.
    warnings : tuple of str
    states : tuple of ForceStates
    regressor : JointRegressor
        Fitted; holds candidates, path and factors.
    campaign : Campaign
    bias : Bias or None
        What was taken out of the coefficients; ``None`` where it was not asked for or could not be measured.
    """

    model: JointModel
    verdict: Verdict
    found: bool
    reason: str
    skew: ChannelDelay | None
    warnings: tuple[str, ...]
    states: tuple[ForceStates, ...] = field(repr=False)
    regressor: JointRegressor = field(repr=False)
    campaign: Campaign = field(repr=False)
    bias: Bias | None = field(repr=False, default=None)

    @property
    def selection(self) -> Selection:
        """The path of models and the choice on it."""
        return self.regressor.selection_result_

    def to_dict(self) -> dict[str, Any]:
        """Return what ``--json`` prints."""
        model, fitted = self.model, self.model.fitted
        bias = {} if self.bias is None else dict(zip(self.bias.ids, self.bias.pooled.tolist(), strict=True))
        return {
            "schema": 1,
            "joint": {
                "name": model.joint.name,
                "motion": model.joint.motion,
                "inertia": model.inertia if model.joint.inertia is not None or INERTIA in model else None,
            },
            "terms": [
                {
                    "id": term.id,
                    "symbol": term.symbol,
                    "coefficient": term.coefficient,
                    "unit": term.unit,
                    "standard_error": term.standard_error,
                    "interval95": list(term.interval95),
                    "bias": bias.get(term.id),
                }
                for term in model.terms
            ],
            "paper_term_set": {
                "verdict": self.verdict.verdict,
                "missing": list(self.verdict.missing),
                "extra": list(self.verdict.extra),
                "reason": self.verdict.reason,
            },
            "fit": {
                "moment_rms": fitted.moment_rms,
                "residual_rms": fitted.residual_rms,
                "noise_floor": fitted.noise_floor,
                "moving_fraction": fitted.moving_fraction,
                "samples": fitted.samples,
                "runs": fitted.runs,
            },
            "warnings": list(self.warnings),
        }


def discover(
    campaign: Campaign | str | Path | None = None,
    library: str | Path | Catalogue | Sequence[str | Path | Catalogue] = "extended",
    *,
    states: str = "auto",
    bandwidth: float | None = None,
    align: bool = False,
    correct: bool = True,
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
    library : str, Path, Catalogue, or sequence of these
        Candidate terms.
    states : {"auto", "periodic", "broadband"}
        How force states are made of signals.
    bandwidth : float, optional
        Highest frequency kept in the angle, Hz.
    align : bool
        Remove the time delay that is found between the channels.
    correct : bool
        Simulate the model under the drive of the campaign and take out of the coefficients what noise and processing
        do to them.
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
    InputError
        For data or options that cannot be used.
    """
    from sindyjoint.discovery.estimator import JointRegressor

    say = progress or (lambda stage: None)
    catalogue = as_catalogue(library)
    if campaign is None:
        say("simulating the virtual test")
    campaign = the_campaign(campaign, random_state, LONGEST)
    inertia = campaign.joint.inertia
    say("force states")
    force_states = campaign_states(campaign, states, bandwidth)  # type: ignore[arg-type]
    say("time delay between the channels")
    delay = _find_delay(force_states, inertia)
    lag = delay.time if align and delay is not None and delay.significant else 0.0
    force_states = tuple(shifted(s, lag) for s in force_states)
    say("selecting terms")
    regressor = JointRegressor(catalogue, motion=campaign.joint.motion, random_state=random_state, **options)
    if has_long_runs(campaign):
        with executor(jobs, workers, cluster) as here:
            regressor, counts = fit_long(
                regressor, campaign, force_states, here, bandwidth=bandwidth, lag=lag, say=say
            )
    else:
        regressor.fit(**regression_rows(force_states, inertia).fit_arguments())
        counts = tuple(SampleCount(int(np.count_nonzero(s.moving)), s.n_samples) for s in force_states)
    say("judging")
    model = _make_campaign_model(regressor, campaign, force_states, counts)
    measured = regressor
    if correct and not has_long_runs(campaign):
        regressor, model, force_states = _complete_states(
            regressor, model, campaign, force_states, counts, say
        )
    verdict = judge(regressor, model, completed=measured is not regressor)
    if (
        correct
        and verdict.verdict == "refuted"
        and _find_artefacts(regressor, model, verdict, campaign, force_states)
    ):
        names = " and ".join(spelled(term) for term in verdict.extra)
        verdict = replace(
            verdict,
            verdict="undecided",
            reason=f"{names} may be the processing's: of a simulated joint of the paper's five terms it makes as much",
        )
    say("measuring the bias of the processing")
    fixed = _correct_model(regressor, measured, model, campaign, force_states) if correct else None
    model = fixed.model if fixed is not None else model
    warnings = [*cautions(campaign, force_states, model, delay, align, regressor.indistinct_)]
    if measured is not regressor:
        warnings.append(
            "the inertia makes weak harmonics of the motion matter: those not known to a tenth were taken from a "
            "simulation of the model, and the terms chosen again"
        )
    if fixed is not None and fixed.reason:
        warnings.append(
            f"the bias of the processing could not be measured ({fixed.reason}): the intervals hold the noise only"
        )
    return Discovery(
        model=model,
        verdict=verdict,
        found=bool(model.terms),
        reason=regressor.selection_result_.reason,
        skew=delay,
        warnings=tuple(warnings),
        states=force_states,
        regressor=regressor,
        campaign=campaign,
        bias=fixed.bias if fixed is not None else None,
    )


def _complete_states(
    regressor: JointRegressor,
    model: JointModel,
    campaign: Campaign,
    states: tuple[ForceStates, ...],
    counts: Sequence[SampleCount],
    say: Callable[[str], None],
) -> tuple[JointRegressor, JointModel, tuple[ForceStates, ...]]:
    """Choose the terms again on states whose weak harmonics are the model's, where those matter to the moment.

    The model that completes the states was itself found on incomplete ones: the search starts from it and from the
    terms of the paper, and the result with the smaller residual is taken.
    """
    from sindyjoint.bias.completion import completed_states
    from sindyjoint.discovery.estimator import JointRegressor
    from sindyjoint.response.model_law import model_law

    best = (regressor, model, states)
    starts = [model] if model.terms else []
    paper = paper_model(regressor, model)
    if paper is not None and set(paper.ids) != set(model.ids):
        starts.append(paper)
    for start in starts:
        found = start
        for _ in range(COMPLETIONS):
            try:
                more = completed_states(model_law(found), campaign.identification_runs, states)
            except (SimulationError, InputError):
                break
            if more is None:
                break
            say("selecting terms with the harmonics below the noise")
            fitted = JointRegressor(**regressor.get_params(deep=False))
            fitted.fit(**regression_rows(more, campaign.joint.inertia).fit_arguments())
            before, found = found.ids, _make_campaign_model(fitted, campaign, more, counts)
            if not found.terms:
                break
            if found.fitted.residual_rms < best[1].fitted.residual_rms * BETTER:
                best = (fitted, found, more)
            if found.ids == before:
                break
    return best


def paper_model(regressor: JointRegressor, model: JointModel) -> JointModel | None:
    """Return the paper's five terms, and inertia where it is one, fitted to a regressor's data; None if not offered."""
    from sindyjoint.discovery.evidence import fit_columns
    from sindyjoint.equation.model import model_terms

    ids = regressor.evidence_.ids
    expected = [*PAPER_TERMS, *([INERTIA] if INERTIA in ids else [])]
    if regressor.fixed or not set(expected) <= set(ids):
        return None
    columns = sorted(ids.index(term) for term in expected)
    fit = fit_columns(regressor.evidence_, columns)
    resolved = {term.id: term for term in regressor.terms_}
    kept = [resolved[ids[column]] for column in columns]
    terms = model_terms(
        kept, fit.coefficients, fit.covariance, fit.unique_share, fit.effective_degrees, model.joint.motion
    )
    return model.with_terms(terms, fit.covariance)


def _find_artefacts(
    regressor: JointRegressor,
    model: JointModel,
    verdict: Verdict,
    campaign: Campaign,
    states: Sequence[ForceStates],
) -> bool:
    """Return whether the found terms beyond the paper's are what the processing makes of the paper's law."""
    from sindyjoint.bias.correction import measure_bias
    from sindyjoint.bias.policy import POLICY as BIAS

    paper = paper_model(regressor, model)
    if paper is None or not verdict.extra:
        return False
    terms = [term for term in regressor.terms_ if term.id in model]
    try:
        bias = measure_bias(paper, terms, campaign, states)
    except (SimulationError, InputError):
        return False
    for term in verdict.extra:
        at, found = bias.ids.index(term), model[term]
        error = np.hypot(
            found.standard_error, np.hypot(bias.pooled_error[at], BIAS.uncertain_share * bias.pooled[at])
        )
        if abs(found.coefficient - bias.pooled[at]) > regressor.significance * error:
            return False
    return True


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


def _find_delay(states: Sequence[ForceStates], inertia: float | None) -> ChannelDelay | None:
    """Estimate the delay under the paper's law and a constant; None where the data do not carry that law."""
    if not any(np.any(s.moment[s.moving]) for s in states) or np.ptp(states[0].moment) == 0:
        return None
    law = load_catalogue("paper").union(load_catalogue("extended").select(["constant_moment"]))
    if inertia is None:
        law = law.union(load_catalogue("inertia"))
    try:
        return estimate_delay(states, law.resolve(reference_of(states)), inertia)
    except (np.linalg.LinAlgError, InputError):
        # Dependent columns (one level of a pure sine): a delay cannot be distinguished from damping there.
        return None


def _make_campaign_model(
    regressor: JointRegressor,
    campaign: Campaign,
    states: Sequence[ForceStates],
    counts: Sequence[SampleCount],
) -> JointModel:
    """Return the regressor's model with the joint and the data it came from."""
    model = regressor.model_
    inertia = campaign.joint.inertia
    if inertia is None and INERTIA in model:
        inertia = model[INERTIA].coefficient
    moving = np.array([count.moving for count in counts], dtype=float)
    # What one sample of the transfer moment cannot repeat: sensor noise, and the inertia times noise of θ̈.
    variance = [s.noise.moment**2 + ((inertia or 0.0) * s.noise.acceleration) ** 2 for s in states]
    fitted = Fitted(
        moment_rms=model.fitted.moment_rms,
        residual_rms=model.fitted.residual_rms,
        noise_floor=float(np.sqrt(np.average(variance, weights=moving))),
        moving_fraction=float(moving.sum() / sum(count.samples for count in counts)),
        samples=int(moving.sum()),
        runs=len(states),
        angle=model.fitted.angle,
        rate=model.fitted.rate,
        frequencies=tuple(sorted({round(s.frequency, 6) for s in states if s.frequency is not None})),
        simulated=campaign.simulated,
    )
    return replace(model, joint=campaign.joint, fitted=fitted)
