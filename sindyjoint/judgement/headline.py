"""What everybody asks of a result first: can I trust it, and what next; made of a discovery."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from sindyjoint.described import Described, same
from sindyjoint.diagnosis.policy import CAMPAIGN as DIAGNOSIS
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.policy import POLICY as EQUATION
from sindyjoint.judgement.policy import POLICY
from sindyjoint.paper import JOINTS
from sindyjoint.text import list_some, percent, quantities, spelled

Colour = Literal["good", "fair", "poor"]
_ORDER: tuple[Colour, ...] = ("good", "fair", "poor")
# Commands that several headlines advise, and what they are for.
SEE_FAULTS = ("sindyjoint check CAMPAIGN --out soundness", "see the faults of the data in every channel")
VERIFY = ("sindyjoint verify RESULTS CAMPAIGN", "simulate the model and hold it against the runs")
EXPORT = ("sindyjoint export RESULTS --to FORMAT", "use the model in another program")
ANSWERS: dict[Colour, str] = {"good": "Yes", "fair": "With reservations", "poor": "Not yet"}


@dataclass(frozen=True)
class Light:
    """One of the reasons for trust or doubt.

    Parameters
    ----------
    name : str
        What is looked at, in a word or two: ``"data"``, ``"fit"``, ``"held out"``, ``"coverage"``.
    colour : {"good", "fair", "poor"}
    sentence : str
    """

    WRITTEN: ClassVar = same("colour", "sentence")
    name: str
    colour: Colour
    sentence: str


@dataclass(frozen=True)
class NextStep:
    """A command, or an action on the bench, and what it is for."""

    do: str
    to: str


@dataclass(frozen=True)
class Headline(Described):
    """The answers that stand above everything else.

    Parameters
    ----------
    lights : tuple of Light
    next_steps : tuple of (str, str)
        A command, or an action on the bench, and what it is for; the most useful first.
    """

    WRITTEN: ClassVar = {"answer": "colour", "lights": "lights_by_name", "next": "advised"}
    lights: tuple[Light, ...]
    next_steps: tuple[tuple[str, str], ...]

    @property
    def colour(self) -> Colour:
        """The worst of the lights."""
        return max((light.colour for light in self.lights), key=_ORDER.index)

    @property
    def answer(self) -> str:
        """Whether to trust it, in a word or two."""
        return ANSWERS[self.colour]

    @property
    def lights_by_name(self) -> dict[str, Light]:
        """The reasons."""
        return {light.name: light for light in self.lights}

    @property
    def advised(self) -> tuple[NextStep, ...]:
        """What to do next."""
        return tuple(NextStep(*step) for step in self.next_steps)


@dataclass(frozen=True)
class Excitations:
    """What was tested, as far as trust depends on it.

    Parameters
    ----------
    frequencies : tuple of float
        Of periodic runs, Hz.
    levels : tuple of str
    runs : int
    """

    frequencies: tuple[float, ...]
    levels: tuple[str, ...]
    runs: int


def is_of_the_paper(joint: str) -> bool:
    """Return whether a joint is one of the paper's, by its name."""
    return joint.strip().lower() in JOINTS


def make_headline(
    model: JointModel,
    tested: Excitations,
    held_out_rms: float,
    soundness: str,
    faults: Sequence[str],
) -> Headline:
    """Return the headline of a discovery.

    Parameters
    ----------
    model : JointModel
    tested : Excitations
    held_out_rms : float
        Error on the groups of runs that were left out, N·m; NaN where none could be.
    soundness : {"sound", "doubtful", "unsound"}
    faults : sequence of str
        Ids of findings of the check of the data, the severest first.
    """
    data = judge_soundness(soundness, faults, model.fitted.simulated)
    if not model.terms:
        nothing = (data, Light("fit", "poor", "no set of terms passed"))
        return Headline(nothing, _next_steps(nothing, tested, found=False))
    rms = model.fitted.moment_rms or math.nan
    lights = (
        data,
        judge_fit(model.fitted.residual_rms / rms, model.fitted.noise_floor / rms, model.joint.motion),
        _held_out(model, held_out_rms),
        judge_coverage(tested),
    )
    return Headline(lights, _next_steps(lights, tested, found=True, predicted=math.isfinite(held_out_rms)))


def judge_soundness(soundness: str, faults: Sequence[str], simulated: bool) -> Light:
    """Return what the check of the data found, as a light.

    Parameters
    ----------
    soundness : {"sound", "doubtful", "unsound"}
    faults : sequence of str
        Ids of findings, the severest first.
    simulated : bool
    """
    named = list_some([spelled(fault) for fault in dict.fromkeys(faults)], "findings")
    virtual = ", simulated" if simulated else ""
    if soundness == "sound":
        return Light("data", "good", f"sound{virtual}: nothing found that shifts a coefficient")
    return Light("data", "fair" if soundness == "doubtful" else "poor", f"{soundness}{virtual}: {named}")


