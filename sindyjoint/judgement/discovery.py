"""What a discovery comes to: the model, the verdict on the paper's five terms, and what both rest on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from sindyjoint.described import Shown, same
from sindyjoint.discovery.delay import ChannelDelay
from sindyjoint.discovery.uncertainty import in_words, inseparable
from sindyjoint.equation.calibration import gain_moves
from sindyjoint.equation.model import INERTIA, Fitted, JointModel
from sindyjoint.judgement.headline import Excitations, is_of_the_paper, of_discovery
from sindyjoint.judgement.over_inputs import OverInput, over_inputs
from sindyjoint.judgement.trust import assess, judge_soundness
from sindyjoint.judgement.verdict import Verdict, unjudged
from sindyjoint.judgement.versions import versions
from sindyjoint.record import Campaign
from sindyjoint.soundness.check import Check
from sindyjoint.soundness.finding import Soundness
from sindyjoint.states import ForceStates
from sindyjoint.states.build import content_hash, run_hash
from sindyjoint.text import in_words_of
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
    stopped: Check | None = field(repr=False, default=None)
    measured: Campaign | None = field(repr=False, default=None)
    paper: bool = False
    lag: float = 0.0

    @property
    def leads_with_paper(self) -> bool:
        """Whether the question of the paper's five terms comes first."""
        return self.paper or is_of_the_paper(self.model.joint.name)

    @cached_property
    def trust(self) -> Trust:
        """Whether to trust the model, and what to do next."""
        if self.stopped is not None:
            lights: tuple[Light, ...] = (judge_soundness(self.soundness, self.campaign.simulated),)
        else:
            seen = {run.name: run.use == "identify" for run in self.campaign.runs}
            lights = assess(self.model, self.campaign, self.soundness, seen, states=self.states)
        return of_discovery(lights, Excitations.of(self.campaign), self.found)

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
        moves = gain_moves(self.model, dict(self.model.fitted.gains))
        return tuple(
            DiscoveredTerm(
                term.id, term.symbol, term.coefficient, term.unit, term.standard_error, term.interval95,
                {name: float(moved[i]) for name, moved in moves.items()},
            )
            for i, term in enumerate(self.model.terms)
        )  # fmt: skip


def stopped_by_data(checked: Check, regressor: TermRegression) -> Discovery:
    """Return the result on data of which no model is made."""
    campaign = checked.campaign
    runs = checked.usable.identification_runs
    moment = float(np.sqrt(np.mean(np.concatenate([run.moment for run in runs]) ** 2))) if runs else 0.0
    unknown = float("nan")
    fitted = Fitted(
        moment_rms=moment,
        residual_rms=moment,
        noise_floor=unknown,
        moving_fraction=unknown,
        samples=0,
        runs=len(runs),
        angle=max((float(np.abs(run.angle).max()) for run in runs), default=0.0),
        rate=unknown,
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
    fitted = replace(model.fitted, data=content_hash(campaign), versions=versions(), seen=tuple(sorted(runs)))
    return replace(model, fitted=fitted)
