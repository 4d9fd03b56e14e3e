"""A diagnosis and the campaign that it is of: what the check of its data, delays and lags have to say."""

from dataclasses import dataclass, replace
from typing import Any

from sindyjoint.diagnosis.parts import NOT_DIVIDED
from sindyjoint.diagnosis.policy import CAMPAIGN
from sindyjoint.diagnosis.result import Diagnosis, Gap
from sindyjoint.diagnosis.verdict import UNDECIDED, Gaps, discount
from sindyjoint.discovery.delay import ChannelDelay
from sindyjoint.equation.calibration import with_gain_uncertainty
from sindyjoint.equation.model import Fitted, JointModel
from sindyjoint.equation.test_record import TestNuisances, channel_delay
from sindyjoint.inputs import fixed_notes
from sindyjoint.judgement.discovery import fitted_to
from sindyjoint.judgement.headlines import judge_diagnosis
from sindyjoint.judgement.over_inputs import InputLag, find_lags, lag_notes
from sindyjoint.judgement.trust import assess, judge_soundness
from sindyjoint.record import Campaign
from sindyjoint.response import corrected
from sindyjoint.response.laws import as_followed
from sindyjoint.response.verify_campaign import seen_runs
from sindyjoint.soundness.check import Check
from sindyjoint.states import campaign_states, content_hash, with_lags
from sindyjoint.text import spelled
from sindyjoint.trust import Trust

# Where one of these says no, something is missing, and a verdict that says otherwise becomes another.
DENYING = ("explained", "predicts")
DENIED = {"nothing_missing": UNDECIDED, "named": "partly_named", "ambiguous": "partly_named"}


def followed(campaign: Campaign, model: JointModel | None) -> tuple[Campaign, tuple[InputLag, ...]]:
    """Return a campaign whose inputs are as the joint follows them, and the lags that were found for it."""
    if model is not None:
        campaign = as_followed(campaign, model)
    if not campaign.inputs or campaign.quasi_static:
        return campaign, ()
    lags = find_lags(campaign_states(campaign), campaign.joint.inertia, campaign.inputs)
    return with_lags(campaign, {lag.name: lag.time for lag in lags}), lags