def colour_of_misfit(relative: float, floor: float) -> Colour:
    """Return the colour of a misfit beside its measured noise floor, both relative RMS.

    Good is what noise and the processing leave, and no more: the limit from which a diagnosis calls something missing.
    """
    if relative <= DIAGNOSIS.within_floors * math.hypot(floor, DIAGNOSIS.processing_error):
        return "good"
    return "fair" if beyond_noise(relative, floor) <= POLICY.mostly_explained else "poor"


def beyond_noise(relative: float, floor: float) -> float:
    """Return what of a relative RMS is not noise."""
    return math.sqrt(max(relative**2 - floor**2, 0.0))


def judge_fit(relative: float, floor: float, motion: str) -> Light:
    """Return how well a model fits, as a light.

    Parameters
    ----------
    relative, floor : float
        RMS residual and noise floor of the moment relative to its RMS; the floor is NaN where it is unknown.
    motion : str
    """
    load = quantities(motion).moment.lower()
    if not math.isfinite(floor):
        colour: Colour = "fair" if relative <= EQUATION.tolerated_misfit else "poor"
        return Light("fit", colour, f"residual {percent(relative)} of the RMS {load}; its noise is unknown")
    colour = colour_of_misfit(relative, floor)
    sentence = f"residual {percent(relative)} of the RMS {load}, noise floor {percent(floor)}"
    neither = f"{sentence}: {percent(beyond_noise(relative, floor))} is neither"
    return Light("fit", colour, sentence if colour == "good" else neither)


def _held_out(model: JointModel, held_out_rms: float) -> Light:
    fitted = model.fitted
    if not (math.isfinite(held_out_rms) and fitted.residual_rms > 0 and fitted.moment_rms > 0):
        return Light("held out", "fair", "nothing could be left out, so nothing was predicted")
    ratio = held_out_rms / fitted.residual_rms
    colour: Colour = (
        "good" if ratio <= POLICY.predicts else "fair" if ratio <= POLICY.predicts_roughly else "poor"
    )
    error = percent(held_out_rms / fitted.moment_rms)
    return Light(
        "held out", colour, f"error {error} on runs left out of the fit, {ratio:.2f} times the residual"
    )


def judge_coverage(tested: Excitations) -> Light:
    """Return whether the runs tell alike terms apart, as a light."""
    frequencies, levels = len(set(tested.frequencies)), len(set(tested.levels))
    if not tested.frequencies:
        colour: Colour = "good" if tested.runs >= POLICY.enough else "fair"
        return Light("coverage", colour, f"{tested.runs} aperiodic run{'s' * (tested.runs != 1)}")
    least = min(frequencies, levels) if tested.levels else frequencies
    colour = "good" if least >= POLICY.enough else "fair" if tested.runs > 1 else "poor"
    written = f"{frequencies} frequenc{'ies' if frequencies != 1 else 'y'}"
    if tested.levels:
        written += f", {levels} level{'s' * (levels != 1)}"
    advice = "" if colour == "good" else f"; {POLICY.enough} of each tell the terms apart"
    return Light("coverage", colour, f"{written} in {tested.runs} run{'s' * (tested.runs != 1)}{advice}")


def _next_steps(
    lights: Sequence[Light], tested: Excitations, found: bool, predicted: bool = False
) -> tuple[tuple[str, str], ...]:
    """Return what to do, for each light that is not good in the order in which one depends on the other."""
    weak = {light.name for light in lights if light.colour != "good"}
    steps = []
    if "data" in weak:
        steps.append(SEE_FAULTS)
    if not found:
        steps.append(("sindyjoint compare CAMPAIGN", "see whether another method or library finds a model"))
        return tuple(steps)
    if "fit" in weak:
        steps.append(("sindyjoint diagnose CAMPAIGN", "find and name what the model lacks"))
    if "held out" in weak and predicted:
        steps.append(("sindyjoint compare CAMPAIGN", "see which terms hold at every frequency and method"))
    if "coverage" in weak or ("held out" in weak and not predicted):
        steps.append((advise_runs(tested), "tell terms apart that are alike on these runs"))
    if not weak:
        steps += [VERIFY, EXPORT]
    return tuple(steps[:2])


def advise_runs(tested: Excitations) -> str:
    """Return which runs to record next."""
    missing = []
    for have, what in ((len(set(tested.frequencies)), "frequenc"), (len(set(tested.levels)), "level")):
        need = POLICY.enough - have
        if need > 0:
            plural = {"frequenc": ("y", "ies"), "level": ("", "s")}[what][need > 1]
            missing.append(f"{need} more {what}{plural}")
    return (
        f"record runs at {' and '.join(missing)}" if tested.frequencies and missing else "record further runs"
    )
