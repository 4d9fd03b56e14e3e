"""The records of a diagnosis."""

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from sindyjoint.described import Maybe, Shown, same
from sindyjoint.diagnosis.effects.fitted import FittedEffect
from sindyjoint.diagnosis.parts import Budget, Place
from sindyjoint.equation.model import JointModel
from sindyjoint.equation.test_record import TestNuisances
from sindyjoint.numeric import Array
from sindyjoint.soundness import Soundness
from sindyjoint.soundness.check import Check
from sindyjoint.substructure.recovery import Update, UpdatedNumber
from sindyjoint.trust import Trust


@dataclass(frozen=True)
class KindNumbers:
    """Numbers of a kind of joint: value and standard error by name."""

    terms: dict[str, tuple[float, float]]
    elements: dict[str, dict[str, tuple[float, float]]]

    @classmethod
    def of(cls, model: JointModel) -> "KindNumbers":
        """Return those of a model."""
        return cls(
            {term.id: (term.coefficient, term.standard_error) for term in model.terms},
            {each.id: {n.name: (n.value, n.standard_error) for n in each.numbers} for each in model.elements},
        )


@dataclass(frozen=True, eq=False)
class InPlace:
    """What a diagnosis from the runs of a structure says of its joints and of itself.

    Parameters
    ----------
    lead : str
        The kind of joint whose model the diagnosis leads with.
    models : dict of str to JointModel
        By kind of joint, effects among them.
    update : Update or None
        Of the structure's uncertain numbers.
    """

    WRITTEN: ClassVar = same("lead", "kinds", "structure")
    lead: str
    models: dict[str, JointModel]
    update: Update | None

    @property
    def kinds(self) -> dict[str, KindNumbers]:
        """Numbers by kind of joint."""
        return {name: KindNumbers.of(model) for name, model in self.models.items()}

    @property
    def structure(self) -> tuple[UpdatedNumber, ...]:
        """The structure's uncertain numbers."""
        return () if self.update is None else self.update.numbers


@dataclass(frozen=True)
class Gap:
    """Relative RMS between model and measurement.

    Parameters
    ----------
    moment : float
        Of the transfer moment at measured states, moving samples, on runs left out of the fit.
    response : float
        Of the response simulated from the measured drive: the angle, or the moment where the motion is the drive. NaN
        where the simulation failed.
    """

    WRITTEN: ClassVar = same("moment", "response")
    moment: Maybe
    response: Maybe


@dataclass(frozen=True)
class Rival:
    """Another effect, and its probability."""

    effect: str
    probability: float


@dataclass(frozen=True)
class Step:
    """One effect found, and what it changed.

    Parameters
    ----------
    effect, family : str
    members : tuple of str
        Ids that the data cannot distinguish from it, itself included.
    probability : float
    rivals : tuple of (str, float)
        Other effects with their probabilities, the likeliest first.
    parameters : dict of str to float
        Coefficients and nonlinear parameters, SI.
    terms_dropped : tuple of str
    gap_before, gap_after : Gap
    units : dict of str to str
        Of the parameters.
    together : tuple of str
        Effects, itself included, of steps that make the gap smaller only together; the gaps are those before the first
        and after the last of them. Empty for a step that does so alone.
    """

    WRITTEN: ClassVar = {
        "effect": "effect",
        "class": "members",
        **same("family", "probability"),
        "rivals": "other_effects",
        **same("parameters", "units", "terms_dropped", "gap_before", "gap_after"),
        "together?": "together",
    }
    effect: str
    family: str
    members: tuple[str, ...]
    probability: float
    rivals: tuple[tuple[str, float], ...]
    parameters: dict[str, float]
    terms_dropped: tuple[str, ...]
    gap_before: Gap
    gap_after: Gap
    units: dict[str, str] = field(default_factory=dict)
    together: tuple[str, ...] = ()

    @property
    def other_effects(self) -> tuple[Rival, ...]:
        """Those that it is confused with."""
        return tuple(Rival(*each) for each in self.rivals)