@dataclass(frozen=True, eq=False)
class Tested:
    """What a diagnosis says of the campaign that it is of.

    Parameters
    ----------
    campaign : Campaign
        As it was given, but for the runs that are kept out.
    checked : Check
    delay : ChannelDelay or None
        That was removed beforehand.
    lags : tuple of InputLag
    hidden : HiddenCampaign or None
        What a virtual test hides.
    beyond : tuple of str
        What to say of runs beyond what a given model was tested to.
    carried : TestNuisances
        Errors of the rig's channels that a given model knows, put right beforehand.
    earlier : tuple of str
        Hashes of the runs that fits of a given model have seen.
    """

    campaign: Campaign
    checked: Check[Campaign]
    delay: ChannelDelay | None
    lags: tuple[InputLag, ...]
    hidden: Any
    beyond: tuple[str, ...] = ()
    carried: TestNuisances = TestNuisances("")
    earlier: tuple[str, ...] = ()

    def complete(self, result: Diagnosis) -> Diagnosis:
        """Return a diagnosis that knows the campaign, and is no surer than its data allow."""
        test = self.nuisances(result.test or TestNuisances(""))
        whole = None if result.whole is None else self._fitted(result.whole, test)
        elements = () if result.whole is None else result.whole.elements
        named = [spelled(each.effect, self.campaign.joint.motion) for each in elements]
        notes = (*lag_notes(self.lags), *fixed_notes(self.campaign.inputs, named))
        result = replace(
            result, test=test, model=self._fitted(result.model, test), whole=whole, hidden=self.hidden,
            warnings=(*self.beyond, *result.warnings, *notes),
        )  # fmt: skip
        return self._with_trust(no_surer_than(result, self.checked, self.delay is not None))

    def _with_trust(self, result: Diagnosis) -> Diagnosis:
        """Return a diagnosis with the answer to whether its model, effects and all, can be trusted."""
        if result.whole is None or result.test is None or result.soundness is None:
            return result
        put_right = corrected(result.test, self.checked.usable)
        seen = seen_runs(result.whole, self.campaign)
        measured = None if put_right is self.checked.usable else self.checked.usable
        lights = assess(result.whole, put_right, result.soundness, seen, result.test, as_measured=measured)
        trust = Trust(lights)
        floor = trust.explained.floor if trust.explained and not self.campaign.validation_runs else None
        if self.campaign.moves_freely:
            floor = float("nan")  # of a moment that has no gap
        if floor is not None:
            # Of one campaign one floor: completed states lack none of the motion that their processing cuts off.
            result = replace(result, noise_floor=replace(result.noise_floor, moment=floor))
        denied = next((each for each in lights if each.name in DENYING and each.colour == "poor"), None)
        noise = result.final.moment <= CAMPAIGN.clearly * result.noise_floor.moment
        if denied is not None and result.verdict in DENIED and not (noise and result.steps):
            # Of a free motion the response alone is judged, and few decays are followed by more than one law; nor are
            # effects named whole that predict a run left out by no more than the uncertainty of their numbers.
            reason = f"{result.reason}, yet the law is not one to rely on: {denied.sentence}"
            verdict = DENIED[result.verdict]
            steps = discount(
                result.steps, verdict, Gaps(result.initial, result.final, result.noise_floor), CAMPAIGN
            )
            result = replace(result, verdict=verdict, reason=reason, steps=steps)
        result = replace(result, trust=trust)
        return replace(result, trust=judge_diagnosis(result, self.campaign.simulated))

    def nuisances(self, test: TestNuisances) -> TestNuisances:
        """Return what belongs to a test as that of its campaign; a delay removed beforehand is the test's."""
        found = (*self.carried.nuisances, *test.nuisances)
        if self.delay is not None:
            found = (channel_delay(self.delay.time, self.delay.standard_error), *found)
        digest = content_hash(self.campaign)
        return replace(test, campaign=digest, joint=self.campaign.joint.name, nuisances=found)

    def _fitted(self, model: JointModel, test: TestNuisances) -> JointModel:
        known = fitted_to(replace(model, test=test or None), self.campaign, self.earlier)
        return with_gain_uncertainty(known, self.campaign.gain_uncertainty)


def no_surer_than(result: Diagnosis, checked: Check[Any], aligned: bool = False) -> Diagnosis:
    """Return a diagnosis that says what was found of its data, and is undecided where these are unsound."""
    warnings = (*checked.warned(aligned), *result.warnings)
    result = replace(result, soundness=checked.soundness, warnings=warnings)
    if checked.soundness.verdict != "unsound":
        return result
    faults = ", ".join(dict.fromkeys(f.id.replace("_", " ") for f in checked.undecided_by()))
    without = f"{result.verdict.replace('_', ' ')}, {result.reason}"
    reason = f"the data are not sound ({faults}); without that: {without}"
    return replace(result, verdict=UNDECIDED, reason=reason)


def stopped(checked: Check[Campaign], model: JointModel | None) -> Diagnosis:
    """Return the diagnosis of data that nothing is concluded from."""
    unknown = float("nan")
    gap = Gap(unknown, unknown)
    if model is None:
        fitted = Fitted(unknown, unknown, unknown, unknown, 0, len(checked.measured.runs), unknown, unknown)
        model = JointModel(checked.measured.joint, (), (), fitted)
    return Diagnosis(
        verdict=UNDECIDED,
        reason=checked.reason,
        initial=gap,
        final=gap,
        noise_floor=gap,
        budget=NOT_DIVIDED,
        where=(),
        steps=(),
        advice=(),
        warnings=(checked.reason, *checked.warnings),
        model=model,
        soundness=checked.soundness,
        stopped=checked,
        trust=Trust((judge_soundness(checked.soundness, checked.measured.simulated, model.joint.motion),)),
    )
