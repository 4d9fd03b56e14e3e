"""A campaign as a problem: its runs as rows, the model with the effects so far, the effects that it can show."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from sindyjoint.clock import Portion
from sindyjoint.diagnosis.campaign.change import processing_error
from sindyjoint.diagnosis.campaign.explain import Searched, with_found
from sindyjoint.diagnosis.campaign.gap import (
    gap_of,
    gap_rows,
    gap_without,
    kept_misfit,
    locate_gap,
    moment_gap,
    noise_floor,
    response_error,
    run_gaps,
)
from sindyjoint.diagnosis.campaign.numbers import from_whole, is_element, nuisances_of, whole_model
from sindyjoint.diagnosis.campaign.other_starts import ZERO, discovered, zero_start
from sindyjoint.diagnosis.campaign.refined import (
    begun_with,
    mean_square,
    on_response,
    ranked_on_response,
    simplest,
)
from sindyjoint.diagnosis.campaign.regression import GapRegression
from sindyjoint.diagnosis.campaign.repair import Repaired, refit
from sindyjoint.diagnosis.campaign.rivals import separating_runs
from sindyjoint.diagnosis.campaign.start import (
    ChannelDrift,
    Work,
    applicable,
    cut_up,
    find_drift,
    first_model,
    without_drift_found,
)
from sindyjoint.diagnosis.campaign.unnamed import make_budget
from sindyjoint.diagnosis.effects import Effect
from sindyjoint.diagnosis.effects.fitted import FittedEffect, input_effects
from sindyjoint.diagnosis.evidence import Ranking
from sindyjoint.diagnosis.parts import Budget, Place
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.problem import Problem, Say, Start, add_effects
from sindyjoint.diagnosis.result import Advice, Diagnosis, Gap, Step
from sindyjoint.diagnosis.verdict import Residual, share_beyond_noise
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.limits import STATES
from sindyjoint.mechanics.excitation import Actuator
from sindyjoint.record import Campaign
from sindyjoint.response.refinement import told_by_response
from sindyjoint.soundness.warnings import (
    identifiability_notes,
    warn_of_negative_damping,
    warn_of_negative_inertia,
)
from sindyjoint.states import ForceStates, campaign_states, one_after_another
from sindyjoint.text import in_words_of

BASE, OWN_ZERO = "paper", "the joint's own zero"


@dataclass(frozen=True, eq=False)
class CampaignProblem(Problem):
    """A campaign, and a model with the effects added so far.

    Parameters
    ----------
    work : Work
        Rows, with delays and drifts of the channels put right.
    repaired : Repaired
        Model and effects, fitted together.
    candidates : tuple of Effect
        That the campaign can show.
    states : tuple of ForceStates
        Of whole runs, as measured.
    drift : ChannelDrift, optional
        Of a channel; put right by :meth:`corrected`.
    may_start_anew : bool
        Whether the terms to start from were left to the program.
    zero, zero_error : float
        From where displacements are counted, in that of the channel, rad (m), and its standard error.
    refined : JointModel, optional
        The whole model with numbers from elsewhere, which those of ``repaired`` are parts of.
    actuator : Actuator, optional
        That makes further runs.
    search : Searched, optional
        What the search came to.
    rows : int
        Of the campaign before anything is put right: costs of different starts are for so many.
    """

    work: Work
    repaired: Repaired
    candidates: tuple[Effect, ...]
    states: tuple[ForceStates, ...]
    drift: ChannelDrift | None = None
    may_start_anew: bool = True
    zero: float = 0.0
    zero_error: float = 0.0
    refined: JointModel | None = None
    actuator: Actuator | None = None
    search: Searched | None = None
    rows: int = 0

    @classmethod
    def build(
        cls,
        campaign: Campaign,
        model: JointModel | None,
        base: Any,
        effects: Sequence[Effect],
        policy: DiagnosisPolicy,
        actuator: Actuator | None = None,
    ) -> "CampaignProblem":
        """Return the problem of a campaign, and of a model or the terms of a library fitted to it."""
        share = STATES.passing_rate_share
        states = one_after_another(campaign, campaign_states(campaign, rate_share=share))
        whole = campaign.identification_runs
        runs, parts, groups = cut_up(whole, states, policy)
        start = first_model(campaign, parts, model, base or BASE, policy, effects)
        work = Work.build(campaign, runs, parts, groups, start.model, start.effects, policy)
        if any(row.processing is not None for row in work.plain):
            start = refit(work.plain, start.model, start.effects, drops=False)
            work = replace(work, model=start.model)
        return cls(
            work=work,
            rows=sum(run.white_size for run in work.plain),
            repaired=start,
            candidates=(*applicable(campaign, effects, parts), *input_effects(campaign.inputs, start.model)),
            states=states,
            # In segments, drifts of the channels are effects like others.
            drift=find_drift(whole, states, policy) if len(parts) == len(states) else None,
            may_start_anew=model is None and base is None,
            actuator=actuator,
        )

    @property
    def policy(self) -> DiagnosisPolicy:
        """Its limits."""
        return self.work.policy

    @property
    def found(self) -> tuple[FittedEffect, ...]:
        """The effects added."""
        return self.repaired.effects

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        """Numbers of the effects added, and of the joint's own zero."""
        return {**super().parameters, **({ZERO: {"theta_0": self.zero}} if self.zero else {})}

    @property
    def dropped(self) -> tuple[str, ...]:
        """Terms of the model that the last effect made needless."""
        return self.repaired.dropped

    @cached_property
    def gap(self) -> Gap:
        """On runs left out of the fit; of free motion its numbers are those of :meth:`finished`."""
        found = self.finished().repaired
        return gap_of(self.work, found.model, found.effects)

    @cached_property
    def moment_gap(self) -> float:
        """The gap of the moment; of a free motion that of its inertia, which decides nothing."""
        if not np.isnan(self.gap.moment):
            return self.gap.moment
        return moment_gap(self.work, self.repaired.model, self.found)

    @property
    def noise_floor(self) -> Gap:
        """Noise of the runs of which the gap is reported; NaN where it is not known."""
        return noise_floor(self.work)

    @property
    def floor_is_bound(self) -> bool:
        """Whether a channel's spectrum ends in signal, so that its noise is only known to be less."""
        return any(s.noise.source == "coherent" for s in self.work.kept_states or self.work.states)

    def uncertainty(self) -> Gap:
        """Return the gap of the response that the true law leaves by its numbers and its drive."""
        floor = self.noise_floor.response
        if self.moves_freely or not self.gap.response > self.policy.clearly * floor:
            return Gap(0.0, 0.0)
        return Gap(0.0, response_error(self.work, self.repaired.model, self.found))

    corrected = without_drift_found

    def searched(self, begun: Any, most: int, say: Say, search: Portion) -> Any:
        """Return the progress with the set of effects that predicts best, as far as the portion goes."""
        if not self.moves_freely:
            return search.do(lambda: with_found(begun, most, say), begun, "the search")
        fewer = self.without_needless()
        straight = replace(begun, problem=fewer, gap=fewer.gap)
        if fewer.is_noise:
            return straight
        # Two may explain together what another explains in part; and what the test does is not simulated. Where no law
        # comes near the noise, as of most real joints, simulated motions take long and tell less than rows left out.
        together = search.do(lambda: with_found(begun, most, say), begun, "sets of effects")
        if together.problem.is_noise:
            # Only fewer would tell more.
            most = max(len(together.steps) - 1, 1)
        one_by_one = add_effects(straight, most, say, search)
        if one_by_one.problem.is_noise and len(one_by_one.steps) < 2:
            return one_by_one
        return min((one_by_one, together), key=lambda each: each.problem.cost())

    @property
    def is_noise(self) -> bool:
        """Whether a free motion goes on as it is simulated: noise is known within a few per cent."""
        return mean_square(self.finished().repaired) <= (1 + self.policy.minor_share) ** 2

    def propose(self, refused: Collection[str], say: Say) -> Ranking[FittedEffect] | None:
        """Return what a free motion may lack, in order of probability."""
        say("trying effects on the simulated motion")
        return ranked_on_response(self.work, self.finished().repaired, self.candidates, refused)

    def add(self, best: FittedEffect) -> Self | None:
        """Return the problem of a free motion with an effect more; None where the motion is hardly nearer by it."""
        now = self.finished().repaired
        more = simplest(self.work, begun_with(self.work, now, [best]))
        left, before = mean_square(more), mean_square(now)
        if (
            left > max((1 - self.policy.minor_share) ** 2 * before, self.policy.clearly**2)
            or not left < before
        ):
            return None
        return replace(self, repaired=more)

    @property
    def moves_freely(self) -> bool:
        """Whether no run has a measured moment."""
        return self.work.campaign.moves_freely

    def cost(self) -> float:
        """Return the negative score of the set found, and what its members must win at least, nats."""
        if self.moves_freely:
            found, rows = self.finished().repaired, sum(s.n_samples for s in self.work.states)
            left = mean_square(found)
            if np.isinf(left):
                left = (self.gap.response / self.noise_floor.response) ** 2
            numbers = len(found.model.terms) + sum(e.variant.degrees for e in found.effects)
            return float(0.5 * (rows * np.log(left) + numbers * np.log(rows)))
        return np.inf if self.search is None else self.search.cost

    def gap_without(self, names: Collection[str]) -> Gap:
        """Return the gap without some of the effects, the others fitted anew."""
        return gap_without(self.work, self.found, names) if names else self.gap

    def units(self, fitted: FittedEffect) -> dict[str, str]:
        """Return the units of an effect's parameters."""
        return fitted.variant.units(self.work.campaign.joint.motion)

    def without_needless(self) -> Self:
        """Return the problem without needless terms of the default library, where no effect was added to it."""
        if self.found or not self.may_start_anew:
            return self
        if self.moves_freely:
            return replace(self, repaired=simplest(self.work, self.repaired))
        repaired = refit(self.work.rows, self.repaired.model, (), drops=True)
        return replace(self, repaired=repaired) if repaired.dropped else self

    def finished(self) -> Self:
        """Return the problem; the numbers of free motion are those of its simulation."""
        if not self.moves_freely or self.repaired.residual is not None:
            return self
        return replace(self, repaired=on_response(self.work, self.repaired))

    @property
    def better_simulated(self) -> bool:
        """Whether numbers along the measured motion are wrong or too sure.

        Mean periods round off the corners of an element; where no run repeats, the noise of states is correlated.
        """
        corners = any(map(is_element, self.found)) and all(run.folded for run in self.work.rows)
        return corners or (not self.moves_freely and told_by_response(self.work.states))

    @cached_property
    def whole(self) -> JointModel:
        """The model with the terms and elements that the effects add to the joint's law."""
        return whole_model(self.repaired, self.work.rows) if self.refined is None else self.refined

    @property
    def test(self) -> TestNuisances:
        """What the effects are of the test, without the hash of its campaign."""
        motion = self.work.campaign.joint.motion
        return nuisances_of(self.repaired, self.work.rows, self.drift, motion, (self.zero, self.zero_error))

    def with_whole(self, whole: JointModel) -> Self:
        """Return the problem with the numbers of another whole model, of the same terms and effects."""
        repaired = from_whole(self.repaired, self.work.rows, whole)
        return replace(self, repaired=repaired, refined=whole)

    def other_start(self, straight: Self, last: Self, say: Say) -> Start[Self] | None:
        """Return the terms that discovery finds as a start, where the terms to start from were not chosen.

        Only where the gap is not far above that of ``last``, where the search ended so far, another one is worth it.
        """
        if self.drift is not None or not self.may_start_anew:
            return None
        say("discovering the terms")
        found = discovered(straight)
        if found is None or not found[0].gap.moment <= (1 + self.policy.minor_share) * last.gap.moment:
            return None
        return Start(*found, "the terms that discovery finds", straight)

    def zero_start(self, straight: Self, last: Self, say: Say) -> Start[Self] | None:
        """Return the start from the joint's own zero, where the search found a zero error."""
        say(OWN_ZERO)
        found = None if self.drift is not None else zero_start(straight, last)
        return None if found is None else Start(*found, OWN_ZERO, straight)

    def with_model(self, model: JointModel) -> Self:
        """Return the problem of another model, fitted to these states."""
        work = self.work
        later = Work.build(work.campaign, work.runs, work.states, work.groups, model, (), self.policy)
        return replace(self, work=later, repaired=Repaired(model, ()))

    def residual(self, straight: Self) -> Residual:
        """Return what the effects leave of the gap that channels put right had."""
        if self.moves_freely:
            # What cannot be simulated misses by any amount; a floor is known within a factor.
            first, last = (min(mean_square(each.finished().repaired), 1e9) for each in (straight, self))
            before, after = (square - self.policy.clearly**2 for square in (first, last))
            share = min(after / before, 1.0) if after > 0 else 0.0
            return Residual(share, self.policy.unexplained, misfit=float(np.sqrt(last)))
        if self.search is None:
            return Residual(1.0, self.policy.unexplained)
        before, after, rows = self.search.before, self.search.after, self.search.rows
        share = share_beyond_noise((before, rows), (after, rows), self.policy)
        kept = self.work.campaign.validation_runs
        misfit = (
            kept_misfit(self.work, self.repaired.model, self.found) if kept else float(np.sqrt(after / rows))
        )
        return Residual(share, self.policy.unexplained, misfit=misfit)

    def budget(self, first: Self, last: Self) -> Budget:
        """Return the parts of the first gap, which differs from this one by the drift of a channel."""
        moments = GapRegression.build(self.work.moment_rows(), self.work.model, (), self.policy)
        total, work = first.moment_gap**2, first.work
        return make_budget(
            moments,
            total,
            float(np.nan_to_num(first.noise_floor.moment)) ** 2,
            0.0 if self.moves_freely else processing_error(work.runs, work.states, work.rows, work.model),
            total - self.moment_gap**2,
            measured=first.work.campaign.quasi_static,
        )

    def places(self) -> tuple[Place, ...]:
        """Return where the gap lies."""
        moments = GapRegression.build(self.work.moment_rows(), self.work.model, (), self.policy)
        return locate_gap(moments, self.work.campaign.joint.motion)

    def separating_runs(
        self, step: Step, ranking: Ranking[FittedEffect], search: Portion, say: Say
    ) -> tuple[tuple[Advice, ...], int, int]:
        """Return the runs that would tell the members of a class apart, how many were tried, and of how many."""
        rivals = ranking.members[1:]
        return separating_runs(self.work, self.found, step, rivals, search, say, self.actuator)

    def diagnosis(self, first: Self, found: Mapping[str, Any]) -> Diagnosis:
        """Return the result."""
        repaired, campaign = self.repaired, self.work.campaign
        return Diagnosis(
            **{**found, "reason": in_words_of(campaign.joint.motion, found["reason"])},
            warnings=(
                *identifiability_notes(campaign, self.states),
                *warn_of_negative_inertia(repaired.model),
                *warn_of_negative_damping(repaired.model),
            ),
            model=repaired.model,
            effects=self.found,
            whole=self.whole,
            test=self.test,
            before=run_gaps(gap_rows(first.work, first.work.model), first.work.model, zero=first.zero),
            after=run_gaps(
                gap_rows(self.work, repaired.model, self.found), repaired.model, self.found, self.zero
            )
            if found["steps"]
            else (),
        )
