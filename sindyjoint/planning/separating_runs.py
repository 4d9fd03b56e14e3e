"""The runs of a plan that separate effects: the search for them is that of the advice of a diagnosis."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sindyjoint.diagnosis.campaign.designs import PLANNED, hidden_law
from sindyjoint.diagnosis.effects import Effect, load_effects, select_effects
from sindyjoint.diagnosis.policy import CAMPAIGN
from sindyjoint.diagnosis.result import Advice, Diagnosis, Step
from sindyjoint.equation.model import JointModel
from sindyjoint.errors import InputError, SindyJointError
from sindyjoint.mechanics import Law, SumLaw
from sindyjoint.mechanics.excitation import SINE, Actuator
from sindyjoint.mechanics.virtual import VirtualTest
from sindyjoint.planning import PlannedRun
from sindyjoint.planning.information import Sensors
from sindyjoint.planning.plan import UNITS, Separation, play
from sindyjoint.record import Campaign
from sindyjoint.response.laws import model_law
from sindyjoint.text import list_some, percent, spelled

Say = Callable[[str], None]


def rivals_of(path: str | Path) -> tuple[str, ...]:
    """Return the effects that a diagnosis could not tell apart, of the first class that has several.

    Raises
    ------
    InputError
        For a file that is no diagnosis, or has no such class.
    """
    place = Path(path)
    place = place / "diagnosis.json" if place.is_dir() else place
    try:
        steps = json.loads(place.read_text(encoding="utf-8"))["steps"]
        classes = [tuple(map(str, step["members"])) for step in steps]
    except OSError as error:
        raise InputError(
            f"{place}: {error.strerror or error}; expected the diagnosis.json of a diagnosis"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"{place}: no diagnosis; expected what 'diagnose --out' writes") from None
    found = next((members for members in classes if len(members) > 1), None)
    if found is None:
        raise InputError(f"{place}: every effect is told apart already; give the effects")
    return found


def chosen_effects(names: Sequence[str]) -> tuple[Effect, ...]:
    """Return the effects of some names, two at least.

    Raises
    ------
    InputError, UnknownNameError
    """
    found = select_effects(load_effects(), list(dict.fromkeys(names)))
    if len(found) < 2:
        raise InputError(
            f"effects are {', '.join(names) or 'not given'}; expected two or more to be told apart"
        )
    return found


def probability_of(result: Diagnosis, name: str, effects: Sequence[str]) -> float:
    """Return the probability of an effect among some, by a diagnosis; zero where none of them was found."""
    step = _step(result, effects)
    return 0.0 if step is None else dict(_all(step)).get(name, 0.0)


def _all(step: Step) -> tuple[tuple[str, float], ...]:
    return ((step.effect, step.probability), *step.rivals)


def _step(result: Diagnosis, effects: Sequence[str]) -> Step | None:
    return next((step for step in result.steps if {*step.members} & {*effects}), None)


def _words(
    names: Sequence[str], after: Sequence[float], advice: Sequence[Advice], motion: str, before: float = 0.0
) -> str:
    who = list_some([spelled(name, motion) for name in names], "effects")
    if after and after[-1] < before + CAMPAIGN.little_confidence:
        return f"{who}: no run that was tried separates them as they are known; along the planned they differ most"
    if after:
        return f"{who}: the true one is then expected to have {percent(after[-1])}"
    said = next((each.waveform for each in advice), "the search for a run was ended before it found one")
    return f"{who} stay one class, {said}"


def planned_run(advice: Advice, actuator: Actuator, model: JointModel, duration: float) -> PlannedRun:
    """Return an advised run as a plan has it; the moment that moves the joint so far is the model's."""
    duration = max(duration, 6 / advice.frequency)
    unit = UNITS[actuator.drive][model.joint.motion != "rotation"]
    if actuator.drive == "angle":
        return PlannedRun("angle", PLANNED[advice.waveform], advice.frequency, advice.level, unit, duration)
    test = VirtualTest(
        model_law(model), (advice.frequency,), (1.0,), "moment", max(1000.0, 20 * advice.frequency), duration,
        angle_limit=advice.level,
    )  # fmt: skip
    level = float(f"{test.amplitude(advice.frequency, 1.0):.4g}")
    return PlannedRun("moment", SINE, advice.frequency, level, unit, duration)


# The effect that is true in a joint of the range, and a virtual test of that joint with some runs more.
Hypothesis = tuple[str, Callable[..., Campaign]]