@dataclass(frozen=True)
class Advice:
    """A run that would tell effects apart.

    Parameters
    ----------
    separates : tuple of str
    frequency : float
        Hz; zero where no run would help, and ``waveform`` says what to do instead.
    level : float
        Peak angle, rad.
    waveform : str
        Of the prescribed angle, f being the frequency.
    expected_confidence : float
        Probability that the true one of them should then have; of the second run for the same effects, after both.
    """

    WRITTEN: ClassVar = {
        "separates": "separates",
        "run": same("frequency", "level", "waveform"),
        "expected_confidence": "expected_confidence",
    }
    separates: tuple[str, ...]
    frequency: Maybe
    level: Maybe
    waveform: str
    expected_confidence: Maybe


@dataclass(frozen=True, eq=False)
class RunGap:
    """One run beside its model.

    Parameters
    ----------
    run : str
    level : str or None
    frequency : float
        Hz; zero where the run has none.
    repeats : bool
        Whether the rows are one mean period.
    time, angle, rate : ndarray, shape (m,)
        s, rad, rad/s; of moving samples.
    measured, model : ndarray, shape (m,)
        Transfer moment (with that of the inertia where this is identified), N·m.
    noise : float
        RMS of the noise of a row, N·m.
    curve : int
        How many rows, the first ones, belong to one segment of the run, of which curves may be drawn.
    """

    run: str
    level: str | None
    frequency: float
    repeats: bool
    time: Array
    angle: Array
    rate: Array
    measured: Array
    model: Array
    noise: float
    curve: int

    @property
    def residual(self) -> Array:
        """Measured less modelled moment, N·m, shape (m,)."""
        return self.measured - self.model


@dataclass(frozen=True, eq=False)
class RecordGap:
    """A record beside its simulation before and after the effects were added.

    Parameters
    ----------
    name : str
        The output point, and the rig where the record is of another one.
    time, measured : ndarray, shape (n,)
        s, m.
    before : ndarray, shape (n,) or None
        Of the model as it was given; None where it could not be simulated.
    after : ndarray, shape (n,) or None
        With the effects, fitted to what was not held out.
    noise : float
        RMS, m.
    held_from : float
        Time from which the record was kept out of the fit of `after`, s.
    gap_before, gap_after, noise_floor : float
        Relative RMS over what was held out.
    quantity, unit : str
        What was measured, and the SI unit.
    """

    name: str
    time: Array
    measured: Array
    before: Array | None
    after: Array | None
    noise: float
    held_from: float
    gap_before: float
    gap_after: float
    noise_floor: float
    quantity: str = "displacement"
    unit: str = "m"


NOT_SOUGHT, NOT_NEEDED, COMPLETE, STOPPED = "not_sought", "not_needed", "complete", "stopped"


