"""The records of a comparison: methods, frequencies and libraries against terms."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from sindyjoint.described import Maybe, Shown, same
from sindyjoint.discovery.frequency import FrequencyTest
from sindyjoint.discovery.uncertainty import CrossValidation
from sindyjoint.equation.model import JointModel
from sindyjoint.judgement import is_of_the_paper
from sindyjoint.judgement.discovery import Discovery
from sindyjoint.paper import TERMS as PAPER_TERMS
from sindyjoint.soundness import Soundness
from sindyjoint.trust import Trust


@dataclass(frozen=True)
class ChosenTerm:
    """A term in one of the compared models.

    Parameters
    ----------
    id : str
    coefficient, standard_error : float
        SI.
    interval95 : tuple of float
    """

    id: str
    coefficient: float
    standard_error: Maybe
    interval95: tuple[Maybe, Maybe]

    @classmethod
    def of(cls, model: JointModel) -> "tuple[ChosenTerm, ...]":
        """Return the terms of a model."""
        return tuple(cls(t.id, t.coefficient, t.standard_error, t.interval95) for t in model.terms)


@dataclass(frozen=True)
class SizeScore:
    """The model of one size on a method's path.

    Parameters
    ----------
    size : int
    terms : tuple of str
    residual, held_out : float
        RMS residual, and RMS error of held-out frequencies, relative to the RMS moment; NaN where nothing is held out.
    """

    size: int
    terms: tuple[str, ...]
    residual: Maybe
    held_out: Maybe


@dataclass(frozen=True)
class Choice:
    """What one method, frequency or library leads to.

    Parameters
    ----------
    name : str
    terms : tuple of ChosenTerm
        Empty where no set passed.
    reason : str
    candidates : int
    residual : float
        RMS residual of the moment relative to its RMS.
    seconds : float
        Time that making the path took; NaN where not measured.
    held_out : float
        RMS error of the moment of held-out frequencies, terms chosen anew each time, relative to its RMS; of what a
        single frequency or level leads to, of the others.
    held_out_error : float
        Its standard error, by how the held-out frequencies scatter.
    response : float
        RMS error of the simulated angle of held-out frequencies relative to its RMS; NaN where not simulated.
    not_simulated : str
        Why there is none.
    path : tuple of SizeScore
    offers_paper_terms : bool
        Whether all five of the paper's terms were among the candidates.
    not_given : tuple of str
        What the search of a method for sets of terms cannot be given.
    wanted : tuple of str
        The paper's terms that these data can show.
    dependences : tuple of (str, str)
        Chosen terms by which one of the paper's depends on an input, and that one.
    """

    name: str
    terms: tuple[ChosenTerm, ...]
    reason: str
    candidates: int
    seconds: Maybe = float("nan")
    held_out: Maybe = float("nan")
    response: Maybe = float("nan")
    not_simulated: str = ""
    path: tuple[SizeScore, ...] = ()
    offers_paper_terms: bool = True
    not_given: tuple[str, ...] = ()
    residual: Maybe = float("nan")
    wanted: tuple[str, ...] = PAPER_TERMS
    dependences: tuple[tuple[str, str], ...] = ()
    held_out_error: Maybe = float("nan")

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the terms."""
        return tuple(term.id for term in self.terms)

    def beside(self, terms: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the chosen terms that are not among others, and which of those are missing; the inertia aside.

        A term by which another one depends on an input is that one, at each level of the input.
        """
        there = {*self.ids, *(term for _, term in self.dependences)}
        changing = {name for name, _ in self.dependences if name not in terms}
        extra = tuple(term for term in self.ids if term not in {*terms, "inertia", *changing})
        return extra, tuple(term for term in terms if term not in {*there, "inertia"})

    @property
    def missing(self) -> tuple[str, ...]:
        """The paper's terms that were not chosen, at any level of the inputs."""
        return self.beside(self.wanted)[1]

    @property
    def extra(self) -> tuple[str, ...]:
        """Chosen terms that are not the paper's, at any level of the inputs, the inertia aside."""
        return self.beside(self.wanted)[0]

    @property
    def agrees(self) -> bool:
        """Whether these are exactly the paper's terms, at each level of the inputs."""
        return not self.missing and not self.extra

    def __getitem__(self, term_id: str) -> ChosenTerm | None:
        return next((term for term in self.terms if term.id == term_id), None)


@dataclass(frozen=True)
class GivenModel:
    """A model that was there before, whole, held against the same runs.

    Parameters
    ----------
    terms : tuple of str
    elements : tuple of str
        Effects with an internal state.
    residual : float
        Error of the moment along the measured motion relative to its RMS.
    response : float
        Error of the simulated response relative to its RMS; NaN where it cannot be simulated.
    seen : bool
        Whether a fit of it has used runs of this campaign.
    """

    terms: tuple[str, ...]
    elements: tuple[str, ...]
    residual: Maybe
    response: Maybe
    seen: bool


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """The result of :func:`~sindyjoint.workflows.compare.compare`.

    Parameters
    ----------
    joint : str
    motion : str
    simulated : bool
    ids : tuple of str
        All candidates of the main library.
    units : dict of str
        Id to unit, of every term that any of the choices holds.
    methods, frequencies, levels, libraries : tuple of Choice
        Of each frequency the terms that its runs alone lead to, of each level too.
    inclusion : tuple of float
        Probability of each candidate when blocks and runs are resampled.
    sets : tuple of (tuple of str, float)
        The most frequent sets of the replicates and their shares.
    left_out : dict of CrossValidation
        By "frequency", "level" or "run", and by the levels of each input; by "time" the parts of a single run.
    tests : tuple of FrequencyTest
        Of the model's coefficients.
    model : Choice
        Terms of the main method with their intervals.
    undetermined : tuple of str
        Sentences on terms that these runs do not tell apart.
    warnings : tuple of str
    seconds : dict of float
        Time of each stage.
    soundness : Soundness
        What the check of the data found.
    noise_floor : float
        Of the moment relative to its RMS; NaN where it is unknown.
    given : GivenModel, optional
    parts : {"frequency", "level", "run"}
        What ``frequencies`` are of: samples without time, and aperiodic runs, have none.
    trust : Trust, optional
        Of the discovered model and the campaign.
    friction : tuple of Choice
        Laws of dry friction, fitted as they are, where an input is a load.
    """

    SCHEMA: ClassVar = 1
    WRITTEN: ClassVar = {
        **same(
            "kind",
            "agreement",
            "trust",
            "joint",
            "motion",
            "simulated",
            "ids",
            "units",
            "methods",
            "frequencies",
            "levels",
        ),
        **same("libraries", "inclusion", "sets", "left_out", "tests", "model", "undetermined", "warnings"),
        **same("seconds", "noise_floor", "given", "parts", "soundness", "friction"),
    }
    joint: str
    motion: str
    simulated: bool
    ids: tuple[str, ...]
    units: dict[str, str]
    methods: tuple[Choice, ...]
    frequencies: tuple[Choice, ...]
    libraries: tuple[Choice, ...]
    inclusion: tuple[Maybe, ...]
    sets: tuple[tuple[tuple[str, ...], float], ...]
    left_out: dict[str, CrossValidation]
    tests: tuple[FrequencyTest, ...]
    model: Choice
    undetermined: tuple[str, ...]
    warnings: tuple[str, ...]
    seconds: dict[str, Maybe]
    discovery: Discovery = field(repr=False, compare=False)
    soundness: Soundness = Soundness()
    noise_floor: Maybe = float("nan")
    given: GivenModel | None = None
    parts: Literal["frequency", "level", "run"] = "frequency"
    trust: Trust | None = None
    levels: tuple[Choice, ...] = ()
    friction: tuple[Choice, ...] = ()

    @property
    def groups(self) -> dict[str, tuple[Choice, ...]]:
        """What was compared, by what: method, frequency, level, library, law of friction."""
        groups = {"method": self.methods, self.parts: self.frequencies}
        more = {"level": self.levels, "library": self.libraries, "friction law": self.friction}
        return groups | {by: choices for by, choices in more.items() if choices}

    @property
    def several(self) -> str:
        """What the parts are called where there is more than one."""
        return {"frequency": "frequencies"}.get(self.parts, f"{self.parts}s")

    @property
    def shown_ids(self) -> tuple[str, ...]:
        """Terms worth a column: those held against, and every one that a choice holds or that a replicate chose."""
        held = {term for choices in self.groups.values() for choice in choices for term in choice.ids}
        held |= {term for term, share in zip(self.ids, self.inclusion, strict=True) if share > 0}
        others = [term for term in (*self.ids, *sorted(held)) if term in held and term not in self.reference]
        return (*self.reference, *dict.fromkeys(others))

    @property
    def wanted(self) -> tuple[str, ...]:
        """The paper's terms that these data can show."""
        return self.model.wanted

    @property
    def paper_set(self) -> str:
        """What those are called."""
        return "the paper's five terms" if self.wanted == PAPER_TERMS else "the paper's terms without rate"

    @property
    def of_paper(self) -> bool:
        """Whether choices are held against the paper's terms: of its joints, and where that was asked for."""
        return is_of_the_paper(self.joint) or getattr(self.discovery, "paper", False)

    @property
    def reference(self) -> tuple[str, ...]:
        """The terms that every choice is held against: the paper's, or of a joint that is not its the model's."""
        return self.wanted if self.of_paper else self.model.ids

    @property
    def agreement(self) -> str:
        """One sentence on how many of the methods, frequencies and libraries lead to the terms held against."""
        offering = tuple(c for c in self.libraries if c.offers_paper_terms or not self.of_paper)
        groups = {
            "methods": self.methods,
            f"single {self.several}": self.frequencies,
            "single levels": self.levels,
            f"libraries{' that offer them' * self.of_paper}": offering,
        }
        parts = [
            f"{sum(not any(c.beside(self.reference)) for c in choices)} of {len(choices)} {name}"
            for name, choices in groups.items()
            if choices
        ]
        levels = any(choice.dependences for choices in self.groups.values() for choice in choices)
        whose = self.paper_set if self.of_paper else "the model's terms"
        return f"{'at each level ' * levels}exactly {whose}: " + ", ".join(parts)

    @property
    def kind(self) -> Literal["Comparison"]:
        """What the record is of."""
        return "Comparison"