def simulate_hypotheses(
    joints: Sequence[JointModel],
    effects: Sequence[Effect],
    runs: Sequence[PlannedRun],
    sensors: Sensors,
    share: float,
    random_state: int,
) -> list[Hypothesis]:
    """Return a joint of the range for each effect, which adds a share of the moment there."""
    peak = max(float(np.abs(play(model_law(joints[0]), [run], sensors).runs[0].angle).max()) for run in runs)
    frequencies = sorted({run.frequency for run in runs})
    hypotheses: list[Hypothesis] = []
    for number, (joint, effect) in enumerate(zip(joints, effects, strict=True)):
        law = model_law(joint)
        generator = np.random.default_rng([random_state, number])
        added = hidden_law(effect.id, law, peak, frequencies, generator, share)

        def test(
            *further: PlannedRun, law: Law = SumLaw(law, added), seed: int = random_state + number
        ) -> Campaign:
            return play(law, [*runs, *further], sensors, seed)

        hypotheses.append((effect.id, test))
    return hypotheses


@dataclass(frozen=True)
class SeparatingRuns:
    """A search for runs that separate effects.

    Parameters
    ----------
    effects : sequence of Effect
    actuator : Actuator
        What makes the runs.
    duration : float
        Of a run, s.
    diagnose : callable
        :func:`~sindyjoint.diagnose`.
    say : callable
        Called with the name of each stage.
    """

    effects: Sequence[Effect]
    actuator: Actuator
    duration: float
    diagnose: Callable[..., Diagnosis]
    say: Say

    @property
    def names(self) -> tuple[str, ...]:
        """Ids of the effects."""
        return tuple(effect.id for effect in self.effects)

    def after_runs(
        self, campaign: Campaign | str | Path, model: JointModel | None
    ) -> tuple[tuple[PlannedRun, ...], Separation, JointModel]:
        """Return the runs that would separate the effects that a campaign does not, what that comes to, its model."""
        names = self.names
        result = self._diagnosed(campaign, model, actuator=self.actuator, progress=self.say)
        step = _step(result, names)
        motion = result.model.joint.motion
        if step is None:
            words = f"the campaign shows none of them: {result.reason}"
            return (), Separation(names, float("nan"), (), words), result.model
        best = max(probability for _, probability in _all(step))
        if len(step.members) < 2:
            words = f"told apart already: {spelled(step.effect, motion)}, {percent(step.probability)}"
            return (), Separation(names, best, (), words), result.model
        runs = [each for each in result.advice if each.frequency]
        after = tuple(float(each.expected_confidence) for each in runs)
        words = _words(names, after, result.advice, motion, best)
        return self._planned(result), Separation(names, best, after, words), result.model

    def before_runs(self, hypotheses: Sequence[Hypothesis]) -> tuple[tuple[PlannedRun, ...], Separation]:
        """Return the run that separates the effects in virtual tests of all hypotheses, and what that comes to.

        Each hypothesis asks for the run that separates best there; all of these are tried under all hypotheses.
        """
        names = self.names
        before, asked, advice = [], list[PlannedRun](), list[Advice]()
        motion = "rotation"
        for number, (truth, test) in enumerate(hypotheses, 1):
            self.say(f"virtual test {number} of {len(hypotheses)}: {spelled(truth)} is true")
            found = self._diagnosed(test(), actuator=self.actuator)
            motion = found.model.joint.motion
            before.append(probability_of(found, truth, names))
            advice += found.advice
            asked += self._planned(found)
        start = float(np.mean(before))
        if start >= Separation.enough:
            return (), Separation(names, start, (), f"the other runs tell them apart: {percent(start)}")
        best, after = None, start
        for number, run in enumerate(dict.fromkeys(asked), 1):
            self.say(f"run {number} of {len(set(asked))} in every virtual test")
            sure = float(np.mean([self._again(hypothesis, run) for hypothesis in hypotheses]))
            if sure > after:
                best, after = run, sure
        if best is None:
            words = _words(names, (), [each for each in advice if not each.frequency], motion)
            return (), Separation(names, start, (), words)
        return (best,), Separation(names, start, (after,), _words(names, (after,), (), motion))

    def _again(self, hypothesis: Hypothesis, run: PlannedRun) -> float:
        """Return how sure a hypothesis's effect is with one run more."""
        truth, test = hypothesis
        try:
            found = self._diagnosed(test(run), advise=False)
        except SindyJointError:
            # A run that this joint does not bear.
            return 0.0
        return probability_of(found, truth, self.names)

    def _diagnosed(
        self, campaign: Campaign | str | Path, model: JointModel | None = None, **options: Any
    ) -> Diagnosis:
        return self.diagnose(campaign, model, effects=self.effects, max_effects=1, rng=0, **options)

    def _planned(self, found: Diagnosis) -> tuple[PlannedRun, ...]:
        """Return the runs that a diagnosis advises, as a plan has them."""
        return tuple(
            planned_run(each, self.actuator, found.model, self.duration)
            for each in found.advice
            if each.frequency
        )
