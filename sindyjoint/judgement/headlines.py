"""Headlines of data, comparisons, diagnoses and verifications: the same two questions as of a discovery."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sindyjoint.judgement import (
    EXPORT,
    LACKING,
    SEE_FAULTS,
    TELL_ALIKE,
    VERIFY,
    Excitations,
    advise_runs,
    steps_of,
)
from sindyjoint.judgement.trust import colour_of_misfit, colour_of_size, judge_coverage, judge_soundness
from sindyjoint.limits import JUDGEMENT
from sindyjoint.soundness import Soundness
from sindyjoint.soundness.check import Check
from sindyjoint.text import list_some, percent, quantities, spelled
from sindyjoint.trust import ANSWERS, ORDER, Colour, Light, Trust, doubt

if TYPE_CHECKING:
    from sindyjoint.diagnosis.result import Diagnosis
    from sindyjoint.judgement.comparison import Choice, Comparison
    from sindyjoint.response.verification import Verification

Step = tuple[str, str]
DISCOVER = ("sindyjoint discover CAMPAIGN --out results", "find the terms of the joint’s equation")
OWN_EFFECTS = (
    "sindyjoint libraries copy effects/friction effects.toml",
    "write effects of your own into the copy, and try them: sindyjoint diagnose CAMPAIGN --library effects.toml",
)
# A step more than these is a list, not an advice.
MOST_STEPS = 2
NAMED: dict[str, Colour] = {"nothing_missing": "good", "named": "good", "unknown": "poor"}


def judge_check(check: Check[Any]) -> Trust:
    """Return whether a model can be made of some data, and what to do with them."""
    soundness, runs = check.soundness, check.measured.identification_runs
    subject = "RIG" if check.words.structure else "CAMPAIGN"
    stops, biases = _faults(soundness, "stops"), _faults(soundness, "biases")
    left_out = all(f.masked for f in soundness.findings if f.severity == "biases")
    accepted = "; accepted" if stops and not soundness.stopping else ""
    lights = (
        Light(
            "faults",
            "poor" if soundness.stopping else "fair",
            f"{_named(stops, check.words.motion)}{accepted}",
        )
        if stops
        else Light("faults", "good", "nothing found that prevents a model"),
        doubt(
            "bias",
            f"{_named(biases, check.words.motion)}{'; the samples are left out' * (left_out and bool(biases))}",
            "nothing found that shifts a coefficient",
        ),
        judge_coverage([run.frequency for run in runs], [run.level for run in runs]),
    )
    accept = "".join(f" --accept {name}" for name in dict.fromkeys(f.id for f in soundness.stopping))
    steps: list[Step] = [
        *((one.remedy, f"mend {one.run or 'all runs'}") for one in soundness.stopping[:1]),
        (
            f"sindyjoint discover {subject}{accept or ' --out results'}",
            "go on all the same" if accept else DISCOVER[1],
        ),
    ]
    if lights[-1].colour != "good":
        advised = advise_runs(Excitations.of(check.measured))
        steps.append((advised, TELL_ALIKE))
    return Trust(lights, tuple(steps[:MOST_STEPS]))


def judge_verification(result: Verification, simulated: bool, soundness: Soundness | None) -> Trust:
    """Return whether a model gives a response, and what to do with it.

    Of a campaign the lights are those of campaign and model; of a structure those of its response.
    """
    if result.response_nrmse is None:
        fit = Light("response", "poor", result.reason)
    else:
        known = result.noise_floor is not None
        colour: Colour = "poor" if not result.passed else "good" if known else "fair"
        floor = f"noise floor {percent(result.noise_floor)}" if known else "its noise is unknown"
        tolerated = f"{percent(result.tolerance)} beyond the noise is tolerated"
        fit = Light("response", colour, f"error {percent(result.response_nrmse)}, {floor}; {tolerated}")
    own = [fit]
    if result.kind == "campaign" or any(run.drive != "pulse" for run in result.runs):
        from sindyjoint.response.verification import seen_words

        # In a structure there is an entry for each sensor of a run.
        cut = ", " if result.kind == "rig" else "\n"
        words = seen_words({run.name.rsplit(cut, 1)[0]: run.seen for run in result.runs})
        fine = "no fit of the model has seen the runs that are compared"
        own.append(doubt("held out", "; ".join(words), fine))
    beyond = list_some(result.beyond_range)
    own.append(
        doubt("range", beyond and f"beyond what was tested: {beyond}", "within what the model was tested to")
    )
    if result.trust is not None:
        lights, question = result.trust.lights, tuple(own)
    else:
        names = {"response": "explained", "held out": "predicts", "range": "determined"}
        data = _of_data(soundness, simulated, result.model.joint.motion)
        lights, question = (*data, *(replace(light, name=names[light.name]) for light in own)), ()
    weak = Trust(lights, (), question).weak
    subject = "CAMPAIGN" if result.kind == "campaign" else "RIG"
    seen = any(run.seen is not False for run in result.runs) and weak & {"held out", "predicts"}
    keep = f'write use = "validate" to a run in {result.kind}.toml'
    steps = steps_of(
        ("data" in weak, SEE_FAULTS),
        (not result.passed, (f"sindyjoint diagnose {subject} --model MODEL", LACKING[1])),
        (seen, (keep, "compare with a run that was not fitted to")),
        (beyond, (f"record runs that go as far as {beyond}", "fit the model where it is used")),
    )
    return Trust(
        lights, tuple((steps or [(EXPORT[0].replace("RESULTS", "MODEL"), EXPORT[1])])[:MOST_STEPS]), question
    )


def judge_diagnosis(result: Diagnosis, simulated: bool) -> Trust:
    """Return whether to believe a diagnosis, and what to do next."""
    own = []
    pairs = ((quantities(result.model.joint.motion).moment.lower(), "moment"), ("response", "response"))
    for name, field in pairs:
        before, after, floor, unsure = (
            getattr(gap, field)
            for gap in (result.initial, result.final, result.noise_floor, result.uncertainty)
        )
        if math.isfinite(before) or math.isfinite(after):
            first = f"{percent(before)} → " if result.steps and math.isfinite(before) else ""
            # Of a campaign without validation runs the response is simulated over all runs.
            left_out = " on data left out of the fit" * (field == "moment" or result.source == "structure")
            what = f"gap {first}{percent(after)}{left_out}"
            own.append(_gap(name, what, after, floor, unsure))
    # The figures of the reason, behind its first clause, stand in the lights of the gaps.
    words = result.reason if result.verdict == "undecided" else result.reason.partition(";")[0]
    own.append(Light("effects", NAMED.get(result.verdict, "fair"), words))
    if result.trust is not None:
        lights, question = result.trust.lights, tuple(own)
    else:
        data = _of_data(result.soundness, simulated, result.model.joint.motion)
        worst = max(own[:-1] or own, key=lambda light: ORDER.index(light.colour))
        known = f"{ANSWERS[worst.colour].lower()}: see the gap of the {worst.name}"
        lights, question = (*data, Light("explained", worst.colour, known)), tuple(own)
    return Trust(lights, tuple(_steps_of_diagnosis(result, lights)[:MOST_STEPS]), question)


def _gap(name: str, what: str, after: float, floor: float, unsure: float) -> Light:
    """Return what a gap came to, as a light; where only the uncertainty of the law explains it, it says so."""
    if not math.isfinite(after):
        return Light(name, "poor", f"{what}: could not be simulated")
    if not math.isfinite(floor):
        return Light(name, colour_of_size(after), f"{what}; its noise is unknown")
    sentence, noise = f"{what}, noise floor {percent(floor)}", colour_of_misfit(after, floor)
    if noise == "good" or not unsure > floor:
        return Light(name, colour_of_misfit(after, math.hypot(floor, unsure)), sentence)
    # What the uncertainty of the law explains is no fault of it, and no proof either.
    sentence += f"; the uncertainty of numbers and drive leaves {percent(unsure)}"
    colour = colour_of_misfit(after, math.hypot(floor, unsure))
    return Light(name, "fair" if colour == "good" else colour, sentence)


def _steps_of_diagnosis(result: Diagnosis, lights: Sequence[Light]) -> list[Step]:
    """Return what to do after a diagnosis, the most useful first."""
    steps = [SEE_FAULTS] if lights[0].name == "data" and lights[0].colour != "good" else []
    motion = result.model.joint.motion
    for advice in result.advice[:1]:
        if advice.frequency:
            level = f"{advice.level:.3g} {result.level_unit}"
            run = f"record a {advice.waveform} at {advice.frequency:.4g} Hz with a peak of {level}"
            named = " and ".join(spelled(n, motion) for n in advice.separates)
            certainty = f"the true one should then have a probability of {advice.expected_confidence:.2f}"
            steps.append((run, f"tell {named} apart: {certainty}"))
    unknown = result.verdict == "undecided" and not math.isfinite(result.noise_floor.moment)
    declare = ('write noise = "0.02 N*m" to a channel in campaign.toml', "have a noise floor to judge by")
    steps += steps_of((result.verdict in ("unknown", "partly_named"), OWN_EFFECTS), (unknown, declare))
    if not steps and result.verdict == "ambiguous":
        fitted = result.model.fitted
        steps.append(
            (advise_runs(Excitations(fitted.frequencies, (), fitted.runs)), "tell the effects apart")
        )
    target = "CAMPAIGN" if result.source == "campaign" else "RIG"
    if result.settled:
        model = "repaired model" if result.steps else "model"
        steps.append((VERIFY[0].replace("CAMPAIGN", target), f"simulate the {model} and compare"))
    return [*steps, EXPORT] if result.verdict in ("named", "nothing_missing") else steps or [SEE_FAULTS]


def judge_comparison(result: Comparison) -> Trust:
    """Return whether methods, frequencies and resampled campaigns agree on the model, and what to do next."""
    ids = set(result.model.ids)
    share = dict(zip(result.ids, result.inclusion, strict=True))
    lights = (
        (judge_soundness(result.soundness, result.simulated, result.motion),)
        if result.trust is None
        else result.trust.lights
    )
    if not ids:
        return Trust(lights, (SEE_FAULTS,), (Light("model", "poor", result.model.reason),))
    own = [_agreement("methods", "methods", ids, result.methods)]
    if result.frequencies:
        own.append(_agreement("single", f"single {result.several}", ids, result.frequencies))
    least = min((share[term] for term in ids if term in share), default=math.nan)
    if math.isfinite(least):
        colour: Colour = (
            "good" if least >= JUDGEMENT.confident else "fair" if least >= JUDGEMENT.mostly else "poor"
        )
        own.append(
            Light(
                "resampled",
                colour,
                f"each term is chosen in at least {percent(least)} of resampled campaigns",
            )
        )
    if result.tests:
        own.append(_constancy(result))
    weak = Trust(lights, (), tuple(own)).weak
    found = result.discovery
    tested = Excitations((), (), 0) if found is None else Excitations.of(found.campaign)
    steps = steps_of(
        ("data" in weak, SEE_FAULTS),
        ("explained" in weak, LACKING),
        ("frequency" in weak, (LACKING[0], "find and name what makes coefficients change")),
        (weak & {"methods", "single", "resampled"}, (advise_runs(tested), TELL_ALIKE)),
    )
    return Trust(
        lights,
        tuple((steps or [DISCOVER, (VERIFY[0].replace("RESULTS", "results"), VERIFY[1])])[:MOST_STEPS]),
        tuple(own),
    )


def _constancy(result: Comparison) -> Light:
    """Return whether the coefficients are the same at every frequency, as a light."""
    answers = {test.name: test.answer for test in result.tests}
    for answer, words in (
        ("depends on frequency", "changes with frequency"),
        ("cannot tell", "a change with frequency is not ruled out"),
    ):
        terms = [spelled(name, result.motion) for name, given in answers.items() if given == answer]
        if terms:
            return Light("frequency", "fair", f"{words}: {list_some(terms, 'terms')}")
    return Light("frequency", "good", "every coefficient is the same at every frequency, within the margin")


def _agreement(name: str, what: str, ids: set[str], choices: Sequence[Choice]) -> Light:
    """Return how many choices lead to the model's terms, as a light."""
    same = sum(set(choice.ids) - {"inertia"} == ids - {"inertia"} for choice in choices)
    colour: Colour = "good" if same == len(choices) else "fair" if 2 * same >= len(choices) else "poor"
    return Light(name, colour, f"{same} of {len(choices)} {what} lead to the model’s terms")


def _of_data(soundness: Soundness | None, simulated: bool, motion: str) -> list[Light]:
    return [] if soundness is None else [judge_soundness(soundness, simulated, motion)]


def _faults(soundness: Soundness, severity: str) -> list[str]:
    return [f.id for f in soundness.findings if f.severity == severity]


def _named(faults: Sequence[str], motion: str) -> str:
    return list_some([spelled(fault, motion) for fault in dict.fromkeys(faults)], "findings")
