"""What a discovery comes to: the model, the verdict on the paper's five terms, and what both rest on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from sindyjoint.described import Shown, same
from sindyjoint.discovery.delay import ChannelDelay
from sindyjoint.discovery.frequency import FrequencyTest, GroupEstimates, frequency_test, group_estimates
from sindyjoint.discovery.uncertainty import in_words, inseparable
from sindyjoint.equation.calibration import gain_moves, with_gain_uncertainty
from sindyjoint.equation.element import Value
from sindyjoint.equation.model import INERTIA, Fitted, JointModel
from sindyjoint.equation.model_parts import versions
from sindyjoint.equation.test_record import Enters, Nuisance, TestNuisances
from sindyjoint.judgement import Excitations, is_of_the_paper, next_steps
from sindyjoint.judgement.over_inputs import OverInput, over_inputs
from sindyjoint.judgement.trust import assess, judge_soundness
from sindyjoint.judgement.verdict import Verdict, unjudged
from sindyjoint.limits import DISCOVERY, JUDGEMENT
from sindyjoint.record import Campaign
from sindyjoint.response import corrected
from sindyjoint.response.drive import prescribed
from sindyjoint.response.output_error_runs import Nuisance as Kind
from sindyjoint.response.refinement import Refinement, refine
from sindyjoint.soundness import Soundness
from sindyjoint.soundness.check import Check
from sindyjoint.states import ForceStates, content_hash, group_labels, run_hash, with_later_motion
from sindyjoint.text import in_words_of, spelled
from sindyjoint.trust import Light, Trust

if TYPE_CHECKING:
    from sindyjoint.discovery.optimizer import JointSINDy
    from sindyjoint.discovery.regression import TermRegression
    from sindyjoint.discovery.selection import Selection


@dataclass(frozen=True)
class DiscoveredTerm:
    """A term of the equation with what is known of its coefficient, SI.

    Parameters
    ----------
    id, symbol : str
    coefficient : float
    unit : str
    standard_error : float
    interval95 : (float, float)
    calibration : dict of str to float
        By how much one standard uncertainty of a channel's gain moves it, where some are declared.
    """

    WRITTEN: ClassVar = {
        **same("id", "symbol", "coefficient", "unit", "standard_error", "interval95"),
        "calibration?": "calibration",
    }
    id: str
    symbol: str
    coefficient: float
    unit: str
    standard_error: float
    interval95: tuple[float, float]
    calibration: dict[str, float]


@dataclass(frozen=True, eq=False, repr=False)
class Discovery(Shown):
    """The result of :func:`~sindyjoint.discover`.

    Parameters
    ----------
    model : JointModel
        Of the regressor, with the errors that it does not know of.
    verdict : Verdict
    found : bool
        Whether a model passed; if not, ``model`` has no terms and ``reason`` says why.
    reason : str
        How the terms were chosen.
    skew : ChannelDelay or None
        Time by which the moment lags the angle, as searched for before anything else.
    warnings : tuple of str
    states : tuple of ForceStates
        Completed by the model where the simulation follows a run.
    regressor : TermRegression
        Fitted; holds candidates, path and factors.
    campaign : Campaign
        As it was used: without the samples that the check of the data leaves out.
    soundness : Soundness
        What the check of the data found.
    stopped : Check or None
        The check, where its findings are such that nothing was discovered: there are no states then, and the regressor
        is not fitted.
    measured : Campaign, optional
        As it was read, with the samples that are left out.
    paper : bool
        Whether the question of the paper's five terms was asked.
    lag : float
        Time by which the motion of the states was moved to undo a delay of the moment, s; not that of the campaign.
    data : Light, optional
        What to think of the data, where that is more than their check says, as of a structure they were recovered in.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        "joint": {"name": "model.joint.name", "motion": "model.joint.motion", "inertia": "inertia"},
        "terms": "terms",
        "trust": "trust",
        "paper_term_set": "verdict",
        "fit": {
            name: f"model.fitted.{name}"
            for name in ("moment_rms", "residual_rms", "noise_floor", "moving_fraction", "samples", "runs")
        },
        "over_inputs?": "over_inputs",
        **same("warnings", "soundness"),
    }
    model: JointModel
    verdict: Verdict
    found: bool
    reason: str
    skew: ChannelDelay | None
    warnings: tuple[str, ...]
    states: tuple[ForceStates, ...] = field(repr=False)
    regressor: TermRegression = field(repr=False)
    campaign: Campaign = field(repr=False)
    soundness: Soundness = Soundness()
    stopped: Check[Campaign] | None = field(repr=False, default=None)
    measured: Campaign | None = field(repr=False, default=None)
    paper: bool = False
    lag: float = 0.0
    data: Light | None = None

    @property
    def leads_with_paper(self) -> bool:
        """Whether the question of the paper's five terms comes first."""
        return self.paper or is_of_the_paper(self.model.joint.name)

    @cached_property
    def trust(self) -> Trust:
        """Whether to trust the model, and what to do next."""
        if self.stopped is not None:
            lights: tuple[Light, ...] = (
                judge_soundness(self.soundness, self.campaign.simulated, self.model.joint.motion),
            )
        else:
            seen: dict[str, bool | None] = {run.name: run.use == "identify" for run in self.campaign.runs}
            lights = self._assessed(seen)
        lights = lights if self.data is None else (self.data, *lights[1:])
        return Trust(tuple(lights), next_steps(lights, Excitations.of(self.campaign), self.found))

    def _assessed(self, seen: dict[str, bool | None]) -> tuple[Light, ...]:
        """Return the lights of model and campaign; channels that were moved in time as a verification moves them."""
        if not self.lag or self.model.test is None:
            return assess(self.model, self.campaign, self.soundness, seen, states=self.states)
        test = self.model.test
        put_right = corrected(test, self.campaign)
        return assess(self.model, put_right, self.soundness, seen, test, as_measured=self.campaign)

    @property
    def over_inputs(self) -> tuple[OverInput, ...]:
        """The law over each declared input, and which coefficients are the same at all of its levels."""
        if not self.found or not self.model.inputs:
            return ()
        return over_inputs(self.model, self.regressor.evidence_, self.states)

    @property
    def selection(self) -> Selection:
        """The path of models and the choice on it."""
        return self.regressor.selection_result_

    @property
    def sindy(self) -> JointSINDy:
        """The model as a fitted ``pysindy.SINDy``, in physical units; its ``simulate`` knows sticking."""
        from sindyjoint.discovery.optimizer import JointSINDy
        from sindyjoint.response.laws import simulated_states

        return JointSINDy.of(self.regressor, self.model, partial(simulated_states, self.model))

    @property
    def inertia(self) -> float | None:
        """As declared or identified, kg·m² (kg)."""
        model = self.model
        return model.inertia if model.joint.inertia is not None or INERTIA in model else None

    @property
    def terms(self) -> tuple[DiscoveredTerm, ...]:
        """The terms of the equation."""
        moves = gain_moves(self.model, self.model.fitted.gains)
        return tuple(
            DiscoveredTerm(
                term.id, term.symbol, term.coefficient, term.unit, term.standard_error, term.interval95,
                {name: float(moved[i]) for name, moved in moves.items()},
            )
            for i, term in enumerate(self.model.terms)
        )  # fmt: skip