@dataclass(frozen=True)
class AdviceSearch:
    """How far the search for runs that tell rivals apart went.

    Parameters
    ----------
    status : {"not_sought", "not_needed", "complete", "stopped"}
        Not sought: it was not asked for, or has not ended yet. Not needed: no class has rivals.
    tried, planned : int
        Runs that were looked at, and that there were to look at.
    reason : str
        When it was stopped, in words.
    """

    WRITTEN: ClassVar = same("status", "tried", "planned")
    status: str = NOT_SOUGHT
    tried: int = 0
    planned: int = 0
    reason: str = ""

    @property
    def warning(self) -> str:
        """What a result says of a search that was stopped; empty otherwise."""
        if self.status != STOPPED:
            return ""
        return (
            f"the search for runs that tell rivals apart ended {self.reason}, with {self.tried} of {self.planned} runs "
            "tried: there may be better ones, or one where none is named"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Shown):
    """The result of :func:`~sindyjoint.workflows.diagnose.diagnose`, of a campaign, and of ``diagnose_structure``.

    Parameters
    ----------
    verdict : {"nothing_missing", "named", "partly_named", "ambiguous", "unknown", "undecided"}
        Nothing missing and named (or ambiguous: a class that the data cannot separate) mean a gap within a factor of
        the noise floor; partly named, that effects help and a stated remainder is there; unknown, a gap without a name
        that helps; undecided, that no floor could be measured or the data are not sound.
    reason : str
        One sentence.
    initial, final, noise_floor : Gap
    budget : Budget
        Of the initial gap.
    where : tuple of Place
    steps : tuple of Step
    advice : tuple of Advice
    warnings : tuple of str
    model : JointModel
        With its terms estimated beside the effects.
    effects : tuple of FittedEffect
    whole : JointModel, optional
        The model with what the effects add to the joint's law: terms of angle and rate, and elements with a memory.
    test : TestNuisances, optional
        What belongs to the test and not to the joint: delays, offsets, drifts, an error of the inertia.
    hidden : str or None
        What a virtual test had hidden.
    source : {"campaign", "structure"}
        What it was made of: runs of a joint alone, or pulse records of a structure that holds it.
    before, after : tuple of RunGap
        Runs of a campaign beside the model as it was, and as it is with the effects; fitted to all runs that were not
        kept out.
    rig : str
        Name of a structure's rig.
    records : tuple of RecordGap
        Of a structure.
    soundness : Soundness, optional
        What the check of the data found; ``None`` where there is no campaign to check.
    stopped : Check, optional
        The check, where its findings are such that nothing was examined; the figures are NaN then.
    search : AdviceSearch
        How far runs to advise were sought.
    uncertainty : Gap
        What noise leaves of the numbers of the law, and of its drive, and the processing of its motion, beside the
        floor; zero where not asked for.
    in_place : InPlace, optional
        Models of all kinds of joints and the structure's numbers, of a diagnosis from the runs of a structure.
    trust : Trust, optional
        Of the model with its effects, and the campaign.
    """

    SCHEMA: ClassVar = 2
    WRITTEN: ClassVar = {
        **same("verdict", "reason", "trust"),
        "gap": same("initial", "final", "noise_floor", "uncertainty", "remainder"),
        **same("budget", "where", "steps", "advice"),
        "advice_search": "search",
        "warnings": "warnings",
        **{"soundness?": "soundness", "in_place?": "in_place"},
    }
    FILED: ClassVar = same("hidden")
    verdict: str
    reason: str
    initial: Gap
    final: Gap
    noise_floor: Gap
    budget: Budget
    where: tuple[Place, ...]
    steps: tuple[Step, ...]
    advice: tuple[Advice, ...]
    warnings: tuple[str, ...]
    model: JointModel
    effects: tuple[FittedEffect, ...] = field(default=(), repr=False)
    whole: JointModel | None = None
    test: TestNuisances | None = field(default=None, repr=False)
    hidden: str | None = None
    source: str = "campaign"
    before: tuple[RunGap, ...] = field(default=(), repr=False)
    after: tuple[RunGap, ...] = field(default=(), repr=False)
    rig: str = ""
    records: tuple[RecordGap, ...] = field(default=(), repr=False)
    soundness: Soundness | None = None
    stopped: Check[Any] | None = field(default=None, repr=False)
    trust: Trust | None = field(default=None, repr=False)
    search: AdviceSearch = AdviceSearch()
    uncertainty: Gap = Gap(0.0, 0.0)
    in_place: InPlace | None = field(default=None, repr=False)

    @property
    def level_unit(self) -> str:
        """Unit of the level of an advised run: of the joint's angle, or of a displacement."""
        turns = self.source == "campaign" and self.model.joint.motion == "rotation"
        return "rad" if turns else "m"

    @property
    def moments(self) -> tuple[FittedEffect, ...]:
        """The effects that add a moment and are no term of :attr:`whole`: with an internal state, or of a run."""
        return tuple(e for e in self.effects if e.effect.enters == "moment" and not e.is_term)

    @property
    def element_ids(self) -> tuple[str, ...]:
        """Effects that are elements of :attr:`whole`."""
        return () if self.whole is None else tuple(element.effect for element in self.whole.elements)

    @property
    def remainder(self) -> Gap:
        """What the model with its effects leaves beyond the noise floor."""
        pairs = zip(
            (self.final.moment, self.final.response),
            (self.noise_floor.moment, self.noise_floor.response),
            strict=True,
        )
        return Gap(
            *(float(np.sqrt(max(gap**2 - floor**2, 0.0))) if gap == gap else gap for gap, floor in pairs)
        )

    @property
    def settled(self) -> bool:
        """Whether the gap has a name, if only for a part of it, or there is none: exit status 0 of the command."""
        return self.verdict not in ("unknown", "undecided")
