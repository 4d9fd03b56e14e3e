"""What a diagnosis asks of its data: of a campaign of runs, or of the pulse record of a structure."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, Self, TypeVar

from sindyjoint.diagnosis.budget import Budget
from sindyjoint.diagnosis.effort import Effort
from sindyjoint.diagnosis.inadmissible import Inadmissible
from sindyjoint.diagnosis.localisation import Place
from sindyjoint.diagnosis.policy import DiagnosisPolicy
from sindyjoint.diagnosis.ranking import Candidate, Ranking
from sindyjoint.diagnosis.result import Advice, Diagnosis, Gap, Step
from sindyjoint.diagnosis.verdict import Residual

Say = Callable[[str], None]


@dataclass(frozen=True)
class Proposal:
    """The candidates that a round may add.

    Parameters
    ----------
    ranking : Ranking
        Of those whose signs the catalogue admits.
    paired : bool
        Whether the first one stands there because of a second beside it.
    doubts : tuple of Inadmissible
        A candidate with another sign that clearly leads them all.
    """

    ranking: Ranking[Any]
    paired: bool = False
    doubts: tuple[Inadmissible, ...] = ()


P = TypeVar("P", bound="Problem")


@dataclass(frozen=True)
class Added(Generic[P]):
    """A problem with one effect more.

    Parameters
    ----------
    problem : Problem
    again : mapping of str to Ranking or None
        Effects found before that were tested again: the candidates for their place, or None where they are needless.
    """

    problem: P
    again: Mapping[str, Ranking[Any] | None]


@dataclass(frozen=True)
class Start(Generic[P]):
    """Where a search begins.

    Parameters
    ----------
    problem : Problem
    steps : tuple of Step
        What it has found before.
    words : str
        How it differs from the model as it was given.
    before : Problem, optional
        The problem without those steps.
    """

    problem: P
    steps: tuple[Step, ...] = ()
    words: str = ""
    before: P | None = None

    @property
    def free(self) -> int:
        """Number of its steps: they do not count among the effects that may be added."""
        return len(self.steps)


class Problem(Protocol):
    """A gap to explain, and the effects added to the model so far. Immutable: adding one gives another problem."""

    @property
    def policy(self) -> DiagnosisPolicy:
        """Its limits."""

    @property
    def found(self) -> Sequence[Candidate]:
        """The effects added, with the numbers of the last fit."""

    @property
    def parameters(self) -> dict[str, dict[str, float]]:
        """Numbers of the effects added, by the effects' names."""
        return {each.name: dict(each.parameters) for each in self.found}

    @property
    def dropped(self) -> tuple[str, ...]:
        """Terms of the model that the last effect made needless."""
        return ()

    @property
    def noise_measured(self) -> bool:
        """Whether repetition, or the record itself, has measured the noise of every row: any gain then counts."""
        return True

    @property
    def is_noise(self) -> bool:
        """Whether it is sure, without a further search, that nothing but noise remains."""
        return False

    @property
    def numbers(self) -> int:
        """Numbers of the law: coefficients of the model and the effects, and nonlinear parameters."""
        return 0

    @property
    def gap(self) -> Gap:
        """On data left out of the fit, with the effects."""

    @property
    def initial_gap(self) -> Gap:
        """On data left out of the fit, of the model as it was given."""
        return self.gap

    @property
    def noise_floor(self) -> Gap:
        """What does not repeat."""

    @property
    def floor_is_bound(self) -> bool:
        """Whether that is only an upper bound."""
        return False

    def replaced(self, name: str, other: Any) -> Self | None:
        """Return the problem with one of its effects replaced by another one; None where that is not possible."""
        return None

    def zero_errors(self, refused: Collection[str]) -> Ranking[Any] | None:
        """Return the zero errors of the channels in order of probability; None where none is believed."""
        return None

    def without_delay(self) -> tuple[Self, str] | None:
        """Return the problem with the channels in their own time, and what its delay is called; None without one."""
        return None

    def ranked_again(self, name: str, members: Collection[str]) -> Ranking[Any] | None:
        """Return the members of a class that one effect leads, ranked beside the others; None without any."""
        return None

    def gap_without(self, names: Collection[str]) -> Gap:
        """Return the gap without some of the effects, the others fitted anew."""
        return self.gap

    def floor(self) -> Gap:
        """Return what noise leaves of the law: where its motion is measured, more than the noise of the channels."""
        return self.noise_floor

    def uncertainty(self) -> Gap:
        """Return the gaps that noise alone leaves, beside the floor: numbers come from noisy data, and so do drives."""
        return Gap(0.0, 0.0)

    def corrected(self) -> tuple[Self, tuple[Step, ...]]:
        """Return the problem with channels put right that drift for all to see, and the steps that this took."""
        return self, ()

    def propose(self, refused: Collection[str], pairs: bool, say: Say) -> Proposal | None:
        """Return the candidates in order of probability; None where there are none."""

    def complaint(self, candidate: Any = None) -> str:
        """Return what physics has against a candidate, or against the law with the effects; empty if nothing."""
        return ""

    def add(self, best: Any) -> Added[Self] | None:
        """Return the problem with an effect more, everything fitted together; None where the fit fails."""

    def units(self, fitted: Any) -> dict[str, str]:
        """Return the units of an effect's parameters."""

    def finished(self) -> Self:
        """Return the problem after a last refinement of its numbers."""
        return self

    def other_starts(
        self, straight: Self, last: Self, say: Say, whole: bool = False
    ) -> Iterator[Start[Self]]:
        """Yield other starts worth a search, where the one from the model as it was given ended in ``last``.

        Where nothing is left to explain (``whole``), only those with the channels put right.
        """
        return iter(())

    def zero_start(self, straight: Self, last: Self, say: Say) -> Start[Self] | None:
        """Return the start with displacements counted from the joint's own zero; None where no zero error was found."""
        return None

    def residual(self, straight: Self) -> Residual:
        """Return what the effects leave of the gap that channels put right had."""

    def budget(self, first: Self, last: Self) -> Budget:
        """Return the parts of the first problem's gap; this one is it with its channels put right."""

    def places(self) -> tuple[Place, ...]:
        """Return where the gap of the model as it was given lies."""

    def separating_runs(self, step: Step, ranking: Ranking[Any], effort: Effort) -> tuple[Advice, ...]:
        """Return the runs that would tell the members of a class apart, as far as the effort goes."""

    def diagnosis(self, first: Self, found: Mapping[str, Any]) -> Diagnosis:
        """Return the result: what was found, completed by model, effects, pictures and warnings."""