def stopped_by_data(checked: Check[Campaign], regressor: TermRegression) -> Discovery:
    """Return the result on data of which no model is made."""
    campaign = checked.measured
    runs = checked.usable.identification_runs
    moment = float(np.sqrt(np.mean(np.concatenate([run.moment for run in runs]) ** 2))) if runs else 0.0
    fitted = Fitted(
        moment_rms=moment,
        residual_rms=moment,
        noise_floor=np.nan,
        moving_fraction=np.nan,
        samples=0,
        runs=len(runs),
        angle=max((float(np.abs(run.angle).max()) for run in runs), default=0.0),
        rate=np.nan,
        frequencies=tuple(sorted({run.frequency for run in runs if run.frequency is not None})),
        simulated=campaign.simulated,
        mean_known=campaign.mean_known,
        quasi_static=campaign.quasi_static,
    )
    return Discovery(
        model=JointModel(campaign.joint, (), (), fitted),
        verdict=unjudged(checked.reason),
        found=False,
        reason=checked.reason,
        skew=None,
        warnings=(*checked.warnings, *campaign.warnings),
        states=(),
        regressor=regressor,
        campaign=campaign,
        soundness=checked.soundness,
        stopped=checked,
    )


def undetermined(found: Discovery) -> tuple[str, ...]:
    """Return in words which terms of the model the runs cannot tell apart."""
    evidence, model = found.regressor.evidence_, found.model
    columns = [evidence.ids.index(term) for term in model.ids if term in evidence.ids]
    pairs = inseparable(evidence, columns) if columns else ()
    return tuple(in_words_of(model.joint.motion, in_words(pair, *_reach(model))) for pair in pairs)


def _reach(model: JointModel) -> tuple[float | None, float | None]:
    """Return the largest angle tested and the softening limit of a model, where it has one."""
    if not {"linear_stiffness", "cubic_stiffness"} <= set(model.ids):
        return None, None
    k1, k3 = model["linear_stiffness"].coefficient, model["cubic_stiffness"].coefficient
    return (model.fitted.angle, float(np.sqrt(k1 / (-3 * k3)))) if k3 < 0 < k1 else (None, None)


def fitted_to(model: JointModel, campaign: Campaign, earlier: Sequence[str] = ()) -> JointModel:
    """Return a model that knows the campaign it was fitted to, as it was given, its runs, and by which versions."""
    runs = {*earlier, *map(run_hash, campaign.identification_runs)}
    fitted = replace(
        model.fitted, data=content_hash(campaign), versions=dict(versions()), seen=tuple(sorted(runs))
    )
    return replace(model, fitted=fitted)


# What the estimated errors of the channels are in the record of a test, by what the response is.
STORED: dict[tuple[str, str], tuple[str, Enters, str]] = {
    ("delay", "angle"): ("channel_delay", "time shift", "tau"),
    ("gain", "angle"): ("angle_gain", "angle gain", "g"),
    ("gain", "moment"): ("moment_gain", "moment gain", "g"),
    ("offset", "angle"): ("angle_offset", "angle zero", "theta_0"),
}


def refined(result: Discovery, nuisance: Sequence[Kind] = (), **options: object) -> Discovery:
    """Return a discovery whose coefficients are refined on the simulated response, with the notes of that."""
    if not result.found:
        return result
    # The states are those of channels that were aligned.
    runs = tuple(with_later_motion(run, result.lag) for run in result.campaign.runs) if result.lag else ()
    campaign = result.campaign.with_runs(runs) if runs else result.campaign
    refinement = refine(
        result.model,
        campaign,
        states=result.states,
        nuisance=nuisance,
        **options,  # type: ignore[arg-type]
    )
    apart = _warn_of_disagreement(result.model, refinement.model) if refinement.refined else ()
    # The intervals of a refinement hold noise alone.
    refined_model, lost = refinement.model, list[str]()
    if refinement.refined:
        estimated, lost = estimated_errors(refinement, result.states)
        refined_model = with_errors(refined_model, estimated, result.measured or result.campaign)
        plain = replace(refined_model, fitted=replace(refined_model.fitted, gains={}))
        refined_model = with_gain_uncertainty(plain, result.campaign.gain_uncertainty)
    return replace(
        result,
        model=refined_model,
        warnings=(*result.warnings, *refinement.notes, *lost, *apart),
    )


def estimated_errors(result: Refinement, states: Sequence[ForceStates]) -> tuple[list[Nuisance], list[str]]:
    """Return errors of channels that a refinement estimated, and what is said of those that no one channel has."""
    responses = {"moment" if prescribed(s, spurious=True) else "angle" for s in states}
    found, lost = [], []
    for name, (value, error) in result.nuisance.items():
        # Of angle and moment together a number is of neither; a delay lies between them.
        channel = "angle" if name == "delay" else "".join(responses)
        if (name, channel) not in STORED:
            lost.append(f"the {name} that was estimated is not applied where model and campaign are compared")
            continue
        id, enters, symbol = STORED[name, channel]
        unit = {"delay": "s", "gain": "1"}.get(
            name, "rad" if result.model.joint.motion == "rotation" else "m"
        )
        ends = (value - 1.96 * error, value + 1.96 * error)
        found.append(Nuisance(id, enters, Value(symbol, value, error, ends, unit)))
    return found, lost


def with_errors(model: JointModel, estimated: Sequence[Nuisance], measured: Campaign) -> JointModel:
    """Return a model whose record of its test holds further errors of channels of that campaign."""
    known = model.test or TestNuisances(content_hash(measured), measured.joint.name)
    test = replace(known, nuisances=(*known.nuisances, *estimated))
    return replace(model, test=test or None)


def _warn_of_disagreement(before: JointModel, after: JointModel) -> tuple[str, ...]:
    """Return a warning for terms that regression and simulation give values that their errors do not reconcile."""
    pairs = ((term, before[term.id]) for term in after.terms if term.id in before)
    apart = [
        f"{spelled(term.id)} ({other.coefficient:.4g} ± {other.standard_error:.2g} by regression, "
        f"{term.coefficient:.4g} ± {term.standard_error:.2g} on the response)"
        for term, other in pairs
        if abs(term.coefficient - other.coefficient)
        > JUDGEMENT.significant * float(np.hypot(term.standard_error, other.standard_error))
    ]
    if not apart:
        return ()
    return (
        f"regression and simulated response disagree by more than {JUDGEMENT.significant:g} standard errors: "
        f"{'; '.join(apart)}; the model lacks something, or samples are too few for derivatives",
    )


def frequency_tests(discovery: Discovery, margin: float = DISCOVERY.margin) -> tuple[FrequencyTest, ...]:
    """Test every term of a discovered model.

    Parameters
    ----------
    discovery : Discovery
        Of a campaign with three or more excitation frequencies; otherwise nothing is returned.
    margin : float
        Relative change over the band that would not matter.
    """
    frequency = frequency_of_groups(discovery.states)
    if len(set(frequency.values())) < 3 or not discovery.model.terms:
        return ()
    found = estimates_by_group(discovery)
    values, errors = found.coefficients, found.standard_errors
    hertz = [frequency[group] for group in found.groups]
    return tuple(
        frequency_test(term, hertz, values[:, i], errors[:, i], found.degrees, margin)
        for i, term in enumerate(found.ids)
    )


def estimates_by_group(discovery: Discovery) -> GroupEstimates:
    """Return fits of the model's terms to each single group."""
    evidence = discovery.regressor.evidence_
    columns = [evidence.ids.index(term) for term in discovery.model.ids if term in evidence.ids]
    return group_estimates(evidence, columns)


def frequency_of_groups(states: Sequence[ForceStates]) -> dict[str, float]:
    """Return the excitation frequency of each group, Hz; empty where runs have none."""
    if any(state.frequency is None for state in states):
        return {}
    return {
        label: float(state.frequency or 0.0)
        for label, state in zip(group_labels(states), states, strict=True)
    }
